"""Heaps and picking them: geometry by brute force, order and words by counting."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from click.testing import CliRunner

from reachmap.cell.model.bodies import BinSpec
from reachmap.cli import group
from reachmap.maps import read_bin_map, write_bin_map
from reachmap.picking.emptying import ALONG, Fate, empty_heap, place_of
from reachmap.picking.heap import Heap, drop_heap
from reachmap.ranking.lookup.ranker import Ranker
from reachmap.tools.empty import empty, part_costs
from tests.support.synthetic_maps import synthetic_bin_map

BIN = BinSpec(inner=(0.4, 0.3, 0.2))
PART = (0.06, 0.04, 0.02)


def a_heap(heights, above):
    """Parts at heights, each with those that cover it."""
    count = len(heights)
    position = np.column_stack([np.zeros((count, 2)), heights])
    return Heap(
        position=position,
        normal=np.tile([0.0, 0.0, 1.0], (count, 1)),
        above=tuple(np.array(parts, np.int64) for parts in above),
        outline=np.zeros((count, 4, 2)),
    )


def test_parts_lie_in_the_bin_and_on_each_other():
    """Tops between one thickness above the bottom and the rim; none is too steep."""
    heap = drop_heap(BIN, PART, 0.8, seed=4)
    assert len(heap) > 100
    assert (np.abs(heap.position[:, :2]) < np.array([0.2, 0.15])).all()
    assert heap.position[:, 2].min() >= min(PART) - 1e-9
    assert heap.position[:, 2].max() <= 0.2
    np.testing.assert_allclose(np.linalg.norm(heap.normal, axis=1), 1.0)
    assert heap.normal[:, 2].min() > 0.8
    for part, parts in enumerate(heap.above):
        assert (parts > part).all()


def room_around(outline, point):
    """Least distance of a point from the sides of a rectangle; negative outside."""
    sides = np.roll(outline, -1, axis=0) - outline
    inwards = np.column_stack([-sides[:, 1], sides[:, 0]])
    inwards /= np.linalg.norm(inwards, axis=1, keepdims=True)
    return float(((point - outline) * inwards).sum(axis=1).min())


def test_a_part_whose_middle_is_hidden_waits():
    """For all that lie over it, by all pairs."""
    heap, waiting = drop_heap(BIN, (0.03, 0.03, 0.03), 0.8, seed=2), 0
    for part, position in enumerate(heap.position):
        over = [
            later
            for later in range(part + 1, len(heap))
            if room_around(heap.outline[later], position[:2]) > 1e-9
        ]
        assert set(over) <= {*heap.above[part].tolist()}
        waiting += len(over) > 0
    assert waiting > 150


def test_what_covers_a_part_lies_over_it():
    """No part waits for one that is nowhere near, or lower."""
    heap = drop_heap(BIN, PART, 0.8, seed=5)
    for part, parts in enumerate(heap.above):
        away = heap.position[parts, :2] - heap.position[part, :2]
        # Farther apart than two half diagonals they cannot touch.
        assert (np.hypot(*away.T) <= np.hypot(PART[0], PART[1])).all()
        assert (heap.position[parts, 2] > heap.position[part, 2] - max(PART)).all()


def test_the_bottom_layer_of_a_shallow_heap_is_flat():
    """The first parts lie on the bottom, their tops one side above it."""
    heap = drop_heap(BIN, (0.1, 0.1, 0.05), 0.05, seed=1)
    first = heap.position[0, 2]
    assert min(abs(first - side) for side in (0.1, 0.05)) < 1e-9
    np.testing.assert_allclose(heap.normal[0], [0, 0, 1])


def test_the_seed_decides_the_heap():
    """Same seed, same heap."""
    a, b, c = (drop_heap(BIN, PART, 0.5, seed=s) for s in (7, 7, 8))
    np.testing.assert_array_equal(a.position, b.position)
    assert a.position.shape != c.position.shape or (a.position != c.position).any()


def test_too_large_a_part_fits_nowhere():
    """A part as long as the bin's diagonal."""
    assert len(drop_heap(BIN, (0.6, 0.5, 0.3), 0.5, seed=1)) == 0


def test_a_part_below_one_that_stays_stays():
    """Part 0 lies below 1, which is not reached; 2 lies below 3, which is."""
    heap = a_heap([0.02, 0.04, 0.02, 0.05, 0.03], [[1], [], [3], [], []])
    cost = np.array([1.0, np.inf, 1.0, 1.0, 0.5])
    done = empty_heap(heap, cost)
    wanted = [Fate.COVERED, Fate.UNREACHABLE, Fate.PICKED, Fate.PICKED, Fate.PICKED]
    assert done.fate.tolist() == [int(fate) for fate in wanted]
    assert done.turn.tolist() == [-1, -1, 2, 0, 1]
    assert empty_heap(heap, cost, "rank").turn.tolist() == [-1, -1, 2, 1, 0]


def test_what_can_be_picked_does_not_depend_on_the_order():
    """Picking only ever frees parts, so both orders end alike."""
    heap = drop_heap(BIN, PART, 0.8, seed=9)
    rng = np.random.default_rng(2)
    cost = np.where(rng.random(len(heap)) < 0.8, rng.random(len(heap)), np.inf)
    a, b = (empty_heap(heap, cost, order) for order in ("highest", "rank"))
    np.testing.assert_array_equal(a.fate, b.fate)
    assert sorted(a.turn[a.turn >= 0]) == [*range(int((a.fate == 0).sum()))]
    for part, parts in enumerate(heap.above):
        if a.turn[part] >= 0:
            assert (a.turn[parts] >= 0).all()
            assert (a.turn[parts] < a.turn[part]).all()


def test_where_parts_remain_is_told_against_where_parts_lie(bin_map):
    """Of parts all over a bin most lie near a wall; the walls count if they differ."""
    record = read_bin_map(bin_map)
    across = np.linspace(-0.95, 0.95, 20)
    x, y = np.meshgrid(*(across * side / 2 for side in record.bin_inner[:2]))
    place = np.column_stack([x.ravel(), y.ravel()])
    heap = dataclasses.replace(
        a_heap(np.zeros(len(place)), [[]] * len(place)),
        position=np.column_stack([place, np.full(len(place), 0.02)]),
    )
    edge = (np.abs(place) / (record.bin_inner[:2] / 2)).max(axis=1)
    rng = np.random.default_rng(1)
    assert (edge >= ALONG).mean() > 0.6
    everything = np.ones(len(place), bool)
    assert place_of(record, heap, everything) == "all over the bin"
    assert place_of(record, heap, rng.random(400) < 0.3) == "all over the bin"
    assert place_of(record, heap, edge > 0.7) == "around the walls"
    assert place_of(record, heap, edge < 0.5) == "in the middle"
    assert place_of(record, heap, ~everything) == ""


@pytest.fixture
def bin_map(tmp_path):
    """The shipped cell's tray, 50 mm deep, reached but for its far side (+x)."""
    found = np.ones((1, 6, 8, 27, 1), bool)
    found[:, :, 6:] = False
    path = tmp_path / "bin.h5"
    write_bin_map(path, synthetic_bin_map(found))
    return path


def test_what_stays_is_counted_and_named(bin_map):
    """Parts beyond the reached columns stay; of those that the map knows, only they."""
    answer = empty(bin_map, part=(0.03, 0.02, 0.01), heaps=2, seed=3)
    record = read_bin_map(bin_map)
    edge = float(record.x[5:7].mean())
    for one in answer.heaps:
        _, outside = part_costs(Ranker(record), record, one.heap)
        x = one.heap.position[:, 0]
        reached = np.isfinite(one.cost)
        assert x[reached].max() < edge
        assert x[~reached & ~outside].min() > edge
        s = one.summary
        assert s.parts == s.picked + s.unreachable + s.covered
        assert s.unreachable > 0
    again = empty(bin_map, part=(0.03, 0.02, 0.01), heaps=2, seed=3)
    assert again.facts(with_parts=True) == answer.facts(with_parts=True)


def test_between_directions_most_of_those_around_decide(bin_map):
    """A part that leans as an unreached direction among reached ones does, or nearly.

    On that direction it is not reached; where the others are as near, it is, though the
    nearest test grasp, by brute force, still is the unreached one.
    """
    table = Ranker(read_bin_map(bin_map)).table
    axes = table.axes[0] @ table.T_bin_base[:3, :3].T
    lost = int(np.argmin(np.abs(-axes[:, 2] - np.cos(np.radians(20)))))
    found = np.ones((*table.shape, 1), bool)
    found[..., lost, :] = False
    path = bin_map.with_name("lost.h5")
    write_bin_map(path, synthetic_bin_map(found))
    record = read_bin_map(path)
    middle = np.array([0.0, 0.0, record.layer[0]])
    near = np.argsort(-axes @ axes[lost])[1:4]
    # From the lost direction to the middle of three around it, as far as it is nearest.
    lines = axes[lost] + np.linspace(0, 1, 400)[:, None] * (
        axes[near].mean(axis=0) - axes[lost]
    )
    nearest = np.argmax(lines @ axes.T, axis=1)
    leaning = lines[np.flatnonzero(nearest == lost)[-1]]
    approach = np.array([axes[lost], leaning / np.linalg.norm(leaning)])
    heap = Heap(
        position=np.tile(middle, (2, 1)),
        normal=-approach,
        above=(np.zeros(0, np.int64),) * 2,
        outline=np.zeros((2, 4, 2)),
    )
    cost, outside = part_costs(Ranker(record), record, heap)
    assert np.isfinite(cost).tolist() == [False, True]
    assert not outside.any()


def test_outlines_are_rectangles_about_the_tops():
    """Their middle is the part's, their sides two of the part's, turned anyhow."""
    heap = drop_heap(BIN, PART, 0.5, seed=2)
    np.testing.assert_allclose(heap.outline.mean(axis=1), heap.position[:, :2])
    along = np.diff(heap.outline, axis=1)
    np.testing.assert_allclose((along[:, 0] * along[:, 1]).sum(axis=-1), 0, atol=1e-12)
    lengths = np.linalg.norm(along[:, :2], axis=-1)
    assert {tuple(sorted(pair)) for pair in lengths.round(6).tolist()} == {
        (0.02, 0.04),
        (0.02, 0.06),
        (0.04, 0.06),
    }


def test_parts_may_be_round_or_meshes_and_what_stays_is_drawn(bin_map, tmp_path):
    """The box around a cylinder, and around a mesh, give the same heaps as that box."""
    mesh = tmp_path / "part.obj"
    corners = [(x, y, z) for x in (0, 20) for y in (0, 20) for z in (0, 50)]
    mesh.write_text(
        "".join(f"v {x / 1e3} {y / 1e3} {z / 1e3}\n" for x, y, z in corners)
        + "f 1 2 3\nf 4 5 6\nf 6 7 8\n"
    )
    picture = tmp_path / "stays.png"
    facts = [
        json.loads(
            CliRunner()
            .invoke(group, ["empty", str(bin_map), "--json", "--part", part, *more])
            .stdout
        )
        for part, more in (
            ("20x20x50mm", []),
            ("d20x50mm", ["--picture", str(picture)]),
            (str(mesh), []),
        )
    ]
    assert facts[0] == facts[1]
    assert facts[2]["part_m"] == pytest.approx(facts[0]["part_m"])
    assert facts[2]["heaps"] == facts[0]["heaps"]
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_the_command_says_it_in_words_and_numbers(bin_map, tmp_path):
    """Table, JSON and the file agree; what the map does not know is on stderr."""
    words = ["empty", str(bin_map), "--part", "30x20x10mm", "--seed", "3"]
    out = tmp_path / "parts.json"
    said = CliRunner().invoke(group, [*words, "-o", str(out)])
    assert said.exit_code == 0, said.output
    assert "parts below the picked one are not" in said.stderr
    facts = json.loads(CliRunner().invoke(group, [*words, "--json"]).stdout)
    assert f"{facts['picked']} of {facts['parts']} parts picked" in said.stdout
    each = [
        part for heap in json.loads(out.read_text())["heaps"] for part in heap["each"]
    ]
    assert len(each) == facts["parts"]
    assert sum(part["fate"] == "picked" for part in each) == facts["picked"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "its cell has no part"),
        (["--part", "30x20mm"], "three sides and a unit"),
        (["--part", "30x20x10mm", "--fill", "1.5"], "--fill must be"),
        (["--part", "3x2x1m"], "not a single one of 3000 x 2000 x 1000 mm fits"),
        (["--part", "0x20x10mm"], "sides must be positive"),
        (["--part", "1x1x1mm"], "more than 20000"),
        (["--part", "d20mm"], "a cylinder, d30x80mm"),
        (["--part", "none.stl"], "--part none.stl: No such file"),
        (["--part", "part.step"], "--part part.step: No such file"),
        (["--part", "30x20x10mm", "--picture", "a.pdf"], "--picture a.pdf"),
    ],
)
def test_wrong_parts_are_refused(bin_map, words, message):
    """One line, exit code 2."""
    answer = CliRunner().invoke(group, ["empty", str(bin_map), *words])
    assert answer.exit_code == 2
    assert message in answer.stderr
