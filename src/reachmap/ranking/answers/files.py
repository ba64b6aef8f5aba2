"""Writing ranked lists: to one file or a folder, never over the supplied list."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from reachmap.disk import is_folder
from reachmap.errors import OutputError, SettingsError
from reachmap.maps.bytes.publish import publish
from reachmap.ranking.lists.reading import STDIN


def targets_of(sources: Sequence[str | Path], output: Path | None) -> list[Path]:
    """Name the file of each list, or the one file of all.

    Parameters
    ----------
    sources : sequence of path
        The supplied lists.
    output : Path or None
        A folder takes ``NAME.ranked.json`` for each list; of several lists, a name
        without suffix is a folder that is made. Any other name is one file.

    Raises
    ------
    OutputError, SettingsError
        The folder cannot be made, or two lists have one name.
    """
    if output is None:
        return []
    if not is_folder(output) and (len(sources) == 1 or output.suffix):
        return [output]
    targets = [output / _ranked_name(source) for source in sources]
    if len(set(targets)) < len(targets):
        raise SettingsError("two lists have one name; rank them one after the other")
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{output}: cannot be made: {error.strerror}") from error
    return targets


def _ranked_name(source: str | Path) -> str:
    stem = "stdin" if str(source) == STDIN else Path(source).stem
    return f"{stem.removesuffix('.ranked')}.ranked.json"


def write_lists(
    targets: Sequence[Path], texts: Sequence[str], *, overwrite: bool
) -> None:
    """Write each list to its file, or all to the one file there is."""
    contents = texts if len(targets) == len(texts) else [joined(texts)]
    for target, text in zip(targets, contents, strict=False):
        publish(target, [text.encode("ascii")], overwrite=overwrite)


def joined(texts: Sequence[str]) -> str:
    """Return one JSON value: a document, or a list of several."""
    return texts[0] if len(texts) == 1 else f"[{','.join(texts)}]\n"
