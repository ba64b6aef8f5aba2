"""Several bins in one cell: what a file says, what is loaded, and what stands where."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from reachmap.cell.loading import cell_from_json, read_cell
from reachmap.core.scene import Scene
from reachmap.errors import CellError

TRAY = (
    "{inner: [0.30, 0.20, 0.05], wall: 0.006, pose: {xyz: [%s], rpy_deg: [0, 0, 90]}}"
)
LEFT, RIGHT = TRAY % "0.45, 0.18, -0.05", TRAY % "0.45, -0.18, -0.05"


def write(folder, bins):
    """The shipped UR5 cell with other bins."""
    text = (read_cell("ur5-eye-in-hand").text).split("\nbin:")
    rest = text[1].split("\nscan_configuration:")[1]
    path = folder / "cell.yaml"
    path.write_text(f"{text[0]}\n{bins}\nscan_configuration:{rest}")
    return str(path)


@pytest.fixture
def two(tmp_path):
    """A cell with a left and a right bin."""
    return write(tmp_path, f"bins:\n  left: {LEFT}\n  right: {RIGHT}")


def test_the_first_is_picked_from_unless_told(two):
    """`pick_from` changes which one is the bin; the other stays."""
    cell = read_cell(two).cell
    assert (cell.bin.name, [*cell.bins]) == ("left", ["right"])
    cell = read_cell(two, ["pick_from=right"]).cell
    assert (cell.bin.name, [*cell.bins]) == ("right", ["left"])
    assert cell.T_base_bin()[1, 3] == pytest.approx(-0.18)


def test_levels_within_the_parts_of_the_bin_are_named(two):
    """Of the bin that is picked from; the heap of another is an obstacle like any."""
    heap = "bins.right.heap=0.02"
    fill = ["bin_scan.fill=[0.1, 0.4, 0.9]", "bin_scan.layers=null"]
    assert not any("heap" in line for line in read_cell(two, [heap, *fill]).warnings)
    found = read_cell(two, [heap, *fill, "pick_from=right"]).warnings
    (line,) = (line for line in found if "heap" in line)
    assert "grasps 5, 20 mm above the bottom lie within" in line
    layers = [heap, "pick_from=right", "bin_scan.layers=[0.01, 0.03]"]
    (line,) = (line for line in read_cell(two, layers).warnings if "heap" in line)
    assert line.startswith("--set bin_scan.layers=[0.01, 0.03]: grasps 10 mm above")


def test_a_single_bin_has_the_hash_it_had(tmp_path):
    """One bin by name is the same cell as one without."""
    single = write(tmp_path, f"bin: {LEFT}")
    plain = read_cell(single)
    assert plain.sha256 == read_cell(write(tmp_path, f"bins: {{a: {LEFT}}}")).sha256
    text = plain.cell.model_dump(mode="json")
    assert text["bins"] == {}
    assert text["bin"]["name"] is None


def test_a_stored_cell_can_change_its_bin(two):
    """What an artefact keeps is picked from elsewhere, and changed by name."""
    loaded = read_cell(two)

    def changed(*changes):
        return cell_from_json(
            loaded.resolved_json,
            urdf=loaded.urdf,
            srdf=loaded.srdf,
            changes=changes,
            files_sha256=loaded.files_sha256,
        )

    assert changed().sha256 == loaded.sha256
    assert (
        changed("pick_from=right").sha256 == read_cell(two, ["pick_from=right"]).sha256
    )
    for name in ("left", "right"):
        moved = changed(f"bins.{name}.pose.xyz.2=0.1")
        heights = {s.name or "right": s.pose.xyz[2] for _, s in moved.cell.every_bin()}
        assert heights[name] == 0.1
        assert sorted(heights.values()) == [-0.05, 0.1]


def test_every_bin_is_an_obstacle(two):
    """The parts of the other bin are bodies, and the arm meets them."""
    scene = Scene.build(read_cell(two))
    names = {name.split(" | ")[1] for name in scene.checker.body_pairs}
    assert {"bin wall +x", "right bin wall +x"} <= names
    bodies = scene.checker.bodies.geometryObjects
    y = [b.placement.translation[1] for b in bodies if "right bin bottom" in b.name]
    assert y == pytest.approx([-0.18])
    bare = Scene.build(read_cell(two), with_bin=False)
    assert not any("bin" in name for name in bare.checker.body_pairs)


def test_a_touch_of_a_bin_is_of_all_or_of_one(two):
    """`bin` stands for every bin, a name for its own."""
    right, left, both = (
        Scene.build(
            read_cell(two, [f"bodies.suction tube.touch=[wrist_3_link, {name}]"])
        )
        for name in ("right", "left", "bin")
    )

    def pairs(scene):
        return [p for p in scene.checker.body_pairs if p.startswith("suction tube |")]

    assert any("| bin wall" in pair for pair in pairs(right))
    assert not any("right bin" in pair for pair in pairs(right))
    assert not any("| bin wall" in pair for pair in pairs(left))
    assert any("right bin" in pair for pair in pairs(left))
    assert not any("bin " in pair for pair in pairs(both))


def test_a_touch_of_a_bin_holds_whichever_is_picked_from(two):
    """Also in a scene without bins, as of a workspace scan."""
    shelf = "{name: rest, shape: {box: [0.02, 0.1, 0.3]}, touch: [left]%s}"
    inside = shelf % ", pose: {xyz: [0.45, 0.18, -0.1]}"
    for picked in ("left", "right"):
        loaded = read_cell(two, [f"bodies=[{inside}]", f"pick_from={picked}"])
        assert not Scene.build(loaded).scan_problems()
        Scene.build(loaded, with_bin=False)
    wrong = inside.replace("left", "right")
    problems = Scene.build(read_cell(two, [f"bodies=[{wrong}]"])).scan_problems()
    assert [text.split(": ", 1)[1] for text in problems] == [
        "bins.left.pose: bin bottom touches rest"
    ]


def test_bins_that_meet_are_named(two):
    """Both of them, with the line of the one that is picked from."""
    scene = Scene.build(read_cell(two, ["bins.right.pose.xyz.1=0.1"]))
    (problem,) = scene.scan_problems()
    assert re.search(r"cell.yaml:\d+:\d+: bins.left.pose: bin .* right bin", problem)


def test_bins_that_are_not_picked_from_are_looked_at_as_well(two):
    """One in the pedestal, and two that meet, which are reported once."""
    inside = Scene.build(read_cell(two, ["bins.right.pose.xyz=[0.1, 0, -0.2]"]))
    (problem,) = inside.scan_problems()
    assert "bins.right.pose: bin" in problem
    assert problem.endswith("touches pedestal")
    third = TRAY % "0.45, -0.25, -0.05"
    text = Path(two).read_text().replace("  right:", f"  third: {third}\n  right:")
    Path(two).write_text(text)
    (problem,) = Scene.build(read_cell(two)).scan_problems()
    assert re.search(r"bins.third.pose: bin .* touches right bin", problem)


def test_carriers_and_supports_are_of_each(tmp_path):
    """`carrier` and `on` work in every bin."""
    table = "{name: table, shape: {box: [0.8, 1.2, 0.1]}, pose: {xyz: [0.5, 0, -0.4]}}"
    bins = (
        "bins:\n  a: {carrier: KLT-3147, on: table, pose: {xyz: [0.5, 0.2, 0]}}\n"
        "  b: {carrier: KLT-4147, on: table, pose: {xyz: [0.5, -0.2, 0]}}"
    )
    cell = read_cell(write(tmp_path, bins), [f"bodies=[{table}]"]).cell
    for name, spec in (("a", cell.bin), ("b", cell.bins["b"])):
        bottom = cell.T_base_of(spec)[2, 3] - spec.bottom_m
        T_base_world = cell.T_base_world()
        assert bottom == pytest.approx(-0.35 + T_base_world[2, 3]), name
    assert cell.bins["b"].inner == (0.346, 0.265, 0.1295)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("pick_from=rigt", "pick_from: no bin 'rigt'; did you mean 'right'"),
        ("pick_from=3", "pick_from: expected a name in quotes: left, right (got 3)"),
        ("bins.left.carrier=KLT-99", "bins.left.carrier: no carrier 'KLT-99'"),
        ("bins.rihgt.carrier=KLT-4147", "bins has no key 'rihgt'; did you mean"),
        ("bins.right.carrier=KLT-99", "bins.right.carrier: no carrier 'KLT-99'"),
        ("bins.left.inner=[1, 2]", "bins.left.inner.2: a value is missing"),
        ("bins.right.inner=[1, 2]", "bins.right.inner.2: a value is missing"),
        ("bins.left.on=flor", "bins.left.on: no body 'flor'; did you mean 'floor'?"),
        ("bins.right.on=suction tube", "bins.right.on: 'suction tube' has no level"),
        (
            "bins.left.pose.rpy_deg=[90, 0, 0]",
            "bins.left.pose: the bin is tilted 90 deg",
        ),
        ("bins.right.pose.rpy_deg=[90, 0, 0]", "bins.right.pose: the bin is tilted 90"),
        ("bins.left.touch=[shelf]", "bins.left.touch.0: no link or body 'shelf'"),
        ("bin.wall=0.1", "bin: give bin or bins, not both"),
        ("bins.left.name=other", "bins.left.name: the name of a bin is its key"),
    ],
)
def test_mistakes_name_the_bin(two, change, message):
    """As it is written in the file, whichever is picked from."""
    with pytest.raises(CellError, match=re.escape(message)):
        read_cell(two, [change])


@pytest.mark.parametrize(
    ("bins", "message"),
    [
        ("bins: {}", "bins: expected at least one bin by name, as in left: {"),
        ("bins:", "bins: expected at least one bin by name, as in left: {"),
        ("bins: [tray]", "bins: expected a mapping of names to values"),
        ("bins: tray", "bins: expected a mapping of names to values"),
    ],
)
def test_bins_that_are_none_are_one_mistake(tmp_path, bins, message):
    """That there is no bin to pick from, then, is not reported as well."""
    with pytest.raises(CellError, match=re.escape(message)) as caught:
        read_cell(write(tmp_path, f"{bins}\npick_from: left"))
    assert len(caught.value.lines) == 1


def test_a_mesh_in_millimetres_is_noticed_in_every_bin(two, tmp_path):
    """Not only in the bin that is picked from."""
    trimesh = pytest.importorskip("trimesh")
    trimesh.creation.box((300, 200, 50)).export(tmp_path / "tray.stl")
    for name in ("left", "right"):
        with pytest.raises(
            CellError, match="300 m large; is it in millimetres"
        ) as told:
            read_cell(two, [f"bins.{name}.mesh={{file: tray.stl}}"])
        assert len(told.value.lines) == 1
        read_cell(two, [f"bins.{name}.mesh={{file: tray.stl, scale: 0.001}}"])


def test_names_must_be_free(tmp_path):
    """A bin is not called like a body."""
    path = write(tmp_path, f"bins:\n  floor: {LEFT}\n  pedestal: {RIGHT}")
    with pytest.raises(CellError, match="'floor' is the name of") as caught:
        read_cell(path)
    assert any("'pedestal' is the name of" in line for line in caught.value.lines)


@pytest.mark.parametrize("name", ["left", "right"])
def test_a_mistake_has_the_place_where_it_is_written(tmp_path, name):
    """Line and column in a bin that is written in lines, picked from or not."""
    bins = "bins:\n" + "".join(
        f"  {one}:\n    inner: [0.3, 0.2, 0.05]\n    wall: {wall}\n"
        f"    pose: {{xyz: [0.45, {y}, -0.05]}}\n"
        for one, y, wall in (
            ("left", 0.18, "thin" if name == "left" else 0.006),
            ("right", -0.18, "thin" if name == "right" else 0.006),
        )
    )
    path = write(tmp_path, bins)
    lines = Path(path).read_text().splitlines()
    line = 1 + next(k for k, text in enumerate(lines) if "wall: thin" in text)
    with pytest.raises(CellError) as caught:
        read_cell(path)
    (said,) = caught.value.lines
    assert said.startswith(f"{path}:{line}:11: bins.{name}.wall: expected a number")


def test_a_cell_without_names_has_none_to_choose():
    """`pick_from` needs bins."""
    with pytest.raises(CellError, match="no bins by name"):
        read_cell("ur5-eye-in-hand", ["pick_from=left"])


def test_other_bins_can_be_taken_away(two):
    """The cell alone has the hash of a cell with that bin only."""
    loaded = read_cell(two)
    alone = loaded.with_other_bins({})
    assert alone.sha256 != loaded.sha256
    assert loaded.with_other_bins(loaded.cell.bins) is loaded
    assert np.allclose(alone.cell.T_base_bin(), loaded.cell.T_base_bin())


@pytest.mark.parametrize(
    ("overrides", "place"),
    [
        ([], "{file}:{line}:"),
        (["bins.left.wall=0.005"], "{file}:{line}:"),
        ([f"bins={{left: {LEFT}, right: {RIGHT}}}"], "--set bins={{left: {{inner:"),
        ([f"bins.left={LEFT}"], "--set bins.left={{inner:"),
        (
            ["bins.left.pose={xyz: [0, 0, 0]}"],
            "--set bins.left.pose={{xyz: [0, 0, 0]}}",
        ),
        (
            ["bins.left.pose.xyz.0=0.1", "bins.left.pose.xyz.1=0.2"],
            "--set bins.left.pose.xyz.0=0.1 --set bins.left.pose.xyz.1=0.2",
        ),
        (["bins.left.pose.xyz.0=0.1", f"bins.left={LEFT}"], "--set bins.left={{inner:"),
    ],
)
def test_what_was_given_last_is_the_place_of_a_key(two, overrides, place):
    """A line of the file only where no assignment is to the key, above or below it."""
    lines = Path(two).read_text().splitlines()
    line = 1 + next(k for k, text in enumerate(lines) if text.startswith("  left:"))
    found = read_cell(two, overrides).place_of("bins.left.pose")
    assert found.startswith(place.format(file=two, line=line))


def test_a_pose_that_nobody_gave_has_the_place_of_its_bin(two):
    """The line of the bin, or the assignment that gave the bin without a pose."""
    bare = "bins.left={inner: [0.3, 0.2, 0.05], wall: 0.006}"
    loaded = read_cell(two, [bare])
    assert loaded.place_of("bins.left.pose") == f"--set {bare}"
    assert loaded.place_of("bins.right.rim").startswith(f"{two}:")
    assert loaded.place_of("lift") == two
