"""The design of a study: what is varied, and the resulting variants."""

from __future__ import annotations

import itertools
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import qmc

from reachmap._typing import FloatArray
from reachmap.cell.loaded import LoadedCell
from reachmap.cell.text.messages import did_you_mean
from reachmap.cell.text.yaml_reader import parse_yaml
from reachmap.errors import SettingsError

# A choice: at a minute a variant, a week of one core.
MAX_VARIANTS = 10_000
# Digits of a value of an even range: 0.1 + 0.2 is to read 0.3.
DIGITS = 12
CHOICE = "choice"
# YAML writes .nan and .inf, Python without the dot.
DOT = re.compile(r"\.(?=nan|inf)", re.IGNORECASE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Factor:
    """A parameter that is varied.

    Attributes
    ----------
    name : str
        As it was given: a parameter of the cell, or a key as ``--set`` takes it.
    key : str
        What ``--set`` takes.
    unit : str
        "" for none; ``choice`` where the values are not numbers.
    texts : tuple of str
        The values as YAML; empty for a range to be sampled.
    numbers : tuple of float
        The same as numbers, their places where they are none; or the ends of a range.
    """

    name: str
    key: str
    unit: str
    texts: tuple[str, ...]
    numbers: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """One row of a study: the overrides, and the numbers they stand for."""

    overrides: tuple[str, ...]
    values: tuple[float, ...]

    def assignment(self, factors: Sequence[Factor]) -> str:
        """What it sets, under the names that were given."""
        return ", ".join(
            f"{factor.name}={text.partition('=')[2]}"
            for factor, text in zip(factors, self.overrides, strict=True)
        )

    def options(self, factors: Sequence[Factor]) -> dict[str, str]:
        """Each override to the option that it is a value of."""
        return {
            text: f"--vary {factor.name}={text.partition('=')[2]}"
            for factor, text in zip(factors, self.overrides, strict=True)
        }

    def row(self, factors: Sequence[Factor]) -> dict[str, Any]:
        """Its row in the study before it is computed."""
        return {
            "values": list(self.values),
            "assignment": self.assignment(factors),
            "unit": None,
            "cell_sha256": "",
            "cause": "",
        }


def factors_of(
    texts: Sequence[str],
    base: LoadedCell,
    *,
    sampled: bool = False,
    optimised: bool = False,
) -> tuple[Factor, ...]:
    """Read ``NAME=LOW:HIGH:N`` and ``NAME=a,b,c``.

    Parameters
    ----------
    texts : sequence of str
    base : LoadedCell
        The cell as it is, with its parameters.
    sampled : bool
        Whether ranges ``NAME=LOW:HIGH`` are to be sampled.
    optimised : bool
        Whether such ranges may stand beside those with steps.

    Raises
    ------
    SettingsError
        One of them is neither, or a name occurs twice.
    """
    factors = tuple(
        _factor(text, base, sampled or (optimised and text.count(":") == 1))
        for text in texts
    )
    keys = [factor.key for factor in factors]
    for key in keys:
        if keys.count(key) > 1:
            raise SettingsError(f"--vary {key}: given more than once")
    return factors


def choices_of(factors: Sequence[Factor]) -> list[str]:
    """Each value that is no number, as an override: files are among them."""
    return [
        f"{factor.key}={text}"
        for factor in factors
        if factor.unit == CHOICE
        for text in factor.texts
    ]


def _factor(text: str, base: LoadedCell, sampled: bool) -> Factor:
    name, equals, values = (part.strip() for part in text.partition("="))
    if not equals or not name or not values:
        raise SettingsError(
            f"--vary {text!r:.120}: expected NAME=LOW:HIGH:N or NAME=a,b,c"
        )
    known = base.cell.parameters.get(name)
    _require_known(name, base)
    key = name if known is None else f"parameters.{name}"
    unit = "" if known is None else known.unit
    colons = [part.strip() for part in values.split(":")]
    if len(colons) > 1 and all(_number(part) is not None for part in colons):
        numbers = _range(text, colons, sampled)
        texts = () if sampled else tuple(f"{value:.12g}" for value in numbers)
        return Factor(name=name, key=key, unit=unit, texts=texts, numbers=numbers)
    items = tuple(_split(values))
    for item in items:
        _require_value(text, item)
    if not all(items) or len(set(items)) < len(items):
        raise SettingsError(f"--vary {text!r:.120}: an empty or repeated value")
    parsed = [_number(item) for item in items]
    if any(value is None for value in parsed):
        return Factor(
            name=name,
            key=key,
            unit=CHOICE,
            texts=items,
            numbers=tuple(float(k) for k in range(len(items))),
        )
    numbers = tuple(value for value in parsed if value is not None)
    return Factor(name=name, key=key, unit=unit, texts=items, numbers=numbers)


def _require_value(text: str, item: str) -> None:
    """Refuse what looks like a number or a range, and is none."""
    first, colon, _ = item.partition(":")
    if colon and _number(first) is not None:
        raise SettingsError(
            f"--vary {text:.120}: {item!r:.60} is not a range; expected "
            "NAME=LOW:HIGH:N, alone, with finite numbers LOW and HIGH"
        )
    if _is_infinite(item):
        raise SettingsError(f"--vary {text:.120}: {item} is not a finite number")


def _require_known(name: str, base: LoadedCell) -> None:
    """Refuse what is neither a parameter of the cell nor begins one of its keys."""
    parameters, keys = base.cell.parameters, json.loads(base.resolved_json)
    first = name.partition(".")[0]
    if name in parameters or first in keys:
        return
    known = ", ".join(parameters) or "it has none"
    raise SettingsError(
        f"--vary {name:.60}: neither a parameter of the cell ({known}) nor one of its "
        f"keys; {did_you_mean(first, [*parameters, *keys])}"
    )


def _range(text: str, parts: Sequence[str], sampled: bool) -> tuple[float, ...]:
    low, high = float(parts[0]), float(parts[1])
    if low >= high:
        raise SettingsError(f"--vary {text}: expected LOW below HIGH")
    if sampled and len(parts) == 2:
        return low, high
    if sampled:
        raise SettingsError(
            f"--vary {text}: expected NAME=LOW:HIGH, which --latin-hypercube samples"
        )
    if len(parts) != 3 or not parts[2].isdecimal() or not 2 <= int(parts[2]) <= 1000:
        raise SettingsError(
            f"--vary {text}: expected NAME=LOW:HIGH:N with N from 2 to 1000 "
            "(--latin-hypercube N samples NAME=LOW:HIGH)"
        )
    return tuple(round(v, DIGITS) for v in np.linspace(low, high, int(parts[2])))


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _is_infinite(text: str) -> bool:
    """Whether a text is a number, but none that is finite."""
    try:
        return not math.isfinite(float(DOT.sub("", text)))
    except ValueError:
        return False


def _split(text: str) -> list[str]:
    """Split at commas that are in no bracket and no quotes."""
    parts, depth, quote = [""], 0, ""
    for sign in text:
        if quote:
            quote = "" if sign == quote else quote
        elif sign in "'\"":
            quote = sign
        else:
            depth += (sign in "[{") - (sign in "]}")
        if sign == "," and depth == 0 and not quote:
            parts.append("")
        else:
            parts[-1] += sign
    return [part.strip() for part in parts]


def grid(factors: Sequence[Factor]) -> list[Variant]:
    """Every combination; the last factor varies fastest.

    Raises
    ------
    SettingsError
        There are too many.
    """
    count = math.prod(len(factor.texts) for factor in factors)
    if count > MAX_VARIANTS:
        raise SettingsError(
            f"{count} variants, more than {MAX_VARIANTS}: vary less, or sample with "
            "--latin-hypercube N"
        )
    return [
        variant_at(factors, place)
        for place in itertools.product(*(range(len(f.texts)) for f in factors))
    ]


def latin_hypercube(factors: Sequence[Factor], count: int, seed: int) -> list[Variant]:
    """Samples such that each factor takes each part of its range once.

    Parameters
    ----------
    factors : sequence of Factor
    count : int
    seed : int
        The same seed gives the same samples.
    """
    if not 2 <= count <= MAX_VARIANTS:
        raise SettingsError(f"--latin-hypercube {count}: from 2 to {MAX_VARIANTS}")
    if all(factor.texts for factor in factors):
        raise SettingsError(
            f"--latin-hypercube {count}: needs a range to sample, --vary NAME=LOW:HIGH"
        )
    sampler = qmc.LatinHypercube(len(factors), rng=np.random.default_rng(seed))
    return [_sampled(factors, row) for row in sampler.random(count)]


def _sampled(factors: Sequence[Factor], row: FloatArray) -> Variant:
    place = [
        share * len(f.texts)
        if f.texts
        else f.numbers[0] + share * (f.numbers[1] - f.numbers[0])
        for f, share in zip(factors, row, strict=True)
    ]
    return variant_at(factors, place)


def variant_at(factors: Sequence[Factor], place: Sequence[float]) -> Variant:
    """Variant at a place: in the list of each factor, or in its range."""
    texts, values = [], []
    for factor, at in zip(factors, place, strict=True):
        if factor.texts:
            text, value = factor.texts[int(at)], factor.numbers[int(at)]
        else:
            value = float(f"{at:.6g}")
            text = f"{value:.6g}"
        texts.append(f"{factor.key}={text}")
        values.append(value)
    return Variant(overrides=tuple(texts), values=tuple(values))


def base_of(
    factors: Sequence[Factor], variants: Sequence[Variant], base: LoadedCell
) -> int:
    """Variant that is closest to the cell as it is; the first of equals."""
    data = json.loads(base.resolved_json)
    distance = np.zeros(len(variants))
    for k, factor in enumerate(factors):
        values = np.array([variant.values[k] for variant in variants])
        own = _own_value(factor, data)
        spread = float(np.ptp(values))
        if own is not None and spread > 0:
            distance += np.abs(values - own) / spread
    # Values that were rounded on the way are as close as those that were not.
    return int(np.argmin(np.round(distance, 9)))


def place_of(factors: Sequence[Factor], base: LoadedCell) -> tuple[float, ...]:
    """Place nearest to the cell as it is; the middle where it has no such value."""
    data = json.loads(base.resolved_json)
    found = []
    for factor in factors:
        own, numbers = _own_value(factor, data), np.array(factor.numbers)
        if not factor.texts:
            own = float(numbers.mean()) if own is None else own
            found.append(float(np.clip(own, *numbers)))
        elif own is None:
            found.append(float(len(numbers) // 2))
        else:
            found.append(float(np.argmin(np.round(np.abs(numbers - own), 9))))
    return tuple(found)


def _own_value(factor: Factor, data: Mapping[str, Any]) -> float | None:
    """Value that the cell has now; None where it is none of the study's."""
    found: Any = data
    parts = factor.key.split(".")
    if parts[0] == "parameters":
        parts = [*parts[:2], "value"]
    for part in parts:
        if isinstance(found, list):
            named = [item for item in found if _name(item) == part]
            inside = part.isdecimal() and int(part) < len(found)
            found = found[int(part)] if inside else (named or [None])[0]
        else:
            found = found.get(part) if isinstance(found, dict) else None
    if factor.unit == CHOICE:
        values = [parse_yaml(text, factor.name).data for text in factor.texts]
        return float(values.index(found)) if found in values else None
    is_number = isinstance(found, int | float) and not isinstance(found, bool)
    return float(found) if is_number else None


def _name(item: Any) -> Any:
    return item.get("name") if isinstance(item, dict) else None
