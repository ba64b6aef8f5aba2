"""The best paths of a bin map under errors: certified or replayed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from reachmap._typing import BoolArray, CodeArray, FloatArray, IntArray
from reachmap.cell.loading import LoadedCell
from reachmap.core.collision.bodies import build_geometry
from reachmap.core.collision.camera import Camera
from reachmap.core.collision.clearance import certain_clearance_m
from reachmap.core.collision.misplacement import Misplacement, MovableBodies
from reachmap.core.scene import Scene
from reachmap.errors import SettingsError
from reachmap.maps.records import BinMap
from reachmap.maps.robustness.record import Certificate
from reachmap.robustness.errors import Errors, misplacement, moved_m
from reachmap.robustness.replay import (
    MOVED,
    PerturbedCell,
    Replay,
    StoredPaths,
    is_covered,
    measure_unit,
    replay_unit,
)
from reachmap.runtime.job import Job
from reachmap.runtime.options import RunOptions
from reachmap.runtime.progress import Progress
from reachmap.runtime.run import run

# Small enough that workers finish at about the same time.
PATHS_PER_UNIT = 50
GraspPlace = tuple[int, int, int, int]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RobustnessProblem:
    """Which paths of a map stay free under errors.

    Attributes
    ----------
    replay : Replay
        Its paths, filling by filling.
    place : tuple of int arrays
        The test grasp of each, as indices into the map, in the same order.
    begin : int array, shape (fillings + 1,)
        Where each filling begins among them.
    certain_m : array, shape (paths,)
        Clearance that the map proves, whatever the bodies [m].
    closest : int array, shape (paths,)
        Bodies it is between, an index into the map's ``body_pairs``; -1: not known.
    body_pairs : tuple of str
        Of the map.
    errors : Errors
    T_base_camera : array, shape (4, 4), or None
        None where the camera is not off.
    """

    replay: Replay
    place: tuple[IntArray, ...]
    begin: IntArray
    certain_m: FloatArray
    closest: IntArray
    body_pairs: tuple[str, ...]
    errors: Errors
    T_base_camera: FloatArray | None

    @classmethod
    def of_map(
        cls,
        bin_map: BinMap,
        loaded: LoadedCell,
        best_rows: Mapping[GraspPlace, int],
        errors: Errors,
        margin_m: float,
    ) -> RobustnessProblem:
        """Take the best paths of a map.

        Parameters
        ----------
        bin_map : BinMap
        loaded : LoadedCell
            Its cell.
        best_rows : mapping
            Test grasp to the row of its path.
        errors : Errors
        margin_m : float
            Clearance that a path must keep.

        Raises
        ------
        SettingsError
            The camera of a cell that has none is said to be off.
        """
        places = sorted(best_rows)
        rows = np.array([best_rows[place] for place in places], np.int64)
        place = tuple(np.array(places, np.int64).reshape(-1, 4).T)
        fillings = loaded.fillings()
        filling = place[0] if len(fillings) > 1 else np.zeros(len(rows), np.int64)
        begin = np.searchsorted(filling, np.arange(len(fillings) + 1))
        store = bin_map.paths
        ends = np.cumsum(store.row_size)
        paths = [
            store.configuration[ends[row] - store.row_size[row] : ends[row]]
            for row in rows
        ]
        certain_m, closest = _stored_clearance(bin_map, place)
        return cls(
            replay=Replay(
                stored=tuple(
                    StoredPaths(loaded=one, paths=tuple(paths[begin[k] : begin[k + 1]]))
                    for k, one in enumerate(fillings)
                ),
                margin_m=margin_m,
            ),
            place=place,
            begin=begin,
            certain_m=certain_m,
            closest=closest,
            body_pairs=bin_map.body_pairs,
            errors=errors,
            T_base_camera=_camera_pose(fillings[0], errors),
        )

    @property
    def fillings(self) -> range:
        """Filling levels, counted from the lowest."""
        return range(len(self.replay.stored))

    def rows_of(self, filling: int) -> slice:
        """Paths of one filling, among all."""
        return slice(int(self.begin[filling]), int(self.begin[filling + 1]))


def certificates(
    problem: RobustnessProblem, scales: FloatArray, options: RunOptions
) -> tuple[CodeArray, IntArray]:
    """What is proved to stay free at multiples of the errors.

    Returns
    -------
    certificate : uint8 array, shape (scales, paths)
        :class:`Certificate` codes.
    closest : int array, shape (paths,)
        Bodies that errors bring closest, an index into the map's ``body_pairs``.
    """
    moved = [_moved(problem, float(scale)) for scale in scales]
    code = np.zeros((len(scales), len(problem.certain_m)), np.uint8)
    anything = np.repeat(problem.certain_m[:, None], len(MOVED), axis=1)
    for filling in problem.fillings:
        rows = problem.rows_of(filling)
        for k in range(len(scales)):
            proved = _covered(problem, anything[rows], moved[k][filling])
            code[k, rows][proved] = Certificate.STORED_CLEARANCE
    units = [
        (filling, range(part, min(part + PATHS_PER_UNIT, count)))
        for filling in problem.fillings
        for count in [len(problem.replay.stored[filling].paths)]
        for part in range(0, count, PATHS_PER_UNIT)
    ]
    closest = problem.closest.copy()
    # Paths that the map proves everywhere need no further look.
    todo = [
        unit
        for unit in units
        if (code[:, problem.rows_of(unit[0])][:, unit[1]] == Certificate.NONE).any()
    ]
    job = Job(function=measure_unit, context=problem.replay)
    progress = Progress("robust: clearances", quiet=options.quiet)
    found = run(job, todo, options, progress)
    for (filling, part), payload in zip(todo, found, strict=True):
        here = np.arange(part.start, part.stop) + problem.rows_of(filling).start
        for k in range(len(scales)):
            proved = _covered(problem, payload["clearance"], moved[k][filling])
            fresh = here[proved & (code[k, here] == Certificate.NONE)]
            code[k, fresh] = Certificate.DISPLACED_PAIRS
        closest[here] = _renumbered(problem, filling, payload["pair"])
    return code, closest


def replayed(
    problem: RobustnessProblem,
    certificate: CodeArray,
    scales: FloatArray,
    unit: FloatArray,
    options: RunOptions,
) -> tuple[BoolArray, list[list[Misplacement]]]:
    """Whether paths stay free in perturbed cells.

    Parameters
    ----------
    certificate : uint8 array, shape (scales, paths)
        What is proved is not replayed.
    unit : array, shape (samples, 3, 2, 3)
        Directions of the errors.

    Returns
    -------
    free : bool array, shape (scales, samples, paths)
    cells : list of list of Misplacement
        By scale and sample.
    """
    T_base_bin = problem.replay.stored[0].loaded.cell.T_base_bin()
    cells = [
        [
            misplacement(
                problem.errors.scaled(float(scale)),
                one,
                T_base_bin,
                problem.T_base_camera,
            )
            for one in unit
        ]
        for scale in scales
    ]
    free = np.ones((len(scales), len(unit), certificate.shape[1]), bool)
    places, units = [], []
    for k, sample in np.ndindex(len(scales), len(unit)):
        for filling in problem.fillings:
            rows = problem.rows_of(filling)
            unproved = np.flatnonzero(certificate[k, rows] == Certificate.NONE)
            if len(unproved) and scales[k] > 0:
                places.append((k, sample, rows.start + unproved))
                units.append(
                    PerturbedCell(
                        filling=filling, rows=unproved, misplacement=cells[k][sample]
                    )
                )
    job = Job(function=replay_unit, context=problem.replay)
    progress = Progress("robust: perturbed cells", quiet=options.quiet)
    found = run(job, units, options, progress)
    for (k, sample, rows), kept in zip(places, found, strict=True):
        free[k, sample, rows] = kept
    return free, cells


def _stored_clearance(
    bin_map: BinMap, place: tuple[IntArray, ...]
) -> tuple[FloatArray, IntArray]:
    """What a map proves of the clearance of its paths, and the pair it names."""
    settings = bin_map.provenance.settings
    proved_m = 0.0
    if settings.get("verification_is_proof"):
        proved_m = float(settings["collision"]["safety_margin_m"])
    if bin_map.margins is None:
        count = len(place[0])
        return np.full(count, proved_m), np.full(count, -1)
    clearance = np.nan_to_num(bin_map.margins.clearance[place], nan=0.0)
    certain = np.maximum(certain_clearance_m(clearance), proved_m)
    return certain, bin_map.margins.clearance_pair[place].astype(np.int64)


def _camera_pose(loaded: LoadedCell, errors: Errors) -> FloatArray | None:
    if not (errors.camera.shift_m or errors.camera.turn_rad):
        return None
    if loaded.cell.camera is None:
        raise SettingsError(f"{loaded.source}: --camera: the cell has no camera")
    scene = Scene.shared(loaded, with_bin=True)
    return Camera(scene.robot, loaded).T_base_camera(scene.scan_configuration)


def _moved(problem: RobustnessProblem, scale: float) -> list[tuple[float, float]]:
    """How far the bin and the tool of each filling move at a multiple of the errors."""
    found = []
    for stored in problem.replay.stored:
        scene = Scene.shared(stored.loaded, with_bin=True)
        bodies = build_geometry(scene.robot, stored.loaded, with_bin=True)
        found.append(
            moved_m(
                problem.errors.scaled(scale),
                MovableBodies(scene.robot, stored.loaded, bodies),
                stored.loaded.cell.T_base_bin(),
                problem.T_base_camera,
            )
        )
    return found


def _covered(
    problem: RobustnessProblem, clearance_m: FloatArray, moved: tuple[float, float]
) -> BoolArray:
    return is_covered(clearance_m, *moved, problem.replay.margin_m)


def _renumbered(problem: RobustnessProblem, filling: int, pair: IntArray) -> IntArray:
    """Pairs of a filling's checker, numbered as in the map."""
    checker = Scene.shared(problem.replay.stored[filling].loaded).checker
    number = {name: k for k, name in enumerate(problem.body_pairs)}
    names = [number.get(name, -1) for name in checker.body_pairs]
    return np.array([names[k] if k >= 0 else -1 for k in pair.tolist()], np.int64)
