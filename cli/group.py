"""The command ``reachmap``: its subcommands, lazy, and one place for failures."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from reachmap.cli.diagnostics import (
    ARGUMENTS,
    PipeClosedError,
    RunState,
    configure_logging,
    exit_code_of,
    show_version,
    verbosity_parameters,
)
from reachmap.errors import SettingsError
from reachmap.runtime.signals import stop_signals


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One subcommand.

    Attributes
    ----------
    section : str
        Heading it stands under in ``reachmap --help``.
    module : str
        Module that defines it as ``command``.
    help : str
        First sentence of its help.
    """

    section: str
    module: str
    help: str

    def is_available(self) -> bool:
        """Whether the module is installed."""
        return find_spec(self.module) is not None


def _section(name: str, commands: dict[str, str]) -> dict[str, Entry]:
    return {
        command: Entry(
            section=name,
            module=f"reachmap.cli.{command.replace('-', '_')}",
            help=help_line,
        )
        for command, help_line in commands.items()
    }


COMMANDS: dict[str, Entry] = {
    **_section(
        "Pipeline",
        {
            "workspace-scan": "Map what the arm reaches around its base.",
            "heatmap": "Draw a workspace map, one picture per level.",
            "place-bin": "Find where the bin should stand, and its scan configuration.",
            "bin-scan": "Plan to every test grasp inside the bin.",
            "rank": "Re-order grasp lists by cost, using the bin map alone.",
        },
    ),
    **_section(
        "Inspect",
        {
            "info": "Summarise an artefact or a journal.",
            "view": "Show a cell or an artefact in 3D in the browser.",
            "report": "Write a report of a run as one self-contained page.",
            "compare": "Compare two maps of the same kind, frame by frame.",
            "empty": "Fill a bin with parts and simulate emptying it.",
            "robust": "Find which grasps survive errors of bin, camera and tool.",
            "validate": "Test a bin map by planning to real grasps.",
        },
    ),
    **_section(
        "Design",
        {
            "study": "Map variants of a cell; find which changes are significant.",
            "place-robot": "Find where the robot should stand for a given bin.",
        },
    ),
    **_section(
        "Motions",
        {"export": "Write verified motions of a bin map for controllers."},
    ),
    **_section(
        "Cells",
        {
            "cells": "List the shipped cells, or export one.",
            "carriers": "List the load carriers that `bin.carrier` takes.",
            "check": "Check a cell: joints, bodies, limits, scan configuration.",
            "new-cell": "Write a commented starter cell for a robot.",
            "schema": "Print the JSON Schema of cells, grasp lists or ranked lists.",
        },
    ),
    **_section(
        "Runs",
        {
            "run": "Run the pipeline: scan, place the bin, scan it, rank, report.",
            "verify": "Check files for damage and against their format.",
            "merge": "Merge the journals of shards into one artefact.",
        },
    ),
    **_section("Shell", {"completion": "Print a shell-completion script."}),
}


def sections(commands: dict[str, Entry]) -> dict[str, list[tuple[str, str]]]:
    """Name and help of the available commands, by section, in table order."""
    grouped: dict[str, list[tuple[str, str]]] = {}
    for name, entry in commands.items():
        if entry.is_available():
            grouped.setdefault(entry.section, []).append((name, entry.help))
    return grouped


def _require_folder() -> None:
    try:
        Path.cwd()
    except OSError:
        raise SettingsError(
            "the current folder no longer exists or cannot be entered; change to "
            "another"
        ) from None


@contextmanager
def _distinct_broken_pipe() -> Iterator[None]:
    try:
        yield
    except BrokenPipeError as error:
        raise PipeClosedError from error


@contextmanager
def _named_arguments() -> Iterator[None]:
    """Say of an argument that was given like an option that it stands by itself."""
    try:
        yield
    except click.NoSuchOption as error:
        context, asked = error.ctx, error.option_name.lstrip("-")
        if context is None:
            raise
        for one in context.command.params:
            name = (one.metavar or one.name or "").strip("[].").lower()
            if isinstance(one, click.Argument) and name == asked:
                raise click.UsageError(
                    f"No such option {error.option_name!r}: {asked} is an argument, "
                    f"as in `{context.command_path} {asked.upper()}`.",
                    context,
                ) from None
        raise


class PipelineGroup(click.Group):
    """A click group that knows its commands by table and imports them on use."""

    def __init__(
        self, *, table: dict[str, Entry] | None = None, **settings: Any
    ) -> None:
        super().__init__(**settings)
        self.table = COMMANDS if table is None else table
        self.params.extend(verbosity_parameters())

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names in the order of the pipeline, without those not installed."""
        return [name for name, entry in self.table.items() if entry.is_available()]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a command by name; every one also takes -v, -q and --debug."""
        entry = self.table.get(cmd_name)
        if entry is None or not entry.is_available():
            return None
        command: click.Command = import_module(entry.module).command
        command.name = cmd_name
        if not any(parameter.name == "verbose" for parameter in command.params):
            command.params.extend(verbosity_parameters())
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command, or suggest the closest name."""
        if args and not args[0].startswith("-") and args[0] not in self.table:
            names = self.list_commands(ctx)
            close = difflib.get_close_matches(args[0], names, n=1)
            hint = f" Did you mean {close[0]}?" if close else ""
            ctx.fail(f"No such command {args[0]!r}.{hint}")
        return super().resolve_command(ctx, args)

    def format_commands(
        self, ctx: click.Context, formatter: click.HelpFormatter
    ) -> None:
        """Write the commands by section, from the table: nothing is imported."""
        for section, rows in sections(self.table).items():
            with formatter.section(section):
                formatter.write_dl(rows, col_max=16)

    def shell_complete(
        self, ctx: click.Context, incomplete: str
    ) -> list[CompletionItem]:
        """Complete names from the table, options from click."""
        names = [
            CompletionItem(name, help=self.table[name].help)
            for name in self.list_commands(ctx)
            if name.startswith(incomplete)
        ]
        return names + click.Command.shell_complete(self, ctx, incomplete)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Keep the words, so that eager options can see those that follow."""
        ctx.meta[ARGUMENTS] = tuple(args)
        return super().parse_args(ctx, args)

    def make_context(
        self, info_name: str | None, args: list[str], *rest: Any, **extra: Any
    ) -> click.Context:
        """Parse the options of the group, ``--help`` among them."""
        with _distinct_broken_pipe():
            return super().make_context(info_name, args, *rest, **extra)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; a closed pipe is distinguished from a failure."""
        with _distinct_broken_pipe(), _named_arguments():
            return super().invoke(ctx)

    def main(  # type: ignore[override]
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        *,
        standalone_mode: bool = True,
        **extra: Any,
    ) -> Any:
        """Run a command line; unless told otherwise, exit with its documented code."""
        if not standalone_mode:
            return super().main(args, prog_name, standalone_mode=False, **extra)
        state = RunState()
        configure_logging(state.verbosity)

        def run() -> Any:
            _require_folder()
            return super(PipelineGroup, self).main(
                args, prog_name, standalone_mode=False, obj=state, **extra
            )

        with stop_signals():  # SIGTERM and a closed terminal end it as Ctrl-C does
            code = exit_code_of(run, state)
        sys.exit(code)


@click.group(
    cls=PipelineGroup,
    name="reachmap",
    context_settings={
        "auto_envvar_prefix": "REACHMAP",
        "help_option_names": ["-h", "--help"],
        "max_content_width": 88,  # as tables.WIDTH, which the group does not load
    },
)
@click.option(
    "--version",
    is_flag=True,
    expose_value=False,
    is_eager=True,
    callback=show_version,
    help="Show the version and exit; with -v, also those of the engines.",
)
def group() -> None:
    """Path-reachability maps for bin-picking cells.

    A robot cell goes in, maps come out, and every later question is answered from a
    map: where the bin goes, which grasps the arm really reaches, and which to pick
    first. Each command of the pipeline writes one file that the next one reads.

    \b
    Example:
      reachmap workspace-scan
      reachmap heatmap
      reachmap place-bin
      reachmap bin-scan
      reachmap rank grasps.json
    """
