"""Motions that leave a map: replayed from the exported file alone."""

from __future__ import annotations

import csv
import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from ruamel.yaml import YAML

from reachmap.cli import group
from reachmap.core.scene import Scene
from reachmap.maps import read_bin_map, write_bin_map
from reachmap.maps.provenance import cell_of_artefact
from reachmap.motions.motion import best_rows, trapezoid
from reachmap.tools.bin_scan import bin_scan
from tests.support.dense_checks import DenseCheck, dense_free
from tests.support.exported_motions import READERS
from tests.support.toy_artefacts import toy_bin_map


@pytest.fixture(scope="module")
def map_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bin map of the planar toy."""
    path = tmp_path_factory.mktemp("map") / "bin.h5"
    write_bin_map(path, toy_bin_map())
    return path


def run(*arguments: object) -> Result:
    """Run `reachmap export`."""
    return CliRunner().invoke(group, ["export", *map(str, arguments)])


def ways(text: str) -> dict[tuple[str, ...], np.ndarray]:
    """Waypoints of each motion of a CSV file, by test grasp: times first."""
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    rows = list(csv.reader(lines))[1:]
    found: dict[tuple[str, ...], list[list[float]]] = {}
    for row in rows:
        numbers = [float(value) for value in row[6:]]
        found.setdefault(tuple(row[:4]), []).append(numbers)
    return {place: np.array(way) for place, way in found.items()}


def test_every_exported_motion_is_free_when_replayed(map_path: Path) -> None:
    """From the file's numbers and the cell alone, at a third of the distance."""
    record = read_bin_map(map_path)
    scene = Scene.build(cell_of_artefact(record.provenance, str(map_path)))
    found = ways(run(map_path, "--all").stdout)
    assert len(found) == len(best_rows(record)) > 3
    for place, way in found.items():
        np.testing.assert_allclose(way[0, 1:], record.scan_configuration, atol=1e-12)
        goal = scene.kinematics.forward(way[-1, 1:])[:3, 3]
        index = tuple(int(k) for k in place)
        np.testing.assert_allclose(goal, record.position[index[:3]], atol=1e-6)
        for a, b in zip(way[:-1, 1:], way[1:, 1:], strict=True):
            assert dense_free(scene, a, b, margin_m=0.0)


def test_times_keep_to_the_limits(map_path: Path) -> None:
    """Of each joint between corners: d = v t at most, and never backwards."""
    record = read_bin_map(map_path)
    scene = Scene.build(cell_of_artefact(record.provenance, str(map_path)))
    for way in ways(run(map_path, "--all").stdout).values():
        time_s = np.diff(way[:, 0])
        assert (time_s > 0).all()
        speed = np.abs(np.diff(way[:, 1:], axis=0)) / time_s[:, None]
        assert (speed <= scene.robot.velocity_rad_s * (1 + 1e-6)).all()


def test_trajectories_stay_on_the_way_and_rest_at_its_corners(map_path: Path) -> None:
    """Sampled positions lie on the polyline; speeds are their derivatives."""
    text = run(map_path, "--all", "--to", "joint-trajectory").stdout
    messages = [m for m in YAML(typ="safe", pure=True).load_all(text) if m]
    polylines = list(ways(run(map_path, "--all").stdout).values())
    assert len(messages) == len(polylines)
    for message, way in zip(messages, polylines, strict=True):
        points = message["points"]
        t = [p["time_from_start"] for p in points]
        time_s = np.array([x["sec"] + 1e-9 * x["nanosec"] for x in t])
        q = np.array([p["positions"] for p in points])
        v = np.array([p["velocities"] for p in points])
        assert (np.diff(time_s) > 0).all()
        assert time_s[-1] == pytest.approx(way[-1, 0], abs=1e-6)
        on = [np.abs(_distance(x, way[:, 1:])) < 1e-9 for x in q]
        assert all(on)
        np.testing.assert_allclose(v[[0, -1]], 0.0, atol=1e-9)
        middle = 0.5 * (v[1:] + v[:-1]) * np.diff(time_s)[:, None]
        np.testing.assert_allclose(np.diff(q, axis=0), middle, atol=0.02)


def _distance(point: np.ndarray, way: np.ndarray) -> float:
    """Distance of a point from a polyline, piece by piece."""
    best = np.inf
    for a, b in zip(way[:-1], way[1:], strict=True):
        d = b - a
        share = np.clip((point - a) @ d / max(d @ d, 1e-18), 0.0, 1.0)
        best = min(best, float(np.linalg.norm(point - a - share * d)))
    return best


@pytest.mark.parametrize("ramp", [0.001, 0.2, 0.5])
def test_the_profile_is_a_trapezoid(ramp: float) -> None:
    """From rest to rest over the whole way; the rate is the derivative of the place."""
    share = np.linspace(0, 1, 20001)
    place, rate = trapezoid(share, ramp)
    assert place[0] == pytest.approx(0, abs=1e-12)
    assert place[-1] == pytest.approx(1, abs=1e-12)
    assert rate[[0, -1]].tolist() == [0.0, 0.0]
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(share)
    np.testing.assert_allclose(np.cumsum(steps), place[1:], atol=2e-3)


def test_json_holds_what_csv_holds(map_path: Path) -> None:
    """The same motions to the last place, with the hashes of map and cell."""
    document = json.loads(run(map_path, "--all", "--to", "json").stdout)
    record = read_bin_map(map_path)
    assert document["map_sha256"] == record.stamp.content_sha256
    assert document["blend_radius_m"] == 0.0
    assert "blend_rad" not in document["motions"][0]
    table = ways(run(map_path, "--all").stdout)
    for motion in document["motions"]:
        way = table[tuple(map(str, motion["test_grasp"]))]
        np.testing.assert_array_equal(way[:, 1:], motion["configuration"])
        np.testing.assert_array_equal(way[:, 0], motion["time_s"])


def test_blended_corners_are_free_when_replayed(tmp_path: Path) -> None:
    """From the numbers of the JSON and the cell alone; none passes half of a motion."""
    path = tmp_path / "bin.h5"
    finger = (
        '{"name":"finger","attach_to":"link_3","shape":{"box":[0.02,0.02,0.15]},'
        '"pose":{"xyz":[0.1,0,-0.135]},"touch":["link_2","link_3"]}'
    )
    shelf = (
        '{"name":"shelf","attach_to":"world","shape":{"box":[0.05,0.05,0.1]},'
        '"pose":{"xyz":[0.24,0.57,-0.15]},"touch":["bin"]}'
    )
    overrides = (
        f"bodies=[{finger},{shelf}]",
        "bin_scan.grid=[4, 3]",
        "bin_scan.repeats=1",
        "planner.time_law=blend",
    )
    bin_scan(None, path, cell="planar-toy", overrides=overrides)
    document = json.loads(run(path, "--all", "--to", "json").stdout)
    record = read_bin_map(path)
    scene = Scene.build(cell_of_artefact(record.provenance, str(path)))
    blended = 0
    for motion in document["motions"]:
        q, blend = np.array(motion["configuration"]), np.array(motion["blend_rad"])
        planned = motion["stage"].count("planned")
        assert len(blend) == len(q)
        assert not blend[[0, *range(planned - 1, len(q))]].any()
        for k in np.flatnonzero(blend):
            before, after = q[k - 1] - q[k], q[k + 1] - q[k]
            lengths = np.linalg.norm([before, after], axis=1)
            assert blend[k] <= lengths.min() / 2 + 1e-12
            a, c = q[k] + blend[k] * np.array([before, after]) / lengths[:, None]
            t = np.linspace(0, 1, 50)[:, None]
            curve = (1 - t) ** 2 * a + 2 * t * (1 - t) * q[k] + t**2 * c
            for one, other in pairwise(curve):
                assert dense_free(scene, one, other, margin_m=0.0)
            blended += 1
    assert blended > 0


def test_one_grasp_and_a_file(map_path: Path, tmp_path: Path) -> None:
    """A named test grasp goes into a file, which is not replaced unasked."""
    place = next(iter(best_rows(read_bin_map(map_path))))
    name, output = ",".join(map(str, place[1:])), tmp_path / "pick.csv"
    assert run(map_path, "--grasp", name, "-o", output).exit_code == 0
    assert list(ways(output.read_text())) == [tuple(map(str, place))]
    again = run(map_path, "--grasp", name, "-o", output)
    assert again.exit_code == 2
    assert "exists" in again.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "name test grasps with --grasp, or take --all"),
        (["--all", "--grasp", "0,0,0"], "name test grasps with --grasp, or take --all"),
        (["--grasp", "9,9,9"], "expected y,x,orientation"),
        (["--grasp", "a,b"], "expected y,x,orientation"),
        (["--all", "--to", "krl"], "arm of six revolute joints"),
    ],
)
def test_what_cannot_be_exported(
    map_path: Path, arguments: list[str], message: str
) -> None:
    """One line, exit code 2, nothing on stdout."""
    result = run(map_path, *arguments)
    assert result.exit_code == 2
    assert message in result.stderr
    assert result.stdout == ""


@pytest.mark.slow
@pytest.mark.parametrize("to", READERS)
def test_every_format_says_the_verified_motion(tmp_path: Path, to: str) -> None:
    """Of a six-axis arm: read back from the text alone, and replayed on the meshes."""
    path = tmp_path / "bin.h5"
    small = ["bin_scan.grid=[2,2]", "bin_scan.repeats=1"]
    record = bin_scan(None, path, cell="ur5-eye-in-hand", overrides=small)
    assert record is not None
    scene = Scene.build(cell_of_artefact(record.provenance, str(path)))
    text = run(path, "--all", "--to", to).stdout
    motions = READERS[to](text)
    assert len(motions) == len(best_rows(record)) > 50
    check = DenseCheck(scene, margin_m=0.0)
    for way, place in zip(motions, best_rows(record), strict=True):
        goal = scene.kinematics.forward(way[-1])[:3, 3]
        np.testing.assert_allclose(goal, record.position[place[:3]], atol=1e-6)
        np.testing.assert_allclose(way[0], scene.scan_configuration, atol=1e-6)
        assert check.path_is_free(way)
