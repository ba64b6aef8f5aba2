"""GraspGen JSON: an object's grasps as 4×4 transforms with a success mask."""

from __future__ import annotations

from typing import Any

from reachmap.errors import GraspListError
from reachmap.ranking.lists.fields import plain_parts, shown


def document_from_graspgen(data: Any, source: str) -> tuple[dict[str, Any], list[str]]:
    """Grasps of ``grasps.transforms``: the gripper base in the object's frame.

    The approach axis is the gripper's +z. Transforms whose ``object_in_gripper`` is
    false failed in simulation and are left out; a note says how many.

    Parameters
    ----------
    data : object
        The parsed JSON.
    source : str
        Name of the file in messages.

    Returns
    -------
    document : dict
    notes : list of str
    """
    body = data.get("grasps") if isinstance(data, dict) else None
    transforms = body.get("transforms") if isinstance(body, dict) else None
    if not isinstance(body, dict) or not isinstance(transforms, list):
        raise GraspListError(f"{source}: GraspGen needs a list grasps.transforms")
    mask = body.get("object_in_gripper", [True] * len(transforms))
    if not isinstance(mask, list) or len(mask) != len(transforms):
        raise GraspListError(
            f"{source}: grasps.object_in_gripper: expected a flag for each of the "
            f"{len(transforms)} transforms (got {shown(mask)})"
        )
    grasps = [
        _grasp(transform, index, source)
        for index, (transform, good) in enumerate(zip(transforms, mask, strict=True))
        if good
    ]
    failed = len(transforms) - len(grasps)
    notes = [f"{failed} transforms that failed in simulation are left out"]
    origin = plain_parts(data, ("grasps",))
    document = {"approach_axis": "+z", "source": origin, "grasps": grasps}
    return document, notes if failed else []


def _grasp(transform: Any, index: int, source: str) -> dict[str, Any]:
    rows = transform if isinstance(transform, list) else []
    sizes = [len(row) if isinstance(row, list) else 0 for row in rows]
    if sizes != [4, 4, 4, 4] or rows[3] != [0, 0, 0, 1]:
        raise GraspListError(
            f"{source}: grasps.transforms[{index}]: expected a 4×4 matrix with the "
            f"last row [0, 0, 0, 1] (got {shown(transform)})"
        )
    return {
        "id": index,
        "position": [row[3] for row in rows[:3]],
        "rotation_matrix": [row[:3] for row in rows[:3]],
    }
