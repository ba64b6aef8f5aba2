"""HTML in small pieces. Every text that comes in is escaped; there is no way round."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from reachmap.maps.format.registry import Artefact
from reachmap.plots.parts.style import figure_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PNG_DPI = 200.0
# Pictures are shown a little larger than on paper.
ENLARGED = 1.12


class Html(str):
    """Text that is HTML already; made in this module only."""

    __slots__ = ()


def text(value: object) -> Html:
    """Escape a text; HTML of this module is passed through."""
    return value if isinstance(value, Html) else Html(html.escape(str(value)))


def element(name: str, *content: object, **attributes: str) -> Html:
    """An element; a trailing underscore of an attribute's name is dropped."""
    said = "".join(
        f' {key.rstrip("_")}="{html.escape(value)}"'
        for key, value in attributes.items()
        if value
    )
    return Html(f"<{name}{said}>{''.join(map(text, content))}</{name}>")


def joined(parts: Iterable[object], between: str = "\n") -> Html:
    """Pieces one after another."""
    return Html(html.escape(between).join(text(part) for part in parts))


def section(anchor: str, title: str, *content: object) -> Html:
    """A section with a heading that the list of contents leads to."""
    return element(
        "section", element("h2", title), Html("\n"), joined(content), id=anchor
    )


def paragraph(*content: object, kind: str = "") -> Html:
    """A paragraph; ``kind`` is its class."""
    return element("p", *content, class_=kind)


def table(
    head: Sequence[object],
    rows: Iterable[Sequence[object]],
    align: str,
    *,
    kind: str = "",
) -> Html:
    """Lay out a table.

    Parameters
    ----------
    head : sequence
        Column titles; none for a table without a head.
    rows : iterable of sequence
    align : str
        ``<`` or ``>`` for each column; numbers are set in figures of one width.
    kind : str
    """

    def cells(row: Sequence[object], name: str) -> Html:
        return joined(
            (
                element(name, cell, class_="n" if side == ">" else "")
                for cell, side in zip(row, align, strict=True)
            ),
            "",
        )

    top = element("thead", element("tr", cells(head, "th"))) if head else Html("")
    body = element(
        "tbody", joined((element("tr", cells(row, "td")) for row in rows), "\n")
    )
    return element("div", element("table", top, body, class_=kind), class_="wide")


def facts(pairs: Iterable[tuple[object, object]]) -> Html:
    """Names and what is said of them; those without anything to say are left out."""
    rows = [(element("b", name), said) for name, said in pairs if str(said)]
    return table((), rows, "<<", kind="facts") if rows else Html("")


def picture(png: bytes, caption: str) -> Html:
    """A picture inside the page, in the size it was drawn for."""
    width = int.from_bytes(png[16:20], "big") * 96.0 / PNG_DPI * ENLARGED
    data = base64.b64encode(png).decode("ascii")
    image = Html(
        f'<img src="data:image/png;base64,{data}" width="{width:.0f}" '
        f'alt="{html.escape(caption)}">'
    )
    return element("figure", image, element("figcaption", caption))


def bullets(items: Iterable[object]) -> Html:
    """A list."""
    return element("ul", joined((element("li", item) for item in items), ""))


def drawn(figure: Figure, caption: str, record: Artefact) -> Html:
    """Render a figure into the page.

    Parameters
    ----------
    figure : Figure
    caption : str
    record : WorkspaceMap, BinMap or BinPlacement
        What it shows; its hash is kept in the picture.
    """
    png = figure_bytes(
        figure, "png", title=caption, config_sha256=record.stamp.config_sha256
    )
    return picture(png, caption)
