"""Heaps after the last pick, from above: the parts that remain, and why."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from reachmap.maps.records import BinMap
from reachmap.picking.emptying import Emptied, Fate
from reachmap.picking.heap import Heap
from reachmap.plots.parts.bin_view import BinView, frame_bin, view_of
from reachmap.plots.parts.style import (
    MUTED,
    PALE,
    axes_at,
    drawing,
    new_figure,
    put_text,
    put_title,
    subtitle_of,
)
from reachmap.text import plural

# As many heaps as one looks at in a glance; the others are in the table.
MOST_HEAPS = 3
WIDTH_IN, GAP_IN, SIDE_IN, FOOT_IN, HEAD_IN = 3.2, 0.35, 0.35, 0.75, 1.15
KINDS = (
    (Fate.PICKED, "picked", "none", PALE),
    (Fate.COVERED, "below a part that remains", "#f4b183", "#9c5a1f"),
    (Fate.UNREACHABLE, "not reached", "#d1493f", "#7a1d16"),
)


@drawing()
def draw_emptied(
    bin_map: BinMap, heaps: Sequence[tuple[Heap, Emptied]], title: str
) -> Figure:
    """The first heaps side by side, lower parts below higher ones.

    Parameters
    ----------
    bin_map : BinMap
    heaps : sequence of (Heap, Emptied)
    title : str
    """
    view, shown = view_of(bin_map), heaps[:MOST_HEAPS]
    low, high = view.view()
    height = WIDTH_IN * float((high - low)[1] / (high - low)[0])
    width = 2 * SIDE_IN + len(shown) * (WIDTH_IN + GAP_IN) - GAP_IN
    figure = new_figure(max(width, 5.2), FOOT_IN + height + HEAD_IN)
    for k, (heap, emptied) in enumerate(shown):
        left = SIDE_IN + k * (WIDTH_IN + GAP_IN)
        axes = axes_at(figure, left, FOOT_IN, WIDTH_IN, height)
        _draw_heap(axes, view, heap, emptied)
        stay = int((emptied.fate != Fate.PICKED).sum())
        text = f"{stay} of {plural(len(heap), 'part')} remain"
        put_text(figure, left, FOOT_IN + height + 0.08, text, color=MUTED)
    figure.legend(
        handles=[
            Patch(facecolor=face, edgecolor=edge, label=words)
            for _, words, face, edge in KINDS
        ],
        loc="lower left",
        bbox_to_anchor=(SIDE_IN / figure.get_size_inches()[0], 0.02),
        ncols=len(KINDS),
    )
    more = f"the first {len(shown)} of {len(heaps)} heaps"
    of = "" if len(shown) == len(heaps) else more
    put_title(figure, SIDE_IN, title, subtitle_of((of, view.cell_name)))
    return figure


def _draw_heap(axes: Axes, view: BinView, heap: Heap, emptied: Emptied) -> None:
    order = np.argsort(heap.position[:, 2], kind="stable")
    for layer, (fate, _, face, edge) in enumerate(KINDS):
        rows = order[emptied.fate[order] == fate]
        axes.add_collection(
            PolyCollection(
                list(heap.outline[rows]),
                facecolors=face,
                edgecolors=edge,
                linewidths=0.5,
                zorder=1 + 0.1 * layer,
            )
        )
    frame_bin(axes, view)
    axes.set_axis_off()
