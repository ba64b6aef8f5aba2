"""Options that would have no effect are refused; dry runs obey all others."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner, Result

from reachmap.cli import group


def run(command: str, **how: object) -> Result:
    """Run a command line in this process."""
    return CliRunner().invoke(group, command.split(), **how)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("rank g.json --set seed=1", "--set: needs --cell."),
        ("rank g.json --force", "--force: needs --cell."),
        ("rank g.json --chart-top 3", "--chart-top: needs --chart."),
        ("rank g.json --overwrite", "--overwrite: needs --output or --chart."),
        ("rank g.json -o - --overwrite", "--overwrite: needs --output or --chart."),
        ("empty a.h5 --overwrite", "--overwrite: needs --output or --picture."),
        ("rank g.json --margin wind_up 2 --margin wind_up 3", "wind_up: given twice"),
        ("place-bin a.h5 --fix z=0 --fix yaw=0 --fix z=1", "z is given twice"),
        ("robust a.h5 --bin 5mm --tool 1mm --bin 3deg", "--bin: given twice"),
        ("new-cell a.urdf a:=1 --xacro-arg a=2", "--xacro-arg a: given twice"),
        ("rank g.json --explain a --top 3", "--top: --explain is about one grasp."),
        ("validate bin.h5 --random 3 --frame bin", "--frame: needs GRASPS."),
        ("validate bin.h5 --random 3 --from suction", "--from: needs GRASPS."),
        ("validate bin.h5 g.json --overwrite", "--overwrite: needs --output, --ch"),
        ("compare a.h5 b.h5 --overwrite", "--overwrite: needs --picture."),
        ("cells --overwrite -o x", "--output, --overwrite: needs --export."),
        ("cells --export a.h5 --overwrite", "--overwrite: needs --output."),
        ("view a.h5 --html b.html --port 8", "--port: --html has no server."),
        ("view a.h5 --html b.html --no-browser", "--html has no server."),
        ("view a.h5 --html b.html --host 0.0.0.0", "--host: --html has no server."),
        ("view a.h5 --overwrite", "--overwrite: needs --html."),
        ("view a.h5 --path 0,0,0,0 --path 0,0,0,1", "the live view plays one"),
        ("place-bin a.h5 --bin-pose 0 0 0 0 --fix z=0", "--fix: not used with"),
        ("place-bin a.h5 --bin-pose 0 0 0 0 --rule paper", "--rule: not used with --"),
        ("bin-scan a.h5 --cell b.yaml", "--cell: PLACEMENT holds the cell"),
        ("bin-scan --dry-run --restart", "--restart: --dry-run writes nothing."),
        ("bin-scan --shard 1/2 --overwrite", "--overwrite: a shard writes a journal"),
        ("workspace-scan --dry-run --overwrite", "--overwrite: --dry-run writes noth"),
        ("workspace-scan --executor dask:tcp://a:1 -j 2", "-j: the workers are those"),
        ("place-bin --executor dask:tcp://a:1 -j 2", "--workers: the workers are tho"),
    ],
)
def test_an_option_that_would_change_nothing_is_refused(
    command: str, message: str
) -> None:
    """In one sentence, before any file is looked at."""
    result = run(command)
    assert result.exit_code == 2
    assert message.removeprefix("-j: ") in result.stderr


def test_values_from_the_environment_may_go_unused() -> None:
    """They are for many commands; only what was typed is taken at its word."""
    env = {"REACHMAP_RANK_CHART_TOP": "3", "REACHMAP_CELL": "planar-toy"}
    assert "No such file" in run("rank g.json --map none.h5", env=env).stderr
    assert "no such file" in run("bin-scan none.h5 -j 1", env=env).stderr


def dry(command: str) -> dict[str, object]:
    """The facts of a dry run."""
    result = run(f"{command} --dry-run --json -j 1")
    assert result.exit_code == 0, result.output
    return dict(json.loads(result.stdout))


def test_a_dry_run_heeds_the_bin_and_the_seed() -> None:
    """As the run itself would: a bin that meets the arm is found, a seed is checked."""
    inside = "--set bin.pose.xyz=[0,0.3,0]"
    assert dry("workspace-scan planar-toy --seed 3")["frames"]
    dry(f"workspace-scan planar-toy {inside}")
    result = run(f"workspace-scan planar-toy {inside} --with-bin --dry-run -j 1")
    assert result.exit_code == 2
    assert "scan_configuration: link_1 touches bin" in result.stderr
    for command in ("workspace-scan planar-toy", "bin-scan --cell planar-toy"):
        refused = run(f"{command} --dry-run --seed {10**30} -j 1")
        assert refused.exit_code == 2, refused.output
        assert "seed" in refused.stderr
