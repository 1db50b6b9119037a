"""A person or a robot that is played from the page: start, turns, held keys, what is told after a step.

What can be done here and now is told with the key that does it, judged by the simulation's own rules. Who is to see
the city starts on a sidewalk with many doors in sight, looking along them.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.agents.human import AXES, KEYS, HeldInput, HumanAgent
from vico.errors import InputError
from vico.geometry import distances
from vico.rules import EARSHOT, REACH, ActionStatus, code_name
from vico.sim.actions import Command, check
from vico.sim.bodies.state_arrays import Posture, Vehicle
from vico.sim.loop.simulation import Simulation
from vico.world.model import Place
from vico.world.walkable import BLOCKED, OPEN, SIDEWALK, WalkableMap
from vico.world.world import World

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
    offers = _hints_of_person(sim, index) if index < len(sim.state.people) else _hints_of_robot(sim, index)
    found: list[Hint] = []
    for hint in offers:
        if len(found) >= _MOST:
            break
        same = sum(one.key == hint.key for one in found)
        if same < _MOST_OF_A_KEY and isinstance(check(hint.action, index, sim.state), Command):
            found.append(hint)
    return [hint._asdict() for hint in found]


def _hints_of_person(sim: Simulation, i: int) -> Iterator[Hint]:
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


def _hints_of_robot(sim: Simulation, index: int) -> Iterator[Hint]:
    state, robots = sim.state, sim.state.robots
    assert robots is not None
    k = index - len(state.people)
    here = robots.bodies().position[k]
    if robots.flies(k):
        yield Hint("L", "land", {"type": "land"})
    if not robots.has_arm(k):
        return
    if held := robots.in_hand(k):
        x, y, z = (float(value) for value in here)
        yaw = float(robots.bodies().yaw[k])
        spot = [x + 0.8 * math.cos(yaw), y + 0.8 * math.sin(yaw), z]  # metres ahead
        yield Hint("N", f"put {state.entity(held)['name']} down", {"type": "place", "target": spot})
        for j, name in enumerate(robots.names):
            if j != k and _apart(robots.bodies().position[j], here) < 2 * EARSHOT:
                yield Hint("N", f"put it on {name}", {"type": "place", "target": int(robots.bodies().entity[j])})
        return
    away = [(_apart(position, here), j) for j, position in enumerate(state.objects.position)]
    for _, j in sorted(away)[:_MOST_OF_A_KEY]:
        yield Hint("B", f"pick up {state.objects.names[j]}", {"type": "pick", "object": int(state.objects.entity[j])})


def _apart(a: Any, b: Any) -> float:
    return math.hypot(float(a[0]) - float(b[0]), float(a[1]) - float(b[1]))


#: Who is silent for so long makes room for another page, seconds.
TURN_ENDS = 5.0

_VEHICLES = {Vehicle.NONE: "", Vehicle.BUS: "bus", Vehicle.BIKE: "bike"}


class PlayedAgent:
    """Takes what a person at the page does to the agent that is played.

    Parameters
    ----------
    agent
        Name of who is played.
    human
        Who acts.
    present
        Told when a person comes to play, and when they are gone.

    Attributes
    ----------
    human
        Who acts.
    """

    def __init__(self, agent: str, human: HumanAgent, *, present: Callable[[bool], None] = lambda there: None) -> None:
        self._agent, self.human, self._present = agent, human, present
        self._lock = threading.Lock()
        self._owner: int | None = None
        self._you: dict[str, Any] | None = None
        #: Gives what is asked of the person, as the message ``you`` has it; None where nothing is.
        self.task: Callable[[float], dict[str, Any]] | None = None

    @property
    def agent(self) -> str:
        """Who is played."""
        return self._agent

    def owner(self) -> int | None:
        """Return which client plays; None for nobody."""
        return self._owner

    def newest(self) -> dict[str, Any] | None:
        """Return what the person is told of the newest step."""
        return self._you

    def keys(self, client: int, message: Mapping[str, Any]) -> bool:
        """Take in what is held down; return whether it was this client's turn.

        Raises
        ------
        ValueError
            If the message is not as the protocol says.
        """
        held = parse_keys(message)
        if not self._takes_turn(client):
            return False
        self.human.mailbox.hold(held)
        return True

    def do(self, client: int, action: Any) -> Future[dict[str, Any]]:
        """Have an action done; its outcome is the result."""
        if self._takes_turn(client):
            return self.human.mailbox.do(action)
        told: Future[dict[str, Any]] = Future()
        told.set_exception(InputError(f"another page plays {self._agent} now"))
        return told

    def leave(self, client: int) -> None:
        """Let go of everything that a client held down who is gone."""
        with self._lock:
            if self._owner != client:
                return
            self._owner = None
            self.human.mailbox.release()
        self._present(False)

    def tell(self, sim: Simulation) -> None:
        """Note what the person is to be told of a step; asked by the thread that simulates."""
        if self._owner is not None or self._you is None:
            self._you = self._you_message(sim)

    def _takes_turn(self, client: int) -> bool:
        with self._lock:
            if self._owner == client:
                return True
            if self._owner is not None and self.human.mailbox.silent < TURN_ENDS:
                return False
            self._owner = client
            self.human.mailbox.release()
        self._present(True)
        return True

    def _you_message(self, sim: Simulation) -> dict[str, Any]:
        state = sim.state
        index = sim.agents.index(self._agent)
        told = {"step": sim.metrics.steps, "time": state.second, "seq": self.human.mailbox.taken, "agent": self._agent}
        told |= (
            _person_record(sim, index) if index < len(state.people) else _robot_record(sim, index - len(state.people))
        )
        told["heard"] = [
            {"time": said.time, "speaker": said.speaker, "text": said.text} for said in state.events.heard[self._agent]
        ]
        told["hints"] = hints_of(sim, self._agent)
        told["task"] = None if self.task is None else self.task(state.second)
        return told


def parse_keys(message: Mapping[str, Any]) -> HeldInput:
    """Return what a message ``keys`` says.

    Raises
    ------
    ValueError
        If it is not as the protocol says.
    """
    seq, down, axes = message.get("seq"), message.get("down", []), message.get("axes") or {}
    if isinstance(seq, bool) or not isinstance(seq, int) or seq < 0:
        raise ValueError("seq has to be a whole number")
    if not isinstance(down, list) or len(down) > len(KEYS) or any(key not in KEYS for key in down):
        raise ValueError(f"down has to be a list of {', '.join(KEYS)}")
    if not isinstance(axes, dict) or any(name not in AXES for name in axes):
        raise ValueError(f"axes has to hold some of {', '.join(AXES)}")
    sticks = {name: min(max(_finite(value, name) or 0.0, -1.0), 1.0) for name, value in axes.items()}
    yaw, pitch = (_finite(message.get(name), name) for name in ("yaw", "pitch"))
    return HeldInput(seq, frozenset(down), yaw, pitch, sticks)


def _finite(value: Any, name: str) -> float | None:
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value) or abs(value) > 1e6:
        raise ValueError(f"{name} has to be a finite number")
    return float(value)


def _person_record(sim: Simulation, i: int) -> dict[str, Any]:
    p = sim.state.people
    room, place = int(p.room[i]), int(p.place[i])
    return {
        "kind": "person",
        "position": [round(float(value), 3) for value in p.position[i]],
        "yaw": round(float(p.yaw[i]), 4),
        "pitch": round(float(p.pitch[i]), 4),
        "speed": round(float(math.hypot(*p.velocity[i])), 2),
        "status": ActionStatus(int(p.status[i])).name.lower(),
        "code": code_name(int(p.reason_code[i])),
        "reason": str(p.reason[i]),
        "posture": Posture(int(p.posture[i])).name.lower(),
        "vehicle": _VEHICLES[Vehicle(int(p.vehicle[i]))],
        "room": room,
        "place": sim.world.places[place].name if place >= 0 else "",
        "held": [_entity_record(sim, int(entity)) for entity in p.held[i]],
        "cash": round(float(p.cash[i]), 2),
        "busy": bool(p.at_door()[i]) or bool(p.lift_left[i] > 0),
    }


def _robot_record(sim: Simulation, k: int) -> dict[str, Any]:
    robots = sim.state.robots
    assert robots is not None
    bodies = robots.bodies()
    kind = "drone" if robots.flies(k) else "arm" if robots.has_arm(k) else "vehicle"
    return {
        "kind": kind,
        "position": [round(float(value), 3) for value in bodies.position[k]],
        "yaw": round(float(bodies.yaw[k]), 4),
        "pitch": 0.0,
        "speed": round(float(math.hypot(*bodies.velocity[k])), 2),
        "status": ActionStatus(int(robots.action_status[k])).name.lower(),
        "code": code_name(int(robots.reason_code[k])),
        "reason": str(robots.reason[k]),
        "posture": "standing",
        "vehicle": "",
        "room": int(robots.rooms[k]),
        "place": "",
        "held": [None, _entity_record(sim, robots.in_hand(k))],
        "cash": 0.0,
        "busy": False,
    }


def _entity_record(sim: Simulation, entity: int) -> dict[str, Any] | None:
    return {"entity": entity, "name": sim.state.entity(entity)["name"]} if entity else None


# Doors that count for a look, the nearer the more.
_NEAREST = 6.0  # metres
_FARTHEST = 80.0  # metres
_FADES = 40.0  # metres in which a door's weight falls to 1/e
_SIDE = 0.6  # within so much of the way one looks, radians
# Looks that are tried at a spot; spots lie this far apart, metres, and as far from walls at least as `clearance`.
_LOOKS, _APART = 16, 4.0
# Of the window's half side: beyond, the city ends in sight.
_WITHIN = 0.6
# The best of them are tried for what stands in the way.
_TRIED = 60
_STEP = 0.5  # along a look, metres
_WANTED = 60.0  # metres of view
# People go in and out of others than these all day.
_QUIET = ("apartments", "company", "office", "house")


def busy_sidewalk_spot(world: World, *, clearance: float = 0.6) -> tuple[float, float, float]:
    """Return a place from which much of a city's life is seen: x, y (ENU metres) and yaw (radians).

    Parameters
    ----------
    clearance
        Metres around it that have to be free.

    Raises
    ------
    InputError
        If there is no free ground.
    """
    spots = _spots(world.walkable, clearance)
    if not len(spots):
        raise InputError(f"{world.manifest.name}: no free ground to start on")
    looks = np.linspace(-np.pi, np.pi, _LOOKS, endpoint=False)
    seen = _door_visibility(spots, looks, np.array([place.position[:2] for place in world.places if _is_lively(place)]))
    # A window without doors: whatever has the longest view.
    best = np.argsort(-seen.reshape(-1), kind="stable")[:_TRIED]
    values = [seen.reshape(-1)[k] * _view(world.walkable, spots[k // _LOOKS], looks[k % _LOOKS]) for k in best.tolist()]
    chosen = int(best[int(np.argmax(values))])
    x, y = spots[chosen // _LOOKS].tolist()
    return x, y, float(looks[chosen % _LOOKS])


def _is_lively(place: Place) -> bool:
    return place.entrance is not None and place.kind not in _QUIET


def _spots(walkable: WalkableMap, clearance: float) -> NDArray[np.float64]:
    """Return sidewalks, or open ground where there are none, that one gets away from, shape ``(n, 2)``."""
    edge = walkable.half * _WITHIN
    axis = np.arange(-edge, edge, _APART)
    points = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    points = points[walkable.is_connected(points) & (walkable.clearance_at(points) >= clearance)]
    kinds = walkable.class_at(points)
    return next((points[kinds == kind] for kind in (SIDEWALK, OPEN) if (kinds == kind).any()), points[:0])


def _door_visibility(
    spots: NDArray[np.float64], looks: NDArray[np.float64], doors: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return how much is seen of doors at each spot in each look, shape ``(spots, looks)``; more than 0."""
    seen = np.full((len(spots), len(looks)), 1e-6)
    for door in doors:
        to = door - spots
        away = np.hypot(to[:, 0], to[:, 1])
        near = np.flatnonzero((away > _NEAREST) & (away < _FARTHEST))
        aside = np.arctan2(to[near, 1], to[near, 0])[:, None] - looks
        aside = np.abs((aside + np.pi) % (2 * np.pi) - np.pi)
        seen[near] += np.exp(-away[near] / _FADES)[:, None] * (aside < _SIDE)
    return seen


def _view(walkable: WalkableMap, spot: NDArray[np.float64], look: float) -> float:
    """Return how far one sees along a look, of what is wanted."""
    away = np.arange(_STEP, _WANTED, _STEP)
    points = spot + away[:, None] * np.array([np.cos(look), np.sin(look)])
    blocked = np.flatnonzero((walkable.class_at(points) == BLOCKED) | ~walkable.inside(points))
    return float(away[blocked[0]] if len(blocked) else _WANTED) / _WANTED
