"""What stands around an arm: a grid of distances to what was seen, and to the robot's own base."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from vico.io.compiled import compiled
from vico.kinematics.limbs import Limbs

Array = NDArray[np.float64]


class Room(NamedTuple):
    """Distances around a base, in its frame.

    Attributes
    ----------
    distance
        Metres from the cells' centres to the nearest thing, at most `FAR`, float32, shape ``(nx, ny, nz)``.
    low
        Corner of the grid, metres.
    cell
        Side of a cell, metres.
    posts
        The base itself: x, y, radius and top of upright cylinders, metres, shape ``(p, 4)``.
    """

    distance: NDArray[np.float32]
    low: Array
    cell: float
    posts: Array


#: Distances are no larger; nothing is known beyond the grid, so it is free.
FAR = 1.0
#: What an arm of about a metre reaches, metres.
LOW, HIGH, CELL = np.array([-0.6, -1.1, -0.2]), np.array([1.3, 1.1, 1.6]), 0.025
# Balls of links below this one belong to the torso, which the base carries.
_FIRST_FREE = 2


def room_of(points: Array, posts: Array, *, ground: float | None = None) -> Room:
    """Make the room of points that were seen.

    Parameters
    ----------
    points
        In the base's frame, metres, shape ``(n, 3)``; what lies beyond the grid is left out.
    posts
        See `Room`.
    ground
        Height of level ground below which all is taken to be solid; None where it was seen.
    """
    shape = np.ceil((HIGH - LOW) / CELL).astype(int)
    free = np.ones(shape, bool)
    cells = np.floor((points - LOW) / CELL).astype(np.int64)
    cells = cells[((cells >= 0) & (cells < shape)).all(axis=1)]
    free[cells[:, 0], cells[:, 1], cells[:, 2]] = False
    if ground is not None:
        free[:, :, : max(int(np.floor((ground - LOW[2]) / CELL)), 0)] = False
    if free.all():
        distance = np.full(shape, FAR, np.float32)
    else:
        # A point lies anywhere in its cell.
        far = ndimage.distance_transform_edt(free, sampling=CELL) - CELL / 2
        distance = np.clip(far, 0.0, FAR).astype(np.float32)
    return Room(distance, LOW.copy(), CELL, np.asarray(posts, np.float64).reshape(-1, 4))


@compiled
def clearance(room, limbs, places, enough):  # type: ignore[no-untyped-def]
    """Return how far an arm's balls are from everything, metres; once less than enough is found, that.

    Parameters
    ----------
    places
        Of the balls, shape ``(n, 3)``.
    """
    least = 1e9
    shape = room.distance.shape
    for k in range(len(places)):
        at = np.empty(3, np.int64)
        inside = True
        for i in range(3):
            at[i] = int(np.floor((places[k, i] - room.low[i]) / room.cell))
            inside = inside and at[i] >= 0 and at[i] < shape[i]
        if inside:
            least = min(least, room.distance[at[0], at[1], at[2]] - limbs.radius[k])
        if limbs.link[k] > _FIRST_FREE:
            for p in range(len(room.posts)):
                aside = np.sqrt((places[k, 0] - room.posts[p, 0]) ** 2 + (places[k, 1] - room.posts[p, 1]) ** 2)
                aside -= room.posts[p, 2]
                above = places[k, 2] - room.posts[p, 3]
                if above > 0.0 and aside > 0.0:
                    aside = np.sqrt(aside * aside + above * above)
                else:
                    aside = max(aside, above)
                least = min(least, aside - limbs.radius[k])
        if least < enough:
            return least
    return least


def seen_nothing(posts: Array) -> Room:
    """Return a room with nothing in it but the base."""
    return room_of(np.zeros((0, 3)), posts)


def limb_gap(room: Room, limbs: Limbs, places: Array) -> float:
    """Return how far an arm's balls are from everything, metres."""
    return float(clearance(room, limbs, places, -1e9))
