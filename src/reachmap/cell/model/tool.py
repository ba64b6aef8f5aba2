"""The tool: its symmetry about the approach axis."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from reachmap.cell.model.fields import Record

LISTED, FREE = "listed", "free"
ROLLS = r"^(listed|free|([2-9]|[1-9][0-9])-fold)$"


class ToolSpec(Record):
    """How the tool may be turned about its approach axis."""

    roll: Annotated[str, Field(pattern=ROLLS)] = Field(
        LISTED,
        description="listed: the rolls of the orientations; free: any roll, as for "
        "a suction cup; N-fold, such as 2-fold: the tool is symmetric under 1/N of "
        "a turn.",
    )
    rolls: int = Field(
        24, ge=2, le=360, description="Rolls tried per direction where roll is free."
    )

    def count(self) -> int:
        """Equivalent rolls per direction, evenly spaced over a turn."""
        if self.roll == LISTED:
            return 1
        return self.rolls if self.roll == FREE else int(self.roll.split("-")[0])
