"""What the processes of a test run share is made once, and left as it was made."""

import threading
from pathlib import Path

import pytest

from shared_folders import SharedFolders


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The temporary folder of a run whose processes have their own in it."""
    monkeypatch.setenv("PYTEST_XDIST_WORKER", "gw0")
    return tmp_path


def test_one_of_two_processes_makes_a_folder_and_both_read_it(run: Path) -> None:
    made: list[str] = []
    both_ask = threading.Barrier(2)
    read: list[str] = []

    def process(name: str) -> None:
        def make(out: Path) -> None:
            made.append(name)
            out.mkdir()
            (out / "file").write_text("made")

        shared = SharedFolders(run / name)
        both_ask.wait()
        read.append((shared.folder("world", make) / "file").read_text())

    threads = [threading.Thread(target=process, args=(name,)) for name in ("gw0", "gw1")]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(made) == 1
    assert read == ["made", "made"]


def test_what_one_that_died_left_is_made_anew(run: Path) -> None:
    def die(out: Path) -> None:
        out.mkdir()
        (out / "half").touch()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        SharedFolders(run / "gw0").folder("world", die)
    assert list(SharedFolders(run / "gw1").folder("world", Path.mkdir).iterdir()) == []


def test_a_test_that_changes_what_all_share_is_found(run: Path) -> None:
    shared = SharedFolders(run / "gw0")
    out = shared.folder("world", Path.mkdir)
    shared.confirm()
    (out / "mine").touch()
    with pytest.raises(AssertionError, match="work on a copy"):
        shared.confirm()
