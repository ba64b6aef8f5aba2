"""From an approach direction or another tool convention to TCP orientations."""

from __future__ import annotations

import numpy as np

from reachmap._typing import FloatArray
from reachmap.geometry import AXES, axis_vector


def rotation_between(a: FloatArray, b: FloatArray) -> FloatArray:
    """Smallest rotation that turns unit vector a into unit vector b.

    Opposite vectors have no smallest one: there the half turn is about the
    coordinate axis most nearly perpendicular to a (the first of them), made
    perpendicular.

    Parameters
    ----------
    a, b : array, shape (..., 3)

    Returns
    -------
    array, shape (..., 3, 3)
    """
    a, b = np.broadcast_arrays(np.asarray(a, float), np.asarray(b, float))
    total = a + b
    length = np.linalg.norm(total, axis=-1, keepdims=True)
    opposite = length < 1e-6
    middle = total / np.where(opposite, 1.0, length)
    middle = np.where(opposite, _perpendicular(a), middle)
    # Two half turns, about a and about the middle of a and b, make the smallest
    # rotation from a to b without dividing by 1 + a·b.
    half_turn = _half_turn(middle) @ _half_turn(a)
    return np.where(opposite[..., None], _half_turn(middle), half_turn)


def _half_turn(u: FloatArray) -> FloatArray:
    return np.asarray(2.0 * u[..., :, None] * u[..., None, :] - np.eye(3))


def _perpendicular(a: FloatArray) -> FloatArray:
    helper = np.eye(3)[np.argmin(np.abs(a), axis=-1)]
    u = helper - np.sum(helper * a, axis=-1, keepdims=True) * a
    return np.asarray(u / np.linalg.norm(u, axis=-1, keepdims=True))


def tcp_rotation(R: FloatArray, grasp_axis: str, tcp_axis: str) -> FloatArray:
    """Orientation of the TCP for a grasp whose approach is another tool axis.

    The TCP frame is turned by the smallest rotation so that its own approach axis
    takes the place of the grasp's; the axis perpendicular to both stays. From
    ``+x`` (GraspNet) to ``+z`` the y axis, along which a gripper closes, is kept.

    Parameters
    ----------
    R : array, shape (..., 3, 3)
        Orientation in the grasp's convention.
    grasp_axis, tcp_axis : str
        Signed axis names: approach axis in either convention.

    Returns
    -------
    array, shape (..., 3, 3)
        ``R`` itself when the conventions agree.
    """
    if grasp_axis == tcp_axis:
        return R
    return np.asarray(
        R @ rotation_between(axis_vector(tcp_axis), axis_vector(grasp_axis))
    )


def complete_rotation(
    directions: FloatArray, R_base_bin: FloatArray, tcp_axis: str
) -> FloatArray:
    """Orientation for a direction whose roll is to be fixed by rule.

    The upright tool of the orientation families, straight down into the bin and
    square to its sides, is turned into the direction by the smallest rotation: where
    a cone family has that direction, this is its roll 0.

    Parameters
    ----------
    directions : array, shape (n, 3)
        Unit approach directions in robot_base.
    R_base_bin : array, shape (3, 3)
    tcp_axis : str

    Returns
    -------
    array, shape (n, 3, 3)
        TCP orientations in robot_base.
    """
    # Imported here: it brings the cell's data model, which nothing else here needs.
    from reachmap.sampling.orientations import straight_down_orientation

    R_base_upright = R_base_bin @ straight_down_orientation(tcp_axis)
    return align(R_base_upright, directions, tcp_axis)


def align(R: FloatArray, directions: FloatArray, tcp_axis: str) -> FloatArray:
    """Turn orientations by the smallest rotation so that they approach exactly so.

    Parameters
    ----------
    R : array, shape (3, 3) or (n, 3, 3)
        TCP orientations, for instance those recommended by a ranking.
    directions : array, shape (n, 3)
        Unit approach directions, same frame.
    tcp_axis : str
        TCP axis that points into the object.

    Returns
    -------
    array, shape (n, 3, 3)
    """
    index, sign = AXES[tcp_axis]
    return np.asarray(rotation_between(sign * R[..., :, index], directions) @ R)
