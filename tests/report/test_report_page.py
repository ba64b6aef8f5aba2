"""``reachmap report``: all sections, what is missing, and nothing from elsewhere."""

from __future__ import annotations

import dataclasses
import json
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from reachmap.cli import group
from reachmap.maps import write_bin_map, write_placement, write_workspace_map
from reachmap.maps.study.format import read_study
from reachmap.maps.study.words import sentence
from reachmap.maps.summary.statistics import saturation_of
from reachmap.report.page import CONTENTS
from tests.support.synthetic_maps import (
    synthetic_bin_map,
    synthetic_placement,
    synthetic_provenance,
)
from tests.support.toy_artefacts import toy_bin_map, toy_workspace

DRAWINGS = {
    "maps": ("draw_level", "draw_overview", "draw_placement", "draw_approach",
                  "draw_reachability", "draw_costs", "draw_saturation",
                  "draw_directions", "draw_clearance"),
    "cause": ("draw_causes",),
    "ranking": ("ranking_chart",),
    "study": ("study_album",),
}  # fmt: skip
VOID = {"meta", "img", "br", "link"}


class Outline(HTMLParser):
    """Checks that elements nest, and gathers text, ids, images and links."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.sources: list[str] = []
        self.links: list[str] = []
        self.tags: set[str] = set()
        self.text = ""
        self.feed(page)
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note ids, sources and links."""
        self.tags.add(tag)
        said = dict(attrs)
        self.ids += [v for k, v in attrs if k == "id" and v]
        self.sources += [v for k, v in attrs if k == "src" and v]
        if tag == "a":
            self.links.append(said.get("href") or "")
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        """Elements close in the order they were opened."""
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        """Gather what people read."""
        if self.open[-1:] != ["style"]:
            self.text += data


def run(*arguments: object) -> Result:
    """Run the command in this process."""
    return CliRunner().invoke(group, ["report", *map(str, arguments)])


def page_of(folder: Path, tmp_path: Path, name: str = "report.html") -> str:
    """The page of a folder."""
    result = run(folder, "-o", tmp_path / name)
    assert result.exit_code == 0, result.output
    return (tmp_path / name).read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def finished_page(finished_run: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The page of a complete run, drawn once."""
    with pytest.MonkeyPatch.context() as patch:
        draw_coarsely(patch)
        return page_of(finished_run, tmp_path_factory.mktemp("page"))


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the drawing out where only words matter."""
    leave_drawing_out(monkeypatch)


@pytest.fixture(scope="module")
def toy_page(tmp_path_factory: pytest.TempPathFactory) -> Outline:
    """The page of a real run on the toy arm, without placement and lists."""
    folder = tmp_path_factory.mktemp("toy")
    write_workspace_map(folder / "w.h5", toy_workspace())
    write_bin_map(folder / "bin.h5", toy_bin_map())
    with pytest.MonkeyPatch.context() as patch:
        leave_drawing_out(patch)
        draw_coarsely(patch)
        return Outline(page_of(folder, folder))


def leave_drawing_out(patch: pytest.MonkeyPatch) -> None:
    """Every picture but that of the cell."""
    for part, names in DRAWINGS.items():
        for name in names:
            patch.setattr(f"reachmap.report.parts.{part}.{name}", lambda *a, **k: [])
    patch.setattr(
        "reachmap.report.blocks.figure_bytes", lambda *a, **k: b"\x89PNG" + bytes(20)
    )


def draw_coarsely(patch: pytest.MonkeyPatch) -> None:
    """Pixels are most of the time."""
    patch.setattr("reachmap.plots.parts.style.DPI", 40)
    patch.setattr("reachmap.plots.cell.cell_view.PIXELS_PER_IN", 20.0)


def test_a_finished_run_has_every_section(finished_page: str) -> None:
    """With its answers first, links that lead somewhere, and nothing missing."""
    outline = Outline(finished_page)
    assert outline.ids == list(CONTENTS)
    assert outline.links == [f"#{anchor}" for anchor in CONTENTS]
    assert "not known yet" not in outline.text
    assert "does not rest on" not in outline.text
    assert len(outline.sources) >= 9


def test_the_page_asks_for_nothing(finished_page: str) -> None:
    """No script, no address, pictures inside; the browser is told so as well."""
    page = finished_page
    outline = Outline(page)
    assert not outline.tags & {"script", "link", "iframe", "object", "video", "base"}
    assert all(s.startswith("data:image/png;base64,") for s in outline.sources)
    assert not re.search(r"(https?:)?//[a-z]", re.sub(r"base64,[^\"]*", "", page))
    assert "url(" not in page
    assert "@import" not in page
    assert "default-src 'none'" in page


@pytest.mark.usefixtures("undrawn")
def test_equal_runs_give_equal_pages(finished_run: Path, tmp_path: Path) -> None:
    """No clock, no random order."""
    first = page_of(finished_run, tmp_path, "a.html")
    assert first == page_of(finished_run, tmp_path, "b.html")


def test_the_answers_are_those_of_the_maps(
    finished_run: Path, finished_page: str
) -> None:
    """Share and interval of the bin, score and place of the placement, first picks."""
    text = Outline(finished_page).text
    found = saturation_of(synthetic_bin_map(0.6))
    assert f"{found.share[-1]:.1f} %" in text
    assert f"{found.low[-1]:.1f} to {found.high[-1]:.1f} %" in text
    assert "x\N{NO-BREAK SPACE}+0.500, y\N{NO-BREAK SPACE}+0.100" in text
    assert "96.5 % of the tool orientations" in text
    assert "80 mm off before" in text
    best = json.loads((finished_run / "ranked.json").read_text())["grasps"][0]
    assert best["id"] in text


@pytest.mark.usefixtures("undrawn")
def test_a_bin_on_a_table_may_be_off_in_the_plane(tmp_path: Path) -> None:
    """It cannot sink into the table, and its place is in the frame of the levels."""
    folder = tmp_path / "run"
    folder.mkdir()
    margin = {"+x": 0.12, "-x": 0.08, "+z": 0.1, "-z": 0.0, "+yaw": 0.4}
    hung = np.diag([1.0, -1.0, -1.0, 1.0])
    placed = synthetic_placement(margin=margin, T_world_base=hung, T_base_level=hung)
    bin_pose = hung @ placed.bin_pose
    for support, room_mm in (("table", 80), ("", 0)):
        write_placement(
            folder / "placement.h5",
            dataclasses.replace(placed, bin_pose=bin_pose, support=support),
            overwrite=True,
        )
        text = Outline(page_of(folder, tmp_path, f"{room_mm}.html")).text
        assert f"It may be {room_mm} mm off before" in text
        assert "Metres in world, turned by" in text


def test_the_validation_is_reported(finished_page: str) -> None:
    """Shares with intervals; what is null or empty is a dash."""
    text = Outline(finished_page).text
    assert "97.0 % (92.0 to 99.0)" in text
    assert "+0.61" in text
    assert "cheaper than the supplied ones in 1 of 1 groups" in text


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(
    ("missing", "section", "said"),
    [
        ("workspace.h5", "workspace", "There is no workspace map"),
        ("placement.h5", "placement", "There is no placement"),
        ("bin.h5", "bin", "There is no bin map"),
        ("ranked.json", "ranking", "There is no ranked grasp list"),
        ("validation.json", "validation", "reachmap validate"),
    ],
)
def test_what_is_missing_is_said(
    finished_run: Path, tmp_path: Path, missing: str, section: str, said: str
) -> None:
    """The page names the file and the command that makes it, and goes on."""
    folder = tmp_path / "run"
    shutil.copytree(finished_run, folder)
    (folder / missing).unlink()
    outline = Outline(page_of(folder, tmp_path))
    assert section not in outline.ids
    assert f"{missing} is not in this folder" in outline.text
    assert said in outline.text


@pytest.mark.usefixtures("undrawn")
def test_damaged_and_foreign_files_are_said(finished_run: Path, tmp_path: Path) -> None:
    """A truncated map is left out; one that was made from others is named."""
    folder = tmp_path / "run"
    shutil.copytree(finished_run, folder)
    data = (folder / "workspace.h5").read_bytes()
    (folder / "workspace.h5").write_bytes(data[: len(data) // 2])
    (folder / "validation.json").write_text('{"lists": 3}')
    stranger = dataclasses.replace(
        synthetic_bin_map(0.5, seed=7),
        provenance=synthetic_provenance(source_sha256="f" * 64),
    )
    write_bin_map(folder / "bin.h5", stranger, overwrite=True)
    outline = Outline(page_of(folder, tmp_path))
    assert "not used: workspace.h5" in outline.text
    assert "validation.json: no validation" in outline.text
    assert "bin.h5 was not made from this placement.h5" in outline.text
    assert "ranked.json was not ranked with this bin.h5" in outline.text
    assert str(tmp_path) not in outline.text


@pytest.mark.usefixtures("undrawn")
def test_names_cannot_put_anything_on_the_page(tmp_path: Path) -> None:
    """Ids of grasps, names of files and folders are text, whatever they hold."""
    evil = '<img src="http://evil.example/x" onerror="alert(1)">'
    folder = tmp_path / "a<b>&c"
    folder.mkdir()
    record = dataclasses.replace(
        synthetic_bin_map(0.6), body_pairs=("a<i>b | c", "d | e&f", "g | h")
    )
    write_bin_map(folder / "bin.h5", record)
    document = {
        "grasps": [
            {
                "id": evil,
                "quadrant": evil,
                "reachmap": {"rank": 1, "original_rank": 1, "cost": 0.5, "status": evil,
                             "terms": {"path_length": 0.5}},
            }
        ],
        "reachmap": {"weights": [evil, 1.0]},
    }  # fmt: skip
    (folder / "ranked.json").write_text(json.dumps(document))
    (folder / "validation.json").write_text(
        json.dumps({"lists": [{"list": evil}], "groups": [], "repeats": evil})
    )
    page = page_of(folder, tmp_path)
    outline = Outline(page)
    assert '<img src="http' not in page
    assert all(s.startswith("data:") for s in outline.sources)
    assert "<i>" not in page
    assert evil in outline.text


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(
    "document",
    [
        "[]", "{}", "3", "null", '{"grasps": [], "reachmap": {}}',
        '{"grasps": [1, {"reachmap": null}, {"id": 3}], "reachmap": {"weights": 5}}',
        '{"grasps": [{"reachmap": {"cost": "x", "terms": [1]}}], "reachmap": {}}',
        '{"grasps": [{"reachmap": {"original_rank": null}}], "reachmap": {}}',
        "not json",
    ],
)  # fmt: skip
def test_strange_lists_do_not_stop_the_page(tmp_path: Path, document: str) -> None:
    """A list is data from elsewhere: it is shown, in part or whole, or left out."""
    write_bin_map(tmp_path / "bin.h5", synthetic_bin_map(0.6, shape=(1, 2, 2, 3, 1)))
    for name in ("ranked.json", "validation.json"):
        (tmp_path / name).write_text(document)
    assert "bin" in Outline(page_of(tmp_path, tmp_path)).ids


def test_the_cell_of_a_real_run_is_drawn(toy_page: Outline) -> None:
    """With its bodies and its scan configuration in degrees."""
    assert "cannot be drawn" not in toy_page.text
    assert "drawn to scale" in toy_page.text
    assert "cylinder r 0.01 m, length 0.1 m" in toy_page.text
    assert "joint_1 60.0°" in toy_page.text


def test_an_artefact_may_have_another_name(toy_page: Outline) -> None:
    """If it is the only one of its kind."""
    assert "workspace" in toy_page.ids
    assert "w.h5" in toy_page.text
    assert "workspace.h5 is not" not in toy_page.text


def test_what_stands_in_the_way_is_named(toy_page: Outline) -> None:
    """The pair that blocks most, in words."""
    assert "Most often in the way: link_1 against post" in toy_page.text


def test_a_cell_that_is_not_here_is_said(finished_page: str) -> None:
    """The numbers are worth a page even where the robot's files are missing."""
    text = Outline(finished_page).text
    assert "The cell cannot be drawn here" in text


def test_folders_without_artefacts_are_refused(tmp_path: Path) -> None:
    """With one line, exit code 2 and no page."""
    from reachmap.errors import MapFileError
    from reachmap.tools.report import report

    with pytest.raises(MapFileError, match="can be used"):
        report(tmp_path, output=tmp_path / "r.html")
    with pytest.raises(MapFileError, match="no such folder"):
        report(tmp_path / "none", output=tmp_path / "r.html")
    (tmp_path / "bin.h5").touch()
    with pytest.raises(MapFileError, match="made of the folder that holds it"):
        report(tmp_path / "bin.h5", output=tmp_path / "r.html")
    assert not (tmp_path / "r.html").exists()


@pytest.mark.usefixtures("undrawn")
def test_a_page_is_not_overwritten(finished_run: Path, tmp_path: Path) -> None:
    """Unless that is asked for."""
    (tmp_path / "report.html").write_text("mine")
    assert run(finished_run, "-o", tmp_path / "report.html").exit_code != 0
    assert (tmp_path / "report.html").read_text() == "mine"
    result = run(finished_run, "-o", tmp_path / "report.html", "--overwrite")
    assert result.exit_code == 0


@pytest.mark.usefixtures("undrawn")
def test_a_study_is_reported_with_its_sentences(
    finished_run: Path, tmp_path: Path
) -> None:
    """The best variant, by itself as well: then nothing else is asked for."""
    folder = tmp_path / "alone"
    folder.mkdir()
    shutil.copy(finished_run / "study.h5", folder)
    study = read_study(folder / "study.h5")
    whole = Outline(page_of(finished_run, tmp_path, "whole.html"))
    alone = Outline(page_of(folder, tmp_path, "alone.html"))
    for outline in (whole, alone):
        assert sentence(study, 1, 0) in outline.text
        assert "not distinguishable from" in outline.text
        assert f"{study.objective[1, 0]:.1f} % (" in outline.text
    assert alone.ids == ["cell", "study", "provenance"]
    assert "is not in this folder" not in alone.text
    assert "not known yet" not in alone.text
