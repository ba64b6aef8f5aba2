"""Load carriers: their figures, and cells that name one."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from reachmap.cell.bins.carriers import carriers, find_carrier
from reachmap.cell.loading import cell_from_json, cell_from_text, read_cell
from reachmap.cli import group
from reachmap.errors import CellError

TOY = Path(__file__).parents[2] / "cells" / "planar-toy.yaml"
WIKIPEDIA = "Wikipedia, 'Euro container' (module), 'Kleinladungsträger' (heights)"
TOTES = "tysonsupplychain.com, 'ESD corrugated bin dimensions chart'"
GITTERBOX = "lagerwiki.de and mhv.systems, 'Gitterbox'"
COLLARS = "sapril.cz, 'EUR pallets'; ronsun-ecopallet.com on collars"
# Outer and inner sizes [mm] as published, and where; None where nothing was found.
PUBLISHED = {
    "KLT-3147": ((297, 198, 147.5), (243, 162, None), WIKIPEDIA),
    "KLT-4147": ((396, 297, 147.5), (346, 265, None), WIKIPEDIA),
    "KLT-4322": ((396, 297, 213), (346, 265, 175), "bekuplast.com, VDA-R-KLT 4322"),
    "KLT-4280": ((396, 297, 280), (346, 265, None), WIKIPEDIA),
    "KLT-4329": ((396, 297, 280), (346, 265, None), WIKIPEDIA),
    "KLT-6147": ((594, 396, 147.5), (544, 364, None), WIKIPEDIA),
    "KLT-6280": ((594, 396, 280), (544, 364, None), WIKIPEDIA),
    "KLT-6422": ((594, 396, 213), (544, 364, None), WIKIPEDIA),
    "KLT-6429": ((594, 396, 280), (544, 364, None), WIKIPEDIA),
    "KLT-6410": ((600, 400, 280), (535, 357, 257), "Wikipedia, 'Kleinladungsträger'"),
    "EURO-4322": ((400, 300, 220), (370, 270, 215), "docs.baslerweb.com, load carrier"),
    "EURO-8632": ((800, 600, None), (752, 552, None), WIKIPEDIA),
    "GITTERBOX": ((1240, 835, 970), (1200, 800, 800), GITTERBOX),
    "EUR-COLLAR-200": ((1200, 800, 344), (None, None, 200), COLLARS),
    "TOTE-SMALL": ((110, 100, 80), (100, 90, 70), TOTES),
    "TOTE-MEDIUM": ((230, 150, 125), (215, 135, 115), TOTES),
    "TOTE-LARGE": ((350, 210, 150), (335, 195, 140), TOTES),
    "TOTE-JUMBO": ((450, 300, 175), (435, 285, 165), TOTES),
}


def toy(bin_lines: str) -> str:
    """The planar toy with another bin."""
    text = TOY.read_text()
    begin = text.index("bin:\n")
    end = text.index("scan_configuration:")
    return f"{text[:begin]}bin:\n{bin_lines}{text[end:]}"


def load(bin_lines: str):
    """Load the toy with another bin."""
    return cell_from_text(toy(bin_lines), label="toy.yaml", directory=TOY.parent)


@pytest.mark.parametrize("name", PUBLISHED)
def test_sizes_are_those_published(name: str) -> None:
    """Typed here from the sources; what is derived is not compared, but said."""
    carrier = find_carrier(name)
    assert carrier is not None
    outer, inner, _ = PUBLISHED[name]
    for found, wanted in zip(
        (*carrier.outer_mm, *carrier.inner_mm), (*outer, *inner), strict=True
    ):
        assert wanted is None or found == wanted
    assert carrier.source
    assert carrier.derived or None not in (*outer, *inner)


def test_eight_carriers_have_every_size_in_print() -> None:
    """Of the other KLTs the depth is derived; a maker's box tells how well."""
    complete = [n for n, (o, i, _) in PUBLISHED.items() if None not in (*o, *i)]
    assert len(complete) >= 8
    ribbed = find_carrier("KLT-6422")
    assert ribbed is not None
    assert ribbed.inner_mm[2] == pytest.approx(175.7, abs=1)


def test_walls_and_bottom_fill_the_room_between_inside_and_outside() -> None:
    """For every carrier; names are unique, whatever their case."""
    names = [name for c in carriers() for name in (c.name, *c.also)]
    assert len({name.casefold() for name in names}) == len(names)
    for c in carriers():
        for axis in (0, 1):
            assert c.inner_mm[axis] + 2 * c.wall_mm[axis] == c.outer_mm[axis], c.name
        assert c.inner_mm[2] + c.bottom_mm == c.outer_mm[2], c.name


@pytest.mark.parametrize("name", ["KLT-6428", "klt 6428", "Klt_6428"])
def test_a_carrier_stands_for_its_dimensions(name: str) -> None:
    """The resolved cell has them written out, and is the same cell without the name."""
    named = load(f"  carrier: {name}\n  pose: {{xyz: [1, 0, 0]}}\n")
    plain = load(
        "  inner: [0.544, 0.364, 0.262]\n  wall: [0.025, 0.016]\n  bottom: 0.018\n"
        "  pose: {xyz: [1, 0, 0]}\n"
    )
    assert named.cell.bin.carrier == "KLT-6428"
    assert named.sha256 == plain.sha256
    assert named.cell.bin.outer == pytest.approx((0.594, 0.396, 0.28))
    again = cell_from_json(named.resolved_json, urdf=named.urdf, srdf=named.srdf)
    assert again.cell == named.cell


def test_what_the_cell_says_itself_wins() -> None:
    """And of two overrides, what the more particular one says."""
    assert load("  carrier: KLT-6428\n  bottom: 0.02\n").cell.bin.bottom == 0.02
    changed = read_cell("planar-toy", ["bin.carrier=KLT-4147", "bin.bottom=0.02"])
    assert changed.cell.bin.inner == (0.346, 0.265, 0.1295)
    assert changed.cell.bin.bottom == 0.02


def test_an_override_changes_the_carrier_of_a_stored_cell() -> None:
    """Dimensions of the former one do not stay behind."""
    kept = load("  carrier: KLT-6428\n")
    other = cell_from_json(
        kept.resolved_json,
        urdf=kept.urdf,
        srdf=kept.srdf,
        changes=["bin.carrier=EURO-4322"],
    )
    assert other.cell.bin.inner == (0.37, 0.27, 0.215)
    assert other.cell.bin.walls == (0.015, 0.015)


@pytest.mark.parametrize("change", ["bin.carrier=5", "bin.carrier=[KLT-6428]"])
def test_a_carrier_that_is_no_name_is_one_mistake(change: str) -> None:
    """That the bin has no size then is not reported as well."""
    with pytest.raises(CellError, match=r"bin\.carrier: expected text") as caught:
        cell_from_text(
            toy("  carrier: KLT-6428\n"),
            label="toy.yaml",
            directory=TOY.parent,
            overrides=[change],
        )
    assert len(caught.value.lines) == 1


def test_unknown_names_are_reported_with_the_nearest() -> None:
    """One line that names file, line, key and the carrier that may be meant."""
    with pytest.raises(CellError) as caught:
        load("  carrier: KLT-6482\n")
    assert len(caught.value.lines) == 1
    assert "toy.yaml:" in str(caught.value)
    assert "bin.carrier: no carrier 'KLT-6482'; did you mean 'KLT-64" in str(
        caught.value
    )
    with pytest.raises(CellError, match=r"bin\.inner: is missing"):
        load("  wall: 0.01\n")


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("  heap: 0.3\n", "heap must lie in the bin"),
        ("  rim: {width: 0.01, height: 0.4}\n", r"rim\.height must be at most"),
        ("  wall: [0.01]\n", r"bin\.wall\.1|a value is missing"),
        ("  inner_top: [0.3, 0]\n", r"bin\.inner_top\.1: expected a number > 0"),
    ],
)
def test_what_no_bin_can_have_is_refused(lines: str, message: str) -> None:
    """With the key to blame."""
    with pytest.raises(CellError, match=message):
        load(f"  inner: [0.3, 0.2, 0.2]\n{lines}")


def test_carriers_are_listed() -> None:
    """Every one with its sizes; with --json also source and what is derived."""
    text = CliRunner().invoke(group, ["carriers"])
    rows = json.loads(CliRunner().invoke(group, ["carriers", "--json"]).stdout)
    assert [row["name"] for row in rows["carriers"]] == [c.name for c in carriers()]
    assert all(row["source"] for row in rows["carriers"])
    assert len(text.stdout.splitlines()) == len(carriers()) + 1
    assert "544 x 364 x 262" in text.stdout
