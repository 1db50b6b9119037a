"""A recorded run as the viewers want it: positions by second and body, events, and who is who."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.sim.recording import View


@dataclass(frozen=True)
class RecordedBody:
    """Something that moves; `agent` is the agent's name, None for traffic."""

    entity: int
    kind: str
    name: str
    length: float
    width: float
    agent: str | None


@dataclass(frozen=True)
class RecordedEvent:
    """Something that happened: `step` seconds after the start."""

    step: int
    kind: str
    agent: str
    text: str
    position: tuple[float, float]


@dataclass(frozen=True)
class Recording:
    """A run, whole or as far as it came.

    Attributes
    ----------
    start
        Second of the day at which it began.
    tracks
        x, y, yaw by step and body, float32, shape ``(steps + 1, n, 3)``; NaN where a body was not there.
    people
        Name, role, a few lines, and the schedule of each agent, by agent name.
    views
        First-person films, by agent name.
    view_steps
        The step of the run that each second of `tracks` shows, int64, shape ``(steps + 1,)``.
    """

    path: Path
    start: int
    tracks: NDArray[np.float32]
    bodies: list[RecordedBody]
    events: list[RecordedEvent]
    people: dict[str, dict[str, Any]]
    views: dict[str, View]
    view_steps: NDArray[np.int64]
    metrics: dict[str, Any]
    state_hash: str

    @property
    def steps(self) -> int:
        """Seconds recorded."""
        return len(self.tracks) - 1

    def body_of(self, agent: str) -> int:
        """Index of an agent's body."""
        return next(i for i, body in enumerate(self.bodies) if body.agent == agent)

    def pictures(self, agent: str, seconds: Sequence[int]) -> Iterator[NDArray[np.uint8] | None]:
        """Yield what an agent saw at each of some ascending seconds, or last before; None before its first picture."""
        steps = self.view_steps[list(seconds)].tolist()
        frames = self.views[agent].frames(set(steps))
        picture: NDArray[np.uint8] | None = None
        coming = next(frames, None)
        for step in steps:
            if coming is not None and coming[0] <= step:
                picture, coming = coming[1], next(frames, None)
            yield picture

    def key_pictures(self, agent: str) -> Iterator[tuple[int, NDArray[np.uint8]]]:
        """Yield second and picture of what an agent saw, wherever a whole frame is stored."""
        for step, picture in self.views[agent].key_frames():
            yield min(int(np.searchsorted(self.view_steps, step)), self.steps), picture

    def travelled(self) -> NDArray[np.float64]:
        """Metres each body covered, leaving out jumps through doors; shape ``(n,)``."""
        moves = np.diff(self.tracks[:, :, :2].astype(np.float64), axis=0)
        metres = np.linalg.norm(moves, axis=2)
        metres[~(metres < 15.0)] = 0.0
        return np.asarray(metres.sum(axis=0))
