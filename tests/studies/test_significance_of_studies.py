"""A parameter that does nothing is called null; one that is worth 2 points is found.

Frames are simulated, in the shape of a bin map and with what makes real ones hard: what
blocks a frame blocks its neighbours, and repeated planning flips whole clusters. They
go through the code that judges real variants.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from reachmap.maps.records import RunInfo
from reachmap.maps.study.record import Study
from reachmap.studies.assembly import assemble
from reachmap.studies.outcomes import Outcomes, compare_outcomes
from tests.support.synthetic_maps import synthetic_provenance, synthetic_stamp

SHAPE = (14, 20, 27)
SEEDS = 100
# Least number of seeds with the right answer that the issue asks for.
ENOUGH = 95
VARIANTS = 5
# Noise of planning: at so many points the frames have another outcome, each with this
# chance, because their component was reached or was not.
NOISY_POINTS, NOISY_FRAMES = 0.03, 0.5
POINTS = np.stack(
    np.meshgrid(*(np.arange(n) for n in SHAPE), indexing="ij"), axis=-1
).reshape(-1, 3)
# Place in the first three columns, turn in the others.
KEY = np.column_stack(
    [POINTS[:, :2] * 50.0, np.zeros(len(POINTS)), POINTS[:, 2:] * np.ones(9) * 50.0]
)


def smooth(rng, sigma=(2.0, 2.0, 0.5)):
    """A field whose neighbours are alike, of unit variance."""
    field = gaussian_filter(rng.normal(size=SHAPE), sigma, mode="nearest")
    return field / field.std()


def noisy(rng, hit):
    """The outcomes of another run that changes nothing."""
    points = rng.random(SHAPE[:2]) < NOISY_POINTS
    to = rng.random(SHAPE[:2]) < 0.5
    frames = points[..., None] & (rng.random(SHAPE) < NOISY_FRAMES)
    return np.where(frames, to[..., None], hit)


def outcomes(hit):
    """What a variant is judged by."""
    value = 100.0 * hit.mean()
    return dataclasses.asdict(
        Outcomes(
            value=value,
            low=value,
            high=value,
            key=KEY,
            result=hit.ravel().astype(float),
        )
    )


def study_of(hits) -> Study:
    """A study of variants with such outcomes, the first being the base."""
    payloads = [
        {"cause": "", "sha256": {}, "outcomes": {"bin_reachability": outcomes(hit)}}
        for hit in hits
    ]
    document: dict[str, Any] = {
        "rows": [
            {
                "values": [float(k)],
                "assignment": f"p={k}",
                "unit": k,
                "cell_sha256": f"{k:064x}",
                "cause": "",
            }
            for k in range(len(hits))
        ],
        "objectives": ["bin_reachability"],
        "base": 0,
        "requirements": [],
        "design": "grid",
        "bin_mode": "kept",
        "parameter_names": ["p"],
        "parameter_units": [""],
        "stamp": dataclasses.asdict(synthetic_stamp()),
        "provenance": dataclasses.asdict(synthetic_provenance()),
    }
    return assemble(document, payloads, run=RunInfo())


def test_a_parameter_that_does_nothing_is_called_null():
    """In at least 95 of 100 seeds none of its values is called significant."""
    null = 0
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        base = smooth(rng) > -0.5
        made = study_of([noisy(rng, base) for _ in range(VARIANTS)])
        null += not made.significant.any()
    assert null >= ENOUGH


@pytest.mark.parametrize("sign", [1, pytest.param(-1, marks=pytest.mark.slow)])
def test_an_effect_of_two_points_is_found(sign):
    """In at least 95 of 100 seeds the one value that is worth 2 points is named."""
    found = 0
    for seed in range(SEEDS):
        rng = np.random.default_rng(1000 + seed)
        field = smooth(rng)
        base = field > -0.5
        # Frames nearest to being reached, or to not being, are those that change.
        level = np.quantile(field, base.mean() * -1 + 1 - sign * 0.02)
        hits = [noisy(rng, base) for _ in range(VARIANTS)]
        hits[2] = noisy(rng, field > level)
        made = study_of(hits)
        found += bool(made.significant[2, 0]) and sign * made.change[2, 0] > 0
    assert found >= ENOUGH


def test_one_place_that_changes_is_no_proof():
    """All 27 frames of one point are one fact; a test of frames would be sure."""
    a = np.zeros(SHAPE)
    b = a.copy()
    b[3, 4] = 1.0
    parts = [Outcomes(**outcomes(hit)) for hit in (a, b)]
    change = compare_outcomes("bin_reachability", *parts)
    assert change.gained == 27
    assert change.p_value == pytest.approx(0.3173, abs=1e-3)
    assert change.change_low < 0.0 < change.change < change.change_high
