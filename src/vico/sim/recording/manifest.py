"""Files of a run folder about the run as a whole: ``run.json``, ``agents.json`` and ``cast.jsonl``.

The cast is who and what takes part, and from when to when: a log that grows as bodies come and go. A line of
``cast.jsonl`` tells of one body: with ``kind``, ``name``, ``size`` and ``agent``, that it is there from ``step`` on, or
has become what the line says; with ``"gone": true``, that it is there no longer.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import MissingFileError, SchemaError
from vico.io.files import read_json, write_bytes, wrong_folder_sentence
from vico.sim.bodies.arrays import KINDS, Bodies
from vico.sim.recording.schema import CAST, MANIFEST, SCHEMA, SEGMENT_STEPS, VERSION
from vico.version import __version__

if TYPE_CHECKING:
    from vico.assets.people import Appearance
    from vico.sim.loop.simulation import Simulation


def run_record(
    sim: Simulation, status: str, digest: str, sources: Mapping[str, str], wanted: int, identity: str
) -> dict[str, Any]:
    """Return what ``run.json`` says of a simulation whose state has the hash `digest`.

    `identity` is the simulation's from before its first step: things may have been dropped since.
    """
    community = sim.community
    return {
        "schema_name": SCHEMA,
        "version": VERSION,
        "producer": f"vico {__version__}",
        "status": status,
        "identity": identity,
        "seed": sim.config.seed,
        "config": sim.config.record(),
        "world": {"path": sources.get("world", ""), "digest": sim.world.digest},
        "community": None
        if community is None
        else {"path": sources.get("community", ""), "residents": len(sim.residents)},
        "start": sim.config.start,
        "steps": sim.metrics.steps,
        "wanted_steps": wanted,
        "segment_steps": SEGMENT_STEPS,
        "state_hash": digest,
    }


def agents_record(sim: Simulation) -> list[dict[str, Any]]:
    """Return what ``agents.json`` says of each agent."""
    people, robots = sim.state.people, sim.state.robots
    places = {place.id: place.name for place in sim.world.places}
    found: list[dict[str, Any]] = []
    for i, name in enumerate(people.names):
        person = sim.residents[i] if i < len(sim.residents) else None
        found.append(
            {
                "name": name,
                "kind": "assistant" if person is None else "resident",
                "entity": int(people.entity[i]),
                "resident": None if person is None else person.id,
                "person": None if person is None else _person(person, sim.looks[i], places),
            }
        )
    if robots is not None:
        entities = robots.bodies().entity.tolist()
        found += [
            {"name": name, "kind": "robot", "entity": entity, "resident": None, "person": None}
            for name, entity in zip(robots.names, entities, strict=True)
        ]
    return found


class _Models:
    """Tells which shape entities are drawn with."""

    def __init__(self, sim: Simulation) -> None:
        self._sim, self._known, self._step = sim, dict[int, str](), -1

    def of(self, entity: int) -> str | None:
        """Return the model of an entity; None for people, and for what nothing is drawn of."""
        if entity not in self._known and self._step != self._sim.metrics.steps:
            self._step = self._sim.metrics.steps
            state, models = self._sim.state, dict[int, str]()
            if state.robots is not None:
                models |= dict(zip(state.robots.bodies().entity.tolist(), self._sim.config.robots, strict=True))
            models |= dict(zip(state.objects.entity.tolist(), state.objects.prototypes, strict=True))
            systems = [system for system in (state.traffic, state.transit, state.things) if system is not None]
            for drawn in (system.draw() for system in systems if system is not state.things or len(state.things)):
                for body, index in zip(drawn.entity.tolist(), drawn.index.tolist(), strict=True):
                    # Bodies come before their parts: lamps, leaves of doors.
                    models.setdefault(body, drawn.prototypes[index])
            self._known = models | self._known
        return self._known.get(entity)


def describer(sim: Simulation) -> Callable[[int], dict[str, Any]]:
    """Return what tells an entity's name, whose body it is, which pedestrian and which model, as the cast says it."""
    models = _Models(sim)
    people, robots = sim.state.people, sim.state.robots
    agents = dict(zip(people.entity.tolist(), people.names, strict=True))
    if robots is not None:
        agents |= dict(zip(robots.bodies().entity.tolist(), robots.names, strict=True))
    walkers = sim.state.traffic.walkers.entity.tolist() if sim.state.traffic is not None else []
    pedestrians = {entity: k for k, entity in enumerate(walkers)}

    def describe(entity: int) -> dict[str, Any]:
        name = sim.entity(entity)["name"]
        played = {"agent": agents.get(entity), "pedestrian": pedestrians.get(entity)}
        return {"name": name, "model": models.of(entity), **played}

    return describe


def read_manifest(path: Path) -> dict[str, Any]:
    """Return ``run.json``.

    Raises
    ------
    MissingFileError, SchemaError
        If there is none, or it is of another version.
    """
    if not (path / MANIFEST).exists():
        raise MissingFileError(wrong_folder_sentence(path, "run", "vico run"))
    manifest = read_json(path / MANIFEST)
    if not isinstance(manifest, dict) or manifest.get("schema_name") != SCHEMA:
        raise SchemaError(f"{path / MANIFEST}: not a {SCHEMA} file; give a run folder")
    if manifest.get("version") != VERSION:
        raise SchemaError(
            f"{path}: a run of version {manifest.get('version')!r} of the format, written by "
            f"{manifest.get('producer')}; this vico reads version {VERSION}; run it anew: {_command(path, manifest)}"
        )
    return manifest


def _command(path: Path, manifest: Mapping[str, Any]) -> str:
    """Return what to type to make a run again, as far as its manifest tells."""
    parts = [manifest.get(name) for name in ("world", "community", "config")]
    world, community, config = (part if isinstance(part, dict) else {} for part in parts)
    words = ["vico", "run", world.get("path") or "WORLD", community.get("path") or "COMMUNITY"]
    options = {"seed": manifest.get("seed"), "steps": manifest.get("wanted_steps"), "out": path}
    options |= {name: config.get(name) for name in ("cars", "cyclists", "pedestrians")}
    for name in ("robots", "observe"):
        names = config.get(name)
        if isinstance(names, list) and all(isinstance(one, str) for one in names):
            options[name] = ",".join(names) or "none"
    words += [word for name, value in options.items() if value is not None for word in (f"--{name}", value)]
    return shlex.join(map(str, [*words, "--force"]))


def _person(resident: Any, look: Appearance, places: Mapping[str, str]) -> dict[str, Any]:
    return {
        "name": resident.name,
        "age": resident.age,
        "gender": resident.gender,
        "occupation": resident.occupation,
        "biography": resident.biography,
        "appearance": look.to_dict(),
        "schedule": [
            {
                "type": str(item.type),
                "start": item.start,
                "end": item.end,
                "activity": item.activity,
                "place": places.get(item.place or "", ""),
            }
            for item in resident.schedule
        ],
    }


@dataclass(frozen=True)
class CastMember:
    """A body of a run.

    Attributes
    ----------
    entity
        Its number, unique in the run.
    kind, name
        What it is, one of `vico.sim.bodies.arrays.KINDS`, and what it is called.
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
            file.writelines(_json_line(line) for line in lines)


def cut_cast(run: Path, step: int) -> None:
    """Drop what came after a step."""
    write_bytes(run / CAST, [_json_line(line) for line in cast_lines(run) if line["step"] <= step])


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


def _json_line(line: Mapping[str, Any]) -> bytes:
    return json.dumps(line, ensure_ascii=False, sort_keys=True).encode() + b"\n"
