"""Messages that a page quotes are those that the program prints."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "how-to" / "own-robot.md"
# Names, numbers and what is left out stand for whatever a message names; a colon joins
# a place and what is wrong there.
FILLED_IN = re.compile(
    r"…|;|: |'[^']*'|\d+(?:\.\d+)?%?|\+x"
    r"|\b(?:FOLDER|X|A|B|j|ur_typ|tool0|velocity|acceleration|floating)\b"
)


def quoted() -> list[str]:
    """First column of the page's table of messages."""
    table = PAGE.read_text().split("## Messages you may meet")[1].split("\n## ")[0]
    return re.findall(r"^\| `(.+?)` \|", table, re.MULTILINE)


@cache
def texts() -> tuple[str, ...]:
    """String literals of the sources, values in them as NUL."""
    found = []
    for path in [*(ROOT / "src").rglob("*.py"), *(ROOT / "cli").rglob("*.py")]:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.append(node.value)
            elif isinstance(node, ast.JoinedStr):
                parts = [
                    str(part.value) if isinstance(part, ast.Constant) else "\0"
                    for part in node.values
                ]
                found.append("".join(parts))
    return tuple(found)


def test_the_table_is_found() -> None:
    """Else the next test would hold nothing."""
    assert len(quoted()) > 20


@pytest.mark.parametrize("message", quoted())
def test_quoted_messages_are_printed(message: str) -> None:
    """Each piece between what is filled in is in the sources, word for word."""
    pieces = [piece.strip() for piece in FILLED_IN.split(message)]
    pieces = [piece for piece in pieces if len(piece) > 3]
    assert pieces
    for piece in pieces:
        assert any(piece in text for text in texts()), piece
