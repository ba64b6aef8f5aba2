"""``-v``, ``-q`` and ``--debug``: accepted before and after the command's name."""

from __future__ import annotations

import logging
import re
import sys

import click

from reachmap import __version__
from reachmap.cli.failures import RunState
from reachmap.cli.terminal import program_name

LEVELS = (logging.ERROR, logging.WARNING, logging.INFO, logging.DEBUG)
COLOURS = {logging.WARNING: "yellow", logging.ERROR: "red"}
NORMAL = LEVELS.index(logging.WARNING)
ARGUMENTS = "reachmap.arguments"
"""Context key of the command line's words: --version may precede -v."""
ENGINES_WANTED = re.compile(r"-v+|--verbose")


class _StderrHandler(logging.StreamHandler):  # type: ignore[type-arg]
    """Writes to whatever ``sys.stderr`` is at the time of writing."""

    def emit(self, record: logging.LogRecord) -> None:
        """Follow a stderr that was replaced since the handler was made."""
        self.stream = sys.stderr
        super().emit(record)

    def format(self, record: logging.LogRecord) -> str:
        """Prefix the name of the program, in the colour of the level."""
        return f"{program_name(COLOURS.get(record.levelno))} {super().format(record)}"


def configure_logging(verbosity: int) -> None:
    """Send the package's log to stderr; 0 shows warnings, higher values more."""
    logger = logging.getLogger("reachmap")
    logger.setLevel(LEVELS[min(max(NORMAL + verbosity, 0), len(LEVELS) - 1)])
    if not any(isinstance(handler, _StderrHandler) for handler in logger.handlers):
        logger.addHandler(_StderrHandler())


def _count(ctx: click.Context, parameter: click.Parameter, value: int) -> None:
    state = ctx.find_root().obj
    if isinstance(state, RunState) and value:
        state.verbosity += value if parameter.name == "verbose" else -value
        configure_logging(state.verbosity)


def _debug(ctx: click.Context, parameter: click.Parameter, value: bool) -> None:
    state = ctx.find_root().obj
    if isinstance(state, RunState) and value:
        state.debug = True


def show_version(ctx: click.Context, parameter: click.Parameter, value: bool) -> None:
    """Print the version and exit; with ``-v`` anywhere, also those of the engines."""
    if not value or ctx.resilient_parsing:
        return
    click.echo(f"reachmap {__version__}")
    if any(ENGINES_WANTED.fullmatch(word) for word in ctx.meta.get(ARGUMENTS, ())):
        # Imported here: a bare version needs no NumPy.
        from reachmap.maps.provenance import package_versions

        for name, version in package_versions().items():
            click.echo(f"{name} {version}")
    ctx.exit()


def verbosity_parameters() -> list[click.Parameter]:
    """Fresh ``-v``, ``-q`` and ``--debug`` that no command has to receive."""
    return [
        click.Option(
            ["-v", "--verbose"],
            count=True,
            expose_value=False,
            is_eager=True,
            callback=_count,
            help="Log more on stderr; -vv logs most.",
        ),
        click.Option(
            ["-q", "--quiet"],
            count=True,
            expose_value=False,
            is_eager=True,
            callback=_count,
            help="Log less on stderr.",
        ),
        click.Option(
            ["--debug"],
            is_flag=True,
            expose_value=False,
            callback=_debug,
            help="Show the traceback of an error.",
        ),
    ]
