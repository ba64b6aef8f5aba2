"""The optional viewer: found here, or missed with a word on how to get it."""

from __future__ import annotations

import contextlib
import io
import socket
from typing import TYPE_CHECKING

from reachmap.errors import MissingExtraError, OutputError

if TYPE_CHECKING:
    import viser

HOST = "127.0.0.1"


def require_viewer() -> None:
    """Refuse to go on without viser and trimesh.

    Raises
    ------
    MissingExtraError
        One of them is not installed.
    """
    try:
        import trimesh
        import viser
    except ImportError as error:
        raise MissingExtraError(
            f"the 3-D view needs {error.name}; install it with: "
            "pip install 'reachmap-cells[view]'"
        ) from error
    del trimesh, viser


def start_server(port: int) -> viser.ViserServer:
    """Start a viewer that this machine alone can see.

    Parameters
    ----------
    port : int
        0 takes a free one.

    Raises
    ------
    OutputError
        The port is taken.
    """
    require_viewer()
    import viser

    # It greets on stdout, which belongs to the command's answer.
    with contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host=HOST, port=free_port(port), verbose=False)
    server.scene.set_up_direction("+z")
    server.scene.world_axes.visible = False
    _light(server)
    server.gui.configure_theme(show_logo=False, show_share_button=False)
    server.gui.main_panel.dock_right()
    return server


def stop_server(server: viser.ViserServer) -> None:
    """End a viewer without a word."""
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()


def _light(server: viser.ViserServer) -> None:
    """Light from all sides and two directions, without shadows, all of it local."""
    scene = server.scene
    scene.configure_environment_map(None)
    scene.configure_default_lights(enabled=False)
    scene.add_light_ambient("/light/ambient", intensity=0.9)
    scene.add_light_hemisphere("/light/sky", intensity=0.5)
    for name, towards, intensity in (
        ("key", (1.2, -1.6, 4.0), 2.2),
        ("fill", (2.0, 2.5, 1.0), 0.5),
    ):
        scene.add_light_directional(
            f"/light/{name}", intensity=intensity, position=towards, cast_shadow=False
        )


def free_port(port: int) -> int:
    """Give a port that is free: the given one, or for 0 any.

    Raises
    ------
    OutputError
        It is taken; viser itself would silently go to the next one.
    """
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError as error:
            raise OutputError(
                f"port {port} cannot be used ({error.strerror}); "
                "--port names another, --port 0 any free one"
            ) from error
        return int(probe.getsockname()[1])
