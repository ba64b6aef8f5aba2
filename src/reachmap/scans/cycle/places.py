"""Configurations at which the part is put down, and the return from each."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from reachmap._typing import CodeArray, FloatArray, IntArray
from reachmap.cell.model.cell import Cell, DropOffSpec
from reachmap.core.planning.approach import StraightApproach
from reachmap.geometry import axis_vector, yaw_transform
from reachmap.maps.parts import StageStatus, freeze
from reachmap.maps.records import NO_PAIR
from reachmap.runtime.progress import Progress
from reachmap.scans.cycle.connecting import connect_from, path_over
from reachmap.scans.cycle.scenes import CycleScenes
from reachmap.scans.cycle.ways import Ways
from reachmap.scans.measured import attempt_seed

# Configurations of a drop-off that are kept, those most lifts are nearest to, and how
# many lifts are asked: what is left is within a percent of the best of all.
_KEPT, _ASKED = 8, 400
# Tells the draws of this stage from those of others.
_SEED = 1 << 21
WaysToPlace = tuple[list[tuple[FloatArray, FloatArray]], str]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Places:
    """Configurations at which the part may be released.

    Attributes
    ----------
    drop_off : int array, shape (places,)
        Where in the cell's list each is.
    place : Ways
        Straight, with the part.
    retreat : Ways
        Straight, after the release.
    back : Ways
        From there to the scan configuration.
    time_s : array, shape (places, 3)
        Of these three.
    status : uint8 array, shape (drop_offs,)
        PATH_FOUND, or why none of its configurations will do: DROP_OFF_UNREACHABLE,
        RETURN_NOT_FOUND.
    blocking_pair : int array, shape (drop_offs,)
    """

    drop_off: IntArray
    place: Ways
    retreat: Ways
    back: Ways
    time_s: FloatArray
    status: CodeArray
    blocking_pair: IntArray

    def __post_init__(self) -> None:
        freeze(self)

    def payload(self) -> dict[str, Any]:
        """Their JSON payload for the journal."""
        return dataclasses.asdict(self)

    @classmethod
    def from_payload(cls, payload: Mapping[str, Any]) -> Places:
        """Undo :meth:`payload`."""
        ways = {name: Ways(**payload[name]) for name in ("place", "retreat", "back")}
        return cls(**{**payload, **ways})

    def of(self, drop_off: int) -> IntArray:
        """Rows of one drop-off."""
        return np.flatnonzero(self.drop_off == drop_off)


def find_places(
    scenes: CycleScenes,
    placing: Sequence[WaysToPlace],
    body_pairs: Sequence[str],
    lifted: FloatArray,
    progress: Progress,
) -> Places:
    """Find where the part may be released.

    Parameters
    ----------
    scenes : CycleScenes
    placing : sequence of (list, str)
        See :func:`ways_to_place`, of each drop-off.
    body_pairs : sequence of str
        As the map numbers them.
    lifted : array, shape (n, dof)
        Ends of the lifts.
    progress : Progress
    """
    dof = scenes.empty.robot.dof
    law = scenes.empty.time_law
    status, pairs = [], []
    found: list[tuple[int, FloatArray, FloatArray]] = []
    for number, (ways, pair) in enumerate(placing):
        status.append(
            StageStatus.PATH_FOUND if ways else StageStatus.DROP_OFF_UNREACHABLE
        )
        pairs.append(body_pairs.index(pair) if pair and not ways else NO_PAIR)
        found += [(number, *ways[k]) for k in _nearest(scenes, ways, lifted)]
    back = _ways_back(scenes, [retreat[-1] for *_, retreat in found], progress)
    kept = [(*entry, way) for entry, way in zip(found, back, strict=True) if len(way)]
    for number in {entry[0] for entry in found} - {entry[0] for entry in kept}:
        status[number] = StageStatus.RETURN_NOT_FOUND
    return Places(
        drop_off=np.array([entry[0] for entry in kept], np.int64),
        place=Ways.of([entry[1] for entry in kept], dof),
        retreat=Ways.of([entry[2] for entry in kept], dof),
        back=Ways.of([entry[3] for entry in kept], dof),
        time_s=np.array(
            [
                (
                    law.way_time_s(entry[1]),
                    law.way_time_s(entry[2]),
                    law.path_time_s(entry[3]),
                )
                for entry in kept
            ]
        ).reshape(-1, 3),
        status=np.array(status, np.uint8),
        blocking_pair=np.array(pairs, np.int64),
    )


def drop_off_poses(cell: Cell, spec: DropOffSpec) -> FloatArray:
    """Equivalent poses T_base_tcp of a drop-off given by a pose, (n, 4, 4)."""
    assert spec.pose is not None
    count = spec.turns(cell.tool.rolls)
    turns = [yaw_transform(0, 0, 0, 2 * np.pi * k / count) for k in range(count)]
    return np.asarray(_frame(cell, spec.frame) @ spec.pose.matrix() @ np.array(turns))


def _frame(cell: Cell, name: str) -> FloatArray:
    """Frame of a drop-off in robot_base, (4, 4)."""
    if name in ("bin", cell.bin.name):
        return cell.T_base_bin()
    if name in cell.bins:
        return cell.T_base_of(cell.bins[name])
    frames = {"world": cell.T_base_world(), "robot_base": np.eye(4)}
    if name in frames:
        return frames[name]
    body = next(body for body in cell.bodies if body.name == name)
    return np.asarray(frames[body.attach_to] @ body.pose.matrix())


def ways_to_place(scenes: CycleScenes, spec: DropOffSpec) -> WaysToPlace:
    """Straight ways in with the part and out without; or the bodies in the way."""
    scene = scenes.carried
    if spec.pose is None:
        values = scene.loaded.joint_values_rad(spec)
        q = scene.robot.configuration(values, f"drop_off {spec.name}")
        Q = np.zeros((0, len(q))) if scene.robot.outside_limits(q) else q[None]
    else:
        Q, _ = scene.kinematics.solve_many(
            drop_off_poses(scene.loaded.cell, spec),
            windings=False,
            near=scene.scan_configuration,
        )
    axis = axis_vector(scene.loaded.cell.robot.tcp.approach_axis)
    into = StraightApproach(
        scene.kinematics, scene.motions, axis, spec.approach_distance_m
    )
    out = StraightApproach(scene.kinematics, scenes.empty.motions, axis, spec.retreat_m)
    free = scene.checker.free_mask(Q)
    found = []
    pair = scene.checker.blocking_pair_of_many(Q) if not free.any() else NO_PAIR
    for q in Q[free]:
        T = scene.kinematics.forward(q)
        way, back = into.of(T, q), out.of(T, q)
        if way is None or back is None:
            continue
        way_in, way_out = into.free_and_straight(way), out.free_and_straight(back)
        if way_in is not None and way_out is not None:
            found.append((way_in, way_out[::-1]))
        elif pair == NO_PAIR:
            pair = into.blocking_pair(way)
    return found, scene.checker.body_pairs[pair] if pair != NO_PAIR else ""


def _nearest(
    scenes: CycleScenes,
    ways: Sequence[tuple[FloatArray, FloatArray]],
    lifted: FloatArray,
) -> list[int]:
    """Configurations that most lifts are nearest to, the way back counted."""
    if not ways:
        return []
    home = scenes.home()
    end = scenes.empty.scan_configuration if home is None else home
    before = np.array([way[0] for way, _ in ways])
    rest_s = scenes.least_times_s(end, np.array([back[-1] for _, back in ways]))
    step = max(1, len(lifted) // _ASKED)
    votes = np.zeros(len(ways))
    for q in lifted[::step]:
        votes[np.argmin(scenes.least_times_s(q, before) + rest_s)] += 1
    votes[np.argmin(rest_s)] += 0.5
    order = np.argsort(-votes, kind="stable")[:_KEPT]
    return [int(k) for k in order if votes[k] > 0]


def _ways_back(
    scenes: CycleScenes, Q: Sequence[FloatArray], progress: Progress
) -> list[FloatArray]:
    """Paths to the scan configuration, by way of where the arm is to return to."""
    scene, home = scenes.empty, scenes.home()
    dof, scan = scene.robot.dof, scene.scan_configuration
    none = np.zeros((0, dof))
    if not Q:
        return []
    start = scan if home is None else home
    goals = np.array(Q if home is None else [*Q, scan])
    routes = connect_from(scene, start, goals, np.arange(len(goals)), progress)
    seed = scene.loaded.cell.seed

    def path_to(row: int) -> FloatArray:
        path = path_over(scene, routes, row, goals[row], attempt_seed(seed, _SEED, row))
        return none if path is None else path

    paths = [path_to(row)[::-1] for row in range(len(Q))]
    if home is None:
        return paths
    last = path_to(len(Q))
    return [
        np.vstack([path, last[1:]]) if len(path) and len(last) else none
        for path in paths
    ]
