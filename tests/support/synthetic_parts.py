"""The parts that maps may have since version 1.1, made to fit a synthetic map."""

from __future__ import annotations

import dataclasses

import numpy as np

from reachmap.geometry import yaw_transform
from reachmap.maps.format.checks import path_lengths
from reachmap.maps.parts import (
    ApproachTimes,
    BestPaths,
    Components,
    Cycle,
    Effort,
    Margins,
    PathStore,
)
from reachmap.maps.records import (
    NO_PAIR,
    BinMap,
    BinPlacement,
    Status,
    WorkspaceMap,
)

STAGES = ("lift", "transfer")
T_WORLD_BASE = yaw_transform(1.0, 2.0, 0.5, 0.3)


def synthetic_components(reached: np.ndarray) -> Components:
    """Components with the given verdicts; the last method agrees with half of them."""
    count = len(reached)
    method_checks = np.arange(1, 3 * count + 1, dtype=np.int32).reshape(count, 3)
    return Components(
        attempts=np.arange(2, count + 2, dtype=np.int32),
        checks=method_checks.sum(axis=1, dtype=np.int32),
        reached=reached.astype(np.uint8),
        agreed=(np.arange(count) % 2).astype(np.uint8),
        method_checks=method_checks,
        methods=("LBKPIECE1", "RRTConnect", "lazy PRM"),
    )


def workspace_with_parts(record: WorkspaceMap) -> WorkspaceMap:
    """A workspace map with evidence and the world's transform."""
    cubes = {
        name: dataclasses.replace(cube, component=components_of(cube.status))
        for name, cube in record.cubes.items()
    }
    return dataclasses.replace(
        record,
        cubes=cubes,
        components=synthetic_components(np.array([True, False, False])),
        T_world_base=T_WORLD_BASE,
    )


def components_of(status: np.ndarray) -> np.ndarray:
    """Component 0 where a path was found, 1 and 2 in turn where none was."""
    turn = 1 + np.arange(status.size).reshape(status.shape) % 2
    missed = np.where(status == Status.NO_PATH_FOUND, turn, -1)
    return np.where(status == Status.PATH_FOUND, 0, missed).astype(np.int32)


def bin_with_parts(record: BinMap, seed: int = 1) -> BinMap:
    """A bin map with every part; where no attempt found a path, the roadmap's counts.

    Half of the test grasps with a path have a whole cycle, and their stages are in the
    path store.
    """
    rng = np.random.default_rng(seed)
    found = record.status == Status.PATH_FOUND
    tried = record.path_found == 1
    whole = found & (rng.random(found.shape) < 0.5)
    paths, row = paths_with_best(record, whole, rng)
    length, _ = path_lengths(paths.configuration, paths.row_size, paths.row_size)
    ends = paths.configuration[np.cumsum(paths.row_size) - 1]
    share = rng.uniform(0.1, 0.4, record.path_found.shape)
    pair = np.arange(found.size).reshape(found.shape) % len(record.body_pairs)
    return dataclasses.replace(
        record,
        paths=paths,
        goal_configuration=np.where(found[..., None], ends[row], np.nan),
        component=components_of(record.status),
        components=synthetic_components(np.array([True, False, False])),
        effort=Effort(
            checks=np.where(tried, rng.integers(50, 9000, tried.shape), 0).astype(
                np.uint32
            ),
            seconds_per_check=2e-5,
        ),
        best=BestPaths(
            row=np.where(found, row, -1).astype(np.int32),
            path_length=np.where(found, length[row], np.nan),
            execution_time=np.where(found, rng.uniform(0.5, 2, found.shape), np.nan),
            effort_checks=np.where(found, 300, 0).astype(np.uint32),
        ),
        winning_roll=np.where(found, rng.uniform(-3, 3, found.shape), np.nan),
        times=ApproachTimes(
            approach=share * record.execution_time,
            retreat=share * record.execution_time,
        ),
        margins=Margins(
            clearance=np.where(found, rng.uniform(0.002, 0.1, found.shape), np.nan),
            clearance_pair=np.where(found, pair, NO_PAIR).astype(np.int32),
            joint_margin=np.where(found, rng.uniform(0, 1, found.shape), np.nan),
            smallest_singular_value=np.where(
                found, rng.uniform(0, 0.3, found.shape), np.nan
            ),
        ),
        cycle=synthetic_cycle(record, whole, rng),
        lift_above_rim=np.where(whole, 0.01, np.nan),
        T_world_base=T_WORLD_BASE,
    )


def paths_with_best(
    record: BinMap, whole: np.ndarray, rng: np.random.Generator
) -> tuple[PathStore, np.ndarray]:
    """The paths of a map, the roadmap's own, and the stages; the best row of each."""
    found = record.status == Status.PATH_FOUND
    own = np.argwhere(found & ~record.path_found.any(axis=-1))
    stages = np.repeat(np.argwhere(whole), len(STAGES), axis=0)
    more = np.concatenate([own, stages])
    rows = rng.integers(2, 5, len(more))
    dof = record.goal_configuration.shape[-1]
    index = np.concatenate(
        [record.paths.index, np.column_stack([more, np.full(len(more), -1)])]
    )
    stage = np.zeros(len(index), np.uint8)
    stage[len(index) - len(stages) :] = np.tile(
        1 + np.arange(len(STAGES)), len(stages) // len(STAGES)
    )
    row = np.zeros(found.shape, np.int64)
    for k in np.flatnonzero(stage == 0)[::-1]:
        row[tuple(index[k, :4])] = k
    return (
        PathStore(
            configuration=np.concatenate(
                [record.paths.configuration, rng.uniform(-3, 3, (rows.sum(), dof))]
            ),
            row_size=np.concatenate([record.paths.row_size, rows]).astype(np.int32),
            planned_size=np.concatenate([record.paths.planned_size, rows - 1]).astype(
                np.int32
            ),
            index=index.astype(np.int32),
            stage=stage,
        ),
        row,
    )


def synthetic_cycle(
    record: BinMap, whole: np.ndarray, rng: np.random.Generator
) -> Cycle:
    """Two stages; where the cycle is not whole, the transfer is blocked."""
    attempted = record.status != Status.NOT_ATTEMPTED
    shape = (*whole.shape, len(STAGES))
    status = np.zeros(shape, np.uint8)
    status[whole] = Status.PATH_FOUND
    half = ~whole & (record.status == Status.PATH_FOUND)
    status[half] = [Status.PATH_FOUND, Status.IK_IN_COLLISION]
    done = status == Status.PATH_FOUND
    percent = np.full(whole.shape[:-1], np.nan)
    tried = attempted.sum(axis=-1)
    np.divide(100.0 * whole.sum(axis=-1), tried, out=percent, where=tried > 0)
    return Cycle(
        stages=STAGES,
        status=status,
        blocking_pair=np.where(status == Status.IK_IN_COLLISION, 1, NO_PAIR).astype(
            np.int32
        ),
        time=np.where(done, rng.uniform(0.5, 2, shape), np.nan),
        length=np.where(done, rng.uniform(1, 4, shape), np.nan),
        drop_off=np.where(whole, 0, -1).astype(np.int32),
        cycle_time=np.where(whole, rng.uniform(2, 6, whole.shape), np.nan),
        reachability=percent,
    )


def placement_with_parts(record: BinPlacement) -> BinPlacement:
    """A placement under a tolerance, on a body."""
    return dataclasses.replace(
        record,
        tolerance=(0.03, 0.087),
        worst_score=record.score - 4.0,
        score_error=np.where(np.isnan(record.score), np.nan, 0.4),
        support="table",
        T_world_base=T_WORLD_BASE,
    )
