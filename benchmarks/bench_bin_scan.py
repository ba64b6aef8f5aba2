"""Plans into the bin: ours against plain OMPL and Pinocchio, in one run.

The rival is what an engineer writes in an afternoon: a StateValidityChecker that calls
``computeCollisions`` on all pairs, OMPL's own motion validator at the same resolution,
LBKPIECE1, ``simplifyMax``; without verification.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pinocchio as pin
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from reachmap._typing import FloatArray
from reachmap.cell.loading import read_cell
from reachmap.core.bodies import build_geometry
from reachmap.core.scene import Scene
from reachmap.core.timing import path_length_rad
from reachmap.sampling.frames import bin_test_frames
from reachmap.scans.survey import Survey, survey_frames

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
    axis = cell.robot.tcp.approach_axis
    grid = bin_test_frames(cell.bin_scan, cell.bin, axis, scene.T_base_bin).frames
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
        f"{name:>8}: {len(found)}/{len(paths)} found, {len(valid)} verified, "
        f"{1e3 * cpu_s / len(paths):.1f} ms CPU a plan, "
        f"length mean {np.mean(lengths):.2f} median {np.median(lengths):.2f} rad"
    )


def main() -> None:
    """Plan to the same goals with both, and print the ratio."""
    scene = Scene.build(read_cell(CELL), with_bin=True)
    _, goals = sample_goals(scene)
    begin = time.process_time()
    ours = [
        scene.planner.plan(scene.scan_configuration, goal, seed).path
        for seed, goal in enumerate(goals, start=1)
    ]
    ours_s = time.process_time() - begin
    plain = PlainPlanner(scene)
    begin = time.process_time()
    theirs = [plain.plan(goal, seed) for seed, goal in enumerate(goals, start=1)]
    theirs_s = time.process_time() - begin
    report("reachmap", ours, ours_s, scene)
    report("plain", theirs, theirs_s, scene)
    both = [
        (a, b)
        for a, b in zip(ours, theirs, strict=True)
        if a is not None and b is not None
    ]
    ratio = np.sum([path_length_rad(a) for a, _ in both]) / np.sum(
        [path_length_rad(b) for _, b in both]
    )
    print(f"plans per CPU second: {theirs_s / ours_s:.1f} times as many")
    print(f"path length: {ratio:.3f} of the plain planner's (sum over {len(both)})")


if __name__ == "__main__":
    main()
