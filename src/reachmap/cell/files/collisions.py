"""The ``<collision>`` elements of a URDF: every one is used, or is a fault.

A URDF parser that meets an element it does not know drops all elements of the link, and
the link is never checked; so they are read here.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from xml.etree import ElementTree

from reachmap.cell.files.origins import NO_ORIGIN, Origin, Triple, finite_numbers
from reachmap.cell.model.fields import (
    MAX_LENGTH_M,
    CapsuleShape,
    CylinderShape,
    Shape,
    SphereShape,
)

# Attributes that are lengths, by element.
_LENGTHS = {
    "box": (("size", 3),),
    "sphere": (("radius", 1),),
    "cylinder": (("radius", 1), ("length", 1)),
    # The length is without the half-spheres, as in SDF.
    "capsule": (("radius", 1), ("length", 1)),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkShape:
    """One collision element.

    Attributes
    ----------
    link : str
    shape : Shape or None
        None where it is a mesh.
    mesh : str
        Reference to the mesh as the URDF writes it, or "".
    scale : tuple of float
        Of the mesh, per axis; negative numbers mirror it.
    origin : Origin
        Of the shape in the link.
    """

    link: str
    shape: Shape | None = None
    mesh: str = ""
    scale: Triple = (1.0, 1.0, 1.0)
    origin: Origin = NO_ORIGIN


def read_collisions(
    root: ElementTree.Element, faults: list[str]
) -> tuple[LinkShape, ...]:
    """Collision elements of all links; what is wrong is added to ``faults``."""
    shapes = []
    for link in root.findall("link"):
        for number, element in enumerate(link.findall("collision"), 1):
            try:
                shapes.append(_shape(link.get("name", ""), element))
            except ValueError as error:
                name = element.get("name")
                called = f"{number} ({name!r})" if name else f"{number}"
                faults.append(
                    f"link {link.get('name', '')!r}: <collision> element {called}: "
                    f"{error}"
                )
    return tuple(shapes)


def links_without_collision(root: ElementTree.Element) -> tuple[str, ...]:
    """Links that can be seen, but have no collision element."""
    return tuple(
        link.get("name", "")
        for link in root.findall("link")
        if link.find("visual") is not None and link.find("collision") is None
    )


def _shape(link: str, element: ElementTree.Element) -> LinkShape:
    geometry = _only(element.findall("geometry"), "<geometry>")
    given = _only(geometry, "shape in <geometry>")
    origin = Origin.of(element)
    if given.tag == "mesh":
        scale = _numbers(given, "scale", 3) if "scale" in given.attrib else [1.0] * 3
        if not all(scale):
            got = given.get("scale")
            raise ValueError(f"<mesh scale>: 0 is not a scale (got {got})")
        if not given.get("filename"):
            raise ValueError("<mesh> needs a filename")
        return LinkShape(
            link=link,
            mesh=given.get("filename", ""),
            scale=(scale[0], scale[1], scale[2]),
            origin=origin,
        )
    if given.tag not in _LENGTHS:
        known = ", ".join(f"<{tag}>" for tag in (*_LENGTHS, "mesh"))
        raise ValueError(f"unknown shape <{given.tag}> (expected {known})")
    sizes = {}
    for key, count in _LENGTHS[given.tag]:
        sizes[key] = _numbers(given, key, count)
        if not all(0 < value <= MAX_LENGTH_M for value in sizes[key]):
            raise ValueError(
                f"<{given.tag} {key}>: expected metres above 0 and up to "
                f"{MAX_LENGTH_M:g} (got {given.get(key, '')[:40]!r})"
            )
    return LinkShape(link=link, shape=_primitive(given.tag, sizes), origin=origin)


def _primitive(tag: str, sizes: dict[str, list[float]]) -> Shape:
    if tag == "box":
        x, y, z = sizes["size"]
        return Shape(box=(x, y, z))
    values = {key: numbers[0] for key, numbers in sizes.items()}
    if tag == "sphere":
        return Shape(sphere=SphereShape(**values))
    if tag == "cylinder":
        return Shape(cylinder=CylinderShape(**values))
    return Shape(capsule=CapsuleShape(**values))


def _only(elements: Iterable[ElementTree.Element], what: str) -> ElementTree.Element:
    found = list(elements)
    if len(found) != 1:
        tags = ", ".join(f"<{element.tag}>" for element in found) or "none"
        raise ValueError(f"expected one {what} (got {tags})")
    return found[0]


def _numbers(element: ElementTree.Element, key: str, count: int) -> list[float]:
    text = element.get(key)
    if text is None:
        raise ValueError(f"<{element.tag}> needs {key}")
    values = finite_numbers(text, count)
    if values is None:
        numbers = "a finite number" if count == 1 else f"{count} finite numbers"
        raise ValueError(
            f"<{element.tag} {key}>: expected {numbers} (got {text[:40]!r})"
        )
    return values


def mesh_scales(shapes: Iterable[LinkShape]) -> dict[str, Triple]:
    """Mesh references to their largest scale per axis, each once, in file order."""
    scales: dict[str, Triple] = {}
    for item in shapes:
        if item.mesh:
            x, y, z = scales.get(item.mesh, (0.0, 0.0, 0.0))
            a, b, c = map(abs, item.scale)
            scales[item.mesh] = (max(a, x), max(b, y), max(c, z))
    return scales
