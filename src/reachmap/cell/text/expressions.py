"""Numbers of a cell written as expressions of its ``parameters``.

``"=pedestal_height - 0.402"`` stands for a number wherever a cell file wants one.
Expressions are arithmetic and nothing else: no attribute, no index, no text, no code.
"""

from __future__ import annotations

import ast
import json
import math
from collections.abc import Iterator, Mapping
from typing import Any, Final

from simpleeval import InvalidExpression, SimpleEval

from reachmap.cell.text.data import at
from reachmap.cell.text.messages import did_you_mean
from reachmap.cell.text.yaml_reader import Document, Location

SIGN = "="
# A choice: two lines of text; what is longer is not a formula.
MAX_LENGTH = 200
# Texts for people may begin with any sign.
TEXTS: Final = frozenset({"name", "description", "unit"})
FUNCTIONS: Final = {
    "abs": abs, "min": min, "max": max, "round": round, "sqrt": math.sqrt,
    "sin": math.sin, "cos": math.cos, "tan": math.tan, "atan2": math.atan2,
    "radians": math.radians, "degrees": math.degrees,
}  # fmt: skip
CONSTANTS: Final = {"pi": math.pi}
_NODES: Final = (
    ast.Expr, ast.Constant, ast.Name, ast.UnaryOp, ast.BinOp, ast.Call,
)  # fmt: skip
_OPERATORS: Final = (
    ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow, ast.Mod, ast.USub, ast.UAdd,
)  # fmt: skip


class ExpressionError(ValueError):
    """An expression that is not a number; the message says why."""


class Evaluator:
    """Values of expressions over parameters, which may be expressions themselves.

    Parameters
    ----------
    parameters : mapping of str to object
        Numbers, or texts that begin with ``=``.
    """

    def __init__(self, parameters: Mapping[str, object]) -> None:
        self._parameters = parameters
        self._known: dict[str, float] = {}
        self._open: list[str] = []

    def parameter(self, name: str) -> float:
        """Value of a parameter or constant by name; expressions are evaluated once."""
        if name in CONSTANTS:
            return CONSTANTS[name]
        if name not in self._parameters:
            hint = did_you_mean(name, [*self._parameters])
            raise ExpressionError(
                f"unknown parameter {name!r}; {hint or 'the cell has no parameters'}"
            )
        if name in self._open:
            circle = " → ".join([*self._open[self._open.index(name) :], name])
            raise ExpressionError(f"circular parameters: {circle}")
        if name not in self._known:
            self._open.append(name)
            try:
                self._known[name] = self.number(self._parameters[name])
            finally:
                self._open.pop()
        return self._known[name]

    def number(self, value: object) -> float:
        """Value of a number or of an expression."""
        if isinstance(value, str) and value.startswith(SIGN):
            return self._evaluate(value.removeprefix(SIGN).strip())
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ExpressionError(f"expected a number or an expression (got {value!r})")
        return value

    def _evaluate(self, text: str) -> float:
        if not text or len(text) > MAX_LENGTH:
            raise ExpressionError(f"expected 1 to {MAX_LENGTH} characters after the =")
        engine = SimpleEval(functions=dict(FUNCTIONS), names=self._name)
        for table, allowed in ((engine.nodes, _NODES), (engine.operators, _OPERATORS)):
            for kind in [*table]:
                if kind not in allowed:
                    del table[kind]
        try:
            value = engine.eval(text)
        except ExpressionError:
            raise
        except SyntaxError as error:
            raise ExpressionError(
                f"{text!r} cannot be read at character {error.offset or 1}"
            ) from None
        except (InvalidExpression, KeyError) as error:
            said = str(error).rstrip(".") or type(error).__name__
            raise ExpressionError(f"{text!r} is not allowed: {said}") from None
        except (ArithmeticError, ValueError, TypeError, RecursionError) as error:
            raise ExpressionError(f"{text!r} has no value: {error}") from None
        return _finite(value, text)

    def _name(self, node: ast.Name) -> float:
        return self.parameter(node.id)


def resolve_expressions(document: Document) -> None:
    """Replace every expression of ``document.data`` by its value, in place.

    The expressions are kept under the key ``expressions``, by the place of the number
    they stand for as a JSON list. Mistakes are added to the document where they are
    written.
    """
    data = document.data
    _spell_out(data)
    evaluator = Evaluator(parameter_values(data))
    found: dict[str, str] = {}
    for location, text in list(_expressions(data, ())):
        try:
            _put(data, location, evaluator.number(text))
        except ExpressionError as error:
            document.add(location, str(error))
            _put(data, location, 0.0)
        found[json.dumps(location)] = text
    if found:
        data["expressions"] = found


def restore_expressions(document: Document) -> None:
    """Put the expressions of a resolved cell back where they stood, in place.

    Numbers that were changed since (place-bin moved the bin) stay as they are.
    """
    data = document.data
    found = data.pop("expressions", None) or {}
    if not isinstance(found, dict):
        document.add(("expressions",), "expected a mapping of places to expressions")
        return
    evaluator = Evaluator(parameter_values(data))
    restored = []
    for key, text in found.items():
        try:
            location = tuple(json.loads(key))
            if at(data, *location) == evaluator.number(text):
                restored.append((location, text))
        except (ValueError, TypeError) as error:
            document.add(("expressions", key), f"{text!r:.60}: {error}")
    for location, text in restored:
        _put(data, location, text)


def _spell_out(data: Any) -> None:
    """Write each parameter as a mapping, so that its value has a place of its own."""
    named = at(data, "parameters")
    for name, entry in named.items() if isinstance(named, dict) else ():
        if not isinstance(entry, dict):
            named[name] = {"value": entry}


def parameter_values(data: Any) -> dict[str, object]:
    """Parameters of a cell's data by name; a number may stand for its mapping."""
    named = at(data, "parameters")
    if not isinstance(named, dict):
        return {}
    return {
        name: at(entry, "value") if isinstance(entry, dict) else entry
        for name, entry in named.items()
    }


def _put(data: Any, location: Location, value: object) -> None:
    for part in location[:-1]:
        data = data[part]
    data[location[-1]] = value


def _expressions(data: Any, location: Location) -> Iterator[tuple[Location, str]]:
    if isinstance(data, str) and data.startswith(SIGN) and location[-1] not in TEXTS:
        yield location, data
    members = enumerate(data) if isinstance(data, list) else ()
    if isinstance(data, dict):
        members = data.items()  # type: ignore[assignment]
    for part, member in members:
        yield from _expressions(member, (*location, part))


def _finite(value: object, text: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ExpressionError(f"{text!r} is not a number (got {value!r:.60})")
    if not math.isfinite(value):
        raise ExpressionError(f"{text!r} is not finite")
    # Counts are whole numbers however they were computed.
    return int(value) if value == int(value) and abs(value) < 2**53 else value
