"""Margins of a path: distance to bodies, joint limits and singularities."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.collision.clearance import ClearanceMeter
from reachmap.core.robot.chain import SerialChain

if TYPE_CHECKING:
    from reachmap.core.scene import Scene


class PathMargins(NamedTuple):
    """Margins of one path to a grasp.

    Attributes
    ----------
    clearance_m : float
        Least distance of two bodies on the path; NaN where no pair is checked.
    clearance_pair : int
        Index into the checker's ``body_pairs``, -1 where there is none.
    joint_margin_rad : float
        Least distance of a revolute joint to its limits at the grasp and on the
        straight approach; NaN where no joint has limits.
    smallest_singular_value : float
        Of the TCP Jacobian (m and rad), least at the grasp and on the approach.
    """

    clearance_m: float
    clearance_pair: int
    joint_margin_rad: float
    smallest_singular_value: float


class MarginMeter:
    """Measures margins of paths.

    Parameters
    ----------
    scene : Scene
    """

    def __init__(self, scene: Scene) -> None:
        self._clearance = ClearanceMeter(scene.checker)
        self._robot = scene.robot
        self._chain = SerialChain.from_robot(scene.robot)

    def of_path(self, path: FloatArray, planned: int) -> PathMargins:
        """Margins of a whole path.

        Parameters
        ----------
        path : array, shape (n, dof)
            From the scan configuration to the grasp, straight approach included.
        planned : int
            Waypoints of its planned part; the approach begins at the last of them.
        """
        clearance, pair = self._clearance.of_path(path)
        approach = path[max(planned - 1, 0) :]
        return PathMargins(
            clearance_m=clearance,
            clearance_pair=pair,
            joint_margin_rad=self._joint_margin_rad(approach),
            smallest_singular_value=self._singular_value(approach),
        )

    def _joint_margin_rad(self, Q: FloatArray) -> float:
        robot = self._robot
        room = np.minimum(Q - robot.lower_rad, robot.upper_rad - Q)
        room = room[:, robot.is_revolute]
        room = room[np.isfinite(room)]
        return max(float(room.min()), 0.0) if room.size else float("nan")

    def _singular_value(self, Q: FloatArray) -> float:
        _, J = self._chain.jacobian_many(Q)
        return float(np.linalg.svd(J, compute_uv=False)[:, -1].min())
