"""Test frames of the bin and of the workspace."""

from pathlib import Path

import numpy as np

from reachmap.cell.loading import read_cell
from reachmap.cell.model.cell import (
    BinScanSpec,
    BinSpec,
    Cell,
    CubeSpec,
    RobotSpec,
    TcpSpec,
    WorkspaceScanSpec,
)
from reachmap.geometry import rotation_angle, yaw_transform
from reachmap.sampling.frames import bin_test_frames, cell_centres, workspace_frames

HARD_CELLS = Path(__file__).parents[2] / "benchmarks" / "hard_cells"
ARM = RobotSpec(urdf="arm.urdf", tcp=TcpSpec(parent="tool"))


def cell_of(**sections) -> Cell:
    """The few sections of a cell that say where its test frames are."""
    bin_spec = BinSpec(inner=(0.36, 0.26, 0.15))
    return Cell.model_construct(**{"robot": ARM, "bin": bin_spec, **sections})


def test_the_bin_grid_is_cell_centred() -> None:
    """20 along the 0.36 m side, 14 along the 0.26 m side, half a pitch off a wall."""
    frames = bin_test_frames(cell_of(bin_scan=BinScanSpec()), np.eye(4))
    assert frames.T_base_tcp.shape == (1, 14, 20, 27, 4, 4)
    np.testing.assert_allclose(np.diff(frames.x), 0.018)
    np.testing.assert_allclose(frames.x[[0, -1]], [-0.171, 0.171])
    np.testing.assert_allclose(frames.y[[0, -1]], [-0.13 + 0.13 / 14, 0.13 - 0.13 / 14])
    np.testing.assert_array_equal(frames.layer, [0.05])


def test_frames_move_and_turn_with_the_bin() -> None:
    """Poses in another bin pose are that pose times the poses of the bin at home."""
    cell = cell_of(bin_scan=BinScanSpec(grid=(4, 3), layers=(0.02, 0.1)))
    T_base_bin = yaw_transform(0.5, -0.2, 0.1, 0.7)
    home = bin_test_frames(cell, np.eye(4)).T_base_tcp
    moved = bin_test_frames(cell, T_base_bin).T_base_tcp
    np.testing.assert_allclose(moved, T_base_bin @ home, atol=1e-15)
    np.testing.assert_allclose(home[1, 2, 3, 0, :3, 3], [0.135, 0.26 / 3, 0.1])


def test_cell_centres_are_symmetric() -> None:
    """An odd number of cells has its middle at exactly 0."""
    centres = cell_centres(0.36, 7)
    np.testing.assert_array_equal(centres, -centres[::-1])
    assert centres[3] == 0.0
    assert not np.signbit(centres[3])


def test_workspace_frames_hold_one_grid_per_cube() -> None:
    """Index order (z, y, x, orientation), orientations equal at every point."""
    cubes = (
        CubeSpec(name="right", min=(0, -1, 0), max=(1, 0, 0.2), grid=(3, 2)),
        CubeSpec(name="left", min=(0, 0, 0), max=(1, 1, 0.2), grid=(3, 2)),
    )
    spec = WorkspaceScanSpec(cubes=cubes, z_step=0.1)
    right, left = workspace_frames(cell_of(workspace_scan=spec))
    assert (right.name, left.name) == ("right", "left")
    assert right.frames.shape == (3, 2, 3, 27)
    T = right.frames.transforms()
    np.testing.assert_array_equal(T[2, 0, 1, 5, :3, 3], [0.5, -1.0, 0.2])
    np.testing.assert_array_equal(T[2, 1, 0, :, :3, :3], right.frames.orientations)


def test_chosen_frames_equal_the_full_product() -> None:
    """Poses by flat index, as a slice and as an array, are those of the whole."""
    cell = cell_of(
        bin_scan=BinScanSpec(grid=(3, 2)),
        robot=RobotSpec(urdf="a", tcp=TcpSpec(parent="t", approach_axis="-y")),
    )
    frames = bin_test_frames(cell, np.eye(4)).frames
    whole = frames.transforms().reshape(-1, 4, 4)
    assert frames.size == len(whole)
    np.testing.assert_array_equal(frames.transforms_at(slice(20, 40)), whole[20:40])
    some = np.array([150, 3, 3, 77])
    np.testing.assert_array_equal(frames.transforms_at(some), whole[some])


def test_a_plain_cone_under_a_ceiling_is_the_list_written_for_it() -> None:
    """Of an arm that hangs, down is +z: what had to be listed before, row by row."""
    name = str(HARD_CELLS / "ceiling-ur10.yaml")
    cone = "{family: cone, tilts_deg: [0, 30], azimuths: [1, 6], rolls: 3}"
    listed, plain = (
        workspace_frames(read_cell(name, overrides).cell)[0].frames
        for overrides in ([], [f"workspace_scan.orientations={cone}"])
    )
    np.testing.assert_array_equal(listed.points, plain.points)
    apart = rotation_angle(listed.orientations[:, None], plain.orientations)
    # The list is rounded to thousandths of a degree.
    assert np.degrees(apart.min(axis=0)).max() < 2e-3
    assert sorted(apart.argmin(axis=0)) == list(range(21))
