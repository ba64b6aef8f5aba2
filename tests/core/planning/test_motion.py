"""Free motions, against very dense sampling on the meshes."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap._typing import FloatArray
from reachmap.core.planning.motion import MotionChecker
from reachmap.core.scene import Scene
from tests.support.dense_checks import dense_free
from tests.support.scenes import scene_of
from tests.support.small_cells import joint, link, load, robot


def random_motions(scene, count, seed, spread):
    """Motions between free configurations around the scan configuration."""
    rng = np.random.default_rng(seed)
    free: list[FloatArray] = []
    while len(free) < count + 1:
        q = scene.scan_configuration + rng.normal(0, spread, scene.robot.dof)
        if scene.checker.is_free(q):
            free.append(q)
    return list(zip(free[:-1], free[1:], strict=True))


@pytest.mark.parametrize("spread", [0.3, 0.8])
def test_a_verified_motion_is_free_wherever_one_looks(spread):
    """No verified motion collides at a third of the verification distance."""
    scene = scene_of("ur5-eye-in-hand")
    verified = [
        m for m in random_motions(scene, 80, 9, spread) if scene.motions.is_verified(*m)
    ]
    assert len(verified) >= 10
    assert scene.motions.is_proof
    for q_from, q_to in verified[:8]:
        assert dense_free(scene, q_from, q_to, margin_m=0.0)


def test_a_refused_motion_really_collides():
    """Every motion that fails to verify passes within the safety margin somewhere."""
    scene = scene_of("ur5-eye-in-hand")
    refused = [
        m
        for m in random_motions(scene, 120, 10, 0.8)
        if not scene.motions.is_verified(*m)
    ]
    assert len(refused) >= 10
    for q_from, q_to in refused[:8]:
        margin = scene.checker.safety_margin_m
        assert not dense_free(scene, q_from, q_to, margin_m=margin)


def test_the_post_is_never_jumped():
    """No motion of the toy arm that crosses the post's angle is free, however long."""
    scene = scene_of("planar-toy")
    rng = np.random.default_rng(11)
    for _ in range(200):
        q_from = np.array([rng.uniform(0.4, 3), *rng.uniform(-3, 3, 2)])
        q_to = np.array([rng.uniform(-3, -0.4), *rng.uniform(-3, 3, 2)])
        assert not scene.motions.is_verified(q_from, q_to)


def test_motions_on_one_side_of_the_post_are_free():
    """Motions of the toy arm within one half of its free space verify."""
    scene = scene_of("planar-toy")
    rng = np.random.default_rng(12)
    for _ in range(200):
        ends = np.column_stack([rng.uniform(0.4, 3, 2), rng.uniform(-3, 3, (2, 2))])
        assert scene.motions.is_verified(*ends)
        assert scene.motions.is_free(*ends)


@pytest.fixture(scope="module")
def carriages(tmp_path_factory):
    """Scenes of a cube of 4 mm on two slides, and a needle at a place along the way."""
    cube = '<box size="0.004 0.004 0.004"/>'
    slides = robot(
        link("world_link"),
        link("beam"),
        link("cube", f'xyz="0 0 0"|{cube}'),
        joint("x", "world_link", "beam", kind="prismatic", more='<axis xyz="1 0 0"/>'),
        joint("y", "beam", "cube", kind="prismatic", more='<axis xyz="0 1 0"/>'),
    )

    def with_needle_at(x_m: float) -> Scene:
        place = f"attach_to: world, pose: {{xyz: [{x_m}, 0, 0]}}"
        needle = f"{{name: needle, shape: {{box: [0.001, 0.001, 1]}}, {place}}}"
        folder = tmp_path_factory.mktemp("slides")
        loaded = load(folder, slides, "cube", ("x", "y"), [f"bodies=[{needle}]"])
        return Scene.build(loaded, with_bin=False)

    return with_needle_at


@pytest.mark.parametrize("seed", range(12))
def test_a_needle_anywhere_on_the_way_is_found(carriages, seed):
    """A motion passes a needle if the boxes, moved on paper, stay apart; only then."""
    rng = np.random.default_rng(seed)
    x_m = rng.uniform(0.05, 1.95)
    motions = carriages(x_m).motions
    assert motions.is_proof
    for offset_m in [0.0, *rng.uniform(-0.01, 0.01, 20)]:
        # Along a line that leaves the needle on one side, by this much in y.
        slope = rng.uniform(-0.3, 0.3)
        y_from = offset_m - slope * x_m
        q_from, q_to = np.array([0.0, y_from]), np.array([2.0, y_from + 2.0 * slope])
        # Half the sides of both boxes, and what the line climbs beside the needle.
        gap_m = abs(offset_m) - (0.002 + 0.0005) * (1.0 + abs(slope))
        way = np.linspace(q_from, q_to, 5)
        for verified in (
            motions.is_verified(q_from, q_to),
            motions.ways_are_verified([way])[0],
        ):
            if gap_m < 0.0:
                assert not verified
            elif gap_m > motions.checker.safety_margin_m:
                assert verified


def test_a_motion_of_no_length_is_its_configuration():
    """A motion from a configuration to itself is free when that is."""
    scene = scene_of("planar-toy")
    free, blocked = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.0])
    assert scene.motions.is_verified(free, free)
    assert not scene.motions.is_verified(blocked, blocked)


def test_without_margin_verification_is_sampling():
    """A checker without a margin says that it does not prove."""
    scene = scene_of("planar-toy", "collision.safety_margin_m=0.0")
    assert not scene.motions.is_proof
    assert isinstance(scene.motions, MotionChecker)
    assert not scene.motions.is_verified(
        np.array([0.5, 0.0, 0.0]), np.array([-0.5, 0.0, 0.0])
    )


def test_the_first_contact_of_a_path_is_named():
    """A path through the post names link and post."""
    scene = scene_of("planar-toy")
    pair = scene.motions.blocking_pair(np.array([[1.0, 0, 0], [-1.0, 0, 0]]))
    assert set(scene.checker.body_pairs[pair].split(" | ")) == {"link_1", "post"}
