"""Which dimension of tool or bin would move what the tool itself cannot take."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.core.collision.bin_fit import ToolFit
from reachmap.core.collision.static_bodies import PlacedBody, box_around
from reachmap.geometry import AXES
from reachmap.placement.mapped.sample import frames_in_bin, rolled

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell
    from reachmap.core.robot.model import RobotModel

# Every dimension is changed by as much, on this many of the test grasps that are lost.
STEP_M, MOST_FRAMES = 0.02, 500
ON_AXIS_M = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class ToolLimit:
    """What the tool loses to the bin's walls, wherever the bin stands.

    Attributes
    ----------
    percent : float
        Share of the test grasps that the tool can take; no score is higher.
    body : str
        Body of the tool that is in the way most, "" where nothing is lost.
    gains : mapping of str to float
        A dimension and what :data:`STEP_M` more of it give back [points].
    """

    percent: float
    body: str
    gains: dict[str, float]


def tool_limit(robot: RobotModel, loaded: LoadedCell, is_open: BoolArray) -> ToolLimit:
    """Try the lost test grasps again with one dimension changed at a time.

    Parameters
    ----------
    robot : RobotModel
    loaded : LoadedCell
    is_open : bool array, shape (layers, y, x, orientations)
        See :func:`reachmap.placement.mapped.sample.open_frames`.
    """
    lost = np.flatnonzero(~is_open)
    percent = 100.0 * float(is_open.mean())
    if not len(lost):
        return ToolLimit(percent=percent, body="", gains={})
    rows = lost[:: max(1, -(-len(lost) // MOST_FRAMES))]
    T = frames_in_bin(loaded.cell).transforms_at(rows)
    fit, axis = ToolFit(robot, loaded), loaded.cell.robot.tcp.approach_axis
    tool = fit.bodies
    hit = fit.first_hit(T, tool)
    culprit = int(np.bincount(hit[hit >= 0], minlength=1).argmax())
    front = _front_most(tool, axis)

    def gain(T_changed: FloatArray, bodies: Sequence[PlacedBody]) -> float:
        equivalent = rolled(loaded.cell, T_changed).reshape(-1, 4, 4)
        free = fit.first_hit(equivalent, bodies) < 0
        freed = float(free.reshape(len(T), -1).any(axis=1).mean())
        return round(freed * (100.0 - percent), 2)

    gains = {f"length of {tool[front].name}": gain(T, _longer(tool, front, axis))}
    outward = _outward(tool, culprit, axis)
    if culprit != front and outward is not None:
        moved = list(tool)
        moved[culprit] = _shifted(tool[culprit], STEP_M * outward)
        gains[f"offset of {tool[culprit].name} from the tool"] = gain(T, moved)
    inward = T.copy()
    inward[:, :2, 3] -= np.sign(T[:, :2, 3]) * np.minimum(np.abs(T[:, :2, 3]), STEP_M)
    gains["distance of the grasps from the walls"] = gain(inward, tool)
    raised = T.copy()
    raised[:, 2, 3] += STEP_M
    gains["height of the grasps in the bin (a bin less deep)"] = gain(raised, tool)
    best_first = dict(sorted(gains.items(), key=lambda pair: -pair[1]))
    return ToolLimit(percent=percent, body=tool[culprit].name, gains=best_first)


def _front_most(tool: Sequence[PlacedBody], approach_axis: str) -> int:
    """The body that reaches furthest along the approach axis: tube, cup or finger."""
    axis, sign = AXES[approach_axis]

    def reach(body: PlacedBody) -> float:
        low, high = box_around(body.shape, body.T)
        return float(high[axis] if sign > 0 else -low[axis])

    return max(range(len(tool)), key=lambda k: reach(tool[k]))


def _longer(
    tool: Sequence[PlacedBody], front: int, approach_axis: str
) -> list[PlacedBody]:
    """The tool with its front body made longer: all that is behind it steps back."""
    axis, sign = AXES[approach_axis]
    back = np.zeros(3)
    back[axis] = -sign * STEP_M
    return [tool[front], *(_shifted(body, back) for body in tool)]


def _outward(
    tool: Sequence[PlacedBody], index: int, approach_axis: str
) -> FloatArray | None:
    """Direction from the tool's axis to a body; None for one around the axis."""
    low, high = box_around(tool[index].shape, tool[index].T)
    centre = (low + high) / 2
    centre[AXES[approach_axis][0]] = 0.0
    away = float(np.linalg.norm(centre))
    return None if away < ON_AXIS_M else np.asarray(centre / away)


def _shifted(body: PlacedBody, by: FloatArray) -> PlacedBody:
    T = body.T.copy()
    T[:3, 3] += by
    return dataclasses.replace(body, T=T)
