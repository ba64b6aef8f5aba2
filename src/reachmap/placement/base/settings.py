"""Settings of the search for a robot placement, as stored in artefacts."""

from __future__ import annotations

from typing import Any

from reachmap.placement.base import lattice, problem, search
from reachmap.placement.settings import placement_settings


def base_settings() -> dict[str, Any]:
    """Everything that a place depends on besides the cell and the options."""
    return placement_settings() | {
        "base": {
            "sparse": list(problem.SPARSE),
            "different_place_m": problem.DIFFERENT_PLACE_M,
            "steps_in_reach": lattice.STEPS_IN_REACH,
            "least_step_m": lattice.LEAST_STEP_M,
            "heights_m": lattice.HEIGHTS_M,
            "asked_per_place": search.ASKED_PER_PLACE,
        }
    }
