"""`reachmap rank`: JSON in, JSON out, tables, stories, charts, refusals."""

from __future__ import annotations

import json
import subprocess
import sys
from itertools import pairwise

import click
import numpy as np
import pytest
from click.testing import CliRunner

from reachmap.cli import group
from reachmap.ranking import (
    Ranker,
    RankSettings,
    document_text,
    grasps_from_document,
    rank_list,
    ranked_document,
)
from reachmap.ranking.lists.document import MAX_GRASPS
from reachmap.ranking.lists.reading import FORMATS, MAX_BYTES
from tests.support.optional import present
from tests.support.ranking_maps import make_bin_map

HEAVY = ("pinocchio", "coal", "ompl", "eaik", "matplotlib", "pydantic", "viser")


def run(*arguments, **how):
    """Run the command line; stdout, stderr and exit code."""
    return CliRunner().invoke(group, ["rank", *map(str, arguments)], **how)


def ranked(*arguments, **how):
    """The JSON that a successful call prints."""
    result = run(*arguments, **how)
    assert result.exit_code == 0, result.stderr
    return json.loads(result.stdout)


def test_the_answer_is_the_same_document_re_ordered(folder):
    """Every supplied object comes back unchanged, sorted by cost, with its reason."""
    supplied = json.loads((folder / "pile-1.json").read_text())
    document = ranked("pile-1.json")
    header = {k: v for k, v in document.items() if k not in ("grasps", "reachmap")}
    assert header == {k: v for k, v in supplied.items() if k != "grasps"}
    results = [grasp.pop("reachmap") for grasp in document["grasps"]]
    assert [r["rank"] for r in results] == list(range(1, len(results) + 1))
    for grasp, result in zip(document["grasps"], results, strict=True):
        assert grasp == supplied["grasps"][result["original_rank"] - 1]
    costs = [r["cost"] for r in results]
    reachable = [cost for cost in costs if cost is not None]
    assert reachable == sorted(reachable)
    assert costs[len(reachable) :] == [None] * (len(costs) - len(reachable))
    last = [r["original_rank"] for r in results[len(reachable) :]]
    assert last == sorted(last)


def test_every_result_has_the_fields_of_the_contract(folder):
    """Reachable grasps have cost, terms and orientation; the others a cause."""
    keys = {
        "rank", "original_rank", "quadrant_rank", "original_quadrant_rank", "cost",
        "terms", "status", "test_grasp", "layer", "distance", "angle",
        "orientation_wxyz", "probability",
    }  # fmt: skip
    states = set()
    for grasp in ranked("pile-1.json")["grasps"]:
        result = grasp["reachmap"]
        assert set(result) - {"extrapolated"} == keys
        states.add(result["status"])
        if result["cost"] is None:
            assert result["terms"] is None
            assert result["orientation_wxyz"] is None
        else:
            assert result["status"] == "path_found"
            assert sum(result["terms"].values()) == pytest.approx(result["cost"])
            assert np.linalg.norm(result["orientation_wxyz"]) == pytest.approx(1.0)
        y, x, orientation = result["test_grasp"]
        assert 0 <= y < 6
        assert 0 <= x < 8
        assert 0 <= orientation < 27
        assert result["layer"] == 0
    assert {"path_found", "no_ik", "ik_in_collision", "no_path_found"} >= states
    assert len(states) > 1


def test_quadrant_ranks_count_within_the_quadrant(folder):
    """Each quadrant is numbered from 1 in supplied and in ranked order."""
    grasps = ranked("pile-1.json")["grasps"]
    for quadrant in ("NE", "NW", "SE", "SW"):
        own = [g["reachmap"] for g in grasps if g["quadrant"] == quadrant]
        assert [r["quadrant_rank"] for r in own] == list(range(1, len(own) + 1))
        by_supply = sorted(own, key=lambda r: r["original_rank"])
        places = [r["original_quadrant_rank"] for r in by_supply]
        assert places == list(range(1, len(own) + 1))


def test_a_ranked_list_can_be_ranked_again(folder):
    """Ranking is repeatable: the second time nothing moves but the supplied places."""
    first = run("pile-1.json").stdout
    (folder / "again.json").write_text(first)
    again = ranked("again.json")
    for grasp in again["grasps"]:
        assert grasp["reachmap"]["rank"] == grasp["reachmap"]["original_rank"]
    assert [g["id"] for g in again["grasps"]] == [
        g["id"] for g in json.loads(first)["grasps"]
    ]


def test_outside_grasps_are_flagged(folder):
    """A grasp a metre away has no test grasp, no cost, a distance, and comes last."""
    last = ranked("far.json")["grasps"][-1]["reachmap"]
    assert last["status"] == "outside_map"
    assert last["original_rank"] == 2
    assert last["test_grasp"] is None
    assert last["layer"] is None
    assert last["cost"] is None
    assert last["distance"] > 0.7


def test_weights_likeness_and_neighbours_change_the_cost(folder):
    """The header says what the list was ranked with, and the likeness is a term."""
    document = ranked(
        "pile-1.json", "--weights", 2, 0, 1, "--likeness", 0.5, "--neighbours", 4
    )
    header = document["reachmap"]
    assert header["weights"] == [2.0, 0.0, 1.0]
    assert header["neighbours"] == 4
    assert sum(header["counts"].values()) == len(document["grasps"])
    terms = document["grasps"][0]["reachmap"]["terms"]
    assert list(terms) == ["path_length", "planning_time", "execution_time", "likeness"]
    assert terms["planning_time"] == 0.0


def test_standard_input(folder):
    """`reachmap rank -` ranks what it is sent; twice in one call it cannot."""
    text = (folder / "pile-1.json").read_text()
    assert ranked("-", input=text)["grasps"] == ranked("pile-1.json")["grasps"]
    result = run("-", "-", input=text)
    assert result.exit_code == 2
    assert "standard input can be read once" in result.stderr


def test_several_lists_in_one_call(folder):
    """Two lists print as a JSON list, and go to a folder or into one file."""
    both = ranked("pile-1.json", "pile-2.json")
    assert [len(document["grasps"]) for document in both] == [167, 169]
    result = run("pile-1.json", "pile-2.json", "-o", "out")
    assert result.exit_code == 0
    assert "pile-2.json\nrank" in result.stdout
    for name, document in zip(("pile-1", "pile-2"), both, strict=True):
        text = (folder / "out" / f"{name}.ranked.json").read_text()
        assert json.loads(text) == document
    assert run("pile-1.json", "pile-2.json", "-o", "both.json").exit_code == 0
    assert json.loads((folder / "both.json").read_text()) == both


def test_a_file_gets_the_list_and_stdout_a_table(folder):
    """With -o the ten best are listed and everything is counted; -o - prints JSON."""
    result = run("pile-1.json", "-o", "ranked.json")
    lines = result.stdout.splitlines()
    assert len(lines) == 12
    assert lines[0].split() == ["rank", "was", "id", "quadrant", "J", "path", "plan",
                                "exec", "status"]  # fmt: skip
    assert lines[-1].startswith("167 grasps: ")
    counted = [int(part.split()[0]) for part in lines[-1].split(": ")[1].split(", ")]
    assert sum(counted) == 167
    document = json.loads((folder / "ranked.json").read_text())
    assert document == ranked("pile-1.json", "-o", "-")


def test_top_keeps_the_best(folder):
    """The N best of the whole list, in the document and in the table."""
    everything = ranked("pile-1.json")["grasps"]
    assert ranked("pile-1.json", "--top", 3)["grasps"] == everything[:3]
    assert len(run("pile-1.json", "--top", 3, "-o", "t.json").stdout.splitlines()) == 5


def test_outputs_are_not_overwritten(folder):
    """An existing file, and the supplied list itself, stay as they are."""
    (folder / "ranked.json").write_text("precious")
    result = run("pile-1.json", "-o", "ranked.json")
    assert result.exit_code == 2
    assert "--overwrite replaces it" in result.stderr
    assert (folder / "ranked.json").read_text() == "precious"
    assert run("pile-1.json", "-o", "ranked.json", "--overwrite").exit_code == 0
    before = (folder / "pile-1.json").read_bytes()
    result = run("pile-1.json", "-o", "pile-1.json", "--overwrite")
    assert result.exit_code == 2
    assert "which this command reads" in result.stderr
    assert (folder / "pile-1.json").read_bytes() == before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["none.json"], "cannot be read: No such file"),
        (["pile-1.json", "--map", "none.h5"], "none.h5"),
        (["pile-1.json", "--map", "pile-1.json"], "pile-1.json"),
        (["bin.h5"], "this is an HDF5 file"),
        (["pile-1.json", "--weights", "0", "0", "0"], "one weight at least"),
        (["pile-1.json", "--frame", "camera"], "states its own frame"),
        (["pile-1.json", "--explain", "XX-9"], "no grasp has the id 'XX-9'"),
        (["pile-1.json", "pile-2.json", "--explain", "NW-00"], "2 grasps match"),
        (["pile-1.json", "--chart", "chart.pdf"], "expected a name in .png or .svg"),
        (["pile-1.json", "-o", "no/such/folder/r.json"], "does not exist"),
    ],
)
def test_wrong_requests(folder, arguments, message):
    """One clear line, exit code 2, nothing written."""
    before = sorted(folder.iterdir())
    result = run(*arguments)
    assert result.exit_code == 2
    assert message in result.stderr
    assert result.stdout == ""
    assert sorted(folder.iterdir()) == before


def test_a_list_wholly_outside_is_questioned(folder):
    """Millimetres taken for metres are refused; a wrong frame is warned about."""
    data = json.loads((folder / "pile-1.json").read_text())
    (folder / "base.json").write_text(json.dumps({**data, "frame": "robot_base"}))
    result = run("base.json")
    assert result.exit_code == 0
    assert "are the frame (robot_base) and the map right?" in result.stderr
    assert json.loads(result.stdout)["reachmap"]["counts"] == {"outside_map": 167}


def test_an_imported_list_comes_out_in_the_native_format(folder):
    """Suction rows with a camera pose are ranked as the same grasps in robot_base."""
    data = json.loads((folder / "pile-1.json").read_text())
    rows = [[0.5, *(-np.array(g["direction"])), *g["position"]] for g in data["grasps"]]
    np.save(folder / "suction.npy", np.array(rows))
    native = ranked("pile-1.json")["grasps"]
    imported = ranked("suction.npy", "--frame", "bin")
    assert imported["format"] == "reachmap.grasps"
    assert imported["source"]["imported_from"] == "suction"
    for one, other in zip(imported["grasps"], native, strict=True):
        assert one["reachmap"]["cost"] == pytest.approx(other["reachmap"]["cost"])
    posed = ranked("suction.npy", "--frame-pose", 0.5, 0.1, -0.05,
                   np.cos(0.15), 0, 0, np.sin(0.15))  # fmt: skip
    for one, other in zip(posed["grasps"], native, strict=True):
        assert one["reachmap"]["cost"] == pytest.approx(other["reachmap"]["cost"])


def test_a_camera_list_is_ranked_with_the_pose_of_its_frame(folder):
    """As the page on grasp lists shows; the answer names the frame of the list."""
    data = json.loads((folder / "pile-1.json").read_text())
    (folder / "camera.json").write_text(json.dumps({**data, "frame": "camera"}))
    pose = (0.5, 0.1, -0.05, np.cos(0.15), 0, 0, np.sin(0.15))
    posed = ranked("camera.json", "--frame-pose", *pose)
    assert posed["frame"] == "camera"
    native = ranked("pile-1.json")["grasps"]
    for one, other in zip(posed["grasps"], native, strict=True):
        assert one["id"] == other["id"]
        assert one["reachmap"]["cost"] == pytest.approx(other["reachmap"]["cost"])


def test_the_longest_ranked_list_can_be_ranked_again():
    """Whatever is asked for: its file is no larger than what is read."""
    bin_map = make_bin_map(seed=7, reachable=0.9)
    points = bin_map.position.reshape(-1, 3).tolist()
    grasp = {"score": 0.123456789012345, "quadrant": "NE", "x_planner": "a" * 100}
    turn = [0.123456789012345, 0.987654321098765, 0.0, 0.096537]
    grasps = [
        {"id": f"{k:06}", "position": p, "quaternion_wxyz": turn, **grasp}
        for k, p in enumerate(points)
    ]
    head = {"format": "reachmap.grasps", "format_version": "1.0"}
    document = {**head, "frame": "robot_base", "grasps": grasps}
    settings = RankSettings(likeness=0.3, roll="free", max_angle_deg=180.0)
    listed = rank_list(
        grasps_from_document(document), Ranker(bin_map), settings=settings
    )
    text = document_text(ranked_document(listed))
    assert len(text) / len(grasps) * MAX_GRASPS < MAX_BYTES


def test_the_story_of_a_reachable_grasp(folder):
    """Rank before and after, test grasp, distances, attempts, terms, ties."""
    grasp = ranked("pile-1.json")["grasps"][4]
    result = grasp["reachmap"]
    story = run("pile-1.json", "--explain", grasp["id"]).stdout
    assert f"rank 5 of 167, supplied as {result['original_rank']}" in story
    y, x, orientation = result["test_grasp"]
    assert f"layer 0, y {y}, x {x}, orientation {orientation};" in story
    assert f"φ1 = {1e3 * result['distance']:.1f} mm" in story
    assert f"J = {result['cost']:.3f} = " in story
    assert "of 5 found a path; mean path length" in story
    assert story.count("tie ") == 3
    assert story.count("(taken)") == 1
    by_place = run("pile-1.json", "--explain", f"#{result['original_rank']}").stdout
    assert by_place == story


def test_the_story_of_an_unreachable_grasp(folder):
    """The cause is named, and which two bodies touch."""
    grasps = ranked("pile-1.json")["grasps"]
    hit = [g for g in grasps if g["reachmap"]["status"] == "ik_in_collision"]
    story = run("pile-1.json", "--explain", hit[0]["id"]).stdout
    assert "0 of 5 found a path: every inverse-kinematics solution collides (" in story
    assert "camera housing | bin wall +x" in story or "gripper | bin bottom" in story
    assert "none: ik_in_collision" in story


def test_the_story_of_a_grasp_outside(folder):
    """The nearest test grasp is far, and that is why there is no cost."""
    story = run("far.json", "--explain", "NW-01").stdout
    assert "none: the map says nothing about this place" in story


def test_a_map_of_another_cell_is_refused(folder):
    """--cell names what the map must have been made for; --force ranks all the same."""
    result = run("pile-1.json", "--cell", "ur5-eye-in-hand")
    assert result.exit_code == 2
    assert "unreadable" in result.stderr


def test_charts(folder):
    """Two charts of the same lists are the same bytes, as PNG and as SVG."""
    for suffix, magic in (("png", b"\x89PNG"), ("svg", b"<?xml")):
        for name in ("a", "b"):
            path = f"{name}.{suffix}"
            result = run("pile-1.json", "-o", "r.json", "--overwrite", "--chart", path)
            assert result.exit_code == 0, result.stderr
        a, b = ((folder / f"{name}.{suffix}").read_bytes() for name in "ab")
        assert a == b
        assert a.startswith(magic)
    result = run("pile-1.json", "--chart", "a.png")
    assert result.exit_code == 2
    assert "exists already" in result.stderr


def test_ranking_loads_no_engine(folder):
    """A whole call imports no kinematics, collision, planning or plotting package."""
    code = (
        "import sys; from reachmap.cli import group;"
        "group.main(['rank', 'pile-1.json'], standalone_mode=False);"
        f"print([m for m in {HEAVY} if m in sys.modules], file=sys.stderr)"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stderr.strip() == "[]"
    assert len(json.loads(result.stdout)["grasps"]) == 167


def test_formats_on_the_command_line_are_those_of_the_library():
    """--from offers what the importers know, without importing them for --help."""
    command = present(group.get_command(click.Context(group), "rank"))
    (option,) = [p for p in command.params if p.name == "format_name"]
    assert isinstance(option.type, click.Choice)
    assert tuple(option.type.choices) == FORMATS


def test_costs_of_the_first_grasps_never_rise_by_ranking(folder):
    """In each quadrant the first k re-ranked have no more mean cost than supplied."""
    grasps = [
        g["reachmap"] | {"q": g["quadrant"]} for g in ranked("pile-1.json")["grasps"]
    ]
    for quadrant in ("NE", "NW", "SE", "SW"):
        own = [g for g in grasps if g["q"] == quadrant]
        cost = [np.inf if g["cost"] is None else g["cost"] for g in own]
        supplied = [c for _, c in sorted(zip(
            [g["original_rank"] for g in own], cost, strict=True))]  # fmt: skip
        for k in (1, 5, 10):
            assert np.mean(cost[:k]) <= np.mean(supplied[:k])
        assert all(a <= b for a, b in pairwise(cost))
