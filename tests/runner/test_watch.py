"""Planted cheaters are caught, each in what it does; honest agents are not taken for cheaters."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import planted_agents
import toy_city
from vico.runner.check import AgentCheck, check_agent
from vico.runner.foreign import Terms, foreign_agents
from vico.runner.gather import Fault, Gatherer
from vico.runner.loading import AgentSeat
from vico.runner.loop import Runner
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation


def check(name: str, folder: Path) -> AgentCheck:
    world = toy_city.world()
    world.path = folder
    return check_agent(f"{planted_agents.__file__}:{name}", world, steps=4, traffic=0, deadline=30.0, isolate=True)


@pytest.mark.parametrize(
    ("name", "promise", "says"),
    [
        ("Searcher", "fair", "searches the process's objects"),
        ("Spy", "fair", "imports vico.sim.loop"),
        ("SideDoor", "fair", "imports vico.runner.truth"),
        ("FrameWalker", "fair", "looks at the frames"),
        ("Inspector", "fair", "looks at the frames"),
        ("Thief", "fair", "reads the world's folder"),
        ("Sly", "fair", "reads the world's folder"),
        ("Generator", "fair", "imports vico.challenges"),
        ("Killer", "fair", "signals the process that judges it"),
        ("Teleporter", "leaves", "changes the observation"),
        ("Impostor", "action", "agent"),
        ("Puppeteer", "action", "assistant_0"),
        ("Driver", "action", "robot"),
    ],
)
def test_a_cheater_is_caught(
    name: str, promise: str, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "task.json").write_text(json.dumps({"the parcel": [1, 2, 3]}))
    monkeypatch.setenv("PLANTED_WORLD", str(tmp_path))
    findings = {finding.promise: finding.what for finding in check(name, tmp_path).findings}
    assert says in findings.get(promise, ""), findings


@pytest.mark.parametrize("name", ["Honest", "Respectable"])
def test_an_honest_agent_is_not_taken_for_one(name: str, tmp_path: Path) -> None:
    assert check(name, tmp_path).findings == []


def test_a_run_goes_on_and_counts_what_was_unfair(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "task.json").write_text("{}")
    monkeypatch.setenv("PLANTED_WORLD", str(tmp_path))
    world = toy_city.world()
    sim = Simulation(world, toy_city.community(), SimConfig(assistants=1, observe=()))
    world.path = tmp_path
    spec = f"{planted_agents.__file__}:Sly"
    agents = Gatherer(foreign_agents(spec, [AgentSeat("assistant_0")], world, Terms(isolate=True)))
    runner = Runner(sim, agents)
    before = sim.observe()[0]["assistant_0"]["pose"].copy()
    try:
        runner.run(3)
    finally:
        agents.close()
    assert runner.faults.by_agent() == {"assistant_0": {"unfair": 3}}
    reason = "reads the world's folder; agents are given observations and the public map"
    assert runner.faults.first[0] == Fault(1, "assistant_0", "unfair", reason)
    assert (sim.observe()[0]["assistant_0"]["pose"] == before).all()


def test_a_module_that_reaches_too_far_is_refused_when_it_is_loaded(tmp_path: Path) -> None:
    source = tmp_path / "mine.py"
    source.write_text("from vico.challenges import records\nfrom planted_agents import Honest\n")
    world = toy_city.world()
    world.path = tmp_path / "world"
    world.path.mkdir()
    found = check_agent(f"{source}:Honest", world, steps=4, traffic=0, isolate=True)
    assert [(finding.promise, finding.where) for finding in found.findings] == [("fair", "")]
    assert "imports vico.challenges" in found.findings[0].what
