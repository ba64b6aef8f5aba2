"""What is varied: ranges, lists, samples, and the variant that is the base."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.cell.loading import LoadedCell, cell_from_text, cell_path, read_cell
from reachmap.errors import SettingsError
from reachmap.studies.design import base_of, factors_of, grid, latin_hypercube


@pytest.fixture(scope="module")
def toy() -> LoadedCell:
    """The toy cell."""
    return read_cell("planar-toy")


def test_a_grid_is_every_combination_the_last_fastest(toy: LoadedCell) -> None:
    """Even values read as they would be written; the order is that of nested loops."""
    texts = ["bin.pose.xyz.0=0.1:0.3:3", "bin.wall=0.01,0.02"]
    factors = factors_of(texts, toy, sampled=False)
    variants = grid(factors)
    assert [variant.overrides for variant in variants] == [
        (f"bin.pose.xyz.0={x}", f"bin.wall={wall}")
        for x in ("0.1", "0.2", "0.3")
        for wall in ("0.01", "0.02")
    ]
    assert [v.values for v in variants][:2] == [(0.1, 0.01), (0.1, 0.02)]
    # The toy's bin is at x = 0.15: as close to 0.1 as to 0.2; its wall is 0.01.
    assert base_of(factors, variants, toy) == 0


def test_values_in_brackets_are_one_value(toy: LoadedCell) -> None:
    """Lists and texts are told apart by their place."""
    text = "bodies.post.pose.xyz=[0.06,0,0],[0,0.06,0]"
    (factor,) = factors_of([text], toy, sampled=False)
    assert factor.texts == ("[0.06,0,0]", "[0,0.06,0]")
    assert (factor.unit, factor.numbers) == ("choice", (0.0, 1.0))
    assert base_of([factor], grid([factor])[::-1], toy) == 1


def test_a_parameter_goes_by_its_name_and_has_its_unit() -> None:
    """The names of a cell's parameters come before its keys."""
    cell = read_cell("ur5-eye-in-hand")
    (factor,) = factors_of(["tube_length=0.119,0.2"], cell, sampled=False)
    assert (factor.key, factor.unit) == ("parameters.tube_length", "m")
    assert base_of([factor], grid([factor])[::-1], cell) == 1


def test_a_latin_hypercube_takes_each_part_of_each_range_once(toy: LoadedCell) -> None:
    """Ten samples, ten parts; the seed decides."""
    texts = ["bin.pose.xyz.0=0.1:0.3", "bin.wall=0.01:0.02"]
    factors = factors_of(texts, toy, sampled=True)
    values = np.array([v.values for v in latin_hypercube(factors, 10, seed=3)])
    parts = np.floor((values - [0.1, 0.01]) / [0.02, 0.001]).astype(int)
    assert sorted(parts[:, 0]) == sorted(parts[:, 1]) == list(range(10))
    again = latin_hypercube(factors, 10, seed=3)
    assert np.array_equal([v.values for v in again], values)
    other = latin_hypercube(factors, 10, seed=4)
    assert not np.array_equal([v.values for v in other], values)


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        (["bin.wall"], "expected NAME=LOW:HIGH:N or NAME=a,b,c"),
        (["bin.wall=1:2"], "expected NAME=LOW:HIGH:N with N from 2 to 1000"),
        (["bin.wall=1:2:1"], "expected NAME=LOW:HIGH:N with N from 2 to 1000"),
        (["bin.wall=2:1:3"], "expected LOW below HIGH"),
        (["bin.wall=1,,2"], "an empty or repeated value"),
        (["bin.wall=1,1"], "an empty or repeated value"),
        (
            ["bin.wall=1:2:x"],
            "--vary .*'1:2:x' is not a range; expected NAME=LOW:HIGH:N",
        ),
        (["bin.wall=1:inf:3"], "'1:inf:3' is not a range"),
        (["bin.wall=1:2:3,4"], "'1:2:3' is not a range"),
        (["bin.wall=nan,1"], "nan is not a finite number"),
        (["bin.wall=-.Inf,1"], "-.Inf is not a finite number"),
        (["bin.wall=1,1e999"], "1e999 is not a finite number"),
        (["bin.wall=1,2", "bin.wall=3,4"], "given more than once"),
        (["tubelength=1,2"], "neither a parameter of the cell .* nor one of its keys"),
        (["colision.safety_margin_m=1,2"], "did you mean 'collision'?"),
    ],
)
def test_what_is_no_design_is_refused(
    texts: list[str], message: str, toy: LoadedCell
) -> None:
    """Before anything is computed."""
    with pytest.raises(SettingsError, match=message):
        factors_of(texts, toy, sampled=False)


def test_a_latin_hypercube_needs_a_range(toy: LoadedCell) -> None:
    """Of lists alone it would take the same values again; steps would not count."""
    listed = factors_of(["bin.wall=0.01,0.02"], toy, sampled=True)
    with pytest.raises(SettingsError, match="needs a range to sample"):
        latin_hypercube(listed, 5, seed=1)
    with pytest.raises(SettingsError, match="which --latin-hypercube samples"):
        factors_of(["bin.wall=0.01:0.02:5"], toy, sampled=True)
    both = factors_of(["bin.wall=0.01:0.02", "seed=1,2"], toy, sampled=True)
    assert len({v.overrides for v in latin_hypercube(both, 6, seed=1)}) == 6


def test_the_shipped_cell_is_the_same_with_and_without_its_parameters() -> None:
    """Expressions lead to the same numbers; the tube moves all that hangs on it."""
    cell = read_cell("ur5-eye-in-hand")
    text = cell_path("ur5-eye-in-hand").read_text()
    numbers = {
        '"=round(0.156 + tube_length, 6)"': "0.275",
        '"=tube_length"': "0.119",
        '"=round(0.155 + tube_length / 2, 6)"': "0.2145",
        '"=pedestal_height"': "0.80",
        '"=round(-0.002 - pedestal_height / 2, 6)"': "-0.402",
        '"=round(-0.028 - pedestal_height, 6)"': "-0.828",
        '"=round(0.998 - pedestal_height, 6)"': "0.198",
        '"=round(0.8 - pedestal_height, 6)"': "0",
    }
    for expression, number in numbers.items():
        assert expression in text
        text = text.replace(expression, number)
    plain = cell_from_text(text, label="plain", directory=cell.directory)
    assert "expressions" not in plain.cell.model_dump_json(exclude_defaults=True)
    assert plain.sha256 == cell.sha256
    longer = read_cell("ur5-eye-in-hand", ["parameters.tube_length=0.319"]).cell
    tube = longer.bodies[-1]
    assert tube.shape.cylinder is not None
    assert tube.shape.cylinder.length == 0.319
    assert tube.pose.xyz[2] == 0.3145
    assert longer.robot.tcp.xyz[2] == 0.475
