"""Defaults of the command line, which states them again so that help loads no tool."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Iterator
from importlib import import_module
from typing import Any

import click
import pytest

from reachmap.cli.group import COMMANDS, group
from reachmap.cli.list_options import list_options
from reachmap.cli.text.tables import WIDTH
from reachmap.ranking.lookup.settings import CostBasis, RankSettings

# What click has for an option without a default; older ones have None.
UNSET = getattr(click.core, "UNSET", None)
# A command opens the browser, a program that calls the tool mostly does not want it.
DIFFERENT = {("view", "open_browser")}
TOOLS = ("place_bin", "rank", "view", "compare", "empty", "robust", "validate",
         "study", "place_robot", "export", "workspace_scan")  # fmt: skip


def own_defaults(module: Any) -> Iterator[tuple[str, str, Any]]:
    """Name of a function or record of a module, a parameter, and its default."""
    for name, member in vars(module).items():
        if getattr(member, "__module__", "") != module.__name__:
            continue
        if dataclasses.is_dataclass(member):
            for field in dataclasses.fields(member):
                yield name, field.name, field.default
        elif inspect.isfunction(member) and not name.startswith("_"):
            for key, parameter in inspect.signature(member).parameters.items():
                yield name, key, parameter.default


def given_defaults(command: click.Command) -> dict[str, Any]:
    """Default of each option that has one."""
    found = {option.name or "": option.default for option in command.params}
    return {
        name: value
        for name, value in found.items()
        if value not in (UNSET, None, ()) and not callable(value)
    }


@pytest.mark.parametrize("tool", TOOLS)
def test_commands_have_the_defaults_of_their_tools(tool: str) -> None:
    """The same numbers from a terminal and from Python."""
    name = tool.replace("_", "-")
    stated = given_defaults(import_module(COMMANDS[name].module).command)
    module = import_module(f"reachmap.tools.{tool}")
    empty = (inspect.Parameter.empty, dataclasses.MISSING)
    compared = [
        (owner, key, default, stated[key])
        for owner, key, default in own_defaults(module)
        if key in stated and default not in empty and (name, key) not in DIFFERENT
    ]
    assert compared, "nothing is stated twice: leave this tool out"
    assert [one for one in compared if one[2] != one[3]] == []


def test_lists_are_ranked_by_the_defaults_of_the_ranking() -> None:
    """Weights, neighbours, roll and the basis of the cost."""

    @click.command()
    @list_options
    def command(**values: Any) -> None:
        """Take the options."""

    stated = given_defaults(command)
    own = {
        field.name: field.default
        for record in (RankSettings, CostBasis)
        for field in dataclasses.fields(record)
    }
    both = set(stated) & set(own)
    assert {"weights", "neighbours", "roll", "cost"} <= both
    assert {key: stated[key] for key in both} == {key: own[key] for key in both}


def test_answers_and_help_have_one_width() -> None:
    """The group states it again, since help loads no text module."""
    assert group.context_settings["max_content_width"] == WIDTH
