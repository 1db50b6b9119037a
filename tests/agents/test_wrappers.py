"""Functions, policies and classes without a state are agents; where a state is needed they say what is missing."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vico.agents.base import NoStateError, as_agent, usage_of
from vico.errors import InputError


def turn(observation: dict[str, Any], info: dict[str, Any]) -> dict[str, Any]:
    return {"type": "turn_left", "degrees": observation["degrees"]}


class Counting:
    """A recurrent policy: its state counts its predictions."""

    def predict(self, observation: dict[str, Any], state: Any = None) -> tuple[dict[str, Any], Any]:
        count = np.zeros(1) if state is None else state
        return {"type": 0, "amount": float(count[0])}, count + 1


class Motors:
    """A policy of a robot."""

    def predict(self, observation: dict[str, Any]) -> Any:
        return np.array([0.5, -0.5])


def test_a_function_acts_and_has_no_state() -> None:
    agent = as_agent(turn)
    assert agent.act({"degrees": 5.0}, {}) == {"type": "turn_left", "degrees": 5.0}
    with pytest.raises(NoStateError, match=r"turn: has no state\(\) and restore\(state\)"):
        agent.state()


def test_what_remembers_nothing_may_say_so() -> None:
    class Plain:
        stateless = True

        def act(self, observation: dict[str, Any], info: dict[str, Any]) -> dict[str, Any]:
            return {"type": "wait"}

    agent = as_agent(Plain())
    agent.restore(agent.state())
    assert agent.state() == {}


def test_a_policys_recurrent_state_is_its_state() -> None:
    agent = as_agent(Counting())
    amounts = [agent.act({}, {})["amount"] for _ in range(3)]
    fresh = as_agent(Counting())
    fresh.restore(agent.state())
    assert amounts == [0.0, 1.0, 2.0]
    assert fresh.act({}, {}) == agent.act({}, {}) == {"type": 0, "amount": 3.0}


def test_a_robots_policy_may_give_the_vector_alone() -> None:
    action = as_agent(Motors()).act({}, {})
    assert action["type"] == "control"
    assert action["vector"].tolist() == [0.5, -0.5]


def test_what_does_not_act_is_refused() -> None:
    with pytest.raises(InputError, match="player: a int is no agent"):
        as_agent(3, name="player")


def test_what_is_spent_has_to_be_a_number() -> None:
    class Boaster:
        tokens, cost = "many", float("nan")

    assert usage_of(Boaster()) == usage_of(object()) == (0, 0.0)
