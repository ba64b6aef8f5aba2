"""isaac_grasp 1.x YAML: named grasps of one gripper on one object."""

from __future__ import annotations

from typing import Any, Final

from reachmap.errors import GraspListError
from reachmap.ranking.lists.fields import shown

# The pure-Python reader takes seconds for each megabyte.
MAX_YAML_BYTES: Final = 2 * 2**20


MAX_DEPTH: Final = 16
"""Nesting of a document; a list of grasps has 5 levels."""


def _parser() -> type[Any]:
    """Parser of YAML that refuses deep nesting, on which the reader takes for ever."""
    from ruamel.yaml.error import MarkedYAMLError
    from ruamel.yaml.events import CollectionEndEvent, CollectionStartEvent
    from ruamel.yaml.parser import Parser

    class ShallowParser(Parser):  # type: ignore[misc, unused-ignore]
        depth = 0

        def get_event(self) -> Any:
            event = super().get_event()
            if isinstance(event, CollectionStartEvent):
                self.depth += 1
            elif isinstance(event, CollectionEndEvent):
                self.depth -= 1
            if self.depth > MAX_DEPTH:
                raise MarkedYAMLError(
                    problem=f"nested more than {MAX_DEPTH} levels deep",
                    problem_mark=event.start_mark,
                )
            return event

    return ShallowParser


def data_from_yaml(text: str, source: str) -> Any:
    """Parse YAML without tags, refusing repeated keys."""
    # Imported here: ranking native lists needs no YAML reader.
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    if len(text) > MAX_YAML_BYTES:
        raise GraspListError(f"{source}: YAML of more than {MAX_YAML_BYTES} bytes")
    reader = YAML(typ="safe", pure=True)
    reader.Parser = _parser()
    try:
        return reader.load(text)
    except YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f":{mark.line + 1}:{mark.column + 1}" if mark else ""
        problem = getattr(error, "problem", None) or "it cannot be parsed"
        first_line = str(problem).splitlines()[0]
        raise GraspListError(f"{source}{where}: not valid YAML: {first_line}") from None
    except (ValueError, TypeError, RecursionError, AttributeError, IndexError,
            KeyError, OverflowError) as error:  # fmt: skip
        # The reader lets these through for odd tags, dates and numbers.
        raise GraspListError(f"{source}: not usable YAML: {error}") from None


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
    named = data.get("grasps")
    if not isinstance(named, dict):
        raise GraspListError(
            f"{source}: grasps: expected names with poses (got {shown(named)})"
        )
    frames = ("object_frame", "gripper_frame")
    origin = {key: data[key] for key in frames if isinstance(data.get(key), str)}
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
    }
    if "confidence" in value:
        grasp["score"] = value["confidence"]
    return grasp
