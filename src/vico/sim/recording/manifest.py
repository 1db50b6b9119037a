"""What a run folder tells of the run as a whole: ``run.json`` and ``agents.json``."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vico.errors import MissingFileError, SchemaError
from vico.io.files import read_json
from vico.io.folders import mistaken
from vico.sim.recording.schema import MANIFEST, SCHEMA, SEGMENT_STEPS, VERSION
from vico.version import __version__

if TYPE_CHECKING:
    from vico.assets.people import Appearance
    from vico.sim.simulation import Simulation


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
            self._known = _models_of(self._sim) | self._known
        return self._known.get(entity)


def _models_of(sim: Simulation) -> dict[int, str]:
    state, found = sim.state, dict[int, str]()
    if state.robots is not None:
        found |= dict(zip(state.robots.bodies().entity.tolist(), sim.config.robots, strict=True))
    found |= dict(zip(state.objects.entity.tolist(), state.objects.prototypes, strict=True))
    systems = [system for system in (state.traffic, state.transit, state.things) if system is not None]
    for drawn in (system.draw() for system in systems if system is not state.things or len(state.things)):
        for entity, index in zip(drawn.entity.tolist(), drawn.index.tolist(), strict=True):
            # Bodies come before their parts: lamps, leaves of doors.
            found.setdefault(entity, drawn.prototypes[index])
    return found


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
        raise MissingFileError(mistaken(path, "run", "vico run"))
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
    world, community, config = (_mapping(manifest.get(name)) for name in ("world", "community", "config"))
    words = ["vico", "run", world.get("path") or "WORLD", community.get("path") or "COMMUNITY"]
    options = {"seed": manifest.get("seed"), "steps": manifest.get("wanted_steps"), "out": path}
    options |= {name: config.get(name) for name in ("cars", "cyclists", "pedestrians")}
    options |= {name: ",".join(config[name]) or "none" for name in ("robots", "observe") if _is_names(config.get(name))}
    words += [word for name, value in options.items() if value is not None for word in (f"--{name}", value)]
    return shlex.join(map(str, [*words, "--force"]))


def _mapping(value: object) -> Mapping[str, Any]:
    return value if isinstance(value, dict) else {}


def _is_names(value: object) -> bool:
    return isinstance(value, list) and all(isinstance(name, str) for name in value)


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
