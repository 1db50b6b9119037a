"""Time in layers, and what happens in a step: ticks, sub-steps, control periods, and the log of events.

The state counts ticks of 0.01 s; a sub-step has ten of them; each agent acts once in its control period. The log of
events is append-only; it is delivered to those who hear of it and recorded at the end of the step.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError

#: The state counts ticks of 0.01 s since the midnight before the run.
TICKS_PER_SECOND = 100
#: Traffic, transit and avatars advance by so many ticks at once, on ticks that are multiples of it.
SUBSTEP_TICKS = 10
#: The same, seconds.
SUBSTEP = SUBSTEP_TICKS / TICKS_PER_SECOND
#: What an avatar's action describes, ticks; whoever acts oftener cuts the motion short.
ACTION_TICKS = TICKS_PER_SECOND

_LONGEST = 3600 * TICKS_PER_SECOND


def ticks_of(seconds: float, what: str, *, multiple: int = 1) -> int:
    """Return a time as ticks.

    Parameters
    ----------
    what
        Names the time in errors.
    multiple
        It has to be a multiple of so many ticks.

    Raises
    ------
    InputError
        If it is not a positive multiple, or longer than an hour.
    """
    step = multiple / TICKS_PER_SECOND
    exact = float(seconds) * TICKS_PER_SECOND
    if not np.isfinite(exact) or not 0.0 < exact <= _LONGEST:
        raise InputError(f"{what} is {seconds} s; it has to be more than 0 and at most an hour")
    ticks = round(exact)
    if abs(ticks - exact) > 1e-6 or ticks % multiple:
        raise InputError(f"{what} is {seconds} s; it has to be a multiple of {step:g} s")
    return ticks


@dataclass(frozen=True)
class ControlPeriods:
    """Control periods of the agents of a run; they never change.

    Attributes
    ----------
    start
        Tick of the state at which the run began: everybody is due then.
    ticks
        Each agent's period, int64, shape ``(agents,)``, in the order of their names.
    """

    start: int
    ticks: NDArray[np.int64]

    @classmethod
    def of(
        cls, people: Sequence[str], robots: Mapping[str, float], asked: Mapping[str, float | str], *, start: int
    ) -> ControlPeriods:
        """Return the periods of a run's agents: 1 s each, unless others are asked for.

        Parameters
        ----------
        people
            Names of residents and assistants.
        robots
            Control period of each robot's model by the robot's name, seconds.
        asked
            Periods by agent's name, seconds; ``"model"`` is the period of a robot's model, ``"robots"`` stands for
            all robots.
        start
            Tick at which the run begins.

        Raises
        ------
        InputError
            If nobody has a name, or a period is none: people's are multiples of 0.1 s, robots' of 0.01 s.
        """
        given = dict(asked)
        if "robots" in given:
            everyone = given.pop("robots")
            given = dict.fromkeys(robots, everyone) | given
        names = [*people, *robots]
        unknown = [name for name in given if name not in names]
        if unknown:
            raise InputError(
                f"periods: nobody is called {unknown[0]!r}; there are {', '.join(names)}"
                + (", and 'robots' for all robots" if robots else "")
            )
        ticks = np.full(len(names), TICKS_PER_SECOND, np.int64)
        for k, name in enumerate(names):
            value = given.get(name, 1.0)
            if isinstance(value, str):
                if value != "model" or name not in robots:
                    raise InputError(
                        f"periods: {name} has the period {value!r}; give seconds"
                        + (', or "model" for its model\'s own' if name in robots else "")
                    )
                value = robots[name]
            ticks[k] = ticks_of(value, f"periods: {name}'s", multiple=1 if name in robots else SUBSTEP_TICKS)
        return cls(start, ticks)

    @property
    def equal(self) -> bool:
        """Whether all agents act at the same times."""
        return not len(self.ticks) or bool((self.ticks == self.ticks[0]).all())

    def due(self, tick: int) -> NDArray[np.bool_]:
        """Return who observes and acts at a tick, shape ``(agents,)``."""
        return np.asarray((tick - self.start) % self.ticks == 0)

    def next_due(self, tick: int) -> int:
        """Return the first tick after this one at which somebody acts; a second later where there is nobody."""
        if not len(self.ticks):
            return tick + TICKS_PER_SECOND
        return tick + int((self.ticks - (tick - self.start) % self.ticks).min())

    def since_begun(self, tick: int) -> NDArray[np.int64]:
        """Return how many ticks ago each agent acted last, shape ``(agents,)``; 0 for those who are due."""
        return np.asarray((tick - self.start) % self.ticks)


KINDS = (
    "message",
    "arrival",
    "late",
    "collision",
    "enter",
    "exit",
    "boarding",
    "alighting",
    "mount",
    "dismount",
    "pick",
    "put",
    "hand_over",
    "refused",
    "agent_late",
    "agent_failed",
    "task_complete",
    "robot",
    "city",
)


@dataclass(frozen=True)
class Event:
    """Something that happened.

    Attributes
    ----------
    time
        Seconds of the day of the step it happened in.
    agent
        Name of who did it or whom it befell.
    text
        What was said, or what happened in words.
    data
        Details by name; numbers, strings and lists of them only.
    """

    step: int
    time: float
    kind: str
    agent: str
    text: str
    position: tuple[float, float, float]
    data: dict[str, Any] = field(default_factory=dict)

    def record(self) -> dict[str, Any]:
        """As a line of `events.jsonl`."""
        x, y, z = (round(value, 3) for value in self.position)
        return {
            "step": self.step,
            "time": self.time,
            "kind": self.kind,
            "agent": self.agent,
            "text": self.text,
            "x": x,
            "y": y,
            "z": z,
            "data": self.data,
        }


@dataclass(frozen=True)
class Message:
    """Something said, as a listener hears it."""

    time: float
    speaker: str
    text: str
    position: tuple[float, float, float]

    def record(self) -> dict[str, Any]:
        """As the observation's `events` hold it."""
        return {"time": self.time, "speaker": self.speaker, "text": self.text, "position": list(self.position)}


class Events:
    """The events of the step in progress, and what every agent heard in it."""

    def __init__(self, names: list[str]) -> None:
        self.names = names
        self.step = 0
        self.time = 0.0
        self.log: list[Event] = []
        self.heard: dict[str, list[Message]] = {name: [] for name in names}
        # What is said between two steps: it is heard in the next one.
        self._later: list[dict[str, Any]] = []

    def begin(self, step: int, time: float, observed: Iterable[str]) -> None:
        """Start a step: forget what the last one held, and what those have heard who have `observed` it."""
        self.step, self.time = step, time
        self.log = []
        self.heard |= {name: [] for name in observed}
        for said in self._later:
            self.say(said["speaker"], said["text"], np.array(said["position"]), said["listeners"])
        self._later = []

    def say_later(self, speaker: str, text: str, position: NDArray[Any], listeners: list[str]) -> None:
        """Deliver a message at the beginning of the next step; see `say`."""
        place = [float(value) for value in position[:3]]
        self._later.append({"speaker": speaker, "text": text, "position": place, "listeners": listeners})

    def add(self, kind: str, agent: str, text: str, position: NDArray[Any], **data: Any) -> None:
        """Note that something happened."""
        x, y, z = (float(value) for value in position[:3])
        self.log.append(Event(self.step, self.time, kind, agent, text, (x, y, z), data))

    def say(
        self,
        speaker: str,
        text: str,
        position: NDArray[Any],
        listeners: list[str],
        missed: Mapping[str, str] | None = None,
    ) -> None:
        """Deliver a message: those who hear it find it in their next observation.

        Parameters
        ----------
        missed
            Who was near and did not hear it, and why.
        """
        self.add("message", speaker, text, position, hearers=listeners, missed=dict(missed or {}))
        said = Message(self.time, speaker, text, self.log[-1].position)
        for name in listeners:
            self.heard[name].append(said)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the messages in the air, as bytes: they are part of what the next observation holds."""
        heard = {name: [m.record() for m in messages] for name, messages in self.heard.items() if messages}
        text = json.dumps(heard, sort_keys=True, ensure_ascii=False)
        later = json.dumps(self._later, sort_keys=True, ensure_ascii=False).encode() if self._later else b""
        told = {"heard": np.frombuffer(text.encode(), np.uint8)}
        return told | ({"later": np.frombuffer(later, np.uint8)} if later else {})

    def restore(self, arrays: dict[str, NDArray[Any]]) -> None:
        """Hear again what `arrays` held."""
        heard = json.loads(np.asarray(arrays["heard"], np.uint8).tobytes().decode())
        self.log = []
        later = np.asarray(arrays.get("later", []), np.uint8).tobytes().decode()
        self._later = json.loads(later) if later else []
        self.heard = {
            name: [
                Message(m["time"], m["speaker"], m["text"], (m["position"][0], m["position"][1], m["position"][2]))
                for m in heard.get(name, [])
            ]
            for name in self.names
        }
