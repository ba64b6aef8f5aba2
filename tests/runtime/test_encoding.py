from __future__ import annotations

import json
import math
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from reachmap.runtime.encoding import decode, encode

DTYPES = ["?", "i1", "u1", *(f"<{kind}{n}" for kind in "iuf" for n in (2, 4, 8))]
ARRAYS = st.sampled_from(DTYPES).flatmap(
    lambda dtype: hnp.arrays(dtype, hnp.array_shapes(min_dims=0, min_side=0))
)
LEAVES = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=True, allow_infinity=True)
    | st.text()
    | ARRAYS
)
KEYS = st.text().filter(lambda key: not key.startswith("$"))
VALUES = st.recursive(
    LEAVES,
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(KEYS, inner, max_size=4)
    ),
    max_leaves=12,
)


def through_text(value):
    """A value written to a line and read back."""
    text = encode(value)
    assert "\n" not in text
    assert text.isascii()
    return decode(text)


def assert_same_bits(one, other):
    """Equal type, structure and bits."""
    assert type(one) is type(other)
    if isinstance(one, np.ndarray):
        assert (one.dtype, one.shape) == (other.dtype, other.shape)
        assert one.tobytes() == other.tobytes()
    elif isinstance(one, float):
        assert math.isnan(one) == math.isnan(other)
        assert math.isnan(one) or struct.pack("<d", one) == struct.pack("<d", other)
    elif isinstance(one, list):
        assert len(one) == len(other)
        for left, right in zip(one, other, strict=True):
            assert_same_bits(left, right)
    elif isinstance(one, dict):
        assert list(one) == list(other)
        for key in one:
            assert_same_bits(one[key], other[key])
    else:
        assert one == other


@given(VALUES)
def test_every_value_comes_back_with_every_bit(value):
    """Nests of numbers, text and arrays survive a journal line unchanged."""
    assert_same_bits(through_text(value), value)


def test_nan_in_an_array_keeps_its_sign_and_payload():
    """A NaN with a payload is not replaced by another NaN."""
    (odd,) = struct.unpack(">d", bytes.fromhex("fff800000000beef"))
    array = np.array([odd, -0.0, 5e-324])
    assert through_text(array).tobytes() == array.tobytes()


def test_arrays_of_any_memory_layout_have_one_form():
    """Byte order and strides do not show in the text; the values are kept."""
    plain = np.arange(12, dtype="<f8").reshape(3, 4)
    for same in (plain.astype(">f8"), np.asfortranarray(plain), plain[::-1][::-1]):
        assert encode(same) == encode(plain)
    np.testing.assert_array_equal(through_text(plain.T), plain.T)


def test_arrays_come_back_read_only():
    """A decoded array cannot be changed by accident."""
    with pytest.raises(ValueError, match="read-only"):
        through_text(np.zeros(3))[0] = 1.0


def test_numpy_scalars_and_tuples_become_plain():
    """NumPy scalars come back as Python numbers, tuples as lists."""
    assert through_text((np.float64(0.5), np.uint8(3), np.True_)) == [0.5, 3, True]


@pytest.mark.parametrize(
    "value", [object(), {(1,): 2}, np.array(["a"]), np.array([None]), 1j]
)
def test_what_has_no_exact_form_is_refused(value):
    """Nothing is turned into something else without saying so."""
    with pytest.raises(TypeError, match=r"no JSON form|keys must be"):
        encode(value)


@pytest.mark.parametrize(
    "data",
    [
        {"$array": "|O", "shape": [1], "data": "AAAAAAAAAAA="},
        {"$array": "f8,f8", "shape": [1], "data": "AAAAAAAAAAA="},
        {"$array": None, "shape": [1], "data": "AAAAAAAAAAA="},
        {"$array": "<f8", "shape": [2], "data": "AAAAAAAAAAA="},
        {"$array": "<f8", "shape": [-1], "data": "AAAAAAAAAAA="},
        {"$array": "<f8", "shape": [1e0], "data": "AAAAAAAAAAA="},
        {"$array": "<f8", "shape": 1, "data": "AAAAAAAAAAA="},
        {"$array": "<f8", "shape": [1], "data": "*AAAAAAAAAAA="},
        {"$array": "<f8", "shape": [10**12, 10**12], "data": ""},
        {"$array": "<f8", "shape": [1]},
    ],
)
def test_damaged_forms_are_refused(data):
    """An array or float that was not written here is an error, never a value."""
    with pytest.raises(ValueError, match=r".+"):  # base64 and NumPy word it too
        decode(json.dumps(data))
