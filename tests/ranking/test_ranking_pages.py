"""What the pages about ranking show is true."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from reachmap.cli import group
from reachmap.ranking import grasps_from_document

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "reference" / "grasps.md").read_text()


def blocks(name, language):
    """Code blocks of a how-to page."""
    text = (DOCS / "how-to" / name).read_text()
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)


@pytest.mark.parametrize("name", ["own-grasps.md", "picking-loop.md"])
def test_python_of_the_how_to_pages_runs(folder, name):
    """The blocks run one after the other in a folder with a map and a list."""
    (folder / "grasps.json").write_bytes((folder / "pile-1.json").read_bytes())
    names: dict[str, Any] = {}
    exec(compile("\n".join(blocks(name, "python")), name, "exec"), names)
    if name == "own-grasps.md":
        document = json.loads((folder / "grasps.json").read_text())
        assert len(grasps_from_document(document)) == 2
    else:
        assert names["R_tool"].shape == (2, 3, 3)
        assert len(names["best"]) == 10


def test_the_example_document_is_valid():
    """The first example of the reference is a list of two grasps."""
    (text, *_) = re.findall(r"```json\n(.*?)```", PAGE, flags=re.DOTALL)
    grasps = grasps_from_document(json.loads(text))
    assert grasps.has_rotation.tolist() == [False, True]


def test_every_key_of_the_format_is_explained():
    """Schema, results and header have a row or a word each in the reference."""
    schema = json.loads(
        (DOCS.parent / "src/reachmap/ranking/grasps-1.schema.json").read_text()
    )
    for key in [*schema["properties"], *schema["$defs"]["grasp"]["properties"]]:
        assert f"`{key}`" in PAGE, key


def test_every_result_is_explained(folder):
    """Nothing is written that the reference does not name."""
    answer = CliRunner().invoke(group, ["rank", "pile-1.json", "--likeness", "0.1"])
    document = json.loads(answer.stdout)
    result = document["grasps"][0]["reachmap"]
    for key in [*document["reachmap"], *result, *result["terms"]]:
        assert f"`{key}`" in PAGE, key


def test_messages_are_as_shown(tmp_path):
    """The reference quotes messages as they are printed."""
    shown = re.findall(r"reachmap: grasps\.json:\d+: (.*)", PAGE)
    down = {"position": [0, 0, 0], "direction": [0, 0, -1]}
    listed = [down, {**down, "quadrant": "N"}, {"position": [0, 0, 0]}]
    data = {"format": "reachmap.grasps", "format_version": "1.0", "frame": "bin",
            "grasps": listed}  # fmt: skip
    path = tmp_path / "grasps.json"
    path.write_text(json.dumps(data))
    answer = CliRunner().invoke(group, ["rank", str(path), "--map", "none.h5"])
    assert answer.exit_code == 2
    printed = [line.split(":1: ", 1)[-1] for line in answer.stderr.splitlines()]
    assert printed == shown
