"""Plans into the bin: ours against plain OMPL and Pinocchio, in one run.

Ours twice: as the cell has it, with the straight motion to the nearest goal tried
first, and searching in any case.

The rival is what an engineer writes in an afternoon: a StateValidityChecker that calls
``computeCollisions`` on all pairs, OMPL's own motion validator at the same resolution,
LBKPIECE1, ``simplifyMax``; without verification.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from reachmap._typing import FloatArray
from reachmap.cell.loading import read_cell
from reachmap.core.collision.bodies import build_geometry
from reachmap.core.planning.timing import path_length_rad
from reachmap.core.scene import Scene
from reachmap.sampling.frames import bin_test_frames
from reachmap.scans.ik_survey import Survey, survey_frames

CELL = "ur5-eye-in-hand"
SAMPLE = 60


class PlainPlanner:
    """OMPL and Pinocchio, put together the obvious way."""

    def __init__(self, scene: Scene) -> None:
        bodies = build_geometry(scene.robot, scene.loaded, with_bin=True)
        model, geometry = scene.robot.model, bodies.geometry
        data, placed = model.createData(), geometry.createData()
        margin = scene.checker.safety_margin_m
        for request in placed.collisionRequests:
            request.security_margin = margin
        self._scene = scene
        self._is_free = lambda q: (
            not pin.computeCollisions(model, data, geometry, placed, q, True)
        )

    def plan(self, goals: FloatArray, seed: int) -> FloatArray | None:
        """Plan and simplify; None without a path in ten seconds."""
        ou.RNG.setSeed(seed)
        robot, scene = self._scene.robot, self._scene
        space = ob.RealVectorStateSpace(robot.dof)
        bounds = ob.RealVectorBounds(robot.dof)
        for k in range(robot.dof):
            bounds.setLow(k, float(robot.lower_rad[k]))
            bounds.setHigh(k, float(robot.upper_rad[k]))
        space.setBounds(bounds)
        setup = og.SimpleSetup(space)
        information = setup.getSpaceInformation()
        setup.setStateValidityChecker(
            lambda s: self._is_free(np.array([s[k] for k in range(robot.dof)]))
        )
        step = scene.motions.planning_step_rad / space.getMaximumExtent()
        information.setStateValidityCheckingResolution(step)
        setup.setStartState(_state(information, scene.scan_configuration))
        goal = ob.GoalStates(information)
        for q in goals:
            goal.addState(_state(information, q))
        setup.setGoal(goal)
        setup.setPlanner(og.LBKPIECE1(information))
        if not setup.solve(10.0) or not setup.haveExactSolutionPath():
            return None
        path = setup.getSolutionPath()
        og.PathSimplifier(information).simplifyMax(path)
        return np.array(
            [
                [path.getState(row)[k] for k in range(robot.dof)]
                for row in range(path.getStateCount())
            ]
        )


def _state(information: Any, q: FloatArray) -> Any:
    state = information.allocState()
    for k, value in enumerate(q):
        state[k] = float(value)
    return state


def sample_goals(scene: Scene) -> tuple[Survey, list[FloatArray]]:
    """Goal sets of random test grasps that have goals."""
    cell = scene.loaded.cell
    grid = bin_test_frames(cell, scene.T_base_bin).frames
    rows = np.random.default_rng(0).permutation(grid.size)[: 2 * SAMPLE]
    T, approach_m = grid.transforms_at(rows), cell.bin_scan.approach_distance_m
    survey = survey_frames(scene, T, approach_m)
    sets = [survey.goals[survey.goals_of(k)] for k in range(len(rows))]
    return survey, [goals for goals in sets if len(goals)][:SAMPLE]


def report(
    name: str, paths: list[FloatArray | None], cpu_s: float, scene: Scene
) -> None:
    """One line per planner; invalid paths are those that collide when verified."""
    found = [path for path in paths if path is not None]
    valid = [path for path in found if scene.motions.path_is_verified(path)]
    lengths = [path_length_rad(path) for path in found]
    print(
        f"{name:>9}: {len(found)}/{len(paths)} found, {len(valid)} verified, "
        f"{1e3 * cpu_s / len(paths):.1f} ms CPU a plan, "
        f"length mean {np.mean(lengths):.2f} median {np.median(lengths):.2f} rad"
    )


def planned(scene: Scene, goals: list[FloatArray]) -> list[FloatArray | None]:
    """Plan to each goal set with a scene's own planner."""
    return [
        scene.planner.plan(scene.scan_configuration, goal, seed).path
        for seed, goal in enumerate(goals, start=1)
    ]


def timed(
    name: str, scene: Scene, plan: Callable[[], list[FloatArray | None]]
) -> tuple[list[FloatArray | None], float]:
    """Plan, and report paths and CPU time."""
    begin = time.process_time()
    paths = plan()
    cpu_s = time.process_time() - begin
    report(name, paths, cpu_s, scene)
    return paths, cpu_s


def length_ratio(ours: list[FloatArray | None], theirs: list[FloatArray | None]) -> str:
    """Sum of our path lengths over theirs, where both found one."""
    both = [
        (path_length_rad(a), path_length_rad(b))
        for a, b in zip(ours, theirs, strict=True)
        if a is not None and b is not None
    ]
    total, total_plain = np.sum(both, axis=0)
    return f"{total / total_plain:.3f} of the plain planner's (sum over {len(both)})"


def main() -> None:
    """Plan to the same goals with all three, and print the ratios."""
    scene = Scene.build(read_cell(CELL), with_bin=True)
    searching = Scene.build(
        read_cell(CELL, ("planner.straight_first=false",)), with_bin=True
    )
    _, goals = sample_goals(scene)
    plain = PlainPlanner(scene)
    theirs, theirs_s = timed(
        "plain",
        scene,
        lambda: [plain.plan(goal, seed) for seed, goal in enumerate(goals, start=1)],
    )
    for name, own in (("searching", searching), ("reachmap", scene)):
        ours, ours_s = timed(name, own, partial(planned, own, goals))
        print(f"plans per CPU second: {theirs_s / ours_s:.1f} times as many")
        print(f"path length: {length_ratio(ours, theirs)}")


if __name__ == "__main__":
    main()
