"""``compare``: two maps of one kind go in, what changed comes out."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from reachmap.disk import recorded_name
from reachmap.errors import GateFailedError, SettingsError
from reachmap.maps.bytes.to_json import json_ready
from reachmap.maps.comparison.comparison import Comparison, SquareChange, compare_maps
from reachmap.maps.comparison.pose_matching import TOLERANCE_DEG, TOLERANCE_M, Frame
from reachmap.maps.comparison.significance import benjamini_hochberg
from reachmap.maps.format.registry import kind_of
from reachmap.maps.records import BinMap, WorkspaceMap
from reachmap.tools.artefacts import read_artefact_or_journal

if TYPE_CHECKING:
    from reachmap.plots.comparison import MapChange

SUFFIXES = (".png", ".svg")


@dataclass(frozen=True, slots=True, kw_only=True)
class MapComparison:
    """Two maps, and what changed from one to the other.

    Attributes
    ----------
    paths : (Path, Path)
    before, after : WorkspaceMap or BinMap
    result : Comparison
    """

    paths: tuple[Path, Path]
    before: WorkspaceMap | BinMap
    after: WorkspaceMap | BinMap
    result: Comparison

    @property
    def names(self) -> tuple[str, str]:
        """What to call the maps: their file names, or paths where these agree."""
        (a, b), (first, second) = self.paths, (path.name for path in self.paths)
        if first == second:
            first, second = str(a), str(b)
        return recorded_name(first), recorded_name(second)

    @property
    def headline(self) -> str:
        """The result in a sentence."""
        r = self.result
        share = [100.0 * n / r.common for n in (r.reached_before, r.reached_after)]
        return (
            f"path reachability {share[0]:.2f} % to {share[1]:.2f} % "
            f"({r.change:+.2f} points)"
        )

    def facts(self) -> dict[str, Any]:
        """Everything as JSON values, the squares with common frames one by one."""
        facts = {
            "before": str(self.paths[0]),
            "after": str(self.paths[1]),
            "headline": self.headline,
            "change_points": self.result.change,
            **{
                item.name: getattr(self.result, item.name)
                for item in dataclasses.fields(self.result)
                if item.name not in ("squares", "losses", "gains")
            },
            "losses": [dataclasses.asdict(item) for item in self.result.losses],
            "gains": [dataclasses.asdict(item) for item in self.result.gains],
            "squares": _square_facts(self.result.squares),
        }
        return dict(json_ready(facts))

    def require(self, points: float) -> None:
        """Raise GateFailedError if the change is below a number of points."""
        if self.result.change < points:
            before, after = self.names
            raise GateFailedError(
                f"{after} against {before}: {self.headline}: "
                f"the change is below {points:+g} points"
            )


def compare(
    before: str | Path,
    after: str | Path,
    *,
    frame: Frame = "robot_base",
    tolerance_m: float = TOLERANCE_M,
    tolerance_deg: float = TOLERANCE_DEG,
) -> MapComparison:
    """Compare two maps of the same kind, frame by frame, matched by pose.

    Parameters
    ----------
    before, after : Path
        Workspace maps or bin maps, or journals of unfinished runs.
    frame : {"robot_base", "bin", "world"}
        Where poses must agree; "bin" compares bins that stand in different places,
        "world" cells whose robots do.
    tolerance_m, tolerance_deg : float
        Poses closer than this are the same [m, deg].

    Raises
    ------
    MapFileError
        A file cannot be read.
    SettingsError
        The maps are of different kinds or have no pose in common.
    """
    before, after = Path(before), Path(after)
    a, b = _read_map(before), _read_map(after)
    kinds = [kind_of(record).replace("_", " ") for record in (a, b)]
    if kinds[0] != kinds[1]:
        raise SettingsError(
            f"{before} is a {kinds[0]}, {after} a {kinds[1]}; "
            "compare takes two maps of the same kind"
        )
    try:
        result = compare_maps(
            a, b, frame=frame, tolerance_m=tolerance_m, tolerance_deg=tolerance_deg
        )
    except SettingsError as error:
        raise SettingsError(f"{before} and {after}: {error}") from None
    return MapComparison(paths=(before, after), before=a, after=b, result=result)


@dataclass(frozen=True, slots=True, kw_only=True)
class MapComparisons:
    """One map against each of several others.

    Attributes
    ----------
    each : tuple of MapComparison
        The first map is the same in all.
    significant : tuple of bool
        Which changes are significant, at a false-discovery rate of 5 % over all.
    """

    each: tuple[MapComparison, ...]
    significant: tuple[bool, ...]

    def facts(self) -> dict[str, Any]:
        """Everything as JSON values."""
        return {
            "before": str(self.each[0].paths[0]),
            "comparisons": [
                item.facts() | {"significant": named}
                for item, named in zip(self.each, self.significant, strict=True)
            ],
        }

    def require(self, points: float) -> None:
        """Raise GateFailedError if a change is below a number of points."""
        for item in self.each:
            item.require(points)


def compare_many(
    before: Path,
    others: Sequence[Path],
    *,
    frame: Frame = "robot_base",
    tolerance_m: float = TOLERANCE_M,
    tolerance_deg: float = TOLERANCE_DEG,
) -> MapComparisons:
    """Compare one map with each of several; see :func:`compare`."""
    each = tuple(
        compare(
            before,
            after,
            frame=frame,
            tolerance_m=tolerance_m,
            tolerance_deg=tolerance_deg,
        )
        for after in others
    )
    p_values = np.array([item.result.p_value for item in each])
    named = tuple(benjamini_hochberg(p_values).tolist())
    return MapComparisons(each=each, significant=named)


def draw_many(
    comparisons: MapComparisons, output: Path, *, overwrite: bool = False
) -> tuple[Path, ...]:
    """Draw all maps side by side, at the level that changed most.

    Parameters
    ----------
    comparisons : MapComparisons
    output : Path
        A file name in .png or .svg, or a folder.
    """
    from reachmap.plots.comparison import draw_small_multiples
    from reachmap.plots.parts.files import Picture, write_all

    changes = [map_change(item) for item in comparisons.each]
    is_file = output.suffix in SUFFIXES
    picture = Picture(
        name=output.stem if is_file else "comparison",
        title="Maps compared",
        draw=partial(draw_small_multiples, changes, comparisons.significant),
    )
    return write_all(
        output.parent if is_file else output,
        [picture],
        kind="svg" if output.suffix == ".svg" else "png",
        config_sha256=comparisons.each[-1].after.stamp.config_sha256,
        overwrite=overwrite,
        inputs=[path for item in comparisons.each for path in item.paths],
    )


def _read_map(path: Path) -> WorkspaceMap | BinMap:
    record, _ = read_artefact_or_journal(path)
    if not isinstance(record, WorkspaceMap | BinMap):
        kind = kind_of(record).replace("_", " ")
        text = "compare takes workspace maps or bin maps"
        raise SettingsError(f"{path}: a {kind}; {text}")
    return record


def draw(
    comparison: MapComparison, output: Path, *, overwrite: bool = False
) -> tuple[Path, ...]:
    """Draw a comparison.

    Parameters
    ----------
    comparison : MapComparison
    output : Path
        A file name in .png or .svg for the level that changed most, or a folder for
        that and an overview of all levels.

    Returns
    -------
    tuple of Path
        The files written.
    """
    from reachmap.plots.albums import comparison_album
    from reachmap.plots.parts.files import write_all

    items = comparison_album(map_change(comparison))
    folder, suffix = output, ".png"
    if output.suffix in SUFFIXES:
        items = [dataclasses.replace(items[0], name=output.stem)]
        folder, suffix = output.parent, output.suffix
    return write_all(
        folder,
        items,
        kind="svg" if suffix == ".svg" else "png",
        config_sha256=comparison.after.stamp.config_sha256,
        overwrite=overwrite,
        inputs=comparison.paths,
    )


def map_change(comparison: MapComparison) -> MapChange:
    """Bring a comparison into the form that pictures are drawn from."""
    from reachmap.plots.comparison import MapChange
    from reachmap.plots.parts.context import context_of

    squares, after = comparison.result.squares, comparison.after
    in_bin = isinstance(after, BinMap)
    return MapChange(
        x=squares.x,
        y=squares.y,
        z=squares.z,
        before=squares.percent("before"),
        after=squares.percent("after"),
        significant=squares.significant,
        names=comparison.names,
        headline=comparison.headline[:1].upper() + comparison.headline[1:],
        details=_details(comparison.result),
        frame="bin" if in_bin else comparison.result.frame,
        outlines=(
            ()
            if in_bin or comparison.result.frame == "world"
            else context_of(after.provenance).standing
        ),
    )


def _details(result: Comparison) -> str:
    return f"{result.common} test frames, {result.gained} gained, {result.lost} lost"


def _square_facts(squares: SquareChange) -> list[dict[str, Any]]:
    rows = zip(*squares.frames.nonzero(), strict=True)
    return [
        {
            "x": squares.x[k[2]],
            "y": squares.y[k[1]],
            "z": squares.z[k[0]],
            "frames": squares.frames[k],
            "before": squares.before[k],
            "after": squares.after[k],
            "change_points": 100.0
            * (squares.after[k] - squares.before[k])
            / squares.frames[k],
            "p_value": squares.p_value[k],
            "significant": squares.significant[k],
        }
        for k in rows
    ]
