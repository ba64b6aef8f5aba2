"""Closed, full and foreign standard streams; folders that are gone; odd names."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

REACHMAP = [sys.executable, "-m", "reachmap"]


def run(
    folder: Path, command: str, *, env: dict[str, str] | None = None
) -> subprocess.CompletedProcess[bytes]:
    """Run a line of shell; ``reachmap`` in it is this environment's."""
    text = f'reachmap() {{ "{sys.executable}" -m reachmap "$@"; }}; {command}'
    return subprocess.run(
        ["bash", "-c", text],
        cwd=folder,
        env=os.environ | (env or {}),
        capture_output=True,
        timeout=120,
        check=False,
    )


@pytest.mark.parametrize(
    ("command", "code", "message"),
    [
        ("reachmap check planar-toy 2>&-", 0, b""),
        ("reachmap check planar-toy 2>/dev/full", 0, b""),
        ("reachmap cells >&-", 0, b""),
        ("reachmap cells >/dev/full", 2, b"standard output cannot be written (No sp"),
        ("reachmap --help >/dev/full", 2, b"standard output cannot be written (No sp"),
        ("reachmap cells <&- >&- 2>&-", 0, b""),
        ("reachmap --help | true; exit ${PIPESTATUS[0]}", 141, b""),
        ("reachmap cells | true; exit ${PIPESTATUS[0]}", 141, b""),
        ("mkdir gone; cd gone; rmdir ../gone; reachmap check planar-toy", 2,
         b"the current folder no longer exists"),
    ],
)  # fmt: skip
def test_streams_that_are_closed_or_full(
    tmp_path: Path, command: str, code: int, message: bytes
) -> None:
    """One line or none on stderr, and the exit code of the table."""
    done = run(tmp_path, command)
    assert done.returncode == code, done.stderr
    assert message in done.stderr
    assert done.stderr.count(b"\n") <= 1
    assert b"internal error" not in done.stderr


@pytest.mark.parametrize("encoding", ["latin-1", "cp437", "cp1252"])
def test_a_console_that_lacks_letters(tmp_path: Path, encoding: str) -> None:
    """What it cannot spell is escaped; the rest of the help is all there."""
    done = run(tmp_path, "reachmap rank --help", env={"PYTHONIOENCODING": encoding})
    assert done.returncode == 0, done.stderr
    shown = done.stdout.decode(encoding)
    assert "--weights" in shown
    assert "\\u03b4" in shown or "δ" in shown


def test_messages_do_not_land_in_the_next_file(tmp_path: Path) -> None:
    """With stderr closed, its number does not fall to a file that is opened later."""
    script = (
        "import os\n"
        "from reachmap.cli.streams import prepare_streams\n"
        "prepare_streams()\n"
        "with open('victim', 'wb') as victim:\n"
        "    assert victim.fileno() > 2\n"
        "    os.write(2, b'from the depths of a library')\n"
    )
    done = run(
        tmp_path, f"'{sys.executable}' -c \"$SCRIPT\" 2>&-", env={"SCRIPT": script}
    )
    assert done.returncode == 0
    assert (tmp_path / "victim").read_bytes() == b""


@pytest.mark.parametrize(
    "locale", ["C", pytest.param("C.UTF-8", marks=pytest.mark.slow)]
)
def test_a_name_that_is_not_utf_8_is_refused_at_once(
    tmp_path: Path, locale: str
) -> None:
    """Neither an output nor a cell nor a value of it may have such a name."""
    env = {"LC_ALL": locale, "PYTHONUTF8": "0"}
    for words in (
        "-o $(printf 'o\\xff.h5')",
        "--cell $(printf 'o\\xff.yaml')",
        "--set bin.pose.xyz=$(printf 'o\\xff')",
    ):
        done = run(tmp_path, f"reachmap bin-scan --cell planar-toy {words}", env=env)
        assert done.returncode == 2, done.stderr
        assert b"UTF-8" in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_names_that_are_not_utf_8_are_shown_or_refused(tmp_path: Path) -> None:
    """Maps may have them, in pictures, too; a starter cell could not name its robot."""
    done = run(
        tmp_path,
        "a=$(printf '\\xfe.h5'); cp $BIN $a && cp $BIN bin.h5 && "
        "reachmap compare $a bin.h5 --picture o.png",
        env={"BIN": str(_toy_map(tmp_path))},
    )
    assert done.returncode == 0, done.stderr
    assert rb"\xfe.h5" in done.stdout
    grasp = {"id": "\ud800", "position": [0, 0, 0.2], "direction": [0, 0, -1]}
    head = {"format": "reachmap.grasps", "format_version": "1.0", "frame": "bin"}
    (tmp_path / os.fsdecode(b"\xfe.json")).write_text(
        json.dumps(head | {"units": {"length": "m"}, "grasps": [grasp]})
    )
    rank = "rank $(printf '\\xfe.json') --map bin.h5 --chart c.png -o ranked.json"
    done = run(tmp_path, f"reachmap {rank} && reachmap report . -o r.html")
    assert done.returncode == 0, done.stderr
    assert "\\ud800" in (tmp_path / "r.html").read_text(encoding="utf-8")
    done = run(tmp_path, "reachmap new-cell $(printf '\\xfe.urdf')")
    assert done.returncode == 2
    assert rb"\xfe.urdf: the path is not UTF-8 text" in done.stderr


def test_a_name_beyond_ascii_is_written_in_any_locale(tmp_path: Path) -> None:
    """Even where Python itself reads names as ASCII, they are stored as UTF-8."""
    (tmp_path / "é").mkdir()
    done = run(
        tmp_path / "é",
        "reachmap cells --export $BIN -o ü.yaml && reachmap check ü.yaml >&2",
        env={"LC_ALL": "C", "PYTHONUTF8": "0", "BIN": str(_toy_map(tmp_path))},
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "é" / "ü.yaml").exists()


def _toy_map(folder: Path) -> Path:
    from reachmap.maps import write_bin_map
    from tests.support.toy_artefacts import toy_bin_map

    write_bin_map(folder / "toy.h5", toy_bin_map())
    return folder / "toy.h5"


@pytest.mark.parametrize(
    "env",
    [
        {"MPLBACKEND": "module://matplotlib_inline.backend_inline"},
        pytest.param({"HOME": "/nonexistent"}, marks=pytest.mark.slow),
        {"HOME": "/proc", "MPLCONFIGDIR": "/proc/none"},
    ],
)
def test_pictures_need_no_backend_and_no_home(
    tmp_path: Path, env: dict[str, str]
) -> None:
    """Notebooks name backends of their own; containers have no home."""
    _toy_map(tmp_path)
    (tmp_path / "tmp").mkdir()
    env = {**env, "TMPDIR": str(tmp_path / "tmp")}
    done = run(tmp_path, "reachmap heatmap toy.h5 -o out", env=env)
    assert done.returncode == 0, done.stderr
    assert b"Traceback" not in done.stderr
    assert list((tmp_path / "out").glob("*.png"))
    assert list((tmp_path / "tmp").iterdir()) == []
