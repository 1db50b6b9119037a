"""What robots may do, and where their actions are refused."""

from __future__ import annotations

import numpy as np

from vico.rules import ReasonCode
from vico.sim.actions.fields import Field
from vico.sim.actions.model import ActionType, Actors, Refusal, Situation, Values
from vico.sim.simulation_state import RobotSystem, SimulationState


def check_control(values: Values, robot: int, state: SimulationState) -> Refusal | None:
    """Judge a motor command: one number a motor."""
    width, given = _robots(state).control_size(robot), len(values["vector"])
    if given == width:
        return None
    return Refusal(ReasonCode.WRONG_SIZE, f"control: {given} numbers; this robot takes {width}")


def control(values: Values, robot: int, state: SimulationState) -> None:
    """Have the motors follow a vector until the next one comes."""
    _robots(state).command(robot, np.array(values["vector"], np.float64))


def _robots(state: SimulationState) -> RobotSystem:
    assert state.robots is not None
    return state.robots


ROBOTS = (
    ActionType(
        "control",
        "Drive a robot's motors by a vector of wheel speeds (rad/s) or joint angles (rad).",
        control,
        check_control,
        {"vector": Field("vector")},
        when=Situation(0),
        actors=Actors.ROBOTS,
    ),
)
