"""Numbers of options are finite, on the command line and in the environment."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner, Result

from reachmap.cli import group
from reachmap.cli.group import COMMANDS
from reachmap.cli.quantities import ERROR_SIZE, PART
from reachmap.cli.rank import ShareType

ENDLESS = ("nan", "inf", "-inf", "1e400")


def number_types() -> list[Any]:
    """Types of all options that take numbers with a fraction, of all commands."""
    found: list[Any] = []
    for name in COMMANDS:
        command = group.get_command(click.Context(group), name)
        assert command is not None
        for parameter in command.params:
            kind = parameter.type
            parts = kind.types if isinstance(kind, click.Tuple) else [kind]
            found += [p for p in parts if isinstance(p, click.types.FloatParamType)]
    return found


def run(command: str, **env: str) -> Result:
    """Run a command line in this process."""
    return CliRunner().invoke(group, command.split(), env=env)


@pytest.mark.parametrize("name", ["robust", "empty", "workspace-scan"])
def test_a_seed_fits_what_stores_it(name: str) -> None:
    """It is refused before any work; `robust` had ended in an internal error."""
    result = run(f"{name} a.h5 --seed {2**63}")
    assert result.exit_code == 2
    assert "is too large; the largest is 2^63 - 1." in result.stderr


@pytest.mark.parametrize("option", ["place-bin a.h5 --bin", "bin-scan a.h5 --part"])
@pytest.mark.parametrize("text", ["", "null", "~"])
def test_no_name_is_not_the_default(option: str, text: str) -> None:
    """Written down as an assignment it would take the default in silence."""
    result = CliRunner().invoke(group, [*option.split(), text])
    assert result.exit_code == 2
    assert f"{text!r} is not a name." in result.stderr


def test_a_folder_in_the_place_of_a_map_is_called_that() -> None:
    """The folder one is in has no name to derive others from."""
    pile = Path(__file__).parents[2] / "examples" / "pile-1.json"
    result = run(f"rank {pile} --map .")
    assert result.exit_code == 2
    assert result.stderr.startswith("reachmap: .: cannot be read")


def test_no_option_takes_what_is_no_number() -> None:
    """NaN is within no range, and no change is below it."""
    assert len(number_types()) > 15
    for kind in number_types():
        for text in ENDLESS:
            with pytest.raises(click.BadParameter):
                kind.convert(text, None, None)


@pytest.mark.parametrize("text", ENDLESS)
def test_a_gate_of_no_number_is_refused(text: str) -> None:
    """Whatever the change is, nothing would be below NaN."""
    result = run(f"compare a.h5 b.h5 --fail-under {text}")
    assert result.exit_code == 2
    assert f"'--fail-under': '{text}' is not a finite number." in result.stderr


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        (PART, "1e400x40x20mm"),
        (PART, "d1e400x20mm"),
        (ERROR_SIZE, "1e400mm"),
        (ERROR_SIZE, "1mm 1e400deg"),
        (ShareType(), "nan"),
        (ShareType(), "inf%"),
    ],
)
def test_quantities_are_finite(kind: Any, text: str) -> None:
    """Digits may say more than a number can hold."""
    with pytest.raises(click.BadParameter):
        kind.convert(text, None, None)


@pytest.mark.parametrize("text", ["rubbish", "clearance", "clearance 1 wind_up"])
def test_groups_in_the_environment_are_whole(text: str) -> None:
    """What fills no group is not left out in silence."""
    for command in ("rank g.json", "validate bin.h5 g.json"):
        name = f"REACHMAP_{command.split()[0].upper()}_MARGINS"
        result = run(command, **{name: text})
        assert result.exit_code == 2
        assert f"'--margin': {text!r} is not a list of groups of 2" in result.stderr


def test_groups_in_the_environment_are_read() -> None:
    """Two groups, and the file is looked for."""
    result = run("rank g.json", REACHMAP_RANK_MARGINS="clearance 1 wind_up 2")
    assert "No such file" in result.stderr
