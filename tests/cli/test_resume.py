"""What a kill interrupts goes on to the same end; how many work, and who looks, decides nothing."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from command_line import kill_once, vico
from shared_folders import Shared
from vico.io.files import read_json
from vico.sim.recording import Run, read_run
from vico.sim.recording.schema import checkpoint_steps

STEPS = 45


def contents(run: Run) -> dict[str, Any]:
    """All that a run holds, step by step."""
    tables = ("steps", "bodies", "people", "agents", "events")
    found = {name: run.table(name).to_pylist() for name in tables}
    films = {name: [step for step, _ in view.frames()] for name, view in run.views.items()}
    return found | {"films": films, "faults": run.manifest["faults"], "hash": run.manifest["state_hash"]}


@pytest.fixture(scope="module")
def words(helsinki_path: Path, helsinki_people: Path) -> list[object]:
    """A run with two assistants, one observer, a robot and traffic, without its end: ``--out FOLDER``."""
    return [
        "run", helsinki_path, helsinki_people, "--steps", STEPS, "--robots", "husky", "--cars", 2, "--pedestrians", 2,
        "--observe", "resident_0", "--assistants", 2, "--agent", "vico.agents.base:RandomAgent", "--states-every", 10,
        "--check", "overlaps",
    ]  # fmt: skip


@pytest.fixture(scope="module")
def whole(words: list[object], shared: Shared) -> Path:
    """The run, uninterrupted."""

    def make(out: Path) -> None:
        assert vico(*words, "--out", out / "run") == 0

    return shared("run_to_resume", make) / "run"


def at_step(out: Path, step: int) -> Callable[[], bool]:
    return lambda: (out / "checkpoints" / f"{step:08d}").is_dir()


def test_a_killed_run_goes_on_to_the_same_end(
    words: list[object], whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    kill_once([*words, "--out", out], at_step(out, 20))
    # Code is only run if the command line names it.
    assert vico("run", "--resume", out) == 2
    assert "--agent vico.agents.base:RandomAgent" in capsys.readouterr().err
    assert vico("run", "--resume", out, "--agent", "vico.agents.base:RandomAgent", "--json") == 0
    said = capsys.readouterr()
    assert "goes on after step" in said.err
    told = json.loads(said.out)
    assert told["state_hash"] == read_json(whole / "run.json")["state_hash"]
    assert (told["overlaps"]["count"], told["overlaps"]["sub_steps"]) == (0, 10 * STEPS)
    assert contents(read_run(out)) == contents(read_run(whole))
    assert checkpoint_steps(out) == checkpoint_steps(whole)
    # Now that it is whole, there is nothing to go on with.
    assert vico("run", "--resume", out, "--agent", "vico.agents.base:RandomAgent") == 2
    assert "complete" in capsys.readouterr().err


@pytest.mark.slow
def test_so_it_does_with_the_same_command_and_isolated_agents(
    words: list[object], whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    kill_once([*words, "--isolate", "--out", out], at_step(out, 30))
    assert vico(*words, "--isolate", "--out", out) == 0
    assert "goes on after step" in capsys.readouterr().err
    assert contents(read_run(out)) == contents(read_run(whole))


def test_what_a_run_says_of_itself_is_not_trusted(
    words: list[object], whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    out.mkdir()
    manifest = read_json(whole / "run.json") | {"status": "stopped"}
    for command, sentence in (
        (None, "give the command that began the run"),
        (manifest["command"] | {"steps": "many"}, "steps"),
        (manifest["command"] | {"agent": "evil:Agent"}, "was begun with --agent evil:Agent"),
    ):
        (out / "run.json").write_text(json.dumps(manifest | {"command": command}))
        assert vico("run", "--resume", out) == 2
        error = capsys.readouterr().err
        assert sentence in error
        assert error.count("\n") == 1
    assert vico("run", "--resume", out, "--seed", 4) == 2
    assert "takes everything but" in capsys.readouterr().err


def test_a_run_has_one_hash_whoever_looks_and_however_many_work(
    helsinki_path: Path, helsinki_people: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    common = [
        "run", helsinki_path, helsinki_people, "--steps", 20, "--seed", 1, "--robots", "husky,go2", "--cars", 4,
        "--pedestrians", 4, "--assistants", 2, "--agent", "vico.agents.base:RandomAgent", "--deadline", 0, "--json",
    ]  # fmt: skip
    hashes = set()
    for observe, workers in (("none", 4), ("all", 1), ("all", 4)):
        capsys.readouterr()
        assert vico(*common, "--observe", observe, "--workers", workers, "--out", tmp_path / f"{observe}{workers}") == 0
        hashes.add(json.loads(capsys.readouterr().out)["state_hash"])
    # And one in a process that has done nothing else.
    fresh = [*common, "--observe", "none", "--workers", 1, "--out", tmp_path / "fresh"]
    done = subprocess.run(
        [sys.executable, "-m", "vico.cli.main", *map(str, fresh)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    hashes.add(json.loads(done.stdout)["state_hash"])
    assert len(hashes) == 1


def test_a_run_whose_agent_has_no_state_says_so(
    helsinki_path: Path, helsinki_people: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    quiet = ("--robots", "none", "--cars", 0, "--pedestrians", 0, "--observe", "none", "--steps", 2)
    planted = Path(__file__).parents[1] / "planted_agents.py"
    words = ["run", helsinki_path, helsinki_people, *quiet, "--assistants", 1, "--agent", f"{planted}:NoState"]
    assert vico(*words, "--out", tmp_path / "a", "--states-every", 1) == 2
    assert "stateless = True" in capsys.readouterr().err
    assert not (tmp_path / "a").exists()
    assert vico(*words, "--out", tmp_path / "b") == 0
    assert "cannot go on if it is cut short" in capsys.readouterr().err
    assert checkpoint_steps(tmp_path / "b") == []


def test_a_run_tells_who_did_what_wrong(
    helsinki_path: Path, helsinki_people: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    quiet = ("--robots", "none", "--cars", 0, "--pedestrians", 0, "--observe", "none", "--steps", 4)
    planted = Path(__file__).parents[1] / "planted_agents.py"
    words = ["run", helsinki_path, helsinki_people, *quiet, "--assistants", 1, "--isolate"]
    assert vico(*words, "--agent", f"{planted}:Quitter", "--out", tmp_path / "run") == 0
    faults = read_json(tmp_path / "run" / "run.json")["faults"]
    assert faults["by_agent"] == {"assistant_0": {"ended": 2}}
    assert faults["first"][0] == {
        "step": 3, "agent": "assistant_0", "kind": "ended", "reason": "its process ended with exit status 7",
    }  # fmt: skip
    assert "assistant_0: ended at step 3, and waits" in caplog.text


@pytest.mark.parametrize(
    ("agent", "sentence"),
    [
        ("nowhere:Agent", "cannot be imported"),
        ("vico.agents.base:Nobody", "has no 'Nobody'"),
        ("no_colon", "my_module:MyAgent"),
        ("PLANTED:Fussy", "asks for 'moon'"),
        ("PLANTED:Broken", "LookupError: no weights"),
        ("PLANTED:LIES", "is no agent"),
        ("missing.py:Agent", "no such file"),
    ],
)
@pytest.mark.parametrize("isolate", [(), ("--isolate",)], ids=["in-process", "isolated"])
def test_an_agent_that_cannot_be_made_is_one_sentence(
    helsinki_path: Path, helsinki_people: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    agent: str, sentence: str, isolate: tuple[str, ...],
) -> None:  # fmt: skip
    planted = str(Path(__file__).parents[1] / "planted_agents.py")
    quiet = ("--robots", "none", "--cars", 0, "--pedestrians", 0, "--observe", "none", "--steps", 2)
    words = ["run", helsinki_path, helsinki_people, *quiet, "--assistants", 1, "--out", tmp_path / "run"]
    assert vico(*words, "--agent", agent.replace("PLANTED", planted), *isolate) == 2
    error = capsys.readouterr().err
    assert sentence in error
    assert error.count("vico: ") == 1
    assert not (tmp_path / "run").exists()
