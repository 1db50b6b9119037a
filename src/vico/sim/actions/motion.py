"""Walking, turning, looking."""

from __future__ import annotations

import math

from vico.rules import BIKE_SPEED, RUN_SPEED, ReasonCode
from vico.sim.actions.fields import Field
from vico.sim.actions.model import ActionType, Refusal, Situation, Values
from vico.sim.moves import eye_height, wrapped
from vico.sim.simulation_state import SimulationState
from vico.sim.state import LEVEL_GAZE, Vehicle

# Eyes turn up and down this far, radians.
_STEEPEST = math.radians(60.0)
# A member of an enumeration costs more to look up than all the rest.
_BIKE = int(Vehicle.BIKE)
#: A learner's turn is at most half a turn, degrees.
_HALF_TURN = 180.0


def check_move_forward(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge a walk: on foot one is slower than on a bicycle."""
    distance = values["distance"]
    if distance <= RUN_SPEED or state.people.vehicle.item(i) == _BIKE:
        return None
    return Refusal(
        ReasonCode.OUT_OF_RANGE, f"move_forward: {distance:g} m is out of range; 0 to {RUN_SPEED:g} m a step on foot"
    )


def move_forward(values: Values, i: int, state: SimulationState) -> None:
    """Walk or ride ahead over the coming second, turning meanwhile if asked; on snow and ice one gets less far."""
    p = state.people
    outdoors = state.environment.conditions
    if p.room.item(i) >= 0:
        gets_on = 1.0
    else:
        gets_on = outdoors.cycling if p.vehicle.item(i) == _BIKE else outdoors.walking
    p.move_left[i] = values["distance"] * gets_on
    p.move_speed[i] = values["distance"] * gets_on
    p.turn_left[i] = math.radians(values.get("turn") or 0.0)
    p.pitch[i] = LEVEL_GAZE


def turn_left(values: Values, i: int, state: SimulationState) -> None:
    """Turn counter-clockwise over the coming second."""
    _turn(values["degrees"], i, state)


def turn_right(values: Values, i: int, state: SimulationState) -> None:
    """Turn clockwise over the coming second."""
    _turn(-values["degrees"], i, state)


def _turn(degrees: float, i: int, state: SimulationState) -> None:
    state.people.turn_left[i] = math.radians(degrees)
    state.people.pitch[i] = LEVEL_GAZE


def check_look_at(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge a look: straight down there is no direction."""
    x, y, _ = values["target"]
    away = math.hypot(x - state.people.position[i, 0], y - state.people.position[i, 1])
    return None if away > 1e-3 else Refusal(ReasonCode.NO_DIRECTION, "look_at: the target is where you stand")


def look_at(values: Values, i: int, state: SimulationState) -> None:
    """Turn towards a point, the shorter way, and look up or down at it."""
    p = state.people
    x, y, z = values["target"]
    dx, dy = x - p.position[i, 0], y - p.position[i, 1]
    p.turn_left[i] = wrapped(math.atan2(dy, dx) - p.yaw[i])
    eyes = eye_height(state)[i] + p.position[i, 2]
    p.pitch[i] = min(_STEEPEST, max(-_STEEPEST, math.atan2(z - eyes, math.hypot(dx, dy))))


_DEGREES = Field("number", low=0.0, high=360.0, unit="degrees", slot="amount", scale=_HALF_TURN)

MOTION = (
    ActionType(
        "move_forward",
        "Walk (to 1 m), run (to 2.5 m) or ride (to 3 m) ahead, straight or turning meanwhile (to the left above 0); "
        "what is in the way stops it with `collision`.",
        move_forward,
        check_move_forward,
        {
            "distance": Field("number", low=0.0, high=BIKE_SPEED, unit="m", slot="amount", scale=RUN_SPEED),
            "turn": Field("number", required=False, low=-360.0, high=360.0, unit="degrees"),
        },
        when=Situation.ON_FOOT | Situation.ON_BIKE,
    ),
    ActionType("turn_left", "Turn to the left.", turn_left, fields={"degrees": _DEGREES}, when=Situation.AWAKE),
    ActionType("turn_right", "Turn to the right.", turn_right, fields={"degrees": _DEGREES}, when=Situation.AWAKE),
    ActionType(
        "look_at",
        "Turn towards a point and look up or down at it.",
        look_at,
        check_look_at,
        {"target": Field("point", slot="target")},
        when=Situation.AWAKE,
    ),
)
