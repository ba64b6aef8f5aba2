"""``place-robot``: from a cell to the pose of its robot base."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.base_pose import (
    heading_rad,
    level_frame,
    mounting_bodies,
    with_world_at,
)
from reachmap.cell.fragments import fragment_overrides
from reachmap.cell.loaded import LoadedCell
from reachmap.cell.loading import cell_path, read_cell
from reachmap.core.kinematics.kinematics import Kinematics
from reachmap.disk import as_path
from reachmap.errors import SettingsError
from reachmap.maps import RunClock, check_outputs
from reachmap.maps.base.format import write_base
from reachmap.maps.base.record import BasePlacement
from reachmap.maps.bytes.publish import check_picture
from reachmap.placement.base.assembly import BaseSearch, base_placement
from reachmap.placement.base.fit import BaseFit
from reachmap.placement.base.lattice import base_region, reach_m
from reachmap.placement.base.mounting import (
    AS_IT_IS,
    LEANS_DEG,
    AnyMounting,
    Mounting,
    RailMounting,
    T_level_base_of,
    own_pose,
)
from reachmap.placement.base.problem import BaseProblem
from reachmap.placement.base.search import search_base
from reachmap.placement.mapped.evaluator import open_evaluator
from reachmap.placement.mapped.exact import Pose
from reachmap.placement.mapped.imaging import can_choose
from reachmap.placement.mapped.sample import open_frames
from reachmap.placement.predicted.region import AXES, Region
from reachmap.runtime.options import IN_PROCESS, RunOptions
from reachmap.runtime.progress import Progress
from reachmap.tools.prologue import (
    check_places,
    path_of_cell,
    refuse_cell_files,
    with_seed,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotChoice:
    """Options on how the robot is placed.

    Attributes
    ----------
    mountings : tuple of str
        ``floor``, ``wall``, ``ceiling`` or a lean [deg]; empty: as the cell has it.
    rail : str
        Locked prismatic joint whose position is sought instead of a pose, or "".
    limits : mapping
        ``x``, ``y``, ``z`` to (low, high) in the world [m]; of a rail ``x``.
    fixed : mapping
        ``x``, ``y``, ``z`` [m] or ``yaw`` [deg] to a value.
    moves, stays : tuple of str
        Bodies on the world that go with the base, besides those that may touch it, and
        those that do not.
    arms : tuple of Path
        Cell fragments with other arms, compared with the cell's own.
    top : int
        Different places that are mapped exactly.
    keep_scan_configuration : bool
    """

    mountings: tuple[str, ...] = ()
    rail: str = ""
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    fixed: Mapping[str, float] = field(default_factory=dict)
    moves: tuple[str, ...] = ()
    stays: tuple[str, ...] = ()
    arms: tuple[Path, ...] = ()
    top: int = 3
    keep_scan_configuration: bool = False


def place_robot(
    cell: str | Path,
    output: str | Path,
    *,
    choice: RobotChoice | None = None,
    overrides: Sequence[str] = (),
    seed: int | None = None,
    picture: str | Path | None = None,
    run: RunOptions = IN_PROCESS,
) -> BasePlacement:
    """Choose the robot's base pose for a bin that is fixed in the world.

    Parameters
    ----------
    cell : str or Path
        Shipped name or path.
    output : Path
        The artefact to write.
    choice : RobotChoice, optional
    overrides : sequence of str
        ``key.path=value``.
    seed : int, optional
    picture : Path, optional
        Also draw the places there; the suffix, .png or .svg, says how.
    run : RunOptions

    Raises
    ------
    ReachmapError
        See :mod:`reachmap.errors`.
    """
    cell, output, picture = str(cell), Path(output), as_path(picture)
    choice = choice or RobotChoice()
    _check(choice)
    check_picture(picture, "--picture")
    check_outputs(
        [output, picture],
        overwrite=run.overwrite,
        inputs=[path_of_cell(cell), *choice.arms],
    )
    clock = RunClock(workers=run.workers)
    overrides = with_seed(overrides, seed)
    cells = _cells(cell, overrides, choice)
    refuse_cell_files([output, picture], *cells)
    names = (choice.rail,) if choice.rail else choice.mountings or (AS_IT_IS,)
    with clock.phase("decide"):
        searches = [
            _searched(loaded, name, choice, run, arm=arm, mounting=k)
            for arm, loaded in enumerate(cells)
            for k, name in enumerate(names)
        ]
    arms = ("the cell's own", *(path.stem for path in choice.arms))
    placement = base_placement(
        searches, arms, names, _choice_settings(choice), rail=choice.rail, clock=clock
    )
    write_base(output, placement, overwrite=run.overwrite)
    if picture is not None:
        _draw(picture, placement, run)
    return placement


def _check(choice: RobotChoice) -> None:
    """Refuse wrong settings before the work is done."""
    named = {choice.rail or name: pair for name, pair in choice.limits.items()}
    check_places(named, choice.fixed, axes=AXES, top=choice.top)
    for name in choice.mountings:
        try:
            fits = name in LEANS_DEG or 0.0 <= float(name) <= 180.0
        except ValueError:
            fits = False
        if not fits:
            raise SettingsError(
                f"--mount {name!r:.40}: expected {', '.join(LEANS_DEG)} or a tilt from "
                "0 to 180 [deg]"
            )
    if choice.rail and (choice.mountings or choice.fixed or set(choice.limits) - {"x"}):
        raise SettingsError(
            "--rail: the base stays where it is, so that --mount, --fix, --heights and "
            "--region have no meaning (--rail-range limits the joint)"
        )


def _cells(
    cell: str, overrides: Sequence[str], choice: RobotChoice
) -> list[LoadedCell]:
    """The cell, and its versions with each other arm."""
    own = read_cell(cell, overrides)
    others = [
        read_cell(
            cell,
            [*fragment_overrides(path, own.text, str(cell_path(cell))), *overrides],
        )
        for path in choice.arms
    ]
    for loaded in (own, *others):
        if loaded.cell.bin_scan.orientations.reference == "robot_base":
            raise SettingsError(
                "bin_scan.orientations.reference is robot_base: test grasps that turn "
                "with the base are others at each place (world and bin can be used)"
            )
    return [own, *others]


def _searched(
    loaded: LoadedCell,
    name: str,
    choice: RobotChoice,
    run: RunOptions,
    *,
    arm: int,
    mounting: int,
) -> BaseSearch:
    along_world = bool({"x", "y"} & {*choice.limits, *choice.fixed})
    T_world_level = level_frame(loaded.cell, along_world=along_world)
    levelled = with_world_at(loaded, T_world_level)
    T_level_base = T_level_base_of(loaded, T_world_level)
    how = _mounting(name, loaded, choice, T_level_base)
    scene = how.scene(levelled)
    kinematics = Kinematics(scene.robot)
    reach = reach_m(kinematics)
    own, region = _own_and_region(loaded, choice, T_world_level, T_level_base, reach)
    is_open = open_frames(scene.robot, levelled)
    progress = Progress(f"place-robot {name}", quiet=run.quiet)
    with open_evaluator(
        levelled, is_open, run, progress=progress, placing=how
    ) as evaluator:
        problem = BaseProblem(
            loaded=levelled,
            mounting=how,
            is_open=is_open,
            region=region,
            own=own,
            scene=scene,
            scan_configuration=np.array(scene.scan_configuration),
            keep_scan=choice.keep_scan_configuration or not can_choose(scene),
            fit=BaseFit(levelled, how) if isinstance(how, Mounting) else None,
            evaluator=evaluator,
        )
        outcome = search_base(problem, reach, choice.top)
    return BaseSearch(
        arm=arm,
        mounting=mounting,
        loaded=loaded,
        problem=problem,
        outcome=outcome,
        T_world_level=T_world_level,
        is_own=isinstance(how, RailMounting)
        or bool(np.allclose(how.lean, T_level_base[:3, :3])),
    )


def _mounting(
    name: str, loaded: LoadedCell, choice: RobotChoice, T_level_base: FloatArray
) -> AnyMounting:
    if choice.rail:
        joint = loaded.robot.joints.get(choice.rail)
        locked = loaded.cell.robot.locked_joints_deg
        if joint is None or joint.type != "prismatic" or choice.rail not in locked:
            raise SettingsError(
                f"--rail {choice.rail!r:.60}: expected a prismatic joint that the cell "
                f"has in robot.locked_joints_deg (there: {', '.join(locked) or 'none'})"
            )
        return RailMounting(name=choice.rail)
    known = {b.name for b in loaded.cell.bodies if b.attach_to == "world"}
    for body in (*choice.moves, *choice.stays):
        if body not in known:
            raise SettingsError(
                f"{body!r:.60} is not a body on the world "
                f"(those are: {', '.join(sorted(known)) or 'none'})"
            )
    stands = dict.fromkeys([*mounting_bodies(loaded), *choice.moves])
    kept = tuple(body for body in stands if body not in choice.stays)
    return Mounting.of(name, T_level_base[:3, :3], kept)


def _own_and_region(
    loaded: LoadedCell,
    choice: RobotChoice,
    T_world_level: FloatArray,
    T_level_base: FloatArray,
    reach: float,
) -> tuple[Pose, Region]:
    """Present pose, and where the base may stand, both in the level frame."""
    if choice.rail:
        at = loaded.cell.robot.locked_joints_deg[choice.rail]
        joint = loaded.robot.joints[choice.rail]
        if joint.lower is None or joint.upper is None:
            raise SettingsError(f"--rail {choice.rail}: the joint has no limits")
        low, high = choice.limits.get("x", (joint.lower, joint.upper))
        low, high = max(low, joint.lower), min(high, joint.upper)
        if low > high:
            raise SettingsError(
                f"--rail {choice.rail}: expected a range inside its limits "
                f"[{joint.lower:g}, {joint.upper:g}] m"
            )
        zero = dict.fromkeys(("y", "z", "yaw"), 0.0)
        own = (round(at, 9), 0.0, 0.0, 0.0)
        return own, base_region(own, reach, {"x": (low, high)}, zero)
    own = own_pose(T_level_base)
    origin = dict(zip(AXES, T_world_level[:3, 3].tolist(), strict=False))
    limits = {
        name: (low - origin[name], high - origin[name])
        for name, (low, high) in choice.limits.items()
    }
    fixed = {
        name: value - origin[name]
        for name, value in choice.fixed.items()
        if name != "yaw"
    }
    if "yaw" in choice.fixed:
        heading = heading_rad(loaded.cell.robot.base_pose.matrix()[:3, :3])
        fixed["yaw"] = float(np.radians(choice.fixed["yaw"])) - heading
    return own, base_region(own, reach, limits, fixed)


def _choice_settings(choice: RobotChoice) -> dict[str, Any]:
    return {
        "mountings": list(choice.mountings),
        "rail": choice.rail,
        "limits": {k: list(v) for k, v in choice.limits.items()},
        "fixed": dict(choice.fixed),
        "moves": list(choice.moves),
        "stays": list(choice.stays),
        "arms": [path.name for path in choice.arms],
        "top": choice.top,
        "keep_scan_configuration": choice.keep_scan_configuration,
    }


def _draw(path: Path, placement: BasePlacement, run: RunOptions) -> None:
    from reachmap.plots.albums import base_album
    from reachmap.plots.parts.files import write_only_picture

    write_only_picture(
        path,
        base_album(placement),
        config_sha256=placement.stamp.config_sha256,
        overwrite=run.overwrite,
    )
