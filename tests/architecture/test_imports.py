"""The shape of the package: imports point down, each engine has one home."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TREES = {"reachmap": ROOT / "src" / "reachmap", "reachmap.cli": ROOT / "cli"}

# A package imports from the floors below its own; those of one floor do not meet.
LEVELS = {
    "_typing": 0, "disk": 0, "errors": 0, "text": 0, "cells": 0,
    "geometry": 1,
    "cell": 2,
    "sampling": 3,
    "maps": 4,
    "core": 5, "ranking": 5, "runtime": 5,
    "scans": 6,
    "motions": 7, "picking": 7, "placement": 7, "robustness": 7, "studies": 7,
    "validation": 7,
    "plots": 8,
    "report": 9, "view": 9,
    "tools": 10,
    "cli": 11, "__main__": 12, "__init__": 12,
}  # fmt: skip

# Part of no floor that a reader needs to know of.
UNSEEN = {"__init__", "__main__", "_typing", "cells"}

# Engine -> the modules that may import it, as prefixes.
HOMES = {
    "pinocchio": ("reachmap.core.",),
    "coal": ("reachmap.core.",),
    "hppfcl": (),
    "eaik": ("reachmap.core.",),
    "ompl": ("reachmap.core.planning.ompl",),
    "h5py": ("reachmap.maps.bytes.",),
    "matplotlib": ("reachmap.plots.",),
    "click": ("reachmap.cli",),
    "rich": ("reachmap.cli.terminal", "reachmap.runtime.progress"),
    "toppra": ("reachmap.core.planning.time_laws.optimal",),
    "viser": ("reachmap.view.",),
    "trimesh": ("reachmap.view.",),
    "xacro": ("reachmap.cell.",),
    "ruamel": ("reachmap.cell.text.",),
    "jinja2": ("reachmap.report.page",),
    "yaml": ("reachmap.ranking.lists.importers.isaac",),
    "simpleeval": ("reachmap.cell.text.expressions",),
    "distributed": ("reachmap.runtime.",),
    "dask": ("reachmap.runtime.",),
}
# Never: they run what a file says, or hide what they import.
BANNED_MODULES = {"pickle", "marshal", "shelve", "dill", "cloudpickle", "imp"}
# Messages between this program's own processes; no file is ever unpickled.
PICKLES = {"reachmap.maps.bytes.isolation"}
BANNED_CALLS = {"eval", "exec", "print", "breakpoint"}


@dataclass(frozen=True)
class Module:
    """One source file, parsed."""

    name: str
    path: Path
    tree: ast.Module

    @property
    def package(self) -> str:
        """First name below `reachmap`."""
        return self.name.split(".")[1] if "." in self.name else "__init__"


def modules() -> Iterator[Module]:
    """Every module of the library and of the command line."""
    for prefix, folder in TREES.items():
        for path in sorted(folder.rglob("*.py")):
            parts = path.relative_to(folder).with_suffix("").parts
            names = [prefix, *(part for part in parts if part != "__init__")]
            yield Module(".".join(names), path, ast.parse(path.read_text()))


MODULES = {module.name: module for module in modules()}


@cache
def imported(tree: ast.AST) -> list[tuple[str, int]]:
    """Names of imported modules, with their lines; `from a import b` gives `a.b`."""
    return list(_imported(tree))


def _imported(tree: ast.AST) -> Iterator[tuple[str, int]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"line {node.lineno}: import absolutely"
            assert node.module is not None
            yield from ((f"{node.module}.{a.name}", node.lineno) for a in node.names)


def imported_for_real(module: Module) -> Iterator[tuple[str, int]]:
    """Like `imported`, without what is there for annotations alone."""
    annotations = {
        item
        for node in ast.walk(module.tree)
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
        for item in imported(node)
    }
    return (item for item in imported(module.tree) if item not in annotations)


def imported_on_loading(module: Module) -> set[str]:
    """Modules of this project that are imported together with this one."""

    class Top(ast.NodeVisitor):
        def __init__(self) -> None:
            self.names: list[str] = []

        def visit_FunctionDef(self, node: ast.FunctionDef) -> None: ...

        def visit_If(self, node: ast.If) -> None:
            if "TYPE_CHECKING" not in ast.unparse(node.test):
                self.generic_visit(node)

        def generic_visit(self, node: ast.AST) -> None:
            if isinstance(node, ast.Import | ast.ImportFrom):
                self.names += [name for name, _ in imported(node)]
            super().generic_visit(node)

    top = Top()
    top.visit(module.tree)
    return {found for name in top.names if (found := owner(name))} - {module.name}


def owner(name: str) -> str | None:
    """The module of this project that a dotted name lives in."""
    while name:
        if name in MODULES:
            return name
        name = name.rpartition(".")[0]
    return None


def closure(name: str) -> set[str]:
    """Everything of this project that comes along when a module is imported."""
    seen: set[str] = set()
    waiting = [name]
    while waiting:
        current = waiting.pop()
        if current not in seen:
            seen.add(current)
            parents = [current.rpartition(".")[0]] if "." in current else []
            waiting += [*imported_on_loading(MODULES[current]), *parents]
    return seen


def test_imports_point_down() -> None:
    """Each package imports from its own level or from those below, never upwards."""
    upward = [
        f"{module.name}, line {line}: {name}"
        for module in MODULES.values()
        for name, line in imported(module.tree)
        if name.startswith("reachmap.")
        and LEVELS.get(name.split(".")[1], 0) >= LEVELS[module.package]
        and name.split(".")[1] != module.package
    ]
    assert not upward


def test_packages_do_not_import_each_other_in_circles() -> None:
    """Packages of one level may use each other, in one direction."""
    edges: dict[str, set[str]] = {}
    for module in MODULES.values():
        names = {
            name.split(".")[1]
            for name, _ in imported(module.tree)
            if name.startswith("reachmap.")
        }
        known = {name for name in names if name in LEVELS}
        edges.setdefault(module.package, set()).update(known - {module.package})

    def reach(start: str) -> set[str]:
        seen: set[str] = set()
        waiting = list(edges.get(start, ()))
        while waiting:
            name = waiting.pop()
            if name not in seen:
                seen.add(name)
                waiting += edges.get(name, ())
        return seen

    circles = [name for name in edges if name in reach(name)]
    assert not circles


def test_the_picture_in_contributing_is_true() -> None:
    """Each room stands on the floor that the imports are held against."""
    text = (ROOT / "CONTRIBUTING.md").read_text()
    floors = {
        name: int(floor)
        for floor, names in re.findall(r"^ ?(\d+)  ([a-z, ]+?)  ", text, re.MULTILINE)
        for name in names.split(", ")
    }
    assert floors == {k: v for k, v in LEVELS.items() if k not in UNSEEN}


def test_each_engine_has_one_home() -> None:
    """Pinocchio in core, h5py in maps, click in cli: nobody else imports them.

    Naming a type in an annotation is no use of the engine.
    """
    strays = [
        f"{module.name}, line {line}: {name}"
        for module in MODULES.values()
        for name, line in imported_for_real(module)
        if (homes := HOMES.get(name.partition(".")[0])) is not None
        and not any(f"{module.name}.".startswith(home) for home in homes)
    ]
    assert not strays


def test_nothing_imports_what_runs_files_or_wants_a_display() -> None:
    """No pickle but between own processes; no pyplot, which takes seconds, too."""
    found = [
        f"{module.name}, line {line}: import {name}"
        for module in MODULES.values()
        for name, line in imported(module.tree)
        if name.startswith("matplotlib.pyplot")
        or (
            name.partition(".")[0] in BANNED_MODULES
            and not (name == "pickle" and module.name in PICKLES)
        )
    ]
    assert not found


def test_nothing_runs_or_prints_what_a_file_says() -> None:
    """No eval, no YAML tags, no pickled arrays, and no print."""
    found = [
        f"{module.name}, line {node.lineno}: {ast.unparse(node.func)}"
        for module in MODULES.values()
        for node in ast.walk(module.tree)
        if isinstance(node, ast.Call) and _is_banned(node)
    ]
    assert not found


def _is_banned(call: ast.Call) -> bool:
    function = call.func
    if isinstance(function, ast.Name):
        banned = function.id in BANNED_CALLS
    else:
        banned = isinstance(function, ast.Attribute) and (
            function.attr == "pyplot"
            or (function.attr == "load" and ast.unparse(function) == "yaml.load")
        )
    return banned or any(
        keyword.arg == "allow_pickle" and ast.unparse(keyword.value) != "False"
        for keyword in call.keywords
    )


RANKING_WITHOUT = ("reachmap.core", "reachmap.scans", "reachmap.plots", "reachmap.view")


@pytest.mark.parametrize("name", ["reachmap.tools.rank", "reachmap.ranking"])
def test_ranking_is_a_look_up(name: str) -> None:
    """What `rank` loads has no planner, no kinematics and no plots in it."""
    heavy = [found for found in closure(name) if found.startswith(RANKING_WITHOUT)]
    assert not heavy
