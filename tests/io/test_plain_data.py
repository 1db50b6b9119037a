"""Plain data goes to bytes and back; whatever else the bytes hold is refused."""

from __future__ import annotations

import json
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vico.errors import InputError, MissingFileError, SchemaError
from vico.io.plain_data import decode, encode, read_plain, write_plain

SCALARS = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text()


def test_nested_values_and_arrays_come_back_as_they_were() -> None:
    given = {
        "number": 1.5,
        "big": 2**127 + 1,
        "none": None,
        "yes": True,
        "text": "Käpylä",
        "list": [1, [2.0, "x"], {}],
        "grid": np.arange(6, dtype=np.int32).reshape(2, 3),
        "deep": {"empty": np.zeros((0, 2)), "flags": np.array([True, False]), "words": np.array(["ab", "c"])},
    }
    found = decode(encode(given))
    assert found["grid"].dtype == np.int32
    assert found["grid"].flags.writeable
    np.testing.assert_array_equal(found.pop("grid"), given.pop("grid"))
    for name, array in found.pop("deep").items():
        np.testing.assert_array_equal(array, given["deep"][name])
    del given["deep"]
    assert found == given


def test_numbers_that_are_none_survive() -> None:
    found = decode(encode([float("nan"), float("inf"), np.float32(0.5), np.int64(3)]))
    assert np.isnan(found[0])
    assert found[1:] == [np.inf, 0.5, 3]


@pytest.mark.parametrize(
    ("value", "where"),
    [
        ({"a": {"b": object()}}, "a.b"),
        ({"a": [1, {2: 3}]}, r"a\[1\]"),
        ({"a": np.array([object()])}, "a"),
        ({"a": "\ud800"}, "Unicode"),
    ],
)
def test_objects_are_refused_with_their_place(value: Any, where: str) -> None:
    with pytest.raises(InputError, match=where):
        encode(value)


def test_what_holds_itself_is_refused() -> None:
    loop: list[Any] = []
    loop.append(loop)
    with pytest.raises(InputError, match="nested"):
        encode(loop)


def message(header: Any, rest: bytes = b"") -> bytes:
    head = header if isinstance(header, bytes) else json.dumps(header).encode()
    return b"VICOPD1\n" + len(head).to_bytes(4, "little") + head + rest


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\x80\x04N.",
        b"VICOPD1\n\xff\xff\xff\xff",
        message(b"[" * 100_000),
        message([]),
        message({"value": {"__array__": 0}, "arrays": []}),
        message({"value": 1, "arrays": [["|O", [1]]]}, b"12345678"),
        message({"value": 1, "arrays": [["<f8", [2**62]]]}),
        message({"value": 1, "arrays": [["<f8", [-1]]]}),
        message({"value": 1, "arrays": [[[["a", "<f8"]], [1]]]}, b"12345678"),
        message({"value": 1, "arrays": []}, b"x"),
        encode({"a": np.ones(4)})[:-1],
    ],
)
def test_bytes_from_anywhere_are_refused(content: bytes) -> None:
    with pytest.raises(SchemaError):
        decode(content)


KEYS = st.text().filter(lambda key: key != "__array__")  # which says that an array stands there


@given(st.recursive(SCALARS, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner), max_leaves=8))
def test_json_values_come_back_exactly(value: Any) -> None:
    assert decode(encode(value)) == value


@pytest.mark.parametrize("key", [3, "__array__"])
def test_keys_that_say_something_else_are_refused(key: Any) -> None:
    with pytest.raises(InputError, match=r"inner: a key is .*keys have to be text other than '__array__'"):
        encode({"inner": {key: None}})


def test_files_hold_what_was_written(tmp_path: Path) -> None:
    file = tmp_path / "kept.bin"
    write_plain(file, {"way": np.arange(6.0).reshape(3, 2), "n": [1, None]})
    found = read_plain(file)
    np.testing.assert_array_equal(found["way"], np.arange(6.0).reshape(3, 2))
    assert found["n"] == [1, None]
    with pytest.raises(MissingFileError):
        read_plain(tmp_path / "none.bin")


def test_damaged_and_foreign_files_are_refused(tmp_path: Path) -> None:
    whole = zlib.compress(encode({"a": np.arange(100)}))
    file = tmp_path / "kept.bin"
    for content in (whole[:-5], b"", b"PK", whole + b"x", whole[:20] + b"x" * 9 + whole[29:], zlib.compress(b"{}")):
        file.write_bytes(content)
        with pytest.raises(SchemaError, match=r"kept\.bin.*make it anew"):
            read_plain(file)
