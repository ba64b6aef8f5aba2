"""Standard load carriers, and the dimensions they give to a bin."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from reachmap.cell.bins.shorthand import bin_places, stand_in
from reachmap.cell.text.data import at, text_at
from reachmap.cell.text.messages import did_you_mean
from reachmap.cell.text.overrides import is_override
from reachmap.cell.text.yaml_reader import Document, Location

DIMENSIONS = ("inner", "inner_top", "wall", "bottom", "rim", "mesh")


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
        tray.update(stand_in())
