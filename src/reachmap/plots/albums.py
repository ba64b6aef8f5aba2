"""The pictures and tables of each artefact, and their names."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from reachmap._typing import FloatArray
from reachmap.errors import SettingsError
from reachmap.maps.base.record import BasePlacement
from reachmap.maps.cycle.summary import summarise_cycle
from reachmap.maps.records import BinMap, BinPlacement, WorkspaceMap
from reachmap.maps.robustness.record import Robustness
from reachmap.maps.study.record import Study
from reachmap.maps.summary.emptying import emptying_of
from reachmap.maps.summary.statistics import are_independent
from reachmap.plots.approach import draw_approach
from reachmap.plots.base import draw_base
from reachmap.plots.bin_map import (
    draw_clearance,
    draw_costs,
    draw_cycle,
    draw_directions,
    draw_reachability,
)
from reachmap.plots.causes import draw_causes
from reachmap.plots.comparison import MapChange, draw_change_sheet, draw_comparison
from reachmap.plots.curves.emptying import draw_emptying
from reachmap.plots.curves.robustness import draw_robustness
from reachmap.plots.curves.saturation import draw_saturation
from reachmap.plots.curves.timeline import draw_timeline
from reachmap.plots.heatmap import draw_level
from reachmap.plots.overview import draw_overview
from reachmap.plots.parts.bin_view import percent_after
from reachmap.plots.parts.context import levels_of
from reachmap.plots.parts.files import Picture, Table, level_table
from reachmap.plots.parts.levels import QUANTITY_NAMES, Quantity, level_names
from reachmap.plots.parts.stack import LevelStack, level_title, stack_of
from reachmap.plots.parts.style import PercentMap
from reachmap.plots.placement import draw_placement, placement_titles
from reachmap.plots.study import draw_best_maps, draw_grid, draw_main_effects
from reachmap.plots.study_space import draw_interactions, draw_parallel, draw_pareto

# How close a height must be to a level to mean it [m].
LEVEL_TOLERANCE = 1e-3

CANDIDATE_COLUMNS = (
    "x [m]", "y [m]", "z [m]", "yaw [deg]", "score [%]", "worst point [%]", "why not",
)  # fmt: skip


def workspace_album(
    workspace: WorkspaceMap,
    quantities: Sequence[Quantity],
    *,
    heights: Sequence[float] = (),
    percent_map: PercentMap = "RdYlGn",
    tables: bool = False,
) -> list[Picture | Table]:
    """List the pictures of a workspace map: levels, overview, causes.

    Parameters
    ----------
    workspace : WorkspaceMap
    quantities : sequence of str
    heights : sequence of float
        Levels to draw [m], nothing else; without any, everything.
    percent_map : str
    tables : bool
        Add a CSV file for each level.

    Raises
    ------
    SettingsError
        A height is no level of the map.
    """
    workspace = levels_of(workspace)
    levels = find_levels(workspace.z, heights)
    items: list[Picture | Table] = []
    for quantity in quantities:
        stack = stack_of(workspace, quantity)
        for level in levels:
            items += _level_items(stack, level, percent_map, tables)
        if not heights:
            title = f"{QUANTITY_NAMES[quantity]} on all levels"
            name = f"{quantity}_overview"
            style = {"percent_map": percent_map}
            items.append(_picture(name, title, draw_overview, stack, **style))
    if not heights:
        items.append(_causes_picture(workspace, "causes"))
    return items


def _picture(
    name: str, title: str, draw: Callable[..., Figure], *arguments: Any, **styles: Any
) -> Picture:
    """Name a picture that is drawn when it is wanted."""
    return Picture(name=name, title=title, draw=partial(draw, *arguments, **styles))


def _causes_picture(record: WorkspaceMap | BinMap, name: str) -> Picture:
    title = "States of the test frames, and bodies in the way"
    return _picture(name, title, draw_causes, record)


def _level_items(
    stack: LevelStack, level: int, percent_map: PercentMap, tables: bool
) -> list[Picture | Table]:
    name = f"{stack.quantity}_z{level_names(stack.z)[level]}"
    title, style = level_title(stack, level), {"percent_map": percent_map}
    picture = _picture(name, title, draw_level, stack, level, **style)
    if not tables:
        return [picture]
    text = level_table(stack.x, stack.y, stack.values[level])
    return [picture, Table(name=name, text=text)]


def find_levels(z: FloatArray, heights: Sequence[float]) -> list[int]:
    """Find the levels at some heights [m]; without any heights, all levels.

    Raises
    ------
    SettingsError
        A height is more than a millimetre from every level.
    """
    if not heights:
        return list(range(z.size))
    nearest = [int(np.abs(z - height).argmin()) for height in heights]
    problems = [
        f"--level: no level at z = {height:g} m (levels: {', '.join(level_names(z))})"
        for height, index in zip(heights, nearest, strict=True)
        if not abs(z[index] - height) <= LEVEL_TOLERANCE
    ]
    if problems:
        raise SettingsError(problems)
    return sorted(set(nearest))


def bin_album(
    bin_map: BinMap,
    cost: FloatArray | None = None,
    *,
    percent_map: PercentMap = "RdYlGn",
    tables: bool = False,
) -> list[Picture | Table]:
    """List the pictures of a bin map; those of a layer name it if there are several.

    Parameters
    ----------
    bin_map : BinMap
    cost : array, shape (nl, ny, nx, no), optional
        J of each test grasp; not finite where it is not path reachable.
    percent_map : str
    tables : bool
        Add the reachability of each layer as a CSV file.
    """
    items: list[Picture | Table] = []
    for layer, height in enumerate(level_names(bin_map.layer)):
        end = f"_layer{height}" if bin_map.layer.size > 1 else ""
        items += _layer_pictures(bin_map, cost, layer, end, percent_map)
        if tables:
            repeats = bin_map.path_found.shape[-1]
            values = percent_after(bin_map, repeats)[layer]
            text = level_table(bin_map.x, bin_map.y, values)
            items.append(Table(name=f"bin_reachability{end}", text=text))
    if are_independent(bin_map):
        title = "Test grasps reached over the number of attempts"
        items.append(_picture("bin_saturation", title, draw_saturation, bin_map))
    emptying = emptying_of(bin_map)
    if emptying is not None:
        title = f"Emptying: {emptying.sentence}"
        items.append(_picture("bin_emptying", title, draw_emptying, bin_map, emptying))
    cycle = summarise_cycle(bin_map)
    if cycle is not None and cycle.whole:
        title = f"Timeline: {cycle.sentence}"
        items.append(_picture("bin_timeline", title, draw_timeline, bin_map, cycle))
    return [*items, _causes_picture(bin_map, "bin_causes")]


def _layer_pictures(
    bin_map: BinMap,
    cost: FloatArray | None,
    layer: int,
    end: str,
    percent_map: PercentMap,
) -> Iterator[Picture]:
    style = {"percent_map": percent_map}
    title = "Path reachability in the bin"
    name = f"bin_reachability{end}"
    yield _picture(name, title, draw_reachability, bin_map, layer, **style)
    title = "Path reachability of test grasps, directions and points"
    name = f"bin_directions{end}"
    yield _picture(name, title, draw_directions, bin_map, layer, **style)
    title = "Cost of reaching into the bin"
    yield _picture(f"bin_costs{end}", title, draw_costs, bin_map, cost, layer)
    title = "Which approach directions and rolls work where"
    yield _picture(f"bin_approach{end}", title, draw_approach, bin_map, layer)
    if bin_map.margins is not None:
        title = "Clearance on the path to the grasp"
        yield _picture(f"bin_clearance{end}", title, draw_clearance, bin_map, layer)
    if bin_map.cycle is not None:
        title = "Whole picks in the bin"
        yield _picture(f"bin_cycle{end}", title, draw_cycle, bin_map, layer, **style)


def placement_album(
    placement: BinPlacement,
    workspace: WorkspaceMap | None = None,
    *,
    percent_map: PercentMap = "RdYlGn",
    tables: bool = False,
) -> list[Picture | Table]:
    """List the picture of a placement, on the map it was chosen from if given."""
    picture = _picture(
        "placement",
        placement_titles(placement)[0],
        draw_placement,
        placement,
        workspace,
        percent_map=percent_map,
    )
    if not tables:
        return [picture]
    return [picture, Table(name="placement", text=_candidate_table(placement))]


def comparison_album(maps: MapChange) -> list[Picture | Table]:
    """List the pictures of two maps: the level that changed most, then all levels."""
    title = maps.headline
    one = _picture("comparison", title, draw_comparison, maps)
    if maps.z.size == 1:
        return [one]
    return [one, _picture("comparison_overview", title, draw_change_sheet, maps)]


def _candidate_table(placement: BinPlacement) -> str:
    """CSV of all candidates, the best first and the excluded ones last."""
    stream = io.StringIO(newline="")
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(CANDIDATE_COLUMNS)
    for index in np.argsort(-np.nan_to_num(placement.score, nan=-1.0), kind="stable"):
        x, y, z, yaw = placement.candidate_pose[index]
        numbers = (placement.score[index], placement.worst_point[index])
        writer.writerow(
            [
                *(f"{value:.4f}" for value in (x, y, z)),
                f"{np.degrees(yaw):.2f}",
                *("" if np.isnan(value) else f"{value:.2f}" for value in numbers),
                placement.reason[index],
            ]
        )
    return stream.getvalue()


def study_album(
    study: Study,
    *,
    percent_map: PercentMap = "RdYlGn",
    effects_on: Sequence[str] | None = None,
) -> list[Picture | Table]:
    """List the pictures of a study.

    Main effects, the grid of two parameters or interactions of more, maps of the base
    and the best, all variants across their parameters, and what is traded off against
    the first objective.
    """
    items: list[Picture | Table] = []
    is_grid, count = study.design == "grid", len(study.parameter_names)
    known = study.done & ~np.isnan(study.objective[:, 0])
    for k, name in enumerate(study.objective_names):
        if effects_on is not None and name not in effects_on:
            continue
        effects = partial(draw_main_effects, study, k)
        title = f"Main effects on {name}"
        items.append(Picture(name=f"effects_{name}", title=title, draw=effects))
        if is_grid and count == 2:
            draw = partial(draw_grid, study, k, percent_map)
            title = f"{name} over both parameters"
            items.append(Picture(name=f"grid_{name}", title=title, draw=draw))
        elif is_grid and count > 2 and known.any():
            draw = partial(draw_interactions, study, k, percent_map)
            title = f"{name} over every two parameters"
            items.append(Picture(name=f"interactions_{name}", title=title, draw=draw))
    first = study.objective_names[0]
    if study.squares is not None and known.any():
        draw = partial(draw_best_maps, study, percent_map)
        title = f"Base and best by {first}"
        items.append(Picture(name="best_maps", title=title, draw=draw))
    if count > 1 and known.any():
        draw = partial(draw_parallel, study, 0, percent_map)
        title = f"All variants, {first}"
        items.append(Picture(name="variants", title=title, draw=draw))
    for k, name in enumerate(study.objective_names[1:], 1):
        title = f"{first} against {name}"
        draw = partial(draw_pareto, study, 0, k)
        items.append(Picture(name=f"pareto_{name}", title=title, draw=draw))
    return items


def robustness_album(record: Robustness) -> list[Picture | Table]:
    """List the picture of what errors cost."""
    title = "Reachability over the errors of the cell"
    return [_picture("robustness", title, draw_robustness, record)]


def base_album(
    placement: BasePlacement, *, percent_map: PercentMap = "RdYlGn"
) -> list[Picture | Table]:
    """List the picture of a place of an arm."""
    title = "Where the robot goes"
    return [_picture("robot", title, draw_base, placement, percent_map)]
