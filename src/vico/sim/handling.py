"""Picking up, putting down, handing over."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.sim.collisions import box_gap
from vico.sim.moves import follow_hands, gesture
from vico.sim.stage import Stage
from vico.sim.state import REACH, REACH_UP
from vico.world.model import Container

_AHEAD = (0.55, 0.45, 0.7, 0.9)
# Containers are searched for a free spot at this pitch, metres.
_PITCH = 0.1


@dataclass(frozen=True)
class Spot:
    """Where a thing comes to lie, and the entity that carries it there (0: the ground, floor or furniture)."""

    point: NDArray[np.float64]
    carrier: int = 0


def pick(values: Mapping[str, Any], i: int, stage: Stage) -> None:
    """Take a thing into a hand."""
    p, goods = stage.people, stage.goods
    k = goods.index(values["object"])
    _hold(k, i, values["hand"], stage)
    gesture("pick", i, stage)
    stage.events.add("pick", p.names[i], f"picks up {goods.names[k]}", p.position[i], object=int(goods.entity[k]))


def put(values: Mapping[str, Any], i: int, stage: Stage) -> None:
    """Put down what a hand holds."""
    p, goods = stage.people, stage.goods
    spot = put_down(values.get("target"), i, values["hand"], stage)
    assert isinstance(spot, Spot)
    k = goods.index(int(p.held[i, values["hand"]]))
    p.held[i, values["hand"]] = 0
    goods.hand[k] = -1
    goods.holder[k] = spot.carrier
    goods.position[k] = spot.point
    goods.room[k] = p.room[i]
    gesture("put", i, stage)
    stage.events.add("put", p.names[i], f"puts down {goods.names[k]}", goods.position[k], object=int(goods.entity[k]))


def hand_over(values: Mapping[str, Any], i: int, stage: Stage) -> None:
    """Give what a hand holds to somebody's free hand, the left one first."""
    p, goods = stage.people, stage.goods
    j = p.names.index(values["agent"])
    k = goods.index(int(p.held[i, values["hand"]]))
    p.held[i, values["hand"]] = 0
    _hold(k, j, 0 if not p.held[j, 0] else 1, stage)
    gesture("reach", i, stage)
    stage.events.add(
        "hand_over",
        p.names[i],
        f"hands {goods.names[k]} to {p.names[j]}",
        p.position[i],
        object=int(goods.entity[k]),
        to=p.names[j],
    )


def _hold(k: int, i: int, hand: int, stage: Stage) -> None:
    p, goods = stage.people, stage.goods
    p.held[i, hand] = goods.entity[k]
    goods.holder[k] = p.entity[i]
    goods.hand[k] = hand
    follow_hands(stage)


def put_down(target: Any, i: int, hand: int, stage: Stage) -> Spot | str:
    """Find where a thing would come to lie.

    Parameters
    ----------
    target
        Entity of a container or of a robot with a deck, a point, or None for the ground ahead.

    Returns
    -------
    Spot or str
        The spot, or why there is none.
    """
    p = stage.people
    k = stage.goods.index(int(p.held[i, hand]))
    size = stage.goods.size[k]
    if target is None:
        return _ahead(i, size, stage)
    if isinstance(target, tuple):
        return _at_point(target, i, stage)
    room = int(p.room[i])
    if room >= 0:
        for container in stage.indoor.rooms[room].containers:
            if container.entity == target:
                return _on(container, i, k, stage)
    if stage.robots is not None:
        deck = stage.robots.deck(target)
        if deck is not None:
            return _on_deck(target, deck, i, stage)
    return f"put: {target} is nothing here that a thing can be put on"


def _ahead(i: int, size: NDArray[np.float64], stage: Stage) -> Spot | str:
    p = stage.people
    c, s = math.cos(p.yaw[i]), math.sin(p.yaw[i])
    for ahead in _AHEAD:
        x, y = p.position[i, 0] + ahead * c, p.position[i, 1] + ahead * s
        if p.room[i] < 0:
            if stage.world.walkable.class_at((x, y)) > 0:
                return Spot(np.array([x, y, float(stage.world.height((x, y)))]))
        elif stage.indoor.gap(int(p.room[i]), (x, y)) >= min(size[0], size[1]) / 2:
            return Spot(np.array([x, y, stage.indoor.floor_at(int(p.room[i]), (x, y))]))
    return "put: no free ground ahead; turn, or name a target"


def _at_point(point: tuple[float, ...], i: int, stage: Stage) -> Spot | str:
    p = stage.people
    x, y, z = point
    away = math.hypot(x - p.position[i, 0], y - p.position[i, 1])
    if away > REACH:
        return f"put: the point is {away:.1f} m away; reach is {REACH} m"
    room = int(p.room[i])
    if room >= 0:
        if not stage.indoor.holds(room, (x, y, stage.indoor.floor_at(room, (x, y)))):
            return "put: the point is outside this room"
        height = stage.indoor.support(room, (x, y))
    else:
        if stage.world.walkable.class_at((x, y)) == 0:
            return "put: something solid is at that point"
        height = float(stage.world.height((x, y)))
    if not height - 0.5 <= z <= height + REACH_UP:
        return f"put: the point is not above the surface there ({height:.2f} m)"
    return Spot(np.array([x, y, height]))


def _on(container: Container, i: int, k: int, stage: Stage) -> Spot | str:
    """Free spot of a container's top nearest to the person, apart from what lies there already."""
    p, goods = stage.people, stage.goods
    x, y, z = container.centre
    half = np.array(container.size) / 2
    person = p.position[i]
    gap = box_gap(person[0], person[1], x, y, container.yaw, half[0], half[1])
    if gap > REACH:
        return f"put: the {container.kind} is {gap:.1f} m away; reach is {REACH} m"
    if z - person[2] > REACH_UP:
        return f"put: the {container.kind} is too high"
    margin = np.minimum(half * 0.9, np.hypot(goods.size[k, 0], goods.size[k, 1]) / 2)
    u = np.linspace(-half[0] + margin[0], half[0] - margin[0], max(1, int(2 * (half[0] - margin[0]) / _PITCH) + 1))
    v = np.linspace(-half[1] + margin[1], half[1] - margin[1], max(1, int(2 * (half[1] - margin[1]) / _PITCH) + 1))
    grid = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    c, s = math.cos(container.yaw), math.sin(container.yaw)
    spots = np.column_stack([x + c * grid[:, 0] - s * grid[:, 1], y + s * grid[:, 0] + c * grid[:, 1]])
    away = np.hypot(*(spots - person[:2]).T)
    lying = (goods.hand < 0) & (goods.room == p.room[i])
    lying &= np.abs(goods.position[:, 2] - z) < 0.3
    radius = np.hypot(goods.size[:, 0], goods.size[:, 1]) / 2
    for index in np.argsort(away, kind="stable"):
        if away[index] > REACH:
            break
        clear = np.hypot(*(goods.position[lying, :2] - spots[index]).T) >= radius[lying] + radius[k]
        on_floor_below = container.kind == "floor" and stage.indoor.gap(int(p.room[i]), spots[index]) < radius[k]
        if clear.all() and not on_floor_below:
            return Spot(np.array([*spots[index], z]))
    return f"put: no free spot on the {container.kind} within reach"


def _on_deck(entity: int, deck: NDArray[np.float64], i: int, stage: Stage) -> Spot | str:
    away = math.hypot(deck[0] - stage.people.position[i, 0], deck[1] - stage.people.position[i, 1])
    if stage.people.room[i] >= 0 or away > REACH:
        return f"put: the deck is {away:.1f} m away; reach is {REACH} m"
    return Spot(np.asarray(deck, np.float64)[:3].copy(), carrier=int(entity))
