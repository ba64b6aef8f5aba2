"""The headline: answers to the questions of a cell designer, as far as possible."""

from __future__ import annotations

import numpy as np

from reachmap.maps.cycle.summary import summarise_cycle
from reachmap.maps.study.record import Study
from reachmap.maps.study.words import changes_text, no_best_text, sentence
from reachmap.maps.summary.bin import clearance_shares
from reachmap.maps.summary.directions import reached_shares
from reachmap.maps.summary.emptying import emptying_of
from reachmap.maps.summary.placement import summarise_placement
from reachmap.maps.summary.statistics import (
    are_independent,
    best_level,
    level_means,
    saturation_of,
)
from reachmap.report.blocks import Tile
from reachmap.report.folder import RunFolder
from reachmap.report.ranked_rows import cost_of_list, ranked_rows
from reachmap.text import count, interval, number, percent, signed

# A choice: as many as one line holds.
FIRST_PICKS = 3


def headline_answers(run: RunFolder) -> list[Tile]:
    """Tiles: level, bin, share of grasps, room, cycle, emptying, first picks, study."""
    if run.is_study_alone and run.study is not None:
        return [_study(run.study)]
    tiles = [
        _level(run),
        _bin(run),
        _share(run),
        _clearance(run),
        _cycle(run),
        _emptying(run),
        _picks(run),
        None if run.study is None else _study(run.study),
    ]
    return [tile for tile in tiles if tile is not None]


def _tile(question: str, reply: str, *why: str) -> Tile:
    return Tile(question, reply, why)


def _absent(question: str, why: str) -> Tile:
    return Tile(question, "not known yet", (why,), absent=True)


def _level(run: RunFolder) -> Tile:
    question = "Which height does the arm reach best?"
    if run.workspace is None:
        return _absent(question, "There is no workspace map in this folder.")
    reached = run.workspace.path_reachability
    best = best_level(reached)
    if best is None:
        return _absent(question, "No test frame of the workspace map was attempted.")
    mean = float(level_means(reached)[best])
    full = int((reached[best] == 100.0).sum())
    known = int((~np.isnan(reached[best])).sum())
    return _tile(
        question,
        f"z = {signed(float(run.workspace.z[best]), 2, 'm')}",
        f"{percent(mean)} of the tool orientations on average, "
        f"and all of them at {full} of {count(known, 'square')}.",
    )


def _bin(run: RunFolder) -> Tile:
    question = "Where does the bin go?"
    if run.placement is None:
        return _absent(question, "There is no placement in this folder.")
    summary = summarise_placement(run.placement)
    chosen, rival = summary.chosen, summary.runner_up
    place = ", ".join(
        f"{axis}\N{NO-BREAK SPACE}{signed(value, 3)}"
        for axis, value in zip("xyz", (chosen.x, chosen.y, chosen.z), strict=True)
    )
    lead = ""
    if rival is not None:
        lead = f"The runner-up reaches {percent(rival.score)}."
    # What the bin stands on holds its height.
    axes = "xy" if summary.support else "xyz"
    slack = [v for k, v in summary.margin.items() if k[1:] in axes]
    room = ""
    if slack:
        room = f"It may be {number(1000 * min(slack), 0)} mm off before "
        room += "that drops by 5 points."
    return _tile(
        question,
        place,
        f"Metres in {summary.frame}, turned by {number(chosen.yaw_deg, 0)}°. "
        f"{percent(chosen.score)} of the tool orientations in the pick volume. {lead}",
        room,
    )


def _share(run: RunFolder) -> Tile:
    question = "How much of the bin is really reached?"
    if run.bin_map is None:
        return _absent(question, "There is no bin map in this folder.")
    found = saturation_of(run.bin_map)
    attempts = len(found.attempts)
    shares = reached_shares(run.bin_map)
    return _tile(
        question,
        percent(float(found.share[-1])),
        f"{int(found.hits[-1])} of {count(found.total, 'test grasp')} after "
        f"{count(attempts, 'attempt')} each "
        f"(95 % interval {interval(float(found.low[-1]), float(found.high[-1]))}); "
        f"{percent(shares.directions)} of the directions with at least one roll, "
        f"{percent(shares.points)} of the points from at least one direction.",
        f"After one attempt: {percent(float(found.share[0]))}."
        if are_independent(run.bin_map)
        else "",
    )


def _clearance(run: RunFolder) -> Tile | None:
    """Reachability where paths must keep a clearance."""
    shares = () if run.bin_map is None else clearance_shares(run.bin_map)
    if not shares:
        return None
    steps = ", ".join(
        f"{percent(share.frames)} keep {number(1000 * share.clearance_m, 0, 'mm')}"
        for share in shares
    )
    middle = shares[len(shares) // 2]
    room = number(1000 * middle.clearance_m, 0, "mm")
    return _tile(
        "How accurately must the cell be built?",
        f"{percent(middle.frames)} with {room} to spare",
        f"By the smallest distance between any two bodies on the path: {steps}.",
    )


def _cycle(run: RunFolder) -> Tile | None:
    """Only where the bin was scanned with the part in hand."""
    found = None if run.bin_map is None else summarise_cycle(run.bin_map)
    if found is None:
        return None
    question = "How long does a pick take, with the part in hand?"
    whole = f"{percent(found.reachability)} of the test grasps have a whole cycle"
    made = found.throughput
    if made is None:
        return _tile(question, "no whole cycle", f"{whole}.")
    longest = max(found.parts, key=lambda part: part.seconds)
    return _tile(
        question,
        f"{number(found.seconds, 2, 's')}, "
        f"{number(made.picks_per_hour, 0)} picks per hour",
        f"{whole}; most of the time goes to the {longest.name} "
        f"({number(100 * longest.share, 0)} %).",
    )


def _emptying(run: RunFolder) -> Tile | None:
    """Only where the bin was scanned at several levels of filling."""
    found = None if run.bin_map is None else emptying_of(run.bin_map)
    if found is None or not found.filled:
        return None
    points = ", ".join(
        f"{percent(level.points)} at {number(1000 * level.height_m, 0, 'mm')}"
        for level in reversed(found.levels)
    )
    sentence = found.sentence
    return _tile(
        "Will it empty the bin, and what remains?",
        f"{number(found.left, 0 if found.left >= 1 else 1)} % remain",
        f"{sentence[0].upper()}{sentence[1:]}.",
        f"Points that can be picked by the height of the parts: {points}.",
    )


def _picks(run: RunFolder) -> Tile:
    question = "Which grasps come first?"
    if not run.ranked:
        return _absent(question, "There is no ranked grasp list in this folder.")
    rows = ranked_rows(run.ranked[0])
    reached = [row for row in rows if row.cost is not None]
    if not reached:
        return _tile(
            question, "none", f"None of {count(len(rows), 'grasp')} is reached."
        )
    first = reached[:FIRST_PICKS]
    by_seconds = cost_of_list(run.ranked[0]) == "cycle"
    cost = "Predicted seconds per pick:" if by_seconds else "With cost J ="
    return _tile(
        question,
        ", ".join(row.name for row in first),
        f"{cost} {', '.join(number(row.cost, 2) for row in first)}. "
        f"{len(reached)} of {count(len(rows), 'supplied grasp')} are reached.",
    )


def _study(study: Study) -> Tile:
    question = "Which change helps most?"
    name, best = study.objective_names[0], study.best
    if best < 0:
        why = no_best_text(int(study.done.sum()), study.requirements)
        return _tile(question, "none", f"{why[0].upper()}{why[1:]}.")
    if best == study.base:
        variants = count(int(study.done.sum()), "variant")
        why = f"None of {variants} has a better {name} than the base."
        return _tile(question, "leave it as it is", why)
    why = "No test grasp is shared with the base."
    if study.done[study.base]:
        why = f"{sentence(study, best, 0)}."
    return _tile(question, changes_text(study, best), why)
