"""Modules and functions stay small enough to be read in one go."""

from __future__ import annotations

import ast
from pathlib import Path

ROOT = Path(__file__).parents[2]
SOURCES = {
    str(path.relative_to(ROOT)): path.read_text()
    for tree in ("src/reachmap", "cli")
    for path in sorted((ROOT / tree).rglob("*.py"))
}
TREES = {name: ast.parse(text) for name, text in SOURCES.items()}
MODULE_LINES = 400
FUNCTION_LINES = 60


def body_lines(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines of a function's body without its docstring."""
    body = function.body
    if ast.get_docstring(function) is not None:
        body = body[1:]
    if not body:
        return 0
    return (body[-1].end_lineno or 0) - body[0].lineno + 1


def test_modules_are_short() -> None:
    """One concept per module."""
    lines = {name: len(text.splitlines()) for name, text in SOURCES.items()}
    assert not {name: n for name, n in lines.items() if n > MODULE_LINES}


def test_functions_are_short() -> None:
    """A long driver is a list of named steps."""
    long = {
        (name, node.name): body_lines(node)
        for name, tree in TREES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        and body_lines(node) > FUNCTION_LINES
    }
    assert not long


def test_modules_say_what_they_are() -> None:
    """Every module begins with a docstring."""
    assert not [name for name, tree in TREES.items() if not ast.get_docstring(tree)]


ROOMS = 13
CATALOGUES = {"cli", "tools"}


def test_folders_can_be_taken_in_at_a_glance() -> None:
    """At most 13 modules a folder, but for the two with a file per command."""
    folders = {(ROOT / name).parent for name in SOURCES}
    crowded = {
        str(folder.relative_to(ROOT)): number
        for folder in folders
        if folder.name not in CATALOGUES
        and (number := len(list(folder.glob("[!_]*.py")))) > ROOMS
    }
    assert not crowded
