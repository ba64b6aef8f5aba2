"""The section on settings and provenance: enough to reproduce everything."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from reachmap.maps.bytes.to_json import flat_json
from reachmap.maps.format.registry import Artefact, Result, kind_of
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
from reachmap.text import number

QUOTE = '"'


def origin_section(run: RunFolder) -> Section:
    """Show how every artefact was made."""
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


def _facts(record: Artefact | Result) -> Table | None:
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
            ("settings", _settings(kept.settings)),
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


def _settings(settings: Mapping[str, Any]) -> str:
    """Settings as ``key.key = value``; of a list, how many entries it has."""
    said = []
    for key, text in flat_json(settings):
        value = json.loads(text)
        many = isinstance(value, list)
        said.append(f"{key}: {len(value)}" if many else f"{key} = {text.strip(QUOTE)}")
    return ", ".join(said)
