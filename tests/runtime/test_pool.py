from __future__ import annotations

import random
from collections import Counter
from concurrent.futures import BrokenExecutor, Executor, Future
from typing import Any

import pytest

from reachmap.errors import EngineError, IncompleteError, SceneError
from reachmap.runtime import pool as pool_module
from reachmap.runtime.job import Job, Reply, get_ready
from reachmap.runtime.pool import Pool, Slot

JOB = Job(function=print, context=None)


class WorkerKilledError(Exception):
    """What an executor that replaces its own dead workers raises."""


class Cluster:
    """What several pretended executors do; units are done when `step` is called.

    `poison` units kill the `width` workers' executor each time, `moody` ones once.
    """

    def __init__(self, width, *, poison=(), moody=(), heals=False):
        self.width, self.poison, self.moody = width, set(poison), set(moody)
        self.heals = heals
        self.pending: list[tuple[Future, int]] = []
        self.done: list[int] = []
        self.crowds: list[tuple[int, ...]] = []
        self.killed: Counter[int] = Counter()
        self.started = 0
        self.most_held = 0

    def slot(self, *, narrow=False, lost=None):
        """The slot of this cluster."""
        return ClusterSlot(self, narrow=narrow, lost=lost)

    def step(self):
        """Let every worker finish one unit, or die of it."""
        crowd, self.pending = self.pending[: self.width], self.pending[self.width :]
        self.crowds.append(tuple(unit for _, unit in crowd))
        deadly = [unit for _, unit in crowd if unit in self.poison | self.moody]
        self.moody -= set(deadly)
        self.killed.update(deadly)
        for future, unit in crowd:
            if not deadly:
                self.done.append(unit)
                future.set_result(Reply(index=unit, text=str(unit)))
            elif self.heals:
                future.set_exception(WorkerKilledError(unit))
            else:
                future.set_exception(BrokenExecutor("died"))
        if deadly and not self.heals:
            for future, _ in self.pending:
                future.set_exception(BrokenExecutor("died"))
            self.pending = []


class ClusterSlot(Slot):
    """A slot of several workers, or of one."""

    def __init__(self, cluster, *, narrow, lost):
        super().__init__(lambda: Scripted(cluster))
        self.cluster, self.lost = cluster, lost
        self.is_wide = not narrow

    def window(self):
        """Room for a few units each."""
        return 4 * self.cluster.width if self.is_wide else 1

    def stop(self, executor):
        """Forget everything."""
        self.cluster.pending.clear()

    def is_lost(self, error):
        """By default when it is broken."""
        return super().is_lost(error) if self.lost is None else self.lost(error)

    def deaths(self, error):
        """What a cluster that heals itself says."""
        return 4 if isinstance(error, WorkerKilledError) else 0


class Scripted(Executor):
    """Submits to a cluster."""

    def __init__(self, cluster):
        self.cluster = cluster
        cluster.started += 1

    def submit(self, fn, /, *args, **kwargs):
        """Keep the unit until the next step; workers are always ready."""
        future: Future[Any] = Future()
        if fn is get_ready:
            future.set_result(1)
        else:
            self.cluster.pending.append((future, args[1]))
            held = len(self.cluster.pending)
            self.cluster.most_held = max(self.cluster.most_held, held)
        return future


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    monkeypatch.setattr(pool_module, "TICK_S", 0.0005)


def run(cluster, units, **settings):
    """Replies by unit."""
    replies = {}
    slot = cluster.slot(**settings)
    with Pool(lambda units, most: [slot]) as pool:
        for reply in pool.replies(JOB, dict.fromkeys(range(units))):
            if reply is None:
                cluster.step()
            else:
                assert reply.index not in replies
                replies[reply.index] = reply
    return replies


def failed(replies):
    """Units that were given up."""
    return sorted(unit for unit, reply in replies.items() if reply.failed)


def test_the_window_bounds_what_is_in_flight():
    """However many units there are, only a few are handed in ahead."""
    cluster = Cluster(2)
    assert failed(run(cluster, 50)) == []
    assert 4 < cluster.most_held <= 8
    assert sorted(cluster.done) == list(range(50))


def test_a_lane_in_order_blames_the_unit_it_was_on():
    """One worker: the oldest unit is the one, with three strikes and no other tries."""
    cluster = Cluster(1, poison={3, 7})
    replies = run(cluster, 10, narrow=True)
    assert failed(replies) == [3, 7]
    assert replies[3].text == '"killed 3 workers"'
    assert cluster.killed == {3: 3, 7: 3}
    assert sorted(cluster.done) == [0, 1, 2, 4, 5, 6, 8, 9]


def test_a_worker_that_dies_once_loses_nothing():
    """A single death is a retry, not an error."""
    cluster = Cluster(1, moody={0, 4, 9})
    assert failed(run(cluster, 10, narrow=True)) == []
    assert sorted(cluster.done) == list(range(10))
    assert cluster.started == 4


def test_workers_killed_from_outside_are_no_fault_of_the_units():
    """Deaths all over the place raise the number that one unit is blamed for."""

    class Stormy(Cluster):
        rng = random.Random(0)

        def step(self):
            if self.pending and self.rng.random() < 0.25:
                self.moody = {self.pending[0][1]}
            super().step()

    for _ in range(20):
        cluster = Stormy(1)
        assert failed(run(cluster, 100, narrow=True)) == []
        assert max(cluster.killed.values()) >= 2


def test_a_poisoned_unit_is_found_among_deaths_from_outside():
    """It takes longer, and it ends."""
    cluster = Cluster(1, poison={5}, moody=set(range(6, 30)))
    replies = run(cluster, 40, narrow=True)
    assert failed(replies) == [5]
    assert cluster.killed[5] == 12


@pytest.mark.parametrize("heals", [False, True])
def test_a_wide_lane_blames_nobody_in_a_crowd(heals):
    """Neighbours of a poisoned unit are tried alone and found innocent."""
    cluster = Cluster(4, poison={5, 6, 17}, heals=heals)
    replies = run(cluster, 30)
    assert failed(replies) == [5, 6, 17]
    assert sorted(cluster.done) == sorted(set(range(30)) - {5, 6, 17})
    fatal_alone = Counter(crowd for crowd in cluster.crowds if len(crowd) == 1)
    assert fatal_alone[(5,)] == (1 if heals else 3)


@pytest.mark.parametrize("heals", [False, True])
def test_a_wide_lane_survives_deaths_that_have_no_culprit(heals):
    """Units that killed once are done in the end, all others too."""
    cluster = Cluster(3, moody={1, 2, 8, 20}, heals=heals)
    assert failed(run(cluster, 24)) == []
    assert sorted(cluster.done) == list(range(24))


def test_workers_that_die_while_getting_ready_are_replaced():
    """An executor that heals itself but lost the job is restarted, without blame."""

    class Forgetful(Cluster):
        def step(self):
            if self.started < 4:
                for future, _ in self.pending:
                    future.set_exception(LookupError("the job is gone"))
                self.pending = []
            else:
                super().step()

    cluster = Forgetful(2)
    replies = run(cluster, 20, lost=lambda error: isinstance(error, LookupError))
    assert sorted(replies) == list(range(20))
    assert failed(replies) == []
    assert cluster.started == 4


def test_all_units_poisoned():
    """Even then the run ends, with every unit given up."""
    assert failed(run(Cluster(2, poison=range(6)), 6)) == list(range(6))


def test_a_broken_executor_that_finished_units_is_believed():
    """Results that came before the death are not computed again."""

    class HalfDone(Cluster):
        def step(self):
            if not self.crowds and len(self.pending) > 2:
                self.crowds.append(())
                self.pending[0][0].set_exception(BrokenExecutor("died"))
                future, unit = self.pending[1]
                self.done.append(unit)
                future.set_result(Reply(index=unit, text="1"))
            else:
                super().step()

    cluster = HalfDone(2)
    assert failed(run(cluster, 8)) == []
    assert sorted(cluster.done) == list(range(8))


def test_workers_that_never_start_end_the_run():
    """A machine that cannot start workers is a defect to report, not to retry."""

    class Dead(Scripted):
        def submit(self, fn, /, *args, **kwargs):
            raise BrokenExecutor("died at once")

    cluster = Cluster(1)
    slot = Slot(lambda: Dead(cluster))
    with (
        pytest.raises(EngineError, match=r"died 3 times before their first unit.*-j 1"),
        Pool(lambda units, most: [slot]) as pool,
    ):
        list(pool.replies(JOB, {0: "a", 1: "b"}))
    assert cluster.started == 3


@pytest.mark.parametrize(
    ("error", "kind", "said"),
    [
        (SceneError("no scan configuration"), SceneError, "no scan configuration"),
        (ValueError("odd"), EngineError, "cannot do its work: ValueError: odd"),
    ],
)
def test_an_exception_of_the_executor_ends_the_run(error, kind, said):
    """Wrong input is reported as it is; anything else as a defect."""

    class Failing(Cluster):
        def step(self):
            if self.pending:
                self.pending[0][0].set_exception(error)

    with pytest.raises(kind, match=said):
        run(Failing(1), 3)


def test_an_executor_that_drops_its_work_leaves_it_to_be_resumed():
    """Cancelled futures mean that the scheduler has gone."""

    class Gone(Cluster):
        def step(self):
            for future, _ in self.pending:
                future.cancel()
                future.set_running_or_notify_cancel()

    with pytest.raises(IncompleteError, match="run the same command again"):
        run(Gone(1), 3)
