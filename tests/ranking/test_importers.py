"""Lists in other formats: recognised by content, each with its convention."""

from __future__ import annotations

import gzip
import io
import json
import time
import zipfile

import numpy as np
import pytest

from reachmap.errors import GraspListError, SettingsError
from reachmap.geometry import rotation_from_rpy_deg
from reachmap.ranking.lists.reading import read_grasps

R = rotation_from_rpy_deg(np.array([10.0, 20.0, 130.0]))
ISAAC = """
format: isaac_grasp
format_version: 1.0
object_frame: /World/mug
gripper_frame: /World/hand
grasps:
  "grasp_0":
    confidence: 0.75
    position: [-0.04, 0.06, 0.2]
    orientation: {w: 0.0, xyz: [1.0, 0.0, 0.0]}
    cspace_position: {finger: 0.01}
    made: 2026-01-01
object_scale: 0.001
"""


def graspnet_rows(n=3, dtype=np.float32):
    """Rows of 17 columns: score, width, height, depth, R by rows, t, object."""
    row = [0.9, 0.06, 0.02, 0.03, *R.ravel(), 0.1, 0.2, 0.3, 7]
    return np.tile(np.array(row, dtype), (n, 1))


def suction_rows(n=3):
    """Rows of 7 columns: score, unit normal, point."""
    return np.tile([0.9, 0.0, 0.6, 0.8, 0.1, -0.2, 0.05], (n, 1))


def saved(path, array, **how):
    """The array as an .npy file."""
    np.save(path, array, **how)
    return path


def test_isaac_grasp(tmp_path):
    """Split quaternions are joined, +z approaches, the confidence is the score."""
    path = tmp_path / "mug.yaml"
    path.write_text(ISAAC)
    grasps = read_grasps(path, frame="robot_base")
    np.testing.assert_allclose(grasps.points, [[-0.04, 0.06, 0.2]])
    # A half turn about x: the gripper's z points down.
    np.testing.assert_allclose(grasps.directions, [[0, 0, -1.0]], atol=1e-15)
    assert grasps.scores.tolist() == [0.75]
    assert grasps.ids == ("grasp_0",)
    assert grasps.document["source"] == {
        "object_frame": "/World/mug",
        "gripper_frame": "/World/hand",
        "object_scale": 0.001,
        "imported_from": "isaac_grasp",
    }
    (grasp,) = grasps.document["grasps"]
    # A date is no value of JSON.
    assert [key for key in grasp if key.startswith("x_")] == ["x_cspace_position"]
    assert grasp["x_cspace_position"] == {"finger": 0.01}


@pytest.mark.parametrize("nothing", ["", " {}"])
def test_isaac_files_without_grasps_are_empty_lists(tmp_path, nothing):
    """The key is there, its value may be left out."""
    path = tmp_path / "none.yaml"
    path.write_text(ISAAC.partition("grasps:")[0] + f"grasps:{nothing}\n")
    assert len(read_grasps(path, frame="robot_base").points) == 0


def test_graspnet_rows(tmp_path):
    """Columns are where GraspNet puts them, and +x of the matrix approaches."""
    path = saved(tmp_path / "g.npy", graspnet_rows())
    grasps = read_grasps(path, frame="robot_base")
    np.testing.assert_allclose(grasps.points[0], [0.1, 0.2, 0.3], atol=1e-7)
    np.testing.assert_allclose(grasps.rotations[0], R, atol=1e-6)
    np.testing.assert_allclose(grasps.directions[0], R[:, 0], atol=1e-6)
    assert grasps.approach_axis == "+x"
    first = grasps.document["grasps"][0]
    assert first["object_id"] == 7
    assert first["width"] == pytest.approx(0.06)
    assert first["x_depth"] == pytest.approx(0.03)


@pytest.mark.parametrize("order", ["normal-first", "point-first"])
def test_suction_rows(tmp_path, order):
    """The unit triple is the normal, wherever it is, and the approach is against it."""
    normal, point = np.array([0.0, 0.6, 0.8]), np.array([0.1, -0.2, 0.05])
    triples = [normal, point] if order == "normal-first" else [point, normal]
    path = saved(tmp_path / "s.npy", np.array([[0.5, *np.concatenate(triples)]]))
    for name in (None, "suction", f"suction-{order}"):
        grasps = read_grasps(path, frame="bin", source_format=name)
        np.testing.assert_allclose(grasps.points, [point])
        np.testing.assert_allclose(grasps.directions, [-normal], atol=1e-15)
    assert not grasps.has_rotation.any()


def test_suction_rows_that_could_be_read_either_way(tmp_path):
    """Two unit triples are not guessed at, but the order can be said."""
    path = saved(tmp_path / "s.npy", np.array([[0.5, 0, 0, 1, 0, 1, 0]], float))
    with pytest.raises(GraspListError, match=r"both of .* suction-point-first"):
        read_grasps(path, frame="bin")
    grasps = read_grasps(path, frame="bin", source_format="suction-point-first")
    np.testing.assert_allclose(grasps.points, [[0, 0, 1.0]])


def test_graspgen(tmp_path):
    """4×4 transforms, +z approaches; grasps that failed are left out and counted."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, [0.01, 0.02, 0.03]
    data = {
        "object": {"file": "mug.obj", "scale": 1.0},
        "grasps": {"transforms": [T.tolist()] * 3, "object_in_gripper": [1, 0, True]},
    }
    path = tmp_path / "mug.json"
    path.write_text(json.dumps(data))
    grasps = read_grasps(path, frame="robot_base")
    assert grasps.ids == ("0", "2")
    np.testing.assert_allclose(grasps.rotations[1], R)
    np.testing.assert_allclose(grasps.directions[1], R[:, 2])
    assert "1 transforms that failed" in grasps.warnings[0]
    assert grasps.document["source"]["object"] == {"file": "mug.obj", "scale": 1.0}


def test_npz_files(tmp_path):
    """The one array with 17 or 7 columns is taken; two are not guessed between."""
    path = tmp_path / "g.npz"
    np.savez(path, preds=graspnet_rows(), other=np.zeros(3))
    assert len(read_grasps(path, frame="bin")) == 3
    np.savez_compressed(path, a=graspnet_rows(), b=graspnet_rows())
    with pytest.raises(GraspListError, match=r"expected one array .*got 2 among"):
        read_grasps(path, frame="bin")
    np.savez(path, a=np.zeros((2, 3)))
    with pytest.raises(GraspListError, match="expected 17 columns"):
        read_grasps(path, frame="bin")


@pytest.mark.parametrize("dtype", ["<f4", ">f4", "<f8", ">f8"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_npy_layouts_agree_with_numpy(tmp_path, dtype, order):
    """Byte orders and column-first storage are read as numpy reads them."""
    rows = np.asarray(graspnet_rows(4, np.float64), dtype=dtype, order=order)
    path = saved(tmp_path / "g.npy", rows)
    grasps = read_grasps(path, frame="bin")
    np.testing.assert_allclose(grasps.points, np.load(path)[:, 13:16])


def test_a_flat_array_is_one_grasp(tmp_path):
    """A single row may have been saved without its second dimension."""
    path = saved(tmp_path / "g.npy", graspnet_rows()[0])
    assert len(read_grasps(path, frame="bin")) == 1


def test_pickles_are_refused(tmp_path):
    """An array of objects, which only a pickle can hold, is never loaded."""
    path = saved(tmp_path / "g.npy", np.array([{"a": 1}]), allow_pickle=True)
    with pytest.raises(GraspListError, match="complete array of numbers"):
        read_grasps(path, frame="bin")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: data[:-1], "complete array of numbers"),
        (lambda data: data[:9], "not a readable .npy"),
        (lambda data: data.replace(b"(3, 17)", b"(9999999999, 17)"), "complete array"),
        (lambda data: data.replace(b"(3, 17)", b"(-3, 17)"), "complete array"),
        (lambda data: data.replace(b"(3, 17)", b"(3, 'a')"), "not a readable .npy"),
        (lambda data: data.replace(b"(3, 17)", b"(-1,-51)"), "complete array"),
        (lambda data: data.replace(b"<f4", b"<c8"), "complete array of numbers"),
        (lambda data: data.replace(b"<f4", b"<c4"), "not a readable .npy"),
        (lambda data: data.replace(b"{'descr'", b"['descr'"), "not a readable .npy"),
    ],
)
def test_damaged_arrays(tmp_path, change, message):
    """Truncated and lying .npy headers are refused before anything is allocated."""
    stream = io.BytesIO()
    np.save(stream, graspnet_rows())
    path = tmp_path / "g.npy"
    path.write_bytes(change(stream.getvalue()))
    with pytest.raises(GraspListError, match=message):
        read_grasps(path, frame="bin")


def test_archives_that_expand_are_refused(tmp_path):
    """A small file that unpacks into much is refused by its directory."""
    path = tmp_path / "g.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.npy", b"\0" * (65 * 2**20))
    with pytest.raises(GraspListError, match=r"more than .* bytes inside"):
        read_grasps(path, frame="bin")
    path.write_bytes(b"PK\x03\x04 no archive")
    with pytest.raises(GraspListError, match=r"not a readable .npz"):
        read_grasps(path, frame="bin")


@pytest.mark.parametrize("method", ["DEFLATED", "BZIP2", "LZMA"])
def test_archives_with_a_flipped_bit_are_refused(tmp_path, method):
    """Whatever the decompressor calls it, and wherever the bit is."""
    path = tmp_path / "g.npz"
    with zipfile.ZipFile(path, "w", getattr(zipfile, f"ZIP_{method}")) as archive:
        stream = io.BytesIO()
        np.save(stream, graspnet_rows(40))
        archive.writestr("rows.npy", stream.getvalue())
    whole = path.read_bytes()
    messages = []
    for at in np.linspace(30, len(whole) - 60, 60).astype(int):
        damaged = bytearray(whole)
        damaged[at] ^= 1 << (at % 8)
        path.write_bytes(damaged)
        try:
            read_grasps(path, frame="bin")
        except GraspListError as error:
            messages.append(str(error))
    assert len(messages) > 50
    assert all("g.npz" in message for message in messages)


@pytest.mark.parametrize("nested", ["[" * 10**5, "- " * 10**5, "{a: " * 10**5])
def test_deep_yaml_is_refused_at_once(tmp_path, nested):
    """The reader would take minutes; its depth is looked at as it goes."""
    path = tmp_path / "g.yaml"
    path.write_text(ISAAC + "x: \n  " + nested)
    begin = time.process_time()
    with pytest.raises(GraspListError, match="nest"):
        read_grasps(path, frame="bin")
    assert time.process_time() - begin < 5.0


def test_more_rows_than_the_limit(tmp_path):
    """A huge array is refused before a grasp is made of each row."""
    path = saved(tmp_path / "s.npy", np.zeros((100_001, 7), np.float32))
    with pytest.raises(GraspListError, match="100001 rows; the limit is 100000"):
        read_grasps(path, frame="bin")


def test_rows_that_are_not_finite(tmp_path):
    """NaN in an array is refused with the row."""
    rows = graspnet_rows()
    rows[1, 4] = np.nan
    with pytest.raises(GraspListError, match="the first is row 1"):
        read_grasps(saved(tmp_path / "g.npy", rows), frame="bin")


@pytest.mark.parametrize("rows_of", [graspnet_rows, suction_rows])
def test_a_row_of_nan_does_not_lose_the_others(tmp_path, rows_of):
    """Asked for, it is an invalid grasp, its score and all."""
    rows = np.array(rows_of(), float)
    whole = read_grasps(saved(tmp_path / "w.npy", rows), frame="bin")
    rows[1] = np.nan
    path = saved(tmp_path / "g.npy", rows)
    marked = read_grasps(path, frame="bin", invalid="mark")
    others = np.arange(len(rows)) != 1
    np.testing.assert_array_equal(marked.points[others], whole.points[others])
    np.testing.assert_array_equal(marked.directions[others], whole.directions[others])
    np.testing.assert_array_equal(marked.scores[others], whole.scores[others])
    assert np.isnan(marked.points[1]).all()
    assert np.isnan(marked.scores[1])
    assert any("grasps[1].position[0]" in line for line in marked.warnings)


@pytest.mark.parametrize(
    ("shape", "name"),
    [((0,), None), ((0,), "suction"), ((0, 7), None), ((0, 17), None)],
)
def test_an_image_without_grasps_is_a_list(tmp_path, shape, name):
    """Whichever way a program stores that it found nothing."""
    path = saved(tmp_path / "e.npy", np.zeros(shape))
    assert len(read_grasps(path, frame="bin", source_format=name)) == 0


def test_compressed_lists_are_told_as_such(tmp_path):
    """With what packs them."""
    (tmp_path / "g.json.gz").write_bytes(gzip.compress(b"{}"))
    with pytest.raises(GraspListError, match=r"is compressed \(gzip\); unpack it"):
        read_grasps(tmp_path / "g.json.gz")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (ISAAC.replace("1.0", "2.0", 1), "isaac_grasp version 1 is read"),
        (ISAAC.replace("{w: 0.0, xyz", "{xyz"), "orientation {w, xyz}"),
        (ISAAC.replace("[1.0, 0.0, 0.0]", "[1.0, 0.0]"), "expected 4 numbers"),
        (
            ISAAC.replace("confidence: 0.75", "confidence: 2020-01-01"),
            "score: expected",
        ),
        (ISAAC.replace("position: [", "position: [[]", 1), "not valid YAML"),
        (ISAAC.replace("[-0.04", "[!!python/name:os.system"), "YAML"),
        (ISAAC.replace("[-0.04", "[.nan"), r"position\[0\]: expected a finite"),
        (ISAAC + "grasps: {}\n", "not valid YAML"),
        ("format: isaac_grasp\nformat_version: 1.0\n", "grasps: expected names"),
    ],
)
def test_wrong_yaml(tmp_path, text, message):
    """Tags, repeated keys, missing parts and odd types are mistakes, not crashes."""
    path = tmp_path / "mug.yaml"
    path.write_text(text)
    with pytest.raises(GraspListError, match=message):
        read_grasps(path, frame="bin")


@pytest.mark.parametrize(
    ("grasps", "message"),
    [
        ({"transforms": 3}, "needs a list grasps.transforms"),
        ({"transforms": [[1]]}, "expected a 4×4 matrix"),
        ({"transforms": [[[1, 0, 0, 0]] * 4]}, "expected a 4×4 matrix"),
        ({"transforms": [], "object_in_gripper": [1]}, "expected a flag for each"),
    ],
)
def test_wrong_graspgen(tmp_path, grasps, message):
    """Shapes that do not fit are named."""
    path = tmp_path / "g.json"
    path.write_text(json.dumps({"grasps": grasps}))
    with pytest.raises(GraspListError, match=message):
        read_grasps(path, frame="bin")


def test_imported_lists_need_a_frame(tmp_path):
    """None of these formats names a frame of the cell; there is no default."""
    path = saved(tmp_path / "g.npy", graspnet_rows())
    with pytest.raises(GraspListError, match="say with --frame"):
        read_grasps(path)


def test_the_format_can_be_forced(tmp_path):
    """--from is obeyed, and refused where the content cannot be that."""
    path = saved(tmp_path / "g.npy", graspnet_rows())
    assert len(read_grasps(path, frame="bin", source_format="graspnet")) == 3
    with pytest.raises(GraspListError, match="cannot be of the format graspgen"):
        read_grasps(path, frame="bin", source_format="graspgen")
    with pytest.raises(GraspListError, match="suction has 7 columns"):
        read_grasps(path, frame="bin", source_format="suction")
    with pytest.raises(SettingsError, match="unknown format 'csv'"):
        read_grasps(path, source_format="csv")


def test_another_approach_axis_can_be_stated(tmp_path):
    """A gripper that was authored along another axis is read so."""
    path = tmp_path / "mug.yaml"
    path.write_text(ISAAC)
    grasps = read_grasps(path, frame="bin", approach_axis="+x")
    np.testing.assert_allclose(grasps.directions, [[1.0, 0, 0]], atol=1e-15)
