"""``reachmap check``: what a cell is made of, and whether it can work."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.bins.support import support_of, top_faces
from reachmap.cell.loading import LoadedCell, read_cell
from reachmap.cell.model.bodies import BinSpec
from reachmap.cell.model.shapes import shape_text
from reachmap.core.scene import Scene
from reachmap.geometry import approach_directions, inverse_transform, tilt_rad
from reachmap.placement.mapped.imaging import picture_of
from reachmap.sampling.frames import approach_distance_m, below_rim_m
from reachmap.scans.cycle.cell_checks import cycle_warnings


@dataclass(frozen=True, slots=True, kw_only=True)
class JointRow:
    """One joint that moves. Unit: deg for a turning joint, m for a sliding one.

    Velocity and acceleration are per second and with the cell's scaling.
    """

    name: str
    unit: str
    lower: float
    upper: float
    velocity: float
    acceleration: float
    scan: float
    within_limits: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyRow:
    """One body that is not in the URDF."""

    name: str
    attach_to: str
    shape: str
    touch: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class CellCheck:
    """What ``reachmap check`` says.

    Attributes
    ----------
    base_tilt_deg : float
        Angle of robot_base's z axis from the world's vertical.
    tcp_at_scan_m : tuple of float
        TCP in robot_base at the scan configuration [m].
    approach_at_scan : tuple of float
        Approach direction there, unit vector in robot_base.
    ik_method, ik_complete, ik_approximation : str, bool, str
        How inverse kinematics is solved, and whether "no solution" is a proof.
    pairs : tuple of str
        ``"A | B"`` that are checked for collision.
    proved_pairs : tuple of str
        Pairs left out because they were proved never to meet.
    test_frames, test_grasps : int
        Sizes of the two scans.
    approach_m, below_rim_m : float
        Length of the straight approaches, and how deep below the rim the deepest of
        them begins; negative where all begin above it.
    problems : tuple of str
        Why the scan configuration cannot be taken, and where that is written; empty
        where it can.
    """

    name: str
    source: str
    sha256: str
    robot: str
    base_frame: str
    base_tilt_deg: float
    tcp_parent: str
    approach_axis: str
    tcp_at_scan_m: tuple[float, ...]
    approach_at_scan: tuple[float, ...]
    ik_method: str
    ik_complete: bool
    ik_approximation: str
    joints: tuple[JointRow, ...]
    bodies: tuple[BodyRow, ...]
    pairs: tuple[str, ...]
    proved_pairs: tuple[str, ...]
    planning_step_rad: float
    verification_distance_m: float
    safety_margin_m: float
    test_frames: int
    test_grasps: int
    approach_m: float
    below_rim_m: float
    warnings: tuple[str, ...]
    problems: tuple[str, ...]


def check(name_or_path: str | Path, overrides: Sequence[str] = ()) -> CellCheck:
    """Load a cell, build its scene with the bin, and test the scan configuration.

    Parameters
    ----------
    name_or_path : str
    overrides : sequence of str
        ``--set`` assignments.

    Raises
    ------
    CellError, SceneError
        The cell cannot be loaded or its scene cannot be built. A scan configuration
        that cannot be taken is in ``problems`` instead.
    """
    name_or_path = str(name_or_path)
    return check_loaded(read_cell(name_or_path, overrides))


def check_loaded(loaded: LoadedCell) -> CellCheck:
    """Check a cell that is loaded already, see :func:`check`."""
    scene = Scene.build(loaded)
    cell, robot = loaded.cell, scene.robot
    T_base_tcp = scene.kinematics.forward(scene.scan_configuration)
    axis = cell.robot.tcp.approach_axis
    return CellCheck(
        name=cell.name,
        source=loaded.source,
        sha256=loaded.sha256,
        robot=cell.robot.urdf,
        base_frame=robot.base_frame,
        base_tilt_deg=round(float(np.degrees(tilt_rad(robot.T_world_base[:3, :3]))), 4),
        tcp_parent=cell.robot.tcp.parent,
        approach_axis=axis,
        tcp_at_scan_m=_rounded(T_base_tcp[:3, 3]),
        approach_at_scan=_rounded(approach_directions(T_base_tcp[:3, :3], axis)),
        ik_method=scene.kinematics.method,
        ik_complete=scene.kinematics.complete,
        ik_approximation=scene.kinematics.approximation,
        joints=_joints(scene),
        bodies=_bodies(loaded),
        pairs=scene.checker.body_pairs,
        proved_pairs=scene.checker.proved_pairs,
        planning_step_rad=cell.collision.planning_step_rad,
        verification_distance_m=cell.collision.verification_distance_m,
        safety_margin_m=cell.collision.safety_margin_m,
        test_frames=cell.workspace_scan.count(),
        test_grasps=cell.bin_scan.count(),
        approach_m=approach_distance_m(cell),
        below_rim_m=round(below_rim_m(cell), 6),
        warnings=(*loaded.warnings, *_picture(scene), *cycle_warnings(loaded)),
        problems=scene.scan_problems(),
    )


def _picture(scene: Scene) -> list[str]:
    """What keeps the camera from seeing the bin at the scan configuration."""
    if scene.loaded.cell.camera is None:
        return []
    wrong = picture_of(scene, scene.scan_configuration)
    if not wrong:
        return []
    return [f"{scene.loaded.source}: {wrong}, at the scan configuration"]


def _joints(scene: Scene) -> tuple[JointRow, ...]:
    robot, q = scene.robot, scene.scan_configuration
    outside = robot.outside_limits(q)
    rows = []
    for k, name in enumerate(robot.joint_names):
        factor = 180.0 / np.pi if robot.is_revolute[k] else 1.0
        rows.append(
            JointRow(
                name=name,
                unit="deg" if robot.is_revolute[k] else "m",
                lower=float(factor * robot.lower_rad[k]),
                upper=float(factor * robot.upper_rad[k]),
                velocity=float(factor * robot.velocity_rad_s[k]),
                acceleration=float(factor * robot.acceleration_rad_s2[k]),
                scan=float(factor * q[k]),
                within_limits=name not in outside,
            )
        )
    return tuple(rows)


def _bodies(loaded: LoadedCell) -> tuple[BodyRow, ...]:
    rows = [
        BodyRow(
            name=body.name,
            attach_to=body.attach_to,
            shape=shape_text(body.shape),
            touch=body.touch,
        )
        for body in loaded.cell.bodies
    ]
    held = loaded.cell.held()
    if held is not None:
        name, part = held
        rows.append(
            BodyRow(
                name=name,
                attach_to="the tool after the grasp",
                shape=shape_text(part.shape),
                touch=part.touch,
            )
        )
    T_world_base = inverse_transform(loaded.cell.T_base_world())
    faces = top_faces(loaded.cell, np.eye(4))
    for place, tray in loaded.cell.every_bin():
        support = support_of(tray, T_world_base @ loaded.cell.T_base_of(tray), faces)
        name = tray.name or place[-1]
        rows.append(
            BodyRow(
                name="bin" if name == "bin" else f"bin {name}",
                attach_to=support or "nothing (it floats)",
                shape=_bin_text(tray),
                touch=tray.touch,
            )
        )
    return tuple(rows)


def _bin_text(tray: BinSpec) -> str:
    inner = " × ".join(f"{side:g}" for side in tray.inner)
    walls = " and ".join(f"{wall:g}" for wall in dict.fromkeys(tray.walls))
    said = [tray.carrier] if tray.carrier else []
    said.append(f"inside {inner} m")
    # Where there is a mesh it has the walls.
    mesh = None if tray.mesh is None else tray.mesh.file.rsplit("/", 1)[-1]
    said.append(f"wall {walls} m" if mesh is None else f"mesh {mesh}")
    if tray.heap:
        said.append(f"parts up to {tray.heap:g} m")
    return ", ".join(said)


def _rounded(values: FloatArray) -> tuple[float, ...]:
    # Adding 0.0 turns -0.0 into 0.0, which reads better.
    return tuple(float(v) + 0.0 for v in np.round(values, 6))
