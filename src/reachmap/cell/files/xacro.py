"""Expanding xacro files, in a separate process that can be stopped.

A xacro file is a program: its ``${…}`` are Python expressions, and one such as
``${9**9**9}`` never ends. Expand only those you trust.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from reachmap.cell.files.resources import Resolver
from reachmap.errors import CellError, MissingExtraError

# Descriptions with hundreds of links take one or two seconds.
LIMIT_CPU_S = 20
# A choice, generous for a busy machine; and address space, most of it only reserved.
LIMIT_WALL_S = 300.0
LIMIT_BYTES = 4_000_000_000
PLACES = (
    "when instantiating",
    "instantiated from",
    "in file",
    "included from",
    "when processing",
)
HARMLESS = re.compile(r"redefining (global symbol|macro)|deprecated")


@dataclass(frozen=True, slots=True, kw_only=True)
class Expansion:
    """What a xacro file expands to.

    Attributes
    ----------
    text : str
        The URDF or SRDF.
    arguments : tuple of str
        Names of the arguments that the file, or what it includes, declares or uses.
    packages : dict
        Packages that ``$(find NAME)`` found, to their folders.
    warnings : tuple of str
        What xacro complained about.
    """

    text: str
    arguments: tuple[str, ...]
    packages: dict[str, str]
    warnings: tuple[str, ...]


def expand_xacro(
    path: Path, arguments: Mapping[str, str], resolver: Resolver
) -> Expansion:
    """Expand a xacro file.

    ``$(find NAME)`` looks where ``package://NAME`` does; other names are relative to
    the file they stand in, whatever the current folder.

    Raises
    ------
    MissingExtraError
        xacro is not installed.
    CellError
        The file does not expand, or not within the limits above.
    """
    if find_spec("xacro") is None:
        raise MissingExtraError(
            f"{path}: xacro files need the extra [xacro]; "
            "install it with: pip install 'reachmap-cells[xacro]'"
        )
    request = {
        "path": str(path),
        "arguments": dict(arguments),
        "directory": str(resolver.directory.absolute()),
        "packages": dict(resolver.packages),
        "cpu_s": LIMIT_CPU_S,
        "bytes": LIMIT_BYTES,
    }
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-m", "reachmap.cell.files.xacro_process"],
            input=json.dumps(request),
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            timeout=LIMIT_WALL_S,
            check=False,
        )
        answer = json.loads(done.stdout) if done.stdout else {}
    except (subprocess.TimeoutExpired, ValueError):
        answer = {}
    if "text" not in answer:
        raise CellError(f"{path}: xacro cannot be expanded: {_reason(answer)}")
    return Expansion(
        text=answer["text"],
        arguments=tuple(answer["arguments"]),
        packages=answer["packages"],
        warnings=tuple(f"{path.name}: {line}" for line in _warnings(done.stderr)),
    )


def _reason(answer: Mapping[str, str]) -> str:
    """One line: what is wrong, and what to do about it."""
    missing = answer.get("missing")
    if missing:
        return (
            f"argument {missing!r} is not given; set {missing} in robot.xacro_args of "
            f"the cell (new-cell --xacro-arg {missing}=VALUE)"
        )
    return answer.get("error") or (
        f"it was stopped after {LIMIT_CPU_S} s of computing or "
        f"{LIMIT_BYTES / 1e9:g} GB; does one of its macros or includes recurse?"
    )


def _warnings(stderr: str) -> list[str]:
    """Warnings on what xacro ignored or did not find, without places and style."""
    plain = re.sub(r"\x1b\[[0-9;]*m", "", stderr)
    lines = dict.fromkeys(line.strip() for line in plain.splitlines())
    return [
        line
        for line in lines
        if line and not line.startswith(PLACES) and not HARMLESS.search(line)
    ][:20]
