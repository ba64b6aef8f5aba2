"""Attempts at test grasps: over a shared network of routes, or each from scratch."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.core.kinematics.windings import Windings
from reachmap.core.planning.connection import Connection, portfolio
from reachmap.core.planning.planner import Planner, PlanResult
from reachmap.core.planning.roadmap import ShortestPaths
from reachmap.core.planning.routes import (
    RouteNetwork,
    build_network,
    spread_over,
)
from reachmap.core.planning.shortcut import settle
from reachmap.core.planning.timing import Pace
from reachmap.core.scene import Scene
from reachmap.scans.ik_survey import Survey
from reachmap.scans.measured import attempt_seed


class WayIn(NamedTuple):
    """A verified path from the scan configuration to a grasp.

    Attributes
    ----------
    path : array, shape (n, dof)
        Straight approach included.
    planned : int
        Waypoints of its planned part.
    repeat : int
        Attempt that it is, -1 for none.
    goal : int
        Row of the goal that it ends at.
    """

    path: FloatArray
    planned: int
    repeat: int
    goal: int

    @classmethod
    def of(cls, path: FloatArray, way: FloatArray, repeat: int, goal: int) -> WayIn:
        """A planned path (n, dof) and the approach (m, dof) that it ends at."""
        return cls(np.vstack([path, way[1:]]), len(path), repeat, goal)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Routes:
    """Routes to test grasps over the roadmap, as sent to workers.

    Attributes
    ----------
    paths : ShortestPaths
        Of the roadmap.
    node : int array, shape (goals,)
        Node of the roadmap at which each goal is nearest by path.
    network : RouteNetwork or None
        None where nothing is reached, or attempts are made by the planner.
    """

    paths: ShortestPaths
    node: IntArray
    network: RouteNetwork | None

    @classmethod
    def of(
        cls, scene: Scene, survey: Survey, connection: Connection, *, with_network: bool
    ) -> Routes:
        """Routes of a connected survey.

        Parameters
        ----------
        scene : Scene
        survey : Survey
        connection : Connection
            Of that survey.
        with_network : bool
            Whether paths are to branch off a network, which takes time to build.
        """
        paths = connection.roadmap.shortest_paths()
        node = connection.roadmap.shortest_to_goals(paths)
        routes = cls(paths=paths, node=node, network=None)
        reached = np.flatnonzero(np.isfinite(paths.length_rad[node]))
        if not with_network or not len(reached):
            return routes
        cell = scene.loaded.cell
        spec, windings = cell.roadmap, Windings(scene.robot)
        rows = reached[
            spread_over(paths.configurations[node[reached]], spec.route_goals)
        ]
        network = build_network(
            [paths.path_to(int(node[row])) for row in rows],
            [
                survey.goals_near(
                    survey.goals_of_group(int(survey.frame[row])),
                    scene.scan_configuration,
                    windings,
                )[0]
                for row in rows
            ],
            [Planner(scene.motions, one) for one in portfolio(spec)],
            spec,
            pace_of(scene),
            cell.seed,
        )
        return cls(paths=paths, node=node, network=network)

    def payload(self) -> dict[str, Any]:
        """Their JSON payload for the journal."""
        network = self.network
        return {
            "paths": dataclasses.asdict(self.paths),
            "node": self.node,
            "network": None if network is None else dataclasses.asdict(network),
        }

    @classmethod
    def from_payload(cls, payload: Mapping[str, Any]) -> Routes:
        """Undo :meth:`payload`."""
        network = payload["network"]
        return cls(
            paths=ShortestPaths(**payload["paths"]),
            node=payload["node"],
            network=None
            if network is None
            else RouteNetwork(**{**network, "pace": Pace(**network["pace"])}),
        )

    @property
    def length_rad(self) -> FloatArray:
        """Length of the roadmap's path to each goal, infinite without one."""
        return self.paths.length_rad[self.node]

    def over_roadmap(self, survey: Survey, grasp: int) -> tuple[FloatArray, int] | None:
        """The roadmap's own path to a test grasp, and the goal that it ends at.

        None where the grasp is not connected.
        """
        rows = survey.goals_of(grasp)
        length = self.length_rad[rows]
        if not np.isfinite(length).any():
            return None
        goal = int(rows[np.argmin(length)])
        return self.paths.path_to(int(self.node[goal])), goal


def pace_of(scene: Scene) -> Pace:
    """What the paths of a scene are compared by."""
    return Pace(
        velocity=scene.robot.velocity_rad_s,
        acceleration=scene.robot.acceleration_rad_s2,
    )


class RouteAttempts:
    """Makes attempts at test grasps over the network.

    Parameters
    ----------
    scene : Scene
    survey : Survey
    routes : Routes
    """

    def __init__(self, scene: Scene, survey: Survey, routes: Routes) -> None:
        self._scene, self._survey, self._routes = scene, survey, routes
        self._windings, self._pace = Windings(scene.robot), pace_of(scene)

    def at(self, grasp: int, repeats: int) -> list[tuple[PlanResult, int]]:
        """Attempts at one test grasp, each with the goal it ends at.

        The ways that branch off the network are the same for all of them; each
        settles them with a seed of its own. Empty where the grasp is not connected.
        """
        own = self._routes.over_roadmap(self._survey, grasp)
        if own is None:
            return []
        scene, checker = self._scene, self._scene.checker
        rows = self._survey.goals_of(grasp)
        goals, goal = self._survey.goals_near(
            rows, scene.scan_configuration, self._windings
        )
        wall, cpu, checks = time.perf_counter(), time.thread_time(), checker.checks
        network, spec = self._routes.network, scene.loaded.cell.roadmap
        ways = network.ways_to(goals, scene.motions, spec) if network else []
        wall, cpu = time.perf_counter() - wall, time.thread_time() - cpu
        checks = checker.checks - checks
        attempts: list[tuple[PlanResult, int]] = []
        for repeat in range(repeats):
            begin = time.thread_time()
            path, end = own
            # What is straight needs no settling: every attempt takes it.
            if repeat and ways and len(ways[0]) == 2:
                path, end = ways[0], attempts[0][1]
            else:
                path = self._settled(ways or [path], grasp, repeat)
                if ways:
                    end = int(goal[np.argmin(np.abs(goals - path[-1]).max(axis=1))])
            result = dataclasses.replace(
                PlanResult.without_search(path, end),
                checks=checks if len(path) == 2 else self._checks_to_serve(path),
                planning_time_s=wall,
                planning_cpu_time_s=cpu,
                simplification_time_s=time.thread_time() - begin,
            )
            attempts.append((result, end))
        return attempts

    def _checks_to_serve(self, path: FloatArray) -> int:
        """State checks of a way round, tested at the planning step.

        What was tried before it was found, and how finely a stretch beside an obstacle
        is verified, depend on where the network happens to lead, which is chance.
        """
        motions, before = self._scene.motions, self._scene.checker.checks
        for motion in zip(path[:-1], path[1:], strict=True):
            motions.is_free(*motion)
        return self._scene.checker.checks - before

    def own(self, grasp: int) -> tuple[FloatArray, int] | None:
        """The roadmap's own path to a test grasp, settled, and its goal."""
        own = self._routes.over_roadmap(self._survey, grasp)
        if own is None:
            return None
        return self._settled([own[0]], grasp, -1), own[1]

    def _settled(
        self, ways: Sequence[FloatArray], grasp: int, repeat: int
    ) -> FloatArray:
        """The cheapest of some ways, all of them settled."""
        scene = self._scene
        cell, motions = scene.loaded.cell, scene.motions
        rng = np.random.default_rng(attempt_seed(cell.seed, grasp, repeat + 1))
        settled = [
            settle(way, motions.is_verified, self._pace, rng, cell.roadmap.least_gain)
            for way in ways
        ]
        return min(settled, key=self._pace.of_path)


def plan_from_scratch(
    scene: Scene, survey: Survey, grasps: Sequence[int]
) -> list[list[tuple[PlanResult, int]]]:
    """Let the cell's planner make all attempts, as in the paper.

    They take turns: a machine that is slow for a moment is then slow for one attempt
    at each of many, and not for every attempt at one, which would look expensive.
    """
    cell, start = scene.loaded.cell, scene.scan_configuration
    windings = Windings(scene.robot)
    goals = [
        survey.goals_near(survey.goals_of(grasp), start, windings) for grasp in grasps
    ]
    plans: list[list[tuple[PlanResult, int]]] = [[] for _ in grasps]
    for repeat in range(cell.bin_scan.repeats):
        for row, grasp in enumerate(grasps):
            Q, goal = goals[row]
            if len(Q):
                seed = attempt_seed(cell.seed, grasp, repeat)
                plan = scene.planner.plan(start, Q, seed)
                plans[row].append((plan, int(goal[plan.goal])))
    return plans


def ways_in(
    survey: Survey,
    plans: Sequence[tuple[PlanResult, int]],
    own: tuple[FloatArray, int] | None,
) -> list[WayIn]:
    """Paths of the attempts that found one, and the roadmap's own, to a test grasp.

    Parameters
    ----------
    survey : Survey
    plans : sequence of (PlanResult, int)
        Attempts, each with the goal it ends at.
    own : (array of shape (n, dof), int) or None
        The roadmap's path and its goal, where it is wanted.
    """
    found = [
        WayIn.of(plan.path, survey.way_from(goal, plan.path[-1]), repeat, goal)
        for repeat, (plan, goal) in enumerate(plans)
        if plan.path is not None
    ]
    if own is not None:
        path, goal = own
        found.append(WayIn.of(path, survey.way_from(goal, path[-1]), -1, goal))
    return found
