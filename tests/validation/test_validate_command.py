"""`reachmap validate`: tables, JSON, results, chart, refusals."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from click.testing import CliRunner

from reachmap.cli import group
from tests.support.toy_truth import toy_grasps


def run(*arguments):
    """Run the command line in this process; stdout, stderr and exit code."""
    return CliRunner().invoke(group, ["validate", *map(str, arguments), "-j", "1"])


def test_tables_results_and_chart_in_one_call(folder):
    """Tables on stdout, progress on stderr, two files that other programs read."""
    result = run(
        "bin.h5", "toy.json", "--random", 4, "--top", 3,
        "-o", "results.json", "--chart", "chart.png",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    assert "validate" in result.stderr
    for words in ("12 grasps", "precision", "map: unreachable", "re-ranked", "Kendall"):
        assert words in result.stdout
    assert (folder / "chart.png").read_bytes()[:4] == b"\x89PNG"
    document = json.loads((folder / "results.json").read_text())
    assert document["format"] == "reachmap.validation"
    assert [one["list"] for one in document["lists"]] == ["toy", "random 4", "all"]
    assert len(document["grasps"]) == 12
    reached = [g for g in document["grasps"] if g["measured"]["cost"] is not None]
    matrix = document["lists"][-1]["confusion"]
    found = sum(matrix[k] for k in ("true_positive", "false_negative"))
    assert len(reached) == found + matrix["outside_reached"]
    for grasp in document["grasps"]:
        assert (grasp["successes"] > 0) == (grasp["measured"]["status"] == "path_found")


def test_json_is_one_object(folder):
    """The summary alone, with null where something is undefined."""
    result = run("bin.h5", "toy.json", "--json", "--no-progress", "--seed", 7)
    assert result.exit_code == 0, result.stderr
    assert result.stderr == ""
    document = json.loads(result.stdout)
    assert (document["seed"], document["repeats"], document["rolls"]) == (7, 1, 24)
    assert document["planner"] == "LBKPIECE1"
    assert "grasps" not in document
    assert document["lists"][0]["repeatability"]["spearman"] is None


def test_the_cell_may_be_changed(folder):
    """Another planner, or a larger camera, tests the map against another cell."""
    result = run("bin.h5", "toy.json", "--json", "--set", "planner.name=RRTConnect")
    assert json.loads(result.stdout)["planner"] == "RRTConnect"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["bin.h5"], "name a grasp list, or draw grasps with --random N"),
        (["bin.h5", "missing.json"], "missing.json: cannot be read"),
        (["toy.json", "toy.json"], "toy.json: .*bin map"),
        (["bin.h5", "-", "-"], "standard input can be read once"),
        (["bin.h5", "none.json"], "there are no grasps to plan to"),
        (["bin.h5", "toy.json", "--random", "100001"], "random must be 1 to 100000"),
        (["bin.h5", "toy.json", "--rolls", "0"], "Invalid value for '--rolls'"),
        (["bin.h5", "toy.json", "-o", "toy.json"], "would replace toy.json"),
        (["bin.h5", "toy.json", "--chart", "a.pdf"], "a.pdf: expected a name in .png"),
        (["bin.h5", "toy.json", "-o", "there.json"], "there.json: exists already"),
        (["bin.h5", "toy.json", "-o", "also", "--chart", "a.png"], "need two files"),
        (["bin.h5", "toy.json", "--set", "planner.nome=RRT"], "planner.nome"),
        (["bin.h5", "toy.json", "--executor", "cloud"], "executor 'cloud'"),
    ],
)
def test_refusals_say_what_is_wrong(folder, arguments, message):
    """Exit code 2, one line each, before anything is planned."""
    (folder / "none.json").write_text(json.dumps(toy_grasps(np.zeros((0, 3)))))
    (folder / "there.json").write_text("{}")
    if not (folder / "also").is_symlink():
        (folder / "also").symlink_to("a.png")
    result = run(*arguments)
    assert result.exit_code == 2
    assert result.stdout == ""
    assert re.search(message, result.stderr), result.stderr
