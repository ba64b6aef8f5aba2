"""The options that commands share."""

from __future__ import annotations

import os
import re

import click
import pytest
from click.testing import CliRunner

from reachmap.cli import options
from reachmap.cli.diagnostics import RunState, verbosity_parameters


def run(command: click.Command, *arguments: str, **env: str) -> str:
    """Run one command under the name `toy` with the prefix REACHMAP_TOY."""
    result = CliRunner().invoke(
        command, list(arguments), env=env, auto_envvar_prefix="REACHMAP_TOY"
    )
    return result.output.strip()


@click.command()
@options.workers_option
@options.shard_option
@options.seed_option
def toy(workers: int, shard: tuple[int, int] | None, seed: int | None) -> None:
    """Print what it was given."""
    click.echo(f"{workers} {shard} {seed}")


def test_workers_default_to_the_cores_this_process_may_use() -> None:
    """In a container with fewer cores than the machine, fewer workers start."""
    expected = len(os.sched_getaffinity(0))
    assert run(toy) == f"{expected} None None"


def test_a_variable_for_one_command_wins_over_the_one_for_all() -> None:
    """REACHMAP_WORKERS holds everywhere; REACHMAP_TOY_WORKERS holds here."""
    assert run(toy, REACHMAP_WORKERS="3") == "3 None None"
    both = {"REACHMAP_WORKERS": "3", "REACHMAP_TOY_WORKERS": "4"}
    assert run(toy, **both) == "4 None None"
    assert run(toy, "-j", "5", **both) == "5 None None"


def test_only_listed_options_have_a_variable_for_all() -> None:
    """A stray REACHMAP_SEED must not change a result unseen."""
    assert run(toy, "-j", "1", REACHMAP_SEED="9") == "1 None None"


@pytest.mark.parametrize(
    ("text", "shard"), [("1/1", (1, 1)), ("3/8", (3, 8)), ("08/10", (8, 10))]
)
def test_shards_are_counted_from_one(text: str, shard: tuple[int, int]) -> None:
    """I/N becomes a pair."""
    assert run(toy, "-j", "1", "--shard", text) == f"1 {shard} None"


@pytest.mark.parametrize(
    "text", ["0/3", "4/3", "3", "a/b", "1/0", "-1/3", "½/2", "1/2/3"]
)
def test_other_shards_are_refused(text: str) -> None:
    """What is not I/N with 1 <= I <= N is wrong usage."""
    assert "is not I/N with 1 <= I <= N" in run(toy, "--shard", text)


def test_a_negative_seed_is_refused() -> None:
    """Seeds are unsigned."""
    assert "-1 is not in the range x>=0" in run(toy, "--seed", "-1")


def test_composed_options_keep_their_order() -> None:
    """Help lists shared options in the order in which they are joined."""

    @click.command()
    @options.scan_options
    def scan(**values: object) -> None:
        """Scan."""

    names = re.findall(r"--[a-z-]+", str([p.opts for p in scan.params]))
    assert names[:4] == ["--set", "--seed", "--workers", "--executor"]


def test_the_inventory_lists_every_shared_option() -> None:
    """The table in the module's docstring is complete."""
    assert options.__doc__ is not None
    for name, value in vars(options).items():
        if name.endswith("_option") and name not in {"_option", "output_option"}:
            command = click.command()(value(lambda **_: None))
            for flag in (flag for option in command.params for flag in option.opts):
                assert f"``{flag}``" in options.__doc__, flag


@pytest.mark.parametrize(
    ("arguments", "answer"),
    [
        ([], "True"),
        (["--no-progress"], "False"),
        (["-q"], "False"),
        (["--progress", "-q"], "False"),
        (["-q", "-v"], "True"),
    ],
)
def test_quiet_silences_progress(arguments: list[str], answer: str) -> None:
    """-q after the command's name counts, wherever it stands."""

    @click.command(params=verbosity_parameters())
    @options.progress_option
    def scan(progress: bool) -> None:
        """Scan."""
        click.echo(progress)

    result = CliRunner().invoke(scan, arguments, obj=RunState())
    assert result.output.strip() == answer
