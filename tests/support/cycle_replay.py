"""A cycle replayed by code that shares nothing with the planner.

Kinematics from the XML of the URDF, meshes by trimesh, the cell from its JSON, pairs
one by one with coal: no Pinocchio, no broadphase, no margin.
"""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from itertools import combinations
from typing import Any

import coal
import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

WORLD = ""


def pose(xyz: Any = (0, 0, 0), rpy: Any = (0, 0, 0), degrees: bool = False) -> Any:
    """Homogeneous matrix of a translation and fixed-axis angles."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("xyz", rpy, degrees=degrees).as_matrix()
    T[:3, 3] = xyz
    return T


def pose_of(spec: dict[str, Any]) -> Any:
    """Homogeneous matrix of a pose of the cell."""
    T = pose(spec["xyz"], spec.get("rpy_deg") or (0, 0, 0), degrees=True)
    if spec.get("quaternion_wxyz"):
        w, x, y, z = spec["quaternion_wxyz"]
        T[:3, :3] = Rotation.from_quat([x, y, z, w]).as_matrix()
    return T


def numbers(element: Any, name: str) -> Any:
    """Numbers of an attribute, zeros where it is missing."""
    text = None if element is None else element.get(name)
    return np.array([float(v) for v in (text or "0 0 0").split()])


def primitive(shape: dict[str, Any]) -> Any:
    """Coal's shape of a primitive of the cell."""
    if shape.get("box"):
        return coal.Box(*shape["box"])
    if shape.get("sphere"):
        return coal.Sphere(shape["sphere"]["radius"])
    kind = "cylinder" if shape.get("cylinder") else "capsule"
    value = shape[kind]
    made = {"cylinder": coal.Cylinder, "capsule": coal.Capsule}[kind]
    return made(value["radius"], value["length"])


def surface(path: Any, scale: Any) -> Any:
    """Coal's triangles of a mesh file."""
    mesh: Any = trimesh.load(path, force="mesh")
    body = coal.BVHModelOBBRSS()
    body.beginModel(len(mesh.faces), len(mesh.vertices))
    body.addVertices(np.ascontiguousarray(mesh.vertices * scale))
    body.addTriangles(np.ascontiguousarray(mesh.faces, np.int64))
    body.endModel()
    return body


class Replay:
    """The bodies of a loaded cell, and where they are at a configuration."""

    def __init__(self, loaded: Any, joint_names: Any) -> None:
        self.cell = json.loads(loaded.resolved_json)
        self.joint_names = list(joint_names)
        root: Any = ET.fromstring(loaded.urdf)
        self.joints: Any = {
            j.find("child").get("link"): j for j in root.findall("joint")
        }
        self.names: list[str] = []
        self.shapes: list[Any] = []
        self.links: list[str] = []
        self.offsets: list[Any] = []
        for link in root.findall("link"):
            for item in link.findall("collision"):
                self._add_link(loaded, link.get("name"), item)
        tip = self.cell["robot"]["tcp"]
        self.T_tip_tcp = pose_of(tip)
        self.tip = tip["parent"]
        for body in self.cell["bodies"]:
            where = WORLD if body["attach_to"] == "world" else body["attach_to"]
            self._add(body["name"], where, pose_of(body["pose"]), body["shape"])
        part = self.cell["part"]
        self._add(
            "part", self.tip, self.T_tip_tcp @ pose_of(part["pose"]), part["shape"]
        )
        self._add_bin()
        self.pairs = [
            p for p in combinations(range(len(self.names)), 2) if self._ok(*p)
        ]
        self._allow(loaded, root)

    def _add_link(self, loaded: Any, name: str, item: Any) -> None:
        origin, geometry = item.find("origin"), item.find("geometry")[0]
        T = pose(numbers(origin, "xyz"), numbers(origin, "rpy"))
        if geometry.tag == "mesh":
            scale = geometry.get("scale")
            scale = [float(v) for v in scale.split()] if scale else 1.0
            made = surface(loaded.mesh_paths[geometry.get("filename")], scale)
        elif geometry.tag == "box":
            made = coal.Box(*numbers(geometry, "size"))
        else:
            sizes = (float(geometry.get("radius")), float(geometry.get("length")))
            made = coal.Cylinder(*sizes)
        self._append(name, name, T, made)

    def _add(self, name: str, link: str, T: Any, shape: dict[str, Any]) -> None:
        self._append(name, link, T, primitive(shape))

    def _append(self, name: str, link: str, T: Any, shape: Any) -> None:
        self.names.append(name)
        self.links.append(link)
        self.offsets.append(T)
        self.shapes.append(shape)

    def _add_bin(self) -> None:
        spec = self.cell["bin"]
        x, y, z = spec["inner"]
        wall = spec["wall"]
        wx, wy = wall if isinstance(wall, list) else (wall, wall)
        low = spec["bottom"] or min(wx, wy)
        T = pose_of(spec["pose"])
        if spec["frame"] == "robot_base":
            T = pose_of(self.cell["robot"]["base_pose"]) @ T
        self.T_world_bin = T
        middle = (z - low) / 2
        boxes = {"bin bottom": ((0, 0, -low / 2), (x, y, low))}
        for s in (-1, 1):
            sign = "+" if s > 0 else "-"
            boxes[f"bin wall {sign}x"] = (
                (s * (x + wx) / 2, 0, middle), (wx, y + 2 * wy, z + low))  # fmt: skip
            boxes[f"bin wall {sign}y"] = (
                (0, s * (y + wy) / 2, middle),
                (x, wy, z + low),
            )
        if spec["heap"]:
            boxes["bin heap"] = ((0, 0, spec["heap"] / 2), (x, y, spec["heap"]))
        for name, (centre, sides) in boxes.items():
            self._append(name, WORLD, T @ pose(centre), coal.Box(*sides))

    def _rigid(self, link: str) -> str:
        """The link whose joint moves a link, WORLD where none does."""
        while link in self.joints:
            if self.joints[link].get("name") in self.joint_names:
                return link
            link = self.joints[link].find("parent").get("link")
        return WORLD

    def _ok(self, a: int, b: int) -> bool:
        return self._rigid(self.links[a]) != self._rigid(self.links[b])

    def _allow(self, loaded: Any, root: Any) -> None:
        allowed = {
            frozenset((j.find("parent").get("link"), j.find("child").get("link")))
            for j in root.findall("joint")
        }
        for element in ET.fromstring(loaded.srdf or "<r/>").iter("disable_collisions"):
            allowed.add(frozenset((element.get("link1"), element.get("link2"))))
        for body in [*self.cell["bodies"], {"name": "part", **self.cell["part"]}]:
            for other in body["touch"]:
                named = [n for n in self.names if n == other or (
                    other == "bin" and n.startswith("bin "))]  # fmt: skip
                allowed |= {frozenset((body["name"], n)) for n in named}
        self.pairs = [
            (a, b)
            for a, b in self.pairs
            if frozenset((self.names[a], self.names[b])) not in allowed
        ]

    def placed(self, Q: Any) -> list[Any]:
        """World poses (m, 4, 4) of every body at configurations (m, dof)."""
        one = np.tile(np.eye(4), (len(Q), 1, 1))
        known = {WORLD: one}
        values = dict(zip(self.joint_names, np.asarray(Q).T, strict=True))
        locked = self.cell["robot"]["locked_joints_deg"]
        base = pose_of(self.cell["robot"]["base_pose"])

        def of(link: str) -> Any:
            if link not in known:
                joint = self.joints.get(link)
                if joint is None:
                    known[link] = one @ base
                else:
                    known[link] = of(joint.find("parent").get("link")) @ motion(joint)
            return known[link]

        def motion(joint: Any) -> Any:
            origin, name = joint.find("origin"), joint.get("name")
            T = one @ pose(numbers(origin, "xyz"), numbers(origin, "rpy"))
            value = values.get(name, np.full(len(Q), np.radians(locked.get(name, 0.0))))
            if joint.get("type") in ("revolute", "continuous"):
                axis = numbers(joint.find("axis"), "xyz")
                turn = one.copy()
                turn[:, :3, :3] = Rotation.from_rotvec(
                    axis * value[:, None]
                ).as_matrix()
                T = T @ turn
            return T

        return [of(link) @ T for link, T in zip(self.links, self.offsets, strict=True)]

    def hits(
        self, Q: Any, *, part: bool, skip: Any = (), step_m: float = np.inf
    ) -> list[str]:
        """Pairs that collide at the first of configurations (m, dof) where any does.

        Without the part where it is not held. Boxes that do not meet settle most pairs;
        where no body moves further than ``step_m`` from one configuration to the next,
        a distance settles the next few.
        """
        placed = self.placed(Q)
        boxes = [box(shape, T) for shape, T in zip(self.shapes, placed, strict=True)]
        found: dict[int, list[str]] = {}
        for a, b in self.pairs:
            name = f"{self.names[a]} | {self.names[b]}"
            if (not part and "part" in (self.names[a], self.names[b])) or name in skip:
                continue
            (low_a, high_a), (low_b, high_b) = boxes[a], boxes[b]
            near = ((low_a <= high_b) & (low_b <= high_a)).all(axis=1)
            free_until = 0
            for row in np.flatnonzero(near).tolist():
                if row < free_until:
                    continue
                distance_m = self.distance(a, b, placed[a][row], placed[b][row])
                if distance_m <= 0.0:
                    found.setdefault(row, []).append(name)
                    break
                # Both bodies may move; a step before the distance is used up is free.
                free_until = row + max(1, int(np.ceil(distance_m / (2 * step_m))))
        return found[min(found)] if found else []

    def distance(self, a: int, b: int, T_a: Any, T_b: Any) -> float:
        """Distance of two bodies at world poses [m], 0 or less where they collide."""
        shapes = self.shapes[a], transform(T_a), self.shapes[b], transform(T_b)
        collision = coal.CollisionResult()
        if coal.collide(*shapes, coal.CollisionRequest(), collision):
            return 0.0
        return max(self.signed_distance(a, b, T_a, T_b), 1e-12)

    def signed_distance(self, a: int, b: int, T_a: Any, T_b: Any) -> float:
        """Distance of two bodies at world poses [m], negative where they collide."""
        result = coal.DistanceResult()
        coal.distance(
            self.shapes[a], transform(T_a), self.shapes[b], transform(T_b),
            coal.DistanceRequest(True), result,
        )  # fmt: skip
        return float(result.min_distance)

    def pair(self, first: str, second: str) -> tuple[int, int]:
        """Indices of two bodies."""
        return self.names.index(first), self.names.index(second)

    def tcp(self, Q: Any) -> Any:
        """World positions (m, 3) of the TCP at configurations (m, dof)."""
        k = self.names.index("part")
        back = np.linalg.inv(pose_of(self.cell["part"]["pose"]))
        return (self.placed(Q)[k] @ back)[:, :3, 3]


def transform(T: Any) -> Any:
    """Coal's form of a pose."""
    return coal.Transform3s(
        np.ascontiguousarray(T[:3, :3]), np.ascontiguousarray(T[:3, 3])
    )


def box(shape: Any, T: Any) -> tuple[Any, Any]:
    """Corners (m, 3) of boxes around a shape at poses (m, 4, 4)."""
    shape.computeLocalAABB()
    low, high = np.array(shape.aabb_local.min_), np.array(shape.aabb_local.max_)
    centre = T[:, :3, :3] @ ((low + high) / 2) + T[:, :3, 3]
    half = np.abs(T[:, :3, :3]) @ ((high - low) / 2)
    return centre - half, centre + half


def dense(path: Any, step_m: float, reach_m: float = 1.2) -> Any:
    """Points along a path, none of the robot's moving more than a step between two.

    ``reach_m`` is a distance from every joint that no point of the robot exceeds.
    """
    parts = [path[:1]]
    for a, b in zip(path[:-1], path[1:], strict=True):
        count = max(1, int(np.ceil(np.abs(b - a).sum() * reach_m / step_m)))
        parts.append(a + np.arange(1, count + 1)[:, None] / count * (b - a))
    return np.vstack(parts)


def paths_by_stage(record: Any, grasp: Any) -> dict[int, Any]:
    """Path of each stage of one test grasp; 0 is the way in of the best path."""
    ends = np.cumsum(record.paths.row_size)
    begins = ends - record.paths.row_size
    rows = np.flatnonzero((record.paths.index[:, :4] == grasp).all(axis=1))
    found = {}
    for row in rows:
        stage = int(record.paths.stage[row])
        if stage or row == record.best.row[tuple(grasp)]:
            found[stage] = record.paths.configuration[begins[row] : ends[row]]
    return found


def faults_of_cycle(loaded: Any, record: Any, grasp: Any, share: float = 1 / 3) -> Any:
    """Everything wrong with one stored cycle, in words."""
    return faults_of(Replay(loaded, record.joint_names), record, grasp, share, {})


def faults_of(
    replay: Replay, record: Any, grasp: Any, share: float, known: dict[bytes, Any]
) -> list[str]:
    """The same with a replay at hand; ``known`` keeps what paths were found to hit."""
    cell, faults = replay.cell, []
    step_m = share * cell["collision"]["verification_distance_m"]
    stages = paths_by_stage(record, grasp)
    for stage, path in sorted(stages.items()):
        held = 1 <= stage <= 3
        skip = ("part | bin bottom", "part | bin heap") if stage == 1 else ()
        key = path.tobytes()
        if key not in known:
            known[key] = replay.hits(
                dense(path, step_m), part=held, skip=skip, step_m=step_m
            )
        if known[key]:
            faults.append(f"stage {stage}: {known[key]}")
        if stage > 0:
            gap = np.abs(path[0] - stages[stage - 1][-1]).max()
            if gap > 1e-9:
                faults.append(f"stage {stage} begins {gap:g} rad off")
    gap = np.abs(stages[max(stages)][-1] - stages[0][0]).max()
    if gap > 1e-9:
        faults.append(f"the cycle ends {gap:g} rad off its beginning")
    return faults + contact_faults(replay, stages[1], step_m)


def contact_faults(replay: Replay, lift: Any, step_m: float) -> list[str]:
    """What the lift does to the bottom beyond its allowance."""
    spec, Q = replay.cell["lift"], dense(lift, step_m)
    part, bottom = replay.pair("part", "bin bottom")
    placed = replay.placed(Q)
    way_m = np.linalg.norm(replay.tcp(Q) - replay.tcp(Q[:1]), axis=1)
    allowed_m = np.where(
        way_m > spec["contact_distance_m"] + 1e-6,
        0.0,
        -spec["contact_allowance_m"] - 1e-5,
    )
    for row in range(len(Q)):
        at = (placed[part][row], placed[bottom][row])
        distance_m = replay.signed_distance(part, bottom, *at)
        if distance_m < allowed_m[row]:
            return [f"{1e3 * distance_m:.2f} mm from the bottom at {way_m[row]:.4f} m"]
    return []
