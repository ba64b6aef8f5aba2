"""The budget of an attempt, by counting."""

from __future__ import annotations

from reachmap.core.collision.checker import CollisionChecker
from reachmap.core.planning.ompl import Budget


class Counter(CollisionChecker):
    """What a budget reads of a checker."""

    def __init__(self, checks=0):
        self.checks = checks


def checks_until(end, counter, step=1):
    """How many checks are made until a condition says stop."""
    begin = counter.checks
    while not end():
        counter.checks += step
    return counter.checks - begin


def test_searches_get_their_part_and_the_attempt_its_whole():
    """Parts of 10, 20, 40 and what is left of 100, then no more."""
    counter = Counter(checks=7)
    budget = Budget(counter, 100, 60.0)
    spent = []
    for part in (10, 20, 40, 80):
        budget.begin_search(part)
        spent.append(checks_until(budget.search_ends, counter))
        assert budget.search_interrupted == (part < 80)
    assert spent == [10, 20, 40, 30]
    assert budget.spent()
    assert budget.used() == 100
    assert not budget.out_of_time


def test_what_is_done_in_a_pause_is_free():
    """Checks of shortening are given back."""
    counter = Counter()
    budget = Budget(counter, 10, 60.0)
    counter.checks += 4
    with budget.paused():
        counter.checks += 1000
    assert budget.used() == 4
    assert not budget.spent()
    counter.checks += 6
    assert budget.spent()


def test_a_search_that_checks_nothing_ends_by_its_calls():
    """Asking alone uses up a part, then the whole."""
    budget = Budget(Counter(), 10, 60.0)
    budget.begin_search(3)
    calls = next(n for n in range(1, 1000) if budget.search_ends())
    assert budget.search_interrupted
    assert calls == 60
    budget.begin_search(100)
    assert next(n for n in range(1, 1000) if budget.search_ends()) == 140
    assert not budget.search_interrupted


def test_the_clock_ends_an_attempt():
    """Seconds that are over are found out without a single check."""
    budget = Budget(Counter(), 10**9, 0.0)
    budget.begin_search(10**9)
    assert any(budget.search_ends() for _ in range(200))
    assert budget.out_of_time
    assert not budget.search_interrupted
