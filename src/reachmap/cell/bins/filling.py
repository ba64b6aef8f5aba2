"""Filling levels of a bin, expanded to the layers of a scan."""

from __future__ import annotations

from typing import Any

from reachmap.cell.text.data import at
from reachmap.cell.text.overrides import is_override
from reachmap.cell.text.yaml_reader import Document

SECTION = "bin_scan"
KEYS = ("fill", "fill_heights_m")


def write_out_fill(document: Document) -> None:
    """Set ``bin_scan.layers`` to the heights that ``fill`` defines.

    What is wrong with the keys themselves is left to validation.
    """
    given = [key for key in KEYS if at(document.data, SECTION, key) is not None]
    if not given:
        return
    if len(given) > 1:
        document.add((SECTION, given[1]), "give fill or fill_heights_m, not both")
        return
    key, spec = given[0], at(document.data, SECTION)
    values, depth = _numbers(spec[key]), _depth(document)
    if values is None or depth is None or min(values) < 0:
        return
    if key == "fill" and max(values) > 1:
        return
    if values != sorted(set(values)):
        document.add((SECTION, key), f"levels must rise strictly (got {values})")
        return
    heights = [round(v * depth if key == "fill" else v, 6) + 0.0 for v in values]
    if heights[-1] > depth:
        document.add(
            (SECTION, key), f"the bin is {depth:g} deep (got a level of {heights[-1]})"
        )
        return
    place = (SECTION, "layers")
    newer = is_override(document.place((SECTION, key)))
    if place in document.places and not newer and spec.get("layers") != heights:
        document.add(place, f"give layers or {key}, not both ({key}=null drops it)")
    spec["layers"] = heights


def _numbers(values: Any) -> list[float] | None:
    if not isinstance(values, list) or not values:
        return None
    if any(isinstance(v, bool) or not isinstance(v, int | float) for v in values):
        return None
    return values


def _depth(document: Document) -> float | None:
    depth = _numbers([at(document.data, "bin", "inner", 2)])
    return None if depth is None else depth[0]
