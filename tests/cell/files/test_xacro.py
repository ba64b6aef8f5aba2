"""Xacro files: where their names lead, what their arguments are, when they end."""

from __future__ import annotations

from pathlib import Path

import pytest

from reachmap.cell.files import xacro as xacro_files
from reachmap.cell.files.resources import Resolver
from reachmap.cell.files.xacro import expand_xacro
from reachmap.errors import CellError

pytest.importorskip("xacro")

HEAD = '<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">'


def write(path: Path, inner: str) -> Path:
    """Create a xacro file around some elements."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"{HEAD}{inner}</robot>")
    return path


def expanded(path: Path, **arguments: str) -> str:
    """Text of a xacro file."""
    return expand_xacro(path, arguments, Resolver(directory=path.parent)).text


@pytest.mark.parametrize("trap", [False, True])
def test_names_are_relative_to_the_file_they_stand_in(
    trap: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not to the current folder, even where that holds files of the same names."""
    arm = write(
        tmp_path / "arm" / "arm.urdf.xacro",
        '<xacro:include filename="parts/one.xacro"/>'
        '<xacro:property name="y" value="${xacro.load_yaml(\'v.yaml\')}"/>'
        '<link name="y${y.value}"/><link name="$(dirname)"/><link name="$(cwd)"/>',
    )
    inner = '<xacro:include filename="two.xacro"/><link name="$(dirname)/x"/>'
    write(arm.parent / "parts" / "one.xacro", inner)
    write(arm.parent / "parts" / "two.xacro", '<link name="right"/>')
    (arm.parent / "v.yaml").write_text("value: 7\n")
    elsewhere = tmp_path / "elsewhere"
    (elsewhere / "parts").mkdir(parents=True)
    if trap:
        for name in ("parts/one.xacro", "two.xacro", "parts/two.xacro"):
            write(elsewhere / name, '<link name="wrong"/>')
        (elsewhere / "v.yaml").write_text("value: 8\n")
        (elsewhere / "json.py").write_text("raise SystemExit")
    monkeypatch.chdir(elsewhere)
    text = expanded(arm)
    assert [line.split('"')[1] for line in text.splitlines() if "<link" in line] == [
        "right",
        f"{arm.parent}/parts/x",
        "y7",
        str(arm.parent),
        str(arm.parent),
    ]


def test_arguments_are_those_declared_or_used_anywhere(tmp_path: Path) -> None:
    """In the file, in what it includes, and where a condition leaves them out."""
    write(tmp_path / "more.xacro", '<xacro:arg name="included" default="1"/>')
    path = write(
        tmp_path / "arm.xacro",
        '<xacro:arg name="len" default="2"/><xacro:include filename="more.xacro"/>'
        '<xacro:if value="false"><xacro:arg name="hidden" default="3"/></xacro:if>'
        '<link name="$(arg len)$(arg used)"/>',
    )
    found = expand_xacro(path, {"used": "x"}, Resolver(directory=tmp_path))
    assert 'name="2x"' in found.text
    assert sorted(found.arguments) == ["hidden", "included", "len", "used"]
    assert 'name="5x"' in expanded(path, used="x", len="5")


@pytest.mark.parametrize(
    ("inner", "message"),
    [
        ('<link name="$(arg who)"/>', r"argument 'who' is not given.*--xacro-arg who="),
        ("<link name=\"${xacro.arg('who')}\"/>", r"argument 'who' is not given"),
        ('<link name="$(find nix)"/>', r"package 'nix' .*--package nix=FOLDER"),
        ('<xacro:include filename="$(find nix)/a"/>', r"package 'nix' .*--package"),
        ('<xacro:include filename="none.xacro"/>', "none.xacro"),
        ('<link name="${1/0}"/>', "division by zero"),
        ('<link name="${nobody}"/>', "nobody"),
        ("<xacro:macro_that_is_not/>", "macro_that_is_not"),
        ("<link>", "mismatched tag"),
        ('<link name="$(env NIX)"/>', "expanded: environment variable 'NIX' is not se"),
    ],
)
def test_a_failure_is_one_line_with_a_remedy(
    inner: str, message: str, tmp_path: Path
) -> None:
    """Whatever xacro raises."""
    path = write(tmp_path / "arm.urdf.xacro", inner)
    with pytest.raises(CellError, match=message) as caught:
        expanded(path)
    assert len(str(caught.value).splitlines()) == 1
    assert "<class" not in str(caught.value)


def test_an_expression_that_never_ends_is_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No signal handler runs inside one power of integers; the process is ended."""
    monkeypatch.setattr(xacro_files, "LIMIT_CPU_S", 1)
    path = write(tmp_path / "arm.xacro", '<link name="${9**9**9}"/>')
    with pytest.raises(CellError, match="stopped after 1 s of computing"):
        expanded(path)


def test_a_text_beyond_memory_is_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Memory has an end, too."""
    monkeypatch.setattr(xacro_files, "LIMIT_BYTES", 500_000_000)
    path = write(tmp_path / "arm.xacro", "<link name=\"${'a'*10**9}\"/>")
    with pytest.raises(CellError, match=r"or 0\.5 GB"):
        expanded(path)


def test_packages_that_find_found_are_reported(tmp_path: Path) -> None:
    """new-cell writes them into the cell."""
    (tmp_path / "tools").mkdir()
    path = write(tmp_path / "arm.xacro", '<link name="$(find gripper)"/>')
    resolver = Resolver(directory=tmp_path, packages={"gripper": "tools"})
    found = expand_xacro(path, {}, resolver)
    assert found.packages == {"gripper": str(tmp_path / "tools")}


def test_only_warnings_that_matter_are_reported(tmp_path: Path) -> None:
    """An include that matches nothing, once; redefined names are a matter of style."""
    inner = '<xacro:include filename="parts/*.xacro"/>' * 2
    inner += '<xacro:property name="pi" value="3"/>'
    path = write(tmp_path / "arm.xacro", inner)
    found = expand_xacro(path, {}, Resolver(directory=tmp_path))
    assert len(found.warnings) == 1
    assert "matched no files" in found.warnings[0]
