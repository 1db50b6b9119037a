"""Actions of robots, and their refusals."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vico.rules import ReasonCode
from vico.sim.actions.model import ActionType, Actors, Field, Refusal, Situation, Values, short
from vico.sim.people.doors import closed_reason, place_of_room
from vico.sim.state.simulation_state import SimulationState

if TYPE_CHECKING:
    from vico.sim.robots.population import RobotPopulation


def check_control(values: Values, robot: int, state: SimulationState) -> Refusal | None:
    """Judge a vector: it has to be one of the robot's action space."""
    refusal = _refuse_without_power("control", robot, state)
    if refusal is not None:
        return refusal
    spaces = _robots(state).action_spaces(robot)
    name = values.get("space") or next(iter(spaces))
    if name not in spaces:
        known = ", ".join(spaces)
        return Refusal(ReasonCode.BAD_VALUE, f"control: no action space {short(name)}; this robot has {known}")
    width, given = len(spaces[name]), len(values["vector"])
    if given == width:
        return None
    units = ", ".join(dict.fromkeys(spaces[name].units))
    entries = ", ".join(spaces[name].entries[:4]) + (", ..." if width > 4 else "")
    sentence = f"control: {given} numbers; this robot takes {width} for {name!r}: {entries} ({units})"
    return Refusal(ReasonCode.WRONG_SIZE, sentence)


def control(values: Values, robot: int, state: SimulationState) -> None:
    """Have a robot follow a vector until the next one comes."""
    _robots(state).command(robot, np.array(values["vector"], np.float64), values.get("space") or "")


def check_go_to(values: Values, robot: int, state: SimulationState) -> Refusal | None:
    """Judge going to a point: the robot drives or walks, and there is a way, through open doors where it is indoors."""
    target, robots = np.array(values["target"], np.float64), _robots(state)
    refusal = _refuse_without_velocities("go_to", robot, state)
    room = robots.room_at(target)
    if refusal is not None or (room < 0 and robots.rooms[robot] < 0):
        return refusal or _refuse_without_way("go_to", target, robot, state)
    if robots.flies(robot):
        return Refusal(ReasonCode.BLOCKED, "go_to: robots that fly do not go indoors")
    if robots.in_hand(robot) and room != robots.rooms[robot]:
        return Refusal(ReasonCode.HAND_FULL, "go_to: doors are for empty hands; put down what is held, or on a deck")
    place = place_of_room(room, state) if robots.rooms[robot] < 0 else None
    if place is not None and (shut := closed_reason(place, state)):
        return Refusal(ReasonCode.CLOSED, f"go_to: {shut}")
    reason = robots.trip_refusal(robot, room, target)
    return Refusal(ReasonCode.BLOCKED, f"go_to: {reason}") if reason else None


def go_to(values: Values, robot: int, state: SimulationState) -> None:
    """Send a robot to a point."""
    target = np.array(values["target"], np.float64)
    room = _robots(state).room_at(target)
    _robots(state).go_to(robot, target[:2] if room < 0 else target, room)


def check_follow(values: Values, robot: int, state: SimulationState) -> Refusal | None:
    """Judge following somebody."""
    if values["agent"] not in state.names:
        return Refusal(ReasonCode.UNKNOWN_AGENT, f"follow: nobody is called {short(values['agent'])}")
    if values["agent"] == _robots(state).names[robot]:
        return Refusal(ReasonCode.SELF, "follow: that is yourself")
    return _refuse_without_velocities("follow", robot, state)


def follow(values: Values, robot: int, state: SimulationState) -> None:
    """Have a robot keep near somebody."""
    robots, agent = _robots(state), state.names.index(values["agent"])
    people = len(state.people)
    entity = state.people.entity[agent] if agent < people else robots.bodies().entity[agent - people]
    robots.follow_body(robot, int(entity))


def check_fly_to(values: Values, robot: int, state: SimulationState) -> Refusal | None:
    """Judge flying to a point: the robot flies, and nothing is there."""
    robots = _robots(state)
    if not robots.flies(robot):
        return Refusal(ReasonCode.NOT_ABLE, "fly_to: this robot does not fly; it takes go_to")
    if robots.is_empty(robot):
        return _refuse_without_power("fly_to", robot, state)
    reason = robots.flight_refusal(robot, np.array(values["target"], np.float64))
    return Refusal(ReasonCode.BLOCKED, f"fly_to: {reason}") if reason else None


def fly_to(values: Values, robot: int, state: SimulationState) -> None:
    """Send a robot that flies to a point."""
    _robots(state).fly_to(robot, np.array(values["target"], np.float64))


def check_land(values: Values, robot: int, state: SimulationState) -> Refusal | None:
    """Judge landing: the robot flies, and what is below is even."""
    robots, target = _robots(state), values.get("target")
    if not robots.flies(robot):
        return Refusal(ReasonCode.NOT_ABLE, "land: this robot does not fly")
    if robots.can_land(robot, None if target is None else np.array(target[:2])):
        return None
    return Refusal(ReasonCode.BLOCKED, "land: what is there is not even enough to land on")


def land(values: Values, robot: int, state: SimulationState) -> None:
    """Have a robot that flies land."""
    target = values.get("target")
    _robots(state).land(robot, None if target is None else np.array(target[:2], np.float64))


def stop(values: Values, robot: int, state: SimulationState) -> None:
    """Have a robot stand still."""
    _robots(state).stop(robot)


def _refuse_without_power(action: str, robot: int, state: SimulationState) -> Refusal | None:
    if not _robots(state).is_empty(robot):
        return None
    return Refusal(ReasonCode.NOT_ABLE, f"{action}: the battery is empty; wait until it is exchanged")


def _refuse_without_arm(action: str, robot: int, state: SimulationState) -> Refusal | None:
    if _robots(state).rooms[robot] >= 0:
        return Refusal(ReasonCode.INDOORS, f"{action}: arms work outdoors; go out first")
    if _robots(state).has_arm(robot):
        return _refuse_without_power(action, robot, state)
    return Refusal(ReasonCode.NOT_ABLE, f"{action}: this robot has no arm")


def _refuse_unless_holding(action: str, robot: int, state: SimulationState) -> Refusal | None:
    refusal = _refuse_without_arm(action, robot, state)
    if refusal is None and not _robots(state).in_hand(robot):
        refusal = Refusal(ReasonCode.HAND_EMPTY, f"{action}: the hand is empty")
    return refusal


def _refuse_without_way(action: str, point: NDArray[np.float64], robot: int, state: SimulationState) -> Refusal | None:
    if _robots(state).has_way(robot, point[:2]):
        return None
    closed = state.environment.agenda.effects.ground
    if any(math.hypot(point[0] - x, point[1] - y) < radius for x, y, radius in closed):
        return Refusal(ReasonCode.CLOSED, f"{action}: an event has closed the ground there")
    return Refusal(
        ReasonCode.BLOCKED,
        f"{action}: no way there outdoors that is wide enough for this robot",
    )


def check_reach(values: Values, robot: int, state: SimulationState) -> Refusal | None:
    """Judge reaching: the robot has an arm, and there is a way."""
    target = np.array(values["target"], np.float64)
    return _refuse_without_arm("reach", robot, state) or _refuse_without_way("reach", target, robot, state)


def reach(values: Values, robot: int, state: SimulationState) -> None:
    """Bring a robot's hand to a point."""
    _robots(state).reach(robot, np.array(values["target"], np.float64))


def check_pick(values: Values, robot: int, state: SimulationState) -> Refusal | None:
    """Judge picking: an arm with nothing in hand, and a thing outdoors that nobody holds and the jaw is wide for."""
    robots, objects = _robots(state), state.objects
    refusal = _refuse_without_arm("pick", robot, state)
    if refusal is not None:
        return refusal
    if robots.in_hand(robot):
        return Refusal(ReasonCode.HAND_FULL, f"pick: the hand holds {robots.in_hand(robot)} already")
    k = objects.index(values["object"])
    if k < 0:
        return Refusal(ReasonCode.NOT_PORTABLE, f"pick: {values['object']} is nothing that can be carried")
    if objects.holder[k] or objects.room[k] >= 0:
        return Refusal(ReasonCode.HELD_ALREADY, f"pick: {objects.names[k]} is held by somebody, or indoors")
    if not robots.can_grasp(robot, objects.size[k]):
        return Refusal(ReasonCode.NOT_PORTABLE, f"pick: {objects.names[k]} is wider than the jaw")
    return _refuse_without_way("pick", objects.position[k], robot, state)


def pick(values: Values, robot: int, state: SimulationState) -> None:
    """Have a robot pick a thing up."""
    _robots(state).pick(robot, int(values["object"]))


def check_place(values: Values, robot: int, state: SimulationState) -> Refusal | None:
    """Judge placing: something in hand, and a point, or a deck, to put it on."""
    target = values["target"]
    refusal = _refuse_unless_holding("place", robot, state)
    if refusal is not None:
        return refusal
    if isinstance(target, int):
        if _robots(state).deck(target) is None:
            return Refusal(ReasonCode.UNKNOWN_TARGET, f"place: {target} has no deck")
        return None
    return _refuse_without_way("place", np.array(target, np.float64), robot, state)


def place(values: Values, robot: int, state: SimulationState) -> None:
    """Have a robot put down what it holds."""
    target = values["target"]
    _robots(state).place(robot, target if isinstance(target, int) else np.array(target, np.float64))


def check_hand_over(values: Values, robot: int, state: SimulationState) -> Refusal | None:
    """Judge handing over: something in hand, and a person outdoors."""
    refusal = _refuse_unless_holding("hand_over", robot, state)
    if refusal is not None:
        return refusal
    if values["agent"] not in state.people.names:
        return Refusal(ReasonCode.UNKNOWN_AGENT, f"hand_over: no person is called {short(values['agent'])}")
    i = state.people.names.index(values["agent"])
    if state.people.room[i] >= 0:
        return Refusal(ReasonCode.ELSEWHERE, f"hand_over: {values['agent']} is indoors")
    return _refuse_without_way("hand_over", state.people.position[i], robot, state)


def hand_over(values: Values, robot: int, state: SimulationState) -> None:
    """Have a robot hold out to a person what it holds, until they pick it."""
    i = state.people.names.index(values["agent"])
    _robots(state).offer(robot, state.people.position[i].copy())


def _refuse_without_velocities(action: str, robot: int, state: SimulationState) -> Refusal | None:
    spaces = _robots(state).action_spaces(robot)
    if any(space.drives == "velocity" for space in spaces.values()):
        return _refuse_without_power(action, robot, state)
    sentence = f"{action}: this robot follows no velocities; it takes control ({', '.join(spaces)})"
    return Refusal(ReasonCode.NOT_ABLE, sentence)


def _robots(state: SimulationState) -> RobotPopulation:
    assert state.robots is not None
    return state.robots


ROBOTS = (
    ActionType(
        "control",
        "Have a robot follow a vector of one of its action spaces (its own, if none is named) until the next one.",
        control,
        check_control,
        {"vector": Field("vector"), "space": Field("name", required=False)},
        when=Situation(0),
        actors=Actors.ROBOTS,
    ),
    ActionType(
        "go_to",
        "Send a robot to a point, outdoors or in a room, through doors and by lifts, round whoever stands in the way.",
        go_to,
        check_go_to,
        {"target": Field("point")},
        when=Situation(0),
        actors=Actors.ROBOTS,
    ),
    ActionType(
        "follow",
        "Have a robot keep near an agent, wherever that goes.",
        follow,
        check_follow,
        {"agent": Field("name")},
        when=Situation(0),
        actors=Actors.ROBOTS,
    ),
    ActionType(
        "stop",
        "Have a robot stand still.",
        stop,
        when=Situation(0),
        actors=Actors.ROBOTS,
    ),
    ActionType(
        "fly_to",
        "Have a robot that flies fly to a point outdoors, over or round what stands in between, and hover there.",
        fly_to,
        check_fly_to,
        {"target": Field("point")},
        when=Situation(0),
        actors=Actors.ROBOTS,
    ),
    ActionType(
        "land",
        "Have a robot that flies land where it is, or at a point, on even ground or a flat roof.",
        land,
        check_land,
        {"target": Field("point", required=False)},
        when=Situation(0),
        actors=Actors.ROBOTS,
    ),
    ActionType(
        "reach",
        "Have a robot with an arm bring its hand to a point, pointing down.",
        reach,
        check_reach,
        {"target": Field("point")},
        when=Situation(0),
        actors=Actors.ROBOTS,
    ),
    ActionType(
        "place",
        "Have a robot put what it holds down at a point, or on the deck of the robot with an entity.",
        place,
        check_place,
        {"target": Field("target")},
        when=Situation(0),
        actors=Actors.ROBOTS,
    ),
)

#: What robots with arms do under names that people's actions have, too.
ARMS = (
    ActionType(
        "pick",
        "Have a robot with an arm pick a thing up from the ground, a table or the like.",
        pick,
        check_pick,
        {"object": Field("integer")},
        when=Situation(0),
        actors=Actors.ROBOTS,
    ),
    ActionType(
        "hand_over",
        "Have a robot hold out what it holds to a person, until they take it with `pick`.",
        hand_over,
        check_hand_over,
        {"agent": Field("name")},
        when=Situation(0),
        actors=Actors.ROBOTS,
    ),
)
