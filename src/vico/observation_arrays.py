"""Observations as arrays: those of many agents at once, and which entities a picture shows.

`entity_pixels` goes over a picture once and tells how many pixels each entity has, where they are in the picture, and
where in the world.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled


@dataclass(frozen=True)
class CrowdObservations:
    """Observations of all agents as arrays: row ``i`` is that of the agent whose `index` is ``i``.

    Attributes
    ----------
    index
        Row of each agent by name.
    time
        Seconds since midnight of the first day.
    pose
        As observations have it: x, y, z and the unit vector one looks along, float64, shape ``(n, 6)``.
    posture
        0 standing, 1 sitting, 2 lying, int8, shape ``(n,)``.
    place, room
        Place one is in, by its index in ``PublicMap.places``, and a number of the room; -1 where there is none, int32,
        shape ``(n,)``.
    heard, stopped
        Whether there are messages, and whether something stopped the last motion, bool, shape ``(n,)``.
    viewer, seen, distance
        Who has which other agent in view, by rows, int64, and how far away it is, metres; shape ``(pairs,)``. Only
        residents are told.
    """

    index: Mapping[str, int]
    time: float
    pose: NDArray[np.float64]
    posture: NDArray[np.int8]
    place: NDArray[np.int32]
    room: NDArray[np.int32]
    heard: NDArray[np.bool_]
    stopped: NDArray[np.bool_]
    viewer: NDArray[np.int64]
    seen: NDArray[np.int64]
    distance: NDArray[np.float64]


_SLOTS = 1024  # of the table of entities at first, a power of 2; at most half of them are taken


class EntityPixels(NamedTuple):
    """Entities that a picture shows, ascending.

    Attributes
    ----------
    entity, pixels
        Number, and how many pixels show it, shape ``(n,)``.
    hits
        How many of these have a depth, shape ``(n,)``.
    position
        Mean of what is seen of its surface, ENU metres, shape ``(n, 3)``; meaningless without hits.
    box
        First column and row, last column and row in which it is seen, shape ``(n, 4)``.
    """

    entity: NDArray[np.int32]
    pixels: NDArray[np.int64]
    hits: NDArray[np.int64]
    position: NDArray[np.float64]
    box: NDArray[np.int32]


def entity_pixels(observation: Mapping[str, Any]) -> EntityPixels:
    """Return what the picture of an observation shows, but for what is no entity (0)."""
    segmentation = np.ascontiguousarray(observation["segmentation"], np.int32)
    depth = np.ascontiguousarray(observation["depth"], np.float32)
    intrinsics = np.ascontiguousarray(observation["intrinsics"], np.float64)
    extrinsics = np.asarray(observation["extrinsics"], np.float64)
    slots = _SLOTS
    while True:
        numbers = np.zeros(slots, np.int32)
        counts = np.zeros((slots, 2), np.int64)
        sums = np.zeros((slots, 3))
        box = np.empty((slots, 4), np.int32)
        if _tally(segmentation, depth, intrinsics, (numbers, counts, sums, box)) >= 0:
            break
        slots *= 4
    (taken,) = np.nonzero(counts[:, 0])
    taken = taken[np.argsort(numbers[taken])]
    mean = sums[taken] / np.maximum(counts[taken, 1:], 1)
    position = (mean - extrinsics[:3, 3]) @ extrinsics[:3, :3]
    return EntityPixels(numbers[taken], counts[taken, 0], counts[taken, 1], position, box[taken])


@compiled
def _tally(segmentation, depth, intrinsics, table):
    """Add every pixel to its entity's slot; -1 where there are more entities than fit."""
    numbers, counts, sums, box = table
    height, width = segmentation.shape
    last = len(numbers) - 1
    fx, fy, cx, cy = intrinsics[0, 0], intrinsics[1, 1], intrinsics[0, 2], intrinsics[1, 2]
    taken, before, slot = 0, 0, 0
    for row in range(height):
        y = (row + 0.5 - cy) / fy
        for column in range(width):
            entity = segmentation[row, column]
            if entity == 0:
                continue
            if entity != before:
                before = entity
                slot = (entity * 40503) & last
                while counts[slot, 0] > 0 and numbers[slot] != entity:
                    slot = (slot + 1) & last
                if counts[slot, 0] == 0:
                    taken += 1
                    if 2 * taken > last:
                        return -1
                    numbers[slot] = entity
                    box[slot, 0] = box[slot, 2] = column
                    box[slot, 1] = box[slot, 3] = row
            counts[slot, 0] += 1
            box[slot, 0] = min(box[slot, 0], column)
            box[slot, 2] = max(box[slot, 2], column)
            box[slot, 3] = row
            z = np.float64(depth[row, column])
            if z > 0.0:
                counts[slot, 1] += 1
                sums[slot, 0] += (column + 0.5 - cx) / fx * z
                sums[slot, 1] += y * z
                sums[slot, 2] += z
    return taken
