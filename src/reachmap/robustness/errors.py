"""Errors of bin, camera and tool: how large, drawn at random, and what they move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from reachmap._typing import FloatArray
from reachmap.core.collision.misplacement import Misplacement, MovableBodies
from reachmap.geometry import inverse_transform, transform_from_parts

SOURCES = ("bin", "camera", "tool")


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorSize:
    """Size of a pose error.

    Attributes
    ----------
    shift_m, turn_rad : float
        In whatever direction, about whatever axis.
    """

    shift_m: float = 0.0
    turn_rad: float = 0.0

    def moves_m(self, reach_m: float) -> float:
        """Furthest that it moves a point this far from the centre of the turn [m]."""
        turn = min(self.turn_rad, np.pi)
        return float(self.shift_m + 2.0 * np.sin(turn / 2.0) * reach_m)

    def scaled(self, scale: float) -> ErrorSize:
        """Shift and turn times a factor."""
        return ErrorSize(shift_m=scale * self.shift_m, turn_rad=scale * self.turn_rad)


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """Sizes of the errors of a cell.

    Attributes
    ----------
    bin : ErrorSize
        The bin stands elsewhere, turned about its own origin.
    camera : ErrorSize
        The camera is elsewhere than the calibration says, turned about its optical
        centre, and with it the bin that is seen from there.
    tool : ErrorSize
        The tool is mounted askew, turned about the frame that it is mounted to.
    """

    bin: ErrorSize = ErrorSize()
    camera: ErrorSize = ErrorSize()
    tool: ErrorSize = ErrorSize()

    def scaled(self, scale: float) -> Errors:
        """All shifts and turns times a factor."""
        return Errors(
            bin=self.bin.scaled(scale),
            camera=self.camera.scaled(scale),
            tool=self.tool.scaled(scale),
        )


def unit_errors(count: int, seed: int) -> FloatArray:
    """Random directions of errors in antithetic pairs.

    Returns
    -------
    array, shape (count, 3, 2, 3)
        Sample, source (bin, camera, tool), shift and axis of the turn: unit vectors.
    """
    rng = np.random.default_rng(seed)
    half = rng.normal(size=(-(-count // 2), len(SOURCES), 2, 3))
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    # The effect of an error is nearly linear, so pairs cancel most of the variance.
    return np.stack([half, -half], axis=1).reshape(-1, *half.shape[1:])[:count]


def misplacement(
    errors: Errors,
    unit: FloatArray,
    T_base_bin: FloatArray,
    T_base_camera: FloatArray | None,
) -> Misplacement:
    """Misplacement caused by errors of given directions.

    Parameters
    ----------
    errors : Errors
    unit : array, shape (3, 2, 3)
        Of one sample, see :func:`unit_errors`.
    T_base_bin : array, shape (4, 4)
        Where the cell has the bin.
    T_base_camera : array, shape (4, 4), or None
        Where the calibration has the camera; None for no camera.
    """
    T_bin, T_camera, T_tool = (
        _transform(getattr(errors, name), unit[k]) for k, name in enumerate(SOURCES)
    )
    T_moved = T_base_bin @ T_bin
    if T_base_camera is not None:
        T_moved = T_base_camera @ T_camera @ inverse_transform(T_base_camera) @ T_moved
    return Misplacement(T_base_bin=T_moved, T_mount_tool=T_tool)


def _transform(size: ErrorSize, unit: FloatArray) -> FloatArray:
    R = Rotation.from_rotvec(size.turn_rad * unit[1]).as_matrix()
    return transform_from_parts(R, size.shift_m * unit[0])


def moved_m(
    errors: Errors,
    bodies: MovableBodies,
    T_base_bin: FloatArray,
    T_base_camera: FloatArray | None,
) -> tuple[float, float]:
    """How far errors of these sizes move a point of the bin, and of the tool [m].

    No direction of them moves any point further.
    """
    bin_m = errors.bin.moves_m(bodies.bin_reach_m(T_base_bin))
    if T_base_camera is not None:
        bin_m += errors.camera.moves_m(bodies.bin_reach_m(T_base_camera) + bin_m)
    return bin_m, errors.tool.moves_m(bodies.tool_reach_m())
