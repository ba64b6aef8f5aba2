"""The cycles of a bin map as people read them."""

from __future__ import annotations

import numpy as np

from reachmap.cli.text.tables import fact_lines, table_lines
from reachmap.maps.cycle.seconds import Throughput
from reachmap.maps.cycle.summary import CycleSummary
from reachmap.text import percent_text, plural

# A choice: the answer fits on a screen.
ENDS_SHOWN = 8


def cycle_lines(cycle: CycleSummary | None) -> list[str]:
    """What a pick takes, stage by stage, and where cycles end early."""
    if cycle is None:
        return []
    lines = [
        "",
        f"Whole cycles: {cycle.whole} of {plural(cycle.reached, 'reached grasp')} "
        f"({percent_text(cycle.reachability)} % of the test grasps); {cycle.sentence}",
    ]
    rows = [
        [part.name, f"{part.seconds:.2f} s", f"{100 * part.share:.0f} %"]
        for part in cycle.parts
    ]
    if rows:
        rows.append(["cycle", f"{cycle.seconds:.2f} s", ""])
    lines += table_lines(rows, "<>>")
    if cycle.throughput is not None:
        lines += fact_lines(
            [
                ("least to most", f"{cycle.least:.2f} to {cycle.most:.2f} s"),
                ("throughput", throughput_text(cycle.throughput)),
                *([("put down at", cycle.put_down)] if cycle.put_down else []),
                *([("lifts", cycle.lower_lifts)] if cycle.lower else []),
            ]
        )
    if cycle.ends:
        ends = [
            [str(end.grasps), f"{end.stage}: {end.status}", end.pair]
            for end in cycle.ends[:ENDS_SHOWN]
        ]
        lines += ["Where cycles end early", *table_lines(ends, "><<")]
    return lines


def throughput_text(made: Throughput) -> str:
    """Picks per hour with their interval, as ``412 picks per hour (395 to 430)``."""
    text = f"{made.picks_per_hour:.0f} picks per hour"
    if np.isfinite(made.low):
        text += f" ({made.low:.0f} to {made.high:.0f})"
    return text
