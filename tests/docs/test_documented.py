"""Documentation and program say the same."""

from __future__ import annotations

import re
from pathlib import Path

import cell_fields
import click
import pytest

from reachmap.cell.model.cell import Cell
from reachmap.cli import group
from reachmap.cli.group import COMMANDS
from reachmap.errors import ReachmapError

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
AVAILABLE = [name for name, entry in COMMANDS.items() if entry.is_available()]
TEXTS = [*PAGES, ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
each_text = pytest.mark.parametrize(
    "page", TEXTS, ids=[str(page.relative_to(ROOT)) for page in TEXTS]
)


@pytest.fixture(scope="module")
def cell_page() -> str:
    """The tables of the cell-file page as the documentation build makes them."""
    return cell_fields.markdown()


def test_every_cell_field_has_a_meaning() -> None:
    """A key without a description would be an empty row of the reference."""
    bare = [
        f"{paths[0]}.{name}".lstrip(".")
        for model, paths in cell_fields.distinct().items()
        for name, field in model.model_fields.items()
        if not cell_fields.meaning(model, name, field)
    ]
    assert not bare


def test_every_cell_field_is_in_the_reference(cell_page: str) -> None:
    """The page is made from the schema of the model, to the last key."""

    def keys(schema: object) -> set[str]:
        if isinstance(schema, dict):
            found = set(schema.get("properties", {}))
            return found.union(*map(keys, schema.values()))
        return set().union(*map(keys, schema)) if isinstance(schema, list) else set()

    for key in keys(Cell.model_json_schema()):
        assert f"| `{key}` |" in cell_page, key
    assert "{cell-fields}" in (DOCS / "reference" / "cell-file.md").read_text()


def test_cell_reference_states_limits_and_defaults(cell_page: str) -> None:
    """A row tells what is accepted and what happens when the key is left out."""
    row = next(
        line for line in cell_page.splitlines() if line.startswith("| `scaling`")
    )
    assert "number > 0, ≤ 1" in row
    assert "`1.0`" in row


def test_command_reference_is_generated_from_the_group() -> None:
    """sphinx-click documents whatever the group lists, with every option."""
    text = (DOCS / "reference" / "cli.md").read_text()
    assert ".. click:: reachmap.cli:group" in text
    assert ":nested: full" in text


@pytest.mark.parametrize("name", AVAILABLE)
def test_every_command_is_shown_in_use(name: str) -> None:
    """Besides the reference, a page or the README uses each command."""
    texts = [page.read_text() for page in [*PAGES, ROOT / "README.md"]]
    assert any(re.search(rf"reachmap {name}\b|`{name}\b", text) for text in texts)


# What it prints is about the shell; there is nothing to call from Python.
@pytest.mark.parametrize("name", [n for n in AVAILABLE if n != "completion"])
def test_every_tool_is_in_the_library_reference(name: str) -> None:
    """What a command does can be called from Python, and is documented as such."""
    text = (DOCS / "reference" / "api" / "tools.md").read_text()
    assert f"reachmap.tools.{name.replace('-', '_')}\n" in text


def command_lines(text: str) -> list[list[str]]:
    """Words of every line in a code block that begins with `reachmap`."""
    blocks = re.findall(r"```(?:console|sh|bash)\n(.*?)```", text, flags=re.DOTALL)
    joined = "\n".join(blocks).replace("\\\n", " ")
    lines = re.findall(r"^\s*(?:\$ )?reachmap (.*)$", joined, flags=re.MULTILINE)
    return [
        line.split(" #")[0].split(" > ")[0].split(" | ")[0].split() for line in lines
    ]


@each_text
def test_shown_commands_and_options_exist(page: Path) -> None:
    """No page shows a command or an option that the program does not have."""
    for words in command_lines(page.read_text()):
        name = next((word for word in words if not word.startswith("-")), None)
        if name is None:
            continue
        assert name in COMMANDS, f"reachmap {name}"
        command = group.get_command(click.Context(group), name)
        if command is None:
            pytest.skip(f"{name} is not there yet")
        known = {flag for parameter in command.params for flag in parameter.opts}
        known |= {flag for p in command.params for flag in p.secondary_opts}
        used = {word.split("=")[0] for word in words if re.match(r"--?[a-zA-Z]", word)}
        assert used <= known | {"--help"}, f"reachmap {' '.join(words)}"


@each_text
def test_links_lead_to_files(page: Path) -> None:
    """Relative links work in the repository as well as in the built pages."""
    for target in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text()):
        if "://" not in target:
            assert (page.parent / target).exists(), target


@each_text
def test_text_holds_no_leftovers(page: Path) -> None:
    """No notes to self, no addresses of the machine it was written on."""
    text = page.read_text()
    assert not re.search(r"\b(TODO|FIXME|XXX|TBD)\b|/(?:work|root|tmp)/", text)


def test_every_exit_code_is_documented() -> None:
    """The table of exit codes covers all errors a user can meet."""
    text = (DOCS / "reference" / "cli.md").read_text()
    waiting = [ReachmapError]
    while waiting:
        error = waiting.pop()
        waiting += error.__subclasses__()
        assert f"* - {error.exit_code}\n" in text, error


def test_every_page_is_reached_from_the_index() -> None:
    """Each page is named in a table of contents, itself or by its folder."""
    index = (DOCS / "index.md").read_text()
    for page in PAGES:
        relative = page.relative_to(DOCS).with_suffix("")
        if relative.parts[0] in {"index", "images"}:
            continue
        folder = relative.parent
        if folder.name == "api":
            text = (DOCS / "reference" / "api" / "index.md").read_text()
            assert relative.name == "index" or relative.name in text, relative
        else:
            assert f"{relative}\n" in index or f"{folder}/*" in index, relative
