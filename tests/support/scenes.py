"""Scenes that several tests look at, built once per process."""

from __future__ import annotations

from functools import lru_cache

from reachmap.cell.loading import read_cell
from reachmap.core.scene import Scene


@lru_cache(maxsize=8)
def scene_of(name: str, *overrides: str, with_bin: bool = True) -> Scene:
    """Scene of a shipped cell."""
    return Scene.build(read_cell(name, overrides), with_bin=with_bin)
