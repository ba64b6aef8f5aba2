"""``reachmap validate``: how well a bin map predicts planning to grasps."""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from reachmap.disk import as_path, one_or_more
from reachmap.errors import GraspListError, SettingsError
from reachmap.maps import read_bin_map
from reachmap.maps.bytes.publish import check_outputs, check_picture, publish_json
from reachmap.maps.parts import concatenated
from reachmap.maps.provenance import cell_of_artefact
from reachmap.maps.records import BinMap
from reachmap.ranking.answers.ranked_list import (
    RankedList,
    pose_from_numbers,
    rank_list,
)
from reachmap.ranking.lists.reading import STDIN
from reachmap.ranking.lookup.costs import cycle_of
from reachmap.ranking.lookup.probability import calibration_beside
from reachmap.ranking.lookup.ranker import Ranker
from reachmap.ranking.lookup.settings import CostBasis, RankSettings
from reachmap.runtime.options import IN_PROCESS, RunOptions
from reachmap.runtime.progress import Progress
from reachmap.sampling.frames import approach_distance_m
from reachmap.scans.bin_scan import pairs_of_fillings
from reachmap.tools.prologue import refuse_cell_files
from reachmap.tools.rank import ListFormat, ranker_of, read_list
from reachmap.validation.calibration import calibrate as fit_calibration
from reachmap.validation.calibration import check_number
from reachmap.validation.cycle_planning import CycleResults, plan_cycles
from reachmap.validation.cycles import judge_cycles, settings_in_j
from reachmap.validation.facts import facts_of
from reachmap.validation.judgement import JudgedList, judge_list
from reachmap.validation.picks import NO_PICKS, picks_of
from reachmap.validation.planning import PickContext, PickResults, plan_picks
from reachmap.validation.random_grasps import random_grasps
from reachmap.validation.routes import plan_picks_over_routes
from reachmap.validation.summary import Validation, summarise

# 15 degrees between rolls.
DEFAULT_ROLLS = 24
MAX_ROLLS, MAX_REPEATS = 360, 255

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class PickOptions:
    """How grasps are planned to.

    Attributes
    ----------
    rolls : int
        Steps of the tool's full turn that a grasp with a free roll is tried at.
    repeats : int or None
        Attempts at each grasp; None takes the map's.
    seed : int or None
        Of attempts and of random grasps; None takes the map's.
    overrides : sequence of str
        Changes to the map's cell, as in ``planner.name=RRTConnect``.
    """

    rolls: int = DEFAULT_ROLLS
    repeats: int | None = None
    seed: int | None = None
    overrides: Sequence[str] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class ValidateAnswer:
    """Result of a validation.

    Attributes
    ----------
    validation : Validation
    facts : mapping
        Its summary as JSON values.
    """

    validation: Validation
    facts: dict[str, Any]


def validate(
    map_path: str | Path,
    sources: Sequence[str | Path] = (),
    *,
    random: int | None = None,
    settings: RankSettings | None = None,
    basis: CostBasis | None = None,
    list_format: ListFormat | None = None,
    pick: PickOptions | None = None,
    top: int = 10,
    output: str | Path | None = None,
    chart: str | Path | None = None,
    calibrate: bool = False,
    run: RunOptions = IN_PROCESS,
) -> ValidateAnswer:
    """Rank grasps with a map, plan to each of them, and compare.

    Parameters
    ----------
    map_path : path
        A bin map; the cell it was made from is in it.
    sources : sequence of path
        Grasp lists; ``-`` is standard input.
    random : int, optional
        Number of grasps to draw from the mapped volume, as a list of their own.
    settings : RankSettings, optional
    basis : CostBasis, optional
    list_format : ListFormat, optional
    pick : PickOptions, optional
    top : int
        How many of the first grasps of each order are compared.
    output : Path, optional
        A JSON file of the summary and every grasp.
    chart : Path, optional
        A picture (.png or .svg).
    calibrate : bool
        Keep a calibration beside the map, which gives every later ranking with it
        calibrated probabilities.
    run : RunOptions
        Its shard and restart do not apply.

    Raises
    ------
    ReachmapError
        See :mod:`reachmap.errors`.
    """
    sources, output, chart = one_or_more(sources), as_path(output), as_path(chart)
    asked, pick = settings or RankSettings(), pick or PickOptions()
    # Paths are judged by J, and cycles by seconds, whatever the settings.
    settings = settings_in_j(asked)
    _check_request(sources, random, pick, top)
    check_picture(chart, "--chart")
    calibration = calibration_beside(map_path) if calibrate else None
    outputs = [output, chart, calibration]
    check_outputs(outputs, overwrite=run.overwrite, inputs=[map_path, *sources])
    bin_map = read_bin_map(Path(map_path))
    context = _context(bin_map, str(map_path), pick)
    refuse_cell_files(outputs, context.loaded)
    ranker = ranker_of(bin_map, map_path, basis, calibrated=not calibrate)
    if asked.cost == "cycle":
        cycle_of(ranker.table)
    ranked = [
        _rank(source, ranker, settings, list_format or ListFormat())
        for source in sources
    ]
    if random is not None:
        drawn = random_grasps(bin_map, random, context.seed)
        ranked.append(rank_list(drawn, ranker, settings=settings))
    if calibrate:
        _check_calibration(pick, ranked)
    context = _with_picks(context, ranked)
    attempts = _attempts(context)
    measure = plan_picks_over_routes if attempts == "roadmap" else plan_picks
    results = measure(context, run, progress=Progress("validate", quiet=run.quiet))
    cycles = None
    if bin_map.cycle is not None:
        cycles = plan_cycles(context, run, progress=Progress("cycles", quiet=run.quiet))
    validation = summarise(
        _judged(ranked, ranker, bin_map, asked, results, cycles),
        top=top,
        settings={
            **_facts_of_settings(map_path, bin_map, settings, context, top),
            **dataclasses.asdict(ranker.table.basis),
            "attempts": attempts,
        },
    )
    if calibration is not None:
        _calibrate(validation, calibration, overwrite=run.overwrite)
    _write(validation, output, chart, context.body_pairs, run.overwrite)
    return ValidateAnswer(validation=validation, facts=facts_of(validation))


def _judged(
    ranked: Sequence[RankedList],
    ranker: Ranker,
    bin_map: BinMap,
    asked: RankSettings,
    results: PickResults,
    cycles: CycleResults | None,
) -> list[JudgedList]:
    """Compare every list with the plans to its grasps."""
    judged = []
    for label, one, rows in zip(_labels(ranked), ranked, _rows_of(ranked), strict=True):
        own = judge_list(label, one, ranker, bin_map, results.take(rows))
        if cycles is not None:
            seen = judge_cycles(one, ranker, asked, cycles.take(rows))
            own = replace(own, cycles=seen)
        judged.append(own)
    return judged


def _with_picks(context: PickContext, ranked: Sequence[RankedList]) -> PickContext:
    """The context with the grasps of all lists, and the pairs of its cell's bodies.

    Raises
    ------
    GraspListError
        There are none.
    """
    picks = concatenated([picks_of(one) for one in ranked])
    if not len(picks):
        raise GraspListError("there are no grasps to plan to")
    pairs = tuple(pairs_of_fillings(context.loaded))
    return replace(context, picks=picks, body_pairs=pairs)


def _attempts(context: PickContext) -> str:
    """How grasps are planned to."""
    spec = context.loaded.cell.bin_scan
    if spec.attempts == "roadmap" and spec.is_filled:
        logger.warning(
            "scanned at levels of filling: each grasp is planned to from scratch, "
            "with the bin filled up to it, not over a roadmap"
        )
        return "planner"
    return spec.attempts


def _context(bin_map: BinMap, map_name: str, pick: PickOptions) -> PickContext:
    """Planning settings without grasps: by default those of the map."""
    overrides = pick.overrides
    if "attempts" not in bin_map.provenance.settings:
        # Older maps say nothing about attempts: they were all the planner's.
        overrides = ("bin_scan.attempts=planner", *overrides)
    return PickContext(
        loaded=cell_of_artefact(bin_map.provenance, map_name, overrides),
        picks=NO_PICKS,
        rolls=pick.rolls,
        repeats=pick.repeats or bin_map.path_found.shape[-1],
        seed=bin_map.stamp.seed if pick.seed is None else pick.seed,
    )


def _rank(
    source: str | Path,
    ranker: Ranker,
    settings: RankSettings,
    list_format: ListFormat,
) -> RankedList:
    numbers = list_format.frame_pose
    return rank_list(
        read_list(source, list_format),
        ranker,
        settings=settings,
        T_base_frame=None if numbers is None else pose_from_numbers(numbers),
    )


def _check_request(
    sources: Sequence[str | Path], random: int | None, pick: PickOptions, top: int
) -> None:
    if not sources and random is None:
        raise SettingsError("name a grasp list, or draw grasps with --random N")
    if sum(str(source) == STDIN for source in sources) > 1:
        raise SettingsError("standard input can be read once")
    bounded = (
        ("rolls", pick.rolls, MAX_ROLLS),
        ("repeats", 1 if pick.repeats is None else pick.repeats, MAX_REPEATS),
    )
    for name, value, most in bounded:
        if not 1 <= value <= most:
            raise SettingsError(f"{name} must be 1 to {most} (got {value})")
    if top < 1:
        raise SettingsError(f"top must be 1 or more (got {top})")


def _check_calibration(pick: PickOptions, ranked: Sequence[RankedList]) -> None:
    """Refuse to calibrate with another cell than the map's, or with few grasps."""
    if pick.overrides:
        raise SettingsError(
            "--calibrate: plans in the cell of the map; leave out --set"
        )
    check_number(sum(int((~np.isnan(o.ranking.probability)).sum()) for o in ranked))


def _calibrate(validation: Validation, path: Path, *, overwrite: bool) -> None:
    said = validation.settings
    names = ("planner", "rolls", "repeats", "seed", "roll")
    found = fit_calibration(
        str(said["map_sha256"]),
        np.concatenate([one.share for one in validation.lists]),
        np.concatenate([one.reached for one in validation.lists]),
        {
            "lists": [one.label for one in validation.lists],
            **{name: said[name] for name in names},
        },
    )
    publish_json(path, found.document(), overwrite=overwrite)
    logger.warning(
        "%s: %d grasps, %d reached; cross-validated calibration error %.3f",
        path,
        found.grasps,
        found.reached,
        found.error,
    )


def _labels(ranked: Sequence[RankedList]) -> list[str]:
    """Short names of lists, numbered where two are the same."""
    names = [Path(one.grasps.source).stem for one in ranked]
    return [
        f"{name} ({names[: k + 1].count(name)})" if names.count(name) > 1 else name
        for k, name in enumerate(names)
    ]


def _rows_of(ranked: Sequence[RankedList]) -> list[slice]:
    """Rows of each list among those of all."""
    ends = np.cumsum([len(one.grasps) for one in ranked]).tolist()
    return [
        slice(end - len(o.grasps), end) for o, end in zip(ranked, ends, strict=True)
    ]


def _facts_of_settings(
    map_path: str | Path,
    bin_map: BinMap,
    settings: RankSettings,
    context: PickContext,
    top: int,
) -> dict[str, Any]:
    cell = context.loaded.cell
    return {
        "map": str(map_path),
        "map_sha256": bin_map.stamp.content_sha256,
        "cell_sha256": context.loaded.sha256,
        "cell": cell.name,
        "test_grasps": bin_map.status.size,
        "map_repeats": bin_map.path_found.shape[-1],
        "planner": cell.planner.name,
        "approach_distance_m": approach_distance_m(cell),
        "weights": list(settings.weights),
        "likeness": settings.likeness,
        "neighbours": settings.neighbours,
        "roll": settings.roll,
        "rolls": context.rolls,
        "repeats": context.repeats,
        "seed": context.seed,
        "top": top,
    }


def _write(
    validation: Validation,
    output: Path | None,
    chart: Path | None,
    body_pairs: tuple[str, ...],
    overwrite: bool,
) -> None:
    if output is not None:
        publish_json(output, facts_of(validation, body_pairs), overwrite=overwrite)
    if chart is not None:
        # Imported here: drawing is rarely requested.
        from reachmap.plots.parts.files import write_picture
        from reachmap.plots.validation import validation_chart

        write_picture(
            chart,
            validation_chart(validation),
            title="Predicted by the map and found by planning",
            config_sha256=str(validation.settings["map_sha256"]),
            overwrite=overwrite,
        )
