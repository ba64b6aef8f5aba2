"""Colours of the parts of a cell, in pictures and in the 3-D view."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeAlias

from reachmap.core.collision.solids import Solid

Rgb: TypeAlias = tuple[int, int, int]

# Choices by eye, red for what is in the way alone.
LINK: Rgb = (150, 164, 184)
BIN: Rgb = (38, 92, 190)
BLOCKING: Rgb = (214, 31, 38)
# The camera first: the housing is what most cells are about.
TOOLS: tuple[Rgb, ...] = ((62, 68, 78), (232, 131, 42), (244, 184, 96), (122, 86, 160))
STANDING: tuple[Rgb, ...] = (
    (232, 222, 202),
    (243, 242, 238),
    (214, 222, 220),
    (226, 212, 204),
)
ARM_NAME, BIN_NAME = "arm", "bin"


def solid_colours(solids: Iterable[Solid]) -> dict[str, Rgb]:
    """Colour of each solid by its name; bodies take turns in the order of the cell."""
    colours: dict[str, Rgb] = {}
    tools, standing = 0, 0
    for solid in solids:
        if solid.name in colours:
            continue
        if solid.kind == "tool":
            colours[solid.name] = TOOLS[tools % len(TOOLS)]
            tools += 1
        elif solid.kind == "body":
            colours[solid.name] = STANDING[standing % len(STANDING)]
            standing += 1
        else:
            colours[solid.name] = BIN if solid.kind == "bin" else LINK
    return colours


def legend_colours(solids: Iterable[Solid]) -> dict[str, Rgb]:
    """Name and colour of what a legend lists: the arm, each body, the bin."""
    solids = tuple(solids)
    colours = solid_colours(solids)
    named: dict[str, Rgb] = {}
    kinds = (("link", ARM_NAME), ("tool", ""), ("bin", BIN_NAME), ("body", ""))
    for kind, name in kinds:
        for solid in solids:
            if solid.kind == kind:
                named.setdefault(name or solid.name, colours[solid.name])
    return named
