"""Building blocks of a report: headings, paragraphs, tables, figures.

Sections build these records; the templates beside this module turn them into a page,
and escape every text on the way.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from reachmap.maps.format.registry import Artefact, Result
from reachmap.plots.parts.style import DPI, figure_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

# A choice: pictures are shown a little larger than on paper.
ENLARGED = 1.12


class Strong(str):
    """Text to be set in bold."""

    __slots__ = ()


class Code(str):
    """Text to be set as code."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class Heading:
    """A heading inside a section."""

    text: str


@dataclass(frozen=True, slots=True)
class Paragraph:
    """Texts one after another; ``kind`` is the class they are styled by."""

    texts: tuple[object, ...]
    kind: str = ""


@dataclass(frozen=True, slots=True)
class Table:
    """Rows in columns; ``align`` has ``<`` or ``>`` for each, as in a format."""

    head: tuple[object, ...]
    rows: tuple[tuple[object, ...], ...]
    align: str
    kind: str = ""


@dataclass(frozen=True, slots=True)
class Picture:
    """A PNG inside the page, in the size it was drawn for."""

    png: bytes
    caption: str

    @property
    def width_px(self) -> int:
        """Width on the page [CSS px]."""
        return round(int.from_bytes(self.png[16:20], "big") * 96.0 / DPI * ENLARGED)


@dataclass(frozen=True, slots=True)
class Bullets:
    """A list; each item is one text or several."""

    items: tuple[tuple[object, ...], ...]


@dataclass(frozen=True, slots=True)
class Tile:
    """A question of a cell designer and its answer."""

    question: str
    reply: str
    why: tuple[str, ...]
    absent: bool = False


@dataclass(frozen=True, slots=True)
class Group:
    """Blocks that are laid out together, as their ``kind`` says."""

    kind: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True, slots=True)
class Section:
    """A part of the page that the list of contents leads to."""

    anchor: str
    title: str
    blocks: tuple[Block, ...]


Block: TypeAlias = Heading | Paragraph | Table | Picture | Bullets | Tile | Group
Blocks: TypeAlias = Block | Iterable["Blocks"] | None


def section(anchor: str, title: str, *blocks: Blocks) -> Section:
    """Make a section of blocks; None and empty lists leave no trace."""
    return Section(anchor, title, flat(blocks))


def group(kind: str, *blocks: Blocks) -> Group:
    """Lay blocks out together."""
    return Group(kind, flat(blocks))


def paragraph(*texts: object, kind: str = "") -> Paragraph:
    """Set texts one after another."""
    return Paragraph(texts, kind)


def table(
    head: Sequence[object],
    rows: Iterable[Sequence[object]],
    align: str,
    *,
    kind: str = "",
) -> Table:
    """Lay out a table; without a head if that is empty."""
    return Table(tuple(head), tuple(map(tuple, rows)), align, kind)


def facts(pairs: Iterable[tuple[str, object]]) -> Table | None:
    """Table of names and values, without empty ones."""
    rows = [(Strong(name), said) for name, said in pairs if str(said)]
    return table((), rows, "<<", kind="facts") if rows else None


def drawn(figure: Drawing, caption: str, record: Artefact | Result) -> Picture:
    """Render a figure into the page.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    caption : str
    record : WorkspaceMap, BinMap, BinPlacement or Study
        What it shows; its hash is kept in the picture.
    """
    png = figure_bytes(
        figure, "png", title=caption, config_sha256=record.stamp.config_sha256
    )
    return Picture(png, caption)


def flat(blocks: Blocks) -> tuple[Block, ...]:
    """Blocks of nested lists, one after another."""
    if blocks is None:
        return ()
    if isinstance(blocks, Block):
        return (blocks,)
    return tuple(block for inner in blocks for block in flat(inner))
