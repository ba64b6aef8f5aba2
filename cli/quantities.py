"""Numbers on the command line, and lengths and angles with their units: ``5mm``."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import click
import numpy as np

LENGTHS_M = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
ANGLES_RAD = {"deg": np.pi / 180.0, "°": np.pi / 180.0, "rad": 1.0}
NUMBER = r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[-+]?[0-9]+)?"
BOX_SIDES = re.compile(
    rf"({NUMBER})\s*x\s*({NUMBER})\s*x\s*({NUMBER})\s*(mm|cm|m)", re.IGNORECASE
)
ROUND = re.compile(rf"d({NUMBER})\s*x\s*({NUMBER})\s*(mm|cm|m)", re.IGNORECASE)
QUANTITY = re.compile(rf"({NUMBER})(mm|cm|m|deg|°|rad)", re.IGNORECASE)


class FiniteType(click.types.FloatParamType):
    """A number that is neither infinite nor NaN, with which no gate would ever fail."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Read one; click reports what is none."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value!r} is not a finite number.", param, ctx)
        return number


class FiniteRange(click.FloatRange):
    """A finite number in a range; NaN is in any range of click's."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Read one; click reports what is none."""
        return float(super().convert(FINITE.convert(value, param, ctx), param, ctx))


FINITE = FiniteType()


class GroupsOption(click.Option):
    """A repeatable option of several values each, in the environment as well.

    What does not fill its last group there, click leaves out without a word.
    """

    def value_from_envvar(self, ctx: click.Context) -> Any:
        """Split into groups; a part of one is a mistake."""
        text = self.resolve_envvar_value(ctx)
        if text and len(self.type.split_envvar_value(text)) % self.nargs:
            message = f"{text!r} is not a list of groups of {self.nargs} values."
            raise click.BadParameter(message, ctx, self)
        return super().value_from_envvar(ctx)


class ErrorSizeType(click.ParamType):  # type: ignore[type-arg, unused-ignore]
    """How far something is off: ``5mm``, ``1deg`` or ``5mm 1deg`` as (m, rad)."""

    name = "size"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, float]:
        """Parse a value; click reports what is not one."""
        if isinstance(value, tuple):
            return value
        sizes: dict[str, float] = {}
        for word in str(value).split():
            found = QUANTITY.fullmatch(word)
            if found is None:
                self.fail(f"{word!r}: expected a number with its unit, 5mm or 1deg.")
            unit = found[2].lower()
            kind, factors = (
                ("shift", LENGTHS_M) if unit in LENGTHS_M else ("turn", ANGLES_RAD)
            )
            if kind in sizes:
                self.fail(f"{value!r}: expected one length and one angle at most.")
            sizes[kind] = FINITE.convert(found[1], param, ctx) * float(factors[unit])
        if not sizes:
            self.fail("expected a length, an angle or both, as in 5mm 1deg.")
        return sizes.get("shift", 0.0), sizes.get("turn", 0.0)


ERROR_SIZE = ErrorSizeType()


class PartType(click.ParamType):  # type: ignore[type-arg, unused-ignore]
    """A box ``60x40x20mm``, a cylinder ``d30x80mm`` or a mesh file.

    A box is returned as three sides in metres, a cylinder as its bounding box.
    """

    name = "part"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, float, float] | Path:
        """Parse a value; click reports what is not one."""
        if isinstance(value, tuple | Path):
            return value
        text = str(value).strip()
        if box := BOX_SIDES.fullmatch(text):
            unit_m = LENGTHS_M[box[4].lower()]
            x, y, z = (unit_m * FINITE.convert(box[k], param, ctx) for k in (1, 2, 3))
            return x, y, z
        if bar := ROUND.fullmatch(text):
            unit_m = LENGTHS_M[bar[3].lower()]
            d, length = (unit_m * FINITE.convert(bar[k], param, ctx) for k in (1, 2))
            return d, d, length
        if not Path(text).suffix[1:2].isalpha():
            self.fail(
                f"{value!r}: expected three sides and a unit, 60x40x20mm, a cylinder, "
                "d30x80mm, or a mesh file."
            )
        return Path(text)


PART = PartType()


class QuantityCommand(click.Command):
    """A command whose options take one or two quantities: ``--bin 5mm 1deg``."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Join the quantities that follow an option for them into one word."""
        names = {
            name
            for parameter in self.params
            if parameter.type is ERROR_SIZE
            for name in parameter.opts
        }
        joined: list[str] = []
        seen: set[str] = set()
        open_value = False
        for word in args:
            if open_value and QUANTITY.fullmatch(word):
                joined[-1] += f" {word}"
                continue
            open_value = bool(joined) and joined[-1] in names
            joined.append(word)
            name, equals, _ = word.partition("=")
            open_value = open_value or (name in names and bool(equals))
            if name in names and name in seen:
                raise click.UsageError(
                    f"{name}: given twice; two quantities follow one option, as in "
                    "--bin 5mm 1deg.",
                    ctx,
                )
            seen.add(name)
        return super().parse_args(ctx, joined)
