"""What is around an agent, as lists whose places an action can name: things, people, places to enter, doors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.pixels import shown_in
from vico.world.public import PublicMap

#: How many of each are told; of more, those that are farther away are left out.
THINGS, PEOPLE, PLACES, DOORS, HEARD = 12, 6, 8, 8, 4

PERSON_KINDS = ("resident", "assistant", "pedestrian", "person")
#: What stands in a street or makes it up is no thing that an action is about.
_SURFACES = frozenset({"ground", "road", "water", "green", "building", "room", "tree", "hedge", "shrub", "nothing"})
# Fewer pixels than this are not taken for a sighting.
_LEAST_PIXELS = 4


@dataclass(frozen=True)
class Something:
    """Something around an agent.

    Attributes
    ----------
    name
        Of a person the agent's name ("" where nobody plays it), of a place or room its id, of a thing what it is
        called.
    kind
        As pictures name it; of doors ``inside`` or ``outside``; of places ``place``.
    position
        ENU metres, shape ``(3,)``.
    entity
        0 for places and doors.
    """

    name: str
    kind: str
    position: NDArray[np.float64]
    entity: int = 0


@dataclass(frozen=True)
class Surroundings:
    """What is around an agent, nearest first.

    Attributes
    ----------
    things, people
        In view: in pictures (which need depth and segmentation), or by sight lines where an agent is told those. No
        more than `THINGS` and `PEOPLE`.
    places
        That can be entered from here: places outdoors, rooms indoors; no more than `PLACES`.
    doors
        Out of the room; no more than `DOORS`.
    """

    things: tuple[Something, ...] = ()
    people: tuple[Something, ...] = ()
    places: tuple[Something, ...] = ()
    doors: tuple[Something, ...] = ()


def surroundings_of(observation: Mapping[str, Any], info: Mapping[str, Any], public_map: PublicMap) -> Surroundings:
    """Return what is around an agent, from what it is told and the public map alone."""
    here = np.asarray(observation["pose"][:3], np.float64)
    state = observation["state"]
    doors = [
        Something(door["to"], "outside" if door["to"] == "outside" else "inside", np.asarray(door["position"], float))
        for door in state["doors"]
    ]
    behind = {door.name: door.position for door in doors}
    places = []
    for name in state["accessible_places"]:
        known = public_map.place_by_id.get(name)
        point = behind.get(name) if known is None else np.asarray(known.entrance or known.position, np.float64)
        places.append(Something(name, "place", here if point is None else point))
    seen = _seen(observation, info)
    people = [one for one in seen if one.kind in PERSON_KINDS]
    things = [one for one in seen if one.kind not in PERSON_KINDS]
    return Surroundings(
        _nearest(things, here, THINGS),
        _nearest(people, here, PEOPLE),
        _nearest(places, here, PLACES),
        _nearest(doors, here, DOORS),
    )


def _nearest(found: list[Something], here: NDArray[np.float64], most: int) -> tuple[Something, ...]:
    """Return the nearest; those as near as each other in the order of entity and name."""
    order = sorted(found, key=lambda one: (math.dist(one.position, here), one.entity, one.name))
    return tuple(order[:most])


def _seen(observation: Mapping[str, Any], info: Mapping[str, Any]) -> list[Something]:
    if "segmentation" in observation and "depth" in observation:
        return _in_pictures(observation, info.get("entities", {}))
    view = info.get("in_view", ())
    return [
        Something(body.agent or body.name, body.kind, np.asarray(body.position, np.float64), body.entity)
        for body in view
    ]


def _in_pictures(observation: Mapping[str, Any], entities: Mapping[int, Mapping[str, str]]) -> list[Something]:
    shown = shown_in(observation)
    found = []
    for k, entity in enumerate(shown.entity.tolist()):
        about = entities.get(entity, {})
        kind = about.get("kind", "")
        if not kind or kind in _SURFACES or shown.pixels[k] < _LEAST_PIXELS or not shown.hits[k]:
            continue
        name = about.get("agent", "") if kind in PERSON_KINDS else about.get("name", "")
        found.append(Something(name, kind, shown.position[k], entity))
    return found
