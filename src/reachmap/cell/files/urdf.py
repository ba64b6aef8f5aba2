"""What the loader must know of a URDF before an engine reads it.

Links, joints, limits and mesh references; nothing of geometry or inertia. The same
text later goes to Pinocchio; faults are found here because this reader can say what
is wrong in a sentence.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from xml.etree import ElementTree

from reachmap.cell.files.xml_text import parse_xml
from reachmap.errors import CellError

MAX_URDF_BYTES = 20_000_000
MAX_LINKS = 2_000
MOVING = ("revolute", "continuous", "prismatic")
JOINT_TYPES = (*MOVING, "fixed", "floating", "planar")
# Root elements of other formats that come as XML.
OTHER_ROOTS = {
    "mujoco": "this is MJCF (MuJoCo)",
    "mujocoinclude": "this is MJCF (MuJoCo)",
    "sdf": "this is SDF (Gazebo)",
    "gazebo": "this is SDF (Gazebo)",
    "COLLADA": "this is a mesh (COLLADA)",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class UrdfJoint:
    """One joint. Limits are in rad or m, None where the URDF gives none."""

    name: str
    type: str
    parent: str
    child: str
    lower: float | None = None
    upper: float | None = None
    velocity: float | None = None
    mimics: str | None = None

    @property
    def moves(self) -> bool:
        """Whether the joint has one independent degree of freedom."""
        return self.type in MOVING and self.mimics is None


@dataclass(frozen=True, slots=True, kw_only=True)
class UrdfDescription:
    """Links, joints and meshes of a URDF, in the order of the file.

    Attributes
    ----------
    links : tuple of str
    joints : dict
        Joint name to :class:`UrdfJoint`.
    root : str
        The link that is nobody's child.
    collision_meshes : tuple of str
        Mesh references of collision elements, each once.
    mesh_scales : dict
        Those references to their largest scale per axis.
    visual_meshes : tuple of str
    """

    name: str
    links: tuple[str, ...]
    joints: dict[str, UrdfJoint]
    root: str
    collision_meshes: tuple[str, ...]
    visual_meshes: tuple[str, ...]
    mesh_scales: dict[str, tuple[float, float, float]]

    def chain(self, base: str, tip: str) -> tuple[str, ...]:
        """List the moving joints on the way from one frame to another, base first.

        Frames are links, or joints, which stand for their child link. The way ends
        at the last ancestor that ``base`` and ``tip`` share.
        """
        shared = {link for link, _ in self._way_up(base)}
        names = []
        for link, joint in self._way_up(tip):
            if link in shared:
                break
            if joint is not None and joint.moves:
                names.append(joint.name)
        return tuple(reversed(names))

    def _way_up(self, frame: str) -> Iterator[tuple[str, UrdfJoint | None]]:
        """Yield each link from a frame to the root, with the joint above it."""
        above = {joint.child: joint for joint in self.joints.values()}
        is_joint = frame in self.joints and frame not in self.links
        link = self.joints[frame].child if is_joint else frame
        while (joint := above.get(link)) is not None:
            yield link, joint
            link = joint.parent
        yield link, None

    def leaves(self) -> tuple[str, ...]:
        """Links without children, in the order of the file."""
        parents = {joint.parent for joint in self.joints.values()}
        return tuple(link for link in self.links if link not in parents)


def parse_urdf(text: str, label: str) -> UrdfDescription:
    """Read the structure of a URDF.

    Raises
    ------
    CellError
        With one line for every fault: names given twice, unknown links, a cycle,
        limits that are not finite or not ordered.
    """
    root = parse_xml(text, label)
    if root.tag != "robot":
        hint = OTHER_ROOTS.get(root.tag.rpartition(":")[2])
        what = f"; {hint}, which is not read: export a URDF instead" if hint else ""
        raise CellError(
            f"{label}: expected the root element <robot> (got <{root.tag}>){what}"
        )
    faults: list[str] = []
    links = [element.get("name", "") for element in root.findall("link")]
    joints = [_joint(element, faults) for element in root.findall("joint")]
    faults += _repeated("link", links) + _repeated("joint", [j.name for j in joints])
    if max(len(links), len(joints)) > MAX_LINKS:
        raise CellError(f"{label}: more than {MAX_LINKS:,} links or joints")
    faults += _structure_faults(set(links), joints)
    faults += _number_faults(root)
    if faults:
        raise CellError([f"{label}: {fault}" for fault in faults[:50]])
    children = {joint.child for joint in joints}
    return UrdfDescription(
        name=root.get("name", ""),
        links=tuple(links),
        joints={joint.name: joint for joint in joints},
        root=next(link for link in links if link not in children),
        collision_meshes=_meshes(root, "collision"),
        visual_meshes=_meshes(root, "visual"),
        mesh_scales=_scales(root),
    )


def _joint(element: ElementTree.Element, faults: list[str]) -> UrdfJoint:
    name, kind = element.get("name", ""), element.get("type", "")
    if kind not in JOINT_TYPES:
        faults.append(f"joint {name!r}: unknown type {kind!r}")
    parent, child = element.find("parent"), element.find("child")
    mimic = element.find("mimic")
    limit = element.find("limit")
    lower = upper = velocity = None
    if limit is not None:
        velocity = _number(limit, "velocity", name, faults)
        if kind in ("revolute", "prismatic"):
            lower = _bound(limit, "lower", name, faults)
            upper = _bound(limit, "upper", name, faults)
            if lower is not None and upper is not None and lower > upper:
                faults.append(f"joint {name!r}: limit {lower:g} is above {upper:g}")
    elif kind in ("revolute", "prismatic"):
        faults.append(f"joint {name!r}: a {kind} joint needs <limit>")
    return UrdfJoint(
        name=name,
        type=kind,
        parent="" if parent is None else parent.get("link", ""),
        child="" if child is None else child.get("link", ""),
        lower=lower,
        upper=upper,
        velocity=velocity,
        mimics=None if mimic is None else mimic.get("joint", ""),
    )


def _number(
    element: ElementTree.Element, key: str, joint: str, faults: list[str]
) -> float | None:
    text = element.get(key)
    if text is None:
        return None
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if math.isinf(value):
        return None  # as good as not given
    if math.isfinite(value):
        return value
    faults.append(
        f"joint {joint!r}: {key}: expected a finite number (got {text[:40]!r})"
    )
    return None


def _bound(
    element: ElementTree.Element, key: str, joint: str, faults: list[str]
) -> float | None:
    """Position limit: 0 where the URDF omits it, None where it is infinite."""
    if element.get(key) is None:
        return 0.0
    return _number(element, key, joint, faults)


def _repeated(kind: str, names: list[str]) -> list[str]:
    seen: set[str] = set()
    faults = []
    for name in names:
        if not name:
            faults.append(f"a {kind} has no name")
        elif name in seen:
            faults.append(f"{kind} {name!r} is given twice")
        seen.add(name)
    return faults


def _structure_faults(links: set[str], joints: list[UrdfJoint]) -> list[str]:
    """Faults of the tree: unknown links, two parents, no root, a cycle."""
    faults = []
    above: dict[str, str] = {}
    for joint in joints:
        for role, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in links:
                faults.append(f"joint {joint.name!r}: unknown {role} link {link!r}")
        if joint.child in above:
            faults.append(f"link {joint.child!r} is the child of two joints")
        above[joint.child] = joint.parent
    roots = sorted(links - set(above))
    if len(roots) != 1:
        shown = ", ".join(roots[:5]) or "none"
        faults.append(f"expected one root link (got {len(roots)}: {shown})")
    for link in sorted(above):
        steps = 0
        while link in above and steps <= len(above):
            link, steps = above[link], steps + 1
        if steps > len(above):
            faults.append("the links form a cycle")
            break
    return faults


_NUMERIC = (
    ("origin", "xyz", 3),
    ("origin", "rpy", 3),
    ("axis", "xyz", 3),
    ("box", "size", 3),
    ("cylinder", "radius", 1),
    ("cylinder", "length", 1),
    ("sphere", "radius", 1),
    ("mesh", "scale", 3),
)


def _number_faults(root: ElementTree.Element) -> list[str]:
    faults = []
    for tag, key, count in _NUMERIC:
        for element in root.iter(tag):
            text = element.get(key)
            if text is None:
                continue
            try:
                values = [float(word) for word in text.split()]
            except ValueError:
                values = []
            if len(values) != count or not all(map(math.isfinite, values)):
                faults.append(
                    f"<{tag} {key}>: expected {count} finite numbers "
                    f"(got {text[:40]!r})"
                )
    return faults


def _mesh_elements(
    root: ElementTree.Element, role: str
) -> Iterator[ElementTree.Element]:
    for link in root.findall("link"):
        for part in link.findall(role):
            yield from part.iter("mesh")


def _meshes(root: ElementTree.Element, role: str) -> tuple[str, ...]:
    names = (mesh.get("filename", "") for mesh in _mesh_elements(root, role))
    return tuple(dict.fromkeys(names))


def _scales(root: ElementTree.Element) -> dict[str, tuple[float, float, float]]:
    scales: dict[str, tuple[float, float, float]] = {}
    for mesh in _mesh_elements(root, "collision"):
        x, y, z = (abs(float(word)) for word in mesh.get("scale", "1 1 1").split())
        a, b, c = scales.get(mesh.get("filename", ""), (0.0, 0.0, 0.0))
        scales[mesh.get("filename", "")] = (max(x, a), max(y, b), max(z, c))
    return scales
