"""Products of stages: bytes and back, the same in any process, and nothing else than our records from a file."""

from __future__ import annotations

import contextlib
import json
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from vico.errors import SchemaError
from vico.world.heights import HeightField
from vico.world.mesh import Material, Surface
from vico.world.model import Category, Dropped
from vico.worldgen.stages import digest_of, read_head, read_product, write_product

LEAVES = st.none() | st.booleans() | st.integers(-(2**50), 2**50) | st.floats(allow_nan=False) | st.text(max_size=8)
TREES = st.recursive(
    LEAVES,
    lambda inner: st.lists(inner, max_size=4) | st.tuples(inner, inner) | st.dictionaries(st.text(max_size=4), inner),
    max_leaves=20,
)


def surface() -> Surface:
    picture = np.arange(4 * 4 * 3, dtype=np.uint8).reshape(4, 4, 3)
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.5]])
    return Surface.from_triangles(corners, np.array([[0, 1, 2]]), entity=7, material=Material("m", picture))


@given(value=TREES)
def test_any_tree_of_plain_data_comes_back(tmp_path_factory: pytest.TempPathFactory, value: object) -> None:
    path = tmp_path_factory.mktemp("p") / "x.stage"
    digest = write_product(path, value, key="k")
    assert read_product(path) == (value, digest)
    assert read_head(path) == ("k", digest)


def test_arrays_shapes_and_records_come_back(tmp_path: Path) -> None:
    one = surface()
    value = {
        "surfaces": [one, one.moved(np.eye(4))],
        "shape": shapely.Point(1, 2).buffer(3).difference(shapely.Point(1, 2).buffer(1)),
        "records": [Dropped(id="w1", reason="too small")],
        "kind": Category.FOOD,
        "names": np.array(["a", "ö"], object),
        "words": np.array(["bench", "tree"]),
        "height": HeightField(np.zeros((3, 3), np.float32), 1.0),
        "number": np.float32(0.1),
    }
    write_product(tmp_path / "x.stage", value, key="k")
    back, digest = read_product(tmp_path / "x.stage")
    assert digest == digest_of(back) == digest_of(value)
    assert back["shape"].equals(value["shape"])
    assert back["records"] == value["records"]
    assert back["kind"] is Category.FOOD
    assert back["names"].tolist() == ["a", "ö"]
    np.testing.assert_array_equal(back["surfaces"][0].positions, one.positions)
    # Shared in memory before, shared after: a city has a few textures, not one a wall.
    assert back["surfaces"][0].material.texture is back["surfaces"][1].material.texture


@pytest.mark.parametrize(
    "array",
    [
        np.zeros((0, 3), np.float32),
        np.array(2.5),
        np.arange(24, dtype=np.int16).reshape(4, 6)[::2, ::-3],
        np.array([[True, False], [True, True]]).T,
        np.array(["bench", "ö"]),
        np.array([1.0, np.nan, -0.0]),
    ],
)
def test_arrays_of_any_layout_come_back_and_can_be_written_to(tmp_path: Path, array: np.ndarray) -> None:
    write_product(tmp_path / "a", [array, array], key="k")
    (back, same), _ = read_product(tmp_path / "a")
    assert back is same
    assert (back.dtype, back.shape) == (array.dtype, array.shape)
    assert back.tobytes() == np.ascontiguousarray(array).tobytes()
    assert back.flags.writeable


def test_a_digest_is_the_same_in_another_process() -> None:
    code = "from vico.worldgen.stages import digest_of; print(digest_of({'a': [1, 2.5], 'b': {'x', 'y', 'z'}}))"
    other = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()
    assert other == digest_of({"a": [1, 2.5], "b": {"x", "y", "z"}})


def test_what_is_none_of_ours_is_not_written(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="Random"):
        write_product(tmp_path / "x.stage", __import__("random").Random(0), key="k")
    assert list(tmp_path.iterdir()) == []


@given(at=st.integers(0, 10_000), bit=st.integers(0, 7))
def test_a_damaged_file_is_told_never_read_wrong(tmp_path_factory: pytest.TempPathFactory, at: int, bit: int) -> None:
    path = tmp_path_factory.mktemp("p") / "x.stage"
    value = [list(range(50)), "words"]
    write_product(path, value, key="k")
    data = bytearray(path.read_bytes())
    data[at % len(data)] ^= 1 << bit
    path.write_bytes(data)
    with contextlib.suppress(SchemaError):
        back, _ = read_product(path)
        assert back == value  # the flipped bit lay in the key, which no content depends on


@pytest.mark.parametrize("name", ["os:system", "vico.cli.main:app", "vico.io.files:write_bytes", "vico.x:Y"])
def test_a_file_can_name_nothing_but_our_records(tmp_path: Path, name: str) -> None:
    tree = json.dumps({"data": name, "value": {}}).encode()
    small = pa.Codec("zstd").compress(tree, asbytes=True)
    total = __import__("hashlib").sha256(struct.pack("<Q", len(tree)) + tree).hexdigest()
    head = json.dumps({"key": "k", "digest": total, "sizes": [(len(tree), len(small))]}).encode()
    (tmp_path / "x.stage").write_bytes(b"vicoprod" + struct.pack("<Q", len(head)) + head + small)
    with pytest.raises(SchemaError, match="not a readable stage product"):
        read_product(tmp_path / "x.stage")
