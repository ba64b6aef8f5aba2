"""Bin poses scored exactly, by mapping test grasps of each."""
