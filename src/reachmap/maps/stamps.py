"""The parts of a record that every artefact has: stamp, provenance, run."""

from __future__ import annotations

from pathlib import Path

from reachmap.maps.provenance import provenance_from_texts, run_from_texts
from reachmap.maps.records import Provenance, RunInfo, Stamp
from reachmap.maps.schema import PROVENANCE_TEXTS, RUN_TEXTS
from reachmap.maps.storage import load
from reachmap.maps.tree import Tree


def stamp_of(tree: Tree) -> Stamp:
    """Collect the root attributes of a checked tree."""
    return Stamp(
        seed=int(tree.attributes["seed"]),
        cell_sha256=str(tree.attributes["cell_sha256"]),
        config_sha256=str(tree.attributes["config_sha256"]),
        content_sha256=str(tree.attributes["content_sha256"]),
        format_version=str(tree.attributes["format_version"]),
    )


def provenance_of(tree: Tree, path: Path) -> Provenance:
    """Collect ``/provenance`` of a checked tree; ``path`` is named in messages."""
    texts = {name: tree.text(f"provenance/{name}") for name in PROVENANCE_TEXTS}
    return provenance_from_texts(texts, str(path))


def run_of(tree: Tree, path: Path) -> RunInfo:
    """Collect ``/run`` of a checked tree; ``path`` is named in messages."""
    texts = {name: tree.text(f"run/{name}") for name in RUN_TEXTS}
    return run_from_texts({k: v for k, v in texts.items() if v}, str(path))


def read_provenance(path: Path) -> Provenance:
    """Read what any artefact was made from.

    Raises
    ------
    MapFileError
        The file is not an artefact, or it is damaged.
    """
    tree, _ = load(path)
    return provenance_of(tree, path)
