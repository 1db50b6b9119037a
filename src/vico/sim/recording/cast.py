"""Who and what takes part in a run, and from when to when: a log that grows as bodies come and go.

A line of ``cast.jsonl`` tells of one body: with ``kind``, ``name``, ``size`` and ``agent``, that it is there from
``step`` on, or has become what the line says; with ``"gone": true``, that it is there no longer.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import SchemaError
from vico.io.files import write_bytes
from vico.sim.bodies import KINDS, Bodies
from vico.sim.recording.schema import CAST


@dataclass(frozen=True)
class CastMember:
    """A body of a run.

    Attributes
    ----------
    entity
        Its number, unique in the run.
    kind, name
        What it is, one of `vico.sim.bodies.KINDS`, and what it is called.
    size
        Length, width, height as last recorded, metres.
    agent
        Name of the agent whose body it is, None for what nobody plays.
    pedestrian
        Index among the pedestrians nobody plays, None for everybody else; looks and manner follow from it.
    intervals
        First step at which it was there, and the first at which it no longer was (None: to the end), once for each
        time that it came.
    model
        Shape it is drawn with: of vehicles, robots and things; None for people, and in runs from before it was told.
    """

    entity: int
    kind: str
    name: str
    size: tuple[float, float, float]
    agent: str | None
    pedestrian: int | None
    intervals: tuple[tuple[int, int | None], ...]
    model: str | None = None

    def present(self, step: int) -> bool:
        """Whether it was there at a step."""
        return any(first <= step and (until is None or step < until) for first, until in self.intervals)


class CastLog:
    """Notes who comes, changes and goes while a run is recorded.

    Parameters
    ----------
    describe
        Returns ``name``, ``agent``, ``pedestrian`` and ``model`` of an entity.
    """

    def __init__(self, describe: Callable[[int], Mapping[str, Any]]) -> None:
        self._describe = describe
        self._entity = np.zeros(0, np.int32)
        self._shape = np.zeros((0, 4))
        self.lines: list[dict[str, Any]] = []
        #: What was different at the step watched last.
        self.latest: list[dict[str, Any]] = []

    def watch(self, step: int, bodies: Bodies) -> None:
        """Note what is different at a step; lines wait in `lines` until they are written."""
        self.latest = []
        shape = np.column_stack([bodies.kind, 2 * bodies.half_length, 2 * bodies.half_width, bodies.height])
        if np.array_equal(bodies.entity, self._entity) and np.array_equal(shape, self._shape):
            return
        before = dict(zip(self._entity.tolist(), self._shape, strict=True))
        now = dict(zip(bodies.entity.tolist(), shape, strict=True))
        for entity in sorted(before.keys() - now.keys()):
            self.latest.append({"step": step, "entity": entity, "gone": True})
        for entity, row in now.items():
            if entity not in before or not np.array_equal(before[entity], row):
                self.latest.append(self._line(step, entity, row))
        self.lines += self.latest
        self._entity, self._shape = bodies.entity.copy(), shape

    def _line(self, step: int, entity: int, row: NDArray[np.float64]) -> dict[str, Any]:
        return {
            "step": step,
            "entity": entity,
            "kind": KINDS[int(row[0])],
            "size": [round(float(value), 3) for value in row[1:]],
            **self._describe(entity),
        }


def append_cast(run: Path, lines: Sequence[Mapping[str, Any]]) -> None:
    """Append lines to the cast of a run."""
    if lines:
        with (run / CAST).open("ab") as file:
            file.writelines(_encoded(line) for line in lines)


def cut_cast(run: Path, step: int) -> None:
    """Drop what came after a step."""
    write_bytes(run / CAST, [_encoded(line) for line in cast_lines(run) if line["step"] <= step])


def read_cast(run: Path, last: int) -> dict[int, CastMember]:
    """Return everybody and everything that was there at some step up to `last`, by entity, in the order of coming."""
    found: dict[int, CastMember] = {}
    for line in cast_lines(run):
        if line["step"] > last:
            break
        take_line(found, line)
    return found


def take_line(found: dict[int, CastMember], line: Mapping[str, Any]) -> None:
    """Take in a line of the cast: who comes, is different, or goes."""
    entity, step = line["entity"], line["step"]
    known = found.get(entity)
    if line.get("gone"):
        if known is not None:
            intervals = (*known.intervals[:-1], (known.intervals[-1][0], step))
            found[entity] = replace(known, intervals=intervals)
        return
    intervals = known.intervals if known is not None else ()
    if not intervals or intervals[-1][1] is not None:
        intervals = (*intervals, (step, None))
    length, width, height = line["size"]
    size = (float(length), float(width), float(height))
    agent, pedestrian = line["agent"], line["pedestrian"]
    model = line.get("model")
    found[entity] = CastMember(entity, line["kind"], line["name"], size, agent, pedestrian, intervals, model)


def cast_lines(run: Path) -> Iterator[dict[str, Any]]:
    """Yield the whole lines of a run's cast.

    Raises
    ------
    SchemaError
        If one is damaged; the last may be cut short, by a kill or because it is being written.
    """
    content = (run / CAST).read_bytes() if (run / CAST).exists() else b""
    lines = content.split(b"\n")[:-1]
    for number, line in enumerate(lines, 1):
        try:
            yield json.loads(line)
        except ValueError as error:
            raise SchemaError(f"{run / CAST}: line {number} is not JSON ({error}); run it anew") from None


def _encoded(line: Mapping[str, Any]) -> bytes:
    return json.dumps(line, ensure_ascii=False, sort_keys=True).encode() + b"\n"
