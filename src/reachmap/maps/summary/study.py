"""Summary of a study: main effects, the change of each variant, the best one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray
from reachmap.maps.study.record import STATES, Study, VariantStatus
from reachmap.maps.study.words import estimate_text, sentence, value_texts


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A number with its 95 % interval; NaN where there is none."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class VariantSummary:
    """One variant, and how it compares with the base.

    Attributes
    ----------
    assignment : str
        What it sets.
    status, cause : str
    feasible : bool
    objectives : mapping of str to Estimate
    sentences : mapping of str to str
        Objective to what changed from the base to this one, in words.
    """

    variant: int
    assignment: str
    status: str
    cause: str
    feasible: bool
    objectives: dict[str, Estimate]
    sentences: dict[str, str]

    def estimates(self) -> list[str]:
        """Each objective with its interval, in words."""
        return [
            estimate_text(name, item.value, item.low, item.high)
            for name, item in self.objectives.items()
        ]


@dataclass(frozen=True, slots=True, kw_only=True)
class MainEffect:
    """Mean of an objective over the other parameters, per value of one parameter.

    Attributes
    ----------
    parameter, unit, objective : str
    values : array, shape (n,)
        Rising.
    labels : tuple of str
        The values in words.
    mean, low, high : array, shape (n,)
        Mean over the variants with that value, and what their intervals come to.
    """

    parameter: str
    unit: str
    objective: str
    values: FloatArray
    labels: tuple[str, ...]
    mean: FloatArray
    low: FloatArray
    high: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class StudySummary:
    """Summary of a study; ``base``, ``best`` and ``runner_up`` are variants or -1."""

    design: str
    bin_mode: str
    done: int
    failed: int
    left_out: int
    base: int
    best: int
    runner_up: int
    requirements: tuple[str, ...]
    variants: tuple[VariantSummary, ...]
    main_effects: tuple[MainEffect, ...]

    def sentences(self) -> list[str]:
        """All changes from the base: the best variant's, then those of one parameter.

        Those of more parameters follow; among equals, those of the first objective
        come first.
        """
        found = [
            (variant.variant != self.best, text.count(" → "), objective, text)
            for variant in self.variants
            for objective, text in enumerate(variant.sentences.values())
        ]
        return [text for *_, text in sorted(found, key=lambda item: item[:3])]

    def role(self, variant: VariantSummary) -> str:
        """What a variant is in the study: base, best, failed; "" for nothing."""
        roles = [
            word
            for word, row in (
                ("base", self.base),
                ("best", self.best),
                ("runner-up", self.runner_up),
            )
            if row == variant.variant
        ]
        if variant.status != "done":
            roles.append(variant.status.replace("_", " "))
        elif not variant.feasible:
            roles.append("below the requirements")
        return ", ".join(roles)


def summarise_study(study: Study) -> StudySummary:
    """Put effects, changes and the best variants of a study into numbers."""
    return StudySummary(
        design=study.design,
        bin_mode=study.bin_mode,
        done=int(study.done.sum()),
        failed=int((study.status == VariantStatus.FAILED).sum()),
        left_out=int((study.status == VariantStatus.LEFT_OUT).sum()),
        base=study.base,
        best=study.best,
        runner_up=study.runner_up,
        requirements=study.requirements,
        variants=tuple(_variant(study, k) for k in range(len(study.status))),
        main_effects=tuple(
            main_effect(study, parameter, objective)
            for objective in range(len(study.objective_names))
            for parameter in range(len(study.parameter_names))
        ),
    )


def _variant(study: Study, row: int) -> VariantSummary:
    names = study.objective_names
    return VariantSummary(
        variant=row,
        assignment=study.assignment[row],
        status=STATES[int(study.status[row])],
        cause=study.cause[row],
        feasible=bool(study.feasible[row]),
        objectives={
            name: Estimate(
                value=float(study.objective[row, k]),
                low=float(study.objective_low[row, k]),
                high=float(study.objective_high[row, k]),
            )
            for k, name in enumerate(names)
        },
        sentences={
            name: sentence(study, row, k)
            for k, name in enumerate(names)
            if row != study.base and study.done[row] and study.done[study.base]
        },
    )


def main_effect(study: Study, parameter: int, objective: int) -> MainEffect:
    """Mean of an objective for each value of a parameter, over the variants with it.

    The interval is that of the mean of independent estimates.
    """
    known = study.done & ~np.isnan(study.objective[:, objective])
    column = study.parameter[:, parameter]
    values = np.unique(column[known])
    groups = [np.flatnonzero(known & (column == value)) for value in values]
    mean = np.array([study.objective[rows, objective].mean() for rows in groups])

    def half(bound: FloatArray) -> FloatArray:
        apart = np.abs(bound - study.objective)[:, objective]
        return np.array(
            [np.sqrt((apart[rows] ** 2).sum()) / len(rows) for rows in groups]
        )

    return MainEffect(
        parameter=study.parameter_names[parameter],
        unit=study.parameter_units[parameter],
        objective=study.objective_names[objective],
        values=values,
        labels=tuple(value_texts(study, int(rows[0]))[parameter] for rows in groups),
        mean=mean,
        low=mean - half(study.objective_low),
        high=mean + half(study.objective_high),
    )
