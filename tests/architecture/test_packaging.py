"""What is installed is what is in the tree."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import reachmap

ROOT = Path(__file__).parents[2]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
SETUPTOOLS = PYPROJECT["tool"]["setuptools"]


def test_every_package_folder_is_listed() -> None:
    """A folder missing from `packages` would silently be missing from the wheel."""
    found = set()
    for package, folder in SETUPTOOLS["package-dir"].items():
        for init in (ROOT / folder).rglob("__init__.py"):
            parts = init.parent.relative_to(ROOT / folder).parts
            found.add(".".join([package, *parts]))
    assert sorted(SETUPTOOLS["packages"]) == sorted(found)


def test_every_module_is_in_a_package() -> None:
    """A folder without __init__.py would not be installed."""
    for folder in SETUPTOOLS["package-dir"].values():
        for path in (ROOT / folder).rglob("*.py"):
            assert (path.parent / "__init__.py").exists(), path


def test_data_files_are_package_data() -> None:
    """Cells, meshes and schemas reach the wheel."""
    patterns = {
        SETUPTOOLS["package-dir"][name]: globs
        for name, globs in SETUPTOOLS["package-data"].items()
    }
    for folder, globs in patterns.items():
        covered = {path for glob in globs for path in (ROOT / folder).glob(glob)}
        for path in (ROOT / folder).rglob("*"):
            if path.is_file() and path.suffix not in {".py", ".pyc"}:
                assert path in covered, path


def test_distribution_and_import_name_differ_on_purpose() -> None:
    """The name `reachmap` on PyPI is another project's; nothing says to install it."""
    assert PYPROJECT["project"]["name"] == "reachmap-cells"
    texts = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    for path in texts:
        assert not re.search(r"pip install reachmap(?!-)", path.read_text()), path


def test_versions_agree() -> None:
    """Package and citation file carry one version."""
    citation = (ROOT / "CITATION.cff").read_text()
    assert f"\nversion: {reachmap.__version__}\n" in citation
    assert "## [Unreleased]" in (ROOT / "CHANGELOG.md").read_text()


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel built from the sdist, as a package index would get it."""
    folder = tmp_path_factory.mktemp("dist")
    command = [
        sys.executable,
        "-m",
        "build",
        "--no-isolation",
        "--outdir",
        str(folder),
        str(ROOT),
    ]
    subprocess.run(command, check=True, capture_output=True, timeout=250)
    (path,) = folder.glob("*.whl")
    return path


def test_the_wheel_works_without_the_tree(wheel: Path, tmp_path: Path) -> None:
    """Installed into a fresh environment, the command finds cli and cells."""
    environment = tmp_path / "venv"
    subprocess.run(
        [sys.executable, "-m", "venv", "--without-pip", str(environment)], check=True
    )
    python = environment / "bin" / "python"
    (site,) = environment.glob("lib/python*/site-packages")
    install = [
        *(sys.executable, "-m", "pip", "install", "--quiet", "--no-deps"),
        *("--disable-pip-version-check", "--target", str(site), str(wheel)),
    ]
    subprocess.run(install, check=True)
    # The engines come from this environment; reachmap itself must not, and its
    # editable finder stays behind because .pth files in this folder are not read.
    engines = Path(reachmap_dependencies())
    (site / "engines.pth").write_text(f"{engines}\n")

    def run(*arguments: str) -> str:
        return subprocess.run(
            [str(python), "-I", *arguments],
            cwd=tmp_path, check=True, capture_output=True, text=True,
        ).stdout  # fmt: skip

    where = run("-c", "import reachmap; print(reachmap.__file__)").strip()
    assert Path(where).is_relative_to(site)
    assert "workspace-scan" in run("-m", "reachmap", "--help")
    assert "ur5-eye-in-hand" in run("-m", "reachmap", "cells")


def reachmap_dependencies() -> str:
    """The site-packages folder that the engines are installed in."""
    import h5py

    return str(Path(h5py.__file__).parents[1])
