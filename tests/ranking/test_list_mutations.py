"""Damaged grasp lists end in a list or in a clean error, never in anything else."""

from __future__ import annotations

import io
import json
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reachmap.errors import GraspListError
from reachmap.ranking import (
    RankedList,
    Ranker,
    document_text,
    rank_list,
    ranked_document,
)
from reachmap.ranking.lists.reading import read_grasps
from tests.support.ranking_maps import make_bin_map

EXAMPLES = Path(__file__).parents[2] / "examples"
RANKER = Ranker(make_bin_map(shape=(1, 2, 3)))
ODD: list[Any] = [
    None, True, False, 0, -1, 1e308, -1e308, 5e-324, 10**30, 10**400, "", "NaN", "bin",
    "\ud800", "\n", "+z", "mm", [], {}, [[]], [1, 2], [0, 0, 1], [1, 0, 0, 0],
    {"length": "mm"}, [[1, 0, 0], [0, 1, 0], [0, 0, 1]], {"position": [0, 0, 0]},
    "1.0", 3.5, [None] * 3,
]  # fmt: skip
KEYS = [
    "format", "format_version", "frame", "units", "approach_axis", "bin_pose", "source",
    "direction_convention", "grasps", "id", "position", "direction", "quaternion_wxyz",
    "quaternion_xyzw", "rotation_matrix", "score", "quadrant", "width", "object_id",
    "x_", "reachmap", "transforms",
]  # fmt: skip
TOKENS = ["NaN", "Infinity", "-Infinity", "1e999", "null", "{", "}", "[", "]", ",", ":",
          '"', "\\u0000", "\\ud800", "-", "0x1", "'", "\n", "\x00", "é"]  # fmt: skip


def seeds():
    """Small valid lists of every format."""
    pile = json.loads((EXAMPLES / "pile-1.json").read_text())
    grasps = pile["grasps"][:4]
    grasps.append({"position": [0, 0, 0.05], "quaternion_wxyz": [0, 1, 0, 0]})
    grasps.append({"position": [0, 0, 0.05], "score": 1, "width": 0.1, "id": 7,
                   "rotation_matrix": [[1, 0, 0], [0, -1, 0], [0, 0, -1]]})  # fmt: skip
    native = {
        **pile,
        "grasps": grasps,
        "x_note": [1],
        "bin_pose": {"position": [0, 0, 0]},
    }
    graspgen = {"grasps": {"transforms": [np.eye(4).tolist()] * 2,
                           "object_in_gripper": [True, False]}}  # fmt: skip
    isaac = (
        "format: isaac_grasp\nformat_version: 1.0\ngrasps:\n  a:\n    confidence: 0.5\n"
        "    position: [0, 0, 0.05]\n    orientation: {w: 0.0, xyz: [1.0, 0, 0]}\n"
    )
    rows = np.array([[0.5, 0, 0, 1.0, 0.05, 0.02, 0.05]] * 3)
    npy, npz = io.BytesIO(), io.BytesIO()
    np.save(npy, rows)
    np.savez(npz, rows)
    return [
        json.dumps(native).encode(),
        json.dumps(native, indent=1).encode(),
        json.dumps(graspgen).encode(),
        isaac.encode(),
        npy.getvalue(),
        npz.getvalue(),
    ]


def mutated_value(value, rng):
    """The JSON value with one part of it changed."""
    if isinstance(value, dict) and value and rng.random() < 0.85:
        key = rng.choice(list(value))
        kind = rng.random()
        if kind < 0.15:
            return {k: v for k, v in value.items() if k != key}
        if kind < 0.3:
            return {**value, rng.choice(KEYS): rng.choice(ODD)}
        return {**value, key: mutated_value(value[key], rng)}
    if isinstance(value, list) and value and rng.random() < 0.85:
        place = rng.randrange(len(value))
        kind = rng.random()
        if kind < 0.1:
            return value[:place] + value[place + 1 :]
        if kind < 0.2:
            return [*value, rng.choice(ODD)]
        return [*value[:place], mutated_value(value[place], rng), *value[place + 1 :]]
    return rng.choice(ODD)


def mutated_bytes(data, rng):
    """The file with some of its bytes flipped, cut out, doubled or put in."""
    data = bytearray(data)
    for _ in range(rng.randint(1, 3)):
        place = rng.randrange(len(data) + 1)
        kind = rng.randrange(5)
        if kind == 0 and place < len(data):
            data[place] ^= 1 << rng.randrange(8)
        elif kind == 1:
            del data[place : place + rng.randint(1, 30)]
        elif kind == 2:
            data[place:place] = rng.choice(TOKENS).encode("utf-8", "surrogatepass")
        elif kind == 3:
            data[place:place] = data[place : place + rng.randint(1, 60)]
        elif data:
            del data[place:]
    return bytes(data)


def outcome(path, content):
    """The ranked list, or None for a clean error, or an error that is not clean."""
    path.write_bytes(content)
    imported = None if content.lstrip()[:1] == b"{" else "bin"
    try:
        try:
            grasps = read_grasps(path, frame=imported)
        except GraspListError as error:
            if "say with --frame" not in str(error):
                raise
            grasps = read_grasps(path, frame="bin")
        ranked = rank_list(grasps, RANKER)
    except GraspListError as error:
        clean = all(line and "\n" not in line for line in error.lines)
        return None if clean and len(error.lines) <= 21 else error
    document = ranked_document(ranked)
    again = json.loads(document_text(document), parse_constant=pytest.fail)
    assert len(again["grasps"]) == len(grasps)
    return ranked


def mutate_many(tmp_path, count, seed):
    """Number of mutated lists that were read and that were refused."""
    rng = random.Random(seed)
    path, files = tmp_path / "list", seeds()
    outcomes = [0, 0]
    for content in files:
        assert isinstance(outcome(path, content), RankedList)
    for _ in range(count):
        content = rng.choice(files)
        if content[:1] == b"{" and rng.random() < 0.6:
            value = json.loads(content)
            for _ in range(rng.randint(1, 3)):
                value = mutated_value(value, rng)
            content = json.dumps(value).encode()
        else:
            content = mutated_bytes(content, rng)
        result = outcome(path, content)
        assert not isinstance(result, Exception), result
        outcomes[result is not None] += 1
    return outcomes


def test_mutated_lists(tmp_path):
    """400 damaged lists of all formats: each is ranked or refused in one clean way."""
    refused, read = mutate_many(tmp_path, 400, seed=1)
    assert refused > 100
    assert read > 20


@pytest.mark.slow
def test_many_mutated_lists(tmp_path):
    """8,000 damaged lists of all formats: each is ranked or refused cleanly."""
    refused, read = mutate_many(tmp_path, 8000, seed=2)
    assert refused > 2000
    assert read > 400
