"""Levels of a filled bin: each is a scan of its own, parts below in the way."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from reachmap.cell.loading import cell_from_json, read_cell
from reachmap.core.robot.model import RobotModel
from reachmap.core.scene import Scene
from reachmap.errors import CellError
from reachmap.maps import read_bin_map
from reachmap.placement.mapped.sample import open_frames
from reachmap.runtime.options import RunOptions
from reachmap.sampling.frames import bin_test_frames
from reachmap.tools.bin_scan import bin_scan
from reachmap.tools.merge import merge
from reachmap.validation.picks import NO_PICKS
from reachmap.validation.planning import PickContext

DEEP = (
    "bin.carrier=KLT-6147",
    "roadmap.max_checks=2000",
    "roadmap.sample_checks=4000",
    "roadmap.route_plans=4",
    "roadmap.route_rounds=1",
    "bin_scan.grid=[3,2]",
    "bin_scan.repeats=1",
    "bin_scan.orientations={family: cone, tilts_deg: [0, 30], azimuths: [1, 4], "
    "rolls: 2}",
)
TOY_FILL = "bin_scan.fill=[0.25, 0.5, 1]"


def scan(path, *overrides, cell="ur10-eye-in-hand", **how):
    """Scan and read a bin map."""
    bin_scan(None, path, cell=cell, overrides=overrides, **how)
    return read_bin_map(path)


def test_each_level_is_the_map_of_a_bin_filled_so_far(tmp_path):
    """Status, paths and culprits are those of single scans with a heap in the bin."""
    whole = scan(tmp_path / "w.h5", *DEEP, "bin_scan.fill_heights_m=[0.008, 0.12]")
    assert whole.layer.tolist() == [0.008, 0.12]
    heaps = (0.0, 0.11)
    for k, (height, heap) in enumerate(zip(whole.layer, heaps, strict=True)):
        alone = scan(
            tmp_path / f"{k}.h5",
            *DEEP,
            f"bin.heap={heap}",
            f"bin_scan.layers=[{height}]",
        )
        np.testing.assert_array_equal(whole.status[k], alone.status[0])
        np.testing.assert_array_equal(whole.path_length[k], alone.path_length[0])
        np.testing.assert_array_equal(
            whole.goal_configuration[k], alone.goal_configuration[0]
        )
        for name in ("clearance", "joint_margin"):
            np.testing.assert_array_equal(
                getattr(whole.margins, name)[k], getattr(alone.margins, name)[0]
            )
        for of_map, numbers in (
            (lambda m: m.blocking_pair, "blocking"),
            (lambda m: m.margins.clearance_pair, "closest"),
        ):
            names = [
                [m.body_pairs[i] if i >= 0 else "" for i in of_map(m)[row].ravel()]
                for m, row in ((whole, k), (alone, 0))
            ]
            assert names[0] == names[1], numbers
    assert (whole.path_reachability[1] > 0).mean() > 0.2
    assert "suction tube | bin heap" in whole.body_pairs
    # Evidence of both roadmaps is kept, one after the other.
    reached = whole.component[whole.status == 1]
    assert whole.components.reached[reached].all()
    assert whole.component[0].max() < whole.component[1][whole.status[1] == 1].min()


def test_the_heap_ends_so_far_below_the_grasps_as_a_cup_presses_in():
    """Pressed in by nothing, the tool would touch the parts it is to pick."""
    loaded = read_cell("ur10-eye-in-hand", [*DEEP, "bin_scan.fill=[0.8]"])
    height = loaded.cell.bin_scan.layers[0]
    assert height == pytest.approx(0.8 * 0.1295)
    (filled,) = loaded.fillings()
    assert filled.cell.bin.heap == pytest.approx(height - 0.01)
    assert filled.fillings() == (filled,)
    tight = read_cell(
        "ur10-eye-in-hand", [*DEEP, "bin_scan.fill=[0.8]", "bin_scan.press_in_m=0"]
    )
    for cell, blocked in ((filled, False), (tight.fillings()[0], True)):
        scene = Scene.build(cell)
        T = bin_test_frames(cell.cell, scene.T_base_bin).T_base_tcp.reshape(-1, 4, 4)
        Q, _ = scene.kinematics.solve_many(T, windings=False)
        met = [
            any("bin heap" in scene.checker.body_pairs[p] for p in pairs)
            for pairs in map(scene.checker.touching_pairs, Q)
        ]
        assert all(met) if blocked else np.mean(met) < 0.5
        # Placement counts parts in the bin against the tool, too.
        can = open_frames(RobotModel.from_cell(cell), tight if blocked else loaded)
        assert can.any() != blocked


def test_shards_and_workers_make_the_same_map(tmp_path):
    """Units do not straddle levels, and levels are numbered on."""
    overrides = (TOY_FILL, "bin_scan.repeats=1")
    alone = scan(tmp_path / "a.h5", *overrides, cell="planar-toy")
    assert alone.status.shape == (3, 4, 5, 4)
    for k in (1, 2):
        bin_scan(
            None,
            tmp_path / "s.h5",
            cell="planar-toy",
            overrides=overrides,
            run=RunOptions(shard=(k, 2)),
        )
    merge(sorted(tmp_path.glob("s*.journal")), output=tmp_path / "m.h5")
    merged = read_bin_map(tmp_path / "m.h5")
    assert merged.stamp.content_sha256 == alone.stamp.content_sha256


def test_progress_names_levels_in_percent(tmp_path, capsys):
    """Each level has its own stages, told by how full the bin is."""
    scan(
        tmp_path / "p.h5",
        "bin_scan.fill=[0.2, 0.825]",
        "bin_scan.grid=[2,1]",
        cell="planar-toy",
        run=RunOptions(quiet=False),
    )
    said = capsys.readouterr().err.splitlines()
    for stage in ("survey", "connect"):
        for percent in ("20%", "82.5%"):
            label = f"bin-scan {stage} at {percent} fill "
            assert any(line.startswith(label) for line in said)


def test_levels_are_written_out_as_layers():
    """In metres, also when depth or levels of a stored cell change."""
    loaded = read_cell("planar-toy", [TOY_FILL])
    assert loaded.cell.bin_scan.layers == (0.01, 0.02, 0.04)
    again = cell_from_json(
        loaded.resolved_json,
        urdf=loaded.urdf,
        changes=["bin.inner=[0.36, 0.26, 0.1]"],
    )
    assert again.cell.bin_scan.layers == (0.025, 0.05, 0.1)
    dropped = read_cell("planar-toy", [TOY_FILL, "bin_scan.fill=null"])
    assert dropped.fillings() == (dropped,)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["bin_scan.fill=[0.5, 0.5]"], "levels must rise strictly"),
        (["bin_scan.fill=[1.5]"], r"bin_scan\.fill\.0: expected a number <= 1"),
        (["bin_scan.fill_heights_m=[0.05]"], r"the bin is 0\.04 m deep"),
        ([TOY_FILL, "bin_scan.fill_heights_m=[0.01]"], "give fill or fill_heights_m"),
        (["bin_scan.fill=[]"], r"bin_scan\.fill: expected at least 1 value"),
    ],
)
def test_levels_that_no_bin_can_have_are_refused(overrides, message):
    """With the key to blame."""
    with pytest.raises(CellError, match=message):
        read_cell("planar-toy", overrides)


def test_a_grasp_is_planned_to_in_a_bin_filled_up_to_it():
    """The heap ends a cup's stroke below the grasp, whatever the layers."""
    loaded = read_cell("ur10-deep-container")
    T = loaded.cell.T_base_bin()
    heights = [0.005, 0.1, 0.2, 0.4]
    picks = dataclasses.replace(
        NO_PICKS, points=np.array([(T @ [0.1, 0.05, z, 1.0])[:3] for z in heights])
    )
    context = PickContext(loaded=loaded, picks=picks, rolls=1, repeats=1, seed=1)
    heaps = [context.cell_for(k).cell.bin.heap for k in range(4)]
    assert heaps == pytest.approx([0.0, 0.09, 0.19, 0.252])
    empty = read_cell("ur10-deep-container", ["bin_scan.fill=null"])
    context = dataclasses.replace(context, loaded=empty)
    assert context.cell_for(2) is empty
