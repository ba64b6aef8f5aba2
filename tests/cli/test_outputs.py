"""No command writes over what it reads, onto devices, or twice into one file."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from reachmap.cli import group
from reachmap.core.scene import Scene
from reachmap.maps import write_bin_map, write_placement, write_workspace_map
from tests.support.synthetic_maps import synthetic_placement
from tests.support.toy_artefacts import toy_bin_map, toy_workspace

CELL = (Path(__file__).parents[2] / "cells" / "planar-toy.yaml").read_text()
URDF = (
    Path(__file__).parents[2] / "cells" / "planar-toy" / "planar_arm.urdf"
).read_text()
GRASPS = (Path(__file__).parents[2] / "examples" / "pile-1.json").read_text()

# Command, with {o} for the output, and the inputs that it must not be.
WRITERS = [
    ("workspace-scan cell.yaml -j 1 -o {o}", ["cell.yaml", "arm.urdf"]),
    ("workspace-scan cell.yaml -j 1 --method per-frame -o {o}", ["cell.yaml"]),
    ("bin-scan --cell cell.yaml -j 1 -o {o}", ["cell.yaml", "arm.urdf"]),
    ("bin-scan placement.h5 -j 1 -o {o}", ["placement.h5"]),
    ("place-bin workspace.h5 -j 1 -o {o}", ["workspace.h5"]),
    ("place-bin workspace.png -j 1 -o p.h5 --picture {o}", ["workspace.png"]),
    ("rank g.json --map bin.h5 -o {o}", ["g.json", "bin.h5"]),
    ("rank g.json --map bin.h5 --cell cell.yaml -o {o}", ["cell.yaml", "arm.urdf"]),
    ("rank g.json --map bin.h5 -o {o}", ["bin.calibration.json"]),
    ("rank g.json --map bin.png --chart {o}", ["bin.png"]),
    ("validate bin.h5 g.json -j 1 -o {o}", ["bin.h5", "g.json"]),
    ("validate bin.png g.json -j 1 --chart {o}", ["bin.png"]),
    ("report . -o {o}", ["bin.h5", "placement.h5", "workspace.h5", "ranked.json"]),
    ("cells --export bin.h5 -o {o}", ["bin.h5"]),
    ("new-cell arm.urdf -o {o}", ["arm.urdf"]),
    ("view bin.h5 --html {o}", ["bin.h5"]),
    ("view cell.yaml --html {o}", ["cell.yaml", "arm.urdf"]),
    ("study cell.yaml --vary robot.urdf=arm.urdf,b.urdf -j 1 -o {o}", ["b.urdf"]),
    ("study cell.yaml --vary bin_scan.repeats=1,2 -j 1 -o {o}", ["cell.yaml"]),
    ("place-robot cell.yaml -j 1 -o {o}", ["cell.yaml", "arm.urdf"]),
    ("place-robot cell.yaml --arm b.yaml -j 1 -o {o}", ["b.yaml", "b.urdf"]),
    ("robust bin.h5 --bin 5mm -j 1 -o {o}", ["bin.h5"]),
    ("robust bin.png --bin 5mm -j 1 -o r.h5 --picture {o}", ["bin.png"]),
    ("empty bin.h5 --part 60x40x20mm -o {o}", ["bin.h5"]),
    ("export bin.h5 --all -o {o}", ["bin.h5"]),
    ("merge a.journal b.journal -o {o}", ["a.journal", "b.journal"]),
    ("compare bin.png bin.h5 --picture {o}", ["bin.png"]),
]
PAIRS = [(command, name) for command, names in WRITERS for name in names]


@pytest.fixture(scope="module")
def maps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one file of every kind that commands read."""
    folder = tmp_path_factory.mktemp("maps")
    write_bin_map(folder / "bin.h5", toy_bin_map())
    write_workspace_map(folder / "workspace.h5", toy_workspace())
    write_placement(folder / "placement.h5", synthetic_placement())
    urdf = "planar-toy/planar_arm.urdf"
    assert urdf in CELL
    (folder / "cell.yaml").write_text(CELL.replace(urdf, "arm.urdf"))
    for name in ("arm.urdf", "b.urdf"):
        (folder / name).write_text(URDF)
    (folder / "b.yaml").write_text("robot: {urdf: b.urdf}\n")
    lists = ("g.json", "ranked.json", "a.journal", "b.journal", "bin.calibration.json")
    for name in lists:
        (folder / name).write_text(GRASPS)
    return folder


@pytest.fixture
def folder(maps: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder to work in; every file has a twin that is named as a picture."""
    for item in maps.iterdir():
        (tmp_path / item.name).write_bytes(item.read_bytes())
    for name in ("bin", "workspace"):
        os.link(tmp_path / f"{name}.h5", tmp_path / f"{name}.png")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@contextmanager
def no_work(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Let the building of a scene, the first work there is, be a failure."""

    def build(*_: Any, **__: Any) -> None:
        raise AssertionError("a scene was built")

    with monkeypatch.context() as patch:
        patch.setattr(Scene, "build", build)
        yield


def run(command: str, monkeypatch: pytest.MonkeyPatch) -> Result:
    """Run a command line that must not come to work."""
    with no_work(monkeypatch):
        return CliRunner().invoke(group, command.split())


def place_of(command: str, name: str) -> str:
    """A name of an output that says no more about its contents than it must."""
    is_picture = "--picture {o}" in command or "--chart {o}" in command
    return f"{name}.png" if is_picture else name


def state_of(folder: Path) -> dict[str, bytes]:
    """Everything in a folder."""
    return {item.name: item.read_bytes() for item in folder.iterdir()}


@pytest.mark.parametrize("alias", ["same", "hard", "symbolic"])
@pytest.mark.parametrize(("command", "name"), PAIRS)
def test_no_command_replaces_what_it_reads(
    folder: Path, monkeypatch: pytest.MonkeyPatch, command: str, name: str, alias: str
) -> None:
    """Not even with --overwrite, and under no other name, however far it looks."""
    output = name if alias == "same" else place_of(command, "alias")
    if alias == "hard":
        os.link(name, output)
    elif alias == "symbolic":
        Path(output).symlink_to(name)
    before = state_of(folder)
    result = run(f"{command.format(o=output)} --overwrite", monkeypatch)
    assert result.exit_code == 2, result.output
    if alias == "same" and "the output is" in result.stderr:
        assert f"{output}: the output is " in result.stderr  # by its suffix alone
    else:
        assert f"{output}: would replace " in result.stderr
    assert state_of(folder) == before


@pytest.mark.parametrize("command", [command for command, _ in WRITERS])
@pytest.mark.parametrize("kind", ["pipe", "socket", "device", "folder"])
def test_what_is_no_file_is_refused(
    folder: Path, monkeypatch: pytest.MonkeyPatch, command: str, kind: str
) -> None:
    """Pipes, sockets, devices and folders are neither written to nor replaced."""
    place = folder / place_of(command, "place")
    if kind == "folder" and ("rank" in command or "compare" in command):
        pytest.skip("this command writes into folders")
    with make(place, kind):
        mode = place.stat().st_mode
        result = run(f"{command.format(o=place)} --overwrite", monkeypatch)
        assert result.exit_code == 2, result.output
        assert "not a regular file" in result.stderr or "is a folder" in result.stderr
        assert place.stat().st_mode == mode


@contextmanager
def make(place: Path, kind: str) -> Iterator[None]:
    """Make something of a kind; a device is a link to the one that takes all."""
    if kind == "pipe":
        os.mkfifo(place)
    elif kind == "device":
        place.symlink_to("/dev/null")
    elif kind == "folder":
        place.mkdir()
    with socket.socket(socket.AF_UNIX) as listening:
        if kind == "socket":
            listening.bind(place.name)
        yield


@pytest.mark.parametrize("command", [command for command, _ in WRITERS])
def test_an_existing_output_is_refused_before_any_work(
    folder: Path, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    """Without --overwrite, and before the scene is built."""
    place = folder / place_of(command, "place")
    place.write_bytes(b"precious")
    result = run(command.format(o=place), monkeypatch)
    assert result.exit_code == 2, result.output
    assert f"{place.name}: exists already" in result.stderr
    assert place.read_bytes() == b"precious"


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (
            "study cell.yaml --vary seed=1,2 -o s.png",
            "s.png: the output is an artefact (HDF5), in a name that ends in .h5",
        ),
        ("bin-scan --cell cell.yaml -o b.JSON", "b.JSON: the output is an artefact"),
        ("merge a.journal b.journal -o m.csv", "m.csv: the output is an artefact"),
        ("report . -o r.svg", "r.svg: the output is a page"),
        ("rank g.json --map bin.h5 -o r.h5", "r.h5: the output is JSON"),
        ("new-cell arm.urdf -o c.urdf", "c.urdf: the output is a cell (YAML)"),
        ("view bin.h5 --html v.png", "v.png: the output is a page"),
        ("heatmap bin.h5 -o p.png", "p.png: the output is a folder"),
        ("run cell.yaml -o run.h5", "run.h5: the output is a folder"),
    ],
)
def test_a_name_does_not_promise_another_kind_of_file(
    folder: Path, monkeypatch: pytest.MonkeyPatch, command: str, message: str
) -> None:
    """Readers go by suffixes; a map called .png would be found damaged by each."""
    before = state_of(folder)
    result = run(command, monkeypatch)
    assert result.exit_code == 2, result.output
    assert message in result.stderr
    assert state_of(folder) == before


@pytest.mark.parametrize("command", sorted({command for command, _ in WRITERS}))
def test_an_empty_name_is_no_output(command, tmp_path, monkeypatch):
    """As a script's unset variable leaves it: nothing appears in the folder."""
    monkeypatch.chdir(tmp_path)
    words = ["" if word == "{o}" else word for word in command.split()]
    result = CliRunner().invoke(group, words)
    assert result.exit_code == 2
    assert "a name is missing (got '')" in result.stderr
    assert not [*tmp_path.iterdir()]


def test_an_empty_cell_is_not_the_usual_one(tmp_path, monkeypatch):
    """It is named, and nothing is scanned."""
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(group, ["bin-scan", "--cell", "", "--dry-run"])
    assert result.exit_code == 2
    assert "'' is neither a shipped cell nor a file" in result.stderr
