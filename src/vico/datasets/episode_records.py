"""What a dataset says of each of its episodes: a row of ``episodes.parquet``, and its statistics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.datasets.demonstrations import Demonstration
from vico.datasets.statistics import colour_counts, depth_moments, vector_statistics
from vico.sim.recording import Run
from vico.world.folder import World


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


def episode_record(demonstration: Demonstration, tally: Tally, run: Run, world: World | None) -> dict[str, Any]:
    """Return what is said of a demonstration, as JSON.

    Parameters
    ----------
    world
        Names what the pictures show that is no body; without it, those have no name.
    """
    facts = demonstration.facts
    manifest = run.manifest
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
        "world": {"name": _world_name(run, world), "digest": manifest["world"]["digest"]},
        "sources": [] if world is None else [source.model_dump(mode="json") for source in world.manifest.sources],
        "run": manifest["state_hash"],
        "producer": manifest["producer"],
        "state_names": list(demonstration.state_names),
        "width": demonstration.form.width,
        "space": demonstration.form.space,
        "goal": demonstration.goal is not None,
        "gaps": _gaps(demonstration, run),
        "tally": tally.record(),
        "statistics": {name: vector_statistics(values) for name, values in vectors_of(demonstration).items()},
        "entities": _names(tally.entities, run, world),
    }


def _world_name(run: Run, world: World | None) -> str:
    return run.source("world").name if world is None or world.path is None else world.path.name


def _gaps(demonstration: Demonstration, run: Run) -> int:
    """Return after how many frames more time passed than a frame lasts, such as at appointments."""
    times = run.times[demonstration.steps]
    return int((np.diff(times) > 1.0 / demonstration.fps + 1e-6).sum())


def _names(entities: Sequence[int], run: Run, world: World | None) -> list[dict[str, Any]]:
    """Return kind and name of entities, as far as the recording and the world tell."""
    fixed = {} if world is None else world.entities
    found: list[dict[str, Any]] = []
    for entity in entities:
        body, thing = run.cast.get(entity), fixed.get(entity)
        if body is not None:
            found.append({"entity": entity, "kind": body.kind, "name": body.name})
        elif thing is not None:
            found.append({"entity": entity, "kind": thing["kind"], "name": thing["name"]})
        else:
            found.append({"entity": entity, "kind": "unknown", "name": ""})
    return found
