"""The probability that a grasp is reached: from the test grasps around it, calibrated.

The share reached among the orientations near the grasp's own, weighted by a von
Mises-Fisher kernel, is interpolated linearly between the test points around it. Beyond
what the map knows the estimate fades into the share reached in the whole map.

A validation of the map says how often grasps were reached where the map reaches such a
share around them; the curve through that is kept beside the map, for this map alone.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any, Final

import numpy as np

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.disk import is_file, is_folder, is_there
from reachmap.errors import MapFileError
from reachmap.geometry import direction_angle, transform_points
from reachmap.maps.parts import freeze
from reachmap.maps.records import Stamp
from reachmap.ranking.lookup.matching import Queries, products
from reachmap.ranking.lookup.table import SAME_AXIS_RAD, GraspTable

logger = logging.getLogger(__name__)

FORMAT: Final = "reachmap.calibration"
FORMAT_VERSION: Final = "1.0"
# A thousand times what a calibration by a thousand grasps takes.
MAX_BYTES: Final = 16 * 2**20

# Width of the kernel in spacings of the orientations: a grasp halfway between two of
# them listens to both, one on an orientation hardly to its neighbours.
KERNEL_STEPS: Final = 0.4
# What the whole map counts beside the surroundings, so that no share is exactly 0 or 1.
MAP_WEIGHT: Final = 0.02


class Surroundings:
    """The test grasps of a map as a field that can be evaluated anywhere.

    Parameters
    ----------
    table : GraspTable
    """

    def __init__(self, table: GraspTable) -> None:
        self._table = table
        lattice = table.bin_points.reshape(*table.shape[:3], 3)
        self._coordinates = (table.layers_m, lattice[0, :, 0, 1], lattice[0, 0, :, 0])
        reached = table.reachable.astype(float)
        axes, any_roll = table.axes, reached
        if table.same_everywhere:
            first, group = _directions(table.axes[0])
            axes = table.axes[:1, first]
            any_roll = np.zeros((len(reached), len(first)))
            np.maximum.at(any_roll.T, group, reached.T)
        self._free = (axes, any_roll)
        self._fixed = (table.distinct(table.quaternions), reached)

    def share_reached(self, queries: Queries) -> FloatArray:
        """Estimate of the share reached around each grasp, in (0, 1); shape (n,).

        Parameters
        ----------
        queries : Queries
            Where the roll is free, a direction counts as reached if one roll is.
        """
        free = queries.free
        if free.all():
            return self._share(queries.points, queries.axes, free=True)
        if not free.any():
            return self._share(queries.points, queries.quaternions, free=False)
        share = np.empty(len(queries))
        share[free] = self._share(queries.points[free], queries.axes[free], free=True)
        share[~free] = self._share(
            queries.points[~free], queries.quaternions[~free], free=False
        )
        return share

    def _share(
        self, points: FloatArray, vectors: FloatArray, *, free: bool
    ) -> FloatArray:
        stored, reached = self._free if free else self._fixed
        spacing = float(self._table.spacing_rad[0 if free else 1])
        corners, weights, far = self._corners(points)
        share, nearest = np.zeros(len(points)), np.full(len(points), -1.0)
        kernel: FloatArray | None = None
        for corner, weight in zip(corners, weights, strict=True):
            if kernel is None or len(stored) > 1:
                kernel, best = orientation_kernel(
                    vectors, stored, corner, KERNEL_STEPS * spacing, free=free
                )
                kernel /= kernel.sum(axis=1, keepdims=True)
                np.maximum(nearest, best, out=nearest)
            share += weight * np.einsum("ng,ng->n", kernel, reached[corner])
        turned = np.arccos(np.clip(nearest, -1.0, 1.0)) / spacing
        far = far + np.maximum(turned - 0.5, 0.0) ** 2
        trust = (1.0 - MAP_WEIGHT) * np.exp(-0.5 * far)
        estimate = trust * share + (1.0 - trust) * reached.mean()
        # Rounding may leave weights a little above 1 in sum.
        return np.asarray(np.clip(estimate, 0.0, 1.0))

    def _corners(
        self, points: FloatArray
    ) -> tuple[list[IntArray], list[FloatArray], FloatArray]:
        """Test points around each grasp, their weights, and how far off they are.

        The last is the square of the distance beyond the outermost points, in pitches.
        """
        table = self._table
        p = transform_points(table.T_bin_base, points)
        pitches = (
            float(table.pitch_m.max()),
            float(table.pitch_m[1]),
            table.pitch_m[0],
        )
        low, share, far = [], [], np.zeros(len(p))
        for axis, at, pitch in zip((2, 1, 0), self._coordinates, pitches, strict=True):
            value = p[:, axis]
            inside = np.clip(value, at[0], at[-1])
            far += ((value - inside) / pitch) ** 2
            k = np.clip(np.searchsorted(at, inside) - 1, 0, max(len(at) - 2, 0))
            low.append(k)
            step = at[np.minimum(k + 1, len(at) - 1)] - at[k]
            share.append((inside - at[k]) / np.where(step > 0, step, 1.0))
        corners, weights = [], []
        sides = [(0, 1) if len(at) > 1 else (0,) for at in self._coordinates]
        for upper in product(*sides):
            place = [k + one for k, one in zip(low, upper, strict=True)]
            corners.append(np.ravel_multi_index(place, table.shape[:3]))
            parts = [s if one else 1.0 - s for s, one in zip(share, upper, strict=True)]
            weights.append(np.prod(parts, axis=0))
        return corners, weights, far


def _directions(axes: FloatArray) -> tuple[IntArray, IntArray]:
    """First orientation of each approach direction, and the direction of each."""
    same: BoolArray = direction_angle(axes[:, None], axes[None]) < SAME_AXIS_RAD
    first, group = np.unique(np.argmax(same, axis=1), return_inverse=True)
    return first, group


def orientation_kernel(
    vectors: FloatArray,
    stored: FloatArray,
    point: IntArray,
    width_rad: float,
    *,
    free: bool,
) -> tuple[FloatArray, FloatArray]:
    """Weigh the orientations of test points by how like those of grasps they are.

    Parameters
    ----------
    vectors : array, shape (n, k)
        Unit approach axes, or unit quaternions.
    stored : array, shape (points, g, k)
        Those of the test grasps; of one point where all points have the same.
    point : int array, shape (n,)
    width_rad : float
    free : bool
        Whether the vectors are axes.

    Returns
    -------
    kernel : array, shape (n, g)
        Von Mises-Fisher kernel of φ2, 1 for the most alike.
    nearest : array, shape (n,)
        Cosine of φ2 of the most alike.
    """
    dots = products(vectors, stored, point)
    # Between quaternions the product is the cosine of half the angle.
    cosine = dots if free else 2.0 * dots**2 - 1.0
    nearest = cosine.max(axis=1)
    return np.exp((cosine - nearest[:, None]) / width_rad**2), nearest


class AnotherMapError(MapFileError):
    """A calibration was made for another map."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Calibration:
    """A curve that rises, from the share reached around a grasp to a probability.

    Attributes
    ----------
    map_sha256 : str
        Content hash of the map it was made for.
    share, probability : array, shape (k,)
        Knots; linear between them, constant beyond.
    grasps, reached : int
        What it was made from.
    error : float
        Calibration error, each grasp judged by a curve made from the others.
    origin : mapping
        How the grasps were planned to.
    """

    map_sha256: str
    share: FloatArray
    probability: FloatArray
    grasps: int
    reached: int
    error: float
    origin: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        freeze(self)

    def __call__(self, share: FloatArray) -> FloatArray:
        """Probability of being reached, shape as given."""
        return np.interp(share, self.share, self.probability)

    def document(self) -> dict[str, Any]:
        """Everything as JSON values."""
        return {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            "map_sha256": self.map_sha256,
            "grasps": self.grasps,
            "reached": self.reached,
            "error": self.error,
            "share": self.share.tolist(),
            "probability": self.probability.tolist(),
            "origin": dict(self.origin),
        }


def calibration_beside(map_path: str | Path) -> Path:
    """Name of the calibration that belongs to a map: ``bin.calibration.json``."""
    path = Path(map_path)
    return path.parent / f"{path.stem}.calibration.json"


def usual_calibration(map_path: str | Path, stamp: Stamp) -> Calibration | None:
    """Calibration beside a map, None where there is none for this map.

    One that was made for another map, a scan that has been repeated for instance, is
    passed over with a warning.
    """
    path = calibration_beside(map_path)
    if not is_there(path):
        return None
    try:
        return read_calibration(path, stamp.content_sha256)
    except AnotherMapError as error:
        logger.warning("%s; probabilities are not calibrated", error)
        return None


def read_calibration(path: str | Path, map_sha256: str) -> Calibration:
    """Read the calibration of a map.

    Parameters
    ----------
    path : path
    map_sha256 : str
        Content hash of the map that it must have been made for.

    Raises
    ------
    MapFileError
        The file is none, is damaged, or was made for another map.
    """
    path = Path(path)
    if is_there(path) and not (is_file(path) or is_folder(path)):
        raise MapFileError(f"{path}: is not a regular file")
    try:
        with path.open("rb") as stream:
            document = json.loads(stream.read(MAX_BYTES))
    except OSError as error:
        raise MapFileError(f"{path}: cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError):
        raise MapFileError(f"{path}: not valid JSON") from None
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise MapFileError(f"{path}: expected a file of the format {FORMAT}")
    version = str(document.get("format_version"))
    if not version.startswith("1."):
        raise MapFileError(f"{path}: format_version {version[:12]} is not 1.N")
    if document.get("map_sha256") != map_sha256:
        raise AnotherMapError(
            f"{path}: was made for the map {str(document.get('map_sha256'))[:12]}, not "
            f"for {map_sha256[:12]}; make a new one with reachmap validate --calibrate"
        )
    try:
        return _calibration(document)
    except (KeyError, TypeError, ValueError, OverflowError):
        raise MapFileError(
            f"{path}: share and probability must be rising numbers from 0 to 1 "
            "of equal count"
        ) from None


def _calibration(document: Mapping[str, Any]) -> Calibration:
    share, probability = (
        np.array(document[name], float) for name in ("share", "probability")
    )
    known = np.concatenate([share, probability])
    if not (
        share.ndim == 1
        and 0 < len(share) == len(probability)
        and ((known >= 0) & (known <= 1)).all()
        and (np.diff(share) > 0).all()
        and (np.diff(probability) >= 0).all()
    ):
        raise ValueError
    return Calibration(
        map_sha256=str(document["map_sha256"]),
        share=share,
        probability=probability,
        grasps=int(document["grasps"]),
        reached=int(document["reached"]),
        error=float(document["error"]),
        origin=dict(document["origin"]),
    )
