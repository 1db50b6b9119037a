"""A person who acts: what they hold down and ask for lies in a mailbox, and becomes an action when it is time."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from vico.agents.base import Action, AgentState, Info, Observation, heading
from vico.errors import InputError
from vico.geometry import wrap_angle
from vico.rules import BIKE_SPEED, RUN_SPEED, WALK_SPEED

#: Seconds between what a person does: often enough that a walk feels like one's own.
PERIOD = 0.1
#: What is held down counts as let go when nothing was heard for so long, seconds.
LET_GO = 1.0
#: How fast one turns by the keys, and towards where one looks, degrees a second.
TURN_SPEED, SWING_SPEED = 120.0, 360.0
#: Who has to turn farther than this turns before walking, degrees.
TURNS_FIRST = 60.0
#: Names of keys, and of axes (-1..1).
KEYS = (
    "forward",
    "back",
    "left",
    "right",
    "turn_left",
    "turn_right",
    "run",
    "up",
    "down",
    "grip_open",
    "grip_close",
)
AXES = ("x", "y", "turn", "up", "hand_x", "hand_y", "hand_z", "hand_pitch")

_MOST_WAITING = 16
# A stick that is let go is not quite in the middle.
_IDLE_STICK = 0.12


@dataclass(frozen=True)
class HeldInput:
    """What is held down at a moment.

    Attributes
    ----------
    seq
        Number of the message that said so; counts up.
    keys
        Some of `KEYS`.
    yaw, pitch
        Where one looks, radians; None where keys turn one.
    axes
        Of sticks, by name, -1..1.
    """

    seq: int = -1
    keys: frozenset[str] = frozenset()
    yaw: float | None = None
    pitch: float | None = None
    axes: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))

    def axis(self, name: str, more: str = "", less: str = "") -> float:
        """Return an axis, -1..1; keys count as a stick that is all the way over."""
        stick = self.axes.get(name, 0.0)
        stick = 0.0 if abs(stick) < _IDLE_STICK else stick
        return min(max(stick + (more in self.keys) - (less in self.keys), -1.0), 1.0)

    @property
    def idle(self) -> bool:
        """Whether nothing is held down."""
        return not self.keys and all(abs(value) < _IDLE_STICK for value in self.axes.values())


class Mailbox:
    """Holds what a person does until the agent is asked; may be used from any thread.

    Parameters
    ----------
    clock
        Seconds of a clock that never goes back.
    """

    def __init__(self, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._held, self._at = HeldInput(), -math.inf
        self._asked: deque[tuple[Action, Future[dict[str, Any]]]] = deque()
        self._closed = ""
        #: Number of the last message that an action took into account.
        self.taken = -1

    def hold(self, held: HeldInput) -> None:
        """Take in what is held down; an older message than the last one is ignored."""
        with self._lock:
            if held.seq > self._held.seq:
                self._held, self._at = held, self._clock()

    def release(self) -> None:
        """Let go of everything; the next message may count from anywhere."""
        with self._lock:
            self._held, self._at = HeldInput(), -math.inf

    def do(self, action: Action) -> Future[dict[str, Any]]:
        """Have an action done as soon as it is time; its outcome is the result."""
        told: Future[dict[str, Any]] = Future()
        with self._lock:
            if self._closed or len(self._asked) >= _MOST_WAITING:
                told.set_exception(InputError(self._closed or f"{_MOST_WAITING} actions wait already"))
            else:
                self._asked.append((action, told))
        return told

    def take(self) -> tuple[HeldInput, tuple[Action, Future[dict[str, Any]]] | None]:
        """Return what is held down now, and an action that is asked for."""
        with self._lock:
            held = self._held if self._clock() - self._at <= LET_GO else HeldInput(self._held.seq)
            self.taken = held.seq
            return held, self._asked.popleft() if self._asked else None

    @property
    def silent(self) -> float:
        """Seconds since anything was heard; infinite before the first."""
        with self._lock:
            return self._clock() - self._at

    def close(self, reason: str) -> None:
        """Take nothing any more, and say why."""
        with self._lock:
            self._closed = reason
            asked, self._asked = list(self._asked), deque()
        for _, told in asked:
            told.set_exception(InputError(reason))


#: Turns what is held down into an action, given what the agent observes.
Steering = Callable[[HeldInput, Observation], Action]


class HumanAgent:
    """Does what a person asks for.

    Parameters
    ----------
    mailbox
        Where that lies.
    steer
        What keys and sticks mean; those of a body on legs unless told.
    """

    def __init__(self, mailbox: Mailbox, *, steer: Steering | None = None) -> None:
        self.mailbox = mailbox
        self._steer = steer or walk
        self._told: Future[dict[str, Any]] | None = None

    def act(self, observation: Observation, info: Info) -> Action:
        """Return what is asked for, or else where the keys lead; say how the last thing went that was asked for."""
        self._tell(observation["state"])
        held, asked = self.mailbox.take()
        if asked is not None:
            action, self._told = asked
            return action
        return self._steer(held, observation)

    def state(self) -> AgentState:
        """Return nothing: what a person remembers is theirs."""
        return {}

    def restore(self, state: AgentState) -> None:
        """Let go of everything that was held down."""
        self.mailbox.release()

    def close(self, reason: str) -> None:
        """Take nothing any more, and say why to whoever waits for an outcome."""
        self.mailbox.close(reason)
        if self._told is not None:
            self._told.set_exception(InputError(reason))
            self._told = None

    def _tell(self, state: Mapping[str, Any]) -> None:
        if self._told is None:
            return
        told, self._told = self._told, None
        outcome = {"status": state["action_status"], "code": state["action_code"], "error": state["action_reason"]}
        told.set_result({"ok": state["action_status"] == "ok", **outcome})


def walk(held: HeldInput, observation: Observation) -> Action:
    """Return how keys move a body on legs or on a bicycle over the coming moment.

    With a direction of gaze, forward is there, and left, right and back are seen from there: the body turns that way
    and walks. Without, keys turn it, and back is half a turn.
    """
    state = observation["state"]
    ahead, aside = held.axis("y", "forward", "back"), held.axis("x", "right", "left")
    if state["vehicle"] not in ("", "bike"):
        ahead = aside = 0.0
    push = min(math.hypot(ahead, aside), 1.0)
    speed = BIKE_SPEED if state["vehicle"] == "bike" else RUN_SPEED if "run" in held.keys else WALK_SPEED
    turning = held.axis("turn", "turn_left", "turn_right")
    if push > 0.0:
        looks = heading(observation) if held.yaw is None or turning else held.yaw
        away = math.degrees(wrap_angle(looks + math.atan2(-aside, ahead) - heading(observation)))
        away = min(max(away / PERIOD, -SWING_SPEED), SWING_SPEED) if not turning else turning * TURN_SPEED
        straight = abs(away) * PERIOD <= TURNS_FIRST and abs(away) < SWING_SPEED
        return {"type": "move_forward", "distance": speed * push if straight else 0.0, "turn": away}
    if turning:
        side = "turn_left" if turning > 0 else "turn_right"
        return {"type": side, "degrees": abs(turning) * TURN_SPEED}
    return _look(held, observation)


def _look(held: HeldInput, observation: Observation) -> Action:
    """Return how somebody who stands turns to where they look."""
    if held.yaw is None:
        return {"type": "wait"}
    away = math.degrees(wrap_angle(held.yaw - heading(observation)))
    if abs(away) < 1.0:
        return {"type": "wait"}
    swing = min(abs(away) / PERIOD, SWING_SPEED)
    return {"type": "turn_left" if away > 0 else "turn_right", "degrees": swing}


def drive(held: HeldInput, observation: Observation) -> Action:
    """Return how keys and sticks drive a robot on wheels or legs: its ``velocity`` space."""
    ahead, turn = held.axis("y", "forward", "back"), held.axis("turn", "turn_left", "turn_right")
    turn = turn or -held.axis("x", "right", "left")
    fast = 1.0 if "run" in held.keys else 0.5
    return {"type": "control", "space": "velocity", "vector": [_FASTEST * ahead * fast, 0.0, _FASTEST_TURN * turn]}


def fly(held: HeldInput, observation: Observation) -> Action:
    """Return how keys and sticks fly a drone: its ``velocity`` space."""
    ahead, aside = held.axis("y", "forward", "back"), -held.axis("x", "right", "left")
    climb, turn = held.axis("up", "up", "down"), held.axis("turn", "turn_left", "turn_right")
    fast = _FASTEST_FLIGHT * (1.0 if "run" in held.keys else 0.5)
    vector = [fast * ahead, fast * aside, _FASTEST_CLIMB * climb, _FASTEST_TURN * turn]
    return {"type": "control", "space": "velocity", "vector": vector}


# What robots are asked for at most; each clips it to what it can do.
_FASTEST = 2.0  # m/s, on the ground
_FASTEST_TURN = 1.2  # rad/s
_FASTEST_FLIGHT = 6.0  # m/s, in the air
_FASTEST_CLIMB = 2.0  # m/s, up and down
