"""Guess of a bin pose for a new cell, and of a tool long enough to pick from it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.core.collision.bin_fit import BinFit
from reachmap.core.collision.solids import SolidCell
from reachmap.core.scene import Scene
from reachmap.geometry import (
    approach_directions,
    axis_vector,
    inverse_transform,
    transform_from_parts,
    transform_points,
    yaw_transform,
)
from reachmap.maps.records import NO_PAIR, Status
from reachmap.maps.summary.statistics import most_likely_cause
from reachmap.sampling.frames import FrameGrid, approach_distance_m, bin_test_frames
from reachmap.tools.arm_sampling import reach_of

# A place is taken where this share of a few test grasps can be reached: the walls deny
# others to any tool.
ENOUGH = 0.4
# Tools that are tried, in depths of the bin: a flange has to stay above the rim.
TOOLS = (0.0, 0.5, 1.0, 2.0, 3.0)
# What protrudes less from the tip belongs to a flange rather than to a tool [m].
FLANGE_M = 0.02
# A longer tool is as unusual as this many other places are.
PLACES_PER_TOOL = 3
# Pairs of both that are looked at before the best of them is taken.
MOST = 24
# Height that an arm gets above with most of its configurations, as a quantile.
LOW = 0.1
THIN = 3
# As a share of the reach: the size of a bin, and of the gaps between random poses.
NEAR = 0.35
# A tool points down up to 60 degrees. Places that are near such poses in less than this
# share of the cases of the best one are skipped: an arm that hangs from a shoulder
# is hardly ever so in front of it (0.04), one on a pedestal often (0.5 and more).
DOWN, FEW = 0.5, 0.4
POINTS = np.array([[0.0, 0.0], [-0.3, -0.3], [0.3, -0.3], [-0.3, 0.3], [0.3, 0.3]])


Place = tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class BinGuess:
    """Where the bin can stand.

    Attributes
    ----------
    xyz_m : tuple of float
    yaw_deg : float
    tool_m : float
        From the tip to the TCP along the approach axis.
    carried_m : float
        From the tip to the end of what the URDF has there; 0 for a flange.
    share : float
        Of a few test grasps, those that a free configuration meets.
    why : str
        Why none of them is met at the usual place with the TCP at the end of what the
        URDF has; "" if one is.
    odd_place : bool
        Whether that is not the usual place.
    avoided : str
        What stands where the bin usually does; "" if nothing.
    """

    xyz_m: Place
    yaw_deg: float
    tool_m: float
    carried_m: float
    share: float
    why: str
    odd_place: bool
    avoided: str


def guess_bin(
    scene: Scene, T_base_tcp: FloatArray, *, with_tool: bool
) -> BinGuess | None:
    """First place for the bin that is clear and that the arm picks from.

    In front at the base's height if it fits there; else nearer, farther, at another
    height, beside the arm or behind it; perhaps with a tool. The best of those that
    were looked at where none is enough; None where it fits nowhere.

    Parameters
    ----------
    scene : Scene
        Built with ``bin_moves``, its TCP at the tip; not to be used any more.
    T_base_tcp : array, shape (n, 4, 4)
        Poses of random configurations. Places that few of them come near with the
        tool pointing down are skipped.
    with_tool : bool
        Whether the TCP may be put beyond the tip, as if on a tool.
    """
    carried_m = _carried_m(scene) if with_tool else 0.0
    places = list(_places(T_base_tcp[:, :3, 3]))
    T = T_base_tcp @ _along(scene, carried_m)
    counts = np.array([_near_poses(scene, T, xyz_m) for xyz_m, _ in places])
    fewest = max(1, FEW * counts.max())
    near = [place for place, n in zip(places, counts, strict=True) if n >= fewest]
    trials, avoided = _clear(scene, near)
    if not trials:
        trials, avoided = _clear(scene, places)
    pairs = product(range(len(trials)), TOOLS[: None if with_tool else 1])
    best: BinGuess | None = None
    why = ""
    for place, depths in sorted(pairs, key=_oddness)[:MOST]:
        trial = trials[place]
        tool_m = carried_m + depths * scene.loaded.cell.bin.inner[2]
        share = trial.share(tool_m)
        if best is None:
            why = "" if share else trial.why_unreachable(tool_m)
        if best is None or share > best.share:
            best = BinGuess(
                xyz_m=trial.xyz_m,
                yaw_deg=trial.yaw_deg,
                tool_m=round(tool_m, 3),
                carried_m=carried_m,
                share=share,
                why=why,
                odd_place=place > 0 or bool(avoided),
                avoided=avoided,
            )
        if share >= ENOUGH:
            break
    return best


def guess_notes(guess: BinGuess, tip: str) -> list[str]:
    """What is unusual about the bin and the tool that were guessed."""
    if not guess.share:
        return [f"no grasp in the bin is reached at the places tried: {guess.why}"]
    notes = []
    few = "few grasps are reached"
    if guess.odd_place:
        where = ", ".join(f"{value:g}" for value in guess.xyz_m)
        why = few if guess.tool_m > guess.carried_m else guess.why or few
        reason = f"it would collide with {guess.avoided}" if guess.avoided else why
        notes.append(f"the bin stands at ({where}): in front of the base {reason}")
    if guess.tool_m > guess.carried_m:
        where = f"the end of what the URDF has there ({guess.carried_m:g} m)"
        notes.append(
            f"robot.tcp is {guess.tool_m:g} m beyond {tip}, as if on a tool: at "
            f"{where if guess.carried_m else f'{tip} itself'} {guess.why or few}"
        )
    elif guess.tool_m:
        notes.append(
            f"robot.tcp is {guess.tool_m:g} m beyond {tip}, at the end of what the "
            "URDF has there"
        )
    if guess.share < ENOUGH:
        notes.append(
            f"{guess.share:.0%} of a few test grasps are reached there: reachmap "
            "place-bin finds better places, reachmap bin-scan says what is in the way"
        )
    return notes


def _carried_m(scene: Scene) -> float:
    """From the TCP along its approach axis to the end of what moves with it [m]."""
    cell = SolidCell.build(scene.loaded)
    robot = cell.robot
    direction = axis_vector(scene.loaded.cell.robot.tcp.approach_axis)
    ends = []
    for solid in cell.solids:
        if solid.joint == robot.tcp_joint and len(solid.vertices):
            T_tcp_solid = inverse_transform(robot.T_joint_tcp) @ solid.T_joint_solid
            along_m = solid.vertices @ T_tcp_solid[:3, :3].T @ direction
            ends.append(float(along_m.max() + T_tcp_solid[:3, 3] @ direction))
    farthest_m = max(ends, default=0.0)
    return round(farthest_m, 3) if farthest_m > FLANGE_M else 0.0


def _oddness(pair: tuple[int, float]) -> float:
    """How unusual a place, counted from the most usual, and a tool are together."""
    return pair[0] + PLACES_PER_TOOL * pair[1]


def _clear(
    scene: Scene, places: Sequence[tuple[Place, float]]
) -> tuple[list[_Trial], str]:
    """Places where the bin is clear of static bodies, and what blocks the first."""
    fit = BinFit(scene.robot, scene.loaded, None)
    trials: list[_Trial] = []
    avoided = ""
    for xyz_m, yaw_deg in places:
        contact = fit.contact(yaw_transform(*xyz_m, np.radians(yaw_deg)))
        if contact is None:
            trials.append(_Trial(scene, xyz_m, yaw_deg))
        elif not trials:
            avoided = avoided or contact.other
    return trials, avoided


class _Trial:
    """A few test grasps in a bin at one place, tried with tools of several lengths."""

    def __init__(self, scene: Scene, xyz_m: Place, yaw_deg: float) -> None:
        self.xyz_m, self.yaw_deg = xyz_m, yaw_deg
        T_base_bin = yaw_transform(*xyz_m, np.radians(yaw_deg))
        self._bare, self._T_base_bin = scene, T_base_bin
        cell = scene.loaded.cell
        frames = bin_test_frames(cell, T_base_bin)
        xy = POINTS * np.array(cell.bin.inner[:2])
        p_bin = np.column_stack([xy, np.full(len(xy), frames.layer[0])])
        grid = FrameGrid(
            points=transform_points(T_base_bin, p_bin),
            orientations=frames.frames.orientations.copy(),
        )
        T = grid.transforms()
        # Of the orientations every third, other ones at each point.
        point, k = np.indices(T.shape[:2])
        part = min(THIN, T.shape[1])
        self._T = T[(k + k // part + point) % part == 0]
        self._approach_m = approach_distance_m(cell)

    def _scene(self) -> Scene:
        """The scene with its bin here."""
        moved = self._bare.loaded.with_changes(bin_pose=self._T_base_bin)
        return self._bare.with_bin_of(moved)

    def share(self, tool_m: float) -> float:
        """Share of the grasps that are free, and free where their approach begins."""
        scene = self._scene()
        met = _free(scene, self._T @ _along(scene, -tool_m))
        T = self._T[met] @ _along(scene, -tool_m - self._approach_m)
        return float(_free(scene, T).sum() / len(self._T))

    def why_unreachable(self, tool_m: float) -> str:
        """Most likely reason why nothing is reached with a tool."""
        scene = self._scene()
        Q, frame, free = _solutions(scene, self._T @ _along(scene, -tool_m))
        status = np.full(len(self._T), Status.NO_IK, np.uint8)
        status[frame] = Status.IK_IN_COLLISION
        status[frame[free]] = Status.APPROACH_BLOCKED
        pair = np.full(len(self._T), NO_PAIR, np.int64)
        # One configuration of each: finding every pair takes long.
        for k, row in zip(*np.unique(frame, return_index=True), strict=True):
            if status[k] == Status.IK_IN_COLLISION:
                pair[k] = scene.checker.touching_pairs(Q[row])[0]
        return most_likely_cause(status, pair, scene.checker.body_pairs)


def _along(scene: Scene, distance_m: float) -> FloatArray:
    """T_tcp_moved: from the TCP along its approach axis."""
    direction = axis_vector(scene.loaded.cell.robot.tcp.approach_axis)
    return transform_from_parts(np.eye(3), distance_m * direction)


def _solutions(
    scene: Scene, T_base_tip: FloatArray
) -> tuple[FloatArray, IntArray, BoolArray]:
    """Configurations that meet poses (n, 4, 4), the poses they meet, which are free."""
    Q, frame = scene.kinematics.solve_many(
        T_base_tip, windings=False, near=scene.scan_configuration
    )
    return Q, frame, scene.checker.free_mask(Q)


def _free(scene: Scene, T_base_tip: FloatArray) -> BoolArray:
    """Whether a free configuration meets a pose, (n, 4, 4) to (n,)."""
    _, frame, free = _solutions(scene, T_base_tip)
    return np.isin(np.arange(len(T_base_tip)), frame[free])


def _near_poses(scene: Scene, T_base_tcp: FloatArray, xyz_m: Place) -> int:
    """Number of poses that are near a place with the tool pointing down."""
    axis = scene.loaded.cell.robot.tcp.approach_axis
    downwards = -approach_directions(T_base_tcp[:, :3, :3], axis)[:, 2]
    apart_m = np.linalg.norm(T_base_tcp[:, :3, 3] - xyz_m, axis=1)
    near = apart_m < NEAR * reach_of(T_base_tcp[:, :3, 3])
    return int((near & (downwards > DOWN)).sum())


def _places(points: FloatArray) -> Iterator[tuple[Place, float]]:
    """Places around the base, and yaws, from the most usual on."""
    reach_m = reach_of(points)
    # An arm on a body of its own does not get down to the floor.
    low_m = max(0.0, float(np.quantile(points[:, 2], LOW)))
    heights_m = [share * reach_m for share in (0.0, 0.1, 0.2, 0.3, -0.2)]
    if low_m > 0.1 * reach_m:
        heights_m.insert(1, low_m)
    farther_m = [share * reach_m for share in (-0.4, -0.6, 0.6, 1.0, 2.0)]
    for angles_deg in ((0,), (90, -90, 180)):
        for height_m, angle_deg, radius in product(
            heights_m + farther_m, angles_deg, (0.6, 0.75, 0.5)
        ):
            r, angle = radius * reach_m, np.radians(angle_deg)
            x, y = round(r * np.cos(angle), 3), round(r * np.sin(angle), 3)
            yield (x + 0.0, y + 0.0, round(height_m, 3)), 90.0 + angle_deg
