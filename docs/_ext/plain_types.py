"""Types in numpydoc sections are words and shapes, not names to be linked.

Sphinx would look up every word of "array, shape (n, 3)"; as emphasised text the types
are left alone. Nor is |Δq| a substitution.
"""

from __future__ import annotations

import re
from typing import Any

FIELD = re.compile(r"^(\s*:(?:type|vartype) [^:]+:) (.+)$")


def process(
    app: Any, what: str, name: str, item: Any, options: Any, lines: list[str]
) -> None:
    """Emphasise the types that napoleon has written as fields."""
    for index, line in enumerate(lines):
        if match := FIELD.match(line):
            text = re.sub(r"([*`|\\])", r"\\\1", match[2].replace("``", ""))
            lines[index] = f"{match[1]} *{text}*"
        elif "``" not in line:
            lines[index] = line.replace("|", "\\|")


def setup(app: Any) -> dict[str, bool]:
    """Run after napoleon."""
    app.connect("autodoc-process-docstring", process, priority=900)
    return {"parallel_read_safe": True}
