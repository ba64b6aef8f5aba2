"""The summary of an artefact as people read it."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence

import numpy as np

from reachmap.cli.text.study import study_lines
from reachmap.cli.text.tables import fact_lines, table_lines
from reachmap.maps.bytes.to_json import flat_json
from reachmap.maps.format.placement import is_turn
from reachmap.maps.records import Status
from reachmap.maps.summary.bin import MEASURES, BinSummary, Spread
from reachmap.maps.summary.clearance import ClearanceShare
from reachmap.maps.summary.directions import ReachedShares
from reachmap.maps.summary.emptying import Emptying
from reachmap.maps.summary.evidence import EvidenceSummary
from reachmap.maps.summary.placement import CandidateSummary, PlacementSummary
from reachmap.maps.summary.reliability import Reliability
from reachmap.maps.summary.statistics import (
    STATUS_NAMES,
    Causes,
    Saturation,
    ik_approximation,
)
from reachmap.maps.summary.study import StudySummary
from reachmap.maps.summary.workspace import LevelSummary, WorkspaceSummary
from reachmap.plots.parts.levels import level_names
from reachmap.text import count_text, percent_text, plural
from reachmap.tools.info import ArtefactInfo

PAIRS_SHOWN = 5
LINE = 88


def info_text(info: ArtefactInfo) -> str:
    """Headline, tables, causes, and where it comes from."""
    summary = info.summary
    if isinstance(summary, WorkspaceSummary):
        body = _workspace_lines(summary)
    elif isinstance(summary, BinSummary):
        body = _bin_lines(summary)
    elif isinstance(summary, StudySummary):
        body = study_lines(summary)
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
    """What "no IK solution" rests on, where that proves nothing."""
    text = ik_approximation(info.record.provenance.settings)
    if not text:
        return []
    said = f'inverse kinematics is approximate ({text}), so that "no IK solution" '
    return textwrap.wrap(f"{said}means that none was found this way", LINE)


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
        *_cause_lines(summary.causes),
        "",
        "Evidence",
        *fact_lines(
            [
                ("reached", _evidence_text(summary.reached)),
                ("not reached", _verdict_text(summary.unreached)),
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


def _evidence_text(evidence: EvidenceSummary) -> str:
    where = f" in {plural(evidence.components, 'component')}"
    return (
        f"{plural(evidence.frames, 'frame')}"
        f"{where if evidence.components else ''}, "
        f"{plural(evidence.attempts, 'attempt')}"
        f"{_checks_text(evidence)}"
    )


def _checks_text(evidence: EvidenceSummary) -> str:
    """State checks, by method."""
    if evidence.checks is None:
        return ""
    methods = ", ".join(f"{n} {count:,}" for n, count in evidence.method_checks.items())
    return f", {evidence.checks:,} state checks" + (f" ({methods})" if methods else "")


def _verdict_text(evidence: EvidenceSummary) -> str:
    """Evidence of frames without a path, and how often another method agreed."""
    text = _evidence_text(evidence)
    if evidence.checks is None or not evidence.frames:
        return text
    agreed = f"{evidence.agreed} of {plural(evidence.frames, 'frame')}"
    return f"{text}; an independent method agrees on {agreed}"


def _cause_lines(causes: Causes) -> list[str]:
    """States with counts; the leading pairs of bodies below those they explain."""
    rows = []
    for status, count in causes.states.items():
        tried = 0 if status == Status.NOT_ATTEMPTED else causes.total
        rows.append((STATUS_NAMES[status], count_text(count, tried)))
    lines = fact_lines(rows)
    if causes.pairs:
        shown = [(str(n), pair) for pair, n in causes.pairs[:PAIRS_SHOWN]]
        rest = len(causes.pairs) - len(shown)
        lines += ["", "Bodies in the way", *table_lines(shown, "><")]
        lines += [f"  and {plural(rest, 'more pair')}"] if rest else []
    return lines


def _bin_lines(summary: BinSummary) -> list[str]:
    s = summary.saturation
    rows = [["attempts", "reached", "of", "%", "95 % interval"]]
    first = 0 if summary.independent else len(s.attempts) - 1
    rows += [
        [str(k), str(n), str(s.total), f"{share:.2f}", f"{low:.2f} to {high:.2f}"]
        for k, n, share, low, high in zip(
            *(v[first:] for v in (s.attempts, s.hits, s.share, s.low, s.high)),
            strict=True,
        )
    ]
    return [
        f"{plural(summary.grasps, 'test grasp')}, "
        f"{plural(summary.repeats, 'attempt')} each, "
        f"{plural(summary.layers, 'layer')}, {plural(summary.paths, 'stored path')}",
        "",
        "Path reachability",
        *share_lines(summary.shares),
        *_clearance_lines(summary.clearances),
        *_emptying_lines(summary.emptying),
        "",
        "Reached after n attempts (Wilson interval)",
        *table_lines(rows, ">>>>>"),
        *_beyond_lines(summary),
        "",
        "Test grasps",
        *_cause_lines(summary.causes),
        *_unreached_lines(summary.unreached),
        "",
        "Attempts that found a path",
        *_measure_lines(summary.measures),
        "",
        "What J is made of: share of the variance that is the grasp and not luck",
        *reliability_lines(summary.reliability),
        "",
        "Quadrants of the bin (N is +y, E is +x)",
        *_quadrant_lines(summary),
    ]


def share_lines(shares: ReachedShares) -> list[str]:
    """Reachability of frames, of directions and of points, with what each means."""
    rows = (
        ("frames", shares.frames, "test grasps with a path, as in the paper"),
        ("directions", shares.directions, "with a path for at least one roll"),
        ("points", shares.points, "with at least one such direction"),
    )
    return table_lines(
        [[name, f"{percent_text(share)} %", said] for name, share, said in rows], "<><"
    )


def _clearance_lines(shares: Sequence[ClearanceShare]) -> list[str]:
    """What is left of the headline where paths must keep a distance."""
    if not shares:
        return []
    rows = [
        [f"{1000.0 * share.clearance_m:.0f} mm", f"{percent_text(share.frames)} %"]
        for share in shares
    ]
    return [
        "",
        "Test grasps whose path keeps a clearance of",
        *table_lines(rows, ">>"),
    ]


def _emptying_lines(emptying: Emptying | None) -> list[str]:
    """Reachability by height, from the top down as a bin is emptied."""
    if emptying is None:
        return []
    rows = [["height [mm]", "fill %", "points %", "directions %", "frames %"]]
    with_cycle = emptying.levels[0].cycle is not None
    if with_cycle:
        rows[0].append("cycle %")
    for level in reversed(emptying.levels):
        values = [level.points, level.directions, level.frames]
        if level.cycle is not None:
            values.append(level.cycle)
        rows.append(
            [
                f"{1000.0 * level.height_m:.0f}",
                f"{100.0 * level.fill:.0f}",
                *(percent_text(value) for value in values),
            ]
        )
    below = "" if emptying.filled else " (parts below a layer are no obstacle)"
    return [
        "",
        f"Emptying: {emptying.sentence}{below}",
        *table_lines(rows, ">" * len(rows[0])),
    ]


def _unreached_lines(evidence: EvidenceSummary | None) -> list[str]:
    if evidence is None or not evidence.frames:
        return []
    return ["", "Evidence", *fact_lines([("no path", _verdict_text(evidence))])]


def reliability_lines(reliability: Mapping[str, Reliability]) -> list[str]:
    """Share of each measure, with a warning where most of it is luck."""
    rows = []
    for name, found in reliability.items():
        if found.share != found.share:
            said = "not known: no test grasp was reached twice, or all are alike"
        else:
            noise = "; mostly luck: it says little of a grasp" if found.is_noise else ""
            said = f"{found.share:.2f} over {plural(found.repeated, 'grasp')}{noise}"
        rows.append((MEASURES[name].words, said))
    return fact_lines(rows)


def _beyond_lines(summary: BinSummary) -> list[str]:
    lines = []
    s = summary.saturation
    if s.missed:
        lines.append(
            f"  {plural(s.missed, 'test grasp')} proved connected but missed by every "
            f"attempt; with them {s.proved:.2f} %"
        )
    if summary.time_limit_hits:
        hits = plural(summary.time_limit_hits, "attempt")
        lines.append(f"  the limit on wall-clock time ended {hits}")
    return lines


def _measure_lines(measures: Mapping[str, Spread]) -> list[str]:
    rows = [["", "unit", "mean", "± spread", "least", "median", "most"]]
    for name, measure in measures.items():
        shown = MEASURES[name]
        spread = shown.of(measure)
        values = (spread.mean, spread.std, spread.low, spread.median, spread.high)
        rows.append([shown.words, shown.unit, *(_number(value) for value in values)])
    return table_lines(rows, "<<>>>>>")


def _quadrant_lines(summary: BinSummary) -> list[str]:
    last = f"after {summary.repeats} %"
    rows = [["", "grasps", "after 1 %", last, "path [rad]", "planning [ms]",
             "execution [s]"]]  # fmt: skip
    for quadrant in summary.quadrants:
        s: Saturation = quadrant.saturation
        spreads = (
            MEASURES[name].of(quadrant.measures[name])
            for name in ("path_length", "planning_cpu_time", "execution_time")
        )
        rows.append(
            [
                quadrant.name,
                str(s.total),
                percent_text(s.share[0]),
                percent_text(s.share[-1]),
                *(f"{_number(a.mean)} ± {_number(a.std)}" for a in spreads),
            ]
        )
    return table_lines(rows, "<>>>>>>")


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
    """What the chosen pose keeps when the bin is off, and what it stands on."""
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


def _number(value: float) -> str:
    return "-" if value != value else f"{value:.3g}"
