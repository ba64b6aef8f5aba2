"""Sizes that are possible but doubtful: a metre taken for a millimetre."""

from __future__ import annotations

from reachmap.cell.fields import MAX_LENGTH_M, Shape
from reachmap.cell.files import CellFiles, body_key
from reachmap.cell.model import Cell
from reachmap.cell.yaml_text import Document, Location

DOUBTFUL_M = 10.0
TINY_M = 1e-3


def find_doubts(document: Document, cell: Cell, files: CellFiles) -> tuple[str, ...]:
    """Sentences about sizes above 10 m or below 1 mm.

    A mesh larger than 100 m is a mistake of the document rather than a doubt, except
    in COLLADA, whose node transforms are not followed here.
    """
    doubts: list[str] = []
    for index, body in enumerate(cell.bodies):
        location: Location = ("bodies", index, "shape")
        mesh = body.shape.mesh
        if mesh is not None:
            key = body_key(body.name, mesh.file)
            scale = mesh.scale if isinstance(mesh.scale, tuple) else (mesh.scale,) * 3
            label = f"mesh of body {body.name!r}"
            doubts += _mesh_doubts(document, files, key, label, scale, location)
        elif largest_side(body.shape) > DOUBTFUL_M:
            side = largest_side(body.shape)
            doubts.append(_large(document, location, f"body {body.name!r}", side))
    if max(cell.bin.inner) > DOUBTFUL_M:
        where: Location = ("bin", "inner")
        doubts.append(_large(document, where, "the bin", max(cell.bin.inner)))
    if files.robot is not None:
        for name, scale in files.robot.mesh_scales.items():
            label = f"URDF mesh {name.rsplit('/', 1)[-1]!r}"
            where = ("robot", "urdf")
            doubts += _mesh_doubts(document, files, name, label, scale, where)
    return tuple(doubts)


def largest_side(shape: Shape) -> float:
    """Largest extent of a primitive [m]; 0 for a mesh."""
    kind, value = shape.kind()
    if kind == "box":
        return float(max(value))
    if kind == "sphere":
        return 2.0 * float(value.radius)
    if kind == "cylinder":
        return float(max(2.0 * value.radius, value.length))
    if kind == "capsule":
        return float(value.length + 2.0 * value.radius)
    return 0.0


def _mesh_doubts(
    document: Document,
    files: CellFiles,
    key: str,
    label: str,
    scale: tuple[float, float, float],
    location: Location,
) -> list[str]:
    if key not in files.mesh_sizes:
        return []
    sides = files.mesh_sizes[key] * scale
    side = float(max(sides))
    exact = files.mesh_paths[key].suffix.lower() != ".dae"
    if side > MAX_LENGTH_M and exact:
        document.add(
            location,
            f"{label} is {side:,.4g} m large; is it in millimetres? (scale: 0.001)",
        )
        return []
    if side > DOUBTFUL_M:
        return [_large(document, location, label, side)]
    if side < TINY_M:
        place = document.place(location)
        return [f"{place}: {label} is only {side:.3g} m large; is its scale right?"]
    return []


def _large(document: Document, location: Location, label: str, side: float) -> str:
    place = document.place(location)
    return f"{place}: {label} is {side:.4g} m large; lengths are in metres"
