"""Seeds of single attempts, so that no result depends on who computed it when."""

from __future__ import annotations

import numpy as np


def attempt_seed(seed: int, *key: int) -> int:
    """Seed of one attempt.

    Parameters
    ----------
    seed : int
        Of the scan.
    *key : int
        What tells the attempt from all others: frame, repeat.

    Returns
    -------
    int
        From 0 to 2³² − 1.
    """
    sequence = np.random.SeedSequence(seed, spawn_key=key)
    return int(sequence.generate_state(1)[0])
