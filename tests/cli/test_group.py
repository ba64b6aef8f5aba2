"""The frame of the command line: help, look-up, failures and exit codes."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path

import click
import pytest
from click.testing import CliRunner, Result

import reachmap
from reachmap.cli import group
from reachmap.cli.group import COMMANDS, Entry, PipelineGroup

ENGINES = ("pinocchio", "coal", "eaik", "ompl", "h5py", "matplotlib", "viser", "scipy")
AVAILABLE = [name for name, entry in COMMANDS.items() if entry.is_available()]

TOY_COMMANDS = '''
    """Commands that fail in every way there is."""
    import logging
    import click
    from reachmap.errors import *

    def raising(error):
        @click.command()
        def command():
            """Fail."""
            raise error
        return command

    two_lines = raising(CellError(["c.yaml:1:2: a: first", "c.yaml:3:4: b: second"]))
    gate = raising(GateFailedError("too low"))
    resumable = raising(IncompleteError("resume with the same command"))
    engine = raising(EngineError("solver broke"))
    defect = raising(ZeroDivisionError("division by zero"))
    interrupt = raising(KeyboardInterrupt("12 of 20 done; the same command resumes"))
    silent_interrupt = raising(KeyboardInterrupt())
    usage = raising(click.UsageError("no such thing"))
    pipe = raising(BrokenPipeError(32, "Broken pipe"))

    @click.command()
    def logs():
        """Log at every level."""
        for level in ("debug", "info", "warning", "error"):
            getattr(logging.getLogger("reachmap.toy"), level)("said %s", level)
        click.echo("answer")

    @click.command()
    @click.option("--number", type=int, default=1)
    def options(number):
        """Take an option."""
        click.echo(number)
'''  # fmt: skip


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> PipelineGroup:
    """A group with one command per way of ending, each its own module."""
    source = textwrap.dedent(TOY_COMMANDS)
    (tmp_path / "toy_commands.py").write_text(source)
    monkeypatch.syspath_prepend(tmp_path)
    names = [
        *("two-lines", "gate", "resumable", "engine", "defect", "interrupt"),
        *("silent-interrupt", "usage", "pipe", "logs", "options"),
    ]
    table = {}
    for name in names:
        attribute = name.replace("-", "_")
        (tmp_path / f"toy_{attribute}.py").write_text(
            f"from toy_commands import {attribute} as command\n"
        )
        table[name] = Entry(section="Toy", module=f"toy_{attribute}", help="Fail.")
    table["absent"] = Entry(section="Toy", module="toy_absent", help="Not installed.")
    return PipelineGroup(
        name="toy", table=table, context_settings={"auto_envvar_prefix": "TOY"}
    )


@pytest.fixture
def run(toy: PipelineGroup) -> Callable[..., Result]:
    """Run the toy group and give what it printed and how it ended."""

    def invoke(*arguments: str, env: dict[str, str] | None = None) -> Result:
        return CliRunner().invoke(toy, list(arguments), env=env)

    return invoke


@pytest.mark.parametrize(
    ("command", "code", "lines"),
    [
        ("two-lines", 2, ["c.yaml:1:2: a: first", "c.yaml:3:4: b: second"]),
        ("gate", 1, ["too low"]),
        ("resumable", 3, ["resume with the same command"]),
        ("engine", 70, ["solver broke"]),
        ("interrupt", 130, ["12 of 20 done; the same command resumes"]),
        ("silent-interrupt", 130, ["interrupted"]),
    ],
)
def test_each_error_ends_with_its_lines_and_code(
    run: Callable[..., Result], command: str, code: int, lines: list[str]
) -> None:
    """Errors of the family print one prefixed line per mistake, and no traceback."""
    result = run(command)
    assert result.exit_code == code
    assert result.stdout == ""
    assert result.stderr.split("\n")[-len(lines) - 1 : -1] == [
        f"reachmap: {line}" for line in lines
    ]
    assert "Traceback" not in result.stderr


def test_a_defect_is_one_line_with_a_hint(run: Callable[..., Result]) -> None:
    """Anything unforeseen exits 70 and points at --debug."""
    result = run("defect")
    assert result.exit_code == 70
    assert result.stderr == (
        "reachmap: internal error: ZeroDivisionError: division by zero "
        "(add --debug for the traceback)\n"
    )


@pytest.mark.parametrize("place", ["before", "after"])
def test_debug_shows_the_traceback(run: Callable[..., Result], place: str) -> None:
    """--debug works on either side of the command's name."""
    arguments = ["--debug", "defect"] if place == "before" else ["defect", "--debug"]
    result = run(*arguments)
    assert result.exit_code == 70
    assert "Traceback (most recent call last)" in result.stderr
    assert "add --debug" not in result.stderr


def test_wrong_usage_exits_2(run: Callable[..., Result]) -> None:
    """What click finds wrong keeps click's wording and code."""
    assert run("usage").exit_code == 2
    assert run("options", "--number", "x").exit_code == 2
    assert "Error: no such thing" in run("usage").stderr


def test_a_near_miss_is_suggested(run: Callable[..., Result]) -> None:
    """A misspelt command names the command that was meant."""
    result = run("optoins")
    assert result.exit_code == 2
    assert "No such command 'optoins'. Did you mean options?" in result.stderr


@pytest.mark.parametrize(
    ("command", "option", "usage"),
    [
        ("workspace-scan", "--cell", "workspace-scan CELL"),
        ("validate", "--map", "validate MAP"),
        ("bin-scan", "--placement", "bin-scan PLACEMENT"),
    ],
)
def test_an_argument_given_like_an_option(
    command: str, option: str, usage: str
) -> None:
    """The message shows where it belongs."""
    result = CliRunner().invoke(group, [command, option, "x"], prog_name="reachmap")
    assert result.exit_code == 2
    assert f"is an argument, as in `reachmap {usage}`" in result.stderr


def test_commands_that_are_not_installed_are_hidden(run: Callable[..., Result]) -> None:
    """A table line without its module is neither listed nor found."""
    assert "absent" not in run("--help").stdout
    assert run("absent").exit_code == 2


@pytest.mark.parametrize(
    ("arguments", "levels"),
    [
        (["logs"], ["warning", "error"]),
        (["-q", "logs"], ["error"]),
        (["logs", "-q"], ["error"]),
        (["logs", "-v"], ["info", "warning", "error"]),
        (["-v", "logs", "-v"], ["debug", "info", "warning", "error"]),
        (["logs", "-vvvv"], ["debug", "info", "warning", "error"]),
        (["-v", "logs", "-q"], ["warning", "error"]),
    ],
)
def test_verbosity_is_counted_and_logs_go_to_stderr(
    run: Callable[..., Result], arguments: list[str], levels: list[str]
) -> None:
    """-v and -q add up wherever they stand; stdout holds the answer alone."""
    result = run(*arguments)
    assert result.stdout == "answer\n"
    said = [line.removeprefix("reachmap: said ") for line in result.stderr.splitlines()]
    assert said == levels


def test_a_closed_pipe_is_not_an_error(run: Callable[..., Result]) -> None:
    """A reader that goes away ends the command silently with 141."""
    result = run("pipe")
    assert (result.exit_code, result.stderr) == (141, "")


def test_a_closed_pipe_of_a_real_process_is_silent() -> None:
    """`reachmap --help | head -0` leaves nothing on stderr."""
    read, write = os.pipe()
    os.close(read)
    process = subprocess.run(
        [sys.executable, "-m", "reachmap", "--help"],
        stdout=write,
        stderr=subprocess.PIPE,
        check=False,
    )
    os.close(write)
    assert process.stderr == b""
    assert process.returncode in {1, 141}


def test_the_command_line_wins_over_the_environment(
    run: Callable[..., Result],
) -> None:
    """Precedence: option, then REACHMAP_<COMMAND>_<OPTION>, then the default."""
    env = {"TOY_OPTIONS_NUMBER": "7"}
    assert run("options").stdout == "1\n"
    assert run("options", env=env).stdout == "7\n"
    assert run("options", "--number", "3", env=env).stdout == "3\n"


def test_version_is_the_package_version() -> None:
    """--version prints name and version, nothing else."""
    result = CliRunner().invoke(group, ["--version"])
    assert result.stdout == f"reachmap {reachmap.__version__}\n"


def test_help_imports_no_engine() -> None:
    """`reachmap --help` lists every command without importing what they use."""
    script = (
        "import sys\n"
        "from reachmap.cli import group\n"
        "group.main(['--help'], standalone_mode=False)\n"
        "loaded = {name.partition('.')[0] for name in sys.modules}\n"
        f"print(sorted(loaded & {set(ENGINES) | {'numpy', 'pydantic'}!r}))\n"
        "print(sorted(n for n in sys.modules if n.startswith('reachmap.cli.')))\n"
    )
    output = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    frame = ["diagnostics", "group", "streams"]
    assert output[-2] == "[]"
    assert output[-1] == str([f"reachmap.cli.{name}" for name in frame])
    for name in AVAILABLE:
        assert any(line.strip().startswith(name) for line in output), name


def test_importing_every_command_imports_no_engine() -> None:
    """Heavy imports live inside commands, so completion and `CMD --help` are quick."""
    script = (
        "import sys, importlib\n"
        "from reachmap.cli.group import COMMANDS\n"
        "for entry in COMMANDS.values():\n"
        "    if entry.is_available():\n"
        "        importlib.import_module(entry.module)\n"
        f"        loaded = set(sys.modules) & {set(ENGINES)!r}\n"
        "        assert not loaded, (entry.module, loaded)\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True)


def test_every_command_of_the_table_is_there() -> None:
    """Hiding is for commands being written; a release has them all."""
    assert list(COMMANDS) == AVAILABLE


@pytest.mark.parametrize("name", AVAILABLE)
def test_table_line_is_the_first_sentence_of_the_help(name: str) -> None:
    """The quick help and the command's own help say the same."""
    command = group.get_command(click.Context(group), name)
    assert command is not None
    first = " ".join((command.help or "").split("\n\n")[0].split())
    assert first == COMMANDS[name].help
    assert command.name == name


@pytest.mark.parametrize("name", AVAILABLE)
def test_every_help_has_an_example_and_explains_its_options(name: str) -> None:
    """Help can be used without the documentation."""
    result = CliRunner().invoke(group, [name, "--help"], prog_name="reachmap")
    assert result.exit_code == 0, result.output
    assert "Example" in result.stdout
    assert f"reachmap {name}" in result.stdout.partition("Example")[2]
    command = group.get_command(click.Context(group), name)
    assert command is not None
    bare = [
        parameter.name
        for parameter in command.params
        if isinstance(parameter, click.Option) and not parameter.help
    ]
    assert not bare, f"options without help: {bare}"
