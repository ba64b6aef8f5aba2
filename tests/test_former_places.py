"""Names that moved since 0.1 are found where they were, too."""

from __future__ import annotations

from importlib import import_module

import pytest

MOVED = {
    "core.solids.SolidCell": "core.collision.solids",
    "core.bodies.build_geometry": "core.collision.bodies",
    "core.timing.execution_time_s": "core.planning.timing",
    "tools.options.RunOptions": "runtime.options",
}


@pytest.mark.parametrize("name", MOVED)
def test_former_places_lead_to_the_same_names(name: str) -> None:
    """The very same object, not a copy."""
    module, _, attribute = name.rpartition(".")
    former = getattr(import_module(f"reachmap.{module}"), attribute)
    now = getattr(import_module(f"reachmap.{MOVED[name]}"), attribute)
    assert former is now
