"""Options that several commands share, as values, so that they read alike everywhere.

=============================  =================================  =====================
Option                         Parameter of the command           Commands
=============================  =================================  =====================
``CELL``                       ``cell: str``                      workspace-scan, check
``--cell``                     ``cell: str | None``               bin-scan, rank
``--bin``                      ``bin_name: str | None``           place-bin, bin-scan
``--keep-scan-configuration``  ``keep_scan_configuration: bool``  place-bin, place-robot
``--set``                      ``overrides: tuple[str, ...]``     all that read a cell
``--seed``                     ``seed: int | None``               scans, validate
``-j``, ``--workers``          ``workers: int``                   scans, place-bin
``--executor``                 ``executor: str``                  scans
``--shard``                    ``shard: tuple[int, int] | None``  scans
``--restart``                  ``restart: bool``                  scans
``--dry-run``                  ``dry_run: bool``                  scans
``--progress``                 ``progress: bool``                 scans, place-bin
``-o``, ``--output``           ``output: Path``                   all that write
``--overwrite``                ``overwrite: bool``                all that write
``--json``                     ``as_json: bool``                  all that answer
``-v``, ``-q``                 none, kept by the group            every command
``--debug``                    none, kept by the group            every command
=============================  =================================  =====================

A value comes from the command line, else from the environment variable
``REACHMAP_<COMMAND>_<PARAMETER>`` (``REACHMAP_BIN_SCAN_WORKERS``), else, where the
table of :data:`FOR_ALL` has it, from one variable for every command
(``REACHMAP_WORKERS``), else from the cell or the default.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click
from click.core import ParameterSource

from reachmap.cli.completing import DEFAULT_CELL, complete_cells, complete_keys
from reachmap.cli.diagnostics import RunState
from reachmap.runtime.options import RunOptions, available_cores

Decorated = TypeVar("Decorated", bound=Callable[..., Any])
Decorator = Callable[[Decorated], Decorated]

FOR_ALL = frozenset({"cell", "workers", "executor", "progress"})

# What a name ends in promises what is in the file.
SUFFIXES = {
    ".h5": "an artefact (HDF5)",
    ".json": "JSON",
    ".yaml": "a cell (YAML)",
    ".html": "a page",
    ".png": "a picture",
    ".svg": "a picture",
    ".csv": "a table",
    ".urdf": "a robot",
}
A_FOLDER = "a folder"


class NamedPath(click.Path):
    """A path with a name: what a script's unset variable leaves is none."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> Any:
        """Refuse the empty name, which would be the current folder."""
        if not os.fspath(value):
            self.fail("a name is missing (got '')", param, ctx)
        return super().convert(value, param, ctx)


INPUT_FILE = OUTPUT_PATH = NamedPath()


class OutputPath(NamedPath):
    """A path whose suffix does not promise another kind of file.

    Parameters
    ----------
    holds : str
        The suffix of what is written; :data:`A_FOLDER`, which should have none of
        them; "" for whatever the name says.
    """

    def __init__(self, holds: str) -> None:
        super().__init__()
        self.holds = holds

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> Any:
        """Refuse the suffix of another kind; any that is not known will do."""
        path = Path(os.fsdecode(super().convert(value, param, ctx)))
        suffix = path.suffix.lower()
        if self.holds and suffix != self.holds and suffix in SUFFIXES:
            kind = SUFFIXES.get(self.holds, self.holds)
            end = f", in a name that ends in {self.holds}" if kind != self.holds else ""
            self.fail(f"{path}: the output is {kind}{end}", param, ctx)
        return path


class SharedOption(click.Option):
    """An option whose variable for one command wins over the one for all."""

    def resolve_envvar_value(self, ctx: click.Context) -> str | None:
        """Value from the environment: the command's own variable, else for all."""
        own = super().resolve_envvar_value(ctx)
        if own is None and self.name in FOR_ALL:
            own = os.environ.get(f"REACHMAP_{self.name.upper()}") or None
        return own


def parse_shard(
    ctx: click.Context, parameter: click.Parameter, value: str | None
) -> tuple[int, int] | None:
    """Turn ``I/N`` into (I, N): the I-th of N shards, counted from 1."""
    if value is None:
        return None
    first, slash, second = value.partition("/")
    if slash and value.isascii() and first.isdigit() and second.isdigit():
        index, count = int(first), int(second)
        if 1 <= index <= count:
            return index, count
    raise click.BadParameter(f"{value!r} is not I/N with 1 <= I <= N, such as 3/8.")


def _option(*declarations: str, **settings: Any) -> Decorator[Any]:
    return click.option(*declarations, cls=SharedOption, **settings)


class SeedType(click.IntRange):
    """A seed as cells take it: 0 or more, of 63 bits."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> int:
        """Read one; click reports what is none."""
        number = int(super().convert(value, param, ctx))
        if number >= 2**63:
            self.fail(f"{number} is too large; the largest is 2^63 - 1.", param, ctx)
        return number


class NameType(click.types.StringParamType):
    """A name; what YAML reads as nothing would stand for the default."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> str:
        """Read one; click reports what is none."""
        text = str(super().convert(value, param, ctx))
        if text.strip().lower() in ("", "~", "null"):
            self.fail(f"{text!r} is not a name.", param, ctx)
        return text


cell_argument = click.argument(
    "cell", default=DEFAULT_CELL, metavar="[CELL]", shell_complete=complete_cells
)

cell_option = _option(
    "--cell",
    metavar="CELL",
    shell_complete=complete_cells,
    help="A shipped cell by name (see reachmap cells), or the path of a cell file.",
)

set_option = _option(
    "--set",
    "overrides",
    multiple=True,
    metavar="KEY=VALUE",
    shell_complete=complete_keys,
    help="Override one value of the cell, as in bin_scan.repeats=1. Repeatable; "
    "recorded in the result.",
)

bin_option = _option(
    "--bin",
    "bin_name",
    type=NameType(),
    metavar="NAME",
    help="Which of the cell's bins to use; default: its pick_from.",
)


def with_bin(overrides: tuple[str, ...], name: str | None) -> tuple[str, ...]:
    """Append to overrides the bin of ``--bin``, if one was given."""
    return overrides if name is None else (*overrides, f"pick_from={name}")


keep_scan_option = _option(
    "--keep-scan-configuration",
    is_flag=True,
    help="Keep the cell's own scan configuration.",
)

seed_option = _option(
    "--seed",
    type=SeedType(min=0),
    metavar="N",
    help="Seed of everything random; by default the cell's.",
)

workers_option = _option(
    "-j",
    "--workers",
    type=click.IntRange(min=1),
    metavar="N",
    default=available_cores,
    show_default="all cores",
    help="Worker processes; 1 runs in this process.",
)

executor_option = _option(
    "--executor",
    default="processes",
    show_default=True,
    metavar="NAME",
    help="Where the work runs: processes, dask:local or dask:tcp://HOST:PORT.",
)

shard_option = _option(
    "--shard",
    callback=parse_shard,
    metavar="I/N",
    help="Do only the I-th of N shares of the work and write a journal for "
    "reachmap merge.",
)

restart_option = _option(
    "--restart",
    is_flag=True,
    help="Discard the journal of an earlier run and start over.",
)

dry_run_option = _option(
    "--dry-run",
    is_flag=True,
    help="Report what would be done and how long it would take; write nothing.",
)


def _unless_quiet(ctx: click.Context, parameter: click.Parameter, value: bool) -> bool:
    state = ctx.find_object(RunState)
    return value and not (state is not None and state.verbosity < 0)


progress_option = _option(
    "--progress/--no-progress",
    default=True,
    callback=_unless_quiet,
    help="Show progress on stderr: a bar on a terminal, otherwise occasional lines. "
    "-q also silences it.",
)

overwrite_option = _option(
    "--overwrite", is_flag=True, help="Replace the output if it exists."
)

json_option = _option(
    "--json",
    "as_json",
    is_flag=True,
    help="Print exactly one JSON object on stdout.",
)


def output_option(
    default: str | None = None,
    *,
    holds: str = "",
    required: bool = False,
    help: str | None = None,
) -> Decorator[Any]:
    """``-o/--output PATH`` with the command's own default name.

    Parameters
    ----------
    default : str, optional
        Name in the current folder, such as ``"bin.h5"``; None leaves it to the tool.
    holds : str
        As in :class:`OutputPath`, where the default name does not say it.
    required : bool
        Whether the command has no sensible default.
    help : str, optional
        What is written there, where "Write the result here." is too vague.
    """
    # A default of None would be a value to Click, and the option never missing.
    usual = {} if default is None else {"default": default, "show_default": True}
    return _option(
        "-o",
        "--output",
        type=OutputPath(holds or Path(default or "").suffix),
        **usual,
        required=required,
        metavar="PATH",
        help=help or "Write the result here.",
    )


def given(*names: str) -> list[str]:
    """Those of the named parameters that are on the command line, as spelled there."""
    ctx = click.get_current_context()
    return [
        parameter.opts[-1] if parameter.param_type_name == "option" else
        parameter.make_metavar(ctx)
        for parameter in ctx.command.params
        if parameter.name in names
        and ctx.get_parameter_source(parameter.name) is ParameterSource.COMMANDLINE
    ]  # fmt: skip


def unused(*names: str, because: str) -> None:
    """Refuse options on the command line that would have no effect.

    Parameters
    ----------
    *names : str
        Parameters of the command that is running.
    because : str
        Rest of the sentence after the options, as in ``"needs --cell"``.

    Raises
    ------
    click.UsageError
        One of them is given. Values from the environment are for many commands and
        may go unused.
    """
    if found := given(*names):
        raise click.UsageError(f"{', '.join(found)}: {because}.")


def compose(*decorators: Decorator[Any]) -> Decorator[Any]:
    """Join decorators into one; their options appear in the order given."""

    def decorate(function: Any) -> Any:
        for decorator in reversed(decorators):
            function = decorator(function)
        return function

    return decorate


def into_run(function: Any) -> Any:
    """Pass the options on how a command computes as one ``run: RunOptions``."""

    @functools.wraps(function)
    def command(**values: Any) -> Any:
        names = ("workers", "executor", "shard", "restart", "overwrite")
        how = {name: values.pop(name) for name in names if name in values}
        if how.get("executor", "").startswith("dask:tcp:"):
            unused("workers", because="the workers are those of the cluster")
        run = RunOptions(**how, quiet=not values.pop("progress"))
        return function(**values, run=run)

    return command


run_options = compose(
    workers_option,
    executor_option,
    overwrite_option,
    progress_option,
    json_option,
    into_run,
)

scan_options = compose(
    set_option,
    seed_option,
    workers_option,
    executor_option,
    shard_option,
    restart_option,
    overwrite_option,
    dry_run_option,
    progress_option,
    json_option,
    into_run,
)


def check_scan_options(run: RunOptions, *, dry_run: bool) -> None:
    """Refuse options of a scan that would have no effect."""
    if run.shard is not None:
        unused("overwrite", because="a shard writes a journal; --restart discards it")
    if dry_run:
        unused("overwrite", "restart", because="--dry-run writes nothing")
