"""Write the golden files of the current format version into tests/maps/format/golden.

Run once when a format version is new, from the root of the checkout::

    python -m tests.support.write_golden

Files of older versions stay as they are: they prove that old maps can be read.
"""

from __future__ import annotations

import gzip
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from reachmap.maps import write_bin_map, write_placement, write_workspace_map
from reachmap.maps.format.layout import FORMAT_VERSION
from tests.support.synthetic_maps import (
    synthetic_bin_map,
    synthetic_placement,
    synthetic_provenance,
    synthetic_workspace_map,
)
from tests.support.synthetic_parts import (
    bin_with_parts,
    placement_with_parts,
    workspace_with_parts,
)

GOLDEN = Path(__file__).parents[1] / "maps" / "format" / "golden"


def main() -> None:
    """Write the three files, compressed without a time stamp."""
    provenance = synthetic_provenance(
        cell_yaml="format: reachmap.cell\n", cell_resolved_json="{}"
    )
    fractions = np.array([[[0.0, 0.5], [1.0, 0.25], [0.75, 0.0]]])
    workspace = synthetic_workspace_map(fractions, shared_row=1)
    bin_map = synthetic_bin_map(0.5, shape=(1, 2, 3, 2, 2))
    records: dict[str, tuple[Any, Any]] = {
        "workspace": (write_workspace_map, workspace_with_parts(workspace)),
        "bin": (write_bin_map, bin_with_parts(bin_map)),
        "placement": (write_placement, placement_with_parts(synthetic_placement())),
    }
    for name, (write, record) in records.items():
        object.__setattr__(record, "provenance", provenance)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"{name}.h5"
            write(path, record)
            target = GOLDEN / f"{name}-{FORMAT_VERSION}.h5.gz"
            target.write_bytes(gzip.compress(path.read_bytes(), 9, mtime=0))


if __name__ == "__main__":
    main()
