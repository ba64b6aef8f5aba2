"""Pictures of a run as HTML, each with its caption."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reachmap.maps.any_file import Artefact
from reachmap.plots.style import figure_bytes
from reachmap.report.markup import Html, picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
