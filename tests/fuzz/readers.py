"""Every reader of files against inputs that a fuzzer makes up.

::

    python -m tests.fuzz.readers grasps                   # until a finding, or Ctrl-C
    python -m tests.fuzz.readers cell -runs=10000 -seed=1

Whatever the input, a reader returns or raises a ReachmapError, and what it returns is
no other answer in silence: a cell is the same when it is written and read again, a map
has the numbers of the one that was damaged, a text means the same twice. Anything else
is a finding, which the fuzzer (atheris, the extra [fuzz]) writes to a file. Options in
one dash are libFuzzer's. A finding becomes a test of the reader's own.
"""

from __future__ import annotations

import io
import json
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from reachmap.errors import ReachmapError

ROOT = Path(__file__).parents[2]
CELLS = ROOT / "cells"
TIME_LIMIT_S = 10

URDF = (CELLS / "planar-toy" / "planar_arm.urdf").read_text()
SRDF = """<robot name="planar"><group name="arm">
<chain base_link="base" tip_link="tip"/><joint name="joint_1"/></group>
<group_state name="home" group="arm">
<joint name="joint_1" value="0.5"/></group_state>
<disable_collisions link1="link_1" link2="link_2" reason="Adjacent"/></robot>"""
LIMITS = """default_velocity_scaling_factor: 0.1
joint_limits:
  joint_1:
    has_velocity_limits: true
    max_velocity: 1.5
    has_acceleration_limits: true
    max_acceleration: 3.0
    has_position_limits: true
    min_position: -1.0
    max_position: 1.0
"""
ISAAC = """format: isaac_grasp
format_version: 1.0
grasps:
  a:
    confidence: 0.5
    position: [0, 0, 0.05]
    orientation: {w: 0.0, xyz: [1.0, 0, 0]}
"""


def cell(data: bytes, folder: Path) -> None:
    """Text of a cell file, with everything that it refers to."""
    from reachmap.cell.loading import cell_from_json, read_cell
    from reachmap.cell.text.yaml_writer import cell_yaml

    path = folder / "cell.yaml"
    path.write_bytes(data)
    loaded = read_cell(str(path))
    stored = cell_from_json(
        loaded.resolved_json,
        urdf=loaded.urdf,
        srdf=loaded.srdf,
        files_sha256=loaded.files_sha256,
    )
    assert stored.sha256 == loaded.sha256
    path.write_text(cell_yaml(loaded.cell), encoding="utf-8")
    assert read_cell(str(path)).resolved_json == loaded.resolved_json


def urdf(data: bytes, folder: Path) -> None:
    """Text of a URDF."""
    from reachmap.cell.files.urdf import parse_urdf
    from reachmap.cell.text.yaml_reader import read_text

    path = folder / "arm.urdf"
    path.write_bytes(data)
    text = read_text(path, limit=10**6)
    assert parse_urdf(text, "arm.urdf") == parse_urdf(text, "arm.urdf")


def srdf(data: bytes, folder: Path) -> None:
    """Text of an SRDF, for the toy arm."""
    from reachmap.cell.files.srdf import parse_srdf
    from reachmap.cell.files.urdf import parse_urdf

    text, robot = data.decode("utf-8", "replace"), parse_urdf(URDF, "arm.urdf")
    found, again = (parse_srdf(text, "arm.srdf", robot) for _ in range(2))
    assert found == again


def limits(data: bytes, folder: Path) -> None:
    """Text of MoveIt's joint limits, for the toy arm."""
    from reachmap.cell.files.joint_limits import parse_joint_limits
    from reachmap.cell.files.urdf import parse_urdf

    text, robot = data.decode("utf-8", "replace"), parse_urdf(URDF, "arm.urdf")
    found, again = (parse_joint_limits(text, "limits.yaml", robot) for _ in range(2))
    assert found == again


def grasps(data: bytes, folder: Path) -> None:
    """A grasp list of any format."""
    from reachmap.errors import GraspListError, SettingsError
    from reachmap.ranking.lists.reading import read_grasps
    from reachmap.ranking.lookup.settings import Invalid

    path = folder / "grasps"
    path.write_bytes(data)
    invalid: Invalid
    for frame, invalid in ((None, "raise"), ("bin", "raise"), ("bin", "mark")):
        try:
            found, again = (
                read_grasps(path, frame=frame, invalid=invalid) for _ in range(2)
            )
        except (GraspListError, SettingsError):
            continue
        for name in ("points", "directions"):
            numbers = getattr(found, name)
            np.testing.assert_array_equal(numbers, getattr(again, name))


def hdf5(data: bytes, folder: Path) -> None:
    """An artefact: as it is, and with a seal that fits."""
    from reachmap.maps.format.registry import read_artefact
    from reachmap.maps.format.store import seal, unseal

    path = folder / "map.h5"
    image = unseal(data)[0]
    for content in (data, image + seal(image)):
        path.write_bytes(content)
        try:
            found = read_artefact(path)
        except ReachmapError:
            continue
        assert found.stamp.content_sha256 == _content_sha256()


TARGETS: dict[str, Callable[[bytes, Path], None]] = {
    target.__name__: target for target in (cell, urdf, srdf, limits, grasps, hdf5)
}


def seeds(name: str) -> list[bytes]:
    """Small inputs of a target that are right, to begin with."""
    if name == "cell":
        text = (CELLS / "planar-toy.yaml").read_text()
        return [text.encode(), (CELLS / "ur5-eye-in-hand.yaml").read_bytes()]
    if name == "grasps":
        return _lists()
    if name == "hdf5":
        return [_placement()]
    texts = {"urdf": URDF, "srdf": SRDF, "limits": LIMITS}
    return [texts[name].encode()]


def _lists() -> list[bytes]:
    pile = json.loads((ROOT / "examples" / "pile-1.json").read_text())
    pile["grasps"] = pile["grasps"][:2]
    transforms = {"grasps": {"transforms": [np.eye(4).tolist()]}}
    npy, npz = io.BytesIO(), io.BytesIO()
    rows = np.array([[0.5, 0, 0, 1.0, 0.05, 0.02, 0.05]] * 2)
    np.save(npy, rows)
    np.savez_compressed(npz, rows)
    texts = [json.dumps(pile), json.dumps(transforms), ISAAC]
    return [*(text.encode() for text in texts), npy.getvalue(), npz.getvalue()]


def _placement() -> bytes:
    from reachmap.maps import write_placement
    from tests.support.synthetic_maps import synthetic_placement

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "placement.h5"
        write_placement(path, synthetic_placement())
        return path.read_bytes()


@cache
def _content_sha256() -> str:
    from reachmap.maps.format.registry import read_artefact

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "placement.h5"
        path.write_bytes(_placement())
        return str(read_artefact(path).stamp.content_sha256)


def attempt(name: str, data: bytes, folder: Path) -> None:
    """Hand an input to a reader; a hang or an error of another family is raised."""
    with _time_limit():
        try:
            TARGETS[name](data, folder)
        except ReachmapError as error:
            # A message is for a person to read, whatever is in the file.
            if not error.lines or not all(str(line).strip() for line in error.lines):
                raise AssertionError("a message without words") from error


@contextmanager
def _time_limit() -> Iterator[None]:
    def out_of_time(*_: Any) -> None:
        raise TimeoutError(f"more than {TIME_LIMIT_S} s")

    signal.signal(signal.SIGALRM, out_of_time)
    signal.alarm(TIME_LIMIT_S)
    try:
        yield
    finally:
        signal.alarm(0)


def workplace(folder: Path) -> Path:
    """A folder with what cells refer to."""
    shutil.copytree(CELLS / "planar-toy", folder / "planar-toy")
    return folder


def main(arguments: list[str]) -> None:
    """Fuzz one target with what atheris learns from the code that runs."""
    import atheris

    name, options = arguments[0], arguments[1:]
    corpus = ROOT / "build" / "fuzz" / name
    corpus.mkdir(parents=True, exist_ok=True)
    for number, seed in enumerate(seeds(name)):
        (corpus / f"seed-{number}").write_bytes(seed)
    with tempfile.TemporaryDirectory() as folder:
        place = workplace(Path(folder))
        with atheris.instrument_imports(include=["reachmap"]):
            for seed in seeds(name):
                attempt(name, seed, place)
        findings = f"-artifact_prefix={corpus}-"
        atheris.Setup(
            [f"fuzz {name}", *options, findings, "-verbosity=0", str(corpus)],
            lambda data: attempt(name, bytes(data), place),
        )
        atheris.Fuzz()


if __name__ == "__main__":
    main(sys.argv[1:])
