"""A commented starter cell for a robot of which only the URDF is known."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, field

from reachmap.cell.files.urdf import UrdfJoint
from reachmap.cell.text.yaml_writer import WIDTH, scalar

SIX_AXES = 6
# Inner sizes: a usual bin, and a flat Euro container (600 x 400 x 120) for wide hands.
BINS_M = (0.36, 0.26, 0.15), (0.56, 0.36, 0.11)


@dataclass(frozen=True, slots=True, kw_only=True)
class StarterChoices:
    """What was guessed or chosen for the starter cell.

    Attributes
    ----------
    urdf, srdf, joint_limits : str
        References as they are written; the last two may be "".
    packages : mapping
        Package name to folder, as it is written.
    xacro_args : mapping
        Argument of a xacro file to value.
    base, tip : str
        Links.
    joints : tuple of UrdfJoint
        Joints that move, base first.
    locked : dict
        Other moving joints to their positions [deg or m].
    approach_axis : str
        Axis of the tip that points into the object.
    own_roll : bool
        Whether the arm leaves its tool no choice of its roll.
    tool_m : float
        From the tip to the TCP along the approach axis.
    reach_m : float
        How far the TCP gets from the base axis.
    bin_inner_m : tuple of float
        Inner size of the bin for an arm that reaches 0.9 m or more.
    bin_xyz_m, bin_yaw_deg : tuple of float, float
        Where the bin stands.
    scan_deg : dict
        Joint to position in the scan configuration [deg or m].
    states : tuple of str
        Named configurations of the SRDF; the first is the scan configuration.
    bodies : tuple of str
        Bodies as lines of YAML.
    """

    name: str
    urdf: str
    srdf: str = ""
    joint_limits: str = ""
    packages: Mapping[str, str] = field(default_factory=dict)
    xacro_args: Mapping[str, str] = field(default_factory=dict)
    base: str
    root: str
    tip: str
    joints: tuple[UrdfJoint, ...]
    locked: Mapping[str, float] = field(default_factory=dict)
    approach_axis: str = "+z"
    own_roll: bool = False
    tool_m: float = 0.0
    reach_m: float = 1.0
    bin_inner_m: tuple[float, float, float] = BINS_M[0]
    bin_xyz_m: tuple[float, float, float] | None = None
    bin_yaw_deg: float = 90.0
    scan_deg: Mapping[str, float] = field(default_factory=dict)
    states: tuple[str, ...] = ()
    bodies: tuple[str, ...] = ()


def middle_position(joint: UrdfJoint) -> float:
    """Zero if the joint may be there, else the middle of its range [rad or m]."""
    low, high = joint.lower, joint.upper
    if (low is None or low < 0.0) and (high is None or high > 0.0):
        return 0.0
    if low is None or high is None:
        return low or high or 0.0
    return (low + high) / 2.0


def user_value(joint: UrdfJoint, value: float) -> float:
    """Position in the unit of the cell file: degrees, or metres if prismatic."""
    return math.degrees(value) if _turns(joint) else value


def cell_name(text: str) -> str:
    """Name of a cell made from any text: letters, digits, dots and dashes."""
    return re.sub(r"[^A-Za-z0-9.]+", "-", text).strip("-.")[:60] or "my-cell"


def starter_text(choices: StarterChoices) -> str:
    """YAML text with a comment at everything that was guessed."""
    parts = [
        _head(choices),
        _robot(choices),
        _surroundings(choices),
        _scan(choices),
        _scans(choices),
    ]
    return "\n".join(parts)


def _turns(joint: UrdfJoint) -> bool:
    return joint.type != "prismatic"


def _head(c: StarterChoices) -> str:
    return f"""\
# Starter cell for {c.name}, written by reachmap new-cell. Lengths in metres, angles in
# degrees. Lines marked GUESS were not known: put your own numbers there.
# `reachmap check THIS_FILE` says what is wrong with it.
format: reachmap.cell
format_version: "1.0"
name: {scalar(c.name)}
description: {scalar(f"{c.name} with a bin in front of it")}
"""


def _robot(c: StarterChoices) -> str:
    lines = []
    if c.packages:
        lines += ["resources:", f"  packages: {scalar(dict(c.packages))}"]
    lines += ["robot:", f"  urdf: {scalar(c.urdf)}"]
    if c.xacro_args:
        lines.append(f"  xacro_args: {scalar(dict(c.xacro_args))}")
    if c.srdf and c.joint_limits:
        lines.append(f"  srdf: {scalar(c.srdf)}")
    elif c.srdf:
        lines.append(
            "  # Pairs of links that touch in every position are disabled here."
        )
        lines.append(f"  srdf: {scalar(c.srdf)}")
    else:
        lines.append(
            "  # srdf: robot.srdf       # MoveIt's disabled collisions, if any"
        )
    if c.base != c.root:
        lines.append(f"  base_frame: {scalar(c.base)}")
    lines += [
        "  # GUESS: the link that carries the tool, the tool centre point in its",
        "  # frame, and the axis of it that points into the object.",
        f"  tcp: {{parent: {scalar(c.tip)}, xyz: {scalar(tcp_xyz(c))}, "
        f'approach_axis: "{c.approach_axis}"}}',
    ]
    names = ", ".join(joint.name for joint in c.joints)
    lines += textwrap.wrap(
        f"Joints that move: {names}.",
        WIDTH,
        initial_indent="  # ",
        subsequent_indent="  # ",
        break_on_hyphens=False,
    )
    if c.locked:
        lines.append("  # Joints that stay where they are [deg, or m if they slide].")
        lines.append(f"  locked_joints_deg: {scalar(dict(c.locked))}")
    lines += _limits(c)
    if c.own_roll:
        lines += [
            "tool:",
            "  # The arm cannot turn its tool: the roll follows from the place.",
            "  roll: free",
        ]
    return "\n".join(lines) + "\n"


def tcp_xyz(c: StarterChoices) -> list[float]:
    """TCP in the frame of the tip [m]."""
    length_m = c.tool_m if c.approach_axis[0] == "+" else -c.tool_m
    return [length_m or 0 if axis == c.approach_axis[1] else 0 for axis in "xyz"]


def _limits(c: StarterChoices) -> list[str]:
    slow = [j.name for j in c.joints if not j.velocity or j.velocity <= 0]
    unbounded = [j for j in c.joints if j.lower is None or j.upper is None]
    lines = ["  limits:"]
    if slow:
        lines.append("    # GUESS: the URDF has no velocity for these joints.")
        lines.append(f"    velocity_rad_s: {scalar(dict.fromkeys(slow, 1.0))}")
    else:
        lines.append("    # Velocities are those of the URDF; tighten them here.")
        lines.append("    # velocity_rad_s: 2.0")
    given = {j.name: j.acceleration for j in c.joints if j.acceleration}
    if len(given) == len(c.joints):
        lines.append("    # Accelerations are those of the URDF; tighten them here.")
        lines.append(f"    acceleration_rad_s2: {scalar(given)}")
    else:
        lines.append("    acceleration_rad_s2: 5.0   # GUESS: the URDF lacks them")
    if c.joint_limits:
        lines.insert(0, f"  joint_limits: {scalar(c.joint_limits)}")
        lines[-1] += "; or MoveIt's, if lower"
    if unbounded:
        table = {joint.name: _range(joint) for joint in unbounded}
        lines.append("    # GUESS: the URDF sets no end to these joints.")
        lines.append(f"    position_deg: {scalar(table)}")
    return lines


def _range(joint: UrdfJoint) -> list[float]:
    """Range for a joint that lacks a limit: a turn, or two metres [deg or m]."""
    widest = 180.0 if _turns(joint) else 1.0
    low = -widest if joint.lower is None else user_value(joint, joint.lower)
    high = widest if joint.upper is None else user_value(joint, joint.upper)
    if joint.upper is None and low >= widest:
        high = low + 2 * widest
    if joint.lower is None and high <= -widest:
        low = high - 2 * widest
    return [round(low, 3), round(high, 3)]


def bin_size(reach_m: float) -> float:
    """Share of a usual bin's size that suits an arm: 1 for a reach of 0.9 m or more."""
    return min(1.0, max(0.1, reach_m / 0.9))


def _bin_inner(c: StarterChoices) -> list[float]:
    """Inner size of the bin [m]."""
    return [round(side * bin_size(c.reach_m), 3) for side in c.bin_inner_m]


def _surroundings(c: StarterChoices) -> str:
    xyz = c.bin_xyz_m or (round(0.6 * c.reach_m, 3), 0.0, 0.0)
    pose = {"xyz": list(xyz), "rpy_deg": [0, 0, c.bin_yaw_deg]}
    bodies = f"{'bodies: []':<30} # what is not in the URDF; replace [] by entries like"
    if c.bodies:
        bodies = "\n".join(["bodies:", *c.bodies, "# and others, like"])
    return f"""\
# camera:                      # the optical frame: z into the scene, x to the right
#   parent: {c.tip}
#   xyz: [0, -0.1, 0.05]
#   range_m: [0.5, 0.6]
#   field_of_view_deg: [57, 36]
{bodies}
#  - name: gripper
#    attach_to: {c.tip}
#    shape: {{cylinder: {{radius: 0.015, length: 0.1}}}}
#    pose: {{xyz: [0, 0, 0.05]}}   # centre of the shape
#    touch: []               # links and bodies it may touch
#  - name: table
#    attach_to: world
#    shape: {{box: [1.5, 1.5, 0.05]}}
#    pose: {{xyz: [0, 0, -0.027]}}
#    touch: [{c.base}, bin]
bin:                           # GUESS; `reachmap place-bin` finds a good place
  inner: {scalar(_bin_inner(c))}
  wall: 0.005
  pose: {scalar(pose)}
"""


def _scan(c: StarterChoices) -> str:
    lines = [
        "# GUESS: where the camera looks at the bin from, and where every path starts.",
        "scan_configuration:",
    ]
    if c.states:
        more = f"   # or {', '.join(c.states[1:])}" if c.states[1:] else ""
        lines.append(f"  group_state: {scalar(c.states[0])}{more}")
        return "\n".join(lines) + "\n"
    lines += [
        "  q_deg:",
        *(
            f"    {scalar(joint.name)}: {scalar(c.scan_deg[joint.name])}"
            for joint in c.joints
        ),
    ]
    return "\n".join(lines) + "\n"


def _orientations(c: StarterChoices) -> str:
    if len(c.joints) >= SIX_AXES:
        return "{family: cone, tilts_deg: [0, 30], azimuths: [1, 8], rolls: 3}"
    rolls = 1 if c.own_roll else 12
    how = "at the roll that the arm has there" if c.own_roll else "in twelve rolls"
    return (
        f"{{family: cone, tilts_deg: [0], azimuths: [1], rolls: {rolls}}}\n"
        f"  # Few axes reach few orientations: straight down, {how}"
    )


def _scans(c: StarterChoices) -> str:
    reach = max(0.05, math.ceil(c.reach_m * 20) / 20)
    layer = scalar(round(_bin_inner(c)[2] / 3, 3))
    cone = _orientations(c)
    low, high = round(-0.4 * reach, 3), round(0.6 * reach, 3)
    side = round(0.85 * reach, 3)
    left = round(-0.1 * reach, 3)
    right_min, right_max = scalar([left, -side, low]), scalar([reach, 0, high])
    left_min, left_max = scalar([left, 0, low]), scalar([reach, side, high])
    return f"""\
workspace_scan:
  cubes:                       # on either side of y = 0, which they share
    - {{name: right, min: {right_min}, max: {right_max}, grid: [11, 6]}}
    - {{name: left, min: {left_min}, max: {left_max}, grid: [11, 6]}}
  z_step: {scalar(round((high - low) / 10, 4))}
  orientations: {cone}
  repeats: 5
bin_scan:
  grid: [20, 14]
  layers: [{layer}]               # heights above the bottom
  orientations: {cone}
  repeats: 5
  approach_distance_m: clear_rim   # straight way before the grasp, from above the rim
seed: 1
"""
