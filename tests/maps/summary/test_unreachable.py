"""The most likely cause of a map without a reachable frame."""

import numpy as np
import pytest

from reachmap.maps import Status
from reachmap.maps.summary.statistics import most_likely_cause

PAIRS = ("housing | bin wall +x", "forearm_link | post")


def cause(counts, pairs=()):
    """The sentence for so many frames in each state."""
    status = np.repeat([int(s) for s in counts], list(counts.values())).astype(np.uint8)
    pair = np.full(len(status), -1)
    rows = np.flatnonzero(status == Status.IK_IN_COLLISION)
    pair[rows[: len(pairs)]] = pairs
    return most_likely_cause(status, pair, PAIRS)


def test_one_reachable_frame_is_not_nothing():
    """Also where nothing was attempted there is nothing to explain."""
    assert cause({Status.NO_IK: 99, Status.PATH_FOUND: 1}) == ""
    assert cause({Status.NOT_ATTEMPTED: 5}) == ""


@pytest.mark.parametrize(
    ("counts", "words"),
    [
        ({Status.NO_IK: 7, Status.NO_PATH_FOUND: 3}, "approach_axis"),
        ({Status.APPROACH_BLOCKED: 7, Status.NO_IK: 3}, "approach_distance_m"),
        ({Status.NO_PATH_FOUND: 7, Status.NO_IK: 3}, "scan configuration"),
    ],
)
def test_the_commonest_state_is_the_cause(counts, words):
    """With the counts of all states, the commonest first."""
    text = cause(counts)
    assert words in text.split("most likely cause")[1]
    assert "of 10 test frames" in text
    assert text.index(" 7") < text.index(" 3")


def test_the_pair_that_collides_most_is_named():
    """By the number of frames it blocks."""
    text = cause({Status.IK_IN_COLLISION: 6, Status.NO_IK: 2}, pairs=[0, 1, 1, 0, 1, 1])
    assert "in 4 of them forearm_link | post collide" in text
