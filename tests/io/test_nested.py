"""Nested records of JSON values and arrays: what comes back is what was written."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vico.errors import InputError, MissingFileError, SchemaError
from vico.io.nested import nested_bytes, nested_from, read_nested, write_nested

SCALARS = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=8)
RECORDS = st.dictionaries(
    st.text(max_size=6).filter(lambda key: not key.startswith("$")),
    st.recursive(SCALARS, lambda inner: st.lists(inner, max_size=3), max_leaves=8),
    max_size=5,
)


@given(RECORDS)
def test_json_values_come_back_exactly(record: dict[str, Any]) -> None:
    assert nested_from(nested_bytes(record)) == record


def test_arrays_come_back_wherever_they_stand(tmp_path: Path) -> None:
    path = np.array([[0.1, 2.0], [3.0, np.nan]])
    record = {"way": [{"points": path}, None], "names": np.array(["a", "ö"]), "best": -math.inf, "n": np.int32(4)}
    write_nested(tmp_path / "r.npz", record)
    back = read_nested(tmp_path / "r.npz")
    np.testing.assert_array_equal(back["way"][0]["points"], path)
    assert back["way"][0]["points"].dtype == path.dtype
    assert back["names"].tolist() == ["a", "ö"]
    assert (back["best"], back["n"]) == (-math.inf, 4)


def test_equal_records_give_equal_bytes() -> None:
    assert nested_bytes({"a": np.arange(5), "b": [1.5]}) == nested_bytes({"a": np.arange(5), "b": [1.5]})


@pytest.mark.parametrize(
    ("record", "words"),
    [
        ({"a": {"b": [1, {2, 3}]}}, r"record.a.b\[1\]: set"),
        ({"a": {3: 1}}, "key 3"),
        ({"a": {"$array": 0}}, "key '\\$array'"),
        ({"a": np.array([object()])}, "array of objects"),
    ],
)
def test_what_cannot_be_saved_is_refused_with_its_place(record: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        nested_bytes(record)


def test_damaged_and_foreign_files_are_refused(tmp_path: Path) -> None:
    whole = nested_bytes({"a": np.arange(100)})
    for content in (whole[:-40], b"", b"PK", b"{}", whole[:60] + b"x" * 40 + whole[100:]):
        with pytest.raises(SchemaError, match="not a readable record"):
            nested_from(content)
    with pytest.raises(MissingFileError):
        read_nested(tmp_path / "none.npz")
