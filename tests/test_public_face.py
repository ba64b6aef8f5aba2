"""What ``import reachmap`` offers."""

from __future__ import annotations

import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import reachmap
from reachmap.errors import SettingsError
from reachmap.maps import write_bin_map
from reachmap.motions.motion import best_rows
from reachmap.tools.prologue import with_seed
from tests.support.toy_artefacts import toy_bin_map


def test_every_public_name_is_there_and_is_what_its_home_defines() -> None:
    """A name of ``__all__`` that cannot be imported would fail at its first user."""
    homes = reachmap._HOMES
    assert {*homes, "__version__"} == set(reachmap.__all__)
    for name, home in homes.items():
        module, _, attribute = home.partition(":")
        value = getattr(reachmap, name)
        assert value.__module__.startswith("reachmap."), name
        defined = getattr(sys.modules[f"reachmap.{module}"], attribute or name)
        assert value is defined
    assert set(reachmap.__all__) <= set(dir(reachmap))


def test_unknown_names_are_attribute_errors() -> None:
    """``hasattr`` and ``from reachmap import …`` behave as with any module."""
    assert not hasattr(reachmap, "no_such_name")


def test_importing_the_package_loads_nothing() -> None:
    """Engines cost seconds; they come with the first name that needs them."""
    code = (
        "import sys, reachmap\n"
        "heavy = {'numpy', 'pinocchio', 'ompl', 'h5py', 'matplotlib', 'pydantic'}\n"
        "print(sorted(heavy & set(sys.modules)))\n"
        "reachmap.Ranker\n"
        "print(sorted(heavy & set(sys.modules) - {'numpy', 'h5py'}))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True
    )
    assert done.stdout.splitlines() == ["[]", "[]"]


def test_paths_may_be_text_everywhere() -> None:
    """Whoever writes a script has names, not Path objects."""
    strict = [
        f"{name}({parameter.name}: {parameter.annotation})"
        for name in reachmap.__all__
        if inspect.isfunction(tool := getattr(reachmap, name))
        for parameter in inspect.signature(tool).parameters.values()
        if "Path" in str(parameter.annotation)
        and "str" not in str(parameter.annotation)
    ]
    assert not strict


def test_what_is_typed_into_a_prompt_answers_in_a_line(tmp_path: Path) -> None:
    """Arrays and whole cells are not spelt out."""
    record = toy_bin_map()
    write_bin_map(tmp_path / "bin.h5", record)
    library = reachmap.MotionLibrary.from_map(tmp_path / "bin.h5")
    place, _ = next(iter(best_rows(record).items()))
    served = library.serve(
        record.position[place[:3]], quaternion_wxyz=record.quaternion_wxyz[place]
    )
    ranker = reachmap.Ranker.from_map(tmp_path / "bin.h5")
    ranking = ranker.rank(record.position[0, 0, :2], [[1.0, 0.0, 0.0]] * 2)
    loaded = reachmap.load_cell("planar-toy")
    for value in (library, served, ranker, ranking, loaded, library.scenes[0]):
        assert repr(value).startswith(f"<{type(value).__name__}: ")
        assert len(repr(value)) < 100


def test_a_single_text_is_one_name_not_its_letters(tmp_path: Path) -> None:
    """Where several may be given, one may be given alone."""
    pile = Path(__file__).parents[1] / "examples" / "pile-1.json"
    one = tmp_path / "bin.h5"
    write_bin_map(one, toy_bin_map())
    for name in (str(pile), pile):
        alone = reachmap.rank(name, map_path=one)  # type: ignore[arg-type]
        assert alone.text == reachmap.rank([pile], map_path=one).text
    assert [item.path for item in reachmap.verify(str(one)).verdicts] == [one]
    wider = "bin.inner=[0.4,0.3,0.04]"
    for cell in (
        reachmap.load_cell("planar-toy", wider),
        reachmap.load_cell("planar-toy", [wider]),
    ):
        assert cell.cell.bin.inner == (0.4, 0.3, 0.04)
    assert with_seed(wider, 3) == (wider, "seed=3")


def test_a_placement_and_a_cell_contradict_each_other(tmp_path: Path) -> None:
    """The cell had been scanned, and the placement left unread."""
    with pytest.raises(SettingsError, match=r"p\.h5 holds a cell"):
        reachmap.bin_scan(tmp_path / "p.h5", tmp_path / "b.h5", cell="planar-toy")
