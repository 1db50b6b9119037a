"""Ctrl-C and a batch system's SIGTERM: what was simulated or filmed is kept, and how to go on is said."""

from __future__ import annotations

import os
import shlex
import shutil
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command_line import interrupted, vico
from shared_folders import Shared
from vico.cli import console
from vico.cli import run as run_verb
from vico.cli.console import CommandInterrupted, ended_by_signals, exit_code, progress_bars, stopped_between_steps
from vico.errors import InputError
from vico.io.files import read_json
from vico.render.film import FilmWriter, partial_film, read_film, write_film
from vico.sim.recording import read_run
from vico.sim.recording.schema import checkpoint_steps
from vico.viewer import run_film

STEPS = 9


@pytest.fixture(autouse=True)
def _listening() -> Iterator[None]:
    # Where tests run in the background, a shell has them ignore Ctrl-C.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="module")
def words(helsinki_path: Path, helsinki_people: Path) -> list[object]:
    """A short run, without its end: ``--out FOLDER``."""
    return [
        "run", helsinki_path, helsinki_people, "--steps", STEPS, "--robots", "none", "--cars", 2, "--pedestrians", 2,
        "--observe", "resident_0",
    ]  # fmt: skip


@pytest.fixture(scope="module")
def whole(words: list[object], shared: Shared) -> Path:
    """The run, uninterrupted."""

    def make(out: Path) -> None:
        assert vico(*words, "--out", out / "run") == 0

    return shared("run_to_interrupt", make) / "run"


def send_after(monkeypatch: pytest.MonkeyPatch, step: int, number: int) -> None:
    """Have a signal sent to this process when a run has made a step."""

    class Sends(run_verb._Progress):
        def on_step(self, made: Any) -> None:
            super().on_step(made)
            if made.number == step:
                os.kill(os.getpid(), number)

    monkeypatch.setattr(run_verb, "_Progress", Sends)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_a_stopped_run_goes_on_after_the_step_it_was_at_by_the_command_it_names(
    words: list[object], whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str], number: int, code: int,
) -> None:  # fmt: skip
    out = tmp_path / "my run"
    if number == signal.SIGHUP:  # a shell's nohup has it ignored, which the command respects
        before = signal.signal(number, signal.SIG_DFL)
    with monkeypatch.context() as patched:
        send_after(patched, 5, number)
        assert vico(*words, "--out", out) == code
    if number == signal.SIGHUP:
        signal.signal(number, before)
    told = capsys.readouterr().err.splitlines()[-1]
    assert f"stopped after step 5 of {STEPS}; go on with: vico run --resume" in told
    assert checkpoint_steps(out) == [5]
    assert read_run(out).steps.tolist() == list(range(6))
    assert vico(*shlex.split(told.partition("go on with: vico ")[2])) == 0
    assert "goes on after step 5" in capsys.readouterr().err
    assert read_run(out).hashes == read_run(whole).hashes
    assert [step for step, _ in read_run(out).views["resident_0"].frames()] == list(range(STEPS + 1))


def test_a_command_of_its_own_that_is_stopped_keeps_its_state(words: list[object], tmp_path: Path, whole: Path) -> None:
    out = tmp_path / "run"
    at_work = [*words[:4], 100_000, *words[5:], "--states-every", 5, "--out", out]
    code, said = interrupted(at_work, lambda: len(checkpoint_steps(out)) > 0, signal.SIGTERM)
    assert code == 143
    assert f"go on with: vico run --resume {out}" in said
    made = read_json(out / "run.json")["steps"]
    assert checkpoint_steps(out)[-1] == made
    assert read_run(out).hashes[:6] == read_run(whole).hashes[:6]


def test_a_run_without_checkpoints_has_one_where_it_is_stopped(
    words: list[object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    send_after(monkeypatch, 3, signal.SIGINT)
    assert vico(*words, "--states-every", 0, "--out", tmp_path / "run") == 130
    assert checkpoint_steps(tmp_path / "run") == [3]


def test_a_stopped_run_that_cannot_go_on_says_so(
    words: list[object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    send_after(monkeypatch, 3, signal.SIGINT)
    planted = Path(__file__).parents[1] / "planted_agents.py"
    out = tmp_path / "run"
    assert vico(*words, "--assistants", 1, "--agent", f"{planted}:NoState", "--out", out) == 130
    assert "it has no checkpoint to go on from" in capsys.readouterr().err
    assert read_run(out).steps.tolist() == list(range(4))


def test_a_signal_in_the_last_step_takes_nothing_from_a_complete_run(
    words: list[object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    send_after(monkeypatch, STEPS, signal.SIGTERM)
    assert vico(*words, "--out", tmp_path / "run") == 0
    assert read_json(tmp_path / "run" / "run.json")["status"] == "complete"


def test_ctrl_c_that_comes_twice_at_once_is_one(capfd: pytest.CaptureFixture[str]) -> None:
    woken = []
    with stopped_between_steps(lambda: woken.append(1)) as asked:
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGINT)
        assert asked.number == signal.SIGINT
    assert woken == [1]
    assert "Ctrl-C once more ends it at once" in capfd.readouterr().err


def test_ctrl_c_once_more_ends_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    now = iter((10.0, 12.0))
    monkeypatch.setattr(console.time, "monotonic", lambda: next(now))
    with stopped_between_steps() as asked:
        os.kill(os.getpid(), signal.SIGINT)
        assert asked
        with pytest.raises(CommandInterrupted):
            os.kill(os.getpid(), signal.SIGINT)


def test_a_second_sigterm_ends_no_step(monkeypatch: pytest.MonkeyPatch) -> None:
    now = iter((10.0, 12.0))
    monkeypatch.setattr(console.time, "monotonic", lambda: next(now))
    with stopped_between_steps() as asked:
        os.kill(os.getpid(), signal.SIGTERM)
        os.kill(os.getpid(), signal.SIGTERM)
    assert asked


def test_what_is_ignored_stays_ignored() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with ended_by_signals(), stopped_between_steps() as asked:
            os.kill(os.getpid(), signal.SIGHUP)
        assert not asked
    finally:
        signal.signal(signal.SIGHUP, before)


def test_sigterm_ends_a_command_as_ctrl_c_does() -> None:
    with pytest.raises(KeyboardInterrupt) as ended, ended_by_signals():
        os.kill(os.getpid(), signal.SIGTERM)
    assert exit_code(ended.value) == 143
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def noise(count: int) -> Iterator[np.ndarray]:
    random = np.random.default_rng(0)
    return (random.integers(0, 255, (64, 96, 3), dtype=np.uint8) for _ in range(count))


def test_a_film_that_is_killed_can_be_played(tmp_path: Path) -> None:
    path, left = tmp_path / "film.mp4", tmp_path / "left.mp4"
    with FilmWriter(path, rate=25) as writer:
        for picture in noise(60):
            writer.add(picture)
        shutil.copy(partial_film(path), left)  # as a kill at this moment leaves it
    assert 30 <= sum(1 for _ in read_film(left)) <= 60
    assert sum(1 for _ in read_film(path)) == 60
    assert not partial_film(path).exists()


def test_a_whole_film_is_no_fragments(tmp_path: Path) -> None:
    with FilmWriter(tmp_path / "film.mp4", rate=25) as writer:
        for picture in noise(4):
            writer.add(picture)
    content = (tmp_path / "film.mp4").read_bytes()
    assert b"moof" not in content
    assert content.index(b"moov") < content.index(b"mdat")


def test_a_film_that_fails_leaves_nothing(tmp_path: Path) -> None:
    def pictures() -> Iterator[np.ndarray]:
        yield from noise(4)
        raise InputError("no more")

    with pytest.raises(InputError):
        write_film(tmp_path / "film.mp4", pictures(), rate=25)
    assert list(tmp_path.iterdir()) == []


def test_an_interrupted_film_keeps_its_frames_and_says_where(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    written = run_film.write_film_of_shots

    def interrupted(*given: Any, report: Callable[[int, int], None], **more: Any) -> int:
        def told(done: int, count: int) -> None:
            report(done, count)
            if done == 7:
                os.kill(os.getpid(), signal.SIGINT)

        return written(*given, report=told, **more)

    monkeypatch.setattr(run_film, "write_film_of_shots", interrupted)
    small = ("--size", "96x64", "--samples", 1, "--quality", "plain", "--fps", 5)
    assert vico("film", whole, "--follow", "resident_0", *small, "--out", tmp_path / "film.mp4") == 130
    assert "film.partial.mp4: stopped after 7 of 45 frames, 1.4 s that can be played" in capsys.readouterr().err
    assert sum(1 for _ in read_film(tmp_path / "film.partial.mp4")) == 7
    assert not (tmp_path / "film.mp4").exists()


def test_lines_of_a_long_stage_tell_the_time_that_is_left(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = 0.0
    monkeypatch.setattr("vico.cli.console.time.perf_counter", lambda: now)
    with progress_bars() as report:
        for done in range(1, 12):
            report("film", done, 601)
            now += 12.0
    # After 36 s with three frames more than at the first line, and each half minute from then on.
    assert capsys.readouterr().err.splitlines()[0].split("  ")[-1] == "36.0 s, 1 h 59 min left"
