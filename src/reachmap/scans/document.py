"""Data shared by all frames of a scan: cell, settings, names, stamp."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from reachmap.cell.model.cell import Cell
from reachmap.core.scene import Scene
from reachmap.maps import (
    Provenance,
    Stamp,
    Status,
    collect_provenance,
    config_sha256,
)


def checking_settings(scene: Scene) -> dict[str, Any]:
    """Collision and kinematics settings, as stored in artefacts."""
    cell = scene.loaded.cell
    approximation = scene.kinematics.approximation
    return {
        "collision": cell.collision.model_dump(mode="json"),
        "verification_is_proof": scene.motions.is_proof,
        "ik_method": scene.kinematics.method,
        "ik_complete": scene.kinematics.complete,
        **({"ik_approximation": approximation} if approximation else {}),
        "with_bin": scene.with_bin,
        "pairs_proved_never_to_meet": list(scene.checker.proved_pairs),
    }


def scan_document(
    scene: Scene,
    *,
    kind: str,
    method: str,
    settings: Mapping[str, Any],
    source_sha256: str = "",
    body_pairs: Sequence[str] | None = None,
) -> dict[str, Any]:
    """Everything an artefact holds besides the results, as JSON values.

    Parameters
    ----------
    scene : Scene
    kind : str
        As in ``"bin_map"``.
    method : str
    settings : mapping
        What the result depends on besides the cell and its seed.
    source_sha256 : str
        ``content_sha256`` of the artefact this one is made from.
    body_pairs : sequence of str, optional
        As the results number them; default: as the scene does.
    """
    loaded = scene.loaded
    seed = loaded.cell.seed
    provenance = collect_provenance(
        loaded, settings=settings, source_sha256=source_sha256
    )
    stamp = Stamp(
        seed=seed,
        cell_sha256=loaded.sha256,
        config_sha256=config_sha256(
            kind=kind,
            cell_sha256=loaded.sha256,
            seed=seed,
            settings=settings,
            method=method,
            source_sha256=source_sha256,
        ),
    )
    return {
        "method": method,
        "provenance": dataclasses.asdict(provenance),
        "stamp": dataclasses.asdict(stamp),
        "scan_configuration": scene.scan_configuration.tolist(),
        "joint_names": list(scene.robot.joint_names),
        "body_pairs": list(
            scene.checker.body_pairs if body_pairs is None else body_pairs
        ),
    }


def journal_settings(document: Mapping[str, Any]) -> dict[str, Any]:
    """Settings that a journal must agree on to be resumed, readable one by one."""
    stamp = document["stamp"]
    return {
        "cell": stamp["cell_sha256"],
        "seed": stamp["seed"],
        "method": document["method"],
        "source": document["provenance"]["source_sha256"],
        **document["provenance"]["settings"],
    }


def cell_of_document(document: Mapping[str, Any]) -> Cell:
    """Cell of a scan, as resolved."""
    return Cell.model_validate_json(document["provenance"]["cell_resolved_json"])


def provenance_from_document(document: Mapping[str, Any]) -> Provenance:
    """Provenance record of a scan."""
    fields = dict(document["provenance"])
    fields["overrides"] = tuple(fields["overrides"])
    return Provenance(**fields)


def tally(payload: Mapping[str, Any]) -> tuple[int, int]:
    """Frames, or grasps, with a path, and all of them, of a unit."""
    status = payload["status"]
    return int((status == Status.PATH_FOUND).sum()), len(status)
