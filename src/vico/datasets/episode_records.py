"""What a dataset says of each of its episodes: a row of ``episodes.parquet``, and its statistics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.datasets.demonstrations import Demonstration
from vico.datasets.statistics import colour_counts, depth_moments, vector_statistics
from vico.sim.recording import Run
from vico.world.world import World


class Tally:
    """Counts what statistics of pictures need, and which entities they show."""

    def __init__(self) -> None:
        self._colours = np.zeros((3, 256), np.int64)
        self._depth: list[Mapping[str, float]] = []
        self._entities: set[int] = set()

    def add(self, pictures: Mapping[str, NDArray[Any]]) -> None:
        """Take the pictures of a frame."""
        if "rgb" in pictures:
            self._colours += colour_counts(pictures["rgb"])
        if "depth" in pictures:
            self._depth.append(depth_moments(pictures["depth"]))
        if "segmentation" in pictures:
            self._entities.update(np.unique(pictures["segmentation"]).tolist())

    @property
    def entities(self) -> list[int]:
        """Entities that were seen, ascending."""
        return sorted(entity for entity in self._entities if entity > 0)

    def record(self) -> dict[str, Any]:
        """Return the counts as JSON; those of depth added up."""
        found: dict[str, Any] = {}
        if self._colours.any():
            found["rgb"] = self._colours.tolist()
        if self._depth:
            summed = {name: sum(one[name] for one in self._depth) for name in ("pixels", "sum", "squares")}
            low, high = min(one["min"] for one in self._depth), max(one["max"] for one in self._depth)
            found["depth"] = summed | {"min": min(low, 1e30), "max": high}
        return found


def vectors_of(demonstration: Demonstration) -> dict[str, NDArray[Any]]:
    """Return what statistics are told of, by the name that trainers know it by."""
    found: dict[str, NDArray[Any]] = {"observation.state": demonstration.state, "action": demonstration.action}
    if demonstration.goal is not None:
        found["observation.environment_state"] = demonstration.goal
    return found


@dataclass(frozen=True)
class Origin:
    """Where a demonstration comes from.

    Attributes
    ----------
    world
        Its name and digest.
    sources
        Of the world's data, as its manifest tells them.
    run
        Hash of all that happened.
    producer
        What made it.
    gaps
        After how many frames more time passed than a frame lasts, such as at appointments.
    names
        Kind and name of entities that the pictures may show; the first that knows one names it.
    """

    world: Mapping[str, str]
    sources: Sequence[Mapping[str, Any]]
    run: str
    producer: str
    gaps: int
    names: Sequence[Mapping[int, Mapping[str, str]]]


def origin_of_run(demonstration: Demonstration, run: Run, world: World | None) -> Origin:
    """Return where a demonstration of a recorded run comes from.

    Parameters
    ----------
    world
        Names what the pictures show that is no body; without it, those have no name.
    """
    manifest = run.manifest
    cast = {entity: {"kind": body.kind, "name": body.name} for entity, body in run.cast.items()}
    return Origin(
        {"name": _world_name(run, world), "digest": manifest["world"]["digest"]},
        [] if world is None else [source.model_dump(mode="json") for source in world.manifest.sources],
        manifest["state_hash"],
        manifest["producer"],
        _gaps(demonstration, run),
        [cast] if world is None else [cast, world.entities],
    )


def episode_record(demonstration: Demonstration, tally: Tally, origin: Origin) -> dict[str, Any]:
    """Return what is said of a demonstration, as JSON."""
    facts = demonstration.facts
    return {
        "frames": len(demonstration),
        "fps": demonstration.fps,
        "agent": demonstration.agent,
        "kind": demonstration.kind,
        "body": demonstration.body,
        "person": demonstration.person,
        "challenge": facts.challenge,
        "category": facts.category,
        "method": facts.method,
        "seed": facts.seed,
        "success": demonstration.success,
        "persons": [demonstration.person] if demonstration.person else list(facts.persons),
        "instructions": list(dict.fromkeys(demonstration.instructions)),
        "world": dict(origin.world),
        "sources": [dict(source) for source in origin.sources],
        "run": origin.run,
        "producer": origin.producer,
        "state_names": list(demonstration.state_names),
        "width": demonstration.form.width,
        "space": demonstration.form.space,
        "goal": demonstration.goal is not None,
        "gaps": origin.gaps,
        "tally": tally.record(),
        "statistics": {name: vector_statistics(values) for name, values in vectors_of(demonstration).items()},
        "entities": _names(tally.entities, origin.names),
    }


def _world_name(run: Run, world: World | None) -> str:
    return run.source("world").name if world is None or world.path is None else world.path.name


def _gaps(demonstration: Demonstration, run: Run) -> int:
    """Return after how many frames more time passed than a frame lasts, such as at appointments."""
    times = run.times[demonstration.steps]
    return int((np.diff(times) > 1.0 / demonstration.fps + 1e-6).sum())


def _names(entities: Sequence[int], names: Sequence[Mapping[int, Mapping[str, str]]]) -> list[dict[str, Any]]:
    """Return kind and name of entities, as far as they are known."""
    unknown = {"kind": "unknown", "name": ""}
    found: list[dict[str, Any]] = []
    for entity in entities:
        known = next((one[entity] for one in names if entity in one), unknown)
        found.append({"entity": entity, "kind": known["kind"], "name": known["name"]})
    return found
