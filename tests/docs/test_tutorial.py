"""The tutorial is executed, word for word, at small sizes."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from reachmap.cli.group import COMMANDS

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
TUTORIAL = DOCS / "tutorial" / "ur5.md"

# The commands are run as printed; the sizes come in through the environment.
SMALL = {
    "REACHMAP_WORKSPACE_SCAN_OVERRIDES": "workspace_scan.z_step=0.25 "
    "bin_scan.grid=[4,3] bin_scan.repeats=1 planner.max_checks=2000",
}
PRODUCTS = {
    "workspace-scan": ["workspace.h5"],
    "heatmap": ["heatmaps"],
    "place-bin": ["placement.h5"],
    "bin-scan": ["bin.h5"],
    "rank": ["ranked.json"],
    "view": ["bin-3d.html"],
    "report": ["report.html"],
}


def commands() -> list[str]:
    """Every line that the tutorial tells the reader to type."""
    blocks = re.findall(r"```console\n(.*?)```", TUTORIAL.read_text(), flags=re.DOTALL)
    return [
        line[2:] for block in blocks for line in block.splitlines() if line[:2] == "$ "
    ]


def test_the_tutorial_shows_the_whole_pipeline() -> None:
    """Every stage is there, in the order of the pipeline."""
    shown = [line.split()[1] for line in commands() if line.startswith("reachmap ")]
    stages = [name for name, entry in COMMANDS.items() if entry.section == "Pipeline"]
    assert [name for name in dict.fromkeys(shown) if name in stages] == stages


def python_blocks(page: Path) -> str:
    """The Python of a page, joined: later blocks build upon earlier ones."""
    return "\n".join(
        re.findall(r"```python\n(.*?)```", page.read_text(), flags=re.DOTALL)
    )


def run(command: list[str], folder: Path, shown: str) -> None:
    """Run a command as the reader would; it must succeed."""
    search = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, **SMALL, "PATH": search}
    done = subprocess.run(
        command,
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"$ {shown}\n{done.stdout}\n{done.stderr}"


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_the_tutorial_works(tmp_path: Path) -> None:
    """Each command exits 0 and leaves the files that the text promises.

    The Python of the README and of the page on xarray then runs on those files.
    """
    missing = [name for name in PRODUCTS if not COMMANDS[name].is_available()]
    if missing:
        pytest.skip(f"not there yet: {missing}")
    for line in commands():
        typed = line.replace("EXAMPLES", str(ROOT / "examples"))
        run(["bash", "-euc", typed], tmp_path, line)
        for name in PRODUCTS.get(line.split()[1], []):
            assert (tmp_path / name).exists(), f"{line} did not write {name}"
    for page in (ROOT / "README.md", TUTORIAL, DOCS / "how-to" / "read-in-xarray.md"):
        run([sys.executable, "-c", python_blocks(page)], tmp_path, page.name)
