"""``reachmap carriers``: the load carriers that a cell can name."""

from __future__ import annotations

import dataclasses
from typing import Any

from reachmap.cell.bins.carriers import carriers


def list_carriers() -> tuple[dict[str, Any], ...]:
    """All carriers, each with its dimensions [mm], source and what was derived."""
    return tuple(dataclasses.asdict(carrier) for carrier in carriers())
