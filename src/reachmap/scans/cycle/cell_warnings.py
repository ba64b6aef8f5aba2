"""Warnings about a cell's pick cycle before any scan."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reachmap.errors import SceneError
from reachmap.scans.cycle.part_fit import require_room_for_part
from reachmap.scans.cycle.places import ways_to_place
from reachmap.scans.cycle.scenes import CycleScenes

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell


def cycle_warnings(loaded: LoadedCell) -> list[str]:
    """Warnings about a part that does not fit, and drop-offs that are out of reach."""
    scenes = CycleScenes.of(loaded)
    if scenes is None:
        return []
    try:
        scenes.home()
        require_room_for_part(scenes)
    except SceneError as error:
        return list(error.lines)
    return drop_off_warnings(scenes)


def drop_off_warnings(scenes: CycleScenes) -> list[str]:
    """Warnings about drop-offs at which nothing can be put down."""
    loaded = scenes.empty.loaded
    warnings = []
    for spec in loaded.cell.drop_offs:
        ways, pair = ways_to_place(scenes, spec)
        if not ways:
            cause = pair or "out of reach, or the straight approach is"
            warnings.append(
                f"{loaded.source}: drop_off: nothing can be put down at "
                f"{spec.name!r} ({cause})"
            )
    return warnings
