"""Folders appear whole or not at all, and one process at a time writes them."""

import errno
import os
import shutil
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from vico.errors import InputError, OutputError, OutputExistsError
from vico.io.files import FolderLock, check_replaceable, is_being_written, new_folder

HOLD = """
import sys, time
from pathlib import Path
from vico.io.files import FolderLock
lock = FolderLock(Path(sys.argv[1]))
print("held", flush=True)
time.sleep(60)
"""


def names(folder: Path) -> list[str]:
    return sorted(os.listdir(folder))


def test_a_folder_appears_when_it_is_whole(tmp_path: Path) -> None:
    out = tmp_path / "a" / "out"
    with new_folder(out) as folder:
        (folder / "x").touch()
        assert not out.exists()
    assert names(out) == ["x"]
    assert names(tmp_path / "a") == ["out"]


def test_a_failure_leaves_nothing_not_even_parents(tmp_path: Path) -> None:
    with suppress(InputError), new_folder(tmp_path / "a" / "b" / "out") as folder:
        (folder / "x").touch()
        raise InputError("no")
    assert names(tmp_path) == []


def test_a_failure_leaves_what_was_there(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "old").touch()
    with pytest.raises(OutputExistsError, match="--force"), new_folder(out):
        pass
    with pytest.raises(InputError), new_folder(out, force=True):
        raise InputError("no")
    assert names(out) == ["old"]
    with new_folder(out, force=True) as folder:
        (folder / "new").touch()
    assert names(out) == ["new"]
    assert names(tmp_path) == ["out"]


@pytest.mark.parametrize("kind", ["file", "link", "dangling"])
def test_files_and_links_are_replaced_and_what_they_lead_to_is_kept(tmp_path: Path, kind: str) -> None:
    out, other = tmp_path / "out", tmp_path / "other"
    other.mkdir()
    (other / "mine").touch()
    if kind == "file":
        out.touch()
    else:
        out.symlink_to(other if kind == "link" else tmp_path / "nowhere")
    with pytest.raises(OutputExistsError):
        check_replaceable(out, force=False)
    with new_folder(out, force=True):
        pass
    assert out.is_dir()
    assert not out.is_symlink()
    assert names(other) == ["mine"]


def test_work_is_kept_for_the_next_time_unless_there_is_none(tmp_path: Path) -> None:
    out, work = tmp_path / "out", tmp_path / "out.partial"
    for fill in (False, True):
        with suppress(InputError), new_folder(out, work=work) as folder:
            if fill:
                (folder / "x").touch()
            raise InputError("no")
        assert names(tmp_path) == (["out.partial"] if fill else [])
    with new_folder(out, work=work):
        pass
    assert names(out) == ["x"]


def test_a_folder_that_another_process_writes_is_left_alone_until_it_ends(tmp_path: Path) -> None:
    out, work = tmp_path / "out", tmp_path / "out.partial"
    out.mkdir()
    (out / "theirs").touch()
    with subprocess.Popen([sys.executable, "-c", HOLD, str(out)], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        assert is_being_written(out)
        with pytest.raises(OutputError, match="another process is writing it"), new_folder(out, force=True):
            pass
        assert names(tmp_path) == ["out"]
        process.kill()
    assert not is_being_written(out)
    work.mkdir()
    with FolderLock(work), pytest.raises(OutputError, match=r"out: another process"):
        new_folder(out, force=True, work=work).__enter__()
    assert names(out) == ["theirs"]


def test_a_folder_that_is_locked_meanwhile_is_not_replaced(tmp_path: Path) -> None:
    out = tmp_path / "out"
    making = new_folder(out)
    making.__enter__()
    out.mkdir()
    with FolderLock(out), pytest.raises(OutputError, match="another process"):
        making.__exit__(None, None, None)
    assert names(tmp_path) == ["out"]


@pytest.mark.parametrize("instead", [False, True])
def test_a_folder_that_is_taken_away_is_said(tmp_path: Path, instead: bool) -> None:
    making = new_folder(tmp_path / "out")
    folder = making.__enter__()
    shutil.rmtree(folder)
    if instead:
        folder.mkdir()
    with pytest.raises(OutputError, match="taken away while it was written"):
        making.__exit__(None, None, None)
    assert not (tmp_path / "out").exists()


def test_a_full_disk_is_one_sentence_and_other_faults_are_not_hidden(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"out: cannot be written: the disk is full"), new_folder(tmp_path / "out"):
        raise OSError(errno.ENOSPC, "x", str(tmp_path / "elsewhere"))
    with pytest.raises(FileNotFoundError), new_folder(tmp_path / "out"):
        (tmp_path / "input").read_bytes()
    assert names(tmp_path) == []
