"""Arms of other structures: planar, seven axes, sliding joints, unknown to EAIK."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest

from reachmap.cell.loading import read_cell
from reachmap.cell.model.cell import IkSpec
from reachmap.core.kinematics.kinematics import Kinematics
from reachmap.core.robot.model import RobotModel
from reachmap.errors import SceneError
from tests.support.kinematics_arms import (
    KINOVA,
    PANDA,
    UR5,
    UR5_JOINTS,
    Link,
    misses,
    nearest_branch,
    pinocchio_tcp,
    robot,
    serial_urdf,
    ur5,
    urdf_text,
)

A1, A2, A3 = 0.4, 0.2, 0.1


def planar_inverse(x: float, y: float, yaw: float) -> list[tuple[float, float, float]]:
    """Elbow-up and elbow-down angles of the toy arm, each in [-π, π]."""
    u, v = x - A3 * np.cos(yaw), y - A3 * np.sin(yaw)
    cosine = (u * u + v * v - A1**2 - A2**2) / (2 * A1 * A2)
    if abs(cosine) > 1:
        return []
    branches = []
    for q2 in (np.arccos(cosine), -np.arccos(cosine)):
        q1 = np.arctan2(v, u) - np.arctan2(A2 * np.sin(q2), A1 + A2 * np.cos(q2))
        q = np.array([q1, q2, yaw - q1 - q2])
        branches.append(tuple((q + np.pi) % (2 * np.pi) - np.pi))
    return branches


def planar_pose(x: float, y: float, yaw: float) -> np.ndarray:
    """Pose in the plane z = 0 with z up."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, 0], [0, 0, 0, 1.0]])


@pytest.mark.parametrize("method", ["auto", "numeric"])
def test_the_toy_arm_has_the_solutions_of_its_closed_form(method: str) -> None:
    """Both elbows inside the ring of reach, none outside, by either method."""
    arm = RobotModel.from_cell(read_cell("planar-toy"))
    kinematics = Kinematics(arm, IkSpec(method=method))
    rng = np.random.default_rng(0)
    poses = rng.uniform([-0.7, -0.7, -np.pi], [0.7, 0.7, np.pi], (60, 3))
    T = np.array([planar_pose(*pose) for pose in poses])
    found, frame = kinematics.solve_many(T)
    for k, pose in enumerate(poses):
        wanted = np.array(sorted(planar_inverse(*pose))).reshape(-1, 3)
        ours = np.array(sorted(found[frame == k].tolist())).reshape(-1, 3)
        assert ours.shape == wanted.shape
        np.testing.assert_allclose(ours, wanted, atol=1e-6)
    assert {len(planar_inverse(*pose)) for pose in poses} == {0, 2}


@pytest.mark.parametrize("method", ["auto", "numeric"])
def test_poses_out_of_the_plane_are_not_solved(method: str) -> None:
    """A planar arm meets a pose fully or not at all."""
    arm = RobotModel.from_cell(read_cell("planar-toy"))
    kinematics = Kinematics(arm, IkSpec(method=method))
    above = planar_pose(0.3, 0.2, 0.5)
    above[2, 3] = 1e-5
    tilted = planar_pose(0.3, 0.2, 0.5)
    tilted[:3, :3] = tilted[:3, :3] @ np.array(
        [[1, 0, 0], [0, 0.6, -0.8], [0, 0.8, 0.6]]
    )
    assert len(kinematics.solve(planar_pose(0.3, 0.2, 0.5))) == 2
    assert len(kinematics.solve(above)) == 0
    assert len(kinematics.solve(tilted)) == 0


@pytest.mark.parametrize("dof", [1, 2, 3, 4])
def test_planar_arms_of_any_length(dof: int) -> None:
    """One to three joints in closed form; four are redundant, hence numeric."""
    links = [Link(), *(Link(xyz=(0.3, 0, 0)) for _ in range(dof - 1))]
    arm = robot(serial_urdf(links), {"parent": f"link_{dof}", "xyz": [0.2, 0.0, 0.0]})
    kinematics = Kinematics(arm)
    assert kinematics.method == ("analytic" if dof <= 3 else "numeric")
    Q = np.random.default_rng(dof).uniform(-3, 3, (20, dof))
    T = kinematics.forward_many(Q)
    found, frame = kinematics.solve_many(T)
    assert len(np.unique(frame)) == len(Q)
    assert misses(arm, found, T[frame]).max() < 1e-6
    if dof <= 3:
        assert nearest_branch(found, frame, Q).max() < 1e-6


def test_panda_finds_the_original_with_its_joint_7_on_the_grid() -> None:
    """Every sampled curve point is exact and within limits; originals are there."""
    arm = robot(urdf_text(PANDA), "panda_hand")
    kinematics = Kinematics(arm, IkSpec(redundant_joint="panda_joint7"))
    assert (kinematics.method, kinematics.complete) == ("redundant-grid", False)
    rng = np.random.default_rng(4)
    Q = rng.uniform(arm.lower_rad, arm.upper_rad, (60, 7))
    Q[:, 6] = np.linspace(arm.lower_rad[6], arm.upper_rad[6], 25)[np.arange(60) % 25]
    T = kinematics.forward_many(Q)
    found, frame = kinematics.solve_many(T)
    assert nearest_branch(found, frame, Q).max() < 1e-6
    assert misses(arm, found, T[frame]).max() < 1e-6
    assert (found >= arm.lower_rad).all()
    assert (found <= arm.upper_rad).all()


def test_panda_poses_between_the_samples_are_solved() -> None:
    """A coarse grid misses short curves; the joint is then freed."""
    arm = robot(urdf_text(PANDA), "panda_hand")
    kinematics = Kinematics(arm, IkSpec(redundant_samples=9))
    Q = np.random.default_rng(5).uniform(arm.lower_rad, arm.upper_rad, (100, 7))
    T = kinematics.forward_many(Q)
    found, frame = kinematics.solve_many(T)
    assert len(np.unique(frame)) >= 97
    assert misses(arm, found, T[frame]).max() < 1e-6
    assert (found >= arm.lower_rad).all()
    assert (found <= arm.upper_rad).all()


def test_numeric_solutions_are_branches_of_the_closed_form() -> None:
    """With enough starts the numeric solver finds what EAIK finds."""
    arm = ur5(half_turn=True)
    analytic = Kinematics(arm)
    numeric = Kinematics(arm, IkSpec(method="numeric", restarts=48))
    assert (numeric.method, numeric.complete) == ("numeric", False)
    Q = np.random.default_rng(6).uniform(-np.pi, np.pi, (25, 6))
    T = analytic.forward_many(Q)
    wanted, of_wanted = analytic.solve_many(T)
    found, of_found = numeric.solve_many(T)
    for k in range(len(T)):
        a, b = wanted[of_wanted == k], found[of_found == k]
        assert len(b) <= len(a)
        apart = np.abs(a[:, None] - b[None]).max(axis=2)
        assert apart.min(axis=0).max() < 1e-5
    assert len(found) >= 0.95 * len(wanted)


def test_sliding_joints_are_solved_numerically() -> None:
    """A gantry with a wrist: metres and radians side by side."""
    gantry = [
        Link(kind="prismatic", axis=(1, 0, 0), limit=(-1, 1)),
        Link(kind="prismatic", axis=(0, 1, 0), limit=(-1, 1)),
        Link(kind="prismatic", axis=(0, 0, 1), limit=(0, 1)),
        Link(axis=(0, 0, 1)),
        Link(axis=(0, 1, 0), xyz=(0, 0, 0.1)),
        Link(axis=(0, 0, 1), xyz=(0, 0, 0.1)),
    ]
    arm = robot(serial_urdf(gantry), {"parent": "link_6", "xyz": [0.1, 0, 0.1]})
    kinematics = Kinematics(arm)
    Q = np.random.default_rng(7).uniform(arm.lower_rad, arm.upper_rad, (20, 6))
    T = kinematics.forward_many(Q)
    found, frame = kinematics.solve_many(T)
    assert kinematics.method == "numeric"
    assert misses(arm, found, T[frame]).max() < 1e-6
    apart = np.abs(found - Q[frame]).max(axis=1)
    assert len(np.unique(frame[apart < 1e-6])) == len(Q)


@pytest.mark.parametrize(
    ("urdf", "tcp"),
    [
        (KINOVA, "j2s6s200_end_effector"),
        ("ur_description/urdf/ur3_robot.urdf", "tool0"),
        ("ur_description/urdf/ur10_robot.urdf", "tool0"),
        ("z1_description/urdf/z1.urdf", "link06"),
    ],
)
def test_known_six_axis_arms(urdf: str, tcp: str) -> None:
    """Other arms of known structure: originals found, nothing misses."""
    arm = robot(urdf_text(urdf), tcp)
    kinematics = Kinematics(arm)
    Q = np.random.default_rng(8).uniform(arm.lower_rad, arm.upper_rad, (200, 6))
    T = kinematics.forward_many(Q)
    found, frame = kinematics.solve_many(T, windings=False)
    assert kinematics.method == "analytic"
    assert nearest_branch(found, frame, Q).max() < 1e-6
    assert np.abs(kinematics.forward_many(found) - T[frame]).max() < 1e-6


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ({"redundant_joint": "elbow"}, "no joint 'elbow' moves"),
        ({"redundant_joint": "elbow_joint"}, "only arms of seven joints"),
    ],
)
def test_a_wrong_redundant_joint_is_refused(
    spec: dict[str, object], message: str
) -> None:
    """Unknown joints, and arms that have no redundant one."""
    with pytest.raises(SceneError, match=message):
        Kinematics(ur5(), IkSpec.model_validate(spec))


def test_an_arm_without_closed_form_is_refused_if_one_is_demanded() -> None:
    """``analytic`` does not fall back silently."""
    rng = np.random.default_rng(9)
    odd = [
        Link(xyz=tuple(rng.normal(size=3)), axis=tuple(a / np.linalg.norm(a)))
        for a in rng.normal(size=(6, 3))
    ]
    arm = robot(serial_urdf(odd), "link_6")
    assert Kinematics(arm).method == "numeric"
    with pytest.raises(SceneError, match="no closed form"):
        Kinematics(arm, IkSpec(method="analytic"))


@pytest.mark.parametrize("seed", range(830, 850))
def test_arms_at_random_are_solved_or_declined(seed: int) -> None:
    """Axes and offsets along x, y, z: whatever is taken as known finds originals."""
    rng = np.random.default_rng(seed)
    dof = int(rng.integers(1, 7))
    links = [
        Link(
            xyz=rng.choice([0, 0, 0.2, 0.3], 3).tolist(),
            axis=np.eye(3)[rng.integers(3)],
        )
        for _ in range(dof)
    ]
    tcp = {"parent": f"link_{dof}", "xyz": rng.choice([0, 0.1, 0.25], 3).tolist()}
    arm = robot(serial_urdf(links), tcp)
    kinematics = Kinematics(arm, IkSpec(restarts=1))
    if not kinematics.complete:
        return
    Q = rng.uniform(-3, 3, (40, dof))
    T = kinematics.forward_many(Q)
    found, frame = kinematics.solve_many(T)
    assert nearest_branch(found, frame, Q).max() < 1e-5
    assert misses(arm, found, T[frame]).max() < 1e-6
    T[:, :3, 3] *= 3.0
    found, frame = kinematics.solve_many(T)
    assert misses(arm, found, T[frame]).max(initial=0.0) < 1e-6


def calibrated(urdf: str, size: float, seed: int) -> str:
    """Shift and tilt the joints of a UR5 by normal noise [m and rad]."""
    rng = np.random.default_rng(seed)
    root = ElementTree.fromstring(urdf)
    for name in UR5_JOINTS:
        origin = root.find(f"joint[@name='{name}']/origin")
        assert origin is not None
        for key in ("xyz", "rpy"):
            values = np.array(origin.get(key, "0 0 0").split(), float)
            moved = values + size * rng.normal(size=3)
            origin.set(key, " ".join(repr(float(v)) for v in moved))
    return ElementTree.tostring(root, encoding="unicode")


@pytest.mark.parametrize("size", [1e-9, 1e-4, 5e-4])
def test_calibrated_arms_start_from_the_nominal_one(size: float) -> None:
    """Axes that are nearly parallel: all poses solved, nearly all branches found."""
    arm = robot(calibrated(urdf_text(UR5), size, seed=1), "tool0")
    kinematics = Kinematics(arm)
    assert (kinematics.method, kinematics.complete) == ("nominal-analytic", False)
    Q = np.random.default_rng(10).uniform(-np.pi, np.pi, (200, 6))
    T = kinematics.forward_many(Q)
    found, frame = kinematics.solve_many(T, windings=False)
    assert len(np.unique(frame)) == len(Q)
    assert (nearest_branch(found, frame, Q) < 1e-6).mean() >= 0.97
    assert misses(arm, found, T[frame]).max() < 1e-6


HALF = np.pi / 2
# Arms that have a closed form which fails where joints are at right angles.
RIGHT_ANGLED = {
    "two axes that meet": [Link(axis=(1, 0, 0)), Link(xyz=(0.3, 0, 0), axis=(0, 1, 0))],
    "three axes": [
        Link(xyz=(0, -0.16, -0.03), rpy=(-HALF, 0, 0)),
        Link(rpy=(-HALF, 0, -HALF)),
        Link(xyz=(0, -0.21, 0), rpy=(0, 0, HALF), axis=(0, 0, -1)),
    ],
    "four axes": [
        Link(xyz=(0, 0.38, 0), axis=(0, -1, 0)),
        Link(xyz=(0, -0.11, 0), axis=(-1, 0, 0)),
        Link(xyz=(0, -0.13, 0.09), axis=(-1, 0, 0)),
        Link(xyz=(0, 0, 0.26), axis=(0, 1, 0)),
    ],
    "parallel wrist": [
        Link(axis=(0, 1, 0)),
        Link(axis=(0, 0, -1)),
        Link(xyz=(-0.25, 0, 0.28), axis=(-1, 0, 0)),
        Link(axis=(0, -1, 0)),
        Link(xyz=(0.27, 0.33, 0), axis=(0, 1, 0)),
        Link(xyz=(0, -0.36, 0.11), axis=(0, 1, 0)),
    ],
}


@pytest.mark.parametrize("links", RIGHT_ANGLED.values(), ids=RIGHT_ANGLED.keys())
@pytest.mark.parametrize("noise", [0.0, 1e-14])
def test_poses_of_joints_at_right_angles_are_solved(
    links: list[Link], noise: float
) -> None:
    """Poses that an arm has by Pinocchio are found; else no proof is claimed."""
    tcp = {"parent": f"link_{len(links)}", "xyz": [0.0, 0.0, 0.0]}
    arm = robot(serial_urdf(links), tcp)
    kinematics = Kinematics(arm)
    rng = np.random.default_rng(7)
    Q = rng.choice(np.radians(np.arange(-150, 151, 30)), (300, len(links)))
    T = np.array([pinocchio_tcp(arm, q) for q in Q])
    T[:, :3] += noise * rng.standard_normal((len(T), 3, 4))
    found, frame = kinematics.solve_many(T)
    assert misses(arm, found, T[frame]).max() < 1e-6
    lost = len(Q) - len(np.unique(frame))
    assert lost <= (0 if kinematics.complete else 0.01 * len(Q))
