"""Proofs that two bodies never collide, against what is worked out on paper."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reachmap.core.scene import Scene
from tests.support.small_cells import joint, link, load, robot

RADIUS_M, MARGIN_M = 0.01, 0.002
ROD = (
    f'xyz="0.1 0 0" rpy="0 {np.pi / 2} 0"|<cylinder radius="{RADIUS_M}" length="0.2"/>'
)


def blocked_rad(distance_m: float) -> float:
    """A rod that turns about z meets a ball within this of the ball's direction."""
    return float(np.arcsin((2 * RADIUS_M + MARGIN_M) / distance_m))


def rod_and_ball(
    folder: Path, limits_rad: np.ndarray, ball_rad: float, distance_m: float
) -> Scene:
    """A rod between two limits and a ball beside it, one joint from each other."""
    low, high = limits_rad
    limit = f'<limit lower="{low}" upper="{high}" velocity="2" effort="1"/>'
    axis = '<axis xyz="0 0 1"/>'
    urdf = robot(
        link("base"),
        link("rod", ROD),
        link("tip"),
        joint("turn", "base", "rod", more=axis + limit),
        joint("wrist", "rod", "tip", more=axis),
    )
    x, y = distance_m * np.cos(ball_rad), distance_m * np.sin(ball_rad)
    ball = f"attach_to: world, shape: {{sphere: {{radius: {RADIUS_M}}}}}"
    middle_deg = np.degrees(limits_rad.mean())
    overrides = [
        f"bodies=[{{name: ball, {ball}, pose: {{xyz: [{x}, {y}, 0]}}}}]",
        f"scan_configuration.q_deg.turn={middle_deg}",
        f"collision.safety_margin_m={MARGIN_M}",
    ]
    loaded = load(folder, urdf, "tip", ("turn", "wrist"), overrides)
    return Scene.build(loaded, with_bin=False)


# By the end of the rod the bound of its motion has nothing to spare.
@pytest.mark.parametrize("distance_m", [0.06, 0.19])
@pytest.mark.parametrize("seed", range(20))
def test_a_pair_is_proved_where_no_angle_brings_it_together(
    tmp_path: Path, seed: int, distance_m: float
) -> None:
    """Limits to both sides of the ball or to one, narrow and wide."""
    blocked = blocked_rad(distance_m)
    rng = np.random.default_rng(seed)
    low = rng.uniform(-3.0, 2.9)
    limits = np.array([low, rng.uniform(low + 0.05, 3.0)])
    # Every other ball lies close to a limit, where a proof has least to spare.
    near = limits[seed // 2 % 2] + rng.choice([-1, 1]) * rng.uniform(0.8, 1.3) * blocked
    ball = near if seed % 2 else rng.uniform(-np.pi, np.pi)
    turns = ball + 2 * np.pi * np.array([-1, 0, 1])
    gaps = np.maximum(limits[0] - turns, turns - limits[1])
    room = float(gaps.min()) - blocked
    checker = rod_and_ball(tmp_path, limits, ball, distance_m).checker
    is_proved = "rod | ball" in checker.proved_pairs
    # Round bodies are proved with hulls of many sides.
    if abs(room) > 0.05 * blocked:
        assert is_proved == (room > 0)
    elif is_proved:
        assert room > -1e-9


def test_both_outcomes_occur(tmp_path: Path) -> None:
    """Of a ball right behind a limit and of one right before it."""
    limits = np.array([0.5, 2.0])
    for away_rad, is_proved in ((0.03, True), (-0.03, False)):
        folder = tmp_path / str(is_proved)
        folder.mkdir()
        ball = limits[1] + blocked_rad(0.06) + away_rad
        checker = rod_and_ball(folder, limits, ball, 0.06).checker
        assert ("rod | ball" in checker.proved_pairs) == is_proved
