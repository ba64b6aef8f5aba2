"""The process that expands one xacro file: a request on stdin, an answer on stdout."""

from __future__ import annotations

import contextlib
import json
import resource
import sys
from pathlib import Path
from typing import Any

import xacro
from xacro import substitution_args

from reachmap.cell.files.resources import NotFoundError, Resolver
from reachmap.cell.files.robot_text import MAX_URDF_BYTES, read_xml
from reachmap.errors import CellError


class _Arguments(dict[str, str]):
    """Arguments that record which names were looked up."""

    def __init__(self, given: dict[str, str]) -> None:
        super().__init__(given)
        self.names: dict[str, None] = {}

    def __contains__(self, name: object) -> bool:
        self.names[str(name)] = None
        return super().__contains__(name)

    def __missing__(self, name: str) -> str:
        raise substitution_args.ArgException(name)

    def __getitem__(self, name: str) -> str:
        self.names[name] = None
        return super().__getitem__(name)


def main() -> None:
    """Answer the request; failures are part of the answer."""
    request = json.load(sys.stdin)
    with contextlib.redirect_stdout(sys.stderr):
        _limit(resource.RLIMIT_CPU, request["cpu_s"])
        _limit(resource.RLIMIT_AS, request["bytes"])
        try:
            answer = _expanded(request)
        except Exception as error:  # xacro raises whatever its expressions raise
            answer = _explained(error)
    json.dump(answer, sys.stdout)


def _limit(kind: int, value: int) -> None:
    with contextlib.suppress(ValueError, OSError):
        resource.setrlimit(kind, (value, resource.getrlimit(kind)[1]))


def _expanded(request: dict[str, Any]) -> dict[str, Any]:
    path = Path(request["path"])
    resolver = Resolver(
        directory=Path(request["directory"]),
        packages=request["packages"],
        urdf_folder=path.parent,
    )
    found: dict[str, str] = {}
    arguments = _Arguments(request["arguments"])
    parse = xacro.parse

    def find(name: str) -> str:
        folders, _ = resolver.package_folders(name)
        if not folders:
            raise NotFoundError(resolver.missing_package(name, f"$(find {name})"))
        found[name] = str(folders[0])
        return found[name]

    def read(text: Any, filename: str | None = None) -> Any:
        if text is None and filename is not None and Path(filename).is_file():
            text = read_xml(Path(filename), limit=MAX_URDF_BYTES)
        document = parse(text, filename)
        # Also those that a condition leaves out.
        for element in document.getElementsByTagName("xacro:arg"):
            arguments.names[element.getAttribute("name")] = None
        return document

    xacro.parse = read
    substitution_args._eval_find = find
    substitution_args._eval_dict["find"] = find
    _declared.append(arguments)
    context = xacro.substitution_args_context
    evaluate = xacro.eval_extension

    def extension(text: str) -> Any:
        context["filename"] = xacro.filestack[-1]
        return evaluate(text)

    xacro.eval_extension = extension
    xacro.root_dir = str(path.parent)
    # Not process_file, whose banner names a path of this machine: the text would not
    # be the same elsewhere.
    xacro.init_stacks(str(path))
    document = xacro.parse(None, str(path))
    xacro.process_doc(document, mappings=arguments)
    text = document.toprettyxml(indent="  ")
    if len(text) > MAX_URDF_BYTES:
        raise CellError(f"larger than {MAX_URDF_BYTES:,} bytes when expanded")
    return {"text": text, "arguments": list(arguments.names), "packages": found}


_declared: list[_Arguments] = []


def _takes() -> str:
    """Say which arguments there are: a file name made from one may be wrong."""
    names = ", ".join(_declared[0].names) if _declared else ""
    return f" (arguments of the file: {names})" if names else ""


def _explained(error: Exception) -> dict[str, str]:
    """Answer for a failure, from its root cause."""
    causes = [error]
    while isinstance(cause := getattr(causes[-1], "exc", None), Exception):
        causes.append(cause)
    for cause in reversed(causes):
        if isinstance(cause, substitution_args.ArgException):
            return {"missing": str(cause)}
        if isinstance(
            cause, CellError | NotFoundError | substitution_args.SubstitutionException
        ):
            return {"error": str(cause)}
    if isinstance(causes[-1], MemoryError):
        return {}
    if isinstance(causes[-1], OSError) and causes[-1].filename is not None:
        return {"error": f"{causes[-1].strerror}: {causes[-1].filename}{_takes()}"}
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    reason = lines[0] if lines else type(causes[-1]).__name__
    stack = [name for name in xacro.filestack or [] if name]
    place = f" (in {stack[-1]})" if len(stack) > 1 else ""
    return {"error": f"{reason}{place}"}


if __name__ == "__main__":
    main()
