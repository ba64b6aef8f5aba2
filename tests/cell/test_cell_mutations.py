"""Whatever a cell file holds, the answer is a cell or a CellError."""

from __future__ import annotations

import copy
import json
import math
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from reachmap.cell.files.resources import shipped_folder
from reachmap.cell.loading import LoadedCell, cell_from_json, cell_from_text
from reachmap.cell.text.yaml_reader import parse_yaml
from reachmap.errors import CellError

FOLDER = shipped_folder()
TOY = (FOLDER / "planar-toy.yaml").read_text(encoding="utf-8")
PANDA = (FOLDER / "panda-eye-in-hand.yaml").read_text(encoding="utf-8")
DATA = {text: parse_yaml(text, "seed").data for text in (TOY, PANDA)}
SNIPPETS = (
    "!!python/object:os.system x", "&a", "*a", "<<: {a: 1}", "---\n", "%YAML 1.1\n",
    "\t", "\0", "\ufeff", "\u2028", "{", "}", "[", "]", ": ", "- ", "? ", "| ", ">-\n",
    "'", '"', "\\", "#", "~", "null", "true", "no", ".nan", ".inf", "-.inf", "1e999",
    "-0", "9" * 500, "0x10", "0o7", "1_0", "1:30", "2001-01-01", "é" * 50, "a" * 3000,
    "package://", "package://x/y", "package://reachmap-cells/../../x",
    "../../etc/passwd", "/etc/passwd", "file:///dev/zero", "/dev/zero", "http://x/y",
    "[" * 60, "{a: " * 60, "robot: {}", "seed: -1", "joint_1", "world", "bin",
    "xyz: [1, 2]", "rpy_deg: [0]",
)  # fmt: skip
VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2**63, 10**400, 0.5, -0.0, 1e308, -1e-320, math.nan,
    math.inf, "", "x", "1.0", "a" * 500, "\ud800", "package://a/b", "/dev/zero", ".",
    "..", [], {}, [1], [1, 2, 3], ["a"], [[[[]]]], {"a": 1}, {"": None},
    {"xyz": [0, 0, 0]}, [None] * 200, "planar-toy/planar_arm.urdf", "planar-toy.yaml",
    "README.md",
    "package://example-robot-data/robots/panda_description/srdf/panda.srdf",
)  # fmt: skip


def check_lines(error: CellError, start: str) -> None:
    """Check that every mistake is a line with words in it."""
    assert error.lines
    assert all(line.strip() and line.startswith(start) for line in error.lines)


def load(text: str, overrides: tuple[str, ...] = ()) -> LoadedCell | None:
    """Load a text: a cell that can be stored and read again, or None."""
    try:
        loaded = cell_from_text(
            text, label="mutant.yaml", directory=FOLDER, overrides=overrides
        )
    except CellError as error:
        check_lines(error, "")
        return None
    again = cell_from_json(
        loaded.resolved_json,
        urdf=loaded.urdf,
        srdf=loaded.srdf,
        files_sha256=loaded.files_sha256,
    )
    assert again.sha256 == loaded.sha256
    assert all(math.isfinite(v) for v in loaded.scan_configuration_rad.values())
    return loaded


@st.composite
def mutated_texts(draw: st.DrawFn) -> str:
    """A shipped cell with pieces cut, moved, doubled, flipped and put in."""
    text = draw(st.sampled_from((TOY, TOY, PANDA)))
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, max(len(text) - 1, 0)))
        length = draw(st.sampled_from((0, 1, 2, 5, 20, 200)))
        piece = text[start : start + length]
        kind = draw(
            st.sampled_from(("cut", "double", "move", "insert", "flip", "line"))
        )
        rest = text[:start] + text[start + length :]
        if kind == "cut":
            text = rest
        elif kind == "double":
            text = text[:start] + piece + text[start:]
        elif kind == "move":
            target = draw(st.integers(0, len(rest)))
            text = rest[:target] + piece + rest[target:]
        elif kind == "insert":
            text = text[:start] + draw(st.sampled_from(SNIPPETS)) + text[start:]
        elif kind == "flip":
            character = chr(draw(st.integers(0, 0x2FFF)))
            text = text[:start] + character + text[start + 1 :]
        else:
            lines = text.split("\n")
            k = draw(st.integers(0, len(lines) - 1))
            lines[k] = " " * draw(st.integers(0, 6)) + lines[k].strip()
            text = "\n".join(lines)
    return text


def locations(data: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Every location in nested data but the root."""
    items = data.items() if isinstance(data, dict) else enumerate(data)
    found = []
    for key, value in items:
        found.append((*path, key))
        if isinstance(value, dict | list):
            found += locations(value, (*path, key))
    return found


PATHS = {text: locations(data) for text, data in DATA.items()}


@st.composite
def mutated_data(draw: st.DrawFn) -> Any:
    """Data of a shipped cell with values replaced, removed, renamed or exchanged."""
    seed = draw(st.sampled_from((TOY, PANDA)))
    data = copy.deepcopy(DATA[seed])
    for _ in range(draw(st.integers(1, 3))):
        path = draw(st.sampled_from(PATHS[seed]))
        parent = data
        for part in path[:-1]:
            try:
                parent = parent[part]
            except (KeyError, IndexError, TypeError):
                break
        if not isinstance(parent, dict | list) or not parent:
            continue
        key: Any = path[-1]
        if isinstance(parent, list):
            key = key % len(parent) if isinstance(key, int) else 0
        value = copy.deepcopy(draw(st.sampled_from(VALUES)))
        kind = draw(st.sampled_from(("replace", "replace", "remove", "rename")))
        if kind == "replace":
            parent[key] = value
        elif kind == "remove" and key in parent:
            del parent[key]
        elif isinstance(parent, dict):
            parent[str(key)[::-1]] = parent.pop(key, value)
    return data


@settings(max_examples=120, deadline=None, suppress_health_check=list(HealthCheck))
@given(mutated_texts())
def test_mutated_texts(text: str) -> None:
    """A valid cell or a CellError, never another exception."""
    load(text)


@settings(max_examples=120, deadline=None, suppress_health_check=list(HealthCheck))
@given(mutated_data())
def test_mutated_data(data: Any) -> None:
    """The same for values of the wrong kind in the right places (JSON is YAML)."""
    text = json.dumps(data)
    for word, scalar in (("NaN", ".nan"), ("-Infinity", "-.inf"), ("Infinity", ".inf")):
        text = text.replace(word, scalar)
    load(text)


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(mutated_data())
def test_mutated_json_of_an_artefact(data: Any) -> None:
    """What an artefact keeps may be damaged, too."""
    urdf = (FOLDER / "planar-toy" / "planar_arm.urdf").read_text()
    try:
        loaded = cell_from_json(json.dumps(data), urdf=urdf, source="map.h5")
    except CellError as error:
        check_lines(error, "map.h5")
    else:
        assert loaded.sha256


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    path=st.sampled_from([".".join(map(str, path)) for path in PATHS[TOY]]),
    tail=st.sampled_from(("", ".x", ".0", ".", "..", "=", ".0.0.0")),
    value=st.sampled_from(SNIPPETS),
)
def test_mutated_assignments(path: str, tail: str, value: str) -> None:
    """``--set`` takes whatever a shell lets through."""
    load(TOY, (f"{path}{tail}={value}",))


@settings(max_examples=60, deadline=None)
@given(st.text(max_size=200))
def test_any_text(text: str) -> None:
    """Most texts are no cells, and that is all."""
    assert load(text) is None


@pytest.mark.slow
@pytest.mark.timeout(3000)
@settings(max_examples=4000, deadline=None, suppress_health_check=list(HealthCheck))
@given(mutated_texts())
def test_many_mutated_texts(text: str) -> None:
    """The same as above, more often."""
    load(text)


@pytest.mark.slow
@pytest.mark.timeout(3000)
@settings(max_examples=4000, deadline=None, suppress_health_check=list(HealthCheck))
@given(mutated_data())
def test_many_mutated_data(data: Any) -> None:
    """The same as above, more often."""
    test_mutated_data.hypothesis.inner_test(data)  # type: ignore[attr-defined]
