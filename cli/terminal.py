"""Answers on stdout: text for people, or one JSON value for programs.

On a terminal, text has headings, coloured verdicts and links, with the same characters.
In pipes and files, on a dumb terminal, and where rich is not installed, it is plain;
NO_COLOR removes the colours.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import click

from reachmap.text import is_terminal

HEADING: Final = re.compile(r"^\S.*(?=\n +\S)", re.MULTILINE)
GOOD: Final = re.compile(r"\b(path_found|path found|reachable|valid)\b")
BAD: Final = re.compile(
    r"\b(no_ik|ik_in_collision|no_path_found|no path found|unlike_map|outside_map"
    r"|invalid|unreachable|error)\b"
)
PLACE: Final = re.compile(r"https?://\S+|[^\s:,;'\"]*[/.][^\s:,;'\"]*")


def print_answer(facts: Any, text: Callable[[], str], *, as_json: bool) -> None:
    """Print an answer.

    Parameters
    ----------
    facts : value
        What ``--json`` prints as one line; what is not finite becomes null.
    text : callable
        Makes what people read instead; nothing is printed where it is empty.
    as_json : bool
    """
    if as_json:
        # Imported here: text needs no NumPy.
        from reachmap.maps.bytes.to_json import json_ready

        click.echo(json.dumps(json_ready(facts), allow_nan=False))
    elif said := text():
        _show(said.rstrip("\n"))


def facts_text(facts: Mapping[str, object]) -> str:
    """One line per fact: its name, with spaces, and its value in one column."""
    width = max(len(key) for key in facts)
    return "\n".join(
        f"{key.replace('_', ' '):{width}}  {value}" for key, value in facts.items()
    )


def _show(text: str) -> None:
    if not (is_terminal(sys.stdout) and _show_styled(text)):
        click.echo(text)


def _show_styled(text: str) -> bool:
    """Print with rich; return False where it is not installed."""
    try:
        # Imported here: pipes need none of it.
        from rich.console import Console
        from rich.style import Style
        from rich.text import Text
    except ModuleNotFoundError:
        return False
    shown = Text(text)
    shown.highlight_regex(HEADING, "bold")
    shown.highlight_regex(GOOD, "green")
    shown.highlight_regex(BAD, "red")
    for match in PLACE.finditer(text):
        if address := _address(match.group()):
            shown.stylize(Style(link=address), *match.span())
    # Not wrapped: the terminal does that, and copying then gets the original lines.
    Console(file=sys.stdout, highlight=False).print(shown, soft_wrap=True)
    return True


def _address(word: str) -> str:
    """Link target of a word: a web page, or a file that exists; else ""."""
    if word.startswith("http"):
        return word.rstrip(".,;)")
    try:
        path = Path(word)
        return path.absolute().as_uri() if path.is_file() else ""
    except (OSError, ValueError):
        return ""
