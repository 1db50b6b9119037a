"""What somebody who is played can do where they are, each with the key that does it: judged by the rules themselves."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from vico.geometry import distances
from vico.rules import EARSHOT, REACH
from vico.sim.actions import Command, check
from vico.sim.bodies.state_arrays import Posture, Vehicle
from vico.sim.loop.simulation import Simulation

Action = dict[str, Any]

# Bodies a little farther than hands reach are judged, too; so many hints are told, so many of a key.
_AROUND, _MOST, _MOST_OF_A_KEY = REACH + 0.5, 12, 4
_LEFT, _RIGHT = 0, 1


class Hint(NamedTuple):
    """Something that can be done.

    Attributes
    ----------
    key
        That does it: the paper's ``B``, ``N``, ``M``, ``<`` and ``>``, or one of ours.
    text
        What it is.
    action
        The same as an action.
    """

    key: str
    text: str
    action: Action


def hints_of(sim: Simulation, agent: str) -> list[dict[str, Any]]:
    """Return what an agent can do here and now, beside moving; the nearest first of each key."""
    index = sim.agents.index(agent)
    offers = _of_person(sim, index) if index < len(sim.state.people) else _of_robot(sim, index)
    found: list[Hint] = []
    for hint in offers:
        if len(found) >= _MOST:
            break
        same = sum(one.key == hint.key for one in found)
        if same < _MOST_OF_A_KEY and isinstance(check(hint.action, index, sim.state), Command):
            found.append(hint)
    return [hint._asdict() for hint in found]


def _of_person(sim: Simulation, i: int) -> Iterator[Hint]:
    p = sim.state.people
    if p.posture[i] == Posture.LYING:
        yield Hint("X", "get up", {"type": "wake"})
        return
    if p.posture[i] == Posture.SITTING:
        yield Hint("X", "stand up", {"type": "stand"})
    yield from _things(sim, i)
    if p.vehicle[i] == Vehicle.BUS:
        yield Hint("M", "get off", {"type": "exit_bus"})
    elif p.vehicle[i] == Vehicle.BIKE:
        yield Hint("<", "get off the bicycle", {"type": "exit_bike"})
    else:
        yield Hint("M", "board", {"type": "enter_bus"})
        yield Hint("<", "get on a bicycle", {"type": "enter_bike"})
        yield from _doors(sim, i)
        yield Hint("X", "sit down", {"type": "sit"})
        yield Hint("Z", "lie down", {"type": "sleep"})
    yield from _people(sim, i)


def _things(sim: Simulation, i: int) -> Iterator[Hint]:
    """Yield what can be taken, and where what is held can be put."""
    state, p = sim.state, sim.state.people
    objects = state.objects
    hand = _RIGHT if not p.held[i, _RIGHT] else _LEFT
    away = distances(objects.position[:, :2], p.position[i, :2]) if len(objects) else np.zeros(0)
    for k in np.argsort(away, kind="stable").tolist():
        if away[k] > _AROUND:
            break
        action = {"type": "pick", "hand": hand, "object": int(objects.entity[k])}
        yield Hint("B", f"pick up {objects.names[k]}", action)
    for full in (_RIGHT, _LEFT):
        if not (entity := int(p.held[i, full])):
            continue
        name = state.entity(entity)["name"]
        yield Hint("N", f"put {name} down", {"type": "put", "hand": full})
        for target, on in _surfaces(sim, i):
            yield Hint("N", f"put {name} on {on}", {"type": "put", "hand": full, "target": target})


def _surfaces(sim: Simulation, i: int) -> Iterator[tuple[int, str]]:
    """Yield entities that a thing can be put on, and what they are: furniture in the room, decks of robots."""
    state, p = sim.state, sim.state.people
    if (room := int(p.room[i])) >= 0:
        for container in state.indoor.rooms[room].containers:
            if container.kind != "floor" and _apart(container.centre, p.position[i]) < _AROUND + max(container.size):
                yield container.entity, f"the {container.kind}"
    elif state.robots is not None:
        bodies = state.robots.bodies()
        for k, name in enumerate(state.robots.names):
            if _apart(bodies.position[k], p.position[i]) < _AROUND + 1.0:
                yield int(bodies.entity[k]), f"the deck of {name}"


def _doors(sim: Simulation, i: int) -> Iterator[Hint]:
    state, p, places = sim.state, sim.state.people, sim.world.place_by_id
    for name in state.accessible_places(i):
        if name in places:
            called = f"enter {places[name].name or places[name].kind}"
        else:
            called = f"go to the {sim.world.room_by_id[name].kind.replace('_', ' ')}"
        yield Hint(">", called, {"type": "enter", "place": name})
    if p.room[i] >= 0:
        yield Hint(">", "go out", {"type": "exit"})


def _people(sim: Simulation, i: int) -> Iterator[Hint]:
    state, p = sim.state, sim.state.people
    away = np.linalg.norm(p.position - p.position[i], axis=1)
    for j in np.argsort(away, kind="stable").tolist():
        if j == i or not state.same_space(i, j):
            continue
        if away[j] > EARSHOT:
            break
        name = state.entity(int(p.entity[j]))["name"]
        for full in (_RIGHT, _LEFT):
            if p.held[i, full] and away[j] < _AROUND:
                action = {"type": "hand_over", "hand": full, "agent": p.names[j]}
                yield Hint("G", f"give {state.entity(int(p.held[i, full]))['name']} to {name}", action)
        if away[j] < EARSHOT / 2:
            yield Hint("Enter", f"talk to {name}", {"type": "communicate", "text": "Hello!"})


def _of_robot(sim: Simulation, index: int) -> Iterator[Hint]:
    state, robots = sim.state, sim.state.robots
    assert robots is not None
    k = index - len(state.people)
    here = robots.bodies().position[k]
    if robots.flies(k):
        yield Hint("L", "land", {"type": "land"})
    if not robots.has_arm(k):
        return
    if held := robots.in_hand(k):
        spot = _before(here, float(robots.bodies().yaw[k]))
        yield Hint("N", f"put {state.entity(held)['name']} down", {"type": "place", "target": spot})
        for j, name in enumerate(robots.names):
            if j != k and _apart(robots.bodies().position[j], here) < 2 * EARSHOT:
                yield Hint("N", f"put it on {name}", {"type": "place", "target": int(robots.bodies().entity[j])})
        return
    away = [(_apart(position, here), j) for j, position in enumerate(state.objects.position)]
    for _, j in sorted(away)[:_MOST_OF_A_KEY]:
        yield Hint("B", f"pick up {state.objects.names[j]}", {"type": "pick", "object": int(state.objects.entity[j])})


def _before(position: Any, yaw: float) -> list[float]:
    x, y, z = (float(value) for value in position)
    return [x + 0.8 * math.cos(yaw), y + 0.8 * math.sin(yaw), z]


def _apart(a: Any, b: Any) -> float:
    return math.hypot(float(a[0]) - float(b[0]), float(a[1]) - float(b[1]))
