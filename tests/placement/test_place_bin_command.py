"""`reachmap place-bin` from the map to the file, on cells cut down to seconds."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pinocchio as pin
import pytest
from click.testing import CliRunner
from ruamel.yaml import YAML

from reachmap.cell.loading import read_cell
from reachmap.cli import group
from reachmap.core.scene import Scene
from reachmap.geometry import yaw_transform
from reachmap.maps import read_bin_map, read_placement
from reachmap.maps.provenance import cell_of_artefact
from reachmap.tools.workspace_scan import workspace_scan
from tests.support.dense_checks import dense_free
from tests.support.optional import present
from tests.support.pinhole import corners_of, sees

UR5_CUBES = [
    f"workspace_scan.cubes.{k}.{name}={value}"
    for k, (low, high) in enumerate([(-0.8, 0), (0, 0.8)])
    for name, value in (
        ("grid", "[6,4]"),
        ("min", f"[0,{low},-0.2]"),
        ("max", f"[1,{high},0.2]"),
    )
]
FEW = [
    f"{scan}.orientations.{name}={value}"
    for scan in ("workspace_scan", "bin_scan")
    for name, value in (
        ("tilts_deg", "[0,30]"),
        ("azimuths", "[1,4]"),
        ("rolls", "1"),
        ("roll_offset_deg", "30" if scan == "workspace_scan" else "120"),
    )
]
UR5 = [
    *UR5_CUBES,
    *FEW,
    "workspace_scan.z_step=0.2",
    "bin_scan.grid=[4,3]",
    "tool.roll=listed",
]
TOY = [
    'workspace_scan.cubes=[{"name":"all","min":[-0.6,-0.6,0],"max":[0.6,0.6,0],'
    '"grid":[7,7]}]',
    "bin_scan.grid=[3,2]",
]
AT_TOY_HEIGHT = ("--fix", "z=-0.2", "--region", "-0.5", "0.5", "0.1", "0.6")


def run(*arguments):
    """Run a command in this process; stdout, stderr and exit code."""
    return CliRunner().invoke(group, [str(a) for a in arguments])


def place(*arguments, workers=1):
    """Run place-bin."""
    return run("place-bin", *arguments, "-j", workers, "--no-progress")


@pytest.fixture(scope="module")
def ur5(tmp_path_factory):
    """A folder with a workspace map of the UR5 cell, and its bin placed at z = 0."""
    folder = tmp_path_factory.mktemp("ur5")
    workspace_scan("ur5-eye-in-hand", folder / "workspace.h5", overrides=UR5)
    result = place(
        folder / "workspace.h5", "-o", folder / "placement.h5",
        "--fix", "z=0.02", "--fix", "yaw=90", "--region", "0.2", "0.8", "-0.1", "0.5",
        "--top", "2",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    (folder / "table.txt").write_text(result.stdout)
    return folder


@pytest.fixture(scope="module")
def toy(tmp_path_factory):
    """A folder with a workspace map of the planar arm, and its bin placed."""
    folder = tmp_path_factory.mktemp("toy")
    workspace_scan("planar-toy", folder / "workspace.h5", overrides=TOY)
    result = place(
        folder / "workspace.h5", "-o", folder / "placement.h5", "--json", *AT_TOY_HEIGHT
    )
    assert result.exit_code == 0, result.stderr
    assert result.stderr == ""
    (folder / "facts.json").write_text(result.stdout)
    return folder


def pose_rows(lines):
    """Lines of the table that have a pose."""
    return [line for line in lines if "°" in line and not line.startswith("margin")]


def placed_cell(path):
    """A placement and the cell in it."""
    placement = read_placement(path)
    return placement, cell_of_artefact(placement.provenance, str(path), ())


def camera_pose(loaded, placement):
    """T_base_camera at the stored configuration, by Pinocchio alone."""
    model = pin.buildModelFromXML(loaded.urdf)
    data, q = model.createData(), pin.neutral(model)
    values = zip(placement.joint_names, placement.scan_configuration, strict=True)
    for name, value in values:
        q[model.joints[model.getJointId(name)].idx_q] = value
    pin.framesForwardKinematics(model, data, q)
    camera = loaded.cell.camera
    base, flange = (
        data.oMf[model.getFrameId(name)].homogeneous
        for name in ("base_link", camera.parent)
    )
    T_flange_camera = np.eye(4)
    T_flange_camera[:3, 3] = camera.xyz
    return np.linalg.inv(base) @ flange @ T_flange_camera


def test_the_stored_configuration_images_the_whole_inner_bin(ur5):
    """Every inner corner, rim included, is in the picture and within range."""
    placement, loaded = placed_cell(ur5 / "placement.h5")
    inner = loaded.cell.bin.inner
    T_base_camera = camera_pose(loaded, placement)
    T_base_bin = placement.bin_pose
    for corner in corners_of(inner, inner[2]):
        point = T_base_bin[:3, :3] @ corner + T_base_bin[:3, 3]
        assert sees(loaded.cell.camera, T_base_camera, point, in_range="along the axis")


def test_the_stored_configuration_is_free_with_the_bin_in_place(ur5):
    """No two bodies touch, checked on the meshes; and it is not the cell's own."""
    placement, loaded = placed_cell(ur5 / "placement.h5")
    q = placement.scan_configuration
    scene = Scene.build(loaded, with_bin=True)
    assert np.allclose(scene.T_base_bin, placement.bin_pose)
    assert np.allclose(scene.scan_configuration, q)
    assert dense_free(scene, q, q, margin_m=loaded.cell.collision.safety_margin_m)
    own = read_cell("ur5-eye-in-hand").scan_configuration_rad
    assert np.abs(q - [own[name] for name in placement.joint_names]).max() > 0.01


def test_options_and_table_agree_with_the_file(ur5):
    """The pose obeys --fix and --region; the table shows what is stored."""
    placement, _ = placed_cell(ur5 / "placement.h5")
    x, y, z, yaw = placement.candidate_pose[placement.chosen]
    assert z == 0.02
    assert yaw == pytest.approx(np.pi / 2)
    assert 0.2 <= x <= 0.8
    assert -0.1 <= y <= 0.5
    assert np.allclose(placement.bin_pose, yaw_transform(x, y, z, yaw))
    best = placement.score[placement.chosen]
    assert best >= np.nanmax(placement.score[placement.exact > 0]) - 0.5
    lines = (ur5 / "table.txt").read_text().splitlines()
    chosen = next(line for line in lines if line.endswith("chosen"))
    assert f"{x:+7.3f} {y:+7.3f} {z:+7.3f}" in chosen
    assert f"{best:.1f} ± " in chosen
    assert 2 <= len(pose_rows(lines)) <= 4
    assert any(line.startswith("margin") and "+yaw" in line for line in lines)
    limit = placement.provenance.settings["placement"]["tool_limit_percent"]
    assert f"no pose can score more than {limit:.1f}%" in "\n".join(lines)
    assert best <= limit + 0.01 < 100.0


def test_bin_scan_goes_on_from_the_placement_alone(ur5, tmp_path):
    """Test grasps lie in the chosen bin and paths start at the stored configuration."""
    placement, _ = placed_cell(ur5 / "placement.h5")
    output = tmp_path / "bin.h5"
    result = run(
        "bin-scan", ur5 / "placement.h5", "-o", output, "-j", 1, "--no-progress",
        "--set", "bin_scan.repeats=1", "--set", "bin_scan.grid=[2,2]",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    bin_map = read_bin_map(output)
    assert np.allclose(bin_map.bin_pose, placement.bin_pose)
    starts = np.cumsum(bin_map.paths.row_size) - bin_map.paths.row_size
    assert len(starts) > 5
    assert np.allclose(
        bin_map.paths.configuration[starts], placement.scan_configuration
    )


def test_the_exported_cell_is_the_placed_cell(ur5, tmp_path):
    """YAML and back: the same cell, with the chosen pose and configuration."""
    placement, loaded = placed_cell(ur5 / "placement.h5")
    path = tmp_path / "cell.yaml"
    assert run("cells", "--export", ur5 / "placement.h5", "-o", path).exit_code == 0
    exported = read_cell(str(path))
    assert exported.cell == loaded.cell
    assert exported.sha256 == loaded.sha256
    assert np.allclose(exported.cell.bin.pose.matrix(), placement.bin_pose)
    assert run("check", path).exit_code == 0


def moved_by_hand(ur5, path, xyz):
    """Export the placed cell and move its bin with an editor."""
    run("cells", "--export", ur5 / "placement.h5", "-o", path)
    yaml = YAML(typ="safe", pure=True)
    cell = yaml.load(path.read_text())
    cell["bin"]["pose"]["xyz"] = xyz
    with path.open("w") as stream:
        yaml.dump(cell, stream)


@pytest.mark.parametrize("command", ["bin-scan", "check"])
def test_a_bin_moved_into_the_pedestal_is_refused(ur5, tmp_path, command):
    """Both names in one line, exit code 2, nothing written."""
    path = tmp_path / "cell.yaml"
    moved_by_hand(ur5, path, [0.2, 0.2, -0.1])
    if command == "check":
        result = run("check", path)
    else:
        result = run("bin-scan", "--cell", path, "-o", tmp_path / "bin.h5", "-j", 1)
        assert not (tmp_path / "bin.h5").exists()
    assert result.exit_code == 2
    assert "bin.pose: bin" in result.output
    assert "touches pedestal" in result.output


def test_a_bin_moved_into_the_arm_is_refused(ur5, tmp_path):
    """A bin lifted to the camera meets what the arm carries, which is named."""
    placement, loaded = placed_cell(ur5 / "placement.h5")
    camera = camera_pose(loaded, placement)
    path = tmp_path / "cell.yaml"
    moved_by_hand(ur5, path, [float(v) for v in camera[:3, 3] - [0, 0, 0.02]])
    result = run("bin-scan", "--cell", path, "-o", tmp_path / "bin.h5", "-j", 1)
    assert result.exit_code == 2
    assert "scan_configuration: suction tube touches bin" in result.stderr


def test_a_given_pose_in_the_pedestal_is_refused(ur5, tmp_path):
    """--bin-pose into the pedestal names both bodies and writes nothing."""
    output = tmp_path / "placement.h5"
    pose = ("--bin-pose", "0.2", "0.2", "-0.1", "0")
    result = place(ur5 / "workspace.h5", "-o", output, *pose)
    assert result.exit_code == 2
    assert "--bin-pose: bin" in result.stderr
    assert "touches pedestal" in result.stderr
    assert not output.exists()


def test_a_region_without_a_feasible_pose_is_refused(ur5, tmp_path):
    """A region inside the pedestal says what stands there."""
    result = place(
        ur5 / "workspace.h5", "-o", tmp_path / "placement.h5",
        "--region", "0", "0.1", "-0.1", "0.1", "--heights", "-0.2", "-0.1",
    )  # fmt: skip
    assert result.exit_code == 2
    assert "the bin can stand nowhere in the region" in result.stderr
    assert "the bin collides with pedestal" in result.stderr


def test_a_region_off_the_map_is_refused(toy, tmp_path):
    """A region outside the map says what there is."""
    output = tmp_path / "placement.h5"
    result = place(toy / "workspace.h5", "-o", output, "--region", 5, 6, 0, 1)
    assert result.exit_code == 2
    assert "x from 5 to 6" in result.stderr
    assert "only from -0.6 to 0.6" in result.stderr


def test_the_configuration_may_be_kept(ur5, tmp_path):
    """--keep-scan-configuration stores the cell's own, with a given pose as well."""
    output = tmp_path / "placement.h5"
    result = place(
        ur5 / "workspace.h5", "-o", output, "--keep-scan-configuration",
        "--bin-pose", "0.5", "0.0", "0.0", "90", "--json",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    placement, loaded = placed_cell(output)
    own = read_cell("ur5-eye-in-hand").scan_configuration_rad
    wanted = [own[name] for name in placement.joint_names]
    assert np.allclose(placement.scan_configuration, wanted)
    assert placement.provenance.settings["placement"]["scan_configuration"] == "kept"
    assert placement.rule == "given"
    facts = json.loads(result.stdout)
    assert facts["chosen"]["xyz_m"] == [0.5, 0.0, 0.0]
    assert facts["chosen"]["yaw_deg"] == 90.0
    assert np.allclose(loaded.cell.bin.pose.xyz, [0.5, 0.0, 0.0])


def test_json_is_one_object_with_what_is_stored(toy):
    """--json alone on stdout: chosen, runner-up, margin and counts."""
    facts = json.loads((toy / "facts.json").read_text())
    placement = read_placement(toy / "placement.h5")
    x, y, z, _ = placement.candidate_pose[placement.chosen]
    assert facts["chosen"]["xyz_m"] == pytest.approx([x, y, z], abs=1e-4)
    assert facts["chosen"]["score_percent"] == pytest.approx(
        placement.score[placement.chosen], abs=0.01
    )
    assert facts["candidates"] == len(placement.score)
    assert facts["mapped_with_bin"] == (placement.exact > 0).sum()
    assert set(facts["margin_m"]) == {"+x", "-x", "+y", "-y", "+z", "-z"}
    assert set(facts["margin_deg"]) == {"+yaw", "-yaw"}
    assert facts["output"] == str(toy / "placement.h5")
    assert facts["tolerance"] == {"shift_m": 0.03, "turn_deg": 5.0}
    worst = present(placement.worst_score)
    assert facts["chosen"]["worst_case_percent"] == pytest.approx(
        worst[placement.chosen], abs=0.01
    )
    assert facts["chosen"]["worst_case_percent"] == pytest.approx(
        np.nanmax(worst), abs=facts["chosen"]["score_error_points"]
    )


def test_without_a_tolerance_the_best_score_is_chosen(toy, tmp_path):
    """--tolerance 0 0 asks for the pose itself, and no worst case is stated."""
    output = tmp_path / "placement.h5"
    place(toy / "workspace.h5", "-o", output, "--tolerance", 0, 0, *AT_TOY_HEIGHT)
    placement = read_placement(output)
    assert placement.tolerance == (0.0, 0.0)
    exact = placement.exact > 0
    assert placement.score[placement.chosen] >= np.nanmax(placement.score[exact]) - 0.5
    assert np.isnan(present(placement.worst_score)).all()
    steady = read_placement(toy / "placement.h5")
    assert present(steady.score_error)[steady.chosen] > 0


def test_top_is_how_many_places_are_mapped_and_printed(toy, tmp_path):
    """--top 1 maps fewer poses and prints the chosen one, and another at most."""
    output = tmp_path / "placement.h5"
    result = place(toy / "workspace.h5", "-o", output, "--top", 1, *AT_TOY_HEIGHT)
    assert 1 <= len(pose_rows(result.stdout.splitlines())) <= 2
    fewer, more = (read_placement(p) for p in (output, toy / "placement.h5"))
    assert (fewer.exact > 0).sum() < (more.exact > 0).sum()


def test_two_workers_write_what_one_writes(toy, tmp_path):
    """The content is the same, whoever did the work."""
    output = tmp_path / "placement.h5"
    place(toy / "workspace.h5", "-o", output, *AT_TOY_HEIGHT, workers=2)
    one, two = (read_placement(p) for p in (toy / "placement.h5", output))
    assert one.stamp.content_sha256 == two.stamp.content_sha256


def test_the_papers_rule_has_the_papers_point(toy, tmp_path):
    """--rule paper puts the bin on a 100 % point of the map, and draws it."""
    output, picture = tmp_path / "placement.h5", tmp_path / "p.svg"
    result = place(
        toy / "workspace.h5", "-o", output, "--rule", "paper", "--picture", picture
    )
    assert result.exit_code == 0, result.stderr
    placement = read_placement(output)
    assert placement.rule == "paper"
    # All grasps lie above the plane in which the toy arm moves.
    assert "no IK solution 24); most likely cause: no IK" in result.stderr
    assert placement.paper_choice == placement.chosen
    assert picture.read_text().startswith("<?xml")


def test_nothing_is_overwritten(toy, tmp_path):
    """An output that exists is refused before the work, with the remedy."""
    output = tmp_path / "placement.h5"
    shutil.copy(toy / "workspace.h5", output)
    before = output.read_bytes()
    result = place(toy / "workspace.h5", "-o", output)
    assert result.exit_code == 2
    assert "--overwrite" in result.stderr
    assert output.read_bytes() == before


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--fix", "roll=3"), "NAME one of x, y, z, yaw"),
        (("--fix", "z=low"), "is not NAME=NUMBER"),
        (("--top", "0"), "0 is not in the range"),
        (("--fix", "z=7"), "z = 7 is not possible"),
    ],
)
def test_wrong_options_say_what_is_right(toy, tmp_path, arguments, words):
    """A wrong option is refused with what was expected."""
    result = place(toy / "workspace.h5", "-o", tmp_path / "p.h5", *arguments)
    assert result.exit_code == 2
    assert words in result.stderr


@pytest.mark.slow
def test_two_workers_agree_on_the_shipped_cell(ur5, tmp_path):
    """With meshes, a new scan configuration and real starts, the content is equal."""
    hashes = set()
    for workers in (1, 2):
        output = tmp_path / f"{workers}.h5"
        result = place(ur5 / "workspace.h5", "-o", output, workers=workers)
        assert result.exit_code == 0, result.stderr
        hashes.add(read_placement(output).stamp.content_sha256)
    assert len(hashes) == 1


@pytest.mark.parametrize(("pitch_deg", "is_said"), [(20, True), (0, False)])
def test_a_bin_that_leans_is_said_to_be_placed_upright(
    toy, tmp_path, pitch_deg, is_said
):
    """Only x, y, z and yaw are searched, so its lean does not stay."""
    output = tmp_path / "placement.h5"
    lean = f"bin.pose={{xyz: [0.3, 0.3, -0.2], rpy_deg: [0, {pitch_deg}, 0]}}"
    result = place(toy / "workspace.h5", "-o", output, "--set", lean, "--top", "1")
    assert result.exit_code == 0, result.stderr
    said = f"the bin leans by {pitch_deg} deg; it is placed upright"
    assert (said in result.stderr) == is_said
    np.testing.assert_allclose(read_placement(output).bin_pose[2], [0, 0, 1, -0.2])


@pytest.mark.parametrize(
    ("frame", "xyz", "is_said"),
    [
        ("world", [0.3, 0.3, -0.19], True),
        ("robot_base", [0.37, 0.3, -0.19], True),
        ("world", [0.3, 0.3, -0.23], False),
        ("world", [0.3, 0.45, -0.19], False),
    ],
)
def test_bodies_that_the_bin_leaves_behind_are_named(
    toy, tmp_path, frame, xyz, is_said
):
    """Those inside it, not those below and beside it."""
    sphere = '"shape":{"sphere":{"radius":0.005}},"touch":["bin"]'
    body = f'{{"name":"divider","attach_to":"{frame}","pose":{{"xyz":{xyz}}},{sphere}}}'
    bin_pose = "bin.pose={xyz: [0.3, 0.3, -0.2]}"
    pose = ("--bin-pose", "0.1", "0.3", "-0.2", "0")
    words = ("--set", f"bodies.0={body}", "--set", bin_pose, *pose)
    output = tmp_path / "placement.h5"
    result = run("place-bin", toy / "workspace.h5", "-o", output, "-j", 1, *words)
    assert result.exit_code == 0, result.stderr
    assert ("inside the bin: divider. Bodies stay" in result.stderr) == is_said


def test_with_something_to_stand_on_every_pose_stands_on_it(toy, tmp_path):
    """Heights are those of the table, footprints inside it, and its name is stored."""
    bin_spec = read_cell("planar-toy").cell.bin
    centre_z = -0.2 - bin_spec.bottom_m - 0.01
    table = (
        'bodies.0={"name":"table","shape":{"box":[1.2,0.6,0.02]},'
        f'"pose":{{"xyz":[0.0,0.5,{centre_z}]}}}}'
    )
    output = tmp_path / "placement.h5"
    result = place(toy / "workspace.h5", "-o", output, "--set", table)
    assert result.exit_code == 0, result.stderr
    assert "the bin stands on table" in result.stdout
    placement = read_placement(output)
    assert placement.support == "table"
    fits = [k for k, reason in enumerate(placement.reason) if not reason]
    fits = [k for k in fits if k != placement.paper_choice]
    assert len(fits) > 3
    half = np.array(bin_spec.inner[:2]) / 2 + np.array(bin_spec.walls)
    for row in fits:
        x, y, z, yaw = placement.candidate_pose[row]
        assert z == pytest.approx(-0.2)
        c, s = np.cos(yaw), np.sin(yaw)
        for sx, sy in [(-1, -1), (1, -1), (1, 1), (-1, 1)]:
            u, v = sx * half[0], sy * half[1]
            assert abs(x + c * u - s * v) <= 0.6 + 1e-6
            assert abs(y + s * u + c * v - 0.5) <= 0.3 + 1e-6


def test_a_region_that_runs_backwards_is_refused_before_the_map_is_read(tmp_path):
    """Which would be refused itself."""
    (tmp_path / "w.h5").write_text("no map")
    for limits, said in (
        (("--region", "0.8", "0.2", "0", "1"), "x from 0.8 to 0.2"),
        (("--heights", "0.3", "0.1"), "z from 0.3 to 0.1"),
    ):
        result = place(tmp_path / "w.h5", *limits, "-o", tmp_path / "p.h5")
        assert result.exit_code == 2
        assert result.stderr.startswith(f"reachmap: {said}: expected two numbers")
