"""Summary of a workspace map."""

from __future__ import annotations

from dataclasses import dataclass

from reachmap._typing import FloatArray
from reachmap.maps.records import KINDS, Status, WorkspaceMap, stitch_cubes
from reachmap.maps.summary.evidence import EvidenceSummary, evidence_of
from reachmap.maps.summary.statistics import Causes, best_level, causes_of, level_means


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelSummary:
    """One level; percentages are means over its squares, as in the paper.

    Attributes
    ----------
    z : float
        Height [m].
    squares, full_squares : int
        Squares that were attempted, and that have 100 % path reachability.
    frames : int
        Test frames that were attempted; those of shared squares count in each cube.
    path, ik, ik_free : int
        Test frames with a path, a solution, a solution free of collision.
    path_percent, ik_percent, ik_free_percent : float
        Means over the squares, NaN if none was attempted.
    """

    z: float
    squares: int
    full_squares: int
    frames: int
    path: int
    ik: int
    ik_free: int
    path_percent: float
    ik_percent: float
    ik_free_percent: float


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkspaceSummary:
    """Summary of a workspace map.

    Attributes
    ----------
    frames : int
    method : str
    levels : tuple of LevelSummary
    best_level : int or None
        Index into ``levels`` of the highest mean path reachability.
    causes : Causes
    reached, unreached : EvidenceSummary
        Of frames with a path, and of those with a free goal but no path to it.
    """

    frames: int
    method: str
    levels: tuple[LevelSummary, ...]
    best_level: int | None
    causes: Causes
    reached: EvidenceSummary
    unreached: EvidenceSummary


def summarise_workspace(record: WorkspaceMap) -> WorkspaceSummary:
    """Count frames, levels, causes and evidence of a workspace map."""
    cubes = tuple(record.cubes.values())
    frames = [(cube.status, cube.component, cube.attempts) for cube in cubes]
    components = record.components
    return WorkspaceSummary(
        frames=sum(cube.status.size for cube in cubes),
        method=record.method,
        levels=_levels(record),
        best_level=best_level(record.path_reachability),
        causes=causes_of(record),
        reached=evidence_of(frames, Status.PATH_FOUND, components),
        unreached=evidence_of(frames, Status.NO_PATH_FOUND, components),
    )


def _levels(record: WorkspaceMap) -> tuple[LevelSummary, ...]:
    stitching = stitch_cubes(record.cubes)
    cubes = record.cubes.values()
    counts = {kind: [cube.counts(kind) for cube in cubes] for kind in KINDS}
    hits = {
        kind: stitching.pool([hit for hit, _ in pairs]).sum(axis=(1, 2))
        for kind, pairs in counts.items()
    }
    tried = stitching.pool([attempted for _, attempted in counts["path"]])
    path = record.path_reachability
    means: dict[str, FloatArray] = {
        "path": level_means(path),
        "ik": level_means(record.ik_reachability),
        "ik_free": level_means(record.ik_free_reachability),
    }
    return tuple(
        LevelSummary(
            z=float(record.z[k]),
            squares=int((tried[k] > 0).sum()),
            full_squares=int((path[k] == 100.0).sum()),
            frames=int(tried[k].sum()),
            path=int(hits["path"][k]),
            ik=int(hits["ik"][k]),
            ik_free=int(hits["ik_free"][k]),
            path_percent=float(means["path"][k]),
            ik_percent=float(means["ik"][k]),
            ik_free_percent=float(means["ik_free"][k]),
        )
        for k in range(len(record.z))
    )
