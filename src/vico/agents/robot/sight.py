"""What a robot sees around its base: points, and whose they are."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.agents.perception import points_from_depth
from vico.agents.robot.body import ArmBody, Stance
from vico.geometry import distances

Array = NDArray[np.float64]

# Fewer pixels are no sight of a thing.
_PIXELS = 6
# Metres round a spot in which points tell its height, and how many there are at least.
_SUPPORT, _FEWEST = 0.06, 8
# Points farther away say nothing about what an arm can do, metres.
_FARTHEST = 6.0


class Look(NamedTuple):
    """One picture, as points.

    Attributes
    ----------
    points
        In the base's frame, metres, shape ``(n, 3)``.
    entity
        What each belongs to, shape ``(n,)``.
    """

    points: Array
    entity: NDArray[np.int64]

    def of(self, entity: int) -> Array:
        """Return the points of one thing, shape ``(m, 3)``."""
        return self.points[self.entity == entity]

    def without(self, *entities: int) -> Array:
        """Return the points of everything else."""
        return self.points[~np.isin(self.entity, entities)]


def look(observation: Mapping[str, Any], *, step: int = 1) -> Look:
    """Return what an observation's depth and segmentation show, near the base.

    Parameters
    ----------
    step
        Use every `step`-th row and column.
    """
    depth = np.where(observation["depth"] < _FARTHEST, observation["depth"], 0.0)
    points, pixels = points_from_depth(depth, observation["intrinsics"], observation["extrinsics"], step=step)
    entity = np.asarray(observation["segmentation"], np.int64).reshape(-1)[pixels]
    return Look(Stance.of(observation).inside(points), entity)


class Seen(NamedTuple):
    """A thing in a picture.

    Attributes
    ----------
    entity
        Its number in segmentation.
    low
        Where it stands: the middle of its points, as low as they are, in the base's frame, metres, shape ``(3,)``.
    """

    entity: int
    low: Array


def seen_at(observation: Mapping[str, Any], info: Mapping[str, Any], name: str) -> Seen | None:
    """Return where a thing of a name is in a picture; None where it is not in view."""
    named = (int(e) for e, about in info["entities"].items() if about.get("name") == name)
    entity = next(named, 0)
    if not entity:
        return None
    points = look(observation).of(entity)
    if len(points) < _PIXELS:
        return None
    return Seen(entity, np.array([*np.median(points[:, :2], axis=0), points[:, 2].min()]))


def height_at(points: Array, spot: Array) -> float:
    """Return how high what was seen round a spot is, in the points' frame; the spot's own height if that is little."""
    near = points[distances(points[:, :2], spot[:2]) < _SUPPORT]
    return float(np.median(near[:, 2])) if len(near) >= _FEWEST else float(spot[2])


def room_ahead(body: ArmBody, points: Array) -> float:
    """Return how far the base can go before it comes to one of some points, metres; in its frame, shape ``(n, 3)``."""
    low, high, radius = -body.stand + 0.08, 1.2, body.radius
    in_the_way = (points[:, 2] > low) & (points[:, 2] < high) & (np.abs(points[:, 1]) < radius) & (points[:, 0] > 0.0)
    ahead = points[in_the_way]
    return float((ahead[:, 0] - np.sqrt(radius**2 - ahead[:, 1] ** 2)).min()) if len(ahead) else math.inf
