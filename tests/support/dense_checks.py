"""Dense collision checks on the original meshes, apart from the program's own."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from reachmap._typing import FloatArray
from reachmap.core.collision.bodies import build_geometry
from reachmap.core.scene import Scene


class DenseCheck:
    """Checks motions of a scene by Pinocchio alone, in small even steps.

    ``share`` of the verification distance is what no point of the robot exceeds
    between two steps.
    """

    def __init__(self, scene: Scene, margin_m: float, share: float = 1 / 3) -> None:
        bodies = build_geometry(scene.robot, scene.loaded, with_bin=scene.with_bin)
        self._model, self._geometry = scene.robot.model, bodies.geometry
        self._data = self._model.createData()
        self._placed = self._geometry.createData()
        for request in self._placed.collisionRequests:
            request.security_margin = margin_m
        self._reach_m = scene.checker.reach_m
        self._step_m = share * scene.motions.verification_distance_m

    def is_free(self, q_from: FloatArray, q_to: FloatArray) -> bool:
        """Whether a straight joint motion is free."""
        change = q_to - q_from
        count = max(1, int(np.ceil(np.abs(change) @ self._reach_m / self._step_m)))
        return not any(
            pin.computeCollisions(
                self._model,
                self._data,
                self._geometry,
                self._placed,
                q_from + k / count * change,
                True,
            )
            for k in range(count + 1)
        )

    def path_is_free(self, path: FloatArray) -> bool:
        """Whether every segment of a path (n, dof) is free."""
        return all(self.is_free(a, b) for a, b in zip(path[:-1], path[1:], strict=True))


def dense_free(
    scene: Scene,
    q_from: FloatArray,
    q_to: FloatArray,
    *,
    margin_m: float,
    share: float = 1 / 3,
) -> bool:
    """Whether a motion is free at a share of the verification distance."""
    return DenseCheck(scene, margin_m, share).is_free(q_from, q_to)
