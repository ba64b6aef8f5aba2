"""``reachmap rank``: grasp lists and a bin map in, re-ordered grasp lists out."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reachmap.disk import as_path, is_folder, one_or_more
from reachmap.errors import GateFailedError, MapFileError, SettingsError
from reachmap.maps import read_bin_map
from reachmap.maps.bytes.publish import (
    check_outputs,
    check_picture,
    make_folder,
    publish,
)
from reachmap.maps.records import BinMap
from reachmap.ranking.answers.explain import explanation, find_grasp
from reachmap.ranking.answers.ranked_list import (
    RankedList,
    document_text,
    pose_from_numbers,
    rank_list,
    ranked_document,
)
from reachmap.ranking.lists.arrays import GraspList
from reachmap.ranking.lists.reading import STDIN, read_grasps
from reachmap.ranking.lookup.probability import calibration_beside, usual_calibration
from reachmap.ranking.lookup.ranker import Ranker
from reachmap.ranking.lookup.settings import CostBasis, Invalid, RankSettings

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class ListFormat:
    """Format of grasp lists, where they do not state it themselves.

    Attributes
    ----------
    name : str or None
        One of :data:`.importers.FORMATS`; None looks at the content.
    frame : str or None
        Frame of imported lists.
    frame_pose : sequence of 7 float, or None
        Pose of the lists' frame in robot_base: x, y, z [m], quaternion wxyz.
    approach_axis : str or None
        Approach axis of imported orientations.
    invalid : {"raise", "mark"}
        How to treat grasps with invalid numbers.
    """

    name: str | None = None
    frame: str | None = None
    frame_pose: Sequence[float] | None = None
    approach_axis: str | None = None
    invalid: Invalid = "raise"


@dataclass(frozen=True, slots=True, kw_only=True)
class RankAnswer:
    """Result of ranking lists.

    Attributes
    ----------
    documents : tuple of mapping
        One re-ordered grasp list for each one supplied.
    text : str
        The documents as JSON: one, or a list of several.
    ranked : tuple of RankedList
        One ranking for each list.
    explanation : str
        The explanation of the requested grasp, or "".
    written : tuple of Path
    """

    documents: tuple[Mapping[str, Any], ...]
    text: str
    ranked: tuple[RankedList, ...]
    explanation: str = ""
    written: tuple[Path, ...] = ()

    def require_reachable(self, number: float, *, percent: bool = False) -> None:
        """Raise GateFailedError if a list has fewer reachable grasps than asked for.

        Parameters
        ----------
        number : float
            Least number of reachable grasps of each list, or their least percentage.
        percent : bool
        """
        for one in self.ranked:
            reached, total = int(one.ranking.reachable.sum()), len(one.grasps)
            share = 100.0 * reached / total if total else 0.0
            if (share if percent else reached) < number:
                wanted = f"{number:g} %" if percent else f"{number:g}"
                raise GateFailedError(
                    f"{one.grasps.source}: {reached} of {total} grasps are reachable "
                    f"({share:.1f} %), which is below {wanted}"
                )


def rank(
    sources: Sequence[str | Path],
    *,
    map_path: str | Path = "bin.h5",
    output: str | Path | None = None,
    settings: RankSettings | None = None,
    basis: CostBasis | None = None,
    list_format: ListFormat | None = None,
    cell: str | Path | None = None,
    overrides: Sequence[str] = (),
    force: bool = False,
    top: int | None = None,
    explain: str | None = None,
    chart: str | Path | None = None,
    chart_top: int = 10,
    overwrite: bool = False,
) -> RankAnswer:
    """Re-order grasp lists by the cost of reaching them.

    Parameters
    ----------
    sources : sequence of path
        Grasp lists; ``-`` is standard input.
    map_path : path
        A bin map.
    output : Path, optional
        A file, or a folder for one file each; several lists in one file make a JSON
        list. Nothing is written by default.
    settings : RankSettings, optional
    basis : CostBasis, optional
    list_format : ListFormat, optional
    cell, overrides : str, sequence of str
        A cell the map must have been made for.
    force : bool
        Rank even if it was made for another.
    top : int, optional
        Keep only this many of the best of each list.
    explain : str, optional
        Id of a grasp whose story is wanted.
    chart : Path, optional
        A picture (.png or .svg) of the costs of the first ``chart_top`` grasps.
    overwrite : bool

    Raises
    ------
    GraspListError, MapFileError, SettingsError, OutputError
    """
    sources, output, chart = one_or_more(sources), as_path(output), as_path(chart)
    cell = None if cell is None else str(cell)
    settings, list_format = settings or RankSettings(), list_format or ListFormat()
    _check_request(sources, top, chart_top)
    check_picture(chart, "--chart")
    targets = _targets_of(sources, output)
    # A cell is a name or a file; either way it is not to be replaced.
    inputs = [map_path, calibration_beside(map_path), cell]
    inputs += [source for source in sources if source != STDIN]
    check_outputs([*targets, chart], overwrite=overwrite, inputs=inputs)
    lists = [read_list(source, list_format) for source in sources]
    bin_map = read_bin_map(Path(map_path))
    if cell is not None:
        outputs = [*targets, chart]
        _check_cell(bin_map, map_path, cell, overrides, outputs, force=force)
    ranker = ranker_of(bin_map, map_path, basis)
    ranked = [_rank_one(grasps, ranker, settings, list_format) for grasps in lists]
    story = ""
    if explain is not None:
        story = explanation(*find_grasp(ranked, explain), ranker, bin_map)
    documents = [ranked_document(one, top) for one in ranked]
    texts = [document_text(document) for document in documents]
    _write_lists(targets, texts, overwrite=overwrite)
    if chart is not None:
        _draw(
            chart, ranked, bin_map.stamp.config_sha256, chart_top, overwrite=overwrite
        )
    return RankAnswer(
        documents=tuple(documents),
        text=_joined(texts),
        ranked=tuple(ranked),
        explanation=story,
        written=(*targets, *([] if chart is None else [chart])),
    )


def _check_request(
    sources: Sequence[str | Path], top: int | None, chart_top: int
) -> None:
    if not sources:
        raise SettingsError("name a grasp list, or - for standard input")
    if sum(str(source) == STDIN for source in sources) > 1:
        raise SettingsError("standard input can be read once")
    for name, value in (("top", top), ("chart-top", chart_top)):
        if value is not None and value < 1:
            raise SettingsError(f"{name} must be 1 or more (got {value})")


def ranker_of(
    bin_map: BinMap,
    map_path: str | Path,
    basis: CostBasis | None,
    *,
    calibrated: bool = True,
) -> Ranker:
    """Make a ranker; deviations from the requested basis are logged.

    By default it has the calibration beside the map.
    """
    basis = basis or CostBasis()
    known = usual_calibration(map_path, bin_map.stamp) if calibrated else None
    ranker = Ranker(bin_map, basis, known)
    if ranker.table.basis != basis:
        logger.warning(
            "%s: has no counts of state checks (format %s), so measured planning times "
            "are used, which differ from run to run; scan again for a reproducible "
            "order",
            map_path,
            bin_map.stamp.format_version,
        )
    return ranker


def _check_cell(
    bin_map: BinMap,
    map_path: str | Path,
    cell: str,
    overrides: Sequence[str],
    outputs: Sequence[Path | None],
    *,
    force: bool,
) -> None:
    """Refuse a map of another cell, and outputs that replace files of the cell."""
    # Imported here: reading cells takes longer than ranking.
    from reachmap.cell.loading import read_cell
    from reachmap.ranking.answers.cell_check import differing_sections
    from reachmap.tools.prologue import refuse_cell_files

    loaded = read_cell(cell, overrides)
    refuse_cell_files(outputs, loaded)
    different = differing_sections(bin_map, loaded)
    if not different:
        return
    message = f"{map_path}: was made for another cell than {cell}"
    message += f" (different: {', '.join(different)})"
    if not force:
        raise MapFileError(f"{message}; scan again, or rank anyway with --force")
    logger.warning("%s", message)


def read_list(source: str | Path, list_format: ListFormat) -> GraspList:
    """Read a grasp list; suspicious things are logged."""
    grasps = read_grasps(
        source,
        source_format=list_format.name,
        frame=list_format.frame,
        frame_is_posed=list_format.frame_pose is not None,
        approach_axis=list_format.approach_axis,
        invalid=list_format.invalid,
    )
    for warning in grasps.warnings:
        logger.warning("%s", warning)
    return grasps


def _rank_one(
    grasps: GraspList, ranker: Ranker, settings: RankSettings, list_format: ListFormat
) -> RankedList:
    numbers = list_format.frame_pose
    T = None if numbers is None else pose_from_numbers(numbers)
    ranked = rank_list(grasps, ranker, settings=settings, T_base_frame=T)
    for doubt in ranked.doubts:
        logger.warning("%s: %s", grasps.source, doubt)
    return ranked


def _draw(
    chart: Path,
    ranked: Sequence[RankedList],
    config_sha256: str,
    top: int,
    *,
    overwrite: bool,
) -> None:
    # Imported here: drawing takes longer than ranking.
    from reachmap.plots.parts.files import write_picture
    from reachmap.plots.ranking import cost_groups, ranking_chart

    figure = ranking_chart(
        cost_groups(ranked), tuple(ranked[0].terms()), top, subtitle=_subtitle(ranked)
    )
    write_picture(
        chart,
        figure,
        title="Mean cost of the first grasps",
        config_sha256=config_sha256,
        overwrite=overwrite,
    )


def _subtitle(ranked: Sequence[RankedList]) -> str:
    names = ", ".join(Path(one.grasps.source).name for one in ranked)
    if ranked[0].in_seconds:
        failure_s = ranked[0].header["failure_cost_s"]
        return f"{names} · a failed pick costs {failure_s:.1f} s"
    alpha, beta, delta = ranked[0].asked.weights
    return f"{names} · J with α = {alpha:g}, β = {beta:g}, δ = {delta:g}"


def _targets_of(sources: Sequence[str | Path], output: Path | None) -> list[Path]:
    """Name the file of each list, or the one file of all.

    Parameters
    ----------
    sources : sequence of path
        The supplied lists.
    output : Path or None
        A folder takes ``NAME.ranked.json`` for each list; of several lists, a name
        without suffix is a folder that is made. Any other name is one file.

    Raises
    ------
    OutputError, SettingsError
        The folder cannot be made, or two lists have the same name.
    """
    if output is None:
        return []
    if not is_folder(output) and (len(sources) == 1 or output.suffix):
        return [output]
    targets = [output / _ranked_name(source) for source in sources]
    if len(set(targets)) < len(targets):
        raise SettingsError(
            "two lists have the same name; rank them one after the other"
        )
    make_folder(output)
    return targets


def _ranked_name(source: str | Path) -> str:
    stem = "stdin" if str(source) == STDIN else Path(source).stem
    return f"{stem.removesuffix('.ranked')}.ranked.json"


def _write_lists(
    targets: Sequence[Path], texts: Sequence[str], *, overwrite: bool
) -> None:
    """Write each list to its file, or all to the one file there is."""
    contents = texts if len(targets) == len(texts) else [_joined(texts)]
    for target, text in zip(targets, contents, strict=False):
        publish(target, [text.encode("ascii")], overwrite=overwrite)


def _joined(texts: Sequence[str]) -> str:
    """Return one JSON value: a document, or a list of several."""
    return texts[0] if len(texts) == 1 else f"[{','.join(texts)}]\n"
