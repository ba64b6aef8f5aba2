"""Answers on stdout: text for people, or one JSON value for programs."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import click

from reachmap.cli.terminal import show


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
        show(said.rstrip("\n"))
