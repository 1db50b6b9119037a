"""Agents that crash, sleep, lie or cheat: the run goes on as if they waited, and says who did what."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

import planted_agents
import toy_city
from vico.agents.schedule import followers_of
from vico.runner.foreign import IsolatedAgent, Terms, foreign_agents
from vico.runner.gather import Fault, Gatherer
from vico.runner.loading import AgentSeat
from vico.runner.loop import Hook, Runner, Step
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.world.public import PublicMap

STEPS = 6

BOTH = pytest.mark.parametrize("isolate", [False, True], ids=["in-process", "isolated"])


class Messages(Hook):
    """Keeps what was said."""

    def __init__(self) -> None:
        self.said: list[str] = []

    def on_step(self, step: Step) -> None:
        """Listen."""
        self.said += [event.text for event in step.result.events if event.kind == "message"]


def play(
    name: str, folder: Path, *, isolate: bool, steps: int = STEPS, deadline: float | None = None, image: bool = False
) -> tuple[Runner, str, list[str]]:
    """Let a planted agent be the assistant among residents; return the runner, the last hash, and what was said."""
    world = toy_city.world()
    observe = ("assistant_0",) if image else ()
    sim = Simulation(world, toy_city.community(), SimConfig(assistants=1, observe=observe, image=32))
    world.path = folder  # isolated agents could read their map there; none of the planted ones does
    terms = Terms(deadline=deadline, isolate=isolate)
    spec = f"{planted_agents.__file__}:{name}"
    players = foreign_agents(spec, [AgentSeat("assistant_0")], world, terms)
    followers = followers_of(toy_city.community(), PublicMap.from_world(world))
    agents = Gatherer(followers | players, trusted=followers, deadline=terms.deadline)
    listener = Messages()
    runner = Runner(sim, agents, hooks=[listener])
    try:
        runner.run(steps)
    finally:
        agents.close()
    return runner, sim.state_hash(), listener.said


def first(runner: Runner) -> Fault:
    return runner.faults.first[0]


@BOTH
def test_an_honest_agent_has_no_faults_and_says_what_it_spent(tmp_path: Path, isolate: bool) -> None:
    runner, _, _ = play("Honest", tmp_path, isolate=isolate)
    assert runner.faults.count == 0
    assert runner.agents.agents["assistant_0"].tokens == 10 * STEPS  # type: ignore[attr-defined]


@BOTH
def test_one_that_crashes_is_asked_again_each_step(tmp_path: Path, isolate: bool) -> None:
    runner, _, _ = play("Crasher", tmp_path, isolate=isolate)
    assert runner.faults.by_agent() == {"assistant_0": {"crashed": STEPS}}
    assert first(runner) == Fault(1, "assistant_0", "crashed", "ZeroDivisionError: no plan")


@BOTH
def test_errors_that_cannot_be_shown_and_exits_are_crashes(tmp_path: Path, isolate: bool) -> None:
    runner, _, _ = play("Mumbler", tmp_path, isolate=isolate)
    assert runner.faults.by_agent() == {"assistant_0": {"crashed": STEPS}}
    assert [fault.reason for fault in runner.faults.first[:2]] == ["Unspeakable", "SystemExit: 0"]


def test_one_whose_process_ends_waits_for_the_rest_of_the_run(tmp_path: Path) -> None:
    runner, _, _ = play("Quitter", tmp_path, isolate=True)
    assert runner.faults.by_agent() == {"assistant_0": {"ended": STEPS - 2}}
    assert first(runner) == Fault(3, "assistant_0", "ended", "its process ended with exit status 7")


@BOTH
def test_one_that_never_answers_is_late(tmp_path: Path, isolate: bool) -> None:
    runner, _, _ = play("Sleeper", tmp_path, isolate=isolate, deadline=0.3)
    assert runner.faults.by_agent() == {"assistant_0": {"late": STEPS}}
    assert [fault.reason for fault in runner.faults.first[:2]] == [
        "no action within 0.3 s",
        "still busy with an earlier step",
    ]


@BOTH
def test_every_lie_is_refused(tmp_path: Path, isolate: bool) -> None:
    runner, _, _ = play("Liar", tmp_path, isolate=isolate, steps=len(planted_agents.LIES))
    assert runner.faults.by_agent() == {"assistant_0": {"malformed": len(planted_agents.LIES)}}
    assert all(len(fault.reason) <= 300 for fault in runner.faults.first)
    told = "\n".join(fault.reason for fault in runner.faults.first)
    for words in ("distance is nan", "nobody_7", "10000000 characters", "dict with a 'type', not NoneType"):
        assert words in told


@pytest.mark.parametrize("name", ["Crasher", "Mumbler", "Liar", "Vandal", "Sleeper"])
def test_the_world_goes_on_as_if_they_had_waited(tmp_path: Path, name: str) -> None:
    def outcome(name: str) -> list[object]:
        world = toy_city.world()
        sim = Simulation(world, toy_city.community(), SimConfig(assistants=1, observe=("assistant_0",), image=32))
        players = foreign_agents(f"{planted_agents.__file__}:{name}", [AgentSeat("assistant_0")], world, Terms())
        followers = followers_of(toy_city.community(), PublicMap.from_world(world))
        agents = Gatherer(followers | players, trusted=followers, deadline=2.0)
        Runner(sim, agents).run(3)
        agents.close()
        # All but how the assistant's last action went.
        about = ("status", "reason", "code")
        return [(key, array.tolist()) for key, array in sim.arrays().items() if not any(part in key for part in about)]

    assert outcome(name)[1:] == outcome("Honest")[1:]


def test_overwriting_what_one_is_given_changes_nothing(tmp_path: Path) -> None:
    honest = play("Honest", tmp_path, isolate=False, image=True)[1]
    runner, vandals, _ = play("Vandal", tmp_path, isolate=False, image=True)
    assert runner.agents.agents["assistant_0"].spoiled >= 8 * STEPS  # type: ignore[attr-defined]
    assert runner.faults.count == 0
    assert vandals == honest


def test_in_a_process_of_its_own_nobody_may_look_for_the_simulation(tmp_path: Path) -> None:
    # In this process there is one, so the search does find what there is.
    said = [text for text in play("Spy", tmp_path, isolate=False, steps=1)[2] if text.startswith("found ")]
    assert len(said) == 1
    assert said != ["found 0"]
    runner, _, heard = play("Spy", tmp_path, isolate=True, steps=1)
    assert not any(text.startswith("found ") for text in heard)
    assert runner.faults.by_agent() == {"assistant_0": {"unfair": 1}}


def test_memory_is_limited(tmp_path: Path) -> None:
    runner, _, _ = play("Glutton", tmp_path, isolate=True, steps=1)
    assert runner.faults.by_agent() == {"assistant_0": {"crashed": 1}}
    assert "emoryError" in first(runner).reason


@BOTH
def test_a_function_is_an_agent(tmp_path: Path, isolate: bool) -> None:
    runner, _, said = play("function", tmp_path, isolate=isolate, steps=1, image=True)
    assert runner.faults.count == 0
    assert "6" in said  # pose, rgb, depth, segmentation, extrinsics, intrinsics


def test_a_process_ends_with_its_agent(tmp_path: Path) -> None:
    agent = IsolatedAgent(f"{planted_agents.__file__}:Sleeper", AgentSeat("assistant_0"), world=tmp_path)
    agent.close()
    assert agent._process.returncode is not None
    agent.close()  # once more does no harm


HOLDER = """
import sys, time
from pathlib import Path
from vico.runner.foreign import IsolatedAgent
from vico.runner.loading import AgentSeat
agent = IsolatedAgent(sys.argv[1], AgentSeat("assistant_0"), world=Path("nowhere"))
print(agent._process.pid, flush=True)
agent.act({}, {})
"""


@pytest.mark.skipif(
    not Path("/proc/self/stat").exists(), reason="no /proc here to tell a running process from an ended one"
)
def test_a_process_ends_with_a_run_that_is_killed(tmp_path: Path) -> None:
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", HOLDER, f"{planted_agents.__file__}:Sleeper"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as run:
        assert run.stdout is not None
        agent = int(run.stdout.readline())
        os.kill(agent, 0)  # it is there
        run.kill()
    deadline = time.monotonic() + 60
    while _is_alive(agent):
        assert time.monotonic() < deadline
        time.sleep(0.02)


def _is_alive(process: int) -> bool:
    """Whether a process runs; one that has ended and was not waited for doesn't."""
    try:
        status = Path(f"/proc/{process}/stat").read_text(encoding="utf-8")
    except OSError:
        return False
    return status.rpartition(")")[2].split()[0] != "Z"
