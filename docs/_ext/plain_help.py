"""Help texts are plain text: keep sphinx-click from reading them as markup.

The example at the end of each help becomes a code block.
"""

from __future__ import annotations

import re
from typing import Any

FOR_ALL = ("-v, --verbose", "-q, --quiet", "--debug")


def escaped(line: str) -> str:
    """A line with the characters escaped that reStructuredText would interpret."""
    bar = "| " if line.startswith("| ") else ""
    return bar + re.sub(r"([*`|\\]|_(?=\W|$))", r"\\\1", line[len(bar) :])


def process(app: Any, ctx: Any, lines: list[str]) -> None:
    """Escape a description; turn its example into a code block."""
    for start, line in enumerate(lines):
        match = re.match(r"(?:\| )?Examples?:\s*(.*)", line)
        if match:
            rest = [
                match[1],
                *(re.sub(r"^\| ?", "", part) for part in lines[start + 1 :]),
            ]
            code = [f"   {part.strip()}" for part in rest if part.strip()]
            block = ["", ".. code-block:: console", "", *code, ""]
            lines[:] = [*map(escaped, lines[:start]), *block]
            return
    lines[:] = map(escaped, lines)


def process_options(app: Any, ctx: Any, lines: list[str]) -> None:
    """Escape the help of each option; leave out those that every command has."""
    blocks: list[list[str]] = []
    for line in lines:
        if line.startswith(".. option::"):
            blocks.append([])
        indented = line.startswith("   ") and not line.lstrip().startswith((":", "**"))
        blocks[-1].append(escaped(line) if indented else line)
    if ctx.parent is not None:
        blocks = [block for block in blocks if not block[0].endswith(FOR_ALL)]
    lines[:] = [line for block in blocks for line in block]


def setup(app: Any) -> dict[str, bool]:
    """Connect to the events of sphinx-click."""
    app.connect("sphinx-click-process-description", process)
    app.connect("sphinx-click-process-epilog", process)
    app.connect("sphinx-click-process-options", process_options)
    return {"parallel_read_safe": True}
