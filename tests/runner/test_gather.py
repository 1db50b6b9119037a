"""Agents that crash or dawdle wait; the run goes on."""

from __future__ import annotations

import threading
import time
from typing import Any

import toy_city
from vico.rules import ActionStatus
from vico.runner.gather import Gatherer
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation


class Crasher:
    """Fails at once."""

    def act(self, observation: dict[str, Any], info: dict[str, Any]) -> dict[str, Any]:
        raise ZeroDivisionError("no plan")


class Dawdler:
    """Waits for a signal before it answers."""

    def __init__(self) -> None:
        self.signal = threading.Event()

    def act(self, observation: dict[str, Any], info: dict[str, Any]) -> dict[str, Any]:
        self.signal.wait(20)
        return {"type": "wait"}


def test_a_crashing_agent_waits_and_the_run_says_so() -> None:
    sim = Simulation(toy_city.world(), None, SimConfig(assistants=1, observe=()))
    gathered = Gatherer({"assistant_0": Crasher()}).gather(*sim.observe())
    result = sim.step(gathered.actions, gathered.agent_faults)
    state = result.observations["assistant_0"]["state"]
    assert (state["action_status"], state["action_reason"]) == ("failed", "ZeroDivisionError: no plan")
    assert [event.kind for event in result.events] == ["agent_failed"]


def test_a_late_agent_waits_until_it_is_done() -> None:
    sim = Simulation(toy_city.world(), None, SimConfig(assistants=1, observe=()))
    dawdler = Dawdler()
    gatherer = Gatherer({"assistant_0": dawdler}, deadline=0.05)
    first = gatherer.gather(*sim.observe())
    second = gatherer.gather(*sim.observe())
    dawdler.signal.set()
    gatherer.close()
    assert first.agent_faults["assistant_0"][0] is second.agent_faults["assistant_0"][0] is ActionStatus.LATE
    result = sim.step(first.actions, first.agent_faults)
    assert result.observations["assistant_0"]["state"]["action_status"] == "late"


def test_late_agents_are_waited_for_together() -> None:
    sim = Simulation(toy_city.world(), None, SimConfig(assistants=10, observe=()))
    dawdlers = {f"assistant_{i}": Dawdler() for i in range(10)}
    gatherer = Gatherer(dawdlers, deadline=1.0)
    begun = time.monotonic()
    gathered = gatherer.gather(*sim.observe())
    waited = time.monotonic() - begun
    for dawdler in dawdlers.values():
        dawdler.signal.set()
    gatherer.close()
    assert {status for status, _ in gathered.agent_faults.values()} == {ActionStatus.LATE}
    assert waited < 5.0  # one after the other they would take ten
