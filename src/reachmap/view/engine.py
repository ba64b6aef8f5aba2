"""The optional viewer, imported here, or an error that says how to install it."""

from __future__ import annotations

import contextlib
import io
import socket
from typing import TYPE_CHECKING

from reachmap.errors import MissingExtraError, OutputError
from reachmap.view.guard import Guard, posted

if TYPE_CHECKING:
    import viser

HOST = "127.0.0.1"
# A choice by eye, so that what is in the shade stays readable.
AMBIENT = 1.3


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


def start_server(
    port: int, *, host: str = HOST, guard: Guard | None = None
) -> viser.ViserServer:
    """Start a viewer that only accepts requests from its own page.

    Parameters
    ----------
    port : int
        0 takes a free one.
    host : str
        Address to listen on; by default this machine alone can see it.
    guard : Guard, optional
        Knows the token where the address is not of this machine alone.

    Raises
    ------
    OutputError
        The port is taken, or the address is not one of this machine.
    """
    require_viewer()
    import viser

    # It greets on stdout, which belongs to the command's answer.
    with contextlib.redirect_stdout(io.StringIO()), posted(guard or Guard(host)):
        server = viser.ViserServer(host=host, port=free_port(port, host), verbose=False)
    server.scene.set_up_direction("+z")
    server.scene.world_axes.visible = False
    _light(server)
    server.gui.configure_theme(show_logo=False, show_share_button=False)
    server.gui.main_panel.dock_right()
    return server


def stop_server(server: viser.ViserServer) -> None:
    """Stop a viewer silently."""
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()


def _light(server: viser.ViserServer) -> None:
    """Light from the viewer's own lamps, which a recording has from its first frame.

    An environment map would be fetched from elsewhere.
    """
    server.scene.configure_environment_map(None)
    server.scene.configure_default_lights(enabled=True, cast_shadow=False)
    server.scene.add_light_ambient("/light", intensity=AMBIENT)


def free_port(port: int, host: str = HOST) -> int:
    """Give a port of an address that is free: the given one, or for 0 any.

    Raises
    ------
    OutputError
        It is taken, where viser itself would silently go to the next one; or the
        address is not one of this machine.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except (OSError, UnicodeError) as error:
            reason = getattr(error, "strerror", None) or error
            raise OutputError(
                f"port {port} cannot be used on {host} ({reason}); "
                "choose another with --port, or any free one with --port 0"
            ) from error
        return int(probe.getsockname()[1])
