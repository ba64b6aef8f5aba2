"""Display of records: as a line, in a notebook, as a picture, in xarray."""

from __future__ import annotations

import html
from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from reachmap._typing import FloatArray
from reachmap.errors import MissingExtraError
from reachmap.maps.parts import Compared

if TYPE_CHECKING:
    from xarray import DataTree

    from reachmap.maps.parts import PathStore

DRAWING: Final = "reachmap.tools.plot"
"""Where pictures are made; by name, because drawing stands on these records."""


class Shown(Compared):
    """Mixin that displays a map, or a result about maps, interactively."""

    __slots__ = ()

    def __repr__(self) -> str:
        facts = "; ".join(f"{name} {value}" for name, value in facts_of(self))
        return f"<{type(self).__name__}: {facts}>"

    def _repr_html_(self) -> str:
        """A small table, which notebooks show."""
        rows = "".join(
            f"<tr><th style='text-align:left'>{html.escape(name)}</th>"
            f"<td style='text-align:left'>{html.escape(value)}</td></tr>"
            for name, value in facts_of(self)
        )
        return f"<b>{type(self).__name__}</b><table>{rows}</table>"

    def plot(self, name: str | None = None) -> Any:
        """Draw a picture, as ``reachmap heatmap`` does.

        Parameters
        ----------
        name : str, optional
            Name of the picture (``"bin_costs"``, ``"path_z+0.00"``); default: the one
            that says most.

        Returns
        -------
        Drawn
            Notebooks show it; ``save(path)`` writes it, ``figure`` is matplotlib's.
        """
        return import_module(DRAWING).shown(self, name)

    def to_xarray(self) -> DataTree:
        """Everything as an :class:`xarray.DataTree`, as ``open_datatree`` reads it.

        Raises
        ------
        MissingExtraError
            xarray is not installed.
        """
        try:
            import xarray as xr
        except ImportError:
            raise MissingExtraError(
                "to_xarray needs xarray: pip install 'reachmap-cells[xarray]'"
            ) from None
        # Imported here: the formats stand on the records.
        from reachmap.maps.format.registry import tree_of

        tree = tree_of(self)
        found: dict[str, dict[str, Any]] = {group: {} for group in ("", *tree.groups)}
        for path, leaf in tree.leaves.items():
            group, _, name = path.rpartition("/")
            if not leaf.is_hidden:
                found[group][name] = (leaf.dims, leaf.value, dict(leaf.attributes))
        sets = {}
        for group, variables in found.items():
            scales = {n: v for n, v in variables.items() if v[0] == (n,)}
            others = {n: v for n, v in variables.items() if n not in scales}
            attributes = tree.groups[group] if group else tree.attributes
            sets[f"/{group}"] = xr.Dataset(others, scales, dict(attributes))
        return xr.DataTree.from_dict(sets)


class ShownBin(Shown):
    """A bin map, which also has paths to look at."""

    __slots__ = ()
    if TYPE_CHECKING:
        paths: PathStore

    def path(self, row: int) -> FloatArray:
        """Waypoints of a stored path, a row of ``paths``, shape (n, dof) [rad]."""
        return self.paths[row]


def facts_of(record: Any) -> list[tuple[str, str]]:
    """Headline facts of a map, as name and text."""
    joints = getattr(record, "joint_names", ())
    return [
        *_FACTS[type(record).__name__](record),
        *([("joints", ", ".join(joints))] if joints else []),
        ("content", record.stamp.content_sha256[:12] or "not stored yet"),
    ]


def _bin(record: Any) -> list[tuple[str, str]]:
    layers, y, x, orientations = record.status.shape
    return [
        ("test grasps", f"{layers} x {y} x {x} points, {orientations} orientations"),
        ("attempts", f"{record.path_found.shape[-1]} each"),
        ("path reachability", f"{np.nanmean(record.path_reachability):.1f} %"),
        ("stored paths", str(len(record.paths))),
    ]


def _workspace(record: Any) -> list[tuple[str, str]]:
    return [
        ("points", " x ".join(str(len(c)) for c in (record.x, record.y, record.z))),
        ("cubes", ", ".join(record.cubes)),
        ("path reachability", f"{np.nanmean(record.path_reachability):.1f} %"),
        ("method", record.method),
    ]


def _placement(record: Any) -> list[tuple[str, str]]:
    x, y, z, yaw = record.candidate_pose[record.chosen]
    return [
        ("bin", f"x {x:.3f}, y {y:.3f}, z {z:.3f} m, yaw {np.degrees(yaw):.1f} deg"),
        ("score", f"{record.score[record.chosen]:.1f} %"),
        ("rule", record.rule),
        ("candidates", str(len(record.score))),
    ]


def _base(record: Any) -> list[tuple[str, str]]:
    x, y, z = record.base_pose[:3, 3]
    return [
        ("base", f"x {x:.3f}, y {y:.3f}, z {z:.3f} m in the world"),
        ("score", f"{record.score[record.chosen]:.1f} %"),
        ("candidates", str(len(record.score))),
    ]


def _study(record: Any) -> list[tuple[str, str]]:
    best = record.assignment[record.best] if record.best >= 0 else "none"
    return [
        ("variants", f"{len(record.assignment)}, {record.design}"),
        ("objectives", ", ".join(record.objective_names)),
        ("base", record.assignment[record.base]),
        ("best", best),
    ]


def _robustness(record: Any) -> list[tuple[str, str]]:
    off = zip(("bin", "camera", "tool"), record.sizes, strict=True)
    sizes = [f"{name} {1e3 * a:.3g} mm {np.degrees(b):.3g} deg" for name, (a, b) in off]
    return [
        ("errors", ", ".join(sizes)),
        ("scales", ", ".join(f"{scale:g}" for scale in record.scale)),
        ("perturbed cells", f"{record.reachability.shape[1]} each"),
    ]


_FACTS: Final[dict[str, Callable[[Any], list[tuple[str, str]]]]] = {
    "BinMap": _bin,
    "WorkspaceMap": _workspace,
    "BinPlacement": _placement,
    "BasePlacement": _base,
    "Study": _study,
    "Robustness": _robustness,
}
