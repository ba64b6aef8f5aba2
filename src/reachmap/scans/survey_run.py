"""A survey of all frames of a scan, on all cores."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from reachmap.core.scene import Scene
from reachmap.sampling.frames import FrameGrid
from reachmap.scans.parallel import compute_units
from reachmap.scans.progress import Progress
from reachmap.scans.survey import Survey, join_surveys, survey_frames

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell

FRAMES_PER_UNIT = 270


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyContext:
    """What a worker needs for a survey; frames are numbered through the grids."""

    loaded: LoadedCell
    with_bin: bool
    grids: tuple[FrameGrid, ...]
    approach_m: float

    def blocks(self) -> list[tuple[int, slice]]:
        """Grid and range of frames of each unit."""
        return [
            (k, slice(start, min(start + FRAMES_PER_UNIT, grid.size)))
            for k, grid in enumerate(self.grids)
            for start in range(0, grid.size, FRAMES_PER_UNIT)
        ]


def run_survey(
    context: SurveyContext, *, workers: int, executor: str, progress: Progress
) -> Survey:
    """Survey all frames; the result does not depend on the number of workers."""
    frames = sum(grid.size for grid in context.grids)
    payloads = compute_units(
        survey_unit,
        len(context.blocks()),
        prepare=prepare_survey,
        context=context,
        workers=min(workers, max(1, math.ceil(frames / (4 * FRAMES_PER_UNIT)))),
        executor=executor,
        progress=progress,
    )
    return join_surveys([Survey(**payload) for payload in payloads])


def prepare_survey(context: SurveyContext) -> tuple[SurveyContext, Scene]:
    """Build the scene, once per worker."""
    return context, Scene.build(context.loaded, with_bin=context.with_bin)


def survey_unit(state: tuple[SurveyContext, Scene], unit: int) -> dict[str, Any]:
    """Survey one block of frames."""
    context, scene = state
    grid, block = context.blocks()[unit]
    T = context.grids[grid].transforms_at(block)
    survey = survey_frames(scene, T, context.approach_m)
    return {f.name: getattr(survey, f.name) for f in dataclasses.fields(survey)}
