"""Each format, held against a file that was read and judged by a person.

No package checks the syntax of URScript, KRL or RAPID. To write the files again, after
a change that is meant: ``python -m tests.motions.test_formats``.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from reachmap.motions.formats import WRITERS, Origin
from reachmap.motions.motion import APPROACH, PLANNED, Motion

GOLDEN = Path(__file__).parent / "golden"
SUFFIXES = {
    "csv": "csv", "json": "json", "joint-trajectory": "yaml", "moveit": "yaml",
    "urscript": "script", "krl": "src", "rapid": "mod",
}  # fmt: skip
NUMBER = re.compile(r"(?<![A-Za-z_0-9])-?\d+\.\d+(?:e-?\d+)?(?![0-9])")


def example(to: str) -> str:
    """Two motions of an arm of six axes, from round numbers."""
    start = np.array([0.0, -1.5, 1.25, 0.25, -1.5, 0.125])
    corner = start + 0.0625
    before = start + np.array([0.125, 0.0625, 0.0, 0.0625, 0.0, 0.0])
    grasp = before + np.array([0.0, 0.0078125, -0.0078125, 0.0, 0.0, 0.0])
    motions = [
        Motion(
            test_grasp=(0, 3, 7, 12),
            configuration=np.array([start, corner, before, grasp]),
            stage=(PLANNED, PLANNED, PLANNED, APPROACH),
            time_s=np.array([0.0, 0.25, 0.5, 0.5625]),
        ),
        Motion(
            test_grasp=(1, 0, 0, 2),
            configuration=np.array([start, corner]),
            stage=(PLANNED, PLANNED),
            time_s=np.array([0.0, 0.25]),
        ),
    ]
    origin = Origin(
        map_sha256="ab" * 32,
        cell_sha256="cd" * 32,
        cell="example",
        base="robot_base",
        tcp="in tool0, 4x4 by rows [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0.25, 0, 0, 0, 1]",
        joint_names=tuple(f"joint_{k}" for k in range(1, 7)),
        is_revolute=np.ones(6, bool),
        velocity=np.full(6, 3.0),
        acceleration=np.full(6, 5.0),
    )
    return WRITERS[to](motions, origin)


def golden(to: str) -> Path:
    """File of a format."""
    return GOLDEN / f"{to}.{SUFFIXES[to]}"


@pytest.mark.parametrize("to", WRITERS)
def test_a_format_is_written_as_it_was_judged(to: str) -> None:
    """Word by word; numbers may differ in their last places."""
    text, known = example(to), golden(to).read_text()
    assert NUMBER.sub("#", text) == NUMBER.sub("#", known)
    np.testing.assert_allclose(
        [float(n) for n in NUMBER.findall(text)],
        [float(n) for n in NUMBER.findall(known)],
        rtol=1e-9,
        atol=1e-12,
    )


if __name__ == "__main__":
    for name in WRITERS:
        golden(name).write_text(example(name))
