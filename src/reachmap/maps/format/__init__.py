"""The layout of each artefact, its checks, and the way from and to records."""
