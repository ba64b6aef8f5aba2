"""``reachmap view``."""

from __future__ import annotations

from pathlib import Path

import click

from reachmap.cli import options
from reachmap.cli.terminal import print_answer

# As ViewOptions has them, whose module takes long to load.
HOST, PORT = "127.0.0.1", 8080


def _test_grasp(
    ctx: click.Context, parameter: click.Parameter, values: tuple[str, ...]
) -> tuple[tuple[int, ...], ...]:
    """Turn each ``LAYER,Y,X,ORIENTATION`` into four numbers."""
    found = []
    for value in values:
        parts = value.split(",")
        if len(parts) != 4 or not all(p.isascii() and p.isdigit() for p in parts):
            raise click.BadParameter(
                f"{value!r} is not LAYER,Y,X,ORIENTATION, such as 0,3,5,12."
            )
        found.append(tuple(int(part) for part in parts))
    return tuple(found)


@click.command("view")
@click.argument("source", metavar="FILE", type=options.INPUT_FILE)
@click.option(
    "--html",
    "page",
    type=options.OutputPath(".html"),
    metavar="PATH",
    help="Write one page with playback that needs no server and no network, and exit.",
)
@click.option(
    "--path",
    "test_grasps",
    multiple=True,
    callback=_test_grasp,
    metavar="LAYER,Y,X,ORIENTATION",
    help="Play the path to this test grasp of a bin map, counted from 0. Repeatable "
    "with --html; by default a path of median length in each quadrant.",
)
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=PORT,
    show_default=True,
    help="Port of the live view; 0 picks a free one.",
)
@click.option(
    "--host",
    default=HOST,
    show_default=True,
    metavar="ADDRESS",
    help="Address the live view listens on. Any but a loopback address, such as "
    "0.0.0.0 in a container, lets in whoever has the token in the printed address.",
)
@click.option(
    "--open/--no-browser",
    "open_browser",
    default=True,
    help="Open the live view in the browser, or only print its address.",
)
@options.overwrite_option
@options.json_option
def command(
    source: Path,
    page: Path | None,
    test_grasps: tuple[tuple[int, int, int, int], ...],
    port: int,
    host: str,
    open_browser: bool,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Show a cell or an artefact in 3D in the browser.

    FILE is a workspace map, a placement, a bin map or a cell. The cell is drawn with
    its collision shapes, and the points of the map are coloured by reachability. A
    slider chooses the level, a filter the state of the test frames. Click a point to
    put the arm there; bodies in collision turn red. Paths of a bin map play in their
    execution time. The view is served on this machine only, to its own page, until
    Ctrl-C. Needs the extra [view].

    Example: reachmap view bin.h5 --html bin-3d.html
    """
    if page is None:
        options.unused("overwrite", because="needs --html")
        if len(test_grasps) > 1:
            raise click.UsageError("--path: the live view plays one; see --html.")
    else:
        options.unused("host", "port", "open_browser", because="--html has no server")
    from reachmap.tools.view import ViewOptions, view

    written = view(
        source,
        page=page,
        test_grasps=test_grasps,
        overwrite=overwrite,
        options=ViewOptions(host=host, port=port, open_browser=open_browser),
        on_ready=lambda address: print_answer(
            {"address": address}, lambda: f"{address}  (Ctrl-C ends)", as_json=as_json
        ),
    )
    if written is not None:
        page_name = str(written)
        print_answer({"output": page_name}, lambda: page_name, as_json=as_json)
