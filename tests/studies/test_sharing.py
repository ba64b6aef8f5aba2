"""What variants share: a result taken over is that of a run from scratch, or none."""

from __future__ import annotations

import json
import tempfile
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reachmap.cell.loading import LoadedCell, read_cell
from reachmap.core import trace
from reachmap.core.memo import Memo, fingerprint, memoized, memoized_part
from reachmap.core.scene import Scene
from reachmap.core.trace import EVERY, FREE, Trace
from reachmap.tools import variant
from tests.studies.test_study import HEIGHT, RADIUS, SMALL

PLACED = (*SMALL, "placement.z=[-0.2,-0.2]")
# As few frames as place a bin.
FEW = (
    "workspace_scan.cubes.0.grid=[7,4]",
    "workspace_scan.repeats=1",
    "bin_scan.grid=[2,2]",
    "bin_scan.repeats=1",
)
OBJECTIVES = ("level_average", "bin_reachability", "path_length_rad")


def toy(*changes: str) -> LoadedCell:
    """The planar toy with some changes."""
    return read_cell("planar-toy", [*PLACED, *changes])


def computed(loaded: LoadedCell) -> dict[str, Any]:
    """One variant with its bin placed: three maps and what they come to."""
    workspace = variant.map_workspace(None, loaded)
    context = variant.VariantContext(
        objectives=OBJECTIVES, places_bin=True, workspaces=[workspace]
    )
    unit = variant.VariantUnit(loaded=loaded, workspace=0)
    return variant.compute_variant(context, unit)


@pytest.fixture
def memo(monkeypatch: pytest.MonkeyPatch) -> Memo:
    """An empty memo in the place of that of the process."""
    fresh = Memo()
    monkeypatch.setattr(variant, "_MEMO", fresh)
    return fresh


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "is_shared"),
    [
        # Above and below the plane of the arm nothing of it is met.
        (f"{HEIGHT}=0.14", True),
        # Where it stands matters to link 1, at angles that were asked about.
        (f"{RADIUS}=0.012", False),
        ("bodies.post.pose.xyz=[0.055,0.03,0]", False),
    ],
)
def test_maps_with_shared_work_are_those_from_scratch(
    memo: Memo, monkeypatch: pytest.MonkeyPatch, change: str, is_shared: bool
) -> None:
    """Hashes and outcomes are equal, whether all, some or no work is taken over."""
    computed(toy())
    before = memo.computed
    shared = computed(toy(change))
    assert (memo.computed - before < 0.1 * before) == is_shared
    monkeypatch.setattr(variant, "_MEMO", Memo())
    alone = computed(toy(change))
    assert shared["sha256"] == alone["sha256"]
    assert set(shared["sha256"]) == {"workspace", "placement", "bin"}
    for name, outcome in alone["outcomes"].items():
        for field, value in outcome.items():
            assert np.array_equal(shared["outcomes"][name][field], value, True)


def test_maps_do_not_depend_on_where_the_camera_looks_from(
    memo: Memo, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the bin is kept, another camera takes all work over; hashes are equal."""
    context = variant.VariantContext(
        objectives=OBJECTIVES, places_bin=False, workspaces=[]
    )

    def mapped(height_m: float) -> dict[str, Any]:
        camera = {"parent": "link_3", "xyz": [0, 0, height_m], "range_m": [0.1, 1.0]}
        camera["field_of_view_deg"] = [60, 40]
        loaded = toy(*FEW, f"camera={json.dumps(camera)}")
        return variant.compute_proposal(
            context, variant.Proposal(row={"cause": ""}, loaded=loaded)
        )

    first = mapped(0.10)
    before = memo.computed
    shared = mapped(0.12)
    assert memo.computed == before > 0
    monkeypatch.setattr(variant, "_MEMO", Memo())
    alone = mapped(0.12)
    assert not alone["cause"]
    assert shared["sha256"] == alone["sha256"]
    assert set(alone["sha256"]) == {"workspace", "bin"}
    for name in alone["sha256"]:
        assert first["sha256"][name] != alone["sha256"][name]


def test_a_bin_is_placed_without_files(
    memo: Memo, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A study that is killed leaves nothing, since its variants write nothing."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "missing"))
    monkeypatch.chdir(tmp_path)
    found = computed(toy(*FEW))
    assert not found["cause"]
    assert set(found["sha256"]) == {"workspace", "placement", "bin"}
    assert not [*tmp_path.iterdir()]


def test_what_differs_otherwise_is_never_shared(memo: Memo) -> None:
    """Another tool, seed or joint limit is another key."""
    texts = {
        fingerprint(toy(change), surroundings=False)
        for change in (
            "seed=1",
            "seed=2",
            "robot.tcp.xyz.0=0.11",
            "robot.limits.velocity_rad_s=1",
            "collision.safety_margin_m=0.001",
            "bodies.post.touch=[link_1]",
        )
    }
    assert len(texts) == 6
    assert fingerprint(toy(), surroundings=False) == fingerprint(
        toy(f"{RADIUS}=0.02", "bodies.post.pose.xyz=[1,1,1]"), surroundings=False
    )
    assert fingerprint(toy()) != fingerprint(toy(f"{RADIUS}=0.02"))


def asked(scene: Scene, Q: np.ndarray) -> list[bool]:
    """Some computation: what it returns depends on nothing but the answers."""
    return [scene.checker.is_free(q) for q in Q]


def test_answers_are_asked_again_near_what_changed() -> None:
    """Random bodies beside the arm: taken over exactly where all answers agree."""
    rng = np.random.default_rng(0)
    Q = rng.uniform(-3.0, 3.0, (40, 3))
    memo = Memo()
    truth: set[tuple[bool, ...]] = set()
    with memo.active():
        for k in range(12):
            x, y = rng.uniform(-0.5, 0.5, 2).round(3) if k else (0.06, 0.0)
            loaded = toy(f"bodies.post.pose.xyz=[{x},{y},0]")
            scene = Scene.build(loaded, with_bin=False)
            with_memo = memoized("k", scene, partial(asked, scene, Q))
            # Budgets are counted in checks: those that only compare are not among them.
            assert scene.checker.checks == len(Q)
            assert with_memo == asked(scene, Q)
            truth.add(tuple(with_memo))
    # A body that is in the way nowhere gives what another one like it has given.
    assert memo.computed >= len(truth) > 1
    assert memo.found + memo.computed == 12


def in_parts(scene: Scene, Q: np.ndarray) -> list[bool]:
    """The same, each quarter as a part that is kept by itself."""
    quarters = np.split(Q, 4)
    parts = [memoized_part("q", partial(asked, scene, R), R) for R in quarters]
    return [answer for part in parts for answer in part]


def test_parts_are_asked_again_with_the_whole() -> None:
    """What rests on a part rests on its answers; parts far from a change are kept."""
    rng = np.random.default_rng(1)
    Q = rng.uniform(-3.0, 3.0, (40, 3))
    memo, kept = Memo(), 0
    with memo.active():
        for k in range(12):
            x, y = rng.uniform(-0.5, 0.5, 2).round(3) if k else (0.06, 0.0)
            loaded = toy(f"bodies.post.pose.xyz=[{x},{y},0]")
            scene = Scene.build(loaded, with_bin=False)
            before, whole_before = memo.found, memo.computed
            with_memo = memoized("k", scene, partial(in_parts, scene, Q))
            assert scene.checker.checks == len(Q)
            assert with_memo == asked(scene, Q)
            if memo.computed > whole_before:
                kept += memo.found - before
    assert kept > 0


def test_one_body_is_asked_about_by_itself() -> None:
    """For many configurations at once: what is in the way is what single checks name.

    Rung by rung, the bodies of the world come to what a check of all pairs says.
    """
    checker = Scene.build(read_cell("ur5-eye-in-hand"), with_bin=False).checker
    robot = checker.robot
    Q = np.random.default_rng(4).uniform(robot.lower_rad, robot.upper_rad, (300, 6))
    named = [{checker.body_pairs[k] for k in checker.touching_pairs(q)} for q in Q]
    for name in ("pedestal", "floor", "back structure"):
        expected = [any(name in pair.split(" | ") for pair in pairs) for pairs in named]
        assert 0 < sum(expected) < len(Q)
        assert checker.touched_mask(FREE, Q, name, EVERY).tolist() == expected
        moving = range(len(checker.bound.on_chain))
        for about in (FREE, 0, 4):
            each = [
                checker.touched_mask(about, Q, name, body)
                for body in checker.bodies_against(name) or moving
            ]
            together = checker.touched_mask(about, Q, name, EVERY)
            assert np.array_equal(np.any(each, axis=0), together)
            clear = np.array([checker.asked(about, q) for q in Q])
            assert not (together & clear).any()


def test_questions_to_another_checker_are_not_taken_over() -> None:
    """A trace that is not whole says nothing; the result is computed each time."""
    scene, other = (Scene.build(toy(), with_bin=b) for b in (False, True))
    memo, q = Memo(), np.zeros(3)
    with memo.active():
        for _ in range(2):
            memoized("k", scene, lambda: other.checker.is_free(q))
    assert (memo.found, memo.computed) == (0, 2)
    assert Trace.current is None


def test_the_oldest_results_are_forgotten() -> None:
    """What a process keeps has a bound in questions."""
    scene, q = Scene.build(toy(), with_bin=False), np.zeros(3)
    memo = Memo(most_questions=3)
    with memo.active():
        for key in ("a", "b", "c", "d", "a", "d"):
            memoized(key, scene, lambda: scene.checker.is_free(q))
    assert (memo.found, memo.computed) == (1, 5)


def test_a_computation_that_asks_very_much_is_not_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its questions take no room, and its result is computed each time."""
    monkeypatch.setattr(trace, "MOST_QUESTIONS", 3)
    scene, memo = Scene.build(toy(), with_bin=False), Memo()
    Q = np.zeros((4, 3))
    with memo.active():
        for _ in range(2):
            memoized("few", scene, partial(asked, scene, Q[:3]))
            memoized("many", scene, partial(asked, scene, Q))
    assert (memo.found, memo.computed) == (1, 3)
