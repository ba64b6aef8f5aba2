"""Evidence behind the verdict "no path found", in both maps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reachmap._typing import CodeArray, IntArray
from reachmap.maps.parts import Components, confidence_of
from reachmap.maps.records import Status


@dataclass(frozen=True, slots=True, kw_only=True)
class EvidenceSummary:
    """Evidence behind the verdicts of a set of frames.

    Attributes
    ----------
    frames : int
    components : int
        Components of the roadmap that they lie in; 0 where frames were planned to one
        by one.
    attempts : int
        Planning attempts, each component's counted once.
    checks : int or None
        State checks spent on these components; None in maps of version 1.0.
    method_checks : mapping of str to int
        The same by method, without methods that were not needed.
    agreed : int
        Frames whose verdict an independent method confirmed.
    confidence : float or None
        Least of the components, see :func:`reachmap.maps.parts.confidence_of`;
        None without components.
    """

    frames: int
    components: int
    attempts: int
    checks: int | None
    method_checks: dict[str, int]
    agreed: int
    confidence: float | None


def evidence_of(
    frames: Sequence[tuple[CodeArray, IntArray, CodeArray]],
    status: Status,
    components: Components | None,
) -> EvidenceSummary:
    """Summarise the evidence behind all frames of one status.

    Parameters
    ----------
    frames : sequence of (array, array, array)
        Status, component and planning attempts of test frames, all of one shape.
    status : Status
    components : Components or None
        Of the map, if it has them.
    """
    chosen = [codes == status for codes, _, _ in frames]
    component = np.concatenate(
        [own[rows] for (_, own, _), rows in zip(frames, chosen, strict=True)]
    ).astype(np.int64)
    attempts = np.concatenate(
        [tried[rows] for (_, _, tried), rows in zip(frames, chosen, strict=True)]
    ).astype(np.int64)
    alone = component < 0
    labels, place = np.unique(component[~alone], return_inverse=True)
    if components is None:
        return EvidenceSummary(
            frames=len(component),
            components=len(labels),
            attempts=int(attempts[alone].sum()) + _least(attempts[~alone], place),
            checks=None,
            method_checks={},
            agreed=0,
            confidence=None,
        )
    by_method = components.method_checks[labels].sum(axis=0).tolist()
    sure = confidence_of(components.checks, components.reached)[labels]
    named = zip(components.methods, by_method, strict=True)
    return EvidenceSummary(
        frames=len(component),
        components=len(labels),
        attempts=int(attempts[alone].sum() + components.attempts[labels].sum()),
        checks=int(components.checks[labels].sum()),
        method_checks={name: int(count) for name, count in named if count},
        agreed=int((components.agreed[component[~alone]] == 1).sum()),
        confidence=float(sure.min()) if len(sure) else None,
    )


def _least(attempts: IntArray, place: IntArray) -> int:
    """Attempts at components, from those that their frames count.

    A frame counts the attempts of every component that one of its goals lies in, so
    the least count among the frames of a component is closest to its own.
    """
    least = np.full(int(place.max(initial=-1)) + 1, np.iinfo(np.int64).max)
    np.minimum.at(least, place, attempts)
    return int(least.sum())
