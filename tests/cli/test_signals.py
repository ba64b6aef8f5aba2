"""Commands that keep nothing on the way end as tidily as scans do."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from reachmap.maps import write_bin_map
from tests.support.toy_artefacts import toy_bin_map


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_told_to_stop(tmp_path: Path, number: signal.Signals) -> None:
    """One line, 130, and nothing left; the signal goes to workers, too."""
    write_bin_map(tmp_path / "bin.h5", toy_bin_map())
    (tmp_path / "tmp").mkdir()
    words = "validate bin.h5 --random 5000 --repeats 200 -j 2 -o v.json"
    process = subprocess.Popen(
        [sys.executable, "-m", "reachmap", *words.split()],
        cwd=tmp_path,
        env=os.environ | {"TMPDIR": str(tmp_path / "tmp")},
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert process.stderr is not None
    assert "validate 0/" in process.stderr.readline()  # the first sign of progress
    os.killpg(process.pid, number)
    lines = process.communicate(timeout=60)[1].splitlines()
    assert process.returncode == 130, lines
    assert [line for line in lines if line and " elapsed " not in line] == [
        "reachmap: interrupted"
    ]
    assert {path.name for path in tmp_path.iterdir()} == {"bin.h5", "tmp"}
    assert not list((tmp_path / "tmp").iterdir())
