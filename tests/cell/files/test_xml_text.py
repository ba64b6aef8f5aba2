"""XML as published robot descriptions write it."""

from __future__ import annotations

from pathlib import Path

import pinocchio as pin
import pytest

from reachmap.cell.files.robot_text import parse_xml, read_xml
from reachmap.cell.files.urdf import parse_urdf
from reachmap.errors import CellError

ARM = (
    '<robot name="ärm"><link name="a"/><link name="b"/>'
    '<joint name="j" type="revolute"><parent link="a"/><child link="b"/>'
    '<limit lower="-1" upper="1" velocity="1" effort="1"/></joint>{}</robot>'
)
PLAIN = ARM.format("")
DECLARED = '<?xml version="1.0" encoding="{}"?>\n'


@pytest.mark.parametrize(
    "data",
    [
        PLAIN.encode(),
        b"\xef\xbb\xbf" + PLAIN.encode(),
        ("\n \r\n" + DECLARED.format("utf-8") + PLAIN).encode(),
        ("<!-- a -->\n<!-- b -->" + DECLARED.format("utf-8") + PLAIN).encode(),
        ("<!-- \xe4 -->" + DECLARED.format("latin-1") + PLAIN).encode("latin-1"),
        ("<!-- a -->" + PLAIN).encode(),
        (DECLARED.format("ISO-8859-1") + PLAIN).encode("latin-1"),
        (DECLARED.format("windows-1252") + PLAIN).encode("cp1252"),
        PLAIN.encode("utf-16"),
        (DECLARED.format("UTF-16") + PLAIN).encode("utf-16"),
        ("<?xml version='1.0'?><!DOCTYPE robot>" + PLAIN).encode(),
        ('<!DOCTYPE robot SYSTEM "urdf.dtd">' + PLAIN).encode(),
        ("<!DOCTYPE robot [<!ELEMENT robot ANY>\n]>\n" + PLAIN).encode(),
    ],
)
def test_one_robot_however_it_is_written(data: bytes, tmp_path: Path) -> None:
    """Marks, blanks, encodings and document types change neither reader's robot."""
    path = tmp_path / "arm.urdf"
    path.write_bytes(data)
    text = read_xml(path, limit=10_000)
    assert parse_urdf(text, "arm") == parse_urdf(PLAIN, "arm")
    assert parse_urdf(text, "arm").name == "ärm"
    assert list(pin.buildModelFromXML(text).names) == ["universe", "j"]


def test_a_usual_text_is_left_as_it_is(tmp_path: Path) -> None:
    """Fingerprints of cells hang on the text."""
    text = DECLARED.format("UTF-8") + "<!-- c -->\n" + PLAIN + "\n\n"
    (tmp_path / "arm.urdf").write_text(text, encoding="utf-8")
    assert read_xml(tmp_path / "arm.urdf", limit=10_000) == text


def test_prefixes_that_nobody_bound_are_read() -> None:
    """Gazebo's elements of old are kept, with their prefix."""
    inner = '<gazebo><sensor:camera name="c"><x>1</x></sensor:camera></gazebo>'
    root = parse_xml(ARM.format(inner), "arm")
    found = root.find("gazebo")
    assert found is not None
    assert [(e.tag, dict(e.attrib)) for e in found] == [
        ("sensor:camera", {"name": "c"})
    ]
    assert found[0].findtext("x") == "1"


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (PLAIN.encode("latin-1"), r"arm\.urdf:1:1: expected UTF-8 text .*declared"),
        ((DECLARED.format("ascii") + PLAIN).encode(), "expected ASCII text"),
        ((DECLARED.format("klingon") + PLAIN).encode(), "unknown encoding 'klingon'"),
        ((DECLARED.format("zip") + PLAIN).encode(), "unknown encoding 'zip'"),
    ],
)
def test_other_encodings_are_refused(data: bytes, message: str, tmp_path: Path) -> None:
    """Nothing is guessed: the file says what it is."""
    (tmp_path / "arm.urdf").write_bytes(data)
    with pytest.raises(CellError, match=message):
        read_xml(tmp_path / "arm.urdf", limit=10_000)


@pytest.mark.parametrize(
    "text",
    [
        '<!DOCTYPE r [<!ENTITY a "b">]><robot>&a;</robot>',
        '<!DOCTYPE r [<!ENTITY % a SYSTEM "file:///etc/passwd"> %a;]><robot/>',
        '<!DOCTYPE r SYSTEM "x.dtd"><robot>&a;</robot>',
        '<!DOCTYPE r [<!ENTITY a SYSTEM "file:///etc/passwd">]><robot>&a;</robot>',
    ],
)
def test_entities_are_refused(text: str, tmp_path: Path) -> None:
    """Neither bombs nor files of this machine come in through XML."""
    (tmp_path / "arm.urdf").write_text(text)
    with pytest.raises(CellError, match="entities"):
        parse_xml(read_xml(tmp_path / "arm.urdf", limit=10_000), "arm")
