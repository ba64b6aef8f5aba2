"""Sampling an arm's configurations: approach axis, touching links, view."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.kinematics.kinematics import Kinematics
from reachmap.core.robot.model import RobotModel
from reachmap.core.scene import Scene
from reachmap.geometry import approach_directions

# 2000 random configurations find a free share of 0.2 % in 98 of 100 cases.
SAMPLES = 2000
MANY = 40
# Shares of random configurations in which links touch by design, and suspiciously.
ALWAYS, OFTEN = 0.98, 0.5
# A tip this close to the last axis (as a share of the reach) is turned, not swung.
ON_AXIS = 0.03
ALONG = 0.95  # cosine of about 18 degrees


def random_configurations(arm: RobotModel) -> FloatArray:
    """Configurations spread over the joint ranges, shape (SAMPLES, dof) [rad]."""
    rng = np.random.default_rng(0)
    # Beyond half a turn an arm only winds itself up.
    half_turn = np.where(arm.is_revolute, np.pi, np.inf)
    low, high = (
        np.maximum(arm.lower_rad, -half_turn),
        np.minimum(arm.upper_rad, half_turn),
    )
    if (low > high).any():
        low, high = arm.lower_rad, arm.upper_rad
    return np.asarray(rng.uniform(low, high, (SAMPLES, arm.dof)))


def approach_axis(kinematics: Kinematics, q: FloatArray, reach_m: float) -> str | None:
    """Axis of the TCP frame along which the tool most likely points into the object.

    A last joint that turns the tool about itself shows it by its axis, pointing away
    from the joint before; one that swings the tool, by where it holds it.

    Parameters
    ----------
    kinematics : Kinematics
    q : array, shape (dof,)
        Any configuration [rad].
    reach_m : float

    Returns
    -------
    str or None
        ``+x`` … ``-z``; None where no axis of the frame is the one.
    """
    robot, last = kinematics.robot, len(q) - 1
    T = kinematics.forward(q)

    def moved(joint: int, by: float) -> FloatArray:
        step = np.zeros(len(q))
        step[joint] = by
        return kinematics.forward(q + step)

    if robot.is_revolute[last]:
        # Half a turn takes the tip to the other side of the axis.
        swung = (T[:3, 3] - moved(last, np.pi)[:3, 3]) / 2.0
        if np.linalg.norm(swung) > max(ON_AXIS * reach_m, 0.01):
            return _nearest_axis(T[:3, :3].T @ swung)
        turn = moved(last, 0.1)[:3, :3] @ T[:3, :3].T
        direction = np.array(
            [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
        )
    else:
        direction = moved(last, 0.1)[:3, 3] - T[:3, 3]
    direction /= np.linalg.norm(direction)
    for joint in reversed(range(last)):
        arm = (T[:3, 3] - moved(joint, np.pi)[:3, 3]) / 2.0
        if robot.is_revolute[joint] and abs(arm @ direction) > 0.01 * reach_m:
            return _nearest_axis(T[:3, :3].T @ (direction * np.sign(arm @ direction)))
    # All axes are parallel, as in a SCARA, which picks from above.
    return _nearest_axis(T[:3, :3].T @ (direction * (-np.sign(direction[2]) or 1.0)))


def _nearest_axis(direction: FloatArray) -> str | None:
    direction = direction / np.linalg.norm(direction)
    column = int(np.argmax(np.abs(direction)))
    if abs(direction[column]) < ALONG:
        return None
    return ("+" if direction[column] > 0 else "-") + "xyz"[column]


def touching_links(scene: Scene, Q: FloatArray) -> dict[tuple[str, str], float]:
    """Pairs of links that touch in half of the configurations, and in what share."""
    if scene.checker.free_mask(Q).mean() > 1.0 - OFTEN:
        return {}
    Q = Q[:MANY]  # finding every pair takes long
    counts = Counter(k for q in Q for k in scene.checker.touching_pairs(q))
    pairs = {}
    for index, count in sorted(counts.items()):
        first, second = scene.checker.body_pairs[index].split(" | ")
        bin_walls = [name for name in (first, second) if name.startswith("bin ")]
        if count >= OFTEN * len(Q) and not bin_walls:
            pairs[first, second] = count / len(Q)
    return pairs


def touching_notes(touching: Mapping[tuple[str, str], float]) -> list[str]:
    """Name pairs that touch suspiciously often, though not always."""
    return [
        f"{first} and {second} touch in {share:.0%} of random configurations; if the "
        "real arm's do not, disable the pair in robot.srdf"
        for (first, second), share in touching.items()
        if share < ALWAYS
    ]


def best_view(
    scene: Scene, Q: FloatArray, axis: str, reach_m: float
) -> tuple[int, float] | None:
    """Free configuration that looks down on the bin best.

    Parameters
    ----------
    scene : Scene
    Q : array, shape (n, dof)
        Candidates [rad].
    axis : str
        Axis of the TCP that looks.
    reach_m : float

    Returns
    -------
    (int, float) or None
        Row, and how far down it looks (1: straight down); None if none is free.
    """
    low, high = scene.robot.lower_rad, scene.robot.upper_rad
    rows = np.flatnonzero(((low <= Q) & (high >= Q)).all(axis=1))
    rows = rows[scene.checker.free_mask(Q[rows])]
    if not len(rows):
        return None
    T = scene.kinematics.forward_many(Q[rows])
    over = T[:, :3, 3] - scene.T_base_bin[:3, 3]
    off_centre = np.linalg.norm(over[:, :2], axis=1) / reach_m
    height = np.abs(over[:, 2] / reach_m - 0.5)
    downwards = -approach_directions(T[:, :3, :3], axis)[:, 2]
    effort = np.abs(Q[rows]).mean(axis=1) / np.pi
    best = int(np.argmax(downwards - off_centre - height - effort))
    return int(rows[best]), float(downwards[best])


def reach_of(points: FloatArray) -> float:
    """How far the TCP gets from the base axis, of positions (n, 3) [m]."""
    return max(float(np.quantile(np.linalg.norm(points[:, :2], axis=1), 0.99)), 0.05)


def as_written(robot: RobotModel, Q: FloatArray) -> FloatArray:
    """Configurations as a cell file has them: 0.1 degrees, 0.1 mm."""
    factor = np.where(robot.is_revolute, np.radians(0.1), 1e-4)
    return np.asarray(np.round(Q / factor) * factor)
