"""``reachmap merge``: journals of shards in, one artefact out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from reachmap.scans.run import Outcome
from reachmap.scans.shards import merge_journals


def merge(shards: Sequence[Path], *, output: Path, overwrite: bool = False) -> Outcome:
    """Join the journals of shards; see :func:`reachmap.scans.shards.merge_journals`.

    Parameters
    ----------
    shards : sequence of Path
        Journals that ``--shard I/N`` runs left, all N of them.
    output : Path
        The artefact.
    overwrite : bool
        Replace ``output``.

    Returns
    -------
    Outcome
    """
    return merge_journals(shards, output=output, overwrite=overwrite)
