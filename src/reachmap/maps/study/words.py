"""A study in words: values, changes, estimates and sentences, the same everywhere."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from reachmap.maps.study.record import OBJECTIVES, Study
from reachmap.text import MINUS, NONE

UNIT_WORDS = {"percent": "%", "rad": "rad", "s": "s"}
CHANGE_WORDS = {"percent": "points", "rad": "rad", "s": "s"}


def estimate_text(objective: str, value: float, low: float, high: float) -> str:
    """A value with its 95 % interval, a dash for what is not known.

    Examples
    --------
    >>> estimate_text("bin_reachability", 69.1, 66.24, 71.8)
    '69.1 % (66.2 to 71.8)'
    """
    if math.isnan(value):
        return NONE
    digits, unit = digits_of(objective), unit_of(objective)
    text = f"{_number(value, digits)} {unit}"
    if math.isnan(low):
        return text
    return f"{text} ({_number(low, digits)} to {_number(high, digits)})"


def unit_of(objective: str) -> str:
    """Unit of an objective as people read it: ``%``, ``rad`` or ``s``."""
    return UNIT_WORDS[OBJECTIVES[objective]]


def no_best_text(done: int, requirements: Sequence[str]) -> str:
    """Why no variant of a study is the best.

    Parameters
    ----------
    done : int
        Variants that were computed.
    requirements : sequence of str
    """
    if not done:
        return "no variant could be mapped"
    if requirements:
        return "no variant meets the requirements"
    return "no variant has a value"


def digits_of(objective: str) -> int:
    """Decimals that an objective is written with."""
    return 1 if OBJECTIVES[objective] == "percent" else 3


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
    word, digits = CHANGE_WORDS[OBJECTIVES[name]], digits_of(name)
    middle = float(study.change[row, objective])
    change = _number(middle, digits, sign="+")
    what = f"{changes_text(study, row)}: {name} "
    if not study.pairs[row, objective]:
        return f"{what}cannot be compared, no test frame is shared with the base"
    low = float(study.change_low[row, objective])
    high = float(study.change_high[row, objective])
    if math.isnan(low):
        return f"{what}{change} {word}, too few frames for an interval"
    half = _number(max(middle - low, high - middle), digits)
    if study.significant[row, objective]:
        return f"{what}{change} ± {half} {word}"
    if not low <= 0.0 <= high:
        return f"{what}{change} ± {half} {word}, not significant across the study"
    return f"{what}{change} {word}, not distinguishable from {half} of noise"


def _number(value: float, digits: int, *, sign: str = "-") -> str:
    """Fixed digits, a real minus, no minus before zero."""
    return f"{round(value, digits) + 0.0:{sign}.{digits}f}".replace("-", MINUS)
