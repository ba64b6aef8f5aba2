"""Modules and functions stay small enough to be read in one go."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = sorted(
    path for tree in ("src/reachmap", "cli") for path in (ROOT / tree).rglob("*.py")
)
MODULE_LINES = 400
FUNCTION_LINES = 60

each_source = pytest.mark.parametrize(
    "path", SOURCES, ids=[str(path.relative_to(ROOT)) for path in SOURCES]
)


def body_lines(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines of a function's body without its docstring."""
    body = function.body
    if ast.get_docstring(function) is not None:
        body = body[1:]
    if not body:
        return 0
    return (body[-1].end_lineno or 0) - body[0].lineno + 1


@each_source
def test_modules_are_short(path: Path) -> None:
    """One concept per module."""
    assert len(path.read_text().splitlines()) <= MODULE_LINES


@each_source
def test_functions_are_short(path: Path) -> None:
    """A long driver is a list of named steps."""
    functions = (ast.FunctionDef, ast.AsyncFunctionDef)
    long = {
        node.name: body_lines(node)
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, functions) and body_lines(node) > FUNCTION_LINES
    }
    assert not long


@each_source
def test_modules_say_what_they_are(path: Path) -> None:
    """Every module begins with a docstring."""
    assert ast.get_docstring(ast.parse(path.read_text()))


ROOMS = 13
CATALOGUES = {"cli", "tools"}


def test_folders_can_be_taken_in_at_a_glance() -> None:
    """At most 13 modules a folder, but for the two with a file per command."""
    folders = {path.parent for path in SOURCES}
    crowded = {
        str(folder.relative_to(ROOT)): number
        for folder in folders
        if folder.name not in CATALOGUES
        and (number := len(list(folder.glob("[!_]*.py")))) > ROOMS
    }
    assert not crowded
