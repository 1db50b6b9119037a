"""Hands in a run: pause, steps, pace, what is changed and written down, going back and branching."""

from __future__ import annotations

import json
import subprocess
import sys
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest

import toy_city
from command_line import vico
from live_toy import live_toy
from vico.agents.schedule import followers_of
from vico.errors import InputError, MissingFileError, OutputExistsError, SchemaError
from vico.runner.control import Control, Pace, Switch, wait_for
from vico.runner.gather import FaultLog, Gatherer
from vico.runner.loop import Runner
from vico.runner.recording import RecordedRun, branched_run, free_name
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.recording import read_run
from vico.sim.recording.interventions import InterventionLine, intervention_of, read_interventions, write_interventions
from vico.sim.recording.recorder import Recorder
from vico.viewer.run_film import RepeatedRun
from vico.world.public import PublicMap

#: What is done to a run in these tests.
DONE = [
    InterventionLine(after=2, command="weather", arguments={"kind": "rain", "over": 0.0}),
    InterventionLine(after=3, command="drop", arguments={"kind": "red helmet", "position": [0.0, -5.0, 0.0]}),
    InterventionLine(after=3, command="say", arguments={"agent": "resident_0", "text": "Where is the shop?"}),
    InterventionLine(after=5, command="event", arguments={"kind": "market", "position": [0.0, -20.0], "minutes": 1}),
    InterventionLine(
        after=6, command="perform", arguments={"agent": "resident_2", "action": {"type": "turn_left", "degrees": 90}}
    ),
]


def played(out: Path, script: list[InterventionLine], *, steps: int = 12) -> list[str]:
    """Run the toy city with interventions, and return the hashes of its states."""
    world, people = toy_city.world(), toy_city.community()
    sim = Simulation(world, people, SimConfig(observe=(), start=28_790))
    agents = Gatherer(followers := followers_of(people, PublicMap.from_world(world), seed=0), trusted=followers)
    control = Control(out, script=script)
    with Recorder(out, sim, sources={}, wanted=steps) as recorder:
        hooks = [RecordedRun(recorder, FaultLog(), notes=control.notes)]
        Runner(sim, agents, hooks=hooks, states_every=4, director=control.before_step).run(steps)
    return read_run(out).hashes


@pytest.fixture(scope="module")
def changed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    """A run to which all of that was done, and its hashes."""
    out = tmp_path_factory.mktemp("runs") / "run"
    return out, played(out, DONE)


def test_interventions_change_the_run_from_the_next_step_on(changed: tuple[Path, list[str]], tmp_path: Path) -> None:
    plain = played(tmp_path / "plain", [])
    assert changed[1][:3] == plain[:3]
    assert changed[1][3] != plain[3]


def test_what_was_done_is_written_down_and_does_the_same_again(changed: tuple[Path, list[str]], tmp_path: Path) -> None:
    lines = read_interventions(changed[0])
    assert lines == DONE
    assert played(tmp_path / "again", lines) == changed[1]


def test_residents_hear_a_voice_and_answer_it(changed: tuple[Path, list[str]]) -> None:
    said = [event for event in read_run(changed[0]).events if event["kind"] == "message"]
    voice = next(event for event in said if event["agent"] == "a voice")
    assert voice["step"] == 4
    assert voice["data"]["hearers"] == ["resident_0"]
    assert any(event["agent"] == "resident_0" and event["step"] in (5, 6) for event in said)


def test_a_thing_that_is_dropped_is_in_the_cast_from_then_on(changed: tuple[Path, list[str]]) -> None:
    run = read_run(changed[0])
    helmet = next(member for member in run.cast.values() if member.name == "red helmet")
    assert helmet.intervals == ((4, None),)
    assert helmet.model == "helmet_red" or "helmet" in (helmet.model or "")


def test_a_recording_with_interventions_can_be_simulated_again(changed: tuple[Path, list[str]]) -> None:
    run = read_run(changed[0])
    again = RepeatedRun(run, toy_city.world(), toy_city.community())
    for step in (7, 12, 5, 9):  # from the beginning, on, back to a checkpoint, and on
        again.go_to(step)
        assert again.sim.state_hash() == run.hashes[step]


def test_an_interrupted_run_with_interventions_goes_on_as_if_it_had_not_been(
    changed: tuple[Path, list[str]], tmp_path: Path
) -> None:
    out = branched_run(changed[0], 4, "again")
    world, people = toy_city.world(), toy_city.community()
    sim = Simulation(world, people, SimConfig(observe=(), start=28_790))
    agents = Gatherer(followers := followers_of(people, PublicMap.from_world(world), seed=0), trusted=followers)
    recorder, checkpoint = Recorder.resume(out, sim, sources={}, wanted=12)
    agents.restore(checkpoint.agents)
    control = Control(out, script=DONE)
    control.restore(checkpoint.notes, out=out, step=checkpoint.step)
    assert len(read_interventions(out)) == 3
    with recorder:
        hooks = [RecordedRun(recorder, FaultLog(), notes=control.notes)]
        Runner(sim, agents, hooks=hooks, director=control.before_step).run(12)
    assert read_run(out).hashes == changed[1]
    assert read_interventions(out) == DONE


def test_a_branch_shares_what_never_changes_and_leaves_the_first_run_whole(changed: tuple[Path, list[str]]) -> None:
    before = {path: path.read_bytes() for path in sorted(changed[0].rglob("*")) if path.is_file()}
    out = branched_run(changed[0], 8, "what if")
    assert out == changed[0].with_name("run.what-if")
    assert read_run(out).last == 8
    shared = next((out / "segments").glob("*/bodies.parquet"))
    assert shared.stat().st_nlink > 1
    assert {path: path.read_bytes() for path in sorted(changed[0].rglob("*")) if path.is_file()} == before
    with pytest.raises(OutputExistsError, match="another name"):
        branched_run(changed[0], 8, "what if")
    assert free_name(changed[0], "what if") == "what if-2"
    with pytest.raises(MissingFileError, match="step 7"):
        branched_run(changed[0], 7, "other")


def test_a_branch_that_is_there_already_is_refused_and_the_run_goes_on(tmp_path: Path) -> None:
    (tmp_path / "run.wet").mkdir()
    control = Control(tmp_path / "run", paused=True)
    with live_toy(tmp_path / "run", control=control):
        with pytest.raises(InputError, match="another name"):
            wait_for(control.command("branch", {"name": "wet"}), 10)
        wait_for(control.command("step", {"steps": 1}), 10)
        assert not control.over


def test_who_asked_for_a_branch_is_told_once_the_run_is_there(tmp_path: Path) -> None:
    (tmp_path / "run.dry").mkdir()
    told: Future[dict[str, Any]] = Future()
    control = Control(tmp_path / "run", paused=True)
    control.step, control.switch = 10, Switch(5, "dry", told)
    control.restore({}, out=tmp_path / "run.dry", step=5)
    assert not told.done()
    assert control.told()["step"] == 5
    control.end()
    assert told.result(0) == {"step": 5, "path": str(tmp_path / "run.dry")}


def test_a_run_waits_makes_single_steps_and_goes_on(tmp_path: Path) -> None:
    control = Control(tmp_path / "run", paused=True)
    with live_toy(tmp_path / "run", control=control) as toy:
        assert wait_for(control.command("bookmarks", {}), 10) == {"bookmarks": []}
        assert control.told()["status"] == "paused"
        assert toy.sim.metrics.steps == 0
        wait_for(control.command("step", {"steps": 3}), 10)
        while control.told()["step"] < 3:
            pass
        wait_for(control.command("bookmark", {"text": "here"}), 10)
        assert toy.sim.metrics.steps == 3
        assert wait_for(control.command("bookmarks", {}), 10)["bookmarks"][0]["step"] == 3
        wait_for(control.command("resume", {}), 10)
        while control.told()["step"] < 10:
            pass
        assert control.told()["status"] == "running"


@pytest.mark.parametrize(
    ("command", "arguments", "reason"),
    [
        ("fly", {}, "no command"),
        ("speed", {"factor": -1}, "0 to 1000"),
        ("speed", {}, "0 to 1000"),
        ("pause", {"now": True}, "no argument"),
        ("step", {"steps": "many"}, "steps"),
        ("back", {"step": 0}, "no checkpoint"),
        ("branch", {"name": "../../etc"}, "letters"),
        ("weather", {"kind": "frogs"}, "no kind"),
        ("weather", {"kind": "rain", "for": 3}, "for"),
        ("drop", {"kind": "red elephant", "position": [0, 0, 0]}, "no 'red elephant'"),
        ("drop", {"kind": "red helmet", "position": [0, 0]}, "position"),
        ("say", {"agent": "nobody", "text": "Hello"}, "nobody"),
        ("goal", {"agent": "resident_0", "place": "x"}, "no robot"),
        ("end_event", {"event": 99}, "event"),
        ("perform", {"agent": "resident_0"}, "action"),
    ],
)
def test_what_cannot_be_done_is_refused_in_a_sentence_and_changes_nothing(
    tmp_path: Path, command: str, arguments: dict[str, Any], reason: str
) -> None:
    control = Control(tmp_path / "run", paused=True)
    with live_toy(tmp_path / "run", control=control) as toy:
        before = wait_for(control.ask(lambda runner: runner.sim.state_hash()), 10)
        with pytest.raises(InputError, match=reason):
            wait_for(control.command(command, arguments), 10)
        assert wait_for(control.ask(lambda runner: runner.sim.state_hash()), 10) == before
        assert read_interventions(toy.control.out) == []


def test_where_somebody_is_judged_nothing_can_be_changed(tmp_path: Path) -> None:
    control = Control(tmp_path / "run", paused=True, allowed=("pause", "resume", "stop"))
    with live_toy(tmp_path / "run", control=control):
        for command in ("weather", "drop", "perform", "speed", "branch"):
            with pytest.raises(InputError, match="no command here"):
                wait_for(control.command(command, {}), 10)


def test_a_file_of_interventions_that_is_none_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "interventions.jsonl"
    for text in (
        "{}",
        '{"after": 1, "command": "fly"}',
        '{"after": 1, "command": "weather", "arguments": {"kind": 3}}',
    ):
        path.write_text(text + "\n")
        with pytest.raises(SchemaError, match="line 1"):
            read_interventions(path)
    write_interventions(tmp_path, reversed(DONE))
    with pytest.raises(SchemaError, match="order"):
        read_interventions(path)
    with pytest.raises(InputError, match="no command"):
        intervention_of("fly", {})


def test_a_pace_holds_back_makes_up_for_little_and_is_measured() -> None:
    now = [0.0]
    pace = Pace(2.0, clock=lambda: now[0])
    assert pace.ahead(100.0) == 0.0
    assert pace.ahead(101.0) == pytest.approx(0.5)
    now[0] = 0.5
    assert pace.ahead(101.0) == 0.0
    now[0] = 10.0  # held up by something: no rush afterwards
    assert pace.ahead(102.0) == 0.0
    assert pace.ahead(103.0) == pytest.approx(0.5)
    pace = Pace(0.0, clock=lambda: now[0])
    for second in range(5):
        now[0] += 0.1
        assert pace.ahead(float(second)) == 0.0
    assert pace.factor == pytest.approx(10.0)


@pytest.mark.slow
def test_the_command_line_does_it_again_in_a_fresh_process(
    helsinki_path: Path, helsinki_people: Path, tmp_path: Path
) -> None:
    lines = [
        InterventionLine(after=2, command="weather", arguments={"kind": "snow", "over": 5}),
        InterventionLine(after=4, command="drop", arguments={"kind": "blue parcel", "position": [5.0, 5.0, 0.0]}),
        InterventionLine(after=4, command="goal", arguments={"agent": "robot_0", "position": [0.0, 10.0, 0.0]}),
        InterventionLine(after=5, command="close_road", arguments={"position": [0.0, 0.0], "radius": 40.0}),
    ]
    write_interventions(tmp_path, lines)
    common = [helsinki_path, helsinki_people, "--steps", 12, "--robots", "husky", "--cars", 4, "--observe", "none"]
    script = ["--interventions", tmp_path / "interventions.jsonl"]
    assert vico("run", *common, *script, "--out", tmp_path / "one") == 0
    again = [sys.executable, "-m", "vico.cli.main", "run", *map(str, [*common, *script, "--out", tmp_path / "two"])]
    assert subprocess.run(again, capture_output=True, check=False).returncode == 0
    one, two = (read_run(tmp_path / name) for name in ("one", "two"))
    assert one.hashes == two.hashes
    assert (tmp_path / "one" / "interventions.jsonl").read_bytes() == (
        tmp_path / "two" / "interventions.jsonl"
    ).read_bytes()
    assert json.loads((tmp_path / "one" / "run.json").read_text())["command"]["interventions"]
