"""``map.plot()``: one picture of a map, for interactive use."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from reachmap.errors import SettingsError
from reachmap.maps.records import BinMap, WorkspaceMap
from reachmap.plots.albums import bin_album, workspace_album
from reachmap.plots.parts.files import Picture, write_picture
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


def shown(record: BinMap | WorkspaceMap, name: str | None = None) -> Drawn:
    """Draw one picture of a map's album.

    Parameters
    ----------
    record : BinMap or WorkspaceMap
    name : str, optional
        As ``reachmap heatmap`` calls it; default: the reachability.

    Raises
    ------
    SettingsError
        There is no picture of that name.
    """
    if isinstance(record, BinMap):
        items = bin_album(record)
    elif isinstance(record, WorkspaceMap):
        items = workspace_album(record, QUANTITIES)
    else:
        raise SettingsError(
            "a placement is drawn on its workspace map: reachmap heatmap placement.h5"
        )
    album = {item.name: item for item in items if isinstance(item, Picture)}
    wanted = name or next(usual for usual in USUAL if usual in album)
    if wanted not in album:
        raise SettingsError(f"no picture {wanted!r}; there are {', '.join(album)}")
    picture = album[wanted]
    return Drawn(
        figure=picture.draw(),
        title=picture.title,
        config_sha256=record.stamp.config_sha256,
    )
