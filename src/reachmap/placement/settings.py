"""How placements are searched for, as stored in artefacts."""

from __future__ import annotations

from typing import Any

import numpy as np

from reachmap.placement import margins, scan_choice, search, steadying, tolerance
from reachmap.placement.mapped import exact, imaging, sample, viewpoints
from reachmap.placement.predicted import places, prediction


def placement_settings() -> dict[str, Any]:
    """Everything that a placement depends on besides the cell, the map and options."""
    return {
        "samples": {
            "predicted": list(prediction.POINTS),
            "thin": list(sample.THIN),
            "coarse": list(sample.COARSE),
            "dense": list(sample.DENSE),
            "quick": list(sample.QUICK),
        },
        "max_layers": sample.MAX_LAYERS,
        "most_rolls": sample.MOST_ROLLS,
        "share_of_checks": exact.SHARE_OF_CHECKS,
        "steps_per_square": places.STEPS_PER_SQUARE,
        "yaw_step_deg": places.YAW_STEP_DEG,
        "natural_poses": ["as the cell is", "middle of supports"],
        "most_unseen": search.MOST_UNSEEN,
        "near_unseen_m": search.NEAR_UNSEEN_M,
        "turns_deg": list(search.TURNS_DEG),
        "places_improved": search.PLACES_IMPROVED,
        "refine_steps": np.round(search.FIRST_STEPS, 9).tolist(),
        "refine_rounds": search.ROUNDS,
        "refine_halvings": search.HALVINGS,
        "refine_min_gain_points": search.MIN_GAIN_POINTS,
        "steadying": {
            "tried": steadying.TRIED,
            "below_points": steadying.BELOW_POINTS,
            "moves": steadying.MOVES,
            "nudge": [steadying.NUDGE_POINTS, steadying.NUDGES],
            "noise_points": tolerance.NOISE_POINTS,
            "suspects": tolerance.SUSPECTS,
            "least_error": steadying.LEAST_ERROR,
            "room": tolerance.ROOM,
        },
        "margin_points": margins.DROP_POINTS,
        "margin_shifts_m": list(margins.SHIFTS_M),
        "margin_turns_rad": np.round(margins.TURNS_RAD, 9).tolist(),
        "views": {
            "distances": viewpoints.DISTANCES,
            "tilts_deg": list(viewpoints.TILTS_DEG),
            "azimuths": viewpoints.AZIMUTHS,
            "roll_step_deg": viewpoints.ROLL_STEP_DEG,
            "offsets": list(viewpoints.OFFSETS),
            "border": viewpoints.BORDER,
            "finalists": scan_choice.FINALISTS,
            "apart_rad": imaging.APART_RAD,
            "parking_turns_deg": list(imaging.PARKING_TURNS_DEG),
            "parking_samples": imaging.PARKING_SAMPLES,
            "most_hidden": imaging.MOST_HIDDEN,
            "equal_points": scan_choice.EQUAL_POINTS,
        },
    }
