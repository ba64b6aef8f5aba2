"""The installation for ranking alone: NumPy, SciPy, h5py and click, nothing else."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from reachmap.maps import write_bin_map
from tests.support.ranking_maps import make_bin_map

ROOT = Path(__file__).parents[2]
LIGHT = {"numpy", "scipy", "h5py", "click"}
# Distributions that are imported under another name.
MODULES = {
    "pin": "pinocchio", "pyyaml": "yaml", "ruamel.yaml": "ruamel",
    "example-robot-data": "example_robot_data",
}  # fmt: skip


def dependencies() -> dict[str, str]:
    """Name of each dependency in pyproject.toml to its whole line."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"].values()
    lines = [*project["dependencies"], *(line for extra in extras for line in extra)]
    return {re.split(r"[<>=\[]", line)[0]: line for line in lines}


def light(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run the command line where no other dependency can be imported."""
    heavy = sorted(MODULES.get(n, n.replace("-", "_")) for n in dependencies())
    code = (
        "import sys, importlib.abc\n"
        f"HEAVY = {heavy!r}\n"
        f"LIGHT = {sorted(LIGHT)!r}\n"
        "class Absent(importlib.abc.MetaPathFinder):\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        top = name.partition('.')[0]\n"
        "        if top in HEAVY and top not in LIGHT:\n"
        "            raise ModuleNotFoundError(f'No module named {top!r}', name=top)\n"
        "sys.meta_path.insert(0, Absent())\n"
        "from reachmap.cli import main\n"
        "main()\n"
    )
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A bin map and a list."""
    write_bin_map(tmp_path / "bin.h5", make_bin_map(seed=1))
    grasp = {"id": "a", "position": [0.0, 0.0, 0.05], "direction": [0, 0, -1]}
    document = {"format": "reachmap.grasps", "format_version": "1.0", "frame": "bin"}
    (tmp_path / "list.json").write_text(json.dumps({**document, "grasps": [grasp]}))
    return tmp_path


def test_the_requirements_are_those_of_the_project() -> None:
    """One place states the floors; the other repeats them."""
    lines = (ROOT / "requirements-ranking.txt").read_text().splitlines()
    stated = {line for line in lines if line and not line.startswith("#")}
    known = dependencies()
    assert stated == {known[name] for name in LIGHT}


def test_lists_are_ranked_without_any_engine(folder: Path) -> None:
    """The same answer as with everything installed."""
    call = ["rank", folder / "list.json", "--map", folder / "bin.h5"]
    done = light(*call)
    assert done.returncode == 0, done.stderr
    full = subprocess.run(
        [sys.executable, "-m", "reachmap", *map(str, call)],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == full.stdout
    assert light(*call, "--explain", "a").returncode == 0
    assert light(*call, "-o", folder / "ranked.json").returncode == 0
    assert light("schema", "ranked").returncode == 0
    assert light("completion", "bash").returncode == 0
    assert light("--help").returncode == 0


@pytest.mark.parametrize(
    "arguments", [["check"], ["bin-scan", "--dry-run"], ["heatmap", "bin.h5"]]
)
def test_what_needs_more_says_so(folder: Path, arguments: list[str]) -> None:
    """One line that names what is missing, and exit code 2."""
    words = [folder / word if word.endswith(".h5") else word for word in arguments]
    done = light(*words)
    assert done.returncode == 2
    assert done.stdout == ""
    assert re.fullmatch(
        r"reachmap: this needs \w+, which is not installed; .*\n", done.stderr
    )
