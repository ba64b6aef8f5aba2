"""A scan in small: cheap units with exact payloads, and units that misbehave.

``python toy_work.py OUT [options]`` runs it as a command would, with its exit codes.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import logging
import os
import signal
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from reachmap.errors import ReachmapError, SceneError
from reachmap.maps import publish
from reachmap.runtime.job import KINDS, Job, Kind, Work
from reachmap.runtime.options import RunOptions


@dataclass(frozen=True, slots=True, kw_only=True)
class Toy:
    """What the toy's units do.

    ``poison`` units kill their worker, ``moody`` ones only the first time (``marks``
    is a folder that remembers), ``buggy`` ones raise, ``wrong`` ones find bad input.
    ``ballast`` makes the context that large [bytes]; each unit computes for ``busy_s``.
    """

    units: int = 40
    seed: int = 1
    pause_s: float = 0.0
    busy_s: float = 0.0
    poison: tuple[int, ...] = ()
    moody: tuple[int, ...] = ()
    buggy: tuple[int, ...] = ()
    wrong: tuple[int, ...] = ()
    marks: str = ""
    prepare: str = "well"
    ballast: int = 0
    load: bytes = field(default=b"", init=False, repr=False)

    def __post_init__(self):
        object.__setattr__(self, "load", bytes(self.ballast))


def prepare(toy):
    """Check the context as building a scene would."""
    if toy.prepare == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    if toy.prepare == "wrong":
        raise SceneError("the scan configuration is in collision")
    if toy.prepare == "buggy":
        raise ZeroDivisionError("no scene")
    return toy


def compute(toy, unit):
    """One payload: numbers of every sort, from the seed and the unit alone."""
    time.sleep(toy.pause_s)
    end = time.thread_time() + toy.busy_s
    while time.thread_time() < end:
        pass
    if unit in toy.poison:
        os.kill(os.getpid(), signal.SIGKILL)
    if unit in toy.moody and not (mark := Path(toy.marks) / str(unit)).exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    if unit in toy.buggy:
        raise ZeroDivisionError(f"unit {unit} divides by zero")
    if unit in toy.wrong:
        raise SceneError(f"unit {unit} met a cell that cannot work")
    rng = np.random.default_rng(np.random.SeedSequence(toy.seed, spawn_key=(unit,)))
    values = rng.normal(size=(3, 4))
    values[0, unit % 4] = (np.nan, np.inf, -np.inf, -0.0)[unit % 4]
    return {
        "unit": unit,
        "status": rng.integers(0, 6, size=5, dtype=np.uint8),
        "values": values,
        "scalar": float(values[1, 1]) if unit % 3 else float("nan"),
    }


def tally(payload):
    """Five frames a unit; those with a status above 1 are ok."""
    return int((payload["status"] > 1).sum()), 5


def blank(document, unit, status):
    """Payload of a unit that failed or was not done."""
    return {
        "unit": unit,
        "status": np.full(5, status, dtype=np.uint8),
        "values": np.full((3, 4), np.nan),
        "scalar": float("nan"),
    }


def assemble(document, payloads, *, run):
    """All payloads as one text that shows every bit."""
    return {"title": document["title"], "rows": [bits(one) for one in payloads]}


def bits(payload):
    """A payload as text without loss."""
    scalar = np.float64(payload["scalar"]).tobytes().hex()
    return [
        payload["unit"],
        payload["status"].tobytes().hex(),
        payload["values"].tobytes().hex(),
        scalar,
    ]


def die_at(moment):
    """Kill this process just before the n-th call of a function: ``os.link:2``."""
    name, _, count = moment.partition(":")
    owner, _, attribute = name.rpartition(".")
    where = {"os": os, "pathlib.Path": Path}[owner]
    before, left = getattr(where, attribute), [int(count)]

    def deadly(*arguments, **settings):
        left[0] -= 1
        if not left[0]:
            os.kill(os.getpid(), signal.SIGKILL)
        return before(*arguments, **settings)

    setattr(where, attribute, deadly)


def write(path, artefact, *, overwrite=False):
    """Publish the text."""
    if moment := os.environ.get("TOY_DIES_AT"):
        die_at(moment)
    padding = b" " * int(os.environ.get("TOY_PADDING", "0"))
    publish(path, [json.dumps(artefact).encode(), padding], overwrite=overwrite)


KIND = Kind(name="toy", blank=blank, assemble=assemble, write=write)
KINDS["toy"] = "tests.support.toy_work:KIND"


def toy_work(toy=None, **changes):
    """The work of a toy."""
    toy = dataclasses.replace(toy or Toy(), **changes)
    job = Job(function=compute, prepare=prepare, context=toy, tally=tally)
    return Work(
        kind=KIND,
        units=range(toy.units),
        job=lambda stages: job,
        settings={"seed": toy.seed, "grid": {"units": [toy.units, 1]}},
        document={"title": "a toy"},
        frames=5 * toy.units,
    )


def expected(toy=None, *, failed=(), **changes):
    """The artefact computed without any of the machinery."""
    from reachmap.maps import Status

    toy = dataclasses.replace(toy or Toy(), **changes)
    clean = dataclasses.replace(toy, poison=(), moody=(), buggy=(), wrong=(), pause_s=0)
    payloads = [
        blank({}, unit, Status.ERROR) if unit in failed else compute(clean, unit)
        for unit in range(toy.units)
    ]
    return {"title": "a toy", "rows": [bits(one) for one in payloads]}


def main():
    """Run a toy as a command."""
    from reachmap.runtime.run import run_scan

    parser = argparse.ArgumentParser()
    parser.add_argument("output", type=Path)
    parser.add_argument("--toy", default="{}")
    parser.add_argument("-j", dest="workers", type=int, default=2)
    parser.add_argument("--executor", default="processes")
    parser.add_argument("--restart", action="store_true")
    parser.add_argument("--overwrite", action="store_true")
    parser.add_argument("--shard", default="")
    options = vars(parser.parse_args())
    given: dict[str, Any] = {
        key: tuple(value) if isinstance(value, list) else value
        for key, value in json.loads(options.pop("toy")).items()
    }
    toy = Toy(**given)
    shard = options.pop("shard")
    options["shard"] = tuple(map(int, shard.split("/"))) if shard else None
    logging.getLogger("reachmap").setLevel(logging.INFO)
    logging.getLogger("reachmap").addHandler(logging.StreamHandler())
    try:
        outcome = run_scan(
            toy_work(toy),
            output=options.pop("output"),
            options=RunOptions(quiet=False, **options),
            label="toy",
        )
    except ReachmapError as error:
        print("\n".join(error.lines), file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt as error:
        print(error, file=sys.stderr)
        return 130
    print(outcome.computed, outcome.resumed)
    return 0


if __name__ == "__main__":
    # Workers must find the functions under the same module name.
    from tests.support import toy_work as this

    sys.exit(this.main())
