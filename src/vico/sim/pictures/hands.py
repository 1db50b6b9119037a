"""Drawn objects in people's hands: carried things, umbrellas, placards, food and drink.

Umbrellas lean so that two of them never pass through each other.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vico.assets.models.library import placards, umbrellas
from vico.assets.models.movable import movable_grip
from vico.exact import each, product
from vico.geometry import rotation_matrix
from vico.sim.animation import Hands, Hold, clip_index, hand_frames
from vico.sim.bodies.arrays import Drawn
from vico.sim.bodies.state_arrays import FIRST_PEDESTRIAN_UMBRELLA, FIRST_UMBRELLA
from vico.sim.people.placement import bearable_rain, carries_umbrella
from vico.sim.state.simulation_state import SimulationState
from vico.world.model import Category

_APART = 0.04  # metres between two rims
_STEEPEST = 0.6  # radians


def lean_apart(
    canopies: NDArray[np.float64], radius: NDArray[np.float64], shaft: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return how far umbrellas lean, each about its fist: away from those that theirs would touch.

    A rim of radius r on a shaft of length h, leant by t, reaches r cos t - h sin t towards the other side; each of two
    neighbours leans so far that its rim ends short of where they share out what is between them.

    Parameters
    ----------
    canopies
        Their middles when nobody leans, ENU metres, shape ``(n, 3)``.
    radius, shaft
        Of each, metres, shape ``(n,)``.

    Returns
    -------
    NDArray[np.float64]
        Horizontal direction times angle, radians, ENU, shape ``(n, 2)``.
    """
    lean = np.zeros((len(canopies), 2))
    if len(canopies) < 2:
        return lean
    pairs = cKDTree(canopies).query_pairs(2.0 * (float(radius.max()) + _APART), output_type="ndarray")
    first, second = np.concatenate([pairs, pairs[:, ::-1]]).T
    away = canopies[first, :2] - canopies[second, :2]
    distance = np.hypot(*away.T)
    share = radius[first] / (radius[first] + radius[second])
    reach = np.hypot(radius, shaft)[first]
    may = np.clip((distance * share - _APART / 2) / reach, -1.0, 1.0)
    angle = np.maximum(each(math.acos, may) - each(math.atan2, shaft, radius)[first], 0.0)
    np.add.at(lean, first, away * (angle / np.maximum(distance, 1e-6))[:, None])
    steep = np.hypot(*lean.T)
    return lean * np.minimum(1.0, _STEEPEST / np.maximum(steep, 1e-9))[:, None]


_DRINKS = (clip_index("drink"), clip_index("sit_drink"))
_PHONE = clip_index("phone")
_EATS = (clip_index("eat"), clip_index("sit_eat"))
# Cups and glasses tip so far at the mouth, radians.
_TIP = 0.8
# Screens lean back so far from lying flat, radians.
_TILT = 0.75
# Umbrellas are made for people so tall, metres; the fist is so far below the canopy.
_MADE_FOR, _SHAFT = 1.75, 0.8
# Of their rims: how wide, and how high above the fist, metres.
_RIM_RADIUS, _RIM_HEIGHT = 0.53, 0.64
# Pedestrians have their umbrellas up when it rains so much more than they bear, mm/h.
_RAIN_MORE = 0.15


class Holders(NamedTuple):
    """Those who are drawn, one row a person; agents first, then pedestrians.

    Attributes
    ----------
    number
        Of each among all agents and, after them, all pedestrians, int64, shape ``(n,)``, ascending.
    joints, rotations, offsets
        As `vico.sim.animation.hand_frames` takes them.
    position, yaw
        Where bodies stand, ENU metres and radians, shapes ``(n, 3)`` and ``(n,)``.
    clip, phase
        Of their motions, shape ``(n,)``.
    hands
        What they hold.
    height
        Stature, metres, shape ``(n,)``.
    entity
        Shape ``(n,)``.
    """

    number: NDArray[np.int64]
    joints: NDArray[np.float32]
    rotations: NDArray[np.float32]
    offsets: NDArray[np.float32]
    position: NDArray[np.float64]
    yaw: NDArray[np.float64]
    clip: NDArray[np.int64]
    phase: NDArray[np.float64]
    hands: Hands
    height: NDArray[np.float64]
    entity: NDArray[np.int32]

    def palms(self, rows: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return where the palms of some are, body frame, metres, shape ``(k, 2, 3)``, left and right."""
        return hand_frames(self.joints[rows], self.rotations[rows], self.offsets[rows])[:, :, :3, 3]

    def world(self, rows: NDArray[np.int64], points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points of body frames, shape ``(k, 3)``, in the world's."""
        c, s = np.cos(self.yaw[rows]), np.sin(self.yaw[rows])
        x, y = c * points[:, 0] - s * points[:, 1], s * points[:, 0] + c * points[:, 1]
        return self.position[rows] + np.column_stack([x, y, points[:, 2]])

    def turned_back(self, rows: NDArray[np.int64], directions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return horizontal directions of the world, shape ``(k, 2)``, in body frames."""
        c, s = np.cos(self.yaw[rows]), np.sin(self.yaw[rows])
        x, y = directions.T
        return np.column_stack([c * x + s * y, c * y - s * x])


def hands_of_agents(state: SimulationState) -> Hands:
    """Return what agents do with their hands beside their motions."""
    p, objects = state.people, state.objects
    width = np.zeros(len(p))
    for k in np.flatnonzero(objects.hand >= 0).tolist():
        width[p.entity == objects.holder[k]] = objects.size[k, 1]
    return Hands(p.gesture_hand.astype(np.int64), p.hold.astype(np.int64), p.hold_share.copy(), width)


def hands_of_pedestrians(
    habit: NDArray[np.float64], rain: float, placard: NDArray[np.float64], afoot: NDArray[np.bool_]
) -> Hands:
    """Return what pedestrians do with their hands.

    Parameters
    ----------
    habit
        How little each minds rain, 0..1, shape ``(n,)``.
    rain
        mm/h.
    placard
        How far each has a placard up, 0..1, shape ``(n,)``; who has one leaves the umbrella closed.
    afoot
        Who is on foot, shape ``(n,)``; all others hold nothing.
    """
    share = np.clip((rain - bearable_rain(habit)) / _RAIN_MORE, 0.0, 1.0) * carries_umbrella(habit)
    hold = np.where(placard > 0.0, int(Hold.PLACARD_RIGHT), int(Hold.UMBRELLA_RIGHT))
    share = np.where(placard > 0.0, placard, share) * afoot
    # The hand that holds nothing makes gestures.
    return Hands((share <= 0.0).astype(np.int64), hold, share, np.zeros(len(habit)))


def draw_in_hands(state: SimulationState, who: Holders) -> list[Drawn]:
    """Return what is drawn in everybody's hands, and the movable objects that lie about."""
    drawn = [draw_umbrellas(who, len(state.people)), draw_placards(who), _meals(state, who), draw_phones(who)]
    if len(state.objects):
        # Movable objects are where they lie, or in the hand or the arms that hold them.
        objects = state.objects
        names = sorted(set(objects.prototypes))
        transforms = np.zeros((len(objects), 4, 4))
        transforms[:, :3, :3] = rotation_matrix(objects.orientation)
        transforms[:, 3, 3] = 1.0
        transforms[:, :3, 3] = objects.position
        for k in np.flatnonzero(objects.hand >= 0).tolist():
            row = np.flatnonzero(who.entity == objects.holder[k])[:1]
            if not len(row):
                continue  # who holds it is not drawn: far from where anybody looks
            transforms[k, :3, 3] = who.world(row, carried_at(k, int(row[0]), state, who)[None])[0]
        index = np.array([names.index(name) for name in objects.prototypes], np.int32)
        drawn.append(Drawn(names, index, transforms.astype(np.float32), objects.entity))
    return [lot for lot in drawn if lot is not None]


def draw_umbrellas(who: Holders, agents: int) -> Drawn | None:
    """Return the umbrellas that are up, None without any; the first so many of all are agents."""
    hold = who.hands.hold
    is_umbrella = (hold == int(Hold.UMBRELLA_LEFT)) | (hold == int(Hold.UMBRELLA_RIGHT))
    rows = np.flatnonzero(is_umbrella & (who.hands.share > 0.25))
    if not len(rows):
        return None
    side = np.where(hold[rows] == int(Hold.UMBRELLA_LEFT), 0, 1)
    fist = who.palms(rows)[np.arange(len(rows)), side]
    size = np.clip(who.height[rows] / _MADE_FOR, 0.65, 1.1)
    # The canopy is above the head, and opens when the arm is half up.
    above = np.column_stack([0.02 - 0.75 * fist[:, 0], -0.75 * fist[:, 1], _SHAFT * size])
    up = above / np.linalg.norm(above, axis=1)[:, None]
    opened = np.clip((who.hands.share[rows] - 0.25) / 0.75, 0.0, 1.0)
    wide = size * (0.1 + 0.9 * opened)
    rim = _RIM_HEIGHT * size
    lean = lean_apart(who.world(rows, fist + rim[:, None] * up), _RIM_RADIUS * wide, rim)
    direction = lean / np.maximum(np.linalg.norm(lean, axis=1), 1e-9)[:, None]
    up[:, :2] += each(math.tan, np.hypot(*lean.T))[:, None] * who.turned_back(rows, direction)
    up /= np.linalg.norm(up, axis=1)[:, None]
    ahead = np.column_stack([up[:, 2], np.zeros(len(rows)), -up[:, 0]])
    ahead /= np.linalg.norm(ahead, axis=1)[:, None]
    axes = np.stack([ahead * wide[:, None], np.cross(up, ahead) * wide[:, None], up * size[:, None]], axis=2)
    names = umbrellas()
    person = who.number[rows]
    entity = np.where(person < agents, FIRST_UMBRELLA + person, FIRST_PEDESTRIAN_UMBRELLA + person - agents)
    return Drawn(
        names,
        (person * 7 // 3 % len(names)).astype(np.int32),
        _transforms(who, rows, axes, fist),
        entity.astype(np.int32),
    )


def draw_placards(who: Holders) -> Drawn | None:
    """Return the placards that are held up, None without any; they face the way that their holders look."""
    rows = np.flatnonzero((who.hands.hold == int(Hold.PLACARD_RIGHT)) & (who.hands.share > 0.25))
    if not len(rows):
        return None
    fist = who.palms(rows)[:, 1]
    size = np.clip(who.height[rows] / _MADE_FOR, 0.65, 1.1) * np.clip((who.hands.share[rows] - 0.25) / 0.75, 0.05, 1.0)
    axes = np.eye(3) * size[:, None, None]
    names, entity = placards(), np.asarray(who.entity[rows], np.int32)
    look = (who.number[rows] * 5 // 2 % len(names)).astype(np.int32)
    return Drawn(names, look, _transforms(who, rows, axes, fist), entity)


def _meals(state: SimulationState, who: Holders) -> Drawn | None:
    clip = who.clip[who.number < len(state.people)]
    drinks, eats = np.isin(clip, _DRINKS), np.isin(clip, _EATS)
    rows = np.flatnonzero(drinks | eats)
    if not len(rows):
        return None
    hand = who.hands.gesture[rows]
    fist = who.palms(rows)[np.arange(len(rows)), hand]
    raised = np.sin(np.pi * who.phase[rows]) ** 2
    names, index = [], []
    axes = np.zeros((len(rows), 3, 3))
    for k, i in enumerate(rows.tolist()):
        person = int(who.number[i])
        names.append(drink_of(person, state) if drinks[i] else food_of(person, state))
        index.append(k)
        # Cups tip towards the face; food points at it.
        tip = -_TIP * float(raised[k]) if drinks[i] else 0.0
        c, s, way = np.cos(tip), np.sin(tip), 1.0 if drinks[i] else -1.0
        axes[k] = np.array([[way * c, 0.0, s], [0.0, way, 0.0], [-way * s, 0.0, c]])
    entity = np.asarray(who.entity[rows], np.int32)
    return Drawn(names, np.array(index, np.int32), _transforms(who, rows, axes, fist), entity)


def draw_phones(who: Holders) -> Drawn | None:
    """Return the phones that people look at, None without any; they come out of a pocket with the hand."""
    rows = np.flatnonzero((who.clip == _PHONE) & (np.abs(who.phase % 1.0 - 0.5) < 0.45))
    if not len(rows):
        return None
    fist = who.palms(rows)[np.arange(len(rows)), who.hands.gesture[rows]]
    c, s = np.cos(_TILT), np.sin(_TILT)
    axes = np.tile(np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]]), (len(rows), 1, 1))
    index, entity = np.zeros(len(rows), np.int32), np.asarray(who.entity[rows], np.int32)
    return Drawn(["hand_phone"], index, _transforms(who, rows, axes, fist + np.array([0.02, 0.0, 0.03])), entity)


def drink_of(i: int, state: SimulationState) -> str:
    """Return the model that a person drinks from: by the place, and outdoors from a bottle or a paper cup."""
    p = state.people
    if p.room[i] < 0:
        return "water_bottle" if p.entity[i] % 2 else "paper_cup"
    place = state.world.places[int(p.place[i])] if p.place[i] >= 0 else None
    kind = "" if place is None else place.kind
    if kind in ("pub", "bar", "nightclub", "biergarten"):
        return "beer_glass"
    if place is not None and place.category is Category.FOOD and kind != "cafe":
        return "water_glass"
    return "mug"


def food_of(i: int, state: SimulationState) -> str:
    """Return the model of what a person eats: with a fork where one sits at a restaurant's table or at home."""
    p = state.people
    place = state.world.places[int(p.place[i])] if p.room[i] >= 0 and p.place[i] >= 0 else None
    served = place is not None and (place.kind in ("restaurant", "apartments", "hotel"))
    return "fork" if served and p.seat[i] >= 0 else "sandwich"


def carried_at(k: int, i: int, state: SimulationState, who: Holders) -> NDArray[np.float64]:
    """Return where the middle of the underside of what is carried is, body frame, metres, shape ``(3,)``.

    Parameters
    ----------
    k
        Row of the object.
    i
        Row of who carries it among `who`.
    """
    objects = state.objects
    size = objects.size[k]
    grip = movable_grip(objects.prototypes[k], size)
    palms = who.palms(np.array([i]))[0]
    mine = palms[objects.hand[k]]
    at = np.array([mine[0], mine[1], mine[2] - (0.5 if grip == "hand" else 1.0) * size[2]])
    if state.people.hold[who.number[i]] == int(Hold.BEFORE_CHEST):
        between = palms.mean(axis=0) - np.array([0.0, 0.0, 0.4 * size[2]])
        at += (between - at) * who.hands.share[i]
    at[2] = max(at[2], 0.02)
    return np.asarray(at, np.float64)


def _transforms(
    who: Holders, rows: NDArray[np.int64], axes: NDArray[np.float64], points: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Return frames given in body frames, shapes ``(k, 3, 3)`` and ``(k, 3)``, in the world's, ``(k, 4, 4)``."""
    c, s = np.cos(who.yaw[rows]), np.sin(who.yaw[rows])
    turn = np.zeros((len(rows), 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = c
    turn[:, 1, 0], turn[:, 0, 1], turn[:, 2, 2] = s, -s, 1.0
    frames = np.zeros((len(rows), 4, 4))
    frames[:, :3, :3] = product(turn, axes)
    frames[:, :3, 3] = who.world(rows, points)
    frames[:, 3, 3] = 1.0
    return frames.astype(np.float32)
