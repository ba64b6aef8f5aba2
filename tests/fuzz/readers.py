"""Every reader of files against inputs that a fuzzer makes up.

::

    python -m tests.fuzz.readers grasps                   # until a finding, or Ctrl-C
    python -m tests.fuzz.readers cell -runs=10000 -seed=1

Whatever the input, a reader returns or raises a ReachmapError; anything else is a
finding, which the fuzzer (atheris, the extra [fuzz]) writes to a file. Options in one
dash are libFuzzer's. A finding becomes a test of the reader's own.
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

    path = folder / "cell.yaml"
    path.write_bytes(data)
    loaded = read_cell(str(path))
    cell_from_json(
        loaded.resolved_json, urdf=loaded.urdf, files_sha256=loaded.files_sha256
    )


def urdf(data: bytes, folder: Path) -> None:
    """Text of a URDF."""
    from reachmap.cell.files.urdf import parse_urdf
    from reachmap.cell.text.yaml_reader import read_text

    path = folder / "arm.urdf"
    path.write_bytes(data)
    parse_urdf(read_text(path, limit=10**6), "arm.urdf")


def srdf(data: bytes, folder: Path) -> None:
    """Text of an SRDF, for the toy arm."""
    from reachmap.cell.files.srdf import parse_srdf
    from reachmap.cell.files.urdf import parse_urdf

    text = data.decode("utf-8", "replace")
    parse_srdf(text, "arm.srdf", parse_urdf(URDF, "arm.urdf"))


def limits(data: bytes, folder: Path) -> None:
    """Text of MoveIt's joint limits, for the toy arm."""
    from reachmap.cell.files.joint_limits import parse_joint_limits
    from reachmap.cell.files.urdf import parse_urdf

    text, robot = data.decode("utf-8", "replace"), parse_urdf(URDF, "arm.urdf")
    parse_joint_limits(text, "joint_limits.yaml", robot)


def grasps(data: bytes, folder: Path) -> None:
    """A grasp list of any format."""
    from reachmap.errors import GraspListError, SettingsError
    from reachmap.ranking.lists.reading import read_grasps

    path = folder / "grasps"
    path.write_bytes(data)
    for how in ({}, {"frame": "bin"}):
        try:
            read_grasps(path, **how)
        except (GraspListError, SettingsError):
            continue


def hdf5(data: bytes, folder: Path) -> None:
    """An artefact: as it is, and with a seal that fits."""
    from reachmap.maps.bytes.integrity import seal, unseal
    from reachmap.maps.format.registry import read_artefact

    path = folder / "map.h5"
    image = unseal(data)[0]
    for content in (data, image + seal(image)):
        path.write_bytes(content)
        try:
            read_artefact(path)
        except ReachmapError:
            continue


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
