"""Inspection of a clicked test frame: its configuration, and what blocks it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.scene import Scene
from reachmap.geometry import rotation_from_quaternion_wxyz, transform_from_parts
from reachmap.maps.records import Status
from reachmap.maps.summary.statistics import STATUS_NAMES
from reachmap.view.points import MapPoints

# The most useful state to show first, of the frames at a point.
ORDER = (
    Status.PATH_FOUND,
    Status.NO_PATH_FOUND,
    Status.APPROACH_BLOCKED,
    Status.IK_IN_COLLISION,
    Status.NO_IK,
    Status.ERROR,
    Status.NOT_ATTEMPTED,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """A test frame, and how the arm would be there.

    Attributes
    ----------
    T_base_tcp : array, shape (4, 4)
    status : Status
    configuration : array, shape (dof,), or None
        None where the pose has no solution [rad].
    blocking : tuple of str
        Names of the two bodies in contact, or none.
    path : int
        Row of a stored path, -1 for none.
    """

    T_base_tcp: FloatArray
    status: Status
    configuration: FloatArray | None = None
    blocking: tuple[str, ...] = ()
    path: int = -1

    @property
    def text(self) -> str:
        """The state, and the bodies in the way."""
        said = STATUS_NAMES[self.status]
        if not self.blocking:
            return said
        return f"{said}: {' touches '.join(self.blocking)}"


def best_first(points: MapPoints, point: int) -> list[int]:
    """Test frames at a point, those with a path first."""
    frames = points.frames
    if frames is None:
        return []
    rows = points.frames_at(point).tolist()
    return sorted(rows, key=lambda row: ORDER.index(Status(int(frames.status[row]))))


def answer(
    points: MapPoints, row: int, body_pairs: tuple[str, ...], scene: Scene | None
) -> Answer:
    """Show one test frame.

    The stored goal is shown where there is one. Where every solution collides none is
    stored, so the solution with the fewest contacts is found again, which is the one
    whose pair the map names.

    Parameters
    ----------
    points : MapPoints
    row : int
        Of its test frames.
    body_pairs : tuple of str
        Of the map.
    scene : Scene or None
        Where to solve again; without it only what is stored is shown.
    """
    frames = points.frames
    assert frames is not None
    R = rotation_from_quaternion_wxyz(frames.quaternion_wxyz[row])
    T = transform_from_parts(R, points.position[frames.point[row]])
    status = Status(int(frames.status[row]))
    pair = int(frames.pair[row])
    blocking = tuple(body_pairs[pair].split(" | ")) if pair >= 0 else ()
    q: FloatArray | None = frames.goal[row]
    if np.isnan(frames.goal[row]).any():
        q = None if scene is None or not frames.solved[row] else _solve(scene, T)
    return Answer(
        T_base_tcp=T,
        status=status,
        configuration=q,
        blocking=blocking,
        path=int(frames.path[row]),
    )


def _solve(scene: Scene, T: FloatArray) -> FloatArray | None:
    """Find the solution with the fewest pairs in contact; of equals, near the scan."""
    Q = scene.kinematics.solve(T)
    if not len(Q):
        return None
    contacts = [len(scene.checker.touching_pairs(q)) for q in Q]
    far = np.linalg.norm(Q - scene.scan_configuration, axis=1)
    return np.asarray(Q[int(np.lexsort((far, contacts))[0])])
