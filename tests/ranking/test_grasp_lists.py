"""Reading grasp lists: every rule, every mistake at once, with its line."""

from __future__ import annotations

import copy
import json
from importlib.resources import files
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reachmap.errors import GraspListError
from reachmap.ranking.lists.json_text import lines_of, parse_json
from reachmap.ranking.lists.reading import grasps_from_document, read_grasps
from tests.support.optional import present

EXAMPLES = Path(__file__).parents[2] / "examples"
SCHEMA = json.loads(
    (files("reachmap.ranking") / "grasps-1.schema.json").read_text("utf-8")
)
DOWN = {"position": [0.1, 0.0, 0.05], "direction": [0, 0, -1]}


def document(*grasps, **header):
    """A minimal valid document, changed."""
    start = {"format": "reachmap.grasps", "format_version": "1.0", "frame": "bin"}
    return {**start, **header, "grasps": list(grasps or [DOWN])}


def written(path, data):
    """A file that holds JSON of the data, one item a line."""
    path.write_text(json.dumps(data, indent=1))
    return path


@pytest.mark.parametrize("name", ["pile-1.json", "pile-2.json"])
def test_examples_are_read(name):
    """The example heaps are valid: unit directions, quadrants, ids, no warning."""
    grasps = read_grasps(EXAMPLES / name)
    assert len(grasps) > 160
    assert not grasps.warnings
    assert not grasps.has_rotation.any()
    np.testing.assert_allclose(np.linalg.norm(grasps.directions, axis=1), 1.0)
    assert grasps.ids[0] == "NW-00"
    jsonschema.validate(dict(grasps.document), SCHEMA)


def test_the_four_forms_of_an_orientation_agree():
    """One rotation as wxyz, xyzw and matrix is the same; direction is its axis."""
    c, s = np.cos(0.3), np.sin(0.3)
    R = [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]
    w, z = np.cos(0.15), np.sin(0.15)
    forms = [
        {"rotation_matrix": R},
        {"quaternion_wxyz": [w, 0, 0, z]},
        {"quaternion_xyzw": [0, 0, z, w]},
        {"direction": [0, 0, 2.5]},
    ]
    listed = [{"position": [0, 0, 0], **form} for form in forms]
    grasps = grasps_from_document(document(*listed))
    for row in range(3):
        np.testing.assert_allclose(grasps.rotations[row], R, atol=1e-15)
    np.testing.assert_allclose(grasps.directions, [[0, 0, 1.0]] * 4, atol=1e-15)
    assert grasps.has_rotation.tolist() == [True, True, True, False]


@pytest.mark.parametrize("axis", ["+x", "-x", "+y", "-y", "+z", "-z"])
def test_the_approach_axis_names_a_column(axis):
    """The direction of a full orientation is the signed column of its matrix."""
    R = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    one = {"position": [0, 0, 0], "rotation_matrix": R}
    grasps = grasps_from_document(document(one, approach_axis=axis))
    sign = 1.0 if axis[0] == "+" else -1.0
    column = [row["xyz".index(axis[1])] for row in R]
    np.testing.assert_allclose(grasps.directions[0], sign * np.array(column))


def test_millimetres_and_outward_normals():
    """Lengths in mm become metres; a normal out of the surface is turned round."""
    one = {"position": [100, -50, 30], "direction": [0, 0.6, 0.8]}
    pose = {"position": [1000, 0, 0]}
    grasps = grasps_from_document(
        document(
            one,
            units={"length": "mm", "angle": "deg"},
            direction_convention="outward_normal",
            frame="camera",
            bin_pose=pose,
        )
    )
    np.testing.assert_allclose(grasps.points, [[0.1, -0.05, 0.03]])
    np.testing.assert_allclose(grasps.directions, [[0, -0.6, -0.8]])
    np.testing.assert_allclose(present(grasps.T_frame_bin)[:3, 3], [1.0, 0.0, 0.0])


def test_a_direction_may_have_any_length():
    """Lengths whose squares over- or underflow give the same unit vector."""
    listed = [
        {"position": [0, 0, 0], "direction": [0, 3e-3 * scale, -4e-3 * scale]}
        for scale in (1e-3, 1.0, 1e200, 1e300)
    ]
    grasps = grasps_from_document(document(*listed))
    np.testing.assert_allclose(grasps.directions, [[0, 0.6, -0.8]] * 4)


def test_small_errors_of_rotations_are_corrected_with_a_warning():
    """Printed digits pass silently or with a warning; the result is a rotation."""
    quaternion = {"position": [0, 0, 0], "quaternion_wxyz": [0.999849, 0, 0, 0]}
    rough = {"position": [0, 0, 0], "quaternion_wxyz": [1.005, 0, 0, 0]}
    skewed = {
        "position": [0, 0, 0],
        "rotation_matrix": [[1, 0.003, 0], [0, 1, 0], [0, 0, 1]],
    }
    grasps = grasps_from_document(document(quaternion, rough, skewed))
    products = grasps.rotations @ np.swapaxes(grasps.rotations, 1, 2)
    np.testing.assert_allclose(
        products, np.broadcast_to(np.eye(3), (3, 3, 3)), atol=1e-12
    )
    assert len(grasps.warnings) == 2
    assert "grasps[1].quaternion_wxyz" in grasps.warnings[0]
    assert "grasps[2].rotation_matrix" in grasps.warnings[1]


MISTAKES: dict[str, tuple[dict[str, Any], str]] = {
    "format": ({"format": "other.grasps"}, "format: expected reachmap.grasps"),
    "version": ({"format_version": "2.0"}, "format_version: expected a string"),
    "version type": ({"format_version": 1.0}, "this program reads version 1"),
    "frame": ({"frame": ""}, "frame: expected the name of a frame"),
    "frame type": ({"frame": 3}, r"frame: expected the name of a frame \(got 3\)"),
    "unit": ({"units": {"length": "inch"}}, "units.length: expected one of m, mm"),
    "angle": ({"units": {"angle": 7}}, "units.angle: expected one of rad, deg"),
    "units type": ({"units": "mm"}, "units: expected an object"),
    "units key": ({"units": {"mass": "kg"}}, "units.mass: unknown key"),
    "axis": ({"approach_axis": "z"}, r"approach_axis: expected one of \+x"),
    "convention": ({"direction_convention": "in"}, "expected one of approach"),
    "source": ({"source": "net"}, "source: expected an object"),
    "key": ({"score": 1}, "score: unknown key; allowed are format"),
    "bin pose": ({"bin_pose": [0, 0]}, "bin_pose: expected an object"),
    "bin pose key": (
        {"bin_pose": {"position": [0, 0, 0], "rpy": [0, 0, 0]}},
        "bin_pose.rpy: unknown key",
    ),
    "bin pose empty": ({"bin_pose": {}}, "bin_pose: position is missing"),
    "list": ({"grasps": {}}, "grasps: expected a list"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes_of_the_header(name):
    """Each wrong value of the header is named with what was expected."""
    change, message = MISTAKES[name]
    with pytest.raises(GraspListError, match=message):
        grasps_from_document({**document(), **change})


GRASP_MISTAKES: dict[str, tuple[Any, str]] = {
    "not an object": (3, r"grasps\[0\]: expected an object \(got 3\)"),
    "no position": ({"direction": [0, 0, 1]}, "position is missing"),
    "no orientation": ({"position": [0, 0, 0]}, r"exactly one of .*\(got none\)"),
    "two": ({**DOWN, "quaternion_wxyz": [1, 0, 0, 0]}, "direction, quaternion_wxyz"),
    "length": ({**DOWN, "position": [0, 0]}, r"position: expected 3 numbers"),
    "text": ({**DOWN, "position": [0, "a", 0]}, r"position\[1\]: .*\(got 'a'\)"),
    "flag": ({**DOWN, "position": [0, True, 0]}, r"position\[1\]: .*\(got true\)"),
    "null": ({**DOWN, "position": [0, None, 0]}, r"position\[1\]: .*\(got null\)"),
    "far": ({**DOWN, "position": [412, 0, 0]}, "for millimetres give"),
    "big integer": ({**DOWN, "position": [10**400, 0, 0]}, r"position\[0\]: expected"),
    "zero": ({**DOWN, "direction": [0, 0, 0]}, "a direction needs a finite length"),
    "long": ({**DOWN, "direction": [1.7e308, 1.7e308, 0]}, "needs a finite length"),
    "quaternion": (
        {"position": [0, 0, 0], "quaternion_wxyz": [1, 1, 0, 0]},
        r"a unit quaternion has length 1 ± 0.01 \(got 1.414\)",
    ),
    "mirror": (
        {"position": [0, 0, 0], "rotation_matrix": [[1, 0, 0], [0, 1, 0], [0, 0, -1]]},
        "mirror image",
    ),
    "scaled": (
        {"position": [0, 0, 0],
         "rotation_matrix": [[1.002, 0, 0], [0, 1.002, 0], [0, 0, 1.002]]},
        r"determinant \+1 \(got 1.006\)",
    ),
    "sheared": (
        {"position": [0, 0, 0],
         "rotation_matrix": [[1, 0.01, 0], [0, 1, 0], [0, 0, 1]]},
        "off a right angle",
    ),
    "overflow": (
        {"position": [0, 0, 0],
         "rotation_matrix": [[1e300, 0, 0], [0, 1e300, 0], [0, 0, 1]]},
        "not a rotation: an element is",
    ),
    "rows": (
        {"position": [0, 0, 0], "rotation_matrix": [[1, 0, 0], [0, 1, 0]]},
        "expected 3 rows",
    ),
    "id": ({**DOWN, "id": [1]}, "id: expected text or an integer"),
    "id fraction": ({**DOWN, "object_id": 1.5}, "object_id: expected text or an"),
    "score": ({**DOWN, "score": "high"}, "score: expected a number"),
    "width": ({**DOWN, "width": -0.1}, r"width: expected a length >= 0"),
    "quadrant": ({**DOWN, "quadrant": "N"}, "quadrant: expected one of NE, NW, SE, SW"),
    "unknown": ({**DOWN, "quality": 1}, "quality: unknown key"),
}  # fmt: skip


@pytest.mark.parametrize("name", GRASP_MISTAKES)
def test_mistakes_of_a_grasp(name):
    """Each wrong value of a grasp is named with its place."""
    grasp, message = GRASP_MISTAKES[name]
    with pytest.raises(GraspListError, match=message):
        grasps_from_document(document(grasp))


def test_all_mistakes_come_at_once_with_their_lines(tmp_path):
    """Four mistakes in one file give four lines that begin with file:line."""
    data = document(
        {**DOWN, "quadrant": "X"},
        DOWN,
        {"position": [0, 0, 0]},
        {**DOWN, "direction": [0, 0, "down"]},
        approach_axis="up",
    )
    path = written(tmp_path / "bad.json", data)
    with pytest.raises(GraspListError, match="quadrant") as caught:
        read_grasps(path)
    lines = caught.value.lines
    assert len(lines) == 4
    text = path.read_text().splitlines()
    for line, token in zip(lines, ['"up"', '"X"', "{", '"down"'], strict=True):
        number = int(line.removeprefix(f"{path}:").split(":")[0])
        assert token in text[number - 1]


def test_many_mistakes_are_counted(tmp_path):
    """A thousand mistakes print as twenty and a count."""
    path = written(tmp_path / "bad.json", document(*[{**DOWN, "score": "a"}] * 1000))
    with pytest.raises(GraspListError, match="and 980 more mistakes") as caught:
        read_grasps(path)
    assert len(caught.value.lines) == 21


def test_a_document_of_another_meaning_is_refused_by_name():
    """JSON that is not a grasp list says what is missing."""
    with pytest.raises(GraspListError, match="frame, grasps missing"):
        grasps_from_document({"name": "ur5", "version": 3})
    data = document()
    del data["frame"]
    with pytest.raises(GraspListError, match="frame is missing: bin, robot_base"):
        grasps_from_document(data)
    with pytest.raises(GraspListError, match="expected an object with grasps"):
        grasps_from_document([DOWN])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", r"f:1:2: not valid JSON"),
        ('{"a": 1,\n "b": NaN}', r"f:2: b: expected a finite number \(got NaN\)"),
        ('{"a": [1,\n\n -Infinity]}', r"f:3: a\[1\]: expected a finite"),
        ('{"a": 1e999}', r"f:1: a: expected a finite number \(got 1e999\)"),
        ('{"a": 1, "b": {"c": 1,\n"c": 2}}', r"f:2: b\.c: the key occurs twice"),
        ("[" * 100_000, "not usable JSON"),
        ("[" + "9" * 5000 + "]", "not usable JSON"),
    ],
)
def test_json_that_others_would_let_pass(text, message):
    """NaN, infinities, repeated keys, deep nesting: a line each, no traceback."""
    with pytest.raises(GraspListError, match=message):
        parse_json(text, "f")


def test_lines_are_found_in_unusual_layouts():
    """Brackets and quotes inside strings do not mislead the search for lines."""
    text = '{"a}": "[",\n"b": [{"c\\"": 1},\n\n[2, "]"]], "d": {}}'
    paths = [("a}",), ("b", 0, 'c"'), ("b", 1, 1), ("d",), ("b", 9), ()]
    assert list(lines_of(text, paths).values()) == [1, 2, 4, 4, 2, 1]


def test_results_of_an_earlier_ranking_are_dropped():
    """A ranked document can be ranked again; the old results are gone."""
    data = document({**DOWN, "reachmap": {"rank": 1}, "x_mine": [1]}, reachmap={"a": 1})
    kept = grasps_from_document(data).document
    assert kept["grasps"] == [{**DOWN, "x_mine": [1]}]
    assert "reachmap" not in kept


def test_files_that_cannot_be_read(tmp_path):
    """Missing, a folder, empty, binary, an HDF5 file: one clear line each."""
    with pytest.raises(GraspListError, match="cannot be read: No such file"):
        read_grasps(tmp_path / "none.json")
    with pytest.raises(GraspListError, match="cannot be read: Is a directory"):
        read_grasps(tmp_path)
    for content, message in [
        (b"  \n", "the file is empty"),
        (b"\x89HDF\r\n\x1a\n", "this is an HDF5 file"),
        (b"\xff\xfe{}", "neither text"),
        (b"a: 1\nb: 2\n", "not a grasp list; recognised are"),
    ]:
        path = tmp_path / "file"
        path.write_bytes(content)
        with pytest.raises(GraspListError, match=message):
            read_grasps(path)


def test_a_byte_order_mark_is_let_pass(tmp_path):
    """Editors of another system put one in front."""
    path = tmp_path / "bom.json"
    path.write_bytes(b"\xef\xbb\xbf" + json.dumps(document()).encode())
    assert len(read_grasps(path)) == 1


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-3, 300) | st.text(max_size=3)
    | st.floats(allow_nan=False, allow_infinity=False, width=32)
    | st.sampled_from(["NE", "+z", "m", "mm", "bin", "1.0", "approach"]),
    lambda inner: st.lists(inner, max_size=4)
    | st.dictionaries(st.sampled_from(["position", "length", "x_a", "id"]), inner),
    max_leaves=6,
)  # fmt: skip
KEYS = ["format", "format_version", "frame", "units", "approach_axis", "source",
        "direction_convention", "bin_pose", "grasps", "x_note", "other"]  # fmt: skip
GRASP_KEYS = ["id", "position", "direction", "quaternion_wxyz", "quaternion_xyzw",
              "rotation_matrix", "score", "quadrant", "width", "object_id",
              "x_more", "other"]  # fmt: skip


@settings(max_examples=150, deadline=None)
@given(
    st.dictionaries(st.sampled_from(KEYS), VALUES, max_size=2),
    st.dictionaries(st.sampled_from(GRASP_KEYS), VALUES, max_size=2),
)
def test_what_is_accepted_is_valid_by_the_schema(header, grasp):
    """The reader never accepts a document that the published schema refuses."""
    data = {**document(copy.deepcopy(DOWN) | grasp), **header}
    try:
        grasps_from_document(data)
    except GraspListError:
        return
    jsonschema.validate(data, SCHEMA)
