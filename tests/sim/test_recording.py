"""A recording's cast grows and shrinks, any step is read by itself, and a killed run goes on as if it had not been."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import toy_city
from vico.agents.schedule import followers_of
from vico.errors import EmptyInputError, InputError, MissingFileError, SchemaError
from vico.sim.animation import Transition, pose
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.recording import PosedPeople, read_run
from vico.sim.recording.recorder import Recorder
from vico.sim.recording.samples import LONGEST_ACTION, action_text
from vico.sim.recording.schema import SEGMENT_STEPS
from vico.world.lanes import read_lanes
from vico.world.public import PublicMap
from vico.world.transit import BikeStation, Transit
from vico.world.world import World

STEPS = 100
EVERY = 40


def city_with_bicycles() -> World:
    """The toy city with three bicycles by the green."""
    world = toy_city.world()
    station = BikeStation(id="s", entity=900_000, name="Green", position=(0.0, -20.0, 0.0), capacity=5, bikes=3)
    world.transit = Transit(stops=[], lines=[], bike_stations=[station], origin={})
    with tempfile.TemporaryDirectory() as folder:
        net = Path(folder) / "roads.net.xml"
        net.write_text('<net version="1.20"/>')
        world.lanes = read_lanes(net)
    return world


def assistant() -> Simulation:
    """One assistant with money beside the bicycles, and two things that can be carried."""
    sim = Simulation(city_with_bicycles(), None, SimConfig(assistants=1, observe=()))
    sim.state.people.cash[0] = 50.0
    for k in range(2):
        sim.scenario.add_object(f"parcel {k}", "parcel", [], (5.0 + k, -25.0, 0.0))
    sim.scenario.place_agent("assistant_0", sim.state.transit.bicycles.xy[0])  # type: ignore[union-attr]
    return sim


class Ride:
    """Records what one assistant does."""

    def __init__(self, out: Path) -> None:
        self.sim = assistant()
        self.recorder = Recorder(out, self.sim, sources={}, wanted=STEPS)
        self.recorder.begin({})
        self.steps: dict[str, int] = {}

    def act(self, note: str = "", **action: Any) -> dict[str, Any]:
        """Do one action, and remember the step under a name."""
        result = self.sim.step({"assistant_0": action})
        self.recorder.write(result, actions={"assistant_0": action})
        if note:
            self.steps[note] = self.sim.metrics.steps
        state: dict[str, Any] = result.observations["assistant_0"]["state"]
        return state

    def ride_off(self, note: str) -> None:
        """Ride a bicycle away, and leave it astray."""
        assert self.act(f"mount {note}", type="enter_bike")["action_status"] == "ok"
        start = self.sim.state.people.position[0, :2].copy()
        for _ in range(20):
            if self.act(type="move_forward", distance=3.0)["action_status"] == "collision":
                self.act(type="turn_left", degrees=75.0)
            if np.linalg.norm(self.sim.state.people.position[0, :2] - start) > 8.0:
                break
        assert self.act(f"astray {note}", type="exit_bike")["action_status"] == "ok"


@pytest.fixture(scope="module")
def ride(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Ride]:
    """A run in which a bicycle is left astray, ridden again and left again, and a thing comes in the middle."""
    out = tmp_path_factory.mktemp("runs") / "ride"
    ride = Ride(out)
    ride.act(type="wait")
    ride.ride_off("first")
    ride.sim.scenario.add_object("letter", "parcel", [], (9.0, -25.0, 0.0))
    ride.act("letter", type="communicate", text="A letter!")
    ride.ride_off("again")
    ride.act(type="move_forward", distance=-1.0)
    ride.recorder.close()
    return out, ride


def test_a_bicycle_left_astray_is_in_the_recording_while_it_is_there(ride: tuple[Path, Ride]) -> None:
    run, steps = read_run(ride[0]), ride[1].steps
    bike = next(member for member in run.cast.values() if member.kind == "bicycle")
    assert bike.intervals == ((steps["astray first"], steps["mount again"]), (steps["astray again"], None))
    tracks = run.tracks()
    column = tracks.entity.tolist().index(bike.entity)
    there = np.isfinite(tracks.yaw[:, column])
    assert there.tolist() == [bike.present(step) for step in run.steps.tolist()]


def test_no_track_overwrites_another(ride: tuple[Path, Ride]) -> None:
    run = read_run(ride[0])
    for k, name in enumerate(("parcel 0", "parcel 1")):
        member = next(member for member in run.cast.values() if member.name == name)
        tracks = run.tracks()
        position = tracks.position[:, tracks.entity.tolist().index(member.entity)]
        assert position == pytest.approx(np.tile([5.0 + k, -25.0, 0.0], (len(run.steps), 1)), abs=1e-3)


def test_a_thing_that_comes_in_mid_run_is_there_from_then_on(ride: tuple[Path, Ride]) -> None:
    run, steps = read_run(ride[0]), ride[1].steps
    letter = next(member for member in run.cast.values() if member.name == "letter")
    assert letter.intervals == ((steps["letter"], None),)
    assert letter.entity not in run.at(steps["letter"] - 1).entity
    assert letter.entity in run.at(steps["letter"]).entity


def test_every_action_is_told_with_what_came_of_it(ride: tuple[Path, Ride]) -> None:
    run, steps = read_run(ride[0]), ride[1].steps
    agent = run.at(steps["letter"]).agents["assistant_0"]
    assert (agent.action, agent.status) == ({"type": "communicate", "text": "A letter!"}, "ok")
    refused = run.at(run.last).agents["assistant_0"]
    assert (refused.status, refused.code) == ("refused", "out_of_range")
    assert "out of range" in refused.reason
    riding = run.at(steps["mount first"]).agents["assistant_0"]
    assert (riding.clip, riding.vehicle > 0) == ("ride_bike", True)
    assert [e["kind"] for e in run.at(steps["letter"]).events] == ["message"]


# Random access.


def test_a_step_read_by_itself_is_the_one_in_the_whole(path: Path) -> None:
    run = read_run(path)
    tracks, events = run.tracks(), run.events
    for step in (0, 1, SEGMENT_STEPS - 1, SEGMENT_STEPS, SEGMENT_STEPS + 1, STEPS):
        moment = read_run(path).at(step)
        there = np.isfinite(tracks.yaw[step])
        assert moment.entity.tolist() == tracks.entity[there].tolist()
        np.testing.assert_array_equal(moment.position, tracks.position[step, there])
        np.testing.assert_array_equal(moment.yaw, tracks.yaw[step, there])
        assert (moment.time, moment.hash) == (run.times[step], run.hashes[step])
        assert moment.events == [event for event in events if event["step"] == step]
    part = run.tracks(50, 70)
    np.testing.assert_array_equal(part.position, tracks.position[50:71])


def test_steps_that_were_not_recorded_are_refused(path: Path) -> None:
    for first, last in ((-1, 3), (0, STEPS + 1), (5, 4)):
        with pytest.raises(InputError, match="there are steps 0 to 100"):
            read_run(path).table("bodies", first, last)


def test_what_is_recorded_is_the_state_to_a_millimetre(path: Path) -> None:
    run, sim = read_run(path), residents()
    for step in run.checkpoints:
        sim.restore(run.checkpoint(step).arrays)
        p, moment = sim.state.people, run.at(step)
        rows = [moment.entity.tolist().index(entity) for entity in p.entity.tolist()]
        assert np.abs(moment.position[rows] - p.position).max() <= 0.00051
        assert np.abs(np.sin(moment.yaw[rows] - p.yaw)).max() <= 0.000051
        assert sim.state_hash() == moment.hash


# Going on after a kill.


def residents() -> Simulation:
    """The toy city's people, one of whom sees."""
    config = SimConfig(start=8 * 3600 - 20, observe=("resident_2",), image=64)
    return Simulation(toy_city.world(), toy_city.community(), config)


def go_on(recorder: Recorder, agents: dict[str, Any], until: int, *, begin: bool = True) -> None:
    """Simulate and record up to a step, with checkpoints."""
    sim = recorder.sim
    observations, infos = sim.observe()
    if begin:
        recorder.begin(observations)
    while sim.metrics.steps < until:
        actions = {name: agent.act(observations[name], infos[name]) for name, agent in agents.items()}
        result = sim.step(actions)
        observations, infos = result.observations, result.infos
        recorder.write(result, actions=actions)
        if recorder.checkpoint_due:
            states = {name: agent.state() for name, agent in agents.items()}
            recorder.checkpoint(states, {"faults": [sim.metrics.steps]})


def fresh(out: Path) -> tuple[Recorder, dict[str, Any]]:
    """A new recording, and agents that follow their schedules."""
    sim = residents()
    agents = followers_of(toy_city.community(), PublicMap.from_world(sim.world))
    return Recorder(out, sim, sources={"world": "toy"}, wanted=STEPS, states_every=EVERY), dict(agents)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that nobody interrupted."""
    out = tmp_path_factory.mktemp("runs") / "whole"
    recorder, agents = fresh(out)
    go_on(recorder, agents, STEPS)
    recorder.close()
    return out


def contents(folder: Path) -> dict[str, Any]:
    """Every file of a run by name, but for what wall-clock figures stand in."""
    found: dict[str, Any] = {}
    for file in sorted(folder.rglob("*")):
        if file.is_file() and file.name != "clock.json":
            found[file.relative_to(folder).as_posix()] = file.read_bytes()
    metrics = json.loads(found["metrics.json"])
    for name in ("wall_seconds", "real_time_factor", "peak_rss_mb", "seconds_by_phase"):
        del metrics[name]
    return found | {"metrics.json": metrics}


KILLED = """
import os, shutil, sys
from pathlib import Path
sys.path[:0] = {folders!r}
from test_recording import EVERY, fresh, go_on
recorder, agents = fresh(Path(sys.argv[1]))
go_on(recorder, agents, EVERY)
shutil.copytree(sys.argv[1], sys.argv[2])
go_on(recorder, agents, 95, begin=False)
os.kill(os.getpid(), 9)
"""


@pytest.fixture(scope="module")
def left(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    """What a process leaves that is killed after 95 steps, and what it would have left after some fewer."""
    here, folder = Path(__file__).parent, tmp_path_factory.mktemp("killed")
    code = KILLED.format(folders=[str(here), str(here.parent)])
    found = {after: folder / f"after_{after}" for after in (95, EVERY)}
    process = subprocess.run([sys.executable, "-c", code, *map(str, found.values())], check=False)
    assert process.returncode == -signal.SIGKILL
    return found


@pytest.mark.parametrize("killed_after", [EVERY, 95])
def test_a_killed_run_goes_on_to_the_same_folder(path: Path, left: dict[int, Path], killed_after: int) -> None:
    out = left[killed_after]
    killed = read_run(out)
    assert not killed.complete
    assert killed.last == {EVERY: EVERY, 95: 80}[killed_after]
    assert killed.hashes == read_run(path).hashes[: killed.last + 1]
    sim = residents()
    agents: dict[str, Any] = dict(followers_of(toy_city.community(), PublicMap.from_world(sim.world)))
    recorder, checkpoint = Recorder.resume(out, sim, sources={"world": "toy"}, wanted=STEPS, states_every=EVERY)
    assert checkpoint.step == sim.metrics.steps == EVERY * (killed_after // EVERY)
    assert checkpoint.notes == {"faults": [checkpoint.step]}
    for name, agent in agents.items():
        agent.restore(checkpoint.agents[name])
    go_on(recorder, agents, STEPS)
    recorder.close()
    assert contents(out) == contents(path)
    assert [step for step, _ in read_run(out).views["resident_2"].frames()] == list(range(STEPS + 1))


def test_only_an_interrupted_run_of_the_same_kind_goes_on(path: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="complete"):
        Recorder.resume(path, residents(), sources={}, wanted=STEPS)
    with pytest.raises(MissingFileError):
        Recorder.resume(tmp_path, residents(), sources={}, wanted=STEPS)
    recorder, agents = fresh(tmp_path / "short")
    go_on(recorder, agents, 5)
    recorder.close("stopped")
    with pytest.raises(EmptyInputError, match="before its first checkpoint"):
        Recorder.resume(tmp_path / "short", residents(), sources={}, wanted=STEPS)
    recorder, agents = fresh(tmp_path / "other")
    go_on(recorder, agents, EVERY)
    recorder.close("stopped")
    with pytest.raises(SchemaError, match="another version, world, community or configuration"):
        Recorder.resume(tmp_path / "other", assistant(), sources={}, wanted=STEPS)


# Reading while it is written.


def test_a_run_is_read_while_another_process_writes_it(path: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    recorder, agents = fresh(out)
    go_on(recorder, agents, SEGMENT_STEPS)
    reader = (
        "import sys; from pathlib import Path; from vico.sim.recording import read_run\n"
        "run = read_run(Path(sys.argv[1])); print(run.last, run.complete, run.at(run.last).hash, flush=True)\n"
        "sys.stdin.readline(); print(run.refresh(), run.last, run.at(run.last).hash)\n"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", reader, str(out)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment) as other:
        assert other.stdin is not None
        assert other.stdout is not None
        hashes = read_run(path).hashes
        assert other.stdout.readline().split() == ["60", "False", hashes[60]]
        go_on(recorder, agents, 80, begin=False)
        other.stdin.write("\n")
        other.stdin.flush()
        assert other.stdout.readline().split() == ["True", "80", hashes[80]]
    recorder.close("stopped")


# Actions as text.


@pytest.mark.parametrize(
    ("action", "text"),
    [
        ({"type": "wait"}, '{"type": "wait"}'),
        ({"type": "control", "vector": np.array([0.5, np.nan])}, '{"type": "control", "vector": [0.5, "nan"]}'),
        ({1: {2}, "x": 10**5000}, '{"<int>": "<set>", "x": "a whole number beyond 64 bits"}'),
        ({"type": "communicate", "text": "\ud800"}, '{"type": "communicate", "text": "?"}'),
        ("jump", '"jump"'),
    ],
)
def test_any_action_can_be_told(action: Any, text: str) -> None:
    assert action_text(action) == text


def test_an_action_without_end_is_told_in_short() -> None:
    told = action_text({"type": "control", "vector": [0.0] * 100_000})
    assert json.loads(told)["type"] == "control"
    assert len(told) < LONGEST_ACTION
    endless: dict[str, Any] = {"type": "wait"}
    endless["again"] = endless
    assert len(action_text(endless)) < LONGEST_ACTION


# Joint poses.


def test_joint_poses_are_those_that_were_drawn(path: Path) -> None:
    run, sim = read_run(path), residents()
    renderer = sim.renderer
    people = PosedPeople(run)
    for step in run.checkpoints:
        sim.restore(run.checkpoint(step).arrays)
        p, posed = sim.state.people, people.at(step)
        assert posed.entity.tolist() == p.entity.tolist()
        after = Transition(p.clip_before, p.phase_before, p.pace_before, p.clip_time)
        style = renderer._people.style  # type: ignore[attr-defined]
        rotations, offsets = pose(p.clip, p.phase, p.pace, style, second=sim.state.second, after=after)
        assert posed.rotations.shape == (len(p), 55, 3)
        assert np.abs(posed.rotations - rotations).max() < 0.01
        assert np.abs(posed.offsets - offsets).max() < 0.002


def test_nobody_is_posed_who_was_not_there(path: Path) -> None:
    with pytest.raises(InputError, match="no person with the number 5"):
        PosedPeople(read_run(path)).at(3, [5])


# Runs of another version.


def test_a_run_of_version_1_is_refused_with_what_to_type(tmp_path: Path) -> None:
    manifest = {
        "schema_name": "vico.run", "version": 1, "producer": "vico 0.3", "status": "complete", "seed": 4,
        "wanted_steps": 1800, "world": {"path": "my demo/world"}, "community": {"path": "my demo/people"},
        "config": {"cars": 30, "robots": ["husky", "go2"], "observe": []},
    }  # fmt: skip
    (tmp_path / "run.json").write_text(json.dumps(manifest))
    with pytest.raises(SchemaError) as refused:
        read_run(tmp_path)
    said = str(refused.value)
    assert "a run of version 1 of the format, written by vico 0.3" in said
    command = f"vico run 'my demo/world' 'my demo/people' --seed 4 --steps 1800 --out {tmp_path} --cars 30"
    assert f"{command} --robots husky,go2 --observe none --force" in said
    assert "\n" not in said


# Damage.


def read_all(out: Path) -> tuple[Any, ...]:
    """Read what other tests damage."""
    run = read_run(out)
    return run.table("bodies"), run.checkpoint(40), run.cast


def test_a_damaged_file_is_named_in_one_sentence(path: Path, tmp_path: Path) -> None:
    for name in (
        "segments/00000000-00000040/bodies.parquet",
        "checkpoints/00000040/simulation.npz",
        "checkpoints/00000040/agents.bin",
        "cast.jsonl",
    ):
        out = tmp_path / name.replace("/", "_")
        shutil.copytree(path, out)
        content = (out / name).read_bytes()
        middle = len(content) // 2
        (out / name).write_bytes(content[: middle - 40] + bytes(80) + content[middle + 40 :])
        with pytest.raises(SchemaError, match=name) as damaged:
            read_all(out)
        assert "\n" not in str(damaged.value)


def test_what_a_writer_left_unfinished_is_not_read(path: Path, tmp_path: Path) -> None:
    shutil.copytree(path, tmp_path / "run")
    last = tmp_path / "run" / "segments" / "00000081-00000100"
    last.rename(last.with_name(f".{last.name}.partial"))
    with (tmp_path / "run" / "cast.jsonl").open("ab") as cast:
        cast.write(b'{"step": 95, "ent')
    run = read_run(tmp_path / "run")
    assert run.last == 80
    assert len(run.cast) == 3
    assert run.checkpoints == [40, 80]


# Size.


def test_a_minute_of_a_standing_crowd_takes_little(tmp_path: Path) -> None:
    sim = Simulation(toy_city.world(), None, SimConfig(assistants=30, observe=()))
    recorder = Recorder(tmp_path / "run", sim, sources={}, wanted=SEGMENT_STEPS)
    recorder.begin({})
    for _ in range(SEGMENT_STEPS):
        recorder.write(sim.step({}))
    recorder.close()
    segment = tmp_path / "run" / "segments" / "00000000-00000060"
    # Nothing moves but the chests of 30 people who breathe: what is left is mostly the files' own heads.
    assert sum(file.stat().st_size for file in segment.iterdir()) < 20_000


# A city's recording.


def test_pedestrians_are_posed_and_robots_have_joints(helsinki_run: tuple[Path, dict[str, Any]]) -> None:
    run = read_run(helsinki_run[0])
    walkers = [member.entity for member in run.cast.values() if member.kind == "pedestrian"]
    assert len(walkers) == 3
    before, after = (PosedPeople(run).at(step, walkers).rotations for step in (run.last - 1, run.last))
    assert np.isfinite(after).all()
    # Whoever walks or breathes holds no pose for a second.
    assert (np.abs(after - before).max(axis=(1, 2)) > 1e-4).all()
    robot = run.at(run.last).agents["robot_0"]
    assert len(robot.joints) > 0
    assert robot.clip == ""
    bases = run.columns("robots")
    length = np.sqrt(sum(bases[key] ** 2 for key in ("qw", "qx", "qy", "qz")))
    assert length == pytest.approx(np.ones(len(length)), abs=2e-4)
