"""``reachmap view``: a cell or an artefact in 3D, live or as one page."""

from __future__ import annotations

import contextlib
import time
import webbrowser
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from reachmap.cell.loaded import SUFFIXES
from reachmap.cell.loading import LoadedCell, read_cell, shipped_cells
from reachmap.errors import SettingsError
from reachmap.maps.base.record import BasePlacement
from reachmap.maps.bytes.publish import check_outputs, publish
from reachmap.maps.format.registry import Artefact, kind_of, read_artefact
from reachmap.maps.provenance import cell_of_artefact
from reachmap.maps.records import BinMap
from reachmap.maps.robustness.record import Robustness
from reachmap.maps.study.record import Study
from reachmap.tools.prologue import path_of_cell, refuse_cell_files
from reachmap.view.engine import HOST, require_viewer, start_server, stop_server
from reachmap.view.guard import Guard

# The default of viser as well.
PORT = 8080


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewOptions:
    """How the live view is served.

    On an address other than those of this machine alone, a token is part of the
    printed address, and access without it is denied.
    """

    host: str = HOST
    port: int = PORT
    open_browser: bool = False


def view(
    source: Path,
    *,
    page: Path | None = None,
    test_grasps: Sequence[tuple[int, int, int, int]] = (),
    overwrite: bool = False,
    options: ViewOptions | None = None,
    on_ready: Callable[[str], None] = lambda address: None,
    wait: Callable[[], None] | None = None,
) -> Path | None:
    """Show an artefact or a cell until interrupted, or write it as one page.

    Parameters
    ----------
    source : Path
        A workspace map, a placement or a bin map; or a cell, by its shipped name or as
        a YAML file.
    page : Path, optional
        Where to write the page; no server is left running then.
    test_grasps : sequence of tuple of int
        layer, y, x, orientation of the bin map's paths to play; chosen if left out.
    overwrite : bool
        Replace the page if it exists.
    options : ViewOptions, optional
    on_ready : callable
        Is called with the address when the live view can be opened.
    wait : callable, optional
        Returns when the live view is to end; by default it ends with Ctrl-C.

    Returns
    -------
    Path or None
        The page.

    Raises
    ------
    MissingExtraError
        The viewer is not installed.
    MapFileError, CellError, SceneError
        The artefact cannot be read, or its cell not be built here.
    SettingsError
        A test grasp is unknown or has no path.
    OutputError
        The page exists, or the port is taken.
    """
    require_viewer()
    check_outputs(
        [page], overwrite=overwrite, inputs=[source, path_of_cell(str(source))]
    )
    # Imported here: without the extra there is nothing to load the engines for.
    from reachmap.core.collision.solids import SolidCell

    record, loaded = _read(source)
    refuse_cell_files([page], loaded)
    paths = _paths(record, test_grasps)
    cell = SolidCell.build(loaded)
    if page is not None:
        from reachmap.view.page import page_of

        text = page_of(record, cell, paths)
        publish(page, [text.encode()], overwrite=overwrite)
        return page
    from reachmap.view.app import App

    options = options or ViewOptions()
    guard = Guard(options.host)
    server = start_server(options.port, host=options.host, guard=guard)
    try:
        App(server, record, cell, paths[0] if paths else None)
        address = _address(options.host, server.get_port(), guard.token)
        on_ready(address)
        if options.open_browser:
            webbrowser.open(address)
        (wait or _until_interrupted)()
    finally:
        stop_server(server)
    return None


def _address(host: str, port: int, token: str) -> str:
    """URL of the view; for a wildcard host, as seen from this machine."""
    name = {"0.0.0.0": HOST, "::": "::1"}.get(host, host)
    name = f"[{name}]" if ":" in name else name
    return f"http://{name}:{port}" + (f"/?token={token}" if token else "")


def _read(source: Path) -> tuple[Artefact | None, LoadedCell]:
    """Read an artefact with its cell, or a cell alone."""
    if source.suffix in SUFFIXES or str(source) in shipped_cells():
        return None, read_cell(str(source))
    record = read_artefact(source)
    if isinstance(record, Study | Robustness | BasePlacement):
        kind = kind_of(record).replace("_", " ")
        raise SettingsError(f"{source}: a {kind} has no view (heatmap draws it)")
    return record, cell_of_artefact(record.provenance, str(source))


def _paths(
    record: Artefact | None, test_grasps: Sequence[tuple[int, int, int, int]]
) -> tuple[int, ...]:
    if not test_grasps:
        return ()
    if not isinstance(record, BinMap):
        raise SettingsError("--path is for bin maps, which keep their paths")
    from reachmap.view.playback import find_path

    return tuple(find_path(record, test_grasp) for test_grasp in test_grasps)


def _until_interrupted() -> None:
    with contextlib.suppress(KeyboardInterrupt):
        while True:
            time.sleep(0.5)
