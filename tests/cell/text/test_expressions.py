"""Numbers of a cell as expressions of its parameters."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import pytest

from reachmap.cell.loaded import LoadedCell
from reachmap.cell.loading import cell_from_json, cell_from_text, read_cell
from reachmap.cell.text.expressions import Evaluator, ExpressionError
from reachmap.errors import CellError

TOY = Path(str(read_cell("planar-toy").directory)) / "planar-toy.yaml"
HEAD = """parameters:
  depth: {value: 0.05, unit: m, range: [0.01, 0.5]}
  half: "=depth / 2"
"""


def toy(head: str = HEAD, bottom: str = '"=half / 5"') -> str:
    """The toy cell with parameters, and the thickness of the bin's bottom in them."""
    text = TOY.read_text().replace("name: planar-toy\n", f"name: planar-toy\n{head}", 1)
    lines = text.splitlines()
    row = next(k for k, line in enumerate(lines) if line.startswith("bin:"))
    lines.insert(row + 1, f"  bottom: {bottom}")
    return "\n".join(lines) + "\n"


def load(text: str, *overrides: str) -> LoadedCell:
    """Load a text as a file of the toy's folder."""
    return cell_from_text(
        text, label="toy.yaml", directory=TOY.parent, overrides=overrides
    )


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("=2 * 3 + 1", 7),
        ("= -h", -0.8),
        ("=h - 0.402", 0.8 - 0.402),
        ("=sqrt(h ** 2)", 0.8),
        ("=sin(radians(30))", math.sin(math.radians(30))),
        ("=max(h, derived)", 1.6),
        ("=pi", math.pi),
    ],
)
def test_expressions_are_arithmetic(text: str, value: float) -> None:
    """Values are those of Python's own arithmetic."""
    evaluator = Evaluator({"h": 0.8, "derived": "=2 * h"})
    assert evaluator.number(text) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    "text",
    [
        "=__import__('os').system('true')", "=h.real", "=[1][0]", "='a'", "=nope",
        "=lambda: 1", "=9**9**9**9", "=1/0", "=", "=" + "1+" * 200 + "1", "=h h",
        "=h if h else 1", "=(1).__class__", "=f'{h}'", "=open('x')",
        "=h > 1", "=True", "=10.0 ** 400",
        "=sqrt(-1)", "=max()", "=h.__class__", "={1: 2}", "=[x for x in (1, 2)]",
    ],
)  # fmt: skip
def test_nothing_but_numbers_comes_out(text: str) -> None:
    """No name, attribute, call or container beyond arithmetic; no value, no number."""
    with pytest.raises(ExpressionError):
        Evaluator({"h": 0.8}).number(text)


def test_parameters_may_not_refer_to_each_other_in_a_circle() -> None:
    """The circle is spelled out."""
    evaluator = Evaluator({"a": "=b", "b": "=a + 1"})
    with pytest.raises(ExpressionError, match="circular parameters: a → b → a"):
        evaluator.number("=a")


def test_a_cell_of_expressions_is_the_cell_of_their_values() -> None:
    """Same numbers, same fingerprint; the parameters leave no trace in it."""
    plain = load(toy(head="", bottom="0.005"))
    named = load(toy())
    assert named.cell.bin.bottom == plain.cell.bin.bottom
    assert named.sha256 == plain.sha256
    assert named.cell.parameters["half"].value == 0.025


def test_an_override_of_a_parameter_moves_what_depends_on_it() -> None:
    """On the file, and on the resolved cell that an artefact keeps."""
    text = toy(bottom='"=half / 5"')
    assert load(text).cell.bin.bottom == 0.025 / 5
    changed = load(text, "parameters.depth=0.1")
    assert changed.cell.bin.bottom == 0.05 / 5
    loaded = load(text)
    again = cell_from_json(
        loaded.resolved_json, urdf=loaded.urdf, changes=["parameters.depth=0.1"]
    )
    assert again.cell == changed.cell
    assert again.sha256 == changed.sha256


def test_a_number_that_was_changed_later_is_no_expression_any_more() -> None:
    """As when place-bin has moved the bin."""
    loaded = load(toy(bottom='"=half / 5"'))
    data = json.loads(loaded.resolved_json)
    data["bin"]["bottom"] = 0.004
    again = cell_from_json(
        json.dumps(data), urdf=loaded.urdf, changes=["parameters.depth=0.1"]
    )
    assert again.cell.bin.bottom == 0.004
    assert again.cell.parameters["half"].value == 0.05


@pytest.mark.parametrize(
    ("head", "bottom", "overrides", "message"),
    [
        (HEAD, '"=dept / 2"', (), "unknown parameter 'dept'; did you mean 'depth'?"),
        (HEAD, '"=dept / 2"', (), ":11: bin.bottom: "),
        (HEAD, '"=depth +"', (), "bin.bottom: 'depth +' cannot be read at character"),
        (HEAD, '"=-depth"', (), "bin.bottom: expected a number > 0 (got -0.05)"),
        (HEAD, "1", ("parameters.depth=0.9",), "value 0.9 is outside 0.01 … 0.5"),
        (HEAD, "1", ("parameters.dept=0.1",), "no key 'dept'; did you mean 'depth'?"),
        ("", '"=depth"', (), "unknown parameter 'depth'; the cell has no parameters"),
        ("parameters: {a b: 1}\n", "1", (), "parameters.a b: expected text that match"),
        ("parameters: {a: xyz}\n", "1", (), "parameters.a.value: expected a number"),
    ],
)  # fmt: skip
def test_mistakes_say_where_they_are_written(
    head: str, bottom: str, overrides: tuple[str, ...], message: str
) -> None:
    """File, line and column, the key, and what would have been right."""
    with pytest.raises(CellError, match=re.escape(message)):
        load(toy(head, bottom), *overrides)
