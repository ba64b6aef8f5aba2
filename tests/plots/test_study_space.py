"""Pictures of a whole study: the front against brute force, and all are drawn."""

from __future__ import annotations

import itertools

import numpy as np

from reachmap.plots.albums import study_album
from reachmap.plots.study_space import pareto_front
from tests.studies.test_significance_of_studies import study_of


def test_the_front_is_what_nothing_dominates():
    """Pair by pair, in loops, with ties among the values."""
    values = np.random.default_rng(1).integers(0, 6, (40, 2)).astype(float)
    known = np.arange(40) % 7 != 0
    expected = known.copy()
    for a, b in itertools.permutations(np.flatnonzero(known), 2):
        if (values[b] >= values[a]).all() and (values[b] != values[a]).any():
            expected[a] = False
    assert np.array_equal(pareto_front(values, known), expected)


def test_a_study_of_one_parameter_has_its_effects_alone():
    """Nothing is drawn that needs a second parameter or objective."""
    rng = np.random.default_rng(0)
    made = study_of([rng.random((14, 20, 27)) < share for share in (0.5, 0.6)])
    assert [item.name for item in study_album(made)] == ["effects_bin_reachability"]
