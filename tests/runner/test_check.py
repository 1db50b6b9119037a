"""What breaks the contract is found, with what is wrong; what keeps it is not."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

import planted_agents
import toy_city
from vico.runner.check import AgentCheck, check_agent

STEPS = 12


class Forgetful(planted_agents.Honest):
    """Leaves its count out of its state."""

    def act(self, observation: dict[str, Any], info: dict[str, Any]) -> dict[str, Any]:
        self.count += 1
        return {"type": "turn_left", "degrees": float(self.count)}

    def state(self) -> dict[str, Any]:
        return {"count": 0}


class Moody(planted_agents.Honest):
    """Draws from a stream of chance that nobody seeded."""

    def act(self, observation: dict[str, Any], info: dict[str, Any]) -> dict[str, Any]:
        return {"type": "turn_left", "degrees": float(os.urandom(1)[0])}


class Marker(planted_agents.Honest):
    """Writes into what it sees."""

    def act(self, observation: dict[str, Any], info: dict[str, Any]) -> dict[str, Any]:
        observation["pose"] += 1.0
        return {"type": "wait"}


class Spender(planted_agents.Honest):
    """Says it earned money."""

    def act(self, observation: dict[str, Any], info: dict[str, Any]) -> dict[str, Any]:
        self.cost = -1.0
        return {"type": "wait"}


def check(spec: str, **options: Any) -> AgentCheck:
    return check_agent(spec, toy_city.world(), steps=STEPS, traffic=0, **options)


@pytest.mark.parametrize("spec", ["vico.agents.base:RandomAgent", f"{planted_agents.__file__}:Honest"])
def test_what_keeps_the_contract_has_no_findings(spec: str) -> None:
    found = check(spec)
    assert found.findings == []
    assert sum(found.types.values()) == len(found.milliseconds) == STEPS


@pytest.mark.parametrize(
    ("name", "promise", "words"),
    [
        ("Crasher", "acts", "ZeroDivisionError: no plan"),
        ("Liar", "action", "distance is nan"),
        ("StateLiar", "state", "self is of type StateLiar"),
        ("NoState", "state", "stateless = True"),
        ("Fussy", "made", "asks for 'moon'"),
    ],
)
def test_each_planted_fault_is_found(name: str, promise: str, words: str) -> None:
    findings = check(f"{planted_agents.__file__}:{name}").findings
    assert any(finding.promise == promise and words in finding.what for finding in findings)


@pytest.mark.parametrize(
    ("name", "promise"),
    [("Forgetful", "state"), ("Moody", "repeatable"), ("Marker", "leaves"), ("Spender", "usage")],
)
def test_each_broken_promise_is_named(name: str, promise: str) -> None:
    findings = check(f"{Path(__file__)}:{name}").findings
    assert promise in [finding.promise for finding in findings]


def test_who_thinks_too_long_is_told() -> None:
    found = check("vico.agents.base:RandomAgent", deadline=1e-9)
    assert [finding.promise for finding in found.findings] == ["deadline"]
