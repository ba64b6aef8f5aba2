"""Several bins by name: the one to pick from, and the others as obstacles.

A cell file has ``bins`` and optionally ``pick_from``. A cell in memory has that one
as ``bin``, with its name, and the others as ``bins``.
"""

from __future__ import annotations

from typing import Any

from reachmap.cell.text.data import at, text_at
from reachmap.cell.text.messages import did_you_mean
from reachmap.cell.text.yaml_reader import Document, Location

CHOICE = "pick_from"


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
        if wanted is not None:
            document.add((CHOICE,), f"the cell has no bins by name (got {wanted!r})")
        return
    names = ", ".join(bins)
    if at(data, "bin") is not None:
        document.add(
            ("bin",), f"give bin or bins, not both; each is bins.NAME ({names})"
        )
    name = wanted or next(iter(bins))
    if name not in bins:
        document.add((CHOICE,), f"no bin {name!r}; {did_you_mean(name, [*bins])}")
        name = next(iter(bins))
    own = bins.pop(name)
    if isinstance(own, dict) and at(own, "name") is not None:
        document.add(("bins", name, "name"), "the name of a bin is its key in bins")
    data["bin"] = {**own, "name": name} if isinstance(own, dict) else own
    data[CHOICE] = None
    document.move(("bins", name), ("bin",))


def bin_places(data: Any) -> list[tuple[str, Location]]:
    """Label and place of every bin, after :func:`write_out_bins`."""
    others = at(data, "bins")
    names = list(others) if isinstance(others, dict) else []
    return [("bin", ("bin",)), *((f"bin {name}", ("bins", name)) for name in names)]
