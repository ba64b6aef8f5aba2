"""YAML to plain data with places."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML

from reachmap.cell.text.yaml_reader import (
    MAX_DEPTH,
    MAX_TEXT_BYTES,
    parse_yaml,
    read_text,
    scalar_value,
)
from reachmap.errors import CellError


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 0.001),
        ("012", 12),
        ("1:30", "1:30"),
        ("no", "no"),
        ("on", "on"),
        ("-7", -7),
        (".5", 0.5),
        ("3.", 3.0),
        ("true", True),
        ("~", None),
        ("", None),
        ("1_000", "1_000"),
        ("0x1F", "0x1F"),
        ("2001-01-01", "2001-01-01"),
        ("-.inf", -math.inf),
    ],
)
def test_unquoted_scalars_follow_yaml_1_2(text: str, value: object) -> None:
    """The surprises of YAML 1.1 (octal, sexagesimal, no, dates) stay out."""
    found = scalar_value(text)
    assert found == value
    assert type(found) is type(value)


def test_quoted_numbers_are_text() -> None:
    """A version in quotes is no number."""
    assert parse_yaml("{a: \"1.0\", b: '2', c: 1.0}", "x").data == {
        "a": "1.0",
        "b": "2",
        "c": 1.0,
    }


def test_every_value_has_its_place() -> None:
    """Lines and columns count from 1 and point at the value, or at the key."""
    text = "a:\n  - 1\n  - {b: [x, y]}\nlong key: 5\n"
    document = parse_yaml(text, "cell.yaml")
    assert document.data == {"a": [1, {"b": ["x", "y"]}], "long key": 5}
    assert str(document.place(("a", 1, "b", 1))) == "cell.yaml:3:13"
    assert str(document.place(("a", 1, "b"), of_key=True)) == "cell.yaml:3:6"
    assert str(document.place(("long key",))) == "cell.yaml:4:11"


def test_the_place_of_what_is_missing_is_that_of_its_parent() -> None:
    """A missing key is reported where the mapping starts."""
    document = parse_yaml("a:\n  b: 1\n", "cell.yaml")
    assert str(document.place(("a", "c"))) == "cell.yaml:2:3"


def test_duplicate_keys_are_mistakes_with_both_places() -> None:
    """The first value is kept, the second is reported."""
    document = parse_yaml("a: 1\nb: 2\na: 3\na: {c: [4]}\nd: 5\n", "cell.yaml")
    assert document.data == {"a": 1, "b": 2, "d": 5}
    assert [one.text(document.data) for one in document.mistakes] == [
        "cell.yaml:3:1: a: key given twice (first at cell.yaml:1:1)",
        "cell.yaml:4:1: a: key given twice (first at cell.yaml:1:1)",
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        ("a: !!python/object:os.system x", "1:4: tags are not supported"),
        ("a: !custom 1", "1:4: tags are not supported"),
        ("a: &x [1]\nb: *x", "1:4: anchors and aliases are not supported"),
        ("a: {<<: {b: 1}}", "1:5: merge keys"),
        ("{[1, 2]: 3}", "1:2: keys must be plain text"),
        ("a: 1\n---\nb: 2", "only one YAML document"),
        ("a: [1, 2", "1:4: not valid YAML|not valid YAML"),
        ("a: 'x", "not valid YAML"),
        ("a: 1\n b: 2", "2:3: not valid YAML"),
        ("a: \x07", "not valid YAML"),
        ("%YAML 9", "not valid YAML"),
    ],
)
def test_what_no_cell_needs_is_refused(text: str, message: str) -> None:
    """Tags, aliases, merge keys, several documents and syntax errors: one line."""
    with pytest.raises(CellError, match=message) as caught:
        parse_yaml(text, "cell.yaml")
    assert len(caught.value.lines) == 1
    assert caught.value.lines[0].startswith("cell.yaml")


def test_nesting_is_bounded() -> None:
    """Thousands of brackets end in a line, not in a RecursionError."""
    with pytest.raises(CellError, match=f"more than {MAX_DEPTH} levels"):
        parse_yaml("[" * 200, "cell.yaml")


def test_size_and_number_of_values_are_bounded(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A text of too many values is refused before it is built."""
    monkeypatch.setattr("reachmap.cell.text.yaml_reader.MAX_VALUES", 100)
    with pytest.raises(CellError, match="more than 100 values"):
        parse_yaml("[" + "1," * 200 + "1]", "cell.yaml")
    with pytest.raises(CellError, match=f"limit of {MAX_TEXT_BYTES:,} bytes"):
        parse_yaml("#" * (MAX_TEXT_BYTES + 1), "cell.yaml")


def test_files_are_utf_8_regular_and_of_bounded_size(tmp_path: Path) -> None:
    """A folder, a missing file, Latin-1 and a huge file each get a line."""
    latin = tmp_path / "latin.yaml"
    latin.write_bytes(b"a: 1\nb: caf\xe9\n")
    with pytest.raises(CellError, match=r"latin\.yaml:2:1: expected UTF-8 text"):
        read_text(latin, limit=100)
    with pytest.raises(CellError, match="limit of 5 bytes"):
        read_text(latin, limit=5)
    with pytest.raises(CellError, match="is a folder"):
        read_text(tmp_path, limit=5)
    with pytest.raises(CellError, match="no such file"):
        read_text(tmp_path / "none.yaml", limit=5)
    with pytest.raises(CellError, match=r"cannot be read|no such file"):
        read_text(Path("x" * 5000), limit=5)


def test_a_byte_order_mark_is_skipped(tmp_path: Path) -> None:
    """Windows editors write one."""
    path = tmp_path / "bom.yaml"
    path.write_bytes(b"\xef\xbb\xbfa: 1\n")
    assert parse_yaml(read_text(path, limit=100), "bom").data == {"a": 1}


KEYS = st.text("abcxyz_", min_size=1, max_size=6).filter(lambda key: key != "_")
SCALARS = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(10**9), 10**9),
    st.floats(allow_nan=False, allow_infinity=False, width=32),
    st.text("abc 'é#-\"", max_size=8),
)
TREES = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(KEYS, inner, max_size=4)
    ),
    max_leaves=12,
)


@settings(max_examples=60, deadline=None)
@given(st.dictionaries(KEYS, TREES, min_size=1, max_size=4))
def test_reading_agrees_with_ruamel(data: dict[str, object]) -> None:
    """What ruamel.yaml dumps and loads itself is read the same here."""
    import io

    engine = YAML(typ="safe", pure=True)
    stream = io.StringIO()
    engine.dump(data, stream)
    text = stream.getvalue()
    # ruamel writes aliases for repeated containers; they are refused here.
    if "&id" not in text:
        assert parse_yaml(text, "x").data == engine.load(text)
