"""The cell model: descriptions, schema, bounds."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import jsonschema
import pytest
from click.testing import CliRunner
from pydantic import BaseModel
from ruamel.yaml import YAML

from reachmap.cell.loading import read_cell, shipped_cells
from reachmap.cell.model.cell import Cell, cell_schema
from reachmap.cell.model.orientations import ConeFamily, ListFamily
from reachmap.cell.text.messages import known_keys
from reachmap.cli import group

EXAMPLES = Path(__file__).parents[3] / "examples"


def records(model: type[BaseModel] = Cell) -> Iterator[type[BaseModel]]:
    """The model and every record inside it."""
    seen: list[type[BaseModel]] = []
    waiting: list[object] = [model]
    while waiting:
        kind = waiting.pop()
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            if kind not in seen:
                seen.append(kind)
                waiting += [f.annotation for f in kind.model_fields.values()]
        else:
            waiting += getattr(kind, "__args__", ())
    yield from seen


@pytest.mark.parametrize("record", list(records()), ids=lambda record: record.__name__)
def test_every_field_is_described(record: type[BaseModel]) -> None:
    """The description is what editors show and what the reference prints."""
    assert record.__doc__
    for name, field in record.model_fields.items():
        assert field.description, name
        assert field.description.endswith((".", '"1.0".')), name


def test_all_records_are_found() -> None:
    """The walk above reaches into unions, tuples and tables."""
    names = {record.__name__ for record in records()}
    assert {"Cell", "ConeFamily", "ListFamily", "MeshShape", "PlacementSpec"} <= names


@pytest.mark.parametrize("name", shipped_cells())
def test_shipped_cells_agree_with_the_schema(name: str) -> None:
    """An independent validator accepts what the model accepts."""
    jsonschema.Draft202012Validator.check_schema(cell_schema())
    validator = jsonschema.Draft202012Validator(cell_schema())
    data = YAML(typ="safe", pure=True).load(shipped_cells()[name].read_text())
    validator.validate(data)
    validator.validate(json.loads(read_cell(name).resolved_json))
    data["bin"]["wal"] = 1
    assert [error.validator for error in validator.iter_errors(data)] == [
        "additionalProperties"
    ]


def test_the_schema_asks_for_one_bin_or_several() -> None:
    """By name in the place of the one, and for either."""
    validator = jsonschema.Draft202012Validator(cell_schema())
    data = YAML(typ="safe", pure=True).load(shipped_cells()["planar-toy"].read_text())
    bin_spec = data.pop("bin")
    assert [error.validator for error in validator.iter_errors(data)] == ["anyOf"]
    validator.validate({**data, "bins": {"left": bin_spec, "right": bin_spec}})


def test_the_schema_describes_every_key() -> None:
    """Every property of every definition has a description."""
    for definition in [cell_schema(), *cell_schema()["$defs"].values()]:
        for name, entry in definition["properties"].items():
            assert "description" in entry, name


def test_schema_command_prints_both_schemas() -> None:
    """Standard output is the JSON Schema and nothing else."""
    for name in ("cell", "grasps"):
        result = CliRunner().invoke(group, ["schema", name])
        assert result.exit_code == 0
        schema = json.loads(result.stdout)
        jsonschema.Draft202012Validator.check_schema(schema)
        assert schema["$id"] == f"reachmap/{name}-1.schema.json"


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.json")), ids=lambda p: p.name)
def test_example_lists_agree_with_the_schema(path: Path) -> None:
    """The grasp lists that the tutorial ranks are what editors call valid."""
    schema = json.loads(CliRunner().invoke(group, ["schema", "grasps"]).stdout)
    validator = jsonschema.Draft202012Validator(schema)
    document = json.loads(path.read_text())
    validator.validate(document)
    del document["grasps"][0]["position"]
    assert not validator.is_valid(document)


def test_known_keys_follow_lists_unions_and_tables() -> None:
    """The keys that may stand at a location, as error messages suggest them."""
    assert known_keys(Cell, ("bodies", 3, "shape", "mesh")) == ("file", "scale")
    families = known_keys(Cell, ("bin_scan", "orientations"))
    assert set(families) == {*ConeFamily.model_fields, *ListFamily.model_fields}
    assert known_keys(Cell, ("robot", "locked_joints_deg")) == ()
    assert known_keys(Cell, ("bin", "pose", "xyz", 0)) == ()
    assert known_keys(Cell, ("nothing", "here")) == ()


def test_frames_are_counted_as_scanned() -> None:
    """The paper's bin grid has 7560 test grasps; a cube counts its last level."""
    cell = read_cell("ur5-eye-in-hand").cell
    bin_scan = cell.bin_scan.model_copy(
        update={
            "grid": (20, 14),
            "layers": (0.05,),
            "orientations": ConeFamily(),
        }
    )
    assert bin_scan.count() == 7560
    toy = read_cell("planar-toy", ["workspace_scan.cubes.0.max.2=0.3"]).cell
    assert toy.workspace_scan.count() == (15 * 8 * 4 + 15 * 8) * 4
