"""How a robot's actions went is told as of the last one: done, refused, late or failed."""

import pytest

from robot_field import field
from vico.rules import ActionStatus
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation

GOOD = {"type": "control", "vector": [0.0, 0.0, 0.0, 0.0]}
BAD = {"type": "control", "vector": [0.0]}


def told(result) -> tuple[str, str, str]:
    state = result.observations["robot_0"]["state"]
    return state["action_status"], state["action_code"], state["action_reason"]


@pytest.fixture(scope="module")
def sim() -> Simulation:
    return Simulation(field(), None, SimConfig(robots=("husky",), observe=()))


@pytest.mark.parametrize("then", [{"robot_0": GOOD}, {}], ids=["a good action", "no action"])
def test_a_refusal_is_forgotten_with_the_next_step(sim: Simulation, then: dict) -> None:
    status, code, reason = told(sim.step({"robot_0": BAD}))
    assert (status, code) == ("refused", "wrong_size")
    assert "takes 4" in reason
    assert told(sim.step(then)) == ("ok", "", "")


@pytest.mark.parametrize("fault", [ActionStatus.LATE, ActionStatus.FAILED])
def test_late_and_failed_robots_are_not_called_refused(sim: Simulation, fault: ActionStatus) -> None:
    status, code, reason = told(sim.step({}, {"robot_0": (fault, "it said nothing")}))
    assert (status, code, reason) == (fault.name.lower(), f"agent_{fault.name.lower()}", "it said nothing")
    assert told(sim.step({"robot_0": GOOD})) == ("ok", "", "")


def test_how_an_action_went_is_saved(sim: Simulation) -> None:
    sim.step({}, {"robot_0": (ActionStatus.LATE, "it said nothing")})
    saved = sim.snapshot()
    sim.step({"robot_0": GOOD})
    sim.restore(saved)
    observations, _ = sim.observe()
    assert observations["robot_0"]["state"]["action_status"] == "late"
