"""The folder of a finished run."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reachmap.maps import (
    read_placement,
    read_workspace_map,
    write_bin_map,
    write_placement,
    write_workspace_map,
)
from reachmap.maps.study.format import write_study
from reachmap.maps.study.record import Study
from reachmap.tools.rank import rank
from tests.studies.test_significance_of_studies import study_of
from tests.support.synthetic_maps import (
    synthetic_bin_map,
    synthetic_placement,
    synthetic_provenance,
    synthetic_workspace_map,
)

EXAMPLES = Path(__file__).parents[2] / "examples"
SHARE = {"hits": 97, "total": 100, "share": 0.97, "low": 0.92, "high": 0.99}
ORDER: dict[str, Any] = {
    "considered": 10, "reached": 9, "cost": 0.5, "path_length": 2.0,
    "planning_time": 0.012, "execution_time": 1.5, "calls_first": 1.1,
    "calls_top": None, "terms": {},
}  # fmt: skip
VALIDATION: dict[str, Any] = {
    "format": "reachmap.validation",
    "format_version": "1.0",
    "repeats": 5,
    "rolls": 24,
    "lists": [
        {
            "list": "pile-1",
            "grasps": 167,
            "confusion": {
                "precision": SHARE,
                "recall": SHARE,
                "false_positive_rate": {"hits": 0, "total": 0, "share": None},
            },
            "correlation": {"spearman": 0.61, "kendall": 0.44, "count": 160},
        }
    ],
    "groups": [
        {
            "group": "NW",
            "grasps": 42,
            "cheaper": True,
            "orders": {"supplied": ORDER, "re-ranked": ORDER},
        }
    ],
}


def write_run(folder: Path) -> None:
    """Write a complete run whose files are made from each other."""
    folder.mkdir(parents=True, exist_ok=True)
    shares = np.arange(24).reshape(2, 3, 4) / 24.0
    write_workspace_map(folder / "workspace.h5", synthetic_workspace_map(shares))
    source = read_workspace_map(folder / "workspace.h5").stamp.content_sha256
    made_from = synthetic_provenance(source_sha256=source)
    write_placement(folder / "placement.h5", synthetic_placement(provenance=made_from))
    source = read_placement(folder / "placement.h5").stamp.content_sha256
    made_from = synthetic_provenance(source_sha256=source)
    record = dataclasses.replace(synthetic_bin_map(0.6), provenance=made_from)
    write_bin_map(folder / "bin.h5", record)
    rank(
        [EXAMPLES / "pile-1.json"],
        map_path=folder / "bin.h5",
        output=folder / "ranked.json",
    )
    (folder / "validation.json").write_text(json.dumps(VALIDATION))
    write_study(folder / "study.h5", small_study())


def small_study() -> Study:
    """A base, a variant that is better beyond doubt, and one that is not."""
    rng = np.random.default_rng(0)
    shares = (0.5, 0.9, 0.5)
    return study_of([rng.random((14, 20, 27)) < share for share in shares])


@pytest.fixture(scope="session")
def finished_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A complete run; not to be written to."""
    folder = tmp_path_factory.mktemp("runs") / "finished"
    write_run(folder)
    return folder
