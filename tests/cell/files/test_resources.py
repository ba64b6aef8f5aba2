"""Finding files named in cells and URDFs."""

from __future__ import annotations

from pathlib import Path

import pytest

from reachmap.cell.files.resources import NotFoundError, Resolver, shipped_folder


@pytest.fixture(autouse=True)
def _no_search_paths(monkeypatch: pytest.MonkeyPatch) -> None:
    """Start from an environment without ROS."""
    for name in ("REACHMAP_PACKAGE_PATH", "ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        monkeypatch.delenv(name, raising=False)


def make(folder: Path, name: str) -> Path:
    """Create a file with its folders."""
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("x")
    return path


def test_packages_are_looked_up_in_the_documented_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Cell first, then the three variables; each is used once those before fail."""
    places = {
        "cell": make(tmp_path, "vendor/other-name/a.txt"),
        "reachmap": make(tmp_path, "r/pkg/a.txt"),
        "ros": make(tmp_path, "ros/pkg/a.txt"),
        "ament": make(tmp_path, "ament/share/pkg/a.txt"),
    }
    monkeypatch.setenv("REACHMAP_PACKAGE_PATH", f"{tmp_path}/none:{tmp_path}/r")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "ros"))
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "ament"))
    named = Resolver(directory=tmp_path, packages={"pkg": "vendor/other-name"})
    assert named.resolve("package://pkg/a.txt") == places["cell"]
    plain = Resolver(directory=tmp_path)
    for name in ("reachmap", "ros", "ament"):
        assert plain.resolve("package://pkg/a.txt") == places[name]
        places[name].unlink()
    with pytest.raises(NotFoundError, match="tried") as caught:
        plain.resolve("package://pkg/a.txt")
    for name in ("reachmap", "ros", "ament"):
        assert str(places[name]) in str(caught.value)


def test_a_ros_path_may_be_the_package_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """ROS 1 allows a package folder as an entry of its search path."""
    path = make(tmp_path, "pkg/a.txt")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "pkg"))
    assert Resolver(directory=tmp_path).resolve("package://pkg/a.txt") == path


def test_a_missing_package_lists_the_places_and_the_remedy(tmp_path: Path) -> None:
    """Every folder tried is named, and what to do."""
    with pytest.raises(NotFoundError, match=r"resources\.packages") as caught:
        Resolver(directory=tmp_path).resolve("package://nowhere/a.urdf")
    assert "cmeel.prefix" in str(caught.value)


def test_without_robot_data_the_message_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The distribution that holds the shipped arms is named."""
    monkeypatch.setattr("reachmap.cell.files.resources.data_folder", lambda: None)
    with pytest.raises(NotFoundError, match="pip install example-robot-data"):
        Resolver(directory=tmp_path).resolve("package://example-robot-data/a.urdf")


def test_robot_data_and_shipped_files_are_found(tmp_path: Path) -> None:
    """Neither depends on the folder of the cell."""
    resolver = Resolver(directory=tmp_path)
    name = "robots/ur_description/urdf/ur5_robot.urdf"
    assert resolver.resolve(f"package://example-robot-data/{name}").is_file()
    toy = resolver.resolve("package://reachmap-cells/planar-toy/planar_arm.urdf")
    assert toy.is_relative_to(shipped_folder())


@pytest.mark.parametrize("reference", ["a/b.stl", "./a/b.stl", "x/../a/b.stl"])
def test_relative_references_start_at_the_cell(tmp_path: Path, reference: str) -> None:
    """The current folder plays no part."""
    path = make(tmp_path, "a/b.stl")
    assert Resolver(directory=tmp_path).resolve(reference) == path


def test_absolute_and_file_references(tmp_path: Path) -> None:
    """Both name the same file."""
    path = make(tmp_path, "a/b.stl")
    resolver = Resolver(directory=Path("/"))
    assert resolver.resolve(str(path)) == resolver.resolve(f"file://{path}") == path


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        ("package://", "expected package://NAME/PATH"),
        ("package://pkg", "expected package://NAME/PATH"),
        ("package://pkg/../secret.txt", "points outside the package"),
        ("package://pkg/x/../../secret.txt", "points outside the package"),
        ("package://pkg/none.stl", "not found"),
        ("none.stl", "not found"),
        ("pkg", "not found"),
        ("a\0b", "not a file name"),
        ("x" * 6000, "not found"),
    ],
)
def test_bad_references_are_refused(
    tmp_path: Path, reference: str, message: str
) -> None:
    """Names that lead nowhere, or out of a package, give one clear sentence."""
    make(tmp_path, "pkg/a.txt")
    make(tmp_path, "secret.txt")
    resolver = Resolver(directory=tmp_path, packages={"pkg": "pkg"})
    with pytest.raises(NotFoundError, match=message):
        resolver.resolve(reference)


def test_a_urdf_reaches_only_its_own_root(tmp_path: Path) -> None:
    """../meshes is fine inside the package, beyond it is refused."""
    make(tmp_path, "cells/cell.yaml")
    mesh = make(tmp_path, "pkg/meshes/a.stl")
    make(tmp_path, "secret.stl")
    urdf = make(tmp_path, "pkg/urdf/arm.urdf")
    resolver = Resolver(directory=tmp_path / "cells", packages={"pkg": "../pkg"})
    path, root = resolver.resolve_robot("package://pkg/urdf/arm.urdf")
    assert (path, root) == (urdf, tmp_path / "pkg")

    def find(reference: str) -> Path:
        return resolver.resolve_from_urdf(reference, urdf.parent, root)

    assert find("../meshes/a.stl") == mesh
    assert find(f"file://{mesh}") == mesh
    assert find("package://pkg/meshes/a.stl") == mesh
    for reference in ("../../secret.stl", f"{tmp_path}/secret.stl", "/etc/passwd"):
        with pytest.raises(NotFoundError, match="points outside"):
            find(reference)
    with pytest.raises(NotFoundError, match="unknown scheme 'http'"):
        find("http://example.org/a.stl")


def test_the_root_of_a_urdf_given_by_path(tmp_path: Path) -> None:
    """The cell's folder if the URDF lies in it, else the folder above the URDF's."""
    inside = make(tmp_path, "cell/robots/urdf/arm.urdf")
    outside = make(tmp_path, "robot/urdf/arm.urdf")
    resolver = Resolver(directory=tmp_path / "cell")
    assert resolver.resolve_robot("robots/urdf/arm.urdf") == (inside, tmp_path / "cell")
    assert resolver.resolve_robot(str(outside)) == (outside, tmp_path / "robot")
