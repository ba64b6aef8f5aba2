"""Rigid transforms as NumPy arrays: rotations, quaternions, angles.

Poses are 4×4 homogeneous matrices named ``T_<to>_<from>``: ``T_a_b`` maps points
given in frame b into frame a. Quaternions are ``wxyz``, unit, with ``w >= 0``.

The few conversions are written out, as importing scipy's takes longer than ranking.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reachmap._typing import FloatArray

AXES: dict[str, tuple[int, float]] = {
    f"{sign}{name}": (index, 1.0 if sign == "+" else -1.0)
    for index, name in enumerate("xyz")
    for sign in "+-"
}

# A frame that leans less than this stands upright; of two axes that lie equally flat
# within TIE the first counts; what is as near to a whole number as DUST is that.
UPRIGHT_RAD, TIE, DUST = 1e-9, 1e-6, 1e-12


def transform_from_parts(R: npt.ArrayLike, p: npt.ArrayLike) -> FloatArray:
    """Assemble homogeneous matrices.

    Parameters
    ----------
    R : array, shape (..., 3, 3)
    p : array, shape (..., 3)
        Translation [m].

    Returns
    -------
    array, shape (..., 4, 4)
    """
    R, p = np.asarray(R, float), np.asarray(p, float)
    shape = np.broadcast_shapes(R.shape[:-2], p.shape[:-1])
    T = np.zeros((*shape, 4, 4))
    T[..., :3, :3] = R
    T[..., :3, 3] = p
    T[..., 3, 3] = 1.0
    return T


def axis_vector(axis: str) -> FloatArray:
    """Unit vector of a signed axis, shape (3,).

    >>> axis_vector("-z").tolist()
    [0.0, 0.0, -1.0]
    """
    column, sign = AXES[axis]
    vector = np.zeros(3)
    vector[column] = sign
    return vector


def approach_directions(R: FloatArray, approach_axis: str) -> FloatArray:
    """Where the tool points: (..., 3, 3) orientations to (..., 3) unit vectors."""
    axis, sign = AXES[approach_axis]
    return np.asarray(sign * R[..., :, axis])


def axis_rotations(axis: str, angles_rad: FloatArray) -> FloatArray:
    """Rotations about a signed axis, shape (n, 3, 3).

    Parameters
    ----------
    axis : str
        As in ``"-z"``.
    angles_rad : array, shape (n,)
    """
    column, sign = AXES[axis]
    after, last = (column + 1) % 3, (column + 2) % 3
    cosine, sine = np.cos(angles_rad), sign * np.sin(angles_rad)
    R = np.tile(np.eye(3), (len(angles_rad), 1, 1))
    R[:, after, after], R[:, last, last] = cosine, cosine
    R[:, last, after], R[:, after, last] = sine, -sine
    return R


def axis_turns(axis: str, angles_rad: FloatArray) -> FloatArray:
    """:func:`axis_rotations` as transforms, shape (n, 4, 4)."""
    return transform_from_parts(axis_rotations(axis, angles_rad), np.zeros(3))


def transform_points(T: FloatArray, points: FloatArray) -> FloatArray:
    """Points (..., 3) of a frame in another one, by its pose T there, (4, 4)."""
    return np.asarray(points @ T[:3, :3].T + T[:3, 3])


def inverse_transform(T: FloatArray) -> FloatArray:
    """Invert rigid transforms, shape (..., 4, 4)."""
    R_t = np.swapaxes(T[..., :3, :3], -1, -2)
    return transform_from_parts(R_t, -(R_t @ T[..., :3, 3:4])[..., 0])


def rotation_from_rpy_deg(rpy_deg: npt.ArrayLike) -> FloatArray:
    """Roll, pitch, yaw [deg] about fixed x, y, z (the URDF order), (..., 3, 3)."""
    angles = np.radians(np.asarray(rpy_deg, float))
    (cr, cp, cy), (sr, sp, sy) = (
        np.moveaxis(values, -1, 0) for values in (np.cos(angles), np.sin(angles))
    )
    R = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return np.moveaxis(np.array(R), (0, 1), (-2, -1))


def rotation_from_quaternion_wxyz(quaternion: npt.ArrayLike) -> FloatArray:
    """Rotation matrices of quaternions ``wxyz`` of any length, (..., 4) to (..., 3, 3).

    Raises
    ------
    ValueError
        A quaternion is zero.
    """
    q = np.asarray(quaternion, float)
    length = np.linalg.norm(q, axis=-1, keepdims=True)
    if not (length > 0).all():
        raise ValueError("a quaternion of length 0 is not a rotation")
    w, x, y, z = np.moveaxis(q / length, -1, 0)
    R = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(R), (0, 1), (-2, -1))


def quaternion_wxyz_from_rotation(R: npt.ArrayLike) -> FloatArray:
    """Unit quaternions ``wxyz``, (..., 3, 3) to (..., 4).

    ``w >= 0``; of a half turn, the first coordinate that is not 0 is positive. The
    entries of R give the matrix 4 q qᵀ; its row with the largest diagonal element is q
    up to scale, without cancellation.
    """
    R = np.asarray(R, float)
    m = R.reshape(-1, 3, 3)
    outer = np.empty((len(m), 4, 4))
    xx, yy, zz = m[:, 0, 0], m[:, 1, 1], m[:, 2, 2]
    for k, diagonal in enumerate(
        (1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz)
    ):
        outer[:, k, k] = diagonal
    for j, i in ((0, 1), (0, 2), (1, 2)):
        k = 3 - i - j
        outer[:, i + 1, j + 1] = outer[:, j + 1, i + 1] = m[:, i, j] + m[:, j, i]
        sign = 1.0 if k != 1 else -1.0
        outer[:, 0, k + 1] = outer[:, k + 1, 0] = sign * (m[:, i, j] - m[:, j, i])
    rows = np.arange(len(m))
    q = outer[rows, np.argmax(np.diagonal(outer, axis1=1, axis2=2), axis=1)]
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    first = q[rows, np.argmax(q != 0.0, axis=1)]
    q = np.where(first[:, None] < 0, -q, q) + 0.0
    return np.asarray(q.reshape(*R.shape[:-2], 4))


def nearest_rotation(R: npt.ArrayLike) -> FloatArray:
    """Rotations nearest to matrices that are some but for rounding, (..., 3, 3).

    The orthogonal factor of the polar decomposition.
    """
    U, _, V_t = np.linalg.svd(np.asarray(R, float))
    return np.asarray(U @ V_t)


def rotation_angle(R_a: FloatArray, R_b: FloatArray) -> FloatArray:
    """Angle of the rotation between two orientations [rad], in [0, π].

    This is φ2 = ‖log(R_a R_bᵀ)‖, Eq. (3) of the paper. The half-angle form by
    ``atan2`` keeps full precision near 0 and near π, where ``acos`` loses half
    the digits.

    Parameters
    ----------
    R_a, R_b : array, shape (..., 3, 3)

    Returns
    -------
    array, shape (...)
    """
    difference = R_a - R_b
    total = R_a + R_b
    # ‖A − B‖_F = 2√2 sin(θ/2); ‖A + B‖²_F = 4 + 8 cos²(θ/2).
    sine = np.linalg.norm(difference, axis=(-2, -1)) / np.sqrt(8.0)
    cosine_sq = (np.linalg.norm(total, axis=(-2, -1)) ** 2 - 4.0) / 8.0
    return np.asarray(2.0 * np.arctan2(sine, np.sqrt(np.maximum(cosine_sq, 0.0))))


def direction_angle(a: FloatArray, b: FloatArray) -> FloatArray:
    """Angle between unit vectors [rad], (..., 3) and (..., 3) to (...)."""
    chord = np.linalg.norm(a - b, axis=-1)
    total = np.linalg.norm(a + b, axis=-1)
    return np.asarray(2.0 * np.arctan2(chord, total))


def upright_rotation(R_world_frame: FloatArray) -> FloatArray:
    """Rotation that turns a frame upright in the world, keeping its heading.

    The upright frame has z along the world's vertical. Its x axis is the horizontal
    direction of the frame's own x, or square to that of its y where y lies flatter: a
    frame tipped about one of its axes keeps that axis. Turning the frame about the
    vertical turns the upright frame with it.

    Parameters
    ----------
    R_world_frame : array, shape (3, 3)

    Returns
    -------
    array, shape (3, 3)
        R_frame_upright; exactly the identity where the frame stands upright.
    """
    R = np.asarray(R_world_frame, float)
    if np.hypot(R[0, 2], R[1, 2]) < UPRIGHT_RAD and R[2, 2] > 0:
        return np.eye(3)
    flat_x, flat_y = np.hypot(R[0, :2], R[1, :2])
    if flat_x >= flat_y - TIE:
        heading = np.arctan2(R[1, 0], R[0, 0])
    else:
        heading = np.arctan2(-R[0, 1], R[1, 1])
    c, s = np.cos(heading), np.sin(heading)
    upright = R.T @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    # sin(180 deg) is 1e-16 in floating point; axes that coincide should do so exactly.
    whole = np.round(upright)
    clean = np.where(np.abs(upright - whole) < DUST, whole, upright)
    return np.asarray(clean + 0.0)


def tilt_rad(R_world_frame: FloatArray) -> float:
    """Angle between a frame's z axis and the world's vertical [rad]."""
    x, y, z = R_world_frame[:, 2]
    return float(np.arctan2(np.hypot(x, y), z))


def yaw_transform(x: float, y: float, z: float, yaw_rad: float) -> FloatArray:
    """Pose with a translation [m] and a rotation about z [rad], (4, 4)."""
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return transform_from_parts(R, np.array([x, y, z]))


def pieces(path: FloatArray, longest: float) -> FloatArray:
    """Points of a polyline and points between them, no further apart than ``longest``.

    Parameters
    ----------
    path : array, shape (n, k)
    longest : float
        In the unit of the path.

    Returns
    -------
    array, shape (m, k)
        The points of the path are among them.
    """
    parts = [path[:1]]
    for q_from, q_to in zip(path[:-1], path[1:], strict=True):
        count = max(1, int(np.ceil(np.linalg.norm(q_to - q_from) / longest)))
        shares = np.arange(1, count + 1)[:, None] / count
        parts.append(q_from + shares * (q_to - q_from))
    return np.vstack(parts)


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
