"""``--set key.path=value`` assignments, applied to the data of a cell file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from pydantic import BaseModel

from reachmap.cell.text.messages import did_you_mean, known_keys
from reachmap.cell.text.yaml_reader import (
    Document,
    Location,
    Mistake,
    Place,
    parse_yaml,
)
from reachmap.disk import is_text, recorded_name
from reachmap.errors import CellError

# A choice against hostile input, far above what a command line holds.
MAX_OVERRIDES = 1000
SOURCE = "--set "


def apply_overrides(
    document: Document, overrides: Sequence[str], model: type[BaseModel]
) -> None:
    """Change ``document.data`` in place, one assignment after another.

    A part of the path is a key, an index of a list, or the ``name`` of an entry of
    a list (``bodies.gripper.pose.xyz.2=0.1``). Values are YAML. Mistakes are added
    to the document.
    """
    if len(overrides) > MAX_OVERRIDES:
        raise CellError(f"--set: at most {MAX_OVERRIDES} assignments")
    for text in overrides:
        place = _place(text)
        try:
            _apply(document, text, place, model)
        except _PathError as error:
            document.mistakes.append(Mistake(place=place, message=str(error)))
        except CellError as error:
            document.mistakes.extend(
                Mistake(place=place, message=line.removeprefix(f"{place}:").strip())
                for line in error.lines
            )


@contextmanager
def given_as(options: Mapping[str, str]) -> Iterator[None]:
    """Let mistakes name the options that assignments stand for.

    Parameters
    ----------
    options : mapping
        Assignment, as in ``pick_from=left``, to the option, as in ``--bin left``.
    """
    names = {f"{_place(text)}: ": f"{option}: " for text, option in options.items()}

    def renamed(line: str) -> str:
        for assignment, option in names.items():
            if line.startswith(assignment):
                return option + line.removeprefix(assignment)
        return line

    try:
        yield
    except CellError as error:
        raise CellError([renamed(line) for line in error.lines]) from error


def _place(text: str) -> Place:
    return Place(source=f"{SOURCE}{recorded_name(text[:120])}")


def is_override(place: Place) -> bool:
    """Whether a value was given by an override."""
    return place.source.startswith(SOURCE)


class _PathError(ValueError):
    """The path of an assignment leads nowhere."""


def _apply(document: Document, text: str, place: Place, model: type[BaseModel]) -> None:
    if not is_text(text):
        raise _PathError("expected UTF-8 text")
    path, separator, value_text = text.partition("=")
    if not separator or not path.strip():
        raise _PathError("expected key.path=value")
    value = parse_yaml(value_text.strip() or "null", str(place))
    parts = [part.strip() for part in path.strip().split(".")]
    container, location = document.data, ()  # type: tuple[Any, Location]
    for index, part in enumerate(parts):
        last = index == len(parts) - 1
        key = _key(container, part, location, model, last=last)
        location = (*location, key)
        if (
            last
            and location[:-1] == ("parameters",)
            and isinstance(container[key], dict)
        ):
            container[key] |= {"value": value.data}
        elif last:
            container[key] = _named(value.data, part, key)
        elif isinstance(container, dict) and container.get(str(key)) is None:
            container[key] = {}
            document.places[location] = place
        container = container[key]
    _replace_places(document, location, place)
    for mistake in value.mistakes:
        document.mistakes.append(
            Mistake(
                place=place,
                location=(*location, *mistake.location),
                message=mistake.message,
            )
        )


def _named(value: Any, part: str, key: str | int) -> Any:
    """A value, an entry of a list that the path names taking that name."""
    if isinstance(value, dict) and key != part and not part.isdigit():
        return {"name": part, **value}
    return value


def _key(
    container: Any,
    part: str,
    location: Location,
    model: type[BaseModel],
    *,
    last: bool,
) -> str | int:
    """Key or index that ``part`` means in a container; _PathError if it has none."""
    where = ".".join(str(item) for item in location) or "the cell"
    if isinstance(container, list):
        if part.isascii() and part.isdigit() and len(part) < 9:
            if int(part) < len(container):
                return int(part)
            raise _PathError(f"{where} has {len(container)} entries (got index {part})")
        names = [item.get("name") for item in container if isinstance(item, dict)]
        if part in names:
            return next(
                index
                for index, item in enumerate(container)
                if isinstance(item, dict) and item.get("name") == part
            )
        texts = [name for name in names if isinstance(name, str)]
        hint = did_you_mean(part, texts)
        raise _PathError(f"{where} has no entry {part!r}; {hint or 'use an index'}")
    if not isinstance(container, dict):
        raise _PathError(f"{where} is a single value (got .{part} after it)")
    known = known_keys(model, location)
    # A bin may be added whole, but not by one of its keys.
    if location == ("parameters",) or (location == ("bins",) and not last):
        known = tuple(container)
    if known and part not in known:
        raise _PathError(f"{where} has no key {part!r}; {did_you_mean(part, known)}")
    return part


def _replace_places(document: Document, location: Location, place: Place) -> None:
    """Let the location and everything below it point at the assignment."""
    for places in (document.places, document.key_places):
        for inner in [key for key in places if key[: len(location)] == location]:
            del places[inner]
    document.places[location] = place
    document.key_places[location] = place
