"""From the share reached around a grasp to the probability that it is reached.

A validation of the map says how often grasps were reached where the map reaches such a
share around them; the curve through that is kept beside the map, for this map alone.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from reachmap._typing import FloatArray
from reachmap.disk import is_file, is_folder, is_there
from reachmap.errors import MapFileError
from reachmap.maps.parts import freeze
from reachmap.maps.records import Stamp

logger = logging.getLogger(__name__)

FORMAT: Final = "reachmap.calibration"
FORMAT_VERSION: Final = "1.0"
# A thousand times what a calibration by a thousand grasps takes.
MAX_BYTES: Final = 16 * 2**20


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
    return Path(map_path).with_suffix(".calibration.json")


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
