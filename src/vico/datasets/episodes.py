"""Facts of each episode of a dataset: a row of ``episodes.parquet``, and its statistics.

Statistics are exact, of vectors and of pictures, for an episode and for all, as formats of trainers want them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.datasets.demonstrations import Demonstration
from vico.sim.recording import Run
from vico.world.world import World

#: Shares whose quantiles are told, by name.
QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}

Statistics = dict[str, list[Any]]


def vector_statistics(values: NDArray[Any]) -> Statistics:
    """Return min, max, mean, std, count and quantiles of each column.

    Parameters
    ----------
    values
        Shape ``(n,)`` or ``(n, d)``, n at least 1; a single column is told as a list of one.
    """
    columns = np.asarray(values, np.float64).reshape(len(values), -1)
    found = {
        "min": columns.min(axis=0),
        "max": columns.max(axis=0),
        "mean": columns.mean(axis=0),
        "std": columns.std(axis=0),
    }
    found |= {name: np.quantile(columns, share, axis=0) for name, share in QUANTILES.items()}
    return {name: numbers.tolist() for name, numbers in found.items()} | {"count": [len(columns)]}


def colour_counts(pictures: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Return how many pixels have each value, int64, shape ``(3, 256)``; pictures of any leading shape."""
    pixels = pictures.reshape(-1, 3)
    return np.stack([np.bincount(pixels[:, channel], minlength=256) for channel in range(3)]).astype(np.int64)


def colour_statistics(counts: NDArray[np.int64], pictures: int) -> Statistics:
    """Return statistics of colours in 0..1, each a list of shape ``(3, 1, 1)``; exact, for bytes have 256 values.

    Parameters
    ----------
    counts
        Of `colour_counts`, added up over all pictures.
    pictures
        How many they were.
    """
    values = np.arange(256) / 255.0
    total = counts.sum(axis=1)
    mean = counts @ values / total
    variance = np.maximum(counts @ values**2 / total - mean**2, 0.0)
    below = np.cumsum(counts, axis=1)
    found = {"min": _first_true(counts > 0), "max": 255 - _first_true(counts[:, ::-1] > 0)}
    columns = {name: place / 255.0 for name, place in found.items()} | {"mean": mean, "std": np.sqrt(variance)}
    for name, share in QUANTILES.items():
        columns[name] = _first_true(below >= share * total[:, None]) / 255.0
    return {name: numbers.reshape(3, 1, 1).tolist() for name, numbers in columns.items()} | {"count": [pictures]}


def _first_true(mask: NDArray[np.bool_]) -> NDArray[np.int64]:
    return np.argmax(mask, axis=1)


def depth_moments(pictures: NDArray[np.float32]) -> Mapping[str, float]:
    """Return sums over the pixels at which something is, from which `depth_statistics` are made."""
    seen = pictures[pictures > 0.0].astype(np.float64)  # 0 stands for nothing
    if not len(seen):
        return {"pixels": 0.0, "sum": 0.0, "squares": 0.0, "min": float("inf"), "max": 0.0}
    return {
        "pixels": float(len(seen)),
        "sum": float(seen.sum()),
        "squares": float((seen**2).sum()),
        "min": float(seen.min()),
        "max": float(seen.max()),
    }


def depth_statistics(moments: Sequence[Mapping[str, float]], pictures: int) -> Statistics:
    """Return min, max, mean and std of depth, metres, over the pixels at which something is; shape ``(1, 1)`` each."""
    pixels = sum(one["pixels"] for one in moments)
    if not pixels:
        return {name: [[0.0]] for name in ("min", "max", "mean", "std")} | {"count": [pictures]}
    mean = sum(one["sum"] for one in moments) / pixels
    variance = max(sum(one["squares"] for one in moments) / pixels - mean**2, 0.0)
    found = {
        "min": min(one["min"] for one in moments),
        "max": max(one["max"] for one in moments),
        "mean": mean,
        "std": variance**0.5,
    }
    return {name: [[number]] for name, number in found.items()} | {"count": [pictures]}


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


@dataclass(frozen=True)
class Origin:
    """Origin of a demonstration.

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
    # After how many frames more time passed than a frame lasts, such as at appointments.
    gaps = int((np.diff(run.times[demonstration.steps]) > 1.0 / demonstration.fps + 1e-6).sum())
    name = run.source("world").name if world is None or world.path is None else world.path.name
    return Origin(
        {"name": name, "digest": manifest["world"]["digest"]},
        [] if world is None else [source.model_dump(mode="json") for source in world.manifest.sources],
        manifest["state_hash"],
        manifest["producer"],
        gaps,
        [cast] if world is None else [cast, world.entities],
    )


def episode_record(demonstration: Demonstration, tally: Tally, origin: Origin) -> dict[str, Any]:
    """Return what is said of a demonstration, as JSON."""
    facts = demonstration.facts
    columns = {"observation.state": demonstration.state, "action": demonstration.action}
    if demonstration.goal is not None:
        columns["observation.environment_state"] = demonstration.goal
    unknown = {"kind": "unknown", "name": ""}
    entities: list[dict[str, Any]] = []
    for entity in tally.entities:
        known = next((one[entity] for one in origin.names if entity in one), unknown)
        entities.append({"entity": entity, "kind": known["kind"], "name": known["name"]})
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
        "statistics": {name: vector_statistics(values) for name, values in columns.items()},
        "entities": entities,
    }
