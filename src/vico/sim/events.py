"""What happens and who hears of it: an append-only log of the step, delivered and recorded at its end."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
