"""Shorthand of cell files about bins, written out: bins by name, filling levels.

A cell file has ``bins`` and optionally ``pick_from``. A cell in memory has that one
as ``bin``, with its name, and the others, which are obstacles, as ``bins``. Filling
levels become the layers of the bin scan.
"""

from __future__ import annotations

import math
from typing import Any

from reachmap.cell.text.data import at, text_at
from reachmap.cell.text.messages import did_you_mean
from reachmap.cell.text.overrides import is_override
from reachmap.cell.text.yaml_reader import Document, Location

CHOICE = "pick_from"

SECTION = "bin_scan"
KEYS = ("fill", "fill_heights_m")


def gather_bins(document: Document) -> None:
    """Collect the bins of a resolved cell under ``bins`` as in a file, in place."""
    data, name = document.data, text_at(document.data, "bin", "name")
    if name is None:
        return
    own = {key: value for key, value in data.pop("bin").items() if key != "name"}
    others = at(data, "bins")
    data["bins"] = {name: own, **(others if isinstance(others, dict) else {})}
    data[CHOICE] = name


def write_out_bins(document: Document) -> None:
    """Set ``bin`` to the bin to pick from, in place.

    Mistakes are still reported where they were written.
    """
    data = document.data
    bins, wanted = at(data, "bins"), text_at(data, CHOICE)
    if not isinstance(bins, dict) or not bins:
        _without_names(document, wanted)
        return
    names = ", ".join(bins)
    if at(data, "bin") is not None:
        document.add(
            ("bin",), f"give bin or bins, not both; each is bins.NAME ({names})"
        )
    name = wanted or next(iter(bins))
    if wanted is None and at(data, CHOICE) is not None:
        given = at(data, CHOICE)
        document.add((CHOICE,), f"expected a name in quotes: {names} (got {given!r})")
    if name not in bins:
        document.add((CHOICE,), f"no bin {name!r}; {did_you_mean(name, [*bins])}")
        name = next(iter(bins))
    own = bins.pop(name)
    if isinstance(own, dict) and at(own, "name") is not None:
        document.add(("bins", name, "name"), "the name of a bin is its key in bins")
    data["bin"] = {**own, "name": name} if isinstance(own, dict) else own
    data[CHOICE] = None
    document.move(("bins", name), ("bin",))


def _without_names(document: Document, wanted: str | None) -> None:
    """Judge a cell without bins by name; what is missing for that is said once."""
    data = document.data
    if "bins" in data and at(data, "bin") is None:
        if not data["bins"]:
            one = "left: {carrier: KLT-4147, pose: …}"
            document.add(("bins",), f"expected at least one bin by name, as in {one}")
            data["bins"] = {}
        data["bin"], data[CHOICE] = stand_in(), None
    elif wanted is not None:
        document.add((CHOICE,), f"the cell has no bins by name (got {wanted!r})")


def stand_in() -> dict[str, Any]:
    """Some size for a bin that has none, so that this is the only mistake."""
    return {"inner": [1.0, 1.0, 1.0]}


def bin_places(data: Any) -> list[tuple[str, Location]]:
    """Label and place of every bin, after :func:`write_out_bins`."""
    others = at(data, "bins")
    names = list(others) if isinstance(others, dict) else []
    return [("bin", ("bin",)), *((f"bin {name}", ("bins", name)) for name in names)]


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
        level = f"{heights[-1]:g} m"
        document.add(
            (SECTION, key), f"the bin is {depth:g} m deep (got a level of {level})"
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
    return values if all(map(math.isfinite, values)) else None


def _depth(document: Document) -> float | None:
    depth = _numbers([at(document.data, "bin", "inner", 2)])
    return None if depth is None else depth[0]
