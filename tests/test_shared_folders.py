"""What the processes of test runs share is made once of the same sources, and left as it was made."""

import os
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import house
from shared_folders import SharedFolders


def test_one_of_two_processes_makes_a_folder_and_both_read_it(tmp_path: Path) -> None:
    made: list[str] = []
    both_ask = threading.Barrier(2)
    read: list[str] = []

    def process(name: str) -> None:
        def make(out: Path) -> None:
            made.append(name)
            out.mkdir()
            (out / "file").write_text("made")

        shared = SharedFolders(tmp_path)
        both_ask.wait()
        read.append((shared.folder("world", make) / "file").read_text())

    threads = [threading.Thread(target=process, args=(name,)) for name in ("gw0", "gw1")]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(made) == 1
    assert read == ["made", "made"]


def test_what_one_that_died_left_is_made_anew(tmp_path: Path) -> None:
    def die(out: Path) -> None:
        out.mkdir()
        (out / "half").touch()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        SharedFolders(tmp_path).folder("world", die)
    assert list(SharedFolders(tmp_path).folder("world", Path.mkdir).iterdir()) == []


def test_a_test_that_changes_what_all_share_is_found(tmp_path: Path) -> None:
    shared = SharedFolders(tmp_path)
    out = shared.folder("world", Path.mkdir)
    (out / "mine").touch()
    with pytest.raises(AssertionError, match="work on a copy"):
        shared.confirm()
    assert list(SharedFolders(tmp_path).folder("world", Path.mkdir).iterdir()) == [], "the next run has it made anew"


def test_other_sources_make_another_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one = SharedFolders(tmp_path).folder("world", Path.mkdir, ["io"])
    assert SharedFolders(tmp_path).folder("world", Path.mkdir, ["io"]) == one
    changed = tmp_path / "vico"
    (changed / "io").mkdir(parents=True)
    (changed / "io" / "files.py").write_text("# edited")
    monkeypatch.setattr(house, "SOURCE", changed)
    assert SharedFolders(tmp_path).folder("world", Path.mkdir, ["io"]) != one


def test_what_no_run_has_read_for_weeks_goes_unless_one_reads_it(tmp_path: Path) -> None:
    reader, long_ago = SharedFolders(tmp_path), time.time() - 30 * 86_400
    read = reader.folder("read", Path.mkdir)
    ended = SharedFolders(tmp_path)
    unread = ended.folder("unread", Path.mkdir)
    ended.confirm()
    for out in (read, unread):
        os.utime(out.with_name(f"{out.name}.done"), (long_ago, long_ago))
    SharedFolders(tmp_path).folder("new", Path.mkdir)
    assert read.is_dir()
    assert not unread.is_dir()


def test_what_was_made_of_arrays_is_read_back(tmp_path: Path) -> None:
    made: list[int] = []

    def make() -> tuple[np.ndarray, list[str]]:
        made.append(1)
        return np.arange(3), ["a"]

    for _ in range(2):
        numbers, words = SharedFolders(tmp_path).product("numbers", make)
        assert numbers.tolist() == [0, 1, 2]
        assert words == ["a"]
    assert made == [1]


def test_a_room_stands_on_those_it_may_import() -> None:
    assert house.below(["worldgen"]) >= {"worldgen", "geo", "world", "io"}
    assert "sim" not in house.below(["worldgen"])
    assert house.above(["datasets"]) == {"datasets", "viewer", "cli"}
