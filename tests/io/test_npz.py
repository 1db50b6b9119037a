"""Archives of arrays are read whole, in many threads, and never with anything pickled."""

from __future__ import annotations

import io
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from vico.io.arrays import read_npz


def _archive(**arrays: object) -> bytes:
    sink = io.BytesIO()
    np.savez(sink, **arrays)  # type: ignore[arg-type]
    return sink.getvalue()


def test_arrays_read_in_many_threads_are_whole() -> None:
    archives = [_archive(a=np.arange(k), b=np.full((2, k), k)) for k in range(1, 60)]
    with ThreadPoolExecutor(8) as pool:
        read = list(pool.map(read_npz, archives))
    for k, arrays in enumerate(read, 1):
        assert list(arrays) == ["a", "b"]
        assert len(arrays["a"]) == k
        assert (arrays["b"] == k).all()


def test_only_the_arrays_named_are_read() -> None:
    assert list(read_npz(_archive(a=1, b=2), ("b", "c"))) == ["b"]


@pytest.mark.parametrize("objects", [np.array([{}], object), np.array([print], object)])
def test_objects_are_refused(objects: object) -> None:
    with pytest.raises(ValueError, match="allow_pickle"):
        read_npz(_archive(a=objects))


def test_a_lone_array_is_no_archive() -> None:
    sink = io.BytesIO()
    np.save(sink, np.arange(3))
    with pytest.raises(ValueError, match="single array"):
        read_npz(sink.getvalue())
