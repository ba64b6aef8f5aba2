"""Files appear whole or not at all, and nothing that stood there is harmed."""

import contextlib
import errno
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from reachmap.errors import EngineError, OutputError
from reachmap.maps import (
    check_output,
    publish,
    read_placement,
    write_bin_map,
    write_placement,
)
from tests.support.synthetic_maps import synthetic_bin_map, synthetic_placement


def names(folder: Path) -> list[str]:
    """What a folder holds."""
    return sorted(item.name for item in folder.iterdir())


def test_an_existing_file_is_refused_and_kept(tmp_path: Path) -> None:
    """Without overwrite the old bytes stay, and the message names the remedy."""
    path = tmp_path / "p.h5"
    path.write_bytes(b"mine")
    with pytest.raises(OutputError, match=r"p\.h5: exists already; --overwrite"):
        write_placement(path, synthetic_placement())
    assert path.read_bytes() == b"mine"
    assert names(tmp_path) == ["p.h5"]


def test_overwrite_replaces_it(tmp_path: Path) -> None:
    """With overwrite the new file takes the place of the old."""
    path = tmp_path / "p.h5"
    path.write_bytes(b"mine")
    write_placement(path, synthetic_placement(), overwrite=True)
    assert read_placement(path).chosen == 0
    assert names(tmp_path) == ["p.h5"]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("missing/p.h5", "the folder .*missing does not exist"),
        ("folder", "is a folder; name a file"),
        ("file/p.h5", "cannot be written|does not exist"),
        ("x" * 300, "too long; the limit is 231 bytes"),
    ],
)
def test_impossible_places_are_refused(tmp_path: Path, name: str, message: str) -> None:
    """A missing folder, a folder itself, a file as a folder, a name too long."""
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match=message):
        write_placement(tmp_path / name, synthetic_placement())


def test_a_read_only_folder_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No permission is said as such (asked of the system, as root may write)."""
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(OutputError, match="no permission in"):
        check_output(tmp_path / "p.h5")


@pytest.mark.parametrize("failing", ["write", "fsync", "replace"])
def test_a_full_disk_leaves_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: str
) -> None:
    """Whichever step fails, the old file stays and no temporary file does."""
    path = tmp_path / "p.h5"
    path.write_bytes(b"old")

    def full(*_: object) -> Any:
        raise OSError(errno.ENOSPC, "No space left on device")

    def chunks() -> list[bytes]:
        return [b"new"]

    if failing == "fsync":
        monkeypatch.setattr(os, "fsync", full)
    elif failing == "replace":
        monkeypatch.setattr(Path, "replace", full)
    data = (full() for _ in chunks()) if failing == "write" else chunks()
    with pytest.raises(OutputError, match="No space left on device"):
        publish(path, data, overwrite=True)
    assert path.read_bytes() == b"old"
    assert names(tmp_path) == ["p.h5"]


def test_a_file_size_limit_is_a_clean_error(tmp_path: Path) -> None:
    """The system's own limit, reached while writing for real."""
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, hard))
    try:
        with pytest.raises(OutputError, match="File too large"):
            write_bin_map(tmp_path / "b.h5", synthetic_bin_map())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert names(tmp_path) == []


def test_a_link_is_followed(tmp_path: Path) -> None:
    """A symbolic link keeps pointing; the file behind it is replaced."""
    target, link = tmp_path / "real.h5", tmp_path / "link.h5"
    target.write_bytes(b"old")
    link.symlink_to(target)
    publish(link, [b"new"], overwrite=True)
    assert link.is_symlink()
    assert target.read_bytes() == b"new"


def test_a_record_that_breaks_the_format_is_not_written(tmp_path: Path) -> None:
    """The producer's mistake is named; no file appears."""
    record = synthetic_placement(score=synthetic_placement().score + 50)
    with pytest.raises(EngineError, match=r"p\.h5: not written, score goes above 100"):
        write_placement(tmp_path / "p.h5", record)
    assert names(tmp_path) == []


def test_a_file_that_appears_meanwhile_is_kept(tmp_path: Path) -> None:
    """Whoever came first has the name, also when the place was free at the check."""
    path = tmp_path / "o.h5"

    def chunks() -> Iterator[bytes]:
        yield b"mine"
        path.write_bytes(b"precious")

    with pytest.raises(OutputError, match=r"o\.h5: exists already"):
        publish(path, chunks())
    assert path.read_bytes() == b"precious"
    assert names(tmp_path) == ["o.h5"]


def test_without_links_a_file_is_renamed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On file systems that have none; a file that is there is kept all the same."""

    def link(*_: object) -> None:
        raise PermissionError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(os, "link", link)
    publish(tmp_path / "o.h5", [b"mine"])
    with pytest.raises(OutputError, match="exists already"):
        publish(tmp_path / "o.h5", [b"other"])
    assert (tmp_path / "o.h5").read_bytes() == b"mine"


KILLED = """
import os, pathlib, signal, sys
from reachmap.maps.bytes import publish

def kill(*_):
    os.kill(os.getpid(), signal.SIGKILL)

if sys.argv[2] == "fsync":
    os.fsync = kill
elif sys.argv[2] == "unlink":
    pathlib.Path.unlink = kill
else:
    os.link = kill
publish.publish(pathlib.Path(sys.argv[1]), [b"new" * 1000])
"""


@pytest.mark.parametrize("step", ["fsync", "link", "unlink"])
def test_what_a_killed_run_left_is_taken_over(tmp_path: Path, step: str) -> None:
    """At most one file stays, however many runs are killed; the next removes it."""
    path = tmp_path / "o.h5"
    for _ in range(3):
        done = subprocess.run([sys.executable, "-c", KILLED, path, step], check=False)
        assert done.returncode in (-signal.SIGKILL, 1)
        assert len(set(names(tmp_path)) - {"o.h5"}) == 1
    published = path.read_bytes() if path.exists() else None
    assert published in (None, b"new" * 1000)
    publish(path, [b"again"], overwrite=True)
    assert names(tmp_path) == ["o.h5"]
    assert path.read_bytes() == b"again"


def test_two_writers_of_one_file_are_kept_apart(tmp_path: Path) -> None:
    """The second is refused; the first does not notice."""
    path = tmp_path / "o.h5"

    def chunks() -> Iterator[bytes]:
        with pytest.raises(OutputError, match="being written by another run"):
            publish(path, [b"second"], overwrite=True)
        yield b"first"

    publish(path, chunks())
    assert path.read_bytes() == b"first"
    assert names(tmp_path) == ["o.h5"]


def test_kills_at_any_moment_leave_the_old_file_or_the_new(tmp_path: Path) -> None:
    """Whole either way, and beside it one temporary file at most."""
    path = tmp_path / "o.h5"
    contents = [bytes([letter]) * 300_000 for letter in b"ab"]
    publish(path, contents[:1])
    rng = random.Random(1)
    for _ in range(60):
        child = os.fork()
        if child == 0:
            with contextlib.suppress(BaseException):
                while True:
                    for content in contents:
                        publish(path, [content], overwrite=True)
            os._exit(1)
        time.sleep(rng.uniform(0.0, 0.03))
        os.kill(child, signal.SIGKILL)
        _, status = os.waitpid(child, 0)
        assert os.WTERMSIG(status) == signal.SIGKILL
        assert path.read_bytes() in contents
        assert set(names(tmp_path)) <= {"o.h5", "o.h5.tmp"}
    publish(path, [b"end"], overwrite=True)
    assert names(tmp_path) == ["o.h5"]
