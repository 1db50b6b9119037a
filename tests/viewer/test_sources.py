"""Frames: their bytes, and that a run that goes on gives the same ones as its recording."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import toy_city
from helsinki_traffic import network, traffic_by
from road_city import HALF
from vico.agents.schedule import followers_of
from vico.errors import InputError, SchemaError
from vico.runner.gather import FaultLog, Gatherer
from vico.runner.loop import Hook, Runner, Step
from vico.runner.recording import RecordedRun
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.recording.recorder import Recorder
from vico.sim.traffic import JunctionRule
from vico.viewer.sources.frames import FRAME_COLUMNS, NEWEST, decode_frame
from vico.viewer.sources.source import Source, heads_on, signals_of
from vico.viewer.sources.tables import LiveTables
from vico.viewer.sources.views import RecordedViews
from vico.world.heights import HeightField
from vico.world.public import PublicMap

STEPS = 70


class Watcher(Hook):
    """Keeps the steps of a run, as the live viewer does, and looks at each as soon as it is there."""

    def __init__(self, out: Path, recorder: Recorder, world: Any) -> None:
        self.tables, self.recorder, self.world = LiveTables(out, kept=20), recorder, world
        self.seen: list[bytes] = []
        self.moments: list[dict[str, Any]] = []
        self.source: Source | None = None

    def begin(self, observations: Any) -> None:
        self.source = Source(self.tables.out, self.tables, self.world, live=True)
        self._look(0)

    def on_step(self, step: Step) -> None:
        self._look(step.number)

    def _look(self, step: int) -> None:
        assert self.source is not None
        self.tables.add(step, self.recorder.latest, self.recorder.latest_cast)
        self.seen.append(next(self.source.frames(step, step)).to_bytes())
        self.moments.append(self.source.moment(step))


@pytest.fixture(scope="module")
def watched(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Watcher]:
    """A run of the toy city with a robot, watched while it went on."""
    out = tmp_path_factory.mktemp("runs") / "run"
    world, people = toy_city.world(), toy_city.community()
    config = SimConfig(observe=("resident_0",), image=64, robots=("husky",), weather="changing", start=28_790)
    sim = Simulation(world, people, config)
    agents = Gatherer(followers := followers_of(people, PublicMap.from_world(world), seed=0), trusted=followers)
    with Recorder(out, sim, sources={}, wanted=STEPS) as recorder:
        watcher = Watcher(out, recorder, world)
        Runner(sim, agents, hooks=[RecordedRun(recorder, FaultLog()), watcher]).run(STEPS)
    return out, watcher


@pytest.fixture(scope="module")
def recorded(watched: tuple[Path, Watcher]) -> Source:
    """The same run, read from its folder."""
    source = Source.of_run(watched[0])
    source.world, source.skylight = watched[1].world, watched[1].source.skylight  # type: ignore[union-attr]
    return source


def test_a_frame_survives_its_bytes(recorded: Source) -> None:
    frame = next(recorded.frames(30, 30))
    again, flags, range_id = decode_frame(frame.to_bytes(flags=NEWEST, range_id=7))
    assert (again.step, again.time, flags, range_id) == (30, 28_820.0, NEWEST, 7)
    np.testing.assert_array_equal(again.sky, frame.sky)
    for table, form in FRAME_COLUMNS.items():
        for key in form:
            np.testing.assert_array_equal(again.tables[table][key], frame.tables[table][key])
    assert len(again.tables["robots"]["entity"]) == 1
    assert len(again.tables["people"]["entity"]) == 3


def test_bytes_that_are_no_frame_are_refused(recorded: Source) -> None:
    content = next(recorded.frames(3, 3)).to_bytes()
    for broken in (b"", content[:50], content[:-8], b"X" + content[1:]):
        with pytest.raises(SchemaError):
            decode_frame(broken)


def test_a_run_that_goes_on_gives_the_frames_of_its_recording(watched: tuple[Path, Watcher], recorded: Source) -> None:
    frames = [frame.to_bytes() for frame in recorded.frames(0, STEPS)]
    assert watched[1].seen == frames


def test_moments_are_the_same_too(watched: tuple[Path, Watcher], recorded: Source) -> None:
    assert watched[1].moments == [recorded.moment(step) for step in range(STEPS + 1)]
    assert recorded.moment(STEPS)["agents"]["resident_0"]["status"] in ("ok", "collision", "refused")


def test_steps_that_memory_has_forgotten_are_read_from_the_disk(
    watched: tuple[Path, Watcher], recorded: Source
) -> None:
    live = watched[1].source
    assert live is not None
    newer = [frame.to_bytes() for frame in live.frames(5, STEPS, 5)]
    assert newer == [frame.to_bytes() for frame in recorded.frames(5, STEPS, 5)]
    assert live.events(0, STEPS) == recorded.events(0, STEPS)
    assert live.cast() == recorded.cast()
    assert live.metrics(0, STEPS, 10) == recorded.metrics(0, STEPS, 10)


def test_the_head_tells_when_every_step_is(recorded: Source) -> None:
    head = recorded.head()
    assert head["pieces"] == [{"first": 0, "time": 28_790.0, "period": 1.0}]
    assert head["run"]["last"] == STEPS
    assert [agent["name"] for agent in head["agents"]][-1] == "robot_0"


def test_places_people_and_what_was_said_are_found(recorded: Source) -> None:
    assert recorded.search("Cleo")["hits"][0]["name"] == "resident_2"
    assert recorded.search("shop")["hits"][0]["what"] in ("place", "agent")
    assert recorded.search("")["hits"] == []


def test_steps_that_are_not_there_are_refused(recorded: Source) -> None:
    with pytest.raises(InputError, match="0 to 70"):
        list(recorded.frames(60, 90))


def test_a_run_from_before_the_weather_was_recorded_has_a_sun_and_no_weather(
    watched: tuple[Path, Watcher], recorded: Source, tmp_path: Path
) -> None:
    import shutil

    old = shutil.copytree(watched[0], tmp_path / "old")
    for path in old.glob("segments/*/weather.parquet"):
        path.unlink()
    source = Source.of_run(old)
    source.skylight = recorded.skylight
    sky = next(source.frames(3, 3)).sky
    assert np.isfinite(sky[:4]).all()
    assert np.isnan(sky[4:15]).all()


def test_pictures_of_what_nobody_filmed_say_why_there_are_none(recorded: Source) -> None:
    run = recorded.tables.run
    assert run is not None
    views = RecordedViews(run)
    assert views.view("resident_0", 10, "rgb")[1] == "image/jpeg"
    with pytest.raises(InputError, match="resident_1"):
        views.view("resident_1", 10, "rgb")


def test_signals_of_a_browser_are_those_that_are_drawn() -> None:
    traffic = traffic_by(JunctionRule.SIGNALS, 1)
    told = heads_on(network(), HeightField.flat(HALF), 1)
    assert {head["kind"] for head in told["heads"]} >= {"signal", "signal_post"}
    for second in (0, 17, 30, 61, 100):
        traffic.set_signals(second, ())
        drawn = traffic.draw()
        expected = [drawn.prototypes[k] for k in drawn.index if drawn.prototypes[k].startswith(("signal_", "walk_"))]
        found = [_prototype(head, told["cycles"], second) for head in told["heads"]]
        assert sorted(found) == sorted(expected)


def _prototype(head: dict[str, Any], cycles: list[str], second: int) -> str:
    if head["kind"] == "signal_post":
        return "signal_post"
    cycle = cycles[head["cycle"]]
    light = {"g": "green", "a": "amber", "r": "red"}[cycle[second % len(cycle)]]
    return f"{head['kind']}_{'red' if head['kind'] == 'walk' and light == 'amber' else light}"


def test_where_no_signals_are_obeyed_none_are_told() -> None:
    told = signals_of(toy_city.world(), "one", 0)
    assert told == {"cycles": [], "heads": [], "dark_events": ["power_cut"]}
