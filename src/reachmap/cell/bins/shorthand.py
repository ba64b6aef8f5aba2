"""Shorthand of cell files about bins, written out: names, carriers, filling levels.

A cell file has ``bins`` and optionally ``pick_from``. A cell in memory has that one
as ``bin``, with its name, and the others, which are obstacles, as ``bins``. A
standard load carrier gives a bin its dimensions. Filling levels become the layers of
the bin scan.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from reachmap.cell.text.data import at, text_at
from reachmap.cell.text.messages import did_you_mean
from reachmap.cell.text.overrides import is_override
from reachmap.cell.text.yaml_reader import Document, Location

CHOICE = "pick_from"

SECTION = "bin_scan"
KEYS = ("fill", "fill_heights_m")

DIMENSIONS = ("inner", "inner_top", "wall", "bottom", "rim", "mesh")


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
    """Judge a cell without bins by name; what is missing for that is told once."""
    data = document.data
    if "bins" in data and at(data, "bin") is None:
        if not data["bins"]:
            one = "left: {carrier: KLT-4147, pose: …}"
            document.add(("bins",), f"expected at least one bin by name, as in {one}")
            data["bins"] = {}
        data["bin"], data[CHOICE] = _stand_in(), None
    elif wanted is not None:
        document.add((CHOICE,), f"the cell has no bins by name (got {wanted!r})")


def _stand_in() -> dict[str, Any]:
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Carrier:
    """A load carrier.

    Attributes
    ----------
    name : str
    also : tuple of str
        Other names of it.
    description : str
    outer_mm, inner_mm : tuple of float
        Outer x, y and height; inner x, y at the bottom and depth.
    inner_top_mm : tuple of float or None
        Inner x, y at the rim, None where the walls are upright.
    wall_mm : tuple of float
        Thickness of the x and of the y walls.
    bottom_mm : float
    rim_mm : tuple of float or None
        Width and height of the ledge around the upper edge.
    source : str
        Where the figures are published.
    derived : str
        Which of them are not published, and how they were found.
    """

    name: str
    also: tuple[str, ...] = ()
    description: str
    outer_mm: tuple[float, float, float]
    inner_mm: tuple[float, float, float]
    inner_top_mm: tuple[float, float] | None = None
    wall_mm: tuple[float, float]
    bottom_mm: float
    rim_mm: tuple[float, float] | None = None
    source: str
    derived: str = ""

    def keys(self) -> dict[str, Any]:
        """The keys of ``bin`` that it defines, in metres."""
        found: dict[str, Any] = {
            "inner": _metres(self.inner_mm),
            "wall": _metres(self.wall_mm),
            "bottom": _metres([self.bottom_mm])[0],
        }
        if self.inner_top_mm is not None:
            found["inner_top"] = _metres(self.inner_top_mm)
        if self.rim_mm is not None:
            found["rim"] = dict(
                zip(("width", "height"), _metres(self.rim_mm), strict=True)
            )
        return found


def _metres(lengths_mm: Any) -> list[float]:
    return [round(length / 1000.0, 7) for length in lengths_mm]


@cache
def carriers() -> tuple[Carrier, ...]:
    """All known carriers, in the order of the file."""
    text = files("reachmap").joinpath("cell/data/carriers.json").read_text("utf-8")
    entries: list[dict[str, Any]] = [
        {k: tuple(v) if isinstance(v, list) else v for k, v in entry.items()}
        for entry in json.loads(text)["carriers"]
    ]
    return tuple(Carrier(**entry) for entry in entries)


def find_carrier(name: str) -> Carrier | None:
    """Find a carrier by name, ignoring case and separators."""
    return next(
        (
            carrier
            for carrier in carriers()
            if _plain(name) in map(_plain, (carrier.name, *carrier.also))
        ),
        None,
    )


def _plain(name: str) -> str:
    return "".join(c for c in name.casefold() if c.isalnum())


def write_out_carriers(document: Document) -> None:
    """Fill in missing dimensions of each bin from its carrier.

    A carrier that an override names takes the place of the file's own dimensions, but
    not of those that are overridden as well. An unknown name becomes a mistake.
    """
    for _, place in bin_places(document.data):
        if text_at(document.data, *place, "carrier") is not None:
            _write_out_carrier(document, place)
        elif at(document.data, *place, "carrier") is not None:
            _give_size(at(document.data, *place))


def _write_out_carrier(document: Document, place: Location) -> None:
    tray, location = at(document.data, *place), (*place, "carrier")
    carrier = find_carrier(tray["carrier"])
    if carrier is None:
        name, known = (
            tray["carrier"],
            [n for c in carriers() for n in (c.name, *c.also)],
        )
        hint = did_you_mean(name.upper(), known)
        document.add(
            location, f"no carrier {name!r}; {hint} (`reachmap carriers` lists them)"
        )
        _give_size(tray)
        return
    tray["carrier"] = carrier.name
    keys = carrier.keys()
    overridden = is_override(document.place(location))
    for key in DIMENSIONS:
        own = (*place, key)
        is_newer = own in document.places and is_override(document.place(own))
        if tray.get(key) is None or (overridden and not is_newer):
            tray[key] = keys.get(key)


def _give_size(tray: dict[str, Any]) -> None:
    """Give a bin of unknown carrier some size, so that this is the only mistake."""
    if tray.get("inner") is None:
        tray.update(_stand_in())
