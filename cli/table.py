"""The subcommands: name, module, section and one line of help each.

The table is what keeps ``reachmap --help`` quick: it is printed from here, and a
command's module is imported only when the command is used. A test holds every line
against the command's own help.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One subcommand.

    Attributes
    ----------
    section : str
        Heading it stands under in ``reachmap --help``.
    module : str
        Module that defines it as ``command``.
    help : str
        First sentence of its help.
    """

    section: str
    module: str
    help: str

    def is_available(self) -> bool:
        """Whether the module is installed."""
        return find_spec(self.module) is not None


def _section(name: str, commands: dict[str, str]) -> dict[str, Entry]:
    return {
        command: Entry(
            section=name,
            module=f"reachmap.cli.{command.replace('-', '_')}",
            help=help_line,
        )
        for command, help_line in commands.items()
    }


COMMANDS: dict[str, Entry] = {
    **_section(
        "Pipeline",
        {
            "workspace-scan": "Map what the arm reaches around its base.",
            "heatmap": "Draw a workspace map, one picture per level.",
            "place-bin": "Find where the bin should stand, and its scan configuration.",
            "bin-scan": "Plan to every test grasp inside the bin.",
            "rank": "Re-order grasp lists by cost, using the bin map alone.",
        },
    ),
    **_section(
        "Look",
        {
            "info": "Summarise an artefact or a journal.",
            "view": "Look at a cell or an artefact in 3D, in the browser.",
            "report": "Write a run as one self-contained page.",
            "compare": "Compare two maps of the same kind, frame by frame.",
            "validate": "Test a bin map against real planning to real grasps.",
        },
    ),
    **_section(
        "Cells",
        {
            "cells": "List the shipped cells, or export one.",
            "check": "Check a cell: joints, bodies, limits, scan configuration.",
            "new-cell": "Write a commented starter cell for a robot.",
            "schema": "Print the JSON Schema of cells or grasp lists.",
        },
    ),
    **_section(
        "Runs",
        {
            "verify": "Check a file for damage and against its contract.",
            "merge": "Join the journals of shards into one artefact.",
        },
    ),
}


def sections(commands: dict[str, Entry]) -> dict[str, list[tuple[str, str]]]:
    """Name and help of the available commands, by section, in table order."""
    grouped: dict[str, list[tuple[str, str]]] = {}
    for name, entry in commands.items():
        if entry.is_available():
            grouped.setdefault(entry.section, []).append((name, entry.help))
    return grouped
