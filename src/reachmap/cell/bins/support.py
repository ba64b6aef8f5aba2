"""How bins stand: upright, on the horizontal top faces of static bodies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.model.bodies import BinSpec, BodySpec
from reachmap.cell.model.cell import Cell
from reachmap.cell.model.shapes import triangles_of
from reachmap.cell.text.messages import did_you_mean
from reachmap.cell.text.yaml_reader import Document, Location
from reachmap.geometry import (
    inverse_transform,
    tilt_rad,
    transform_points,
)

# Points of a shape this far below its highest one still belong to its top face; a
# bin that is this near to a top face stands on it.
FLAT_M, TOUCH_M = 5e-4, 5e-3
# Rounding of an edge that is meant to coincide; a lean that is meant to be none.
SLACK_M = 1e-6
STEADY_DEG = 0.1
# Parts slide out of a bin long before; it is a bin that was meant to stand.
MAX_BIN_TILT_DEG = 75.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TopFace:
    """A level face, convex.

    Attributes
    ----------
    name : str
        Of the body.
    polygon : array, shape (n, 2)
        Corners, anticlockwise [m].
    z : float
        Height [m].
    """

    name: str
    polygon: FloatArray
    z: float

    def overhang_m(self, points: FloatArray) -> float:
        """How far points (n, 2) extend beyond the face; 0 or less where none does."""
        along = np.roll(self.polygon, -1, axis=0) - self.polygon
        outward = np.column_stack([along[:, 1], -along[:, 0]])
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        away = (points[:, None] - self.polygon) * outward
        return float(away.sum(axis=-1).max())


def top_faces(cell: Cell, T_to_world: FloatArray) -> tuple[TopFace, ...]:
    """Top faces of bodies on world or robot_base, in an upright frame.

    Parameters
    ----------
    cell : Cell
    T_to_world : array, shape (4, 4)
        The world in that frame.
    """
    T_to_base = T_to_world @ inverse_transform(cell.T_base_world())
    frames = {"world": T_to_world, "robot_base": T_to_base}
    faces = (
        _top_face(body, frames[body.attach_to])
        for body in cell.bodies
        if body.attach_to in frames and body.shape.mesh is None
    )
    return tuple(face for face in faces if face is not None)


def bodies_in_bin(cell: Cell) -> list[str]:
    """Names of bodies on the world or robot_base whose origin is inside the bin."""
    T_bin_base = inverse_transform(cell.T_base_bin())
    frames = {"world": T_bin_base @ cell.T_base_world(), "robot_base": T_bin_base}
    x, y = np.maximum(cell.bin.inner[:2], cell.bin.top) / 2.0 + SLACK_M
    low = np.array([-x, -y, -SLACK_M])
    high = np.array([x, y, cell.bin.inner[2] + SLACK_M])
    found = []
    for body in cell.bodies:
        if body.attach_to in frames:
            p_bin = (frames[body.attach_to] @ body.pose.matrix())[:3, 3]
            if ((p_bin >= low) & (p_bin <= high)).all():
                found.append(body.name)
    return found


def _top_face(body: BodySpec, T_to_parent: FloatArray) -> TopFace | None:
    # Imported here: it takes long, and few cells stand their bins on bodies.
    from scipy.spatial import ConvexHull, QhullError

    points = triangles_of(body.shape).vertices
    T = T_to_parent @ body.pose.matrix()
    points = transform_points(T, points)
    top = float(points[:, 2].max())
    flat = points[points[:, 2] > top - FLAT_M, :2]
    try:
        polygon = flat[ConvexHull(flat).vertices]
    except (QhullError, ValueError):
        return None
    return TopFace(name=body.name, polygon=polygon, z=top)


def footprint_of_bin(spec: BinSpec, T_to_bin: FloatArray) -> FloatArray:
    """Corners of a bin's outer bottom from above, shape (4, 2) [m]."""
    half = np.array(spec.inner[:2]) / 2 + spec.walls
    corners = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return np.asarray(corners @ T_to_bin[:2, :2].T + T_to_bin[:2, 3])


def support_of(spec: BinSpec, T_to_bin: FloatArray, faces: tuple[TopFace, ...]) -> str:
    """Name of the body that supports a bin, "" where it floats.

    Parameters
    ----------
    spec : BinSpec
    T_to_bin : array, shape (4, 4)
        In the frame of the faces.
    faces : tuple of TopFace
    """
    centre, z = T_to_bin[None, :2, 3], T_to_bin[2, 3] - spec.bottom_m
    under = (
        face.name
        for face in faces
        if abs(face.z - z) <= TOUCH_M and face.overhang_m(centre) <= 0
    )
    return next(under, "")


def with_standing_bins(document: Document, cell: Cell) -> Cell:
    """The cell with each bin placed on the body that its ``on`` names, if any.

    Mistakes are added to the document where a bin stands on its side or its head in
    the world, and where the body has no level top face, the bin does not fit on it, or
    leans.
    """
    _check_tilts(document, cell)
    for place, spec in cell.every_bin():
        if spec.on is None:
            continue
        T_base_bin = _on_support(document, cell, spec, (*place, "on"))
        if T_base_bin is not None:
            cell = cell.with_spec_at(spec, T_base_bin, spec.frame)
    return cell


def _no_support(cell: Cell, name: str, faces: tuple[TopFace, ...]) -> str:
    """Why a bin cannot stand on something of that name."""
    known = [face.name for face in faces]
    if name not in [body.name for body in cell.bodies]:
        return f"no body {name!r}; {did_you_mean(name, known)}"
    return (
        f"{name!r} has no level top face, or is not attached to world or robot_base "
        f"(bodies that are and have one: {', '.join(known) or 'none'})"
    )


def _on_support(
    document: Document, cell: Cell, spec: BinSpec, where: Location
) -> FloatArray | None:
    """T_base_bin of a bin on the body that its ``on`` names."""
    T_base_world = cell.T_base_world()
    T_world_bin = inverse_transform(T_base_world) @ cell.T_base_of(spec)
    every, name = top_faces(cell, np.eye(4)), spec.on
    faces = [face for face in every if face.name == name]
    if not faces:
        document.add(where, _no_support(cell, str(name), every))
        return None
    tilt_deg = np.degrees(tilt_rad(T_world_bin[:3, :3]))
    if tilt_deg > MAX_BIN_TILT_DEG:
        return None  # reported already
    if tilt_deg > STEADY_DEG:
        document.add(
            where,
            f"the bin leans by {tilt_deg:.3g} deg, so it cannot stand flat on "
            f"{name!r}; leave out on, or the lean in pose",
        )
        return None
    over = faces[0].overhang_m(footprint_of_bin(spec, T_world_bin))
    if over > SLACK_M:
        x, y, _ = spec.outer
        document.add(
            where,
            f"the bin, {x:g} x {y:g} m outside, hangs {1e3 * over:.0f} mm over the "
            f"edge of {name!r}; move or turn it in pose",
        )
        return None
    T_world_bin[2, 3] = faces[0].z + spec.bottom_m
    return np.asarray(T_base_world @ T_world_bin)


def _check_tilts(document: Document, cell: Cell) -> None:
    T_world_base = inverse_transform(cell.T_base_world())
    leans = tilt_rad(T_world_base[:3, :3]) > 0
    for place, spec in cell.every_bin():
        T_world_bin = T_world_base @ cell.T_base_of(spec)
        tilt = float(np.degrees(tilt_rad(T_world_bin[:3, :3])))
        if tilt <= MAX_BIN_TILT_DEG:
            continue
        hint = (
            "robot_base itself is tilted, so give the pose in the world with "
            f"{'.'.join(place)}.frame: world"
            if leans and spec.frame == "robot_base"
            else "its z axis must point up"
        )
        document.add(
            (*place, "pose"),
            f"the bin is tilted {tilt:.0f} deg from upright in the world and would "
            f"spill (allowed: {MAX_BIN_TILT_DEG:g}); {hint}",
        )
