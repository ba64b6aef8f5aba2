"""Pictures of a whole study: the front against brute force, and all are drawn."""

from __future__ import annotations

import itertools

import numpy as np

from reachmap.maps.study.format import read_study, write_study
from reachmap.plots.albums import study_album
from reachmap.plots.study import best_rows, draw_best_maps
from reachmap.plots.study_space import pareto_front
from reachmap.studies.assembly import squares_of
from reachmap.studies.outcomes import Outcomes
from tests.studies.test_significance_of_studies import outcomes, study_of
from tests.support.optional import present


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
    assert [item.name for item in study_album(made)] == [
        "effects_bin_reachability",
        "best_maps",
    ]


def test_the_best_maps_are_means_of_frames(tmp_path):
    """Base first, then by value; each square is the mean over what is at its point."""
    rng = np.random.default_rng(2)
    hits = [rng.random((14, 20, 27)) < share for share in (0.4, 0.3, 0.8, 0.6)]
    made = study_of(hits)
    assert best_rows(made) == [0, 2, 3, 1]
    squares = present(made.squares)
    for row, hit in enumerate(hits):
        # Points are listed y first in the synthetic frames.
        expected = 100.0 * hit.mean(axis=2).T
        assert np.allclose(squares.bin_square[row], expected)
    write_study(tmp_path / "study.h5", made)
    again = present(read_study(tmp_path / "study.h5").squares)
    assert np.array_equal(again.bin_square, squares.bin_square)
    figure = draw_best_maps(made)
    assert [len(axes.collections) > 0 for axes in figure.axes[:4]] == [True] * 4


def test_variants_with_other_test_points_have_no_maps():
    """What is not the same square is not drawn as if it was."""
    hits = [np.ones((14, 20, 27)), np.zeros((14, 20, 27))]
    parts = [outcomes(hit) for hit in hits]
    assert squares_of([Outcomes(**part) for part in parts]) is not None
    parts[1]["key"] = parts[1]["key"] + 1.0
    assert squares_of([Outcomes(**part) for part in parts]) is None
    assert present(squares_of([None, Outcomes(**parts[1])])).bin_square.shape[0] == 2
