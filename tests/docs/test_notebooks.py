"""The notebooks run from their first cell to their last."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[2] / "docs" / "notebooks").glob("*.ipynb"))


def code_of(path: Path) -> str:
    """Code cells as a script; the last expression of each is shown as Jupyter does."""
    cells = json.loads(path.read_text())["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    return "import ast\n" + "\n".join(f"show({text!r})" for text in code)


SHOW = """
def show(text, names=globals()):
    tree = ast.parse(text)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "cell", "exec"), names)
    if last is not None:
        value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
        for way in ("_repr_html_", "_repr_png_"):
            if hasattr(value, way):
                assert getattr(value, way)()
"""


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(
    path: Path, tmp_path: Path, pytestconfig: pytest.Config
) -> None:
    """In a process of its own, in an empty folder, warnings being errors."""
    # What pytest was told to ignore, as with old dependencies, is ignored there, too.
    filters = ["error", *(pytestconfig.getoption("pythonwarnings") or [])]
    words = [f"-W{text}" for text in filters]
    done = subprocess.run(
        [sys.executable, *words, "-c", SHOW + code_of(path)],
        cwd=tmp_path,
        env={**os.environ, "TMPDIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_hold_no_outputs(path: Path) -> None:
    """Outputs are of a machine and a day; they are made by running it."""
    for cell in json.loads(path.read_text())["cells"]:
        assert not cell.get("outputs")
        assert cell.get("execution_count") is None


def test_there_are_three_notebooks() -> None:
    """A first map, an own cell, a picking loop."""
    assert [p.stem for p in NOTEBOOKS] == ["first-map", "own-cell", "picking-loop"]
