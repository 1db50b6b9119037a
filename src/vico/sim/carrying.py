"""Things that lie on a deck of something that moves: where there is room for one more, and going along with it.

Whatever has a deck says so by an entity number (`HasDecks`); nothing here knows what it is. A thing on a deck lies
along the deck's sides, and keeps its place in the carrier's frame until somebody takes it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.exact import apply_matrix
from vico.sim.collisions import box_gap

if TYPE_CHECKING:
    from vico.sim.state import MovableObjects

# Steps in which a deck is searched for a place, metres, and what things may stick out over its edges, share of it.
_PITCH = 0.02
_OVERHANG = 1.25


@dataclass(frozen=True)
class DeckPose:
    """A deck as it lies in the world.

    Attributes
    ----------
    position, rotation
        Origin of the carrier's frame, ENU metres, shape ``(3,)``, and that frame to world, shape ``(3, 3)``.
    centre
        Middle of the deck's surface in the carrier's frame, metres, shape ``(3,)``.
    length, width
        Extents along the carrier's x and y, metres.
    """

    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    centre: NDArray[np.float64]
    length: float
    width: float

    def world(self, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a point of the carrier's frame in the world."""
        return self.position + apply_matrix(point, self.rotation)

    def gap(self, point: NDArray[np.float64]) -> float:
        """Metres along the ground from a point of the world to the deck; 0 or less above it."""
        x, y, _ = self.world(self.centre)
        yaw = math.atan2(self.rotation[1, 0], self.rotation[0, 0])
        return float(box_gap(point[0], point[1], x, y, yaw, self.length / 2, self.width / 2))


class HasDecks(Protocol):
    """Who carries things on decks."""

    def deck(self, entity: int) -> DeckPose | None:
        """Return the deck of one of its bodies; None if that has none, or is none of its bodies."""


def free_place(deck: DeckPose, entity: int, k: int, objects: MovableObjects) -> NDArray[np.float64] | str:
    """Find a place for one more thing on a deck.

    Parameters
    ----------
    entity
        Of the carrier.
    k
        Index of the thing.

    Returns
    -------
    array or str
        Middle of the thing's underside in the carrier's frame, shape ``(3,)``; or why there is none. Places are taken
        from the back and the right, so that what comes later finds room.
    """
    half = objects.size[k, :2] / 2
    deck_half = np.array([deck.length, deck.width]) / 2
    if np.any(half > deck_half * _OVERHANG):
        return f"{objects.names[k]} is larger than the deck"
    room = np.maximum(deck_half - half, 0.0)
    lying = np.flatnonzero((objects.holder == entity) & (objects.hand < 0))
    others = objects.offset[lying, :2] - deck.centre[:2]
    apart = objects.size[lying, :2] / 2 + half
    for u in _steps(room[0]):
        for v in _steps(room[1]):
            if np.all(np.any(np.abs(others - (u, v)) >= apart - 1e-9, axis=1)):
                return deck.centre + np.array([u, v, 0.0])
    return f"no room on the deck for {objects.names[k]}; {len(lying)} things lie there"


def _steps(room: float) -> Iterable[float]:
    """Places along one side, from one end to the other, both ends among them."""
    count = max(1, math.ceil(2 * room / _PITCH) + 1)
    return np.linspace(-room, room, count).tolist() if count > 1 else (0.0,)


def lay_down(deck: DeckPose, entity: int, k: int, place: NDArray[np.float64], objects: MovableObjects) -> None:
    """Lay a thing on a deck, along its sides."""
    objects.hand[k] = -1
    objects.holder[k] = entity
    objects.offset[k] = place
    objects.room[k] = -1
    _move(deck, k, objects)


def carry_along(objects: MovableObjects, carriers: Iterable[HasDecks]) -> None:
    """Move what lies on decks to where those are now, turned and tilted as they are."""
    owners = list(carriers)
    decks: dict[int, DeckPose | None] = {}
    for k in np.flatnonzero((objects.holder != 0) & (objects.hand < 0)):
        entity = int(objects.holder[k])
        if entity not in decks:
            found = (owner.deck(entity) for owner in owners)
            decks[entity] = next((deck for deck in found if deck is not None), None)
        deck = decks[entity]
        if deck is not None:
            _move(deck, int(k), objects)


def _move(deck: DeckPose, k: int, objects: MovableObjects) -> None:
    objects.position[k] = deck.world(objects.offset[k])
    objects.set_rotation(k, deck.rotation)
