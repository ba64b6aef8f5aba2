"""Canonical forms, and hashes against a direct transcription of their definition."""

import dataclasses
import hashlib
import json
from typing import Any

import numpy as np
import pytest

from reachmap.maps import canonical_json, config_sha256
from reachmap.maps.bytes.tree import (
    Leaf,
    Tree,
    canonical_array,
    content_sha256,
    integrity_sha256,
)
from reachmap.maps.format.placement import tree_from_placement
from reachmap.maps.format.workspace import tree_from_workspace_map
from tests.support.synthetic_maps import synthetic_placement, synthetic_workspace_map

FACTS: dict[str, Any] = {
    "kind": "bin_map",
    "cell_sha256": "c" * 64,
    "seed": 1,
    "settings": {"repeats": 5, "planner": {"name": "LBKPIECE1", "range_rad": 0.5}},
    "method": "roadmap",
    "source_sha256": "e" * 64,
}


def test_every_fact_changes_the_config_hash() -> None:
    """Kind, cell, seed, each setting, method and source all count."""
    changes: list[dict[str, Any]] = [
        {},
        {"kind": "workspace_map"},
        {"cell_sha256": "d" * 64},
        {"seed": 2},
        {"settings": {**FACTS["settings"], "repeats": 4}},
        {"settings": {**FACTS["settings"], "planner": {"name": "LBKPIECE1"}}},
        {"method": "per-frame"},
        {"source_sha256": ""},
    ]
    hashes = {config_sha256(**{**FACTS, **change}) for change in changes}
    assert len(hashes) == len(changes)


def test_the_config_hash_is_that_of_sorted_compact_json() -> None:
    """Anyone can compute it; the order in which settings are given does not matter."""
    text = json.dumps(FACTS, sort_keys=True, separators=(",", ":"))
    assert config_sha256(**FACTS) == hashlib.sha256(text.encode()).hexdigest()
    turned = dict(reversed(FACTS["settings"].items()))
    assert config_sha256(**{**FACTS, "settings": turned}) == config_sha256(**FACTS)


def test_numpy_values_hash_like_plain_ones() -> None:
    """A setting that went through an array is the same setting."""
    settings = {
        "repeats": np.int64(5),
        "planner": {"name": np.str_("LBKPIECE1"), "range_rad": np.float64(0.5)},
    }
    assert config_sha256(**{**FACTS, "settings": settings}) == config_sha256(**FACTS)


@pytest.mark.parametrize(
    ("value", "error"),
    [(float("nan"), ValueError), (float("inf"), ValueError), (object(), TypeError)],
)
def test_what_has_no_canonical_form_is_refused(
    value: Any, error: type[Exception]
) -> None:
    """NaN, infinity and objects never enter a hash."""
    with pytest.raises(error, match=r"JSON|no plain form"):
        canonical_json({"a": value})


def test_one_bit_pattern_per_number() -> None:
    """NaN with another payload, -0 and another byte order are the same numbers."""
    payload = np.frombuffer(b"\x01\0\0\0\0\0\xf8\xff", "<f8")[0]
    odd = np.array([payload, -0.0, 1.5]).astype(">f8")
    plain = np.array([np.nan, 0.0, 1.5])
    assert canonical_array(odd).tobytes() == plain.tobytes()
    strided = np.arange(12, dtype="<i4").reshape(3, 4).T
    assert canonical_array(strided).tobytes() == strided.copy(order="C").tobytes()


def test_the_content_hash_is_what_the_reference_page_says() -> None:
    """A transcription of the definition, step by step, gives the same digest."""
    tree = tree_from_workspace_map(synthetic_workspace_map(np.full((1, 2, 2), 0.5)))
    digest = hashlib.sha256()
    kept = {
        key: value.item() if isinstance(value, np.generic) else value
        for key, value in tree.attributes.items()
        if key not in ("content_sha256", "integrity_sha256")
    }
    text = json.dumps(kept, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    digest.update(f'attributes "" {text}\n'.encode())
    for path in sorted(tree.leaves):
        if not path.startswith(("run/", "provenance/")):
            leaf = tree.leaves[path]
            value = np.asarray(leaf.value)
            if value.dtype.kind == "U":
                texts = [path, list(leaf.dims), value.tolist()]
                digest.update(f"texts {json.dumps(texts)}\n".encode())
                continue
            header = [path, list(leaf.dims), value.dtype.str, list(value.shape)]
            digest.update(f"array {json.dumps(header)}\n".encode())
            if value.dtype.kind == "f":
                value = np.where(np.isnan(value), np.nan, value + 0.0)
            digest.update(value.tobytes())
    assert tree.attributes["content_sha256"] == digest.hexdigest()


def test_the_order_of_variables_does_not_matter() -> None:
    """Hashes are over sorted paths, so a repacked file keeps them."""
    tree = tree_from_placement(synthetic_placement())
    turned = dataclasses.replace(tree, leaves=dict(reversed(tree.leaves.items())))
    assert content_sha256(turned) == content_sha256(tree)
    assert integrity_sha256(turned) == integrity_sha256(tree)


@pytest.mark.parametrize(
    "leaf",
    [
        Leaf(value=np.array([1.0, 2.0]), dims=("a",)),
        Leaf(value=np.array([1.0, 2.0]), dims=("b",)),
        Leaf(value=np.array([[1.0, 2.0]]), dims=("b", "a")),
        Leaf(value=np.array([1, 2]), dims=("a",)),
        Leaf(value="12"),
    ],
)
def test_shape_type_and_dimensions_are_hashed(leaf: Leaf) -> None:
    """The same bytes under another shape, type or name are something else."""
    base = Tree(leaves={"x": Leaf(value=np.array([1.0, 2.0]), dims=("c",))})
    assert content_sha256(Tree(leaves={"x": leaf})) != content_sha256(base)
