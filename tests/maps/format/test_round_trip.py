"""Records written and read again are the same, whatever they hold."""

import dataclasses
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from reachmap.maps import (
    BinMap,
    RunInfo,
    Stamp,
    Status,
    WorkspaceMap,
    read_bin_map,
    read_placement,
    read_provenance,
    read_workspace_map,
    write_bin_map,
    write_placement,
    write_workspace_map,
)
from tests.support.map_asserts import assert_records_equal
from tests.support.synthetic_maps import (
    synthetic_bin_map,
    synthetic_placement,
    synthetic_provenance,
    synthetic_workspace_map,
)
from tests.support.synthetic_parts import (
    bin_with_parts,
    placement_with_parts,
    workspace_with_parts,
)

PROPERTY = settings(
    max_examples=6,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
TEXT = st.text(st.characters(blacklist_categories=["Cs"], blacklist_characters="\0"))
NAMES = st.lists(TEXT, min_size=1, max_size=5).map(tuple)
SECONDS = st.floats(0, 1e6)


def write_and_read(record: Any, write: Any, read: Any, path: Path) -> Any:
    """One round trip; the hash that was returned is the one in the file."""
    content = write(path, record, overwrite=True)
    again = read(path)
    assert again.stamp.content_sha256 == content
    assert_records_equal(record, again, skip=("stamp",))
    stamp = dataclasses.replace(again.stamp, content_sha256="")
    assert stamp == dataclasses.replace(record.stamp, content_sha256="")
    return again


@PROPERTY
@given(
    shape=st.tuples(*[st.integers(1, 4)] * 4),
    seed=st.integers(0, 2**32),
    shared=st.booleans(),
    pairs=NAMES,
)
def test_workspace_maps_survive(
    tmp_path: Path, shape: tuple[int, ...], seed: int, shared: bool, pairs: Any
) -> None:
    """Every status, one cube or two, any names of bodies."""
    status = np.random.default_rng(seed).choice([0, 1, 2, 3, 4, 5], shape)
    record = synthetic_workspace_map(
        np.zeros(shape, bool),
        status=status,
        shared_row=shape[1] // 2 if shared else None,
    )
    pairs = (*record.body_pairs, *pairs)
    stamp = dataclasses.replace(record.stamp, seed=seed)
    record = dataclasses.replace(record, body_pairs=pairs, stamp=stamp)
    write_and_read(record, write_workspace_map, read_workspace_map, tmp_path / "w.h5")


@PROPERTY
@given(
    shape=st.tuples(*[st.integers(1, 3)] * 5),
    chance=st.sampled_from([0.0, 0.3, 1.0]),
    seed=st.integers(0, 2**63 - 1),
)
def test_bin_maps_survive(tmp_path: Path, shape: Any, chance: float, seed: int) -> None:
    """Any number of layers, orientations, repeats; no path at all, or all of them."""
    record = synthetic_bin_map(chance, shape=shape, seed=seed)
    write_and_read(record, write_bin_map, read_bin_map, tmp_path / "b.h5")


@PROPERTY
@given(
    scores=st.lists(st.floats(0, 100), min_size=1, max_size=6),
    excluded=st.lists(TEXT.filter(bool), max_size=4),
    margin=st.dictionaries(
        st.sampled_from(["+x", "-x", "+y", "-z", "+yaw", "-yaw"]), st.floats(0, 3)
    ),
)
def test_placements_survive(
    tmp_path: Path, scores: list[float], excluded: list[str], margin: dict[str, float]
) -> None:
    """Any number of candidates, reasons and margins, none included."""
    n = len(scores) + len(excluded)
    values = np.array([*scores, *[np.nan] * len(excluded)])
    poses = np.random.default_rng(n).uniform(-1, 1, (n, 4))
    base = synthetic_placement()
    pose = np.array(base.bin_pose)
    poses[0, :3] = pose[:3, 3]
    record = dataclasses.replace(
        base,
        runner_up=-1,
        paper_choice=n - 1,
        candidate_pose=poses,
        score=values,
        worst_point=values / 2,
        reachable_share=values,
        exact=np.zeros(n, np.uint8),
        reason=(*[""] * len(scores), *excluded),
        margin={k: margin[k] for k in sorted(margin, key=lambda k: "yaw" in k)},
    )
    write_and_read(record, write_placement, read_placement, tmp_path / "p.h5")


@PROPERTY
@given(
    texts=st.tuples(TEXT, TEXT, TEXT, TEXT, TEXT),
    overrides=st.lists(TEXT).map(tuple),
    facts=st.dictionaries(TEXT, TEXT),
    seconds=st.dictionaries(TEXT, SECONDS),
    workers=st.integers(1, 10**6),
)
def test_provenance_and_run_survive(
    tmp_path: Path, texts: Any, overrides: Any, facts: Any, seconds: Any, workers: int
) -> None:
    """Texts in any language, empty ones included."""
    provenance = synthetic_provenance(
        cell_yaml=texts[0],
        cell_resolved_json=texts[1],
        urdf=texts[2],
        srdf=texts[3],
        overrides=overrides,
        files_sha256=facts,
        settings={"nested": {"list": [1, 2.5, None, True, "é"]}},
    )
    run = RunInfo(
        command_line=texts[4],
        workers=workers,
        wall_s=seconds,
        cpu_s=seconds,
    )
    record = synthetic_placement(provenance=provenance, run=run)
    path = tmp_path / "p.h5"
    write_and_read(record, write_placement, read_placement, path)
    assert_records_equal(read_provenance(path), provenance)


def hash_of(path: Path, record: BinMap | WorkspaceMap, **changes: Any) -> str:
    """Content hash of a record with some fields changed."""
    write: Any = write_bin_map if isinstance(record, BinMap) else write_workspace_map
    return str(write(path, dataclasses.replace(record, **changes), overwrite=True))


def test_measured_times_and_runs_stay_outside_the_content_hash(tmp_path: Path) -> None:
    """Another machine, another day, other versions: the same hash."""
    record, path = synthetic_bin_map(), tmp_path / "b.h5"
    expected = hash_of(path, record)
    slower = {
        name: getattr(record, name) * 1.7
        for name in ("planning_time", "planning_cpu_time", "simplification_time")
    }
    provenance = dataclasses.replace(record.provenance, packages={"numpy": "9"})
    assert hash_of(path, record, **slower) == expected
    assert hash_of(path, record, run=RunInfo(host="other", workers=64)) == expected
    assert hash_of(path, record, provenance=provenance) == expected


@pytest.mark.parametrize(
    "name",
    ["execution_time", "tcp_path_length", "position", "scan_configuration", "n_ik"],
)
def test_everything_else_is_inside_the_content_hash(tmp_path: Path, name: str) -> None:
    """One number more or less, in one place, and the hash is another."""
    record, path = synthetic_bin_map(1.0), tmp_path / "b.h5"
    values = getattr(record, name).copy()
    values.flat[-1] += 1
    assert hash_of(path, record, **{name: values}) != hash_of(path, record)


def test_names_and_seeds_are_inside_the_content_hash(tmp_path: Path) -> None:
    """Joint names, body pairs, method and the stamp count as content."""
    record, path = synthetic_workspace_map(np.full((1, 2, 2), 0.5)), tmp_path / "w.h5"
    seen = {hash_of(path, record)}
    for change in (
        {"joint_names": ("a", "b", "c", "d", "e", "f")},
        {"body_pairs": (*record.body_pairs[::-1],)},
        {"method": "per-frame"},
        {"stamp": Stamp(seed=2, cell_sha256="c" * 64, config_sha256="d" * 64)},
        {"stamp": Stamp(seed=1, cell_sha256="c" * 64, config_sha256="e" * 64)},
    ):
        seen.add(hash_of(path, record, **change))
    assert len(seen) == 6


def test_records_read_are_read_only(tmp_path: Path) -> None:
    """Arrays of a record cannot be changed by accident."""
    path = tmp_path / "w.h5"
    write_workspace_map(path, synthetic_workspace_map(np.ones((1, 1, 1))))
    cube = read_workspace_map(path).cubes["all"]
    with pytest.raises(ValueError, match="read-only"):
        cube.status[0, 0, 0, 0] = Status.NO_IK


def test_the_numbers_of_a_bin_need_not_be_in_the_types_of_the_file(
    tmp_path: Path,
) -> None:
    """Wider integers and booleans are taken where no number is lost."""
    record = synthetic_bin_map()
    loose = dataclasses.replace(
        record,
        status=record.status.astype(np.int64),
        path_found=record.path_found.astype(bool),
        blocking_pair=record.blocking_pair.astype(np.int16),
    )
    write_bin_map(tmp_path / "a.h5", record)
    write_bin_map(tmp_path / "b.h5", loose)
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


@pytest.mark.parametrize("seed", [1, 2])
def test_the_parts_of_version_1_1_come_back(tmp_path: Path, seed: int) -> None:
    """Evidence, effort, best paths, rolls, times, margins, cycle, world, tolerance."""
    rng = np.random.default_rng(seed)
    connected = rng.random((1, 4, 5, 6)) < 0.5
    record = bin_with_parts(synthetic_bin_map(0.4, connected=connected), seed)
    write_and_read(record, write_bin_map, read_bin_map, tmp_path / "b.h5")
    fractions = rng.random((2, 3, 2))
    workspace = workspace_with_parts(synthetic_workspace_map(fractions, shared_row=1))
    write_and_read(
        workspace, write_workspace_map, read_workspace_map, tmp_path / "w.h5"
    )
    placement = placement_with_parts(synthetic_placement())
    write_and_read(placement, write_placement, read_placement, tmp_path / "p.h5")


def test_what_a_record_lacks_is_absent(tmp_path: Path) -> None:
    """Without the parts, a file has none of their variables, and reads as None."""
    path = tmp_path / "b.h5"
    write_bin_map(path, synthetic_bin_map())
    with h5py.File(path) as file:
        assert not {"component", "effort_checks", "best_path", "cycle"} & set(file)
        assert "stage" not in file["paths"]
    record = read_bin_map(path)
    assert record.best is None
    assert record.paths.stage is None
