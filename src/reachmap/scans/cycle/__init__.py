"""The cycle after the grasp: lift, transfer to a drop-off, retreat, return."""
