"""The section on settings and provenance: enough to make everything again."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from reachmap.maps.format.registry import Artefact, kind_of
from reachmap.report.blocks import (
    Code,
    Heading,
    Section,
    Table,
    facts,
    group,
    paragraph,
    section,
)
from reachmap.report.folder import RunFolder
from reachmap.report.numbers import number


def origin_section(run: RunFolder) -> Section:
    """Say of every artefact how it was made."""
    parts = []
    for role, record in run.artefacts.items():
        parts += [Heading(run.files[role]), _facts(record)]
    return section(
        "provenance",
        "Settings and provenance",
        paragraph(
            "Each file keeps the cell, the robot description and all settings it was "
            "made with. Equal contents have equal hashes on every machine."
        ),
        group("small", parts),
    )


def _facts(record: Artefact) -> Table | None:
    stamp, kept, run = record.stamp, record.provenance, record.run
    return facts(
        [
            ("kind", f"{kind_of(record).replace('_', ' ')}, {stamp.format_version}"),
            ("content", Code(stamp.content_sha256 or "-")),
            ("cell", Code(stamp.cell_sha256)),
            ("made from", _code(kept.source_sha256)),
            ("overrides", ", ".join(kept.overrides)),
            ("seed", stamp.seed),
            ("command", _code(_command(run.command_line))),
            ("run", f"{run.started} to {run.finished}" if run.started else ""),
            ("workers", run.workers if run.started else ""),
            ("wall time", _seconds(run.wall_s)),
            ("CPU time", _seconds(run.cpu_s)),
            ("settings", ", ".join(flat_settings(kept.settings))),
            ("packages", ", ".join(f"{k} {v}" for k, v in kept.packages.items())),
        ]
    )


def _seconds(phases: Mapping[str, float]) -> str:
    return ", ".join(
        f"{name} {number(value, 1, 's')}" for name, value in phases.items()
    )


def _code(value: str) -> str:
    return Code(value) if value else ""


def _command(line: str) -> str:
    """Command without the folder that the program lies in."""
    program, _, rest = line.partition(" ")
    return f"{program.rsplit('/', 1)[-1]} {rest}".strip()


def flat_settings(value: Any, prefix: str = "") -> list[str]:
    """Nested settings as ``key.key = value``; of a list, how long it is.

    Examples
    --------
    >>> flat_settings({"planner": {"name": "RRT"}, "pairs": ["a | b", "c | d"]})
    ['planner.name = RRT', 'pairs: 2']
    """
    if isinstance(value, Mapping):
        return [
            text
            for key, item in value.items()
            for text in flat_settings(item, f"{prefix}.{key}" if prefix else str(key))
        ]
    if isinstance(value, list | tuple):
        return [f"{prefix}: {len(value)}"]
    words = {True: "yes", False: "no", None: "none"}
    said = words[value] if value is None or isinstance(value, bool) else value
    return [f"{prefix} = {said}"]
