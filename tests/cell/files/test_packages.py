"""Packages that lie around a URDF, and references as vendors write them."""

from __future__ import annotations

from pathlib import Path

import pytest

from reachmap.cell.files.resources import NotFoundError, Resolver


@pytest.fixture(autouse=True)
def _no_search_paths(monkeypatch: pytest.MonkeyPatch) -> None:
    """Start from an environment without ROS."""
    for name in ("REACHMAP_PACKAGE_PATH", "ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        monkeypatch.delenv(name, raising=False)


def make(folder: Path, name: str, text: str = "x") -> Path:
    """Create a file with its folders."""
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def package(folder: Path, name: str) -> Path:
    """Create a package; its folder need not have its name."""
    make(folder, "package.xml", f"<package>\n  <name> {name} </name></package>")
    return folder


def test_the_own_package_and_its_neighbours_are_found(tmp_path: Path) -> None:
    """By package.xml, whatever the folders are called; nearest first."""
    repository = tmp_path / "ws" / "src" / "repository"
    own = package(repository / "arms" / "arm-1.2", "arm_description")
    urdf = make(own, "urdf/maker/arm.urdf")
    mesh = make(own, "meshes/a.stl")
    tool = package(repository / "tools" / "gripper_main", "gripper")
    finger = make(tool, "f.stl")
    other = make(package(tmp_path / "ws" / "src" / "camera", "camera"), "c.stl")
    inner = package(tool / "test" / "hidden", "hidden")
    resolver = Resolver(directory=tmp_path / "cells").around(str(urdf))
    assert resolver.resolve("package://arm_description/meshes/a.stl") == mesh
    assert resolver.resolve("package://gripper/f.stl") == finger
    assert resolver.resolve("package://camera/c.stl") == other
    with pytest.raises(NotFoundError, match=r"--package hidden=FOLDER"):
        resolver.resolve(f"package://hidden/{inner.name}")
    assert resolver.resolve_robot(str(urdf)) == (urdf, own)


def test_a_folder_of_the_name_will_do(tmp_path: Path) -> None:
    """Unpacked archives often have no package.xml."""
    urdf = make(tmp_path, "arm_description/urdf/arm.urdf")
    mesh = make(tmp_path, "arm_description/meshes/a.stl")
    finger = make(tmp_path, "gripper/f.stl")
    resolver = Resolver(directory=Path("/")).around(str(urdf))
    assert resolver.resolve("package://arm_description/meshes/a.stl") == mesh
    assert resolver.resolve("package://gripper/f.stl") == finger


def test_what_the_user_says_comes_before_what_lies_around(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The cell, then reachmap's variable, then the neighbourhood, then ROS."""
    urdf = make(package(tmp_path / "own" / "arm", "arm"), "arm.urdf")
    places = [make(tmp_path, f"{k}/arm/a.stl") for k in "cre"]
    near = make(urdf.parent, "a.stl")
    monkeypatch.setenv("REACHMAP_PACKAGE_PATH", str(tmp_path / "r"))
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "e"))
    named = Resolver(directory=tmp_path, packages={"arm": "c/arm"}).around(str(urdf))
    for expected in (places[0], places[1], near, places[2]):
        assert named.resolve("package://arm/a.stl") == expected
        expected.unlink()


@pytest.mark.parametrize(
    ("name", "written"),
    [
        ("meshes/a.stl", "file:///{0}/meshes/a.stl"),
        ("meshes/a.stl", "file://{0}/meshes/a.stl"),
        ("meshes/a.stl", "file://localhost{0}/meshes/a.stl"),
        ("mesh es/ä#1.stl", "file://{0}/mesh%20es/%C3%A4%231.stl"),
        ("a%20b.stl", "file://{0}/a%20b.stl"),
        ("a%20b.stl", "package://arm/a%20b.stl"),
        ("a b.stl", "package://arm/a%20b.stl"),
        ("a.stl", "package:///arm/a.stl"),
        ("meshes/a.stl", "package://arm//meshes//a.stl"),
        ("a%20b.stl", "../a%20b.stl"),
    ],
)
def test_meshes_as_vendors_name_them(name: str, written: str, tmp_path: Path) -> None:
    """Four slashes, as xacro's $(find) makes them, and percent signs in URIs."""
    own = package(tmp_path / "arm", "arm")
    urdf, mesh = make(own, "urdf/arm.urdf"), make(own, name)
    resolver = Resolver(directory=tmp_path / "elsewhere").around(str(urdf))
    reference = written.format(own)
    assert resolver.resolve_from_urdf(reference, urdf.parent, own) == mesh


def test_percent_signs_are_no_way_out(tmp_path: Path) -> None:
    """What is decoded must stay in the package, too."""
    own = package(tmp_path / "arm", "arm")
    urdf = make(own, "urdf/arm.urdf")
    make(tmp_path, "secret.stl")
    resolver = Resolver(directory=tmp_path / "cells").around(str(urdf))
    for reference in (
        "package://arm/%2e%2e/secret.stl",
        f"file://{own}/%2e%2e/secret.stl",
    ):
        with pytest.raises(NotFoundError, match=r"points outside|not found"):
            resolver.resolve_from_urdf(reference, urdf.parent, own)


def test_a_file_in_a_neighbouring_package_may_be_absolute(tmp_path: Path) -> None:
    """$(find gripper) expands to a path; a package of another workspace does not do."""
    urdf = make(package(tmp_path / "ws" / "arm", "arm"), "urdf/arm.urdf")
    finger = make(package(tmp_path / "ws" / "tools", "gripper"), "f.stl")
    stranger = make(package(tmp_path / "a" / "b" / "c" / "d" / "x", "gripper"), "f.stl")
    resolver = Resolver(directory=tmp_path / "cells").around(str(urdf))
    root = urdf.parent.parent
    assert resolver.resolve_from_urdf(f"file:///{finger}", urdf.parent, root) == finger
    with pytest.raises(NotFoundError, match="points outside"):
        resolver.resolve_from_urdf(str(stranger), urdf.parent, root)


def test_a_path_of_another_machine_leads_into_the_package(tmp_path: Path) -> None:
    """A URDF that was expanded where its package was installed works as it is."""
    own = package(tmp_path / "arm-main", "arm")
    urdf, mesh = make(own, "urdf/arm.urdf"), make(own, "meshes/a.stl")
    resolver = Resolver(directory=tmp_path / "cells").around(str(urdf))

    def find(reference: str) -> Path:
        return resolver.resolve_from_urdf(reference, urdf.parent, own)

    assert find("file:///root/ws/install/arm/share/arm/meshes/a.stl") == mesh
    assert find("/home/me/ws/src/arm/meshes/a.stl") == mesh
    with pytest.raises(NotFoundError):
        find("file:///root/ws/install/leg/share/leg/meshes/a.stl")
    with pytest.raises(NotFoundError):
        find("file:///root/ws/share/arm/../../../../secret.stl")
