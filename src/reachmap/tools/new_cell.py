"""``reachmap new-cell``: a starter cell from a URDF, tried before it is written."""

from __future__ import annotations

import dataclasses
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.files.files import robot_text
from reachmap.cell.files.resources import SCHEME, NotFoundError, Resolver
from reachmap.cell.files.urdf import UrdfDescription, parse_urdf
from reachmap.cell.loading import LoadedCell, cell_from_text
from reachmap.cell.starter import (
    StarterChoices,
    approach_axis,
    cell_name,
    guess_base,
    guess_tip,
    middle_position,
    starter_text,
    user_value,
)
from reachmap.cell.text.messages import did_you_mean
from reachmap.core.kinematics.kinematics import Kinematics
from reachmap.core.robot.model import RobotModel
from reachmap.core.scene import Scene
from reachmap.errors import ReachmapError, SettingsError
from reachmap.geometry import AXES
from reachmap.maps.bytes.publish import check_output, check_outputs, publish

SAMPLES = 2000
MANY = 40
ALWAYS = 0.98


@dataclass(frozen=True, slots=True, kw_only=True)
class NewCell:
    """What was written, and what was guessed.

    Attributes
    ----------
    path, srdf_path : Path
        The cell, and the SRDF beside it if links touch in every position.
    problems : tuple of str
        Why the cell does not work yet; empty where it does.
    """

    path: Path
    srdf_path: Path | None
    base: str
    tip: str
    joints: tuple[str, ...]
    problems: tuple[str, ...]


def new_cell(
    urdf: str,
    *,
    output: Path,
    base: str | None = None,
    tip: str | None = None,
    overwrite: bool = False,
) -> NewCell:
    """Write a commented starter cell for a robot.

    Parameters
    ----------
    urdf : str
        URDF or xacro: ``package://`` name or path.
    output : Path
        The cell file.
    base, tip : str, optional
        Links of the chain; guessed where omitted.
    overwrite : bool
        Replace ``output``.

    Raises
    ------
    CellError, SettingsError, OutputError
        The URDF cannot be used, a link does not exist, or nothing can be written.
    """
    target = check_output(output, overwrite=overwrite, inputs=[urdf])
    folder = target.parent
    srdf_target = target.with_suffix(".srdf")
    check_outputs([output, srdf_target], overwrite=True, inputs=[urdf])
    reference = _reference(urdf, folder)
    choices, robot = _first_choices(reference, folder, base, tip)
    choices, srdf, problems = _tried(choices, robot, folder, srdf_target.name)
    if srdf:
        publish(srdf_target, [srdf.encode()], overwrite=overwrite)
    publish(output, [starter_text(choices).encode()], overwrite=overwrite)
    return NewCell(
        path=output,
        srdf_path=output.with_suffix(".srdf") if srdf else None,
        base=choices.base,
        tip=choices.tip,
        joints=tuple(joint.name for joint in choices.joints),
        problems=problems,
    )


def _reference(urdf: str, folder: Path) -> str:
    """Write the reference to the URDF: relative if it lies beside the cell."""
    if urdf.startswith(SCHEME):
        return urdf
    path = Path(urdf).absolute()
    if path.is_relative_to(folder):
        return path.relative_to(folder).as_posix()
    return str(path)


def _first_choices(
    reference: str, folder: Path, base: str | None, tip: str | None
) -> tuple[StarterChoices, UrdfDescription]:
    """Choices that the URDF alone decides."""
    resolver = Resolver(directory=folder)
    try:
        path = resolver.resolve(reference)
    except NotFoundError as error:
        raise SettingsError(str(error)) from None
    robot = parse_urdf(robot_text(path, {}, resolver).text, path.name)
    for link in (base, tip):
        if link is not None and link not in robot.links:
            hint = did_you_mean(link, robot.links)
            raise SettingsError(f"{path.name}: no link {link!r}; {hint}")
    chosen_base = base or guess_base(robot)
    chosen_tip = tip or guess_tip(robot, chosen_base)
    joints = [robot.joints[n] for n in robot.chain(chosen_base, chosen_tip)]
    if not joints:
        raise SettingsError(
            f"{path.name}: no joint moves between {chosen_base!r} and {chosen_tip!r}"
        )
    locked = {
        joint.name: user_value(joint, middle_position(joint))
        for joint in robot.joints.values()
        if joint.moves and joint not in joints
    }
    scan = {j.name: round(user_value(j, middle_position(j)), 4) for j in joints}
    choices = StarterChoices(
        name=cell_name(robot.name or path.stem),
        urdf=reference,
        base=chosen_base,
        root=robot.root,
        tip=chosen_tip,
        joints=tuple(joints),
        locked=locked,
        scan_deg=scan,
    )
    return choices, robot


def _tried(
    choices: StarterChoices, robot: UrdfDescription, folder: Path, srdf_name: str
) -> tuple[StarterChoices, str, tuple[str, ...]]:
    """Refine the choices by moving the arm; problems where that cannot be done."""
    scan, srdf = None, ""
    try:
        arm = RobotModel.from_cell(_loaded(choices, folder, ""))
        Q, kinematics = _samples(arm), Kinematics(arm)
        points = kinematics.forward_many(Q)[:, :3, 3]
        reach = float(np.quantile(np.linalg.norm(points[:, :2], axis=1), 0.99))
        choices = dataclasses.replace(choices, reach_m=max(reach, 0.05))
        scene = Scene.build(_loaded(choices, folder, ""))
        pairs = _always_touching(scene, Q[:300])
        if pairs:
            srdf = _srdf_text(robot.name, pairs)
            scene = Scene.build(_loaded(choices, folder, srdf))
            choices = dataclasses.replace(choices, srdf=srdf_name)
        scan = _scan_configuration(scene, Q, choices.tip)
    except ReachmapError as error:
        return choices, srdf, error.lines
    if scan is None:
        return choices, srdf, ("no free scan configuration was found",)
    choices = dataclasses.replace(choices, scan_deg=_as_user(choices, scan))
    return choices, srdf, ()


def _loaded(choices: StarterChoices, folder: Path, srdf: str) -> LoadedCell:
    text = starter_text(dataclasses.replace(choices, srdf=""))
    loaded = cell_from_text(text, label="starter cell", directory=folder)
    # The SRDF is not on disk yet.
    return dataclasses.replace(loaded, srdf=srdf)


def _samples(arm: RobotModel) -> FloatArray:
    rng = np.random.default_rng(0)
    # Beyond half a turn an arm only winds itself up.
    half_turn = np.where(arm.is_revolute, np.pi, np.inf)
    low, high = (
        np.maximum(arm.lower_rad, -half_turn),
        np.minimum(arm.upper_rad, half_turn),
    )
    if (low > high).any():
        low, high = arm.lower_rad, arm.upper_rad
    return np.asarray(rng.uniform(low, high, (SAMPLES, arm.dof)))


def _always_touching(scene: Scene, Q: FloatArray) -> list[tuple[str, str]]:
    """Pairs of links that touch in practically every configuration."""
    if scene.checker.free_mask(Q).mean() > 1.0 - ALWAYS:
        return []
    Q = Q[:MANY]  # finding every pair takes long
    counts = Counter(k for q in Q for k in scene.checker.touching_pairs(q))
    pairs = []
    for index, count in sorted(counts.items()):
        first, second = scene.checker.body_pairs[index].split(" | ")
        bin_walls = [name for name in (first, second) if name.startswith("bin ")]
        if count >= ALWAYS * len(Q) and not bin_walls:
            pairs.append((first, second))
    return pairs


def _srdf_text(name: str, pairs: list[tuple[str, str]]) -> str:
    lines = ['<?xml version="1.0"?>', f"<robot name={quoteattr(name)}>"]
    lines += [
        f"  <disable_collisions link1={quoteattr(first)} link2={quoteattr(second)} "
        'reason="Default"/>'
        for first, second in pairs
    ]
    return "\n".join([*lines, "</robot>", ""])


def _scan_configuration(scene: Scene, Q: FloatArray, tip: str) -> FloatArray | None:
    """Free configuration that looks down on the bin best; None if none is free."""
    # As it will be written: degrees with one decimal, metres with four.
    factor = np.where(scene.robot.is_revolute, np.radians(0.1), 1e-4)
    Q = np.round(Q / factor) * factor
    low, high = scene.robot.lower_rad, scene.robot.upper_rad
    Q = Q[((low <= Q) & (high >= Q)).all(axis=1)]
    Q = Q[scene.checker.free_mask(Q)]
    if not len(Q):
        return None
    T = scene.kinematics.forward_many(Q)
    column, sign = AXES[approach_axis(tip)]
    reach = np.linalg.norm(T[:, :2, 3], axis=1).max()
    over = T[:, :3, 3] - scene.T_base_bin[:3, 3]
    off_centre = np.linalg.norm(over[:, :2], axis=1) / reach
    height = np.abs(over[:, 2] / reach - 0.5)
    downwards = -sign * T[:, 2, column]
    effort = np.abs(Q).mean(axis=1) / np.pi
    return np.asarray(Q[np.argmax(downwards - off_centre - height - effort)])


def _as_user(choices: StarterChoices, q: FloatArray) -> dict[str, float]:
    return {
        joint.name: round(user_value(joint, float(value)), 4)
        for joint, value in zip(choices.joints, q, strict=True)
    }
