"""Time per pose of forward and inverse kinematics, one core.

Run ``python benchmarks/bench_ik.py``. CPU time of this process, best of three, so that
other load on the machine counts for little.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.loading import read_cell
from reachmap.cell.model.cell import IkSpec, RobotSpec
from reachmap.core.kinematics.kinematics import Kinematics
from reachmap.core.robot.model import RobotModel
from reachmap.geometry import rotation_from_rpy_deg, transform_from_parts


def seconds(run: Callable[[], object], repeats: int = 3) -> float:
    """CPU time of the fastest of several runs [s]."""
    best = np.inf
    for _ in range(repeats):
        start = time.process_time()
        run()
        best = min(best, time.process_time() - start)
    return best


def report(what: str, count: int, spent_s: float) -> None:
    """Print one line: what, time per pose, number of poses."""
    print(f"{what:<58}{spent_s / count * 1e6:10.1f} µs  ({count} poses)")


def lattice_poses() -> FloatArray:
    """Poses of a workspace scan: 1,452 points, 27 orientations about straight down."""
    axes = (np.linspace(-0.1, 0.9, 11), np.linspace(-0.75, 0.75, 12))
    grid = np.meshgrid(*axes, np.linspace(-0.4, 0.6, 11), indexing="ij")
    points = np.stack(grid, axis=-1).reshape(-1, 3)
    down = rotation_from_rpy_deg(np.array([180.0, 0.0, 0.0]))
    cone = [(0.0, 0.0), *((30.0, float(azimuth)) for azimuth in range(0, 360, 45))]
    turns = [
        yaw(azimuth)
        @ rotation_from_rpy_deg(np.array([0, tilt, 0]))
        @ yaw(roll - azimuth)
        for tilt, azimuth in cone
        for roll in (0.0, 120.0, 240.0)
    ]
    R = down @ np.array(turns)
    return transform_from_parts(
        np.tile(R, (len(points), 1, 1)), np.repeat(points, len(R), axis=0)
    )


def yaw(angle_deg: float) -> FloatArray:
    """Rotation about z."""
    return rotation_from_rpy_deg(np.array([0.0, 0.0, angle_deg]))


def random_poses(kinematics: Kinematics, count: int) -> FloatArray:
    """Poses of uniform configurations."""
    robot = kinematics.robot
    rng = np.random.default_rng(0)
    Q = rng.uniform(robot.lower_rad, robot.upper_rad, (count, robot.dof))
    return kinematics.forward_many(Q)


def time_arm(name: str, spec: IkSpec, batch: int, single: int) -> None:
    """Solve random poses of a shipped cell's arm, at once and one by one."""
    kinematics = Kinematics(RobotModel.from_cell(read_cell(name)), spec)
    label = f"{name}, {kinematics.method}"
    T = random_poses(kinematics, batch)
    report(f"{label}: batch", batch, seconds(lambda: kinematics.solve_many(T)))
    report(
        f"{label}: one by one",
        single,
        seconds(lambda: [kinematics.solve(pose) for pose in T[:single]]),
    )


def offset_wrist() -> RobotModel:
    """Arm with two parallel axes and no meeting ones at the wrist: no closed form."""
    joints = [
        ("0 0 0.28", "0 0 1"),
        ("0 0 0", "0 1 0"),
        ("0 0 0.7", "0 1 0"),
        ("0.5 0 0.1", "1 0 0"),
        ("0 0 0.16", "0 1 0"),
        ("0.13 0 0", "1 0 0"),
    ]
    parts = ['<robot name="arm"><link name="l0"/>']
    for k, (xyz, axis) in enumerate(joints, start=1):
        parts.append(
            f'<link name="l{k}"/><joint name="j{k}" type="revolute">'
            f'<parent link="l{k - 1}"/><child link="l{k}"/><origin xyz="{xyz}"/>'
            f'<axis xyz="{axis}"/><limit lower="-3.14" upper="3.14" velocity="2" '
            'effort="9"/></joint>'
        )
    spec = {"urdf": "arm.urdf", "tcp": {"parent": "l6", "xyz": [0.1, 0.02, 0.0]}}
    spec["limits"] = {"acceleration_rad_s2": 5.0}
    return RobotModel.from_spec(
        RobotSpec.model_validate(spec), urdf="".join([*parts, "</robot>"])
    )


def compare_methods(count: int = 1000) -> None:
    """Closed form and numeric solver side by side, in and out of reach."""
    ur5 = RobotModel.from_cell(read_cell("ur5-eye-in-hand"))
    arms = {
        "ur5, closed form": Kinematics(ur5),
        "ur5, numeric": Kinematics(ur5, IkSpec(method="numeric")),
        "offset wrist, numeric": Kinematics(offset_wrist()),
    }
    reference = {}
    for name, kinematics in arms.items():
        T = random_poses(kinematics, count)
        far = T.copy()
        far[:, :3, 3] += 5.0
        found, frame = kinematics.solve_many(T, windings=False)
        missed = np.abs(kinematics.forward_many(found) - T[frame]).max()
        for what, poses in (("reachable", T), ("out of reach", far)):
            spent = seconds(
                lambda k=kinematics, p=poses: k.solve_many(p, windings=False)  # type: ignore[misc]
            )
            ratio = spent / reference.setdefault(what, spent)
            report(f"{name}: {what}, {ratio:.1f} times the closed form", count, spent)
        solved = len(np.unique(frame))
        print(f"    {solved} of {count} solved, residual {missed:.0e}")


def time_lattice() -> None:
    """Solve all frames of a workspace scan."""
    kinematics = Kinematics(RobotModel.from_cell(read_cell("ur5-eye-in-hand")))
    T = lattice_poses()
    spent = seconds(lambda: kinematics.solve_many(T))
    found, frame = kinematics.solve_many(T)
    report("ur5-eye-in-hand, workspace lattice: batch", len(T), spent)
    share = len(np.unique(frame)) / len(T)
    print(f"    {spent:.2f} s, {len(found)} solutions, {share:.1%} of frames solved")


def time_forward_and_follow() -> None:
    """Forward kinematics and a straight approach."""
    kinematics = Kinematics(RobotModel.from_cell(read_cell("ur5-eye-in-hand")))
    Q = np.random.default_rng(0).uniform(-3, 3, (20000, 6))
    report("forward: batch", len(Q), seconds(lambda: kinematics.forward_many(Q)))
    some = Q[:2000]
    report(
        "forward: one by one",
        len(some),
        seconds(lambda: [kinematics.forward(q) for q in some]),
    )
    q = np.array([0.3, -1.2, 1.1, -1.4, -1.5, 0.2])
    path = np.repeat(kinematics.forward(q)[None], 50, axis=0)
    path[:, :3, 3] += np.linspace(0, 0.1, 50)[:, None] * path[0, :3, 2]
    report(
        "follow a straight approach, 2 mm a pose",
        len(path),
        seconds(lambda: kinematics.follow(q, path)),
    )


def main() -> None:
    """Run all."""
    time_forward_and_follow()
    compare_methods()
    time_lattice()
    time_arm("ur5-eye-in-hand", IkSpec(), 5000, 300)
    time_arm("ur5-eye-in-hand", IkSpec(method="numeric"), 1000, 20)
    time_arm("panda-eye-in-hand", IkSpec(), 500, 50)
    time_arm("planar-toy", IkSpec(), 5000, 300)


if __name__ == "__main__":
    main()
