"""The reference page and the files say the same."""

import re
from pathlib import Path

import h5py
import numpy as np
import pytest

from reachmap.maps import write_bin_map, write_placement, write_workspace_map
from reachmap.maps.format.layout import (
    COMMON_ATTRIBUTES,
    PROVENANCE_TEXTS,
    RUN_TEXTS,
    Layout,
    Variable,
)
from reachmap.maps.format.registry import LAYOUTS
from tests.support.synthetic_maps import (
    synthetic_bin_map,
    synthetic_placement,
    synthetic_workspace_map,
)
from tests.support.synthetic_parts import (
    bin_with_parts,
    placement_with_parts,
    workspace_with_parts,
)

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "artefacts.md"
TYPES = {"f8": "float64", "u1": "uint8", "i4": "int32", "u4": "uint32", "U": "text"}


def rows() -> dict[str, list[list[str]]]:
    """Rows of the page's tables by their first cell, section by section merged."""
    found: dict[str, list[list[str]]] = {}
    for line in PAGE.read_text().splitlines():
        if line.startswith("| `"):
            cells = [cell.strip() for cell in line.strip("|").split(" | ")]
            found.setdefault(cells[0].strip("`"), []).append(cells[1:])
    return found


def every_variable(layout: Layout) -> list[Variable]:
    """Variables of a layout and of its sections."""
    return [
        *layout.variables,
        *(variable for section in layout.sections for variable in section.variables),
    ]


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """One file of each kind."""
    folder = tmp_path_factory.mktemp("files")
    paths = [folder / name for name in ("workspace.h5", "bin.h5", "placement.h5")]
    workspace = synthetic_workspace_map(np.full((1, 3, 2), 0.5), shared_row=1)
    write_workspace_map(paths[0], workspace_with_parts(workspace))
    write_bin_map(paths[1], bin_with_parts(synthetic_bin_map()))
    write_placement(paths[2], placement_with_parts(synthetic_placement()))
    return paths


def test_every_dataset_that_is_written_is_documented(files: list[Path]) -> None:
    """Name, dimensions, type and unit of each are a row of the page."""
    page = rows()

    def check(path: str, item: h5py.Dataset | h5py.Group) -> None:
        name = re.sub(r"^cubes/[^/]+/", "cubes/<name>/", path)
        if isinstance(item, h5py.Group):
            return
        assert name in page, path
        if item.shape == ():
            return
        last = path.rpartition("/")[2]
        dims = [dim[0].name.rpartition("/")[2] for dim in item.dims if len(dim)]
        row = [
            ", ".join([last] if item.is_scale else dims),
            "text" if h5py.check_string_dtype(item.dtype) else item.dtype.name,
            item.attrs["units"],
        ]
        assert row in [cells[:3] for cells in page[name]], path

    for path in files:
        with h5py.File(path) as file:
            file.visititems(check)


def test_every_attribute_that_is_written_is_documented(files: list[Path]) -> None:
    """Root attributes are rows, lists of variables are named with them."""
    page = rows()
    text = PAGE.read_text()
    for path in files:
        with h5py.File(path) as file:
            assert set(file.attrs) <= set(page)

            def check(name: str, item: h5py.Dataset | h5py.Group) -> None:
                internal = {"CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST"}
                for attribute in set(item.attrs) - internal - {"long_name"}:
                    assert f"`{attribute}`" in text, f"{name}: {attribute}"

            file.visititems(check)


@pytest.mark.parametrize("kind", LAYOUTS)
def test_the_page_has_every_variable_in_the_words_of_the_file(kind: str) -> None:
    """The meaning on the page is the long_name in the file; nothing is left over."""
    page = rows()
    for variable in every_variable(LAYOUTS[kind]):
        name = variable.path.replace("{cube}", "<name>")
        wanted = [
            ", ".join(variable.dims),
            TYPES[variable.dtype],
            variable.units,
        ]
        found = [
            cells
            for cells in page.get(name, [])
            if cells[:3] == wanted and cells[3].startswith(variable.meaning)
        ]
        assert found, name
        if variable.frame:
            assert any(f"`{variable.frame}`" in cells[3] for cells in found), name
    for name, meaning in LAYOUTS[kind].attributes.items():
        assert [meaning] in page[name], name


def test_the_page_has_nothing_that_no_file_has() -> None:
    """A row for each thing, and no row for anything else."""
    known = {
        variable.path.replace("{cube}", "<name>")
        for layout in LAYOUTS.values()
        for variable in every_variable(layout)
    }
    known |= {name for layout in LAYOUTS.values() for name in layout.attributes}
    known |= set(COMMON_ATTRIBUTES)
    known |= {f"provenance/{name}" for name in PROVENANCE_TEXTS}
    known |= {f"run/{name}" for name in RUN_TEXTS}
    known |= {"support", "workspace.h5", "placement.h5", "bin.h5", "study.h5"}
    known |= {"robustness.h5", "robot.h5"}
    assert set(rows()) == known


def test_the_states_are_listed() -> None:
    """Each code with its CF meaning, in order: of frames, and of stages."""
    table = re.findall(r"^\| (\d+) \| `(\w+)` \|", PAGE.read_text(), flags=re.MULTILINE)
    from reachmap.maps import Status
    from reachmap.maps.parts import StageStatus

    assert [(int(code), name) for code, name in table] == [
        (int(code), code.name.lower())
        for codes in (Status, StageStatus)
        for code in codes
    ]
