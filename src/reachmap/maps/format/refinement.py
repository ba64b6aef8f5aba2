"""What a bin map may know between its test grasps."""

from __future__ import annotations

from typing import Final

from reachmap.maps.format.layout import Section, Variable, index
from reachmap.maps.parts import Refinement
from reachmap.maps.records import Status

REFINEMENT: Final = Section(
    field="refinement",
    part=Refinement,
    scales=(index("refinement/sample", "Grasps between the test grasps."),),
    numbers={"lever_m": "lever_m"},
    arrays={
        "position": Variable(
            path="refinement/position",
            dims=("sample", "xyz"),
            dtype="f8",
            units="m",
            meaning="TCP position of grasps between the test grasps.",
            frame="robot_base",
            number="lever_m",
        ),
        "quaternion_wxyz": Variable(
            path="refinement/quaternion_wxyz",
            dims=("sample", "quat"),
            dtype="f8",
            units="1",
            meaning="TCP orientation in the roll that is reached, in any where none "
            "is; unit quaternion.",
            frame="robot_base",
        ),
        "status": Variable(
            path="refinement/status",
            dims=("sample",),
            dtype="u1",
            units="1",
            meaning="Outcome in any roll.",
            codes=Status,
        ),
    },
)
