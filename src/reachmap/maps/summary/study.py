"""Summary of a study: main effects, the change of each variant, the best one."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray
from reachmap.maps.study.record import OBJECTIVES, STATES, Study, VariantStatus

UNIT_WORDS = {"percent": "%", "rad": "rad", "s": "s"}
CHANGE_WORDS = {"percent": "points", "rad": "rad", "s": "s"}


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


def summarise_study(study: Study) -> StudySummary:
    """Summarise a study."""
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


def value_texts(study: Study, row: int) -> list[str]:
    """Value of each parameter as the variant sets it, in words."""
    names = [re.escape(name) for name in study.parameter_names]
    pattern = ", ".join(f"{name}=(.*)" for name in names)
    found = re.fullmatch(pattern, study.assignment[row], re.DOTALL)
    if found is None:
        return [f"{value:g}" for value in study.parameter[row]]
    return [
        text if unit == "choice" else f"{value:.6g}"
        for text, unit, value in zip(
            found.groups(), study.parameter_units, study.parameter[row], strict=True
        )
    ]


def changes_text(study: Study, row: int) -> str:
    """Which parameters differ from the base: ``tube_length 0.119 → 0.319``."""
    before, after = value_texts(study, study.base), value_texts(study, row)
    return ", ".join(
        f"{name} {old} → {new}"
        for name, old, new in zip(study.parameter_names, before, after, strict=True)
        if old != new
    )


def sentence(study: Study, row: int, objective: int) -> str:
    """The change of a variant and its significance, as a sentence."""
    name = study.objective_names[objective]
    word = CHANGE_WORDS[OBJECTIVES[name]]
    digits = 1 if word == "points" else 3
    middle = float(study.change[row, objective])
    change = _signed(middle, digits)
    what = f"{changes_text(study, row)}: {name} "
    if not study.pairs[row, objective]:
        return f"{what}cannot be compared, no test frame is shared with the base"
    if np.isnan(study.change_low[row, objective]):
        return f"{what}{change} {word}, too few frames for an interval"
    low, high = study.change_low[row, objective], study.change_high[row, objective]
    half = f"{max(middle - low, high - middle):.{digits}f}"
    if study.significant[row, objective]:
        return f"{what}{change} ± {half} {word}"
    if not low <= 0.0 <= high:
        return f"{what}{change} ± {half} {word}, not significant across the study"
    return f"{what}{change} {word}, not distinguishable from {half} of noise"


def _signed(value: float, digits: int) -> str:
    return f"{value + 0.0:+.{digits}f}".replace("-", "−")


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
