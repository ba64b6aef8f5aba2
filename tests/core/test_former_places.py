"""Names that moved since 0.1 are found where they were, too."""

from __future__ import annotations

from importlib import import_module

import pytest

MOVED = {
    "solids.SolidCell": "collision.solids",
    "bodies.build_geometry": "collision.bodies",
    "timing.execution_time_s": "planning.timing",
}


@pytest.mark.parametrize("name", MOVED)
def test_former_places_lead_to_the_same_names(name: str) -> None:
    """The very same object, not a copy."""
    module, _, attribute = name.partition(".")
    former = getattr(import_module(f"reachmap.core.{module}"), attribute)
    now = getattr(import_module(f"reachmap.core.{MOVED[name]}"), attribute)
    assert former is now
