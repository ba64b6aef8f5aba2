"""isaac_grasp 1.x YAML: named grasps of one gripper on one object."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

from reachmap.errors import GraspListError
from reachmap.ranking.lists.fields import plain_parts, shown

MAX_DEPTH: Final = 16
"""Nesting of a document; a list of grasps has 5 levels."""

ROOT_KEYS: Final = ("format", "format_version", "grasps")
GRASP_KEYS: Final = ("position", "orientation", "confidence")
"""What is converted; all else that programs write is copied to the answer."""


def data_from_yaml(text: str, source: str) -> Any:
    """Parse YAML without tags, anchors or repeated keys, nested a few levels deep."""
    # Imported here: ranking native lists needs no YAML reader. PyYAML's is in C, and
    # thirty times as fast as the one that reads cells.
    import yaml

    class Loader(yaml.CSafeLoader):  # type: ignore[misc, unused-ignore]
        def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:
            mapping: dict[Any, Any] = super().construct_mapping(node, deep)
            if len(mapping) < len(node.value):
                raise yaml.MarkedYAMLError(
                    problem="a key is repeated", problem_mark=node.start_mark
                )
            return mapping

    try:
        _check_structure(yaml.parse(text, Loader=yaml.CSafeLoader))
        return Loader(text).get_single_data()
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f":{mark.line + 1}:{mark.column + 1}" if mark else ""
        problem = getattr(error, "problem", None) or "it cannot be parsed"
        first_line = str(problem).splitlines()[0]
        raise GraspListError(f"{source}{where}: not valid YAML: {first_line}") from None
    except (ValueError, TypeError, RecursionError, AttributeError, IndexError,
            KeyError, OverflowError) as error:  # fmt: skip
        # The reader lets these through for odd tags, dates and numbers.
        raise GraspListError(f"{source}: not usable YAML: {error}") from None


def _check_structure(events: Iterable[Any]) -> None:
    """Refuse what makes small texts large or slow, before anything is built."""
    import yaml

    depth = 0
    for event in events:
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        problem = ""
        if depth > MAX_DEPTH:
            problem = f"nested more than {MAX_DEPTH} levels deep"
        elif isinstance(event, yaml.AliasEvent):
            problem = "anchors and aliases are not supported"
        if problem:
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=event.start_mark)


def document_from_isaac(data: Any, source: str) -> dict[str, Any]:
    """Grasps of an isaac_grasp file: the gripper frame in the object's frame.

    Quaternions are split into ``w`` and ``xyz``; the approach axis is the gripper's
    +z, and the confidence becomes the score.

    Parameters
    ----------
    data : object
        The parsed YAML.
    source : str
        Name of the file in messages.
    """
    if not isinstance(data, dict) or data.get("format") != "isaac_grasp":
        raise GraspListError(f"{source}: isaac_grasp needs 'format: isaac_grasp'")
    version = str(data.get("format_version"))
    if version.split(".")[0] != "1":
        raise GraspListError(f"{source}: isaac_grasp version 1 is read (got {version})")
    # An image without grasps: programs leave the value out.
    named = {} if data.get("grasps", 0) is None else data.get("grasps")
    if not isinstance(named, dict):
        raise GraspListError(
            f"{source}: grasps: expected names with poses (got {shown(named)})"
        )
    origin = plain_parts(data, ROOT_KEYS)
    grasps = [_grasp(str(name), value, source) for name, value in named.items()]
    return {"approach_axis": "+z", "source": origin, "grasps": grasps}


def _grasp(name: str, value: Any, source: str) -> dict[str, Any]:
    turn = value.get("orientation") if isinstance(value, dict) else None
    vector = turn.get("xyz") if isinstance(turn, dict) else None
    if not isinstance(turn, dict) or "w" not in turn or not isinstance(vector, list):
        raise GraspListError(
            f"{source}: grasps.{name!a}: expected position and "
            f"orientation {{w, xyz}} (got {shown(value)})"
        )
    grasp = {
        "id": name,
        "position": value.get("position"),
        "quaternion_wxyz": [turn["w"], *vector],
        **plain_parts(value, GRASP_KEYS, "x_"),
    }
    if "confidence" in value:
        grasp["score"] = value["confidence"]
    return grasp
