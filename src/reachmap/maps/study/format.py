"""Studies: record to file and back."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from reachmap.maps.bytes.tree import Tree
from reachmap.maps.comparison.significance import benjamini_hochberg
from reachmap.maps.format.assembly import (
    assemble,
    origin_of,
    section_arrays,
    sections_of,
)
from reachmap.maps.format.checks import require
from reachmap.maps.format.layout import (
    PERCENT,
    Layout,
    Section,
    Variable,
    coordinate,
    index,
)
from reachmap.maps.format.store import RecordFile
from reachmap.maps.study.record import (
    MEANS,
    STATES,
    BinSquares,
    Study,
    VariantStatus,
)

TEXTS: Final = {
    "assignment": "What the variant sets.",
    "cause": "Why the variant failed, or was left out; empty: neither.",
    "cell_sha256": "Hash of the variant's cell; empty where it is none.",
    "workspace_sha256": "content_sha256 of its workspace map; empty: none.",
    "placement_sha256": "content_sha256 of its placement; empty: none.",
    "bin_sha256": "content_sha256 of its bin map; empty: none.",
}
NUMBERS: Final[dict[str, tuple[str, dict[str, Any]]]] = {
    "objective": ("Value of the objective; NaN: none.", {}),
    "objective_low": ("Lower end of its 95 % interval.", {}),
    "objective_high": ("Upper end of its 95 % interval.", {}),
    "change": ("Variant minus base over the frames they share; NaN: none.", {}),
    "change_low": ("Lower end of the 95 % interval of the change.", {}),
    "change_high": ("Upper end of the 95 % interval of the change.", {}),
    "p_value": ("Of the paired test; NaN: not tested.", {"low": 0.0, "high": 1.0}),
}
COUNTS: Final = {
    "pairs": "Frames that variant and base share.",
    "gained": "Shared frames that the variant alone reaches.",
    "lost": "Shared frames that the base alone reaches.",
}
ATTRIBUTES: Final = {
    "design": "How variants were chosen: `grid`, `latin_hypercube` or `optimised`.",
    "bin_mode": "Whether the bin was `kept` where the cell has it, or `placed`.",
    "base": "Variant that the others are compared with.",
    "best": "Best variant that meets the requirements, -1: none.",
    "runner_up": "The one after it, -1: none.",
    "requirements": "What a variant must meet, such as `bin_reachability >= 90`.",
    "parameter_names": "Names of the parameters, or keys of the cell.",
    "parameter_units": "Their units; `choice`: the place among values that are texts.",
    "objective_names": "Names of the objectives; `best` is about the first.",
    "states": "States of a variant.",
}
LISTS: Final = (
    "requirements",
    "parameter_names",
    "parameter_units",
    "objective_names",
)


def check_study(tree: Tree) -> list[str]:
    """Check intervals, rows, tests and states against each other."""
    value, change = tree.array("objective"), tree.array("change")
    done = tree.array("status") == VariantStatus.DONE
    p_value, significant = tree.array("p_value"), tree.array("significant")
    tested = ~np.isnan(p_value)
    named = np.zeros(p_value.shape, bool)
    named[tested] = benjamini_hochberg(p_value[tested])
    problems = [
        *require(done[:, None] | np.isnan(value), "objective must be NaN unless done"),
        *require(
            (tree.array("cause") == "") | ~done,
            "cause must be empty where a variant is done",
        ),
        *require(named == (significant == 1), "significant must follow from p_value"),
    ]
    for name, middle in (("objective", value), ("change", change)):
        low, high = tree.array(f"{name}_low"), tree.array(f"{name}_high")
        problems += require(
            np.isnan(low) | ((low <= middle + 1e-9) & (middle <= high + 1e-9)),
            f"{name} must lie in its interval",
        )
    problems += _check_counts(tree, change)
    for name, least in (("base", 0), ("best", -1), ("runner_up", -1)):
        row = tree.attributes.get(name)
        if not isinstance(row, int) or not least <= row < len(done):
            problems.append(f"the root attribute {name} must be a variant")
    return problems


def _check_counts(tree: Tree, change: Any) -> list[str]:
    pairs, gained, lost = (tree.array(name) for name in COUNTS)
    share = ~np.isin(tree.attributes["objective_names"], [*MEANS])
    counted = share[None, :] & ~np.isnan(change) & (pairs > 0)
    points = 100.0 * (gained - lost) / np.maximum(pairs, 1)
    return [
        *require(gained + lost <= pairs, "gained and lost must not exceed pairs"),
        *require(
            ~counted | (np.abs(points - change) < 1e-9),
            "change must be the frames gained and lost",
        ),
    ]


def _scale(name: str, meaning: str, labels: str) -> Variable:
    return Variable(
        path=name, dims=(name,), dtype="U", units="1", meaning=meaning, labels=labels
    )


def _of_variant(path: str, dtype: str, meaning: str, **more: Any) -> Variable:
    return Variable(
        path=path, dims=("variant",), dtype=dtype, units="1", meaning=meaning, **more
    )


def _of_objective(path: str, dtype: str, meaning: str, **more: Any) -> Variable:
    return Variable(
        path=path,
        dims=("variant", "objective_name"),
        dtype=dtype,
        units="1",
        meaning=meaning,
        **more,
    )


SQUARES = Section(
    field="squares",
    part=BinSquares,
    arrays={
        "bin_x": coordinate("bin_x", "Columns of test points.", "bin"),
        "bin_y": coordinate("bin_y", "Rows of test points.", "bin"),
        "bin_square": Variable(
            path="bin_square",
            dims=("variant", "bin_y", "bin_x"),
            dtype="f8",
            meaning="Share of the test grasps at a point that are reached; NaN: none.",
            nan=True,
            **PERCENT,
        ),
    },
)
STUDY = Layout(
    kind="study",
    title="Variants of a robot cell compared",
    signal="objective",
    axes=("variant", "objective_name"),
    check=check_study,
    attributes=ATTRIBUTES,
    variables=(
        index("variant", "Variants of the cell."),
        _scale("parameter_name", "Parameters that are varied.", "parameter_names"),
        _scale("objective_name", "What variants are judged by.", "objective_names"),
        Variable(
            path="parameter",
            dims=("variant", "parameter_name"),
            dtype="f8",
            units="1",
            meaning="Value of each parameter, in its own unit.",
            labels="parameter_units",
        ),
        _of_variant("status", "u1", "Its outcome.", labels="states", is_index=True),
        _of_variant("feasible", "u1", "1: it meets all requirements.", is_flag=True),
        *(_of_variant(name, "U", meaning) for name, meaning in TEXTS.items()),
        *(
            _of_objective(name, "f8", meaning, nan=True, **more)
            for name, (meaning, more) in NUMBERS.items()
        ),
        *(_of_objective(name, "i4", text, low=0) for name, text in COUNTS.items()),
        _of_objective(
            "significant",
            "u1",
            "1: more than chance, at a false-discovery rate of 5 % across the study.",
            is_flag=True,
        ),
    ),
    sections=(SQUARES,),
)
_ARRAYS: Final = ("parameter", "status", "feasible", "significant", *NUMBERS, *COUNTS)
_PLAIN: Final = ("design", "bin_mode", "base", "best", "runner_up")


def tree_from_study(record: Study) -> Tree:
    """Everything that the file will hold."""
    arrays: dict[str, Any] = {name: getattr(record, name) for name in _ARRAYS}
    arrays.update({name: np.array(getattr(record, name), str) for name in TEXTS})
    return assemble(
        STUDY,
        arrays=arrays | section_arrays(STUDY, record)[0],
        attributes={name: getattr(record, name) for name in _PLAIN},
        labels={"states": STATES} | {name: getattr(record, name) for name in LISTS},
        stamp=record.stamp,
        provenance=record.provenance,
        run=record.run,
    )


def study_from_tree(tree: Tree, path: Path) -> Study:
    """Turn a checked tree into a record; ``path`` is named in messages."""
    fields: dict[str, Any] = {name: tree.array(name) for name in _ARRAYS}
    fields.update({name: tuple(tree.array(name).tolist()) for name in TEXTS})
    fields.update({name: tuple(tree.attributes[name]) for name in LISTS})
    fields.update({name: tree.attributes[name] for name in _PLAIN})
    return Study(
        **fields,
        **sections_of(STUDY, tree),
        **origin_of(tree, path),
    )


_FILE = RecordFile(layout=STUDY, to_tree=tree_from_study, from_tree=study_from_tree)
write_study, read_study = _FILE.write, _FILE.read
