"""The summary of an artefact as people read it."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping

import numpy as np

from reachmap.cli.text.base import base_lines
from reachmap.cli.text.bin_map import bin_lines
from reachmap.cli.text.evidence import (
    PAIRS_SHOWN,
    cause_lines,
    evidence_text,
    verdict_text,
)
from reachmap.cli.text.robustness import robustness_lines
from reachmap.cli.text.study import study_lines
from reachmap.cli.text.tables import WIDTH, fact_lines, table_lines
from reachmap.maps.bytes.to_json import flat_json
from reachmap.maps.format.candidates import is_turn
from reachmap.maps.robustness.summary import RobustnessSummary
from reachmap.maps.summary.base import BaseSummary
from reachmap.maps.summary.bin import BinSummary
from reachmap.maps.summary.placement import CandidateSummary, PlacementSummary
from reachmap.maps.summary.statistics import (
    ik_approximation,
)
from reachmap.maps.summary.study import StudySummary
from reachmap.maps.summary.workspace import LevelSummary, WorkspaceSummary
from reachmap.plots.parts.levels import level_names
from reachmap.text import percent_text, plural
from reachmap.tools.info import ArtefactInfo


def info_text(info: ArtefactInfo) -> str:
    """Headline, tables, causes, and where it comes from."""
    summary = info.summary
    if isinstance(summary, WorkspaceSummary):
        body = _workspace_lines(summary)
    elif isinstance(summary, BinSummary):
        body = bin_lines(summary)
    elif isinstance(summary, StudySummary):
        body = study_lines(summary)
    elif isinstance(summary, RobustnessSummary):
        body = robustness_lines(summary)
    elif isinstance(summary, BaseSummary):
        body = base_lines(summary)
    else:
        body = _placement_lines(summary)
    lines = [_headline(info), *_approximation_lines(info), *body, "", "Made from"]
    return "\n".join([*lines, *_origin_lines(info)])


def _headline(info: ArtefactInfo) -> str:
    kind = info.kind.replace("_", " ")
    stamp = info.record.stamp
    if not info.finished:
        return f"{info.path}: journal of a {kind} that is not finished"
    return (
        f"{info.path}: {kind}, format {stamp.format_version}, "
        f"content {stamp.content_sha256[:12]}"
    )


def _approximation_lines(info: ArtefactInfo) -> list[str]:
    """Caveat on "no IK solution" where that is not a proof."""
    text = ik_approximation(info.record.provenance.settings)
    if not text:
        return []
    said = f'inverse kinematics is approximate ({text}), so that "no IK solution" '
    return textwrap.wrap(f"{said}means that none was found this way", WIDTH)


def _workspace_lines(summary: WorkspaceSummary) -> list[str]:
    best = summary.best_level
    head = ["", "z [m]", "path %", "free IK %", "IK %", "path", "free IK", "IK",
            "frames", "at 100 %"]  # fmt: skip
    heights = level_names(np.array([level.z for level in summary.levels]))
    rows = [
        _level_row(level, height, "best" if index == best else "")
        for index, (level, height) in enumerate(
            zip(summary.levels, heights, strict=True)
        )
    ]
    squares = sum(level.squares for level in summary.levels)
    return [
        f"{summary.frames} test frames, {squares} squares on "
        f"{plural(len(summary.levels), 'level')}, method {summary.method}",
        "",
        "Levels: mean over the squares, frames counted, squares at 100 % path",
        *table_lines([head, *reversed(rows)], "<>>>>>>>>>"),
        "",
        "Frames",
        *cause_lines(summary.causes),
        "",
        "Evidence",
        *fact_lines(
            [
                ("reached", evidence_text(summary.reached)),
                ("not reached", verdict_text(summary.unreached)),
            ]
        ),
    ]


def _level_row(level: LevelSummary, height: str, mark: str) -> list[str]:
    shares = (level.path_percent, level.ik_free_percent, level.ik_percent)
    counts = (level.path, level.ik_free, level.ik, level.frames, level.full_squares)
    return [
        mark,
        height,
        *("-" if share != share else f"{share:.2f}" for share in shares),
        *(str(count) for count in counts),
    ]


def _placement_lines(summary: PlacementSummary) -> list[str]:
    rows = [["", "x [m]", "y [m]", "z [m]", "yaw [deg]", "score %", "worst point %",
             "reachable %"]]  # fmt: skip
    named = (
        ("chosen", summary.chosen),
        ("runner-up", summary.runner_up),
        ("paper's choice", summary.paper_choice),
    )
    rows += [_candidate_row(name, item) for name, item in named if item is not None]
    margin = ", ".join(
        f"{name} {value:.3g} {'deg' if is_turn(name) else 'm'}"
        for name, value in summary.margin.items()
    )
    scan = ", ".join(
        f"{name} {value:.1f}" for name, value in summary.scan_configuration_deg.items()
    )
    lines = [
        f"rule {summary.rule}, {plural(summary.candidates, 'candidate')}, "
        f"{summary.exact} of them with the bin in the scene",
        "",
        *table_lines(rows, "<>>>>>>>"),
        "",
        *fact_lines(
            [
                ("margin to -5 points", margin),
                *_tolerance_facts(summary),
                ("scan pose [deg]", scan),
            ]
        ),
    ]
    if summary.excluded:
        excluded = [(str(n), reason) for reason, n in summary.excluded.items()]
        lines += ["", "Excluded candidates"]
        lines += table_lines(excluded[:PAIRS_SHOWN], "><")
    return lines


def _tolerance_facts(summary: PlacementSummary) -> list[tuple[str, str]]:
    """Worst case of the chosen pose within the tolerance, and its support."""
    facts = []
    if summary.tolerance_shift_m is not None and summary.worst_score is not None:
        shift, turn = 1e3 * summary.tolerance_shift_m, summary.tolerance_turn_deg
        off = f"{shift:.3g} mm and {turn:.3g} deg off"
        facts.append(("worst score", f"{percent_text(summary.worst_score)} %, {off}"))
    if summary.score_error is not None:
        facts.append(("error of the score", f"{summary.score_error:.2g} points"))
    if summary.support is not None:
        facts.append(("stands on", summary.support or "nothing"))
    return facts


def _candidate_row(name: str, item: CandidateSummary) -> list[str]:
    return [
        name,
        *(f"{value:+.3f}" for value in (item.x, item.y, item.z)),
        f"{item.yaw_deg:+.1f}",
        *(
            percent_text(value)
            for value in (item.score, item.worst_point, item.reachable_share)
        ),
    ]


def _origin_lines(info: ArtefactInfo) -> list[str]:
    stamp, provenance = info.record.stamp, info.record.provenance
    run = info.record.run
    settings = (f"{key}={text}" for key, text in flat_json(provenance.settings))
    facts = [
        ("cell", f"{info.cell_name or '?'}, contents {stamp.cell_sha256[:12]}"),
        ("bin", info.bin_name),
        ("overrides", ", ".join(provenance.overrides)),
        ("seed", str(stamp.seed)),
        ("source", provenance.source_sha256[:12]),
        ("settings", ", ".join(settings)),
        ("packages", ", ".join(f"{k} {v}" for k, v in provenance.packages.items())),
    ]
    if run.started:
        facts += [
            ("run", f"{run.started} to {run.finished} on {run.host}"),
            ("command", run.command_line),
            ("workers", str(run.workers)),
            ("wall [s]", _seconds(run.wall_s)),
            ("CPU [s]", _seconds(run.cpu_s)),
        ]
    return fact_lines([(name, text) for name, text in facts if text])


def _seconds(phases: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {value:.1f}" for name, value in phases.items())
