"""The tool: what turning it about its approach axis changes."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from reachmap.cell.model.fields import Record

LISTED, FREE = "listed", "free"


class ToolSpec(Record):
    """How the tool may be turned about its approach axis."""

    roll: Annotated[str, Field(pattern=r"^(listed|free|([2-9]|[1-9][0-9])-fold)$")] = (
        Field(
            LISTED,
            description="listed: as the orientations say; free: any roll will do, as "
            "for a suction cup; N-fold, as in 2-fold: the tool looks the same after a "
            "part of a turn.",
        )
    )
    rolls: int = Field(
        24, ge=2, le=360, description="Rolls of a direction that are tried where free."
    )

    def count(self) -> int:
        """Rolls of one direction that will do, evenly spread over a turn."""
        if self.roll == LISTED:
            return 1
        return self.rolls if self.roll == FREE else int(self.roll.split("-")[0])
