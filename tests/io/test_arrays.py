"""Arrays in files: written whole or not at all, read page by page, and let go of."""

from __future__ import annotations

import mmap
from pathlib import Path

import numpy as np
import pytest

from vico.errors import MissingFileError, SchemaError
from vico.io.arrays import drop_pages, mapped_array, new_array


def test_what_was_written_is_read_and_a_block_that_fails_leaves_nothing(tmp_path: Path) -> None:
    path = tmp_path / "a.npy"
    with new_array(path, (40, 50), np.int32, fill=7) as array:
        array[3, 4] = 11
    found = mapped_array(path)
    assert (found[3, 4], found.sum()) == (11, 40 * 50 * 7 + 4)
    with pytest.raises(RuntimeError), new_array(tmp_path / "b.npy", (2,), np.uint8):
        raise RuntimeError
    assert [one.name for one in tmp_path.iterdir()] == ["a.npy"]


def test_a_file_that_is_gone_or_no_array_is_named(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match=r"gone\.npy"):
        mapped_array(tmp_path / "gone.npy")
    (tmp_path / "odd.npy").write_bytes(b"no array")
    with pytest.raises(SchemaError, match=r"odd\.npy"):
        mapped_array(tmp_path / "odd.npy")


@pytest.mark.skipif(not hasattr(mmap, "MADV_DONTNEED"), reason="this system gives no pages back")
def test_pages_that_are_let_go_of_are_read_again(tmp_path: Path) -> None:
    path = tmp_path / "a.npy"
    with new_array(path, (3000, 1000), np.float32) as array:
        array[:] = np.arange(1000)
    found = mapped_array(path)
    whole = found.copy()
    found[5, 5] = -1.0  # the array's own, which shows that pages went
    drop_pages(found[10:, 2:])
    np.testing.assert_array_equal(found, whole)
    drop_pages(whole)  # of no file
    assert whole[0, 999] == 999.0
