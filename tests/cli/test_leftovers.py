"""Commands leave their outputs behind, and nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.command_line import reachmap

EXAMPLE = Path(__file__).parents[2] / "examples" / "pile-1.json"
SMALL = "--set bin_scan.grid=[3,2] --set bin_scan.repeats=1"
RUNS = [
    "workspace-scan planar-toy -j 2",
    f"bin-scan --cell planar-toy {SMALL} -j 2",
    f"bin-scan --cell planar-toy {SMALL} -j 2 --executor dask:local -o dask.h5",
    "heatmap workspace.h5 -o pictures",
    f"rank {EXAMPLE} --map bin.h5 --chart chart.png -o ranked.json",
    "report . -o report.html",
    "view bin.h5 --html view.html",
    "verify workspace.h5 bin.h5",
    "compare bin.h5 bin.h5 --picture change.png",
    "info bin.h5",
]


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_20_runs_leave_nothing_in_the_temporary_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With and without a home that can be written to."""
    pytest.importorskip("viser")
    pytest.importorskip("distributed")
    for home in ("home", "/proc/none"):
        folder = tmp_path / Path(home).name
        (folder / "tmp").mkdir(parents=True)
        monkeypatch.setenv("TMPDIR", str(folder / "tmp"))
        monkeypatch.setenv("HOME", home if home.startswith("/") else str(folder))
        for command in RUNS:
            done = reachmap(folder, *command.split())
            assert done.returncode == 0, done.stderr
        assert list((folder / "tmp").iterdir()) == []
