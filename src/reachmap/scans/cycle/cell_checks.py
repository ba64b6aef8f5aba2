"""Checks of the pick cycle before any scan: the part fits, drop-offs are in reach."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.cell.model.robot import LISTED
from reachmap.core.collision.bodies import LAIN_ON, ROOT, parts_of_bin
from reachmap.core.collision.shapes import coal_shape
from reachmap.core.collision.static_bodies import PlacedBodies, PlacedBody
from reachmap.errors import SceneError
from reachmap.geometry import inverse_transform, transform_from_parts
from reachmap.sampling.frames import bin_test_frames
from reachmap.scans.cycle.places import ways_to_place
from reachmap.scans.cycle.scenes import CycleScenes
from reachmap.scans.rolls import RollGroups

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell


def require_room_for_part(scenes: CycleScenes) -> None:
    """Refuse a part that starts inside the bin itself at every test grasp.

    Where it does at some, the map says so for each.

    Raises
    ------
    SceneError
        A sentence that says where the part is and what may be changed.
    """
    cell, source = scenes.empty.loaded.cell, scenes.empty.loaded.source
    least_m, wall, grasps = -np.inf, "", 0
    for T_bin_tcp in _turned_grasps(scenes):
        heights = T_bin_tcp[:, 2, :3] @ scenes.part.points.T + T_bin_tcp[:, 2, 3:]
        lowest_m = heights.min(axis=1)
        above = lowest_m >= -cell.lift.contact_allowance_m
        least_m = max(least_m, float(lowest_m.max()))
        grasps = max(grasps, len(T_bin_tcp))
        if above.any():
            wall = _wall_around(scenes, T_bin_tcp, above)
            if not wall:
                return
    many = f"all {grasps} test grasps"
    if cell.tool.roll != LISTED:
        many += ", however the tool is turned"
    if not wall:
        raise SceneError(
            f"{source}: part: it starts {-1e3 * least_m:.3g} mm or more inside "
            f"the bin bottom at {many} (lift.contact_allowance_m: "
            f"{1e3 * cell.lift.contact_allowance_m:g} mm); raise bin_scan.layers, or "
            "change part.shape or part.pose"
        )
    raise SceneError(
        f"{source}: part: it starts inside a wall at {many} ({wall}, for one); "
        "change part.shape or part.pose"
    )


def _turned_grasps(scenes: CycleScenes) -> Iterator[FloatArray]:
    """Poses (n, 4, 4) of the tool in the bin at all test grasps, turn by turn."""
    cell, T_base_bin = scenes.empty.loaded.cell, scenes.empty.T_base_bin
    grid, axis = bin_test_frames(cell, T_base_bin), cell.robot.tcp.approach_axis
    T_bin_base = inverse_transform(T_base_bin)
    yield T_bin_base @ grid.T_base_tcp.reshape(-1, 4, 4)
    if cell.tool.roll == LISTED or scenes.part.is_round:
        return  # no other turn will do, or all are alike
    groups = RollGroups.of(grid.frames, axis, cell.tool)
    every = np.arange(len(groups.T))
    for turn in groups.turns:
        yield T_bin_base @ groups.turned(every, np.array([turn]), axis)


def _wall_around(scenes: CycleScenes, T_bin_tcp: FloatArray, wanted: BoolArray) -> str:
    """A wall that the part is in, "" where it is clear of all at some grasp."""
    part = scenes.part
    walls = PlacedBodies(
        PlacedBody(
            name=wall.name,
            joint=ROOT,
            shape=coal_shape(wall.shape),
            T=transform_from_parts(np.eye(3), wall.centre_m),
        )
        for wall in parts_of_bin(scenes.empty.loaded)
        if wall.name not in LAIN_ON
    )
    shape, hit = coal_shape(part.solid), -1
    for T in T_bin_tcp[wanted]:
        hit = walls.first_touched(shape, T @ part.T_tcp_part)
        if hit < 0:
            return ""
    return walls.bodies[hit].name


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
