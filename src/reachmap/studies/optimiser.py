"""Which variant to try next: Optuna's TPE, then the neighbours of the best."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Any

from reachmap.errors import SettingsError
from reachmap.studies.design import CHOICE, Factor, Variant, variant_at

# Variants are proposed in rounds of this size, whatever the number of workers, so that
# the same study comes out on any machine.
ROUND = 4
# The last part of the budget goes to the neighbours of the best: TPE finds the region,
# and steps in it are what it is slow at.
LOCAL_SHARE = 0.5
# A range without steps has neighbours at these shares of its width.
STEPS = (0.1, 0.03, 0.01)
# Times that the sampler is asked for a variant that was not tried yet.
ASKED = 30
Place = tuple[float, ...]


class Optimiser:
    """Proposes variants from results so far; the same seed gives the same ones.

    Parameters
    ----------
    factors : sequence of Factor
    count : int
        Variants to propose, at most.
    seed : int
    first : tuple of float
        Where to begin: for each factor its place in the list, or the value.

    Raises
    ------
    SettingsError
        Optuna is not installed.
    """

    def __init__(
        self, factors: Sequence[Factor], count: int, seed: int, first: Place
    ) -> None:
        try:
            import optuna
        except ImportError:
            raise SettingsError(
                "--optimise needs Optuna: pip install 'reachmap-cells[optimise]'"
            ) from None
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        self._factors, self._first = factors, first
        self._failed = optuna.trial.TrialState.FAIL
        self._pending: list[Place] = []
        self._distributions = {
            f"{k}": _distribution(optuna, factor) for k, factor in enumerate(factors)
        }
        self._study = optuna.create_study(
            direction="maximize", sampler=optuna.samplers.TPESampler(seed=seed)
        )
        sizes = [len(factor.texts) or math.inf for factor in factors]
        self.count = int(min(float(count), math.prod(sizes)))
        self._utilities: dict[Place, float] = {}
        self._trials: dict[Place, Any] = {}

    def rounds(self) -> Iterator[list[Variant]]:
        """Variants to try, round by round; :meth:`tell` is called between them."""
        while len(self._utilities) < self.count:
            wanted = min(ROUND, self.count - len(self._utilities))
            places: list[Place] = []
            if not self._utilities:
                places.append(self._first)
            local = len(self._utilities) >= (1.0 - LOCAL_SHARE) * self.count
            if local:
                places += itertools.islice(self._neighbours(), wanted - len(places))
            while len(places) < wanted:
                places.append(self._asked(places))
            self._pending = places
            yield [variant_at(self._factors, place) for place in places]

    def tell(self, utilities: Sequence[float]) -> None:
        """Report the utilities of the variants of the last round; more is better."""
        for place, value in zip(self._pending, utilities, strict=True):
            self._utilities[place] = value
            trial = self._trials.pop(place, None)
            if trial is None:
                self._study.enqueue_trial(_named(place))
                trial = self._study.ask(self._distributions)
            self._study.tell(trial, value)

    def _asked(self, places: Sequence[Place]) -> Place:
        """The sampler's proposal if it is new; else the first untried one."""
        for _ in range(ASKED):
            trial = self._study.ask(self._distributions)
            place = tuple(float(trial.params[name]) for name in self._distributions)
            if place in self._utilities:
                self._study.tell(trial, self._utilities[place])
            elif place in places:
                self._study.tell(trial, state=self._failed)
            else:
                self._trials[place] = trial
                return place
        every = itertools.product(*(range(len(f.texts)) for f in self._factors))
        found = (tuple(float(k) for k in place) for place in every)
        return next(p for p in found if p not in self._utilities and p not in places)

    def _neighbours(self) -> Iterator[Place]:
        """Untried places one step from the best, then from the next best."""
        seen = set(self._utilities)
        for best in sorted(self._utilities, key=lambda p: (-self._utilities[p], p)):
            for size in range(len(STEPS)):
                for k, factor in enumerate(self._factors):
                    for value in _beside(factor, best[k], size):
                        place = (*best[:k], value, *best[k + 1 :])
                        if place not in seen:
                            seen.add(place)
                            yield place


def _named(place: Place) -> dict[str, float]:
    return {f"{k}": value for k, value in enumerate(place)}


def _distribution(optuna: Any, factor: Factor) -> Any:
    """Places in a list, or a range; numbers have an order, choices have none."""
    if not factor.texts:
        return optuna.distributions.FloatDistribution(*factor.numbers)
    if factor.unit == CHOICE:
        return optuna.distributions.CategoricalDistribution(range(len(factor.texts)))
    return optuna.distributions.IntDistribution(0, len(factor.texts) - 1)


def _beside(factor: Factor, value: float, size: int) -> list[float]:
    if not factor.texts:
        low, high = factor.numbers
        step = STEPS[size] * (high - low)
        return [v for v in (value + step, value - step) if low <= v <= high]
    if size > 0:
        return []
    if factor.unit == CHOICE:
        return [float(k) for k in range(len(factor.texts)) if k != value]
    return [v for v in (value + 1.0, value - 1.0) if 0 <= v < len(factor.texts)]
