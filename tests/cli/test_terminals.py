"""What a terminal sees, and what pipes and logs get instead."""

from __future__ import annotations

import os
import pty
import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

ESCAPE = "\x1b"
COLOUR = re.compile(r"\x1b\[[0-9;]*(?:3[0-9]|38;[0-9;]+)m")
SCAN = ("bin-scan", "--cell", "planar-toy", "-j", "1", "--set", "bin_scan.grid=[2,2]",
        "--set", "bin_scan.repeats=1", "--overwrite", "-o", "bin.h5")  # fmt: skip
REACHMAP = (sys.executable, "-m", "reachmap")
# A stage of four frames, and a warning in its middle.
STAGE = (
    sys.executable,
    "-c",
    "import logging\n"
    "from reachmap.cli.streams import prepare_streams\n"
    "from reachmap.cli.diagnostics import configure_logging\n"
    "from reachmap.runtime.progress import Progress\n"
    "prepare_streams()\n"
    "configure_logging(0)\n"
    "progress = Progress('stage')\n"
    "progress.begin(4)\n"
    "logging.getLogger('reachmap.x').warning('mind the gap')\n"
    "progress.add(4, 4)\n"
    "progress.end()\n",
)


def shown(
    *command: str,
    folder: Path | None = None,
    env: Mapping[str, str] | None = None,
    on_terminal: str = "stderr",
) -> tuple[str, str, int]:
    """What a terminal and a pipe get, and the exit code.

    ``on_terminal`` is the stream that leads to the terminal: stdout or stderr; the
    other one is a pipe.
    """
    master, slave = pty.openpty()
    usual = {"TERM": "xterm-256color", "COLUMNS": "100"}
    known = {
        k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "FORCE_COLOR")
    }
    out, err = subprocess.PIPE, slave
    if on_terminal == "stdout":
        out, err = err, out
    env = known | usual | dict(env or {})
    with subprocess.Popen(
        command, cwd=folder, env=env, stdout=out, stderr=err
    ) as process:
        os.close(slave)
        seen = b""
        while block := _read(master):
            seen += block
        os.close(master)
        pipe = process.stdout or process.stderr
        assert pipe is not None
        rest = pipe.read()
    return seen.decode().replace("\r\n", "\n"), rest.decode(), process.returncode


def _read(master: int) -> bytes:
    try:
        return os.read(master, 65536)
    except OSError:  # the last writer has closed its end
        return b""


@pytest.fixture(scope="module")
def scanned(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str, str]:
    """A folder with a bin map, and what its scan showed on a terminal and a pipe."""
    folder = tmp_path_factory.mktemp("scan")
    seen, answer, code = shown(*REACHMAP, *SCAN, folder=folder)
    assert code == 0
    return folder, seen, answer


def test_a_terminal_sees_a_bar_for_each_stage(scanned: tuple[Path, str, str]) -> None:
    """Redrawn in place, with the cursor back in the end; stdout is the answer alone."""
    _, seen, answer = scanned
    for stage in ("bin-scan survey", "bin-scan connect", "bin-scan"):
        assert re.search(rf"\r\x1b\[2K{stage} .*━+.* \d+/\d+ \(100%\)", seen)
    assert seen.count("\x1b[?25l") == seen.count("\x1b[?25h") == 3
    assert COLOUR.search(seen)
    assert answer.startswith("output ")
    assert ESCAPE not in answer


def test_progress_can_be_silenced(scanned: tuple[Path, str, str]) -> None:
    """The terminal stays empty; the answer is the same."""
    folder, _, answer = scanned
    seen, again, _ = shown(*REACHMAP, *SCAN, "--no-progress", folder=folder)
    assert seen == ""
    assert again == answer


def test_colours_can_be_refused() -> None:
    """NO_COLOR leaves the bar and takes its colours."""
    seen, _, _ = shown(*STAGE, env={"NO_COLOR": "1"})
    assert "━━━" in seen
    assert not COLOUR.search(seen)


def test_a_dumb_terminal_gets_plain_lines() -> None:
    """Nothing is redrawn and nothing coloured."""
    seen, _, _ = shown(*STAGE, env={"TERM": "dumb"})
    assert "stage 4/4 (100%)" in seen
    assert ESCAPE not in seen
    assert "\r" not in seen


def test_a_pipe_gets_plain_lines_whatever_is_forced() -> None:
    """Logs of CI, where FORCE_COLOR often is set."""
    _, log, _ = shown(*STAGE, env={"FORCE_COLOR": "1"}, on_terminal="stdout")
    first, warning, last = log.splitlines()
    assert first.startswith("stage 0/4 (0%) elapsed ")
    assert warning == "reachmap: mind the gap"
    assert last.startswith("stage 4/4 (100%) ok 100.0% ")
    assert ESCAPE not in log
    assert "\r" not in log


def test_warnings_stand_above_the_bar() -> None:
    """A message that arrives while a bar is drawn keeps its line to itself."""
    seen, _, code = shown(*STAGE)
    assert code == 0
    plain = re.sub(r"\x1b\[[?0-9;]*[A-Za-z]", "", seen)
    lines = [line.split("\r")[-1] for line in plain.split("\n")]
    assert "reachmap: mind the gap" in lines


def test_answers_have_headings_and_links(scanned: tuple[Path, str, str]) -> None:
    """On a terminal; without its escapes the text is that of the pipe to a letter."""
    folder, _, _ = scanned
    call = (*REACHMAP, "info", "bin.h5")
    seen, _, _ = shown(*call, folder=folder, on_terminal="stdout")
    _, piped, _ = shown(*call, folder=folder)
    assert f";{(folder / 'bin.h5').as_uri()}{ESCAPE}\\bin.h5" in seen
    assert "\x1b[1mPath reachability\x1b[0m" in seen
    assert COLOUR.search(seen)
    links = re.sub(r"\x1b\]8;.*?\x1b\\", "", seen)
    assert re.sub(r"\x1b\[[0-9;]*m", "", links) == piped
    assert ESCAPE not in piped


def test_json_is_never_styled() -> None:
    """A program may read a terminal, too."""
    seen, _, code = shown(*REACHMAP, "cells", "--json", on_terminal="stdout")
    assert code == 0
    assert ESCAPE not in seen


@pytest.mark.parametrize(("env", "coloured"), [({}, True), ({"NO_COLOR": "1"}, False)])
def test_mistakes_are_red(env: dict[str, str], coloured: bool) -> None:
    """The name of the program alone, where colours are wanted."""
    seen, _, code = shown(*REACHMAP, "check", "nowhere", env=env)
    assert code == 2
    assert bool(COLOUR.search(seen)) is coloured
    plain = re.sub(r"\x1b\[[0-9;]*m", "", seen)
    assert plain.startswith("reachmap: 'nowhere' is neither")
