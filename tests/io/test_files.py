"""Files are written whole or not at all, and a disk that refuses is one sentence."""

import errno
import os
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from vico.errors import MissingFileError, OutputError, SchemaError
from vico.io.files import new_file, read_json, sha256_of, write_bytes, write_json


def test_equal_content_gives_equal_bytes(tmp_path: Path) -> None:
    write_json(tmp_path / "a.json", {"b": 1, "a": "ä"})
    write_json(tmp_path / "b.json", {"a": "ä", "b": 1})
    assert sha256_of(tmp_path / "a.json") == sha256_of(tmp_path / "b.json")
    assert read_json(tmp_path / "a.json") == {"a": "ä", "b": 1}


def test_pieces_are_joined_and_folders_made(tmp_path: Path) -> None:
    write_bytes(tmp_path / "x" / "y" / "z.bin", [b"one", b"two"])
    assert (tmp_path / "x" / "y" / "z.bin").read_bytes() == b"onetwo"
    assert (tmp_path / "x" / "y" / "z.bin").stat().st_mode & 0o777 == 0o644


def test_a_writer_that_fails_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "kept.osm.pbf"
    path.write_bytes(b"old")
    with suppress(KeyError), new_file(path) as temporary:
        assert temporary.suffix == ".pbf"
        temporary.write_bytes(b"half")
        raise KeyError
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == [path.name]


def test_a_full_disk_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("vico.io.files.os.fsync", full)
    with pytest.raises(OutputError, match=r"a\.json: cannot be written: the disk is full; free some space"):
        write_json(tmp_path / "a.json", {})
    assert os.listdir(tmp_path) == []


def test_a_file_in_the_way_of_a_folder_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="cannot be written"):
        write_bytes(tmp_path / "file" / "a.json", b"")


def test_what_is_no_json_is_said(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text('{\n"a": 1,\n}')
    with pytest.raises(SchemaError, match="line 3"):
        read_json(tmp_path / "a.json")
    with pytest.raises(MissingFileError):
        read_json(tmp_path / "b.json")
