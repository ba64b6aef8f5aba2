"""What goes to stderr: the log as ``-v`` and ``-q`` ask, and how a command line ends.

This is the one place where errors become lines and exit codes:

===== ==========================================================================
Code  Meaning
===== ==========================================================================
0     done
1     done, but a gate failed (``--fail-under``, ``--min-reachable``, …)
2     wrong usage or wrong input, or the answer cannot be written
3     unfinished; the same command resumes
70    an internal error; ``--debug`` shows where
130   interrupted
141   stdout was closed by its reader (``| head``)
===== ==========================================================================
"""

from __future__ import annotations

import logging
import os
import re
import sys
import traceback
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import click

from reachmap import __version__
from reachmap.cli.streams import AnswerError, discard_stdout
from reachmap.errors import MissingExtraError, OutputError, ReachmapError
from reachmap.text import is_terminal

# EX_SOFTWARE of sysexits.h; 128 and the signal (SIGINT, SIGPIPE), as shells count.
INTERNAL_ERROR = 70
INTERRUPTED = 130
PIPE_CLOSED = 141

LEVELS = (logging.ERROR, logging.WARNING, logging.INFO, logging.DEBUG)
COLOURS = {logging.WARNING: "yellow", logging.ERROR: "red"}
NORMAL = LEVELS.index(logging.WARNING)
ARGUMENTS = "reachmap.arguments"
"""Context key of the command line's words: --version may precede -v."""
ENGINES_WANTED = re.compile(r"-v+|--verbose")


class PipeClosedError(Exception):
    """Stands in for BrokenPipeError, which click would turn into exit code 1."""


@dataclass(slots=True, kw_only=True)
class RunState:
    """Values of ``-v``, ``-q`` and ``--debug``; the context object of the group."""

    debug: bool = False
    verbosity: int = 0


def program_name(colour: str | None = None) -> str:
    """First word of every line, coloured where the terminal supports it."""
    name = "reachmap:"
    if colour is None or os.environ.get("NO_COLOR") or not is_terminal(sys.stderr):
        return name
    return click.style(name, fg=colour, bold=True)


def exit_code_of(run: Callable[[], Any], state: RunState) -> int:
    """Run a command line; report what went wrong on stderr.

    Parameters
    ----------
    run : callable
        Invokes click without its own error handling; an int it returns is the code
        of ``ctx.exit``.
    state : RunState
        Filled in while ``run`` parses its options.

    Returns
    -------
    int
        Exit code, see the table of this module.
    """
    try:
        result = run()
        sys.stdout.flush()
    except (BrokenPipeError, PipeClosedError):
        discard_stdout()
        return PIPE_CLOSED
    except click.ClickException as error:
        error.show()
        return error.exit_code
    except (click.Abort, KeyboardInterrupt) as error:
        return _interrupted(error)
    except ReachmapError as error:
        _report(error.lines, state)
        return error.exit_code
    except AnswerError as error:
        discard_stdout()
        _report([f"standard output cannot be written ({error.strerror})"], state)
        return OutputError.exit_code
    except Exception as error:
        if lines := _missing_lines(error):
            _report(lines, state)
            return MissingExtraError.exit_code
        _report(_internal_lines(error, state), state)
        return INTERNAL_ERROR
    return result if isinstance(result, int) else 0


def _report(lines: Iterable[str], state: RunState) -> None:
    if state.debug:
        traceback.print_exc()
    _print_errors(lines)


def _print_errors(lines: Iterable[str]) -> None:
    for line in lines:
        click.echo(f"{program_name('red')} {line}", err=True)


def _missing_lines(error: Exception) -> list[str]:
    """Message for a missing dependency, as after a ranking-only installation."""
    name = error.name if isinstance(error, ModuleNotFoundError) else None
    if name is None or name.partition(".")[0] == "reachmap":
        return []
    return [
        f"this needs {name}, which is not installed; the ranking-only installation "
        "leaves it out: install reachmap-cells with its dependencies"
    ]


def _internal_lines(error: Exception, state: RunState) -> list[str]:
    kind = type(error).__name__
    summary = (str(error).strip().splitlines() or ["no message"])[0]
    hint = "" if state.debug else " (add --debug for the traceback)"
    return [f"internal error: {kind}: {summary}{hint}"]


def _interrupted(error: BaseException) -> int:
    # click hides the interrupt, and what it says about resuming, behind an Abort.
    cause = error.__cause__ if isinstance(error, click.Abort) else error
    message = str(cause or "").strip() or "interrupted"
    _print_errors(message.splitlines())
    return INTERRUPTED


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
