"""The fuzzer's targets: what is right is read, and a few mutants are survived."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from tests.fuzz.readers import TARGETS, attempt, seeds, workplace

TOKENS = (
    b"\0", b"\xff", b"[", b"{", b'"', b": ", b"\n", b"-", b"1e999", b"nan", b"9" * 40,
    b"<", b"/>", b"&", b"!!python/name:x", b"*a", b"\xed\xa0\x80", b"package://",
    b"../",
)  # fmt: skip


def mutant(data: bytes, rng: random.Random) -> bytes:
    """The input with a few bytes flipped, dropped, doubled or put in."""
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 5))):
        at = rng.randrange(len(changed) + 1)
        length = rng.randint(1, 40)
        kind = rng.randrange(4)
        if kind == 0 and at < len(changed):
            changed[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            del changed[at : at + length]
        elif kind == 2:
            changed[at:at] = rng.choice(TOKENS)
        else:
            changed[at:at] = changed[at : at + length] * rng.choice((1, 1, 1, 50))
    return bytes(changed)


@pytest.mark.parametrize("name", TARGETS)
def test_seeds_are_read(name: str, tmp_path: Path) -> None:
    """What the fuzzer begins with is right, so that it gets past the front door."""
    workplace(tmp_path)
    for seed in seeds(name):
        TARGETS[name](seed, tmp_path)


@pytest.mark.parametrize("name", TARGETS)
def test_mutants_are_survived(name: str, tmp_path: Path) -> None:
    """A handful at every run; `make fuzz` tries them by the ten thousands."""
    workplace(tmp_path)
    rng = random.Random(name)
    for _ in range(8 if name == "hdf5" else 40):
        attempt(name, mutant(rng.choice(seeds(name)), rng), tmp_path)
