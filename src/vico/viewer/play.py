"""Somebody who is played from the page: whose turn it is, what they hold down, what they are told after a step."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from typing import Any

from vico.agents.human import AXES, KEYS, HeldInput, HumanAgent
from vico.errors import InputError
from vico.rules import ActionStatus, code_name
from vico.sim.bodies.state_arrays import Posture, Vehicle
from vico.sim.loop.simulation import Simulation
from vico.viewer.hints import hints_of

#: Who is silent for so long makes room for another page, seconds.
TURN_ENDS = 5.0

_VEHICLES = {Vehicle.NONE: "", Vehicle.BUS: "bus", Vehicle.BIKE: "bike"}


class PlayedAgent:
    """The `vico.viewer.server.state.Player` of a human agent.

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
        held = held_of(message)
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
            self._you = self._told(sim)

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

    def _told(self, sim: Simulation) -> dict[str, Any]:
        state = sim.state
        index = sim.agents.index(self._agent)
        told = {"step": sim.metrics.steps, "time": state.second, "seq": self.human.mailbox.taken, "agent": self._agent}
        told |= _person(sim, index) if index < len(state.people) else _robot(sim, index - len(state.people))
        told["heard"] = [
            {"time": said.time, "speaker": said.speaker, "text": said.text} for said in state.events.heard[self._agent]
        ]
        told["hints"] = hints_of(sim, self._agent)
        told["task"] = None if self.task is None else self.task(state.second)
        return told


def held_of(message: Mapping[str, Any]) -> HeldInput:
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


def _person(sim: Simulation, i: int) -> dict[str, Any]:
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
        "held": [_named(sim, int(entity)) for entity in p.held[i]],
        "cash": round(float(p.cash[i]), 2),
        "busy": bool(p.at_door()[i]) or bool(p.lift_left[i] > 0),
    }


def _robot(sim: Simulation, k: int) -> dict[str, Any]:
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
        "held": [None, _named(sim, robots.in_hand(k))],
        "cash": 0.0,
        "busy": False,
    }


def _named(sim: Simulation, entity: int) -> dict[str, Any] | None:
    return {"entity": entity, "name": sim.state.entity(entity)["name"]} if entity else None
