"""Grasps anywhere in the volume that a bin map stands for, as a list."""

from __future__ import annotations

import numpy as np

from reachmap._typing import FloatArray
from reachmap.errors import SettingsError
from reachmap.maps.records import BinMap
from reachmap.ranking.lists.arrays import GraspList
from reachmap.ranking.lists.document import FORMAT
from reachmap.ranking.lists.reading import grasps_from_document
from reachmap.ranking.lookup.table import GraspTable, table_from_bin_map

MAX_RANDOM = 100_000


def random_grasps(bin_map: BinMap, count: int, seed: int) -> GraspList:
    """Directions into the bin, uniform over the mapped volume and approach cone.

    Points lie between the outermost test points sideways: nearer to a wall the map
    extrapolates. In height they fill what the layers stand for: half a step below the
    lowest to half a step above the highest; with a single layer, half the grid's
    larger pitch either way. Directions are uniform over the sphere between the least
    and the greatest tilt of the map's orientations.

    Parameters
    ----------
    bin_map : BinMap
    count : int
    seed : int

    Returns
    -------
    GraspList
        In the frame ``bin``.

    Raises
    ------
    SettingsError
    """
    if not 1 <= count <= MAX_RANDOM:
        raise SettingsError(f"random must be 1 to {MAX_RANDOM} (got {count})")
    table = table_from_bin_map(bin_map)
    rng = np.random.default_rng(seed)
    low, high = _volume(table)
    points = rng.uniform(low, high, (count, 3))
    directions = _directions(table, rng.random((count, 2)))
    grasps = [
        {"id": f"random-{number}", "position": p, "direction": v}
        for number, (p, v) in enumerate(
            zip(points.tolist(), directions.tolist(), strict=True), start=1
        )
    ]
    document = {
        "format": FORMAT,
        "format_version": "1.0",
        "frame": "bin",
        "grasps": grasps,
    }
    return grasps_from_document(document, source=f"random {count}")


def _volume(table: GraspTable) -> tuple[FloatArray, FloatArray]:
    """Corners of the mapped volume in the bin frame [m]."""
    low, high = table.bin_points.min(axis=0), table.bin_points.max(axis=0)
    layers = table.layers
    step = float(np.diff(layers).max()) if len(layers) > 1 else float(table.pitch.max())
    low[2] = max(float(layers[0]) - step / 2, 0.0)
    high[2] = float(layers[-1]) + step / 2
    return low, high


def _directions(table: GraspTable, shares: FloatArray) -> FloatArray:
    """Unit vectors in the bin frame between the map's tilts, shape (n, 3)."""
    down = -(table.axes.reshape(-1, 3) @ table.bin_pose[:3, 2])
    cosine = down.max() - shares[:, 0] * (down.max() - down.min())
    cosine = np.clip(cosine, -1.0, 1.0)
    sine = np.sqrt(1.0 - cosine**2)
    azimuth = 2.0 * np.pi * shares[:, 1]
    return np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), -cosine], axis=1)
