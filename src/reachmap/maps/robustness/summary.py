"""Summary of robustness."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from reachmap.maps.robustness.record import Certificate, Robustness

SOURCES = ("bin", "camera", "tool")


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorStep:
    """Reachability at one multiple of the errors.

    Attributes
    ----------
    scale : float
    certified : float
        Test grasps that are proved to stay reachable [percent].
    reachability, lowest, highest : float
        Test grasps whose path stays free: mean, least and most over the perturbed
        cells [percent].
    always : float
        Those whose path stays free in all of them [percent].
    """

    scale: float
    certified: float
    reachability: float
    lowest: float
    highest: float
    always: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RobustnessSummary:
    """Summary of robustness.

    Attributes
    ----------
    errors : mapping of str to (float, float)
        Shift [mm] and turn [deg] of what is off.
    margin_m : float
    grasps, reached : int
        Test grasps, and those with a path.
    samples : int
        Perturbed cells at each multiple.
    steps : tuple of ErrorStep
        Rising multiples, from none.
    by_clearance, by_pairs : int
        Test grasps certified at the errors themselves: by the clearance that the map
        holds, and by that of the bodies that errors move.
    closest : tuple of (str, int)
        Bodies that come closest, with the number of test grasps that are not
        certified for them.
    """

    errors: dict[str, tuple[float, float]]
    margin_m: float
    grasps: int
    reached: int
    samples: int
    steps: tuple[ErrorStep, ...]
    by_clearance: int
    by_pairs: int
    closest: tuple[tuple[str, int], ...]

    @property
    def given(self) -> ErrorStep:
        """The step at the given errors."""
        return next(step for step in self.steps if step.scale == 1.0)


def errors_text(errors: Mapping[str, tuple[float, float]]) -> str:
    """Sizes of errors in words, as in "bin 5 mm and 1 deg, tool 2 mm"."""
    words = []
    for name, (shift_mm, turn_deg) in errors.items():
        shift = [f"{shift_mm:.3g} mm"] if shift_mm else []
        turn = [f"{turn_deg:.3g} deg"] if turn_deg else []
        words.append(f"{name} {' and '.join([*shift, *turn])}")
    return ", ".join(words)


def summarise_robustness(record: Robustness) -> RobustnessSummary:
    """Summarise the effect of errors."""
    given = record.certificate[record.scale.tolist().index(1.0)]
    samples = record.reachability.shape[1]
    reached = record.reached == 1
    open_pair = record.closest_pair[reached & (given == Certificate.NONE)]
    counts = np.bincount(open_pair[open_pair >= 0], minlength=len(record.body_pairs))
    order = np.argsort(-counts, kind="stable")
    return RobustnessSummary(
        errors={
            name: (1000.0 * float(shift), float(np.degrees(turn)))
            for name, (shift, turn) in zip(SOURCES, record.sizes, strict=True)
            if shift or turn
        },
        margin_m=record.margin_m,
        grasps=int(reached.size),
        reached=int(reached.sum()),
        samples=samples,
        steps=tuple(
            ErrorStep(
                scale=float(scale),
                certified=float(record.certified[k]),
                reachability=float(record.reachability[k].mean()),
                lowest=float(record.reachability[k].min()),
                highest=float(record.reachability[k].max()),
                always=100.0 * float((record.kept[k] == samples).mean()),
            )
            for k, scale in enumerate(record.scale)
        ),
        by_clearance=int((given == Certificate.STORED_CLEARANCE).sum()),
        by_pairs=int((given == Certificate.DISPLACED_PAIRS).sum()),
        closest=tuple(
            (record.body_pairs[k], int(counts[k])) for k in order if counts[k]
        ),
    )
