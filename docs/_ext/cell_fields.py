"""A directive that writes the tables of the cell file from the model itself.

``{cell-fields}`` walks the description of a cell and gives one section per record:
every key, what it accepts, its default and its meaning. The page can therefore not
drift from the code; a test asserts that no meaning is missing.
"""

from __future__ import annotations

import re
import types
import typing
from collections.abc import Iterator
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from docutils import nodes
from docutils.statemachine import StringList
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined
from sphinx.util.docutils import SphinxDirective

from reachmap.cell.model.cell import Cell

BOUNDS = {"gt": ">", "ge": "≥", "lt": "<", "le": "≤"}
NAMES = {
    float: "number",
    int: "integer",
    str: "text",
    bool: "true or false",
    type(None): "null",
}


def records(annotation: Any) -> Iterator[type[BaseModel]]:
    """Every record that an annotation mentions, in order."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from records(part)


def walk(
    model: type[BaseModel], path: str = ""
) -> Iterator[tuple[str, type[BaseModel]]]:
    """Each record of the cell with the key it is found under, outermost first."""
    yield path, model
    for name, field in model.model_fields.items():
        for record in records(field.annotation):
            plural = "[]" if get_origin(field.annotation) is tuple else ""
            yield from walk(record, f"{path}.{name}{plural}".lstrip("."))


def distinct() -> dict[type[BaseModel], list[str]]:
    """Each record once, with all the keys it is found under."""
    found: dict[type[BaseModel], list[str]] = {}
    for path, model in walk(Cell):
        found.setdefault(model, []).append(path)
    return found


def bounds(metadata: Any) -> str:
    """Limits on a number, such as ``> 0, ≤ 1``."""
    parts = []
    for item in metadata:
        nested = getattr(item, "metadata", None)
        if nested:
            parts.append(bounds(nested))
        for attribute, sign in BOUNDS.items():
            value = getattr(item, attribute, None)
            if value is not None and type(item).__name__.lower() == attribute:
                parts.append(f"{sign} {value:g}")
    return ", ".join(part for part in parts if part)


def type_text(annotation: Any, metadata: Any = ()) -> str:
    """What a key accepts, in words."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return type_text(arguments[0], (*arguments[1:], *metadata))
    if origin in (Union, types.UnionType):
        parts = [
            type_text(part, metadata) for part in arguments if part is not type(None)
        ]
        return " or ".join(parts)
    if origin is Literal:
        return ", ".join(f"`{value}`" for value in arguments)
    if origin is tuple:
        return _tuple_text(arguments)
    if origin is dict:
        return f"mapping of names to {type_text(arguments[1])}"
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return f"[{label(annotation)}](#{anchor(annotation)})"
    limit = bounds(metadata)
    name = NAMES.get(annotation, getattr(annotation, "__name__", str(annotation)))
    return f"{name} {limit}" if limit else name


def _tuple_text(arguments: tuple[Any, ...]) -> str:
    if arguments[-1] is Ellipsis:
        return f"list of {type_text(arguments[0])}"
    kinds = {type_text(part) for part in arguments}
    if len(kinds) == 1:
        return f"{len(arguments)} × {kinds.pop()}"
    return "[" + ", ".join(type_text(part) for part in arguments) + "]"


def default_text(field: FieldInfo) -> str:
    """The default as YAML would show it, or "required"."""
    if field.is_required():
        return "**required**"
    value = field.get_default(call_default_factory=True)
    if value is None or value is PydanticUndefined:
        return "–"
    if isinstance(value, BaseModel):
        return "its defaults"
    if value in ((), {}, ""):
        return "empty"
    if isinstance(value, tuple):
        return f"`[{', '.join(map(str, value))}]`"
    return f"`{value}`"


def anchor(model: type[BaseModel]) -> str:
    """Name a record's section can be linked by."""
    return f"cell-{model.__name__.lower()}"


def label(model: type[BaseModel]) -> str:
    """A record's name in words: ``ConeFamily`` is "cone family"."""
    words = re.findall("[A-Z][a-z0-9]*", model.__name__.removesuffix("Spec"))
    return " ".join(words).lower()


def meaning(model: type[BaseModel], name: str, field: FieldInfo) -> str:
    """Description of a key: its own, or the first sentence of the record it holds."""
    if field.description:
        return field.description
    for record in records(field.annotation):
        return (record.__doc__ or "").strip().split("\n\n")[0].replace("\n", " ")
    return ""


def markdown() -> str:
    """All tables, as MyST Markdown."""
    lines: list[str] = []
    for model, paths in distinct().items():
        places = ", ".join(f"`{path}`" for path in dict.fromkeys(paths) if path)
        lines += [f"({anchor(model)})=", f"## {places or 'Top level'}", ""]
        lines += [typing.cast("str", model.__doc__).replace("\n    ", "\n"), ""]
        lines += ["| Key | Accepts | Default | Meaning |", "|---|---|---|---|"]
        for name, field in model.model_fields.items():
            accepts = type_text(field.annotation, field.metadata).replace("|", "\\|")
            meant = meaning(model, name, field).replace("``", "`").replace("|", "\\|")
            lines.append(f"| `{name}` | {accepts} | {default_text(field)} | {meant} |")
        lines.append("")
    return "\n".join(lines)


class CellFields(SphinxDirective):
    """Insert the tables."""

    has_content = False

    def run(self) -> list[nodes.Node]:
        """Parse the generated Markdown in place."""
        text = StringList(markdown().splitlines(), source="cell model")
        container = nodes.Element()
        self.state.nested_parse(text, self.content_offset, container, match_titles=True)
        return list(container.children)


def setup(app: Any) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("cell-fields", CellFields)
    return {"parallel_read_safe": True}
