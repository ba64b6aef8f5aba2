"""The lock file covers the dependencies, names no host, and floors are stated."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
LOCK = (ROOT / "requirements.lock").read_text()
EXTRAS = PROJECT["optional-dependencies"]
DIRECT = [
    *PROJECT["dependencies"],
    *(text for extra in ("xacro", "view", "dask", "xarray") for text in EXTRAS[extra]),
]


def locked(name: str) -> list[Requirement]:
    """Versions of a package in the lock file, for one Python or another."""
    lines = [line.removesuffix("\\").strip() for line in LOCK.splitlines()]
    found = [Requirement(line) for line in lines if re.match(r"[a-z0-9].*==", line)]
    return [item for item in found if item.name == canonicalize_name(name)]


@pytest.mark.parametrize("text", DIRECT)
def test_every_dependency_is_locked_within_its_bounds(text: str) -> None:
    """`make lock` was run after the bounds were changed."""
    wanted = Requirement(text)
    versions = [next(iter(item.specifier)).version for item in locked(wanted.name)]
    assert versions
    assert all(wanted.specifier.contains(version) for version in versions)


def test_every_locked_package_has_hashes_and_no_place() -> None:
    """Where packages come from is left to whoever installs them."""
    entries = re.split(r"\n(?=[a-z0-9])", LOCK)[1:]
    assert len(entries) > 50
    assert all("--hash=sha256:" in entry for entry in entries)
    assert not re.search(r"://|--index|--find-links|--extra", LOCK)


@pytest.mark.parametrize(
    "text", [*PROJECT["dependencies"], *(t for e in EXTRAS.values() for t in e)]
)
def test_every_dependency_has_a_floor(text: str) -> None:
    """`make test-lowest` tests that it is low enough, `make test` that it is not."""
    wanted = Requirement(text)
    floors = {item.operator for item in wanted.specifier}
    assert wanted.name == PROJECT["name"] or ">=" in floors
