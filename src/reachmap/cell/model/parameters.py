"""Named numbers of a cell that its expressions refer to."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from reachmap.cell.model.fields import Finite, Record


class Parameter(Record):
    """A number with a name, to be varied as one."""

    value: Finite = Field(description="Its value, or an expression of others.")
    unit: str = Field("", max_length=20, description="Unit, such as m or deg.")
    range: tuple[Finite, Finite] | None = Field(
        None, description="Lowest and highest sensible value."
    )
    description: str = Field("", max_length=500, description="What it is, in words.")

    @model_validator(mode="after")
    def _inside(self) -> Parameter:
        if self.range is None:
            return self
        low, high = self.range
        if low > high:
            raise ValueError(f"range: expected lowest, highest (got {low:g}, {high:g})")
        if not low <= self.value <= high:
            raise ValueError(f"value {self.value:g} is outside {low:g} … {high:g}")
        return self


ParameterName = Annotated[
    str, Field(min_length=1, max_length=40, pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")
]
Parameters = dict[ParameterName, Parameter]
