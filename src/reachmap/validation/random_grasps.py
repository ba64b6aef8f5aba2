"""Random grasps in the volume covered by a bin map, as a list."""

from __future__ import annotations

import numpy as np

from reachmap.errors import SettingsError
from reachmap.maps.records import BinMap
from reachmap.ranking.lists.arrays import GraspList
from reachmap.ranking.lists.document import FORMAT
from reachmap.ranking.lists.reading import grasps_from_document
from reachmap.ranking.lookup.table import GraspTable, table_from_bin_map
from reachmap.sampling.volume import GraspVolume

# The limit of grasp lists as well.
MAX_RANDOM = 100_000


def random_grasps(bin_map: BinMap, count: int, seed: int) -> GraspList:
    """Directions into the bin, uniform over the mapped volume and approach cone.

    Points lie between the outermost test points sideways: nearer to a wall the map
    extrapolates. In height they fill what the layers stand for: half a step below the
    lowest to half a step above the highest; with a single layer, half the grid's
    larger pitch either way. Directions are uniform over the sphere between the least
    and the greatest tilt of the map's orientations.

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
    volume = mapped_volume(table_from_bin_map(bin_map))
    points, directions = volume.draw(np.random.default_rng(seed), count)
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


def mapped_volume(table: GraspTable) -> GraspVolume:
    """The volume covered by the test grasps of a map."""
    return GraspVolume.of(
        table.bin_points,
        table.layers_m,
        float(table.pitch_m.max()),
        table.axes.reshape(-1, 3) @ table.T_base_bin[:3, :3],
    )
