"""Paths from one configuration to exactly given others, over a shared roadmap."""

from __future__ import annotations

import dataclasses

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.core.kinematics.windings import Windings
from reachmap.core.planning.routes import shorten_until
from reachmap.core.scene import Scene
from reachmap.maps.records import NO_PAIR
from reachmap.runtime.progress import Progress
from reachmap.scans.ik_survey import Survey
from reachmap.scans.routes import Routes
from reachmap.scans.workspace_roadmap import connect_survey

# Rounding of a configuration that was stored and read again.
_SAME_RAD = 1e-9


def connect_from(
    scene: Scene,
    start: FloatArray,
    Q: FloatArray,
    frame: IntArray,
    progress: Progress,
) -> Routes:
    """Connect configurations to a start.

    Parameters
    ----------
    scene : Scene
    start : array, shape (dof,)
    Q : array, shape (n, dof)
        Free.
    frame : int array, shape (n,)
        Rising; any one configuration of a frame will do.
    progress : Progress
    """
    _, frame = np.unique(frame, return_inverse=True)
    frames = int(frame.max(initial=-1)) + 1
    ones = np.ones(frames, np.uint8)
    survey = Survey(
        status=np.zeros(frames, np.uint8),
        blocking_pair=np.full(frames, NO_PAIR, np.int64),
        n_ik=ones,
        n_ik_free=ones.copy(),
        frame=frame.astype(np.int64),
        way=Q.copy(),
        way_size=np.ones(len(Q), np.int64),
    )
    there = dataclasses.replace(scene, scan_configuration=start)
    seed = scene.loaded.cell.seed
    connection = connect_survey(there, survey, seed=seed, progress=progress)
    return Routes.of(there, survey, connection, with_network=True)


def path_over(
    scene: Scene, routes: Routes, row: int, q: FloatArray, seed: int
) -> FloatArray | None:
    """Quickest verified path from where routes begin to a configuration.

    Parameters
    ----------
    scene : Scene
    routes : Routes
        Of that scene.
    row : int
        Row of the configuration among those that were connected.
    q : array, shape (dof,)
        The configuration, at the turns of its joints that are wanted.
    seed : int

    Returns
    -------
    array, shape (n, dof), or None
    """
    spec, motions = scene.loaded.cell.roadmap, scene.motions
    network, start = routes.network, routes.paths.configurations[0]
    ways = [] if network is None else network.ways_to(q[None], motions, spec)
    connected = bool(np.isfinite(routes.length_rad[row]))
    if not ways and connected:
        own = routes.paths.path_to(int(routes.node[row]))
        if np.abs(own[-1] - q).max() <= _SAME_RAD:
            ways = [own]
        elif Windings(scene.robot).exist:
            # Another turn of a joint was connected: the same place, another path.
            plan = scene.planner.plan(start, q[None], seed)
            ways = [] if plan.path is None else [plan.path]
    return quickest(scene, ways, seed)


def quickest(scene: Scene, ways: list[FloatArray], seed: int) -> FloatArray | None:
    """The way that takes the least time when all are shortened; None of none."""
    rng, spec = np.random.default_rng(seed), scene.loaded.cell.roadmap
    short = [shorten_until(w, scene.motions, rng, spec.least_gain) for w in ways]
    return min(short, key=scene.time_law.path_time_s, default=None)
