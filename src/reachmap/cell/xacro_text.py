"""Xacro to URDF text, through the optional ``xacrodoc``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from reachmap.cell.resources import Resolver, search_folders
from reachmap.disk import is_folder
from reachmap.errors import CellError, MissingExtraError


def expand_xacro(path: Path, arguments: Mapping[str, str], resolver: Resolver) -> str:
    """Expand a xacro file.

    A xacro file is a program (its ``${…}`` are Python expressions): expand only those
    you trust. ``$(find NAME)`` looks where ``package://NAME`` does.

    Raises
    ------
    MissingExtraError
        xacrodoc is not installed.
    CellError
        The file does not expand.
    """
    try:
        from xacrodoc import XacroDoc, packages
    except ImportError:
        raise MissingExtraError(
            f"{path}: xacro files need the extra [xacro]; "
            "install it with: pip install 'reachmap-cells[xacro]'"
        ) from None
    packages.reset()
    packages.look_in([str(folder) for folder in search_folders() if is_folder(folder)])
    packages.update_package_cache(
        {
            name: str(resolver.directory / folder)
            for name, folder in resolver.packages.items()
        }
    )
    try:
        document = XacroDoc.from_file(
            str(path), subargs=dict(arguments), resolve_packages=False
        )
        # Not to_urdf_string(): it would turn relative mesh paths into paths of this
        # machine, and the text would not be the same elsewhere.
        return str(document.dom.toprettyxml(indent="  "))
    except Exception as error:  # xacro raises whatever its expressions raise
        lines = str(error).strip().splitlines()
        reason = lines[0] if lines else type(error).__name__
        raise CellError(f"{path}: xacro cannot be expanded: {reason}") from None
    finally:
        packages.reset()
