"""A validation as tables for a terminal."""

from __future__ import annotations

from collections.abc import Sequence

from reachmap.cli.text.bin_map import reliability_lines
from reachmap.cli.text.tables import fact_lines, table_lines
from reachmap.text import plural, printable
from reachmap.validation.calibration import ReliabilityDiagram
from reachmap.validation.statistics import Confusion, Share
from reachmap.validation.summary import (
    GroupSummary,
    ListSummary,
    OrderFigures,
    Validation,
)

# A choice: names of files and conditions, in characters.
LABEL_WIDTH = 32
SHORT_ORDERS = {"supplied": "supplied", "re-ranked": "re-ranked", "ik-only": "IK only"}


def validation_text(validation: Validation) -> str:
    """Confusion, shares with intervals, correlation, planner calls, first grasps."""
    overall = validation.overall
    return "\n".join(
        [
            _headline(validation),
            "",
            *_confusion_lines(overall.confusion),
            "",
            "Predictions (Wilson 95 % intervals)",
            *_share_lines(overall),
            "",
            *_diagram_lines(validation.diagram),
            "",
            "Terms of J: share of an attempt's variance between grasps",
            *reliability_lines(validation.reliability),
            "",
            "By list",
            *_list_lines(validation.summaries),
            "",
            f"First {validation.top} of each order, as measured "
            "(means over those reached)",
            *_group_lines(validation.groups),
            _cheaper_line(validation),
            *_cycle_lines(validation),
        ]
    )


def _headline(validation: Validation) -> str:
    said = validation.settings
    grasps = plural(validation.overall.grasps, "grasp")
    over = said["attempts"] == "roadmap"
    how = "over a roadmap of their own" if over else f"with {said['planner']}"
    return (
        f"{said['map']} against planning: {grasps}, "
        f"{plural(int(said['repeats']), 'attempt')} each {how}, "
        f"{plural(int(said['rolls']), 'roll')} where free, seed {said['seed']}"
    )


def _confusion_lines(confusion: Confusion) -> list[str]:
    c = confusion
    rows = [["planning", "reached", "not reached"]]
    rows += [
        ["map: reachable", str(c.true_positive), str(c.false_positive)],
        ["map: unreachable", str(c.false_negative), str(c.true_negative)],
        ["outside the map", str(c.outside_reached), str(c.outside_missed)],
    ]
    return table_lines(rows, "<>>")


def _share_lines(summary: ListSummary) -> list[str]:
    c, r = summary.confusion, summary.correlation
    again = summary.repeatability
    return fact_lines(
        [
            ("precision", _share_text(c.precision)),
            ("recall", _share_text(c.recall)),
            ("false-positive rate", _share_text(c.false_positive_rate)),
            ("as recommended", _share_text(summary.recommended)),
            (
                "order of J",
                f"Spearman {_signed(r.spearman)}, Kendall {_signed(r.kendall)} over "
                f"{plural(r.count, 'grasp')}; two halves of the attempts: Spearman "
                f"{_signed(again.spearman)}",
            ),
        ]
    )


def _diagram_lines(diagram: ReliabilityDiagram) -> list[str]:
    head = (
        f"Probability of being reached: calibration error {_number(diagram.error, 3)} "
        f"over {plural(diagram.grasps, 'grasp')}, Brier score "
        f"{_number(diagram.brier, 3)}"
    )
    rows = [["predicted", "mean", "reached", "of", "%", "95 % interval"]]
    for one in diagram.bins:
        hit = one.reached
        rows.append(
            [
                f"{one.low:.1f} to {one.high:.1f}",
                f"{one.predicted:.3f}",
                str(hit.hits),
                str(hit.total),
                _percent(hit),
                f"{100 * hit.low:.1f} to {100 * hit.high:.1f}",
            ]
        )
    return [head, *table_lines(rows, "<>>>>>")]


def _share_text(share: Share) -> str:
    if share.total == 0:
        return "- (no such grasp)"
    low, high = 100 * share.low, 100 * share.high
    return (
        f"{100 * share.share:.2f} %  ({low:.2f} to {high:.2f}), "
        f"{share.hits} of {share.total}"
    )


def _list_lines(summaries: Sequence[ListSummary]) -> list[str]:
    rows = [["", "grasps", "outside", "precision %", "recall %", "Spearman", "Kendall"]]
    for one in summaries:
        c, r = one.confusion, one.correlation
        rows.append(
            [
                printable(one.label, LABEL_WIDTH),
                str(one.grasps),
                str(c.outside_reached + c.outside_missed),
                _percent(c.precision),
                _percent(c.recall),
                _signed(r.spearman),
                _signed(r.kendall),
            ]
        )
    return table_lines(rows, "<>>>>>>")


def _group_lines(groups: Sequence[GroupSummary]) -> list[str]:
    rows = [["", "order", "reached", "J", "path [rad]", "planning [ms]",
             "execution [s]", "calls to 1", "to all"]]  # fmt: skip
    for group in groups:
        label = printable(group.label, LABEL_WIDTH)
        for name, figures in group.orders.items():
            rows.append([label, SHORT_ORDERS[name], *_figures_row(figures)])
            label = ""
    return table_lines(rows, "<<>>>>>>>")


def _figures_row(figures: OrderFigures) -> list[str]:
    return [
        f"{figures.reached}/{figures.considered}",
        _number(figures.cost, 3),
        _number(figures.path_length, 2),
        _number(1000 * figures.planning_time, 1),
        _number(figures.execution_time, 2),
        _number(figures.calls_first, 2),
        _number(figures.calls_top, 2),
    ]


def _cycle_lines(validation: Validation) -> list[str]:
    """Re-planned whole cycles beside those of the map."""
    if not validation.cycles:
        return []
    overall = validation.cycles[-1]
    c, r = overall.confusion, overall.correlation
    rows = [["", "order", "whole", "cycle [s]", "per part [s]"]]
    for one in validation.cycles:
        label = printable(one.label, LABEL_WIDTH)
        for name, first in one.orders.items():
            share = f"{first.whole}/{first.considered}"
            seconds = (first.seconds, first.seconds_per_part)
            rows.append([label, name, share, *(_number(s, 2) for s in seconds)])
            label = ""
    return [
        "",
        "Whole cycles re-planned with the part",
        *fact_lines(
            [
                ("precision", _share_text(c.precision)),
                ("recall", _share_text(c.recall)),
                (
                    "order of seconds",
                    f"Spearman {_signed(r.spearman)}, Kendall {_signed(r.kendall)} "
                    f"over {plural(r.count, 'grasp')}",
                ),
            ]
        ),
        f"First {validation.top} of each order: mean measured time of whole cycles; "
        "per part including the cost of failures",
        *table_lines(rows, "<<>>>"),
    ]


def _cheaper_line(validation: Validation) -> str:
    cheaper = sum(group.cheaper for group in validation.groups)
    return (
        f"  re-ranked is cheaper than supplied in {cheaper} of "
        f"{plural(len(validation.groups), 'group')}"
    )


def _percent(share: Share) -> str:
    return _number(100 * share.share, 2)


def _number(value: float, digits: int) -> str:
    return "-" if value != value else f"{value:.{digits}f}"


def _signed(value: float) -> str:
    return "-" if value != value else f"{value:+.2f}"
