"""``reachmap new-cell``: a starter cell from a URDF, tried before it is written."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell import guesses
from reachmap.cell.files.moveit_config import planning_group
from reachmap.cell.files.srdf import srdf_text
from reachmap.cell.loading import LoadedCell, cell_from_text, check_storable
from reachmap.cell.starter import (
    BINS_M,
    StarterChoices,
    cell_name,
    middle_position,
    starter_text,
    tcp_xyz,
    user_value,
)
from reachmap.cell.text.messages import did_you_mean
from reachmap.cell.text.yaml_writer import scalar
from reachmap.core.kinematics.any_roll import has_own_roll
from reachmap.core.kinematics.kinematics import Kinematics
from reachmap.core.robot.model import RobotModel
from reachmap.core.scene import Scene
from reachmap.disk import as_path
from reachmap.errors import CellError, ReachmapError, SceneError, SettingsError
from reachmap.geometry import quaternion_wxyz_from_rotation
from reachmap.maps.bytes.publish import check_output, publish
from reachmap.tools import arm_sampling
from reachmap.tools.bin_guess import ENOUGH, BinGuess, guess_bin, guess_notes
from reachmap.tools.robot_source import RobotSource, read_source

LABEL = "starter cell"
# A named state is taken for the scan configuration if it looks down at least this much
# (cosine of 60 degrees).
LOOKS_DOWN = 0.5
# Thickness of a supposed tool [m]: that of the gripper in the starter cell's examples.
ROD_M = 0.03


@dataclass(frozen=True, slots=True, kw_only=True)
class NewCell:
    """What was written, and what was guessed.

    Attributes
    ----------
    path, srdf_path : Path
        The cell, and the SRDF beside it if links touch in every position.
    packages : mapping
        Packages that the cell names.
    notes : tuple of str
        What was left out, or put elsewhere than usual.
    problems : tuple of str
        Why the cell does not work yet; empty where it does.
    """

    path: Path
    srdf_path: Path | None
    base: str
    tip: str
    approach_axis: str
    joints: tuple[str, ...]
    packages: Mapping[str, str]
    notes: tuple[str, ...]
    problems: tuple[str, ...]


def new_cell(
    urdf: str | Path,
    *,
    output: str | Path,
    base: str | None = None,
    tip: str | None = None,
    packages: Mapping[str, str] | None = None,
    xacro_args: Mapping[str, str] | None = None,
    moveit_config: str | Path | None = None,
    overwrite: bool = False,
) -> NewCell:
    """Write a commented starter cell for a robot.

    Nothing is written where the cell could not be loaded: what is wrong then is not in
    the cell. One that loads but needs fixing is written as well.

    Parameters
    ----------
    urdf : str
        URDF or xacro: ``package://`` name or path.
    output : Path
        The cell file.
    base, tip : str, optional
        Links of the chain; guessed where omitted.
    packages, xacro_args : mapping, optional
        Package name to folder, argument of the xacro file to value; both are written
        into the cell.
    moveit_config : Path, optional
        Folder of a MoveIt configuration: SRDF, joint limits, named states and bodies
        of planning scenes are taken into the cell.
    overwrite : bool
        Replace ``output``.

    Raises
    ------
    CellError, SettingsError, OutputError
        The URDF cannot be used, a link does not exist, or nothing can be written.
    """
    output = Path(output)
    moveit_config = as_path(moveit_config)
    urdf = str(urdf)
    target = check_output(output, overwrite=overwrite, inputs=[urdf])
    folder = target.parent
    for place in (Path(urdf), folder):
        check_storable(place)
    srdf_target = target.with_suffix(".srdf")
    check_output(srdf_target, overwrite=True, inputs=[urdf])
    source = read_source(
        urdf,
        folder,
        packages=packages or {},
        xacro_args=xacro_args or {},
        moveit_config=moveit_config,
    )
    inputs = [folder / name for name in (source.srdf, source.joint_limits) if name]
    check_output(target, overwrite=overwrite, inputs=inputs)
    attempt = _Attempt(folder, source, _first_choices(source, base, tip))
    if tip is None:
        others = guesses.other_tips(
            source.robot, attempt.choices.base, attempt.choices.tip
        )
        attempt.notes += others
    problems = attempt.refine()
    choices = attempt.choices
    if attempt.srdf:
        check_output(srdf_target, overwrite=overwrite, inputs=inputs)
        publish(srdf_target, [attempt.srdf.encode()], overwrite=overwrite)
        choices = replace(choices, srdf=srdf_target.name)
    publish(output, [starter_text(choices).encode()], overwrite=overwrite)
    return NewCell(
        path=output,
        srdf_path=output.with_suffix(".srdf") if attempt.srdf else None,
        base=choices.base,
        tip=choices.tip,
        approach_axis=choices.approach_axis,
        joints=tuple(joint.name for joint in choices.joints),
        packages=choices.packages,
        notes=(*source.notes, *attempt.notes),
        problems=problems,
    )


def _first_choices(
    source: RobotSource, base: str | None, tip: str | None
) -> StarterChoices:
    """Choices that the files alone decide."""
    robot = source.robot
    for link in (base, tip):
        if link is not None and link not in robot.links:
            hint = did_you_mean(link, robot.links)
            raise SettingsError(f"{source.label}: no link {link!r}; {hint}")
    chosen_base = base or guesses.guess_base(robot)
    group: tuple[str, ...] = ()
    if source.moveit is not None:
        fingers = guesses.finger_joints(robot, chosen_base)
        group = planning_group(robot, source.moveit, fingers)
    below = guesses.joints_below(robot, chosen_base)
    group = tuple(n for n in group if base is None or n in below)
    chosen_tip = tip or guesses.guess_tip(robot, chosen_base, group)
    chain = robot.chain(chosen_base, chosen_tip)
    names = [n for n in chain if tip or not group or n in group]
    if not names:
        raise SettingsError(
            f"{source.label}: no joint moves between {chosen_base!r} and {chosen_tip!r}"
        )
    joints = [robot.joints[name] for name in names]
    # What drives a joint of the arm from beside is not to be held by a guess.
    driving = {joint.mimics for joint in robot.way(chosen_base, chosen_tip)}
    return StarterChoices(
        name=cell_name(robot.name or Path(source.label).stem),
        urdf=source.urdf,
        srdf=source.srdf,
        joint_limits=source.joint_limits,
        packages=source.packages,
        xacro_args=source.xacro_args,
        base=chosen_base,
        root=robot.root,
        tip=chosen_tip,
        joints=tuple(joints),
        approach_axis="+x" if chosen_tip.lower().endswith("ee_link") else "+z",
        locked={
            joint.name: round(user_value(joint, middle_position(joint)), 4)
            for joint in robot.joints.values()
            if joint.moves and joint not in joints and joint.name not in driving
        },
        scan_deg={j.name: round(user_value(j, middle_position(j)), 4) for j in joints},
    )


class _Attempt:
    """Guesses that are refined while the arm is moved about.

    Parameters
    ----------
    folder : Path
        Where the cell will be.
    source : RobotSource
    choices : StarterChoices
    """

    def __init__(
        self, folder: Path, source: RobotSource, choices: StarterChoices
    ) -> None:
        self._folder, self._source = folder, source
        self.choices = choices
        self.srdf = ""
        self.notes: list[str] = []

    def refine(self) -> tuple[str, ...]:
        """Move the arm to refine the guesses; report problems that remain.

        Raises
        ------
        CellError
            The cell cannot even be loaded.
        """
        loaded = self._loaded()
        warnings = (_without_label(line) for line in loaded.warnings)
        self.notes += [line for line in warnings if line not in self._source.notes]
        try:
            arm = RobotModel.from_cell(loaded)
            Q = arm_sampling.as_written(arm, arm_sampling.random_configurations(arm))
            self._measure(arm, Q)
            scene = self._without_touching(Scene.build(self._loaded()), Q[:300])
            scene = self._with_bin(scene, Q)
            return self._with_scan_configuration(scene, Q)
        except CellError:
            raise
        except ReachmapError as error:
            return tuple(map(_without_label, error.lines))

    def _loaded(self) -> LoadedCell:
        """The cell as it would be read from disk."""
        try:
            loaded = cell_from_text(
                starter_text(self.choices), label=LABEL, directory=self._folder
            )
        except CellError as error:
            lines = map(_without_label, error.lines)
            raise CellError(f"{self._source.label}: {line}" for line in lines) from None
        # An SRDF of our own is not on the disk yet.
        return replace(loaded, srdf=self.srdf) if self.srdf else loaded

    def _measure(self, arm: RobotModel, Q: FloatArray) -> None:
        kinematics = Kinematics(arm)
        reach = arm_sampling.reach_of(kinematics.forward_many(Q)[:, :3, 3])
        axis = arm_sampling.approach_axis(kinematics, Q[0], reach)
        axis = axis or self.choices.approach_axis
        self.choices = replace(
            self.choices,
            reach_m=reach,
            approach_axis=axis,
            own_roll=has_own_roll(kinematics.chain, axis),
            bodies=tuple(_body_lines(self._source, arm)),
        )

    def _without_touching(self, scene: Scene, Q: FloatArray) -> Scene:
        """Disable pairs of links that touch in every position, in an SRDF."""
        touching = arm_sampling.touching_links(scene, Q)
        pairs = [
            pair for pair, share in touching.items() if share >= arm_sampling.ALWAYS
        ]
        self.notes += arm_sampling.touching_notes(touching)
        if not pairs:
            return scene
        if self.choices.srdf:
            self.notes += [
                f"{a} and {b} touch in every position, which the SRDF does not allow"
                for a, b in pairs
            ]
            return scene
        self.srdf = srdf_text(self._source.robot.name, pairs)
        return Scene.build(self._loaded())

    def _with_bin(self, scene: Scene, Q: FloatArray) -> Scene:
        """Place the bin clear of static bodies, where the arm can pick from it."""
        tip, T_base_tcp = self.choices.tip, scene.kinematics.forward_many(Q)
        best: BinGuess | None = None
        choices = self.choices
        for inner_m in BINS_M:
            self.choices = replace(choices, bin_inner_m=inner_m)
            guess = guess_bin(
                Scene.build(self._loaded(), bin_moves=True),
                T_base_tcp,
                with_tool=not guesses.is_tool_point(tip),
            )
            if guess is not None and (best is None or guess.share > best.share):
                best, chosen = guess, self.choices
            if best is not None and best.share >= ENOUGH:
                break
        if best is None:
            raise SceneError("bin.pose: the bin fits nowhere near the arm")
        self.choices = replace(
            chosen,
            bin_xyz_m=best.xyz_m,
            bin_yaw_deg=best.yaw_deg,
            tool_m=best.tool_m,
        )
        self.notes += guess_notes(best, tip)
        return Scene.build(self._loaded())

    def _with_scan_configuration(self, scene: Scene, Q: FloatArray) -> tuple[str, ...]:
        axis, reach = self.choices.approach_axis, self.choices.reach_m
        joints = self.choices.joints
        states = self._states()
        if states:
            rows = [[v[j.name] for j in joints] for v in states.values()]
            seen = arm_sampling.best_view(scene, np.array(rows), axis, reach)
            if seen is not None and seen[1] >= LOOKS_DOWN:
                names = list(states)
                best = names.pop(seen[0])
                self.choices = replace(self.choices, states=(best, *names))
                return ()
            self.notes.append(
                f"no named state is free and looks down ({', '.join(states)}); "
                "the scan configuration was searched for"
            )
        found = None
        if self.choices.tool_m:
            found = arm_sampling.best_view(self._with_tool(), Q, axis, reach)
        found = found or arm_sampling.best_view(scene, Q, axis, reach)
        if found is None:
            return ("no free scan configuration was found",)
        values = {
            joint.name: round(user_value(joint, float(value)), 4)
            for joint, value in zip(joints, Q[found[0]], strict=True)
        }
        self.choices = replace(self.choices, scan_deg=values)
        return ()

    def _with_tool(self) -> Scene:
        """The scene with a rod from the tip to the TCP, which supposes a tool."""
        chosen, along = self.choices, np.array(tcp_xyz(self.choices), float)
        rod = {
            "name": "supposed-tool",
            "attach_to": chosen.tip,
            "shape": {"box": np.maximum(np.abs(along), ROD_M).tolist()},
            "pose": {"xyz": (0.5 * along).tolist()},
        }
        self.choices = replace(chosen, bodies=(*chosen.bodies, f"  - {scalar(rod)}"))
        try:
            return Scene.build(self._loaded())
        finally:
            self.choices = chosen

    def _states(self) -> dict[str, dict[str, float]]:
        """Named states that define every joint."""
        moveit = self._source.moveit
        return {
            name: values
            for name, values in ({} if moveit is None else moveit.states).items()
            if all(joint.name in values for joint in self.choices.joints)
        }


def _body_lines(source: RobotSource, arm: RobotModel) -> list[str]:
    """Bodies of planning scenes as lines of YAML, in robot_base."""
    lines = []
    names: set[str] = {*source.robot.links, "bin"}
    for body in source.bodies:
        known = body.frame in source.robot.links and body.frame != source.robot.root
        T = body.T_frame_body if known else arm.T_base_root @ body.T_frame_body
        name = re.sub(r"[^A-Za-z0-9_.-]+", "_", body.name).strip("_.-") or "object"
        while name in names:
            name += "_"
        names.add(name)
        pose = {
            "xyz": [round(float(v), 6) + 0.0 for v in T[:3, 3]],
            "quaternion_wxyz": [
                round(float(v), 9) + 0.0
                for v in quaternion_wxyz_from_rotation(T[:3, :3])
            ],
        }
        entry = {
            "name": name,
            "attach_to": body.frame if known else "robot_base",
            "shape": body.shape,
            "pose": pose,
        }
        lines.append(f"  - {scalar(entry)}")
    return lines


def _without_label(line: str) -> str:
    return re.sub(rf"^{LABEL}(:\d+:\d+)?: ", "", line)
