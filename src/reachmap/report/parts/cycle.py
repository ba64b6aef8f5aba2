"""Duration of a pick by stage, and where cycles end early."""

from __future__ import annotations

from reachmap.maps.cycle.summary import CycleSummary, summarise_cycle
from reachmap.maps.records import BinMap
from reachmap.plots.bin_map import draw_cycle
from reachmap.plots.curves.timeline import draw_timeline
from reachmap.plots.parts.levels import level_names
from reachmap.report.blocks import Blocks, Heading, drawn, paragraph, table
from reachmap.text import count, number, percent

# A choice: as many as a reader takes in.
ENDS_SHOWN = 12


def cycle_blocks(record: BinMap) -> Blocks:
    """Blocks on the cycles of a bin map; None for a map without them."""
    cycle = summarise_cycle(record)
    if cycle is None:
        return None
    blocks: list[Blocks] = [
        Heading("Whole picks"),
        paragraph(_sentences(cycle)),
    ]
    for layer, name in enumerate(level_names(record.layer)):
        where = (
            f" in the layer {name} m above the bottom" if len(record.layer) > 1 else ""
        )
        blocks.append(
            drawn(
                draw_cycle(record, layer),
                f"Test grasps with a whole cycle, and its mean time{where}.",
                record,
            )
        )
    if cycle.whole:
        said = "Time of a pick by stage; lines span the middle 80 % of each stage."
        blocks.append(drawn(draw_timeline(record, cycle), said, record))
    if cycle.ends:
        rows = [
            (end.grasps, end.stage, end.status, end.pair.replace(" | ", " – "))
            for end in cycle.ends[:ENDS_SHOWN]
        ]
        head = ("test grasps", "stage", "outcome", "bodies in the way")
        blocks.append(table(head, rows, "><<<"))
    return blocks


def _sentences(cycle: CycleSummary) -> str:
    text = (
        f"Of {count(cycle.reached, 'reached test grasp')}, {cycle.whole} have a "
        f"whole cycle ({percent(cycle.reachability)} of all test grasps): "
        f"{cycle.sentence}."
    )
    if cycle.put_down:
        text += f" Whole cycles by where the part is put down: {cycle.put_down}."
    if cycle.lower:
        text += f" {cycle.lower_lifts}."
    made = cycle.throughput
    if made is None:
        return text
    return (
        f"{text} With planning effort and the risk of failure that makes "
        f"{number(made.picks_per_hour, 0)} picks per hour "
        f"(95 % interval {number(made.low, 0)} to {number(made.high, 0)})."
    )
