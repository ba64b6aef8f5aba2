"""The section on failures: states of the test frames, and bodies in the way."""

from __future__ import annotations

from reachmap.maps.records import BinMap, WorkspaceMap
from reachmap.maps.summary.statistics import (
    STATUS_NAMES,
    Causes,
    causes_of,
    ik_approximation,
)
from reachmap.plots.causes import draw_causes
from reachmap.report.blocks import (
    Blocks,
    Heading,
    Section,
    Table,
    drawn,
    group,
    paragraph,
    section,
    table,
)
from reachmap.text import percent

# A choice: as many as a reader takes in.
PAIRS_SHOWN = 8


def cause_section(maps: dict[str, WorkspaceMap | BinMap]) -> Section:
    """Explain for each map why its test frames are not reached.

    Parameters
    ----------
    maps : mapping
        Heading to map.
    """
    parts: list[Blocks] = []
    for name, record in maps.items():
        causes = causes_of(record)
        parts += [
            Heading(name),
            paragraph(_sentences(causes)),
            drawn(draw_causes(record), f"{name}: states and causes.", record),
            group("pair", _states(causes), _pairs(causes)),
        ]
    return section(
        "causes",
        "Why poses are not reached",
        paragraph(
            f"{_no_solution(maps)} Where every solution "
            "collides, the two bodies named are in the way: a slimmer housing, a "
            "lower wall or another place would help. Where no path was found, the pose "
            "is free, but planning did not reach it with the effort stated below."
        ),
        parts,
    )


def _no_solution(maps: dict[str, WorkspaceMap | BinMap]) -> str:
    """What "no IK solution" means in these maps."""
    ways = [ik_approximation(record.provenance.settings) for record in maps.values()]
    way = next((text for text in ways if text), "")
    if not way:
        return "A pose with no IK solution is out of the arm's reach."
    return (
        "A pose with no IK solution is most likely out of the arm's reach; inverse "
        f"kinematics is approximate ({way}) and none was found this way."
    )


def _sentences(causes: Causes) -> str:
    if not causes.pairs:
        return "No pair of bodies blocks a pose."
    pair, blocked = causes.pairs[0]
    share = 100.0 * blocked / max(causes.total, 1)
    bodies = " against ".join(pair.split(" | "))
    return f"Most often in the way: {bodies} ({percent(share)} of the poses)."


def _states(causes: Causes) -> Table:
    rows = [
        (STATUS_NAMES[code], count, percent(100.0 * count / max(causes.total, 1)))
        for code, count in causes.states.items()
    ]
    return table(("state", "poses", "share"), rows, "<>>")


def _pairs(causes: Causes) -> Table | None:
    if not causes.pairs:
        return None
    rows = [(pair.replace(" | ", " – "), n) for pair, n in causes.pairs[:PAIRS_SHOWN]]
    return table(("bodies in contact", "poses"), rows, "<>")
