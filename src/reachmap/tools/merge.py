"""``reachmap merge``: journals of shards in, one artefact out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from reachmap.disk import one_or_more
from reachmap.maps import check_outputs
from reachmap.runtime.merge import merge_journals
from reachmap.runtime.run import Outcome


def merge(
    shards: Sequence[str | Path], *, output: str | Path, overwrite: bool = False
) -> Outcome:
    """Join the journals of shards; see :func:`reachmap.runtime.merge.merge_journals`.

    Parameters
    ----------
    shards : sequence of Path
        Journals that ``--shard I/N`` runs left, all N of them.
    output : Path
        The artefact.
    overwrite : bool
        Replace ``output``.
    """
    shards, output = one_or_more(shards), Path(output)
    check_outputs([output], overwrite=overwrite, inputs=shards)
    return merge_journals(
        [Path(shard) for shard in shards], output=output, overwrite=overwrite
    )
