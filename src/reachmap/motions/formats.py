"""Motions as text: for programs, for ROS, and for the controllers of robots.

Robot languages get joint motions only, one for each waypoint and with an exact stop:
a controller moves the joints in proportion between them, which is the straight joint
motion that was verified. Blending would leave it, and so would a linear motion of the
tool where the joints turn much; neither is written.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.errors import SettingsError
from reachmap.motions.motion import Motion

PERIOD_S: Final = 0.02
"""Step of sampled trajectories; a common period of position controllers."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Origin:
    """Origin of exported motions, written at the head of every file.

    Attributes
    ----------
    map_sha256, cell_sha256 : str
        Content of the map, and its cell.
    cell : str
        Name of the cell.
    base, tcp : str
        Frame that the joints are counted from, and what the tool centre point is.
    joint_names : tuple of str
    is_revolute : bool array, shape (dof,)
    velocity, acceleration : array, shape (dof,)
        Limits that times keep to.
    """

    map_sha256: str
    cell_sha256: str
    cell: str
    base: str
    tcp: str
    joint_names: tuple[str, ...]
    is_revolute: BoolArray = field(repr=False)
    velocity: FloatArray = field(repr=False)
    acceleration: FloatArray = field(repr=False)

    def lines(self) -> list[str]:
        """Sentences for the head of a file."""
        return [
            f"reachmap motions of {self.cell}",
            f"map {self.map_sha256}",
            f"cell {self.cell_sha256}",
            f"base {self.base}; TCP {self.tcp}",
            f"joints {', '.join(self.joint_names)}: signs and zeros of the URDF",
            "joint motions with an exact stop at every point (blend radius 0), as "
            "verified; do not blend",
            "each starts at its first point, the scan configuration; the way there was "
            "not verified",
        ]


def as_csv(motions: Sequence[Motion], origin: Origin) -> str:
    """One row a waypoint; lines that begin with # say where it comes from."""
    text = io.StringIO()
    text.writelines(f"# {line}\n" for line in origin.lines())
    writer = csv.writer(text, lineterminator="\n")
    unit = ["rad" if turns else "m" for turns in origin.is_revolute]
    columns = [f"{n} [{u}]" for n, u in zip(origin.joint_names, unit, strict=True)]
    place = ["layer", "y", "x", "orientation"]
    writer.writerow([*place, "point", "stage", "time [s]", *columns])
    for motion in motions:
        rows = zip(motion.stage, motion.time_s, motion.configuration, strict=True)
        for number, (stage, time_s, q) in enumerate(rows):
            numbers = [repr(float(value)) for value in (time_s, *q)]
            writer.writerow(
                [*motion.test_grasp, number, stage, numbers[0], *numbers[1:]]
            )
    return text.getvalue()


def as_json(motions: Sequence[Motion], origin: Origin) -> str:
    """Everything as JSON, numbers to their last place."""
    document = {
        "format": "reachmap.motions",
        "format_version": "1.0",
        **_head(origin),
        "motions": [
            {
                "test_grasp": list(motion.test_grasp),
                "stage": list(motion.stage),
                "time_s": motion.time_s.tolist(),
                "configuration": motion.configuration.tolist(),
                **_blends(motion),
            }
            for motion in motions
        ],
    }
    return json.dumps(document) + "\n"


def as_joint_trajectory(motions: Sequence[Motion], origin: Origin) -> str:
    """``trajectory_msgs/JointTrajectory`` messages as YAML documents."""
    return _messages(motions, origin, lambda trajectory: trajectory)


def as_moveit(motions: Sequence[Motion], origin: Origin) -> str:
    """``moveit_msgs/RobotTrajectory`` messages as YAML documents."""
    return _messages(
        motions, origin, lambda trajectory: {"joint_trajectory": trajectory}
    )


def as_urscript(motions: Sequence[Motion], origin: Origin) -> str:
    """A URScript function for each motion."""
    _require_six(origin, "urscript")
    v, a = float(origin.velocity.min()), float(origin.acceleration.min())
    lines = [f"# {line}" for line in origin.lines()]
    for motion in motions:
        lines += [f"def {_name(motion)}():"]
        lines += [
            f"  movej([{', '.join(f'{x:.9f}' for x in q)}], a={a:.6g}, v={v:.6g}, r=0)"
            for q in motion.configuration
        ]
        lines += ["end", ""]
    return "\n".join(lines).rstrip() + "\n"


def as_krl(motions: Sequence[Motion], origin: Origin) -> str:
    """A KRL subroutine for each motion, exact stops at every point."""
    _require_six(origin, "krl")
    lines = [f"; {line}" for line in origin.lines()]
    for motion in motions:
        lines += [f"DEF {_name(motion)}()", "  $ADVANCE = 0"]
        for q in motion.configuration:
            axes = ", ".join(f"A{k} {x:.7f}" for k, x in enumerate(np.rad2deg(q), 1))
            lines.append(f"  PTP {{AXIS: {axes}}}")
        lines += ["END", ""]
    return "\n".join(lines).rstrip() + "\n"


def as_rapid(motions: Sequence[Motion], origin: Origin) -> str:
    """A RAPID module with a procedure for each motion, ``fine`` at every point."""
    _require_six(origin, "rapid")
    lines = [f"! {line}" for line in origin.lines()]
    lines.append("MODULE reachmap_motions")
    for motion in motions:
        lines.append(f"  PROC {_name(motion)}()")
        for q in motion.configuration:
            axes = ", ".join(f"{x:.7f}" for x in np.rad2deg(q))
            target = f"[[{axes}], [9E9, 9E9, 9E9, 9E9, 9E9, 9E9]]"
            lines.append(f"    MoveAbsJ {target}, v1000, fine, tool0;")
        lines.append("  ENDPROC")
    return "\n".join([*lines, "ENDMODULE"]) + "\n"


Writer = Callable[[Sequence[Motion], Origin], str]
WRITERS: Final[Mapping[str, Writer]] = {
    "csv": as_csv,
    "json": as_json,
    "joint-trajectory": as_joint_trajectory,
    "moveit": as_moveit,
    "urscript": as_urscript,
    "krl": as_krl,
    "rapid": as_rapid,
}
"""Name of each format to what writes it."""


def _blends(motion: Motion) -> dict[str, Any]:
    given = motion.blend_rad
    return {} if given is None else {"blend_rad": given.tolist()}


def _head(origin: Origin) -> dict[str, Any]:
    return {
        "map_sha256": origin.map_sha256,
        "cell_sha256": origin.cell_sha256,
        "cell": origin.cell,
        "base": origin.base,
        "tcp": origin.tcp,
        "joint_names": list(origin.joint_names),
        "blend_radius_m": 0.0,
    }


def _messages(
    motions: Sequence[Motion],
    origin: Origin,
    wrap: Callable[[dict[str, Any]], dict[str, Any]],
) -> str:
    """Sampled motions; a mapping of JSON is YAML as well."""
    documents = ["\n".join(f"# {line}" for line in origin.lines())]
    for motion in motions:
        times, positions, speeds = motion.sampled(
            PERIOD_S, origin.velocity, origin.acceleration
        )
        points = [
            {
                "positions": q.tolist(),
                "velocities": v.tolist(),
                "time_from_start": _duration(float(t)),
            }
            for t, q, v in zip(times, positions, speeds, strict=True)
        ]
        trajectory = {"joint_names": list(origin.joint_names), "points": points}
        documents.append(f"# {_name(motion)}\n{json.dumps(wrap(trajectory))}")
    return "\n---\n".join(documents) + "\n"


def _duration(time_s: float) -> dict[str, int]:
    nanoseconds = round(time_s * 1e9)
    return {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}


def _name(motion: Motion) -> str:
    return "to_grasp_" + "_".join(map(str, motion.test_grasp))


def _require_six(origin: Origin, language: str) -> None:
    if len(origin.joint_names) != 6 or not origin.is_revolute.all():
        raise SettingsError(
            f"--to {language}: needs an arm of six revolute joints (this one has "
            f"{', '.join(origin.joint_names)}); take csv, json or joint-trajectory"
        )
