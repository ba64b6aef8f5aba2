"""``map.plot()``: one picture of a map, for interactive use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from reachmap.errors import SettingsError
from reachmap.maps.base.record import BasePlacement
from reachmap.maps.records import BinMap, WorkspaceMap
from reachmap.maps.robustness.record import Robustness
from reachmap.maps.study.record import Study
from reachmap.plots.albums import (
    base_album,
    bin_album,
    robustness_album,
    study_album,
    workspace_album,
)
from reachmap.plots.parts.files import Picture, Table, write_picture
from reachmap.plots.parts.levels import QUANTITIES
from reachmap.plots.parts.style import figure_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

USUAL = ("path_overview", "bin_reachability")


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn:
    """A picture that notebooks show."""

    figure: Figure
    title: str
    config_sha256: str

    def _repr_png_(self) -> bytes:
        return figure_bytes(
            self.figure, "png", title=self.title, config_sha256=self.config_sha256
        )

    def save(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write it; the suffix, .svg or any other, says how."""
        return write_picture(
            Path(path),
            self.figure,
            title=self.title,
            config_sha256=self.config_sha256,
            overwrite=overwrite,
        )


def shown(record: Any, name: str | None = None) -> Drawn:
    """Draw one picture of a map's album.

    Parameters
    ----------
    record : BinMap, WorkspaceMap, BasePlacement, Study or Robustness
    name : str, optional
        As ``reachmap heatmap`` calls it; default: the reachability of a map, else the
        first.

    Raises
    ------
    SettingsError
        There is no picture of that name.
    """
    items = _album(record)
    album = {item.name: item for item in items if isinstance(item, Picture)}
    usual = [one for one in album if one.startswith(USUAL)]
    wanted = name or next(iter([*usual, *album]))
    if wanted not in album:
        raise SettingsError(f"no picture {wanted!r}; there are {', '.join(album)}")
    picture = album[wanted]
    return Drawn(
        figure=picture.draw(),
        title=picture.title,
        config_sha256=record.stamp.config_sha256,
    )


def _album(record: Any) -> Sequence[Picture | Table]:
    """Pictures of a record.

    Raises
    ------
    SettingsError
        It is a placement of the bin.
    """
    if isinstance(record, BinMap):
        return bin_album(record)
    if isinstance(record, WorkspaceMap):
        return workspace_album(record, QUANTITIES)
    if isinstance(record, BasePlacement):
        return base_album(record)
    if isinstance(record, Study):
        return study_album(record)
    if isinstance(record, Robustness):
        return robustness_album(record)
    raise SettingsError(
        "a placement is drawn on its workspace map: reachmap heatmap placement.h5"
    )
