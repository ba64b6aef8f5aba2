"""The formats by kind, and what to call them in messages."""

from __future__ import annotations

from typing import Final

from reachmap.maps.bin_format import BIN
from reachmap.maps.placement_format import PLACEMENT
from reachmap.maps.schema import Layout
from reachmap.maps.workspace_format import WORKSPACE

LAYOUTS: Final[dict[str, Layout]] = {
    layout.kind: layout for layout in (WORKSPACE, BIN, PLACEMENT)
}
"""Kind to format."""


def layout_of(format_name: object) -> Layout | None:
    """Find the layout for a ``format`` attribute; None if it is not one of ours."""
    return next((item for item in LAYOUTS.values() if item.format == format_name), None)
