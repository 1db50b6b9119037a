"""The array form of observations: which arrays there are, what their numbers mean, and how they are filled in.

What is around an agent is listed by kind: things, people, places to enter, doors; actions name a place in these
lists. Free distances are found along rays over the public map.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from vico.envs.spaces import picture_space
from vico.exact import each
from vico.io.compiled import compiled
from vico.observation_arrays import entity_pixels
from vico.rules import ActionStatus
from vico.sim.cameras import Lens
from vico.sim.robots import Reading
from vico.world.public import PublicMap
from vico.world.walkable import WalkableMap

#: How many of each are told; of more, those that are farther away are left out.
THINGS, PEOPLE, PLACES, DOORS, HEARD = 12, 6, 8, 8, 4

PERSON_KINDS = ("resident", "assistant", "pedestrian", "person")
#: What stands in a street or makes it up is no thing that an action is about.
_SURFACES = frozenset({"ground", "road", "water", "green", "building", "room", "tree", "hedge", "shrub", "nothing"})
# Fewer pixels than this are not taken for a sighting.
_LEAST_PIXELS = 4


@dataclass(frozen=True)
class NearbyEntity:
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
    """Surroundings of an agent, nearest first.

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

    things: tuple[NearbyEntity, ...] = ()
    people: tuple[NearbyEntity, ...] = ()
    places: tuple[NearbyEntity, ...] = ()
    doors: tuple[NearbyEntity, ...] = ()


def surroundings_of(observation: Mapping[str, Any], info: Mapping[str, Any], public_map: PublicMap) -> Surroundings:
    """Return what is around an agent, from what it is told and the public map alone."""
    here = np.asarray(observation["pose"][:3], np.float64)
    state = observation["state"]
    doors = [
        NearbyEntity(
            door["to"], "outside" if door["to"] == "outside" else "inside", np.asarray(door["position"], float)
        )
        for door in state["doors"]
    ]
    behind = {door.name: door.position for door in doors}
    places = []
    for name in state["accessible_places"]:
        known = public_map.place_by_id.get(name)
        point = behind.get(name) if known is None else np.asarray(known.entrance or known.position, np.float64)
        places.append(NearbyEntity(name, "place", here if point is None else point))
    if "segmentation" in observation and "depth" in observation:
        seen = _entities_in_pictures(observation, info.get("entities", {}))
    else:
        view = info.get("in_view", ())
        seen = [
            NearbyEntity(body.agent or body.name, body.kind, np.asarray(body.position, np.float64), body.entity)
            for body in view
        ]
    people = [one for one in seen if one.kind in PERSON_KINDS]
    things = [one for one in seen if one.kind not in PERSON_KINDS]
    return Surroundings(
        _nearest(things, here, THINGS),
        _nearest(people, here, PEOPLE),
        _nearest(places, here, PLACES),
        _nearest(doors, here, DOORS),
    )


def _nearest(found: list[NearbyEntity], here: NDArray[np.float64], most: int) -> tuple[NearbyEntity, ...]:
    """Return the nearest; those as near as each other in the order of entity and name."""
    order = sorted(found, key=lambda one: (math.dist(one.position, here), one.entity, one.name))
    return tuple(order[:most])


def _entities_in_pictures(
    observation: Mapping[str, Any], entities: Mapping[int, Mapping[str, str]]
) -> list[NearbyEntity]:
    shown = entity_pixels(observation)
    found = []
    for k, entity in enumerate(shown.entity.tolist()):
        about = entities.get(entity, {})
        kind = about.get("kind", "")
        if not kind or kind in _SURFACES or shown.pixels[k] < _LEAST_PIXELS or not shown.hits[k]:
            continue
        name = about.get("agent", "") if kind in PERSON_KINDS else about.get("name", "")
        found.append(NearbyEntity(name, kind, shown.position[k], entity))
    return found


#: Rays around an agent, the first one ahead, counter-clockwise; how far they reach, metres.
RAYS, FAR = 16, 20.0
_LEAST_STEP = 0.25


def free_distances(walkable: WalkableMap, x: float, y: float, heading: float) -> NDArray[np.float64]:
    """Return how far it is to what stands in the way along each ray, metres, up to `FAR`, shape ``(RAYS,)``.

    Parameters
    ----------
    x, y
        ENU metres.
    heading
        Radians.
    """
    out = np.empty(RAYS)
    _march_rays(walkable.clearance, float(walkable.half), float(walkable.cell), (x, y, heading), out)
    return out


@compiled
def _march_rays(clearance, half, cell, stance, out):
    x, y, heading = stance
    n = clearance.shape[0]
    for k in range(len(out)):
        angle = heading + 2.0 * math.pi * k / len(out)
        east, north, away = math.cos(angle), math.sin(angle), 0.0
        while away < FAR:
            ix = math.floor((x + away * east + half) / cell)
            iy = math.floor((y + away * north + half) / cell)
            room = clearance[iy, ix] if 0 <= ix < n and 0 <= iy < n else 0.0
            if room <= 0.0:
                break
            # Clearance is that of the cell's centre: half a cell less is free at every point of it.
            away += max(_LEAST_STEP, room - cell)
        out[k] = min(away, FAR)


Array = NDArray[Any]

#: Bytes of a message that are told.
TEXT_BYTES = 128
#: Every number of the arrays below lies within these; what is beyond is cut off there.
LOW, HIGH = -10.0, 10.0

_POSTURES = ("standing", "sitting", "lying")
_VEHICLES = ("", "bike")  # whatever else one rides is a bus, a tram or a train
_STATUSES = tuple(status.name.lower() for status in ActionStatus)
#: Kinds of things that are told apart, by the kinds that pictures name.
CLASSES = ("object", "robot", "vehicle", "other")
_VEHICLE_KINDS = frozenset({"car", "truck", "van", "taxi", "bus", "tram", "train", "bicycle", "bike"})
#: Numbers of a direction: whether there is something, cosine and sine of where it is from ahead (left is positive),
#: ``log(1 + metres) / 6``, and metres above the agent's feet / 10.
DIRECTION = 5

#: Numbers of ``self``, in order.
SELF = (
    *_POSTURES,
    "on_foot",
    "on_bicycle",
    "in_bus",
    "indoors",
    "left_hand_full",
    "right_hand_full",
    "cash_by_100",
    *_STATUSES,
)

#: What people are told, by name: shape, and what it is.
PARTS: dict[str, tuple[tuple[int, ...], str]] = {
    "pose": ((6,), "x and y by half the side of the world, z / 100 m; the unit vector one looks along"),
    "clock": ((2,), "cosine and sine of the time of day"),
    "self": ((len(SELF),), ", ".join(SELF)),
    "free": ((RAYS,), "log(1 + metres) / 3 to what stands in the way on the public map, counter-clockwise from ahead"),
    "things": ((THINGS, DIRECTION + len(CLASSES)), f"things in view: direction; {', '.join(CLASSES)}"),
    "people": ((PEOPLE, DIRECTION), "people in view: direction"),
    "places": ((PLACES, DIRECTION), "places and rooms that can be entered from here: direction"),
    "doors": ((DOORS, DIRECTION + 1), "ways out of the room: direction; whether it leads outside"),
    "heard": ((HEARD, DIRECTION), "what was said since the last observation, the latest first: direction of who spoke"),
}


def arrays_markdown() -> str:
    """Return the table of all arrays for the documentation: name, shape, what they tell."""
    return "\n".join(
        f"| `{name}` | {' x '.join(map(str, shape))} | {meaning} |" for name, (shape, meaning) in PARTS.items()
    )


def observation_parts(
    lens: Lens | None, readings: Mapping[str, Reading] | None, *, outputs: Sequence[str], texts: bool = False
) -> dict[str, spaces.Box[Any]]:
    """Return the spaces of an agent's arrays by name: float32, but for texts and pictures.

    Parameters
    ----------
    lens, readings, outputs
        As `vico.envs.spaces.observation_space` takes them.
    texts
        Whether ``heard_text`` is among them: what was said, UTF-8, a row each, cut off at a whole character.
    """
    parts: dict[str, spaces.Box[Any]] = {
        name: spaces.Box(LOW, HIGH, shape, np.float32) for name, (shape, _) in PARTS.items()
    }
    if texts:
        parts["heard_text"] = spaces.Box(0, 255, (HEARD, TEXT_BYTES), np.uint8)
    for name, reading in (readings or {}).items():
        # As one row of numbers: readings may be single ones.
        size = int(np.prod(reading.shape, dtype=int))
        parts[f"sensors.{name}"] = spaces.Box(-np.inf, np.inf, (size,), np.float32)
    if lens is not None:
        parts |= {name: picture_space(name, lens) for name in outputs}
        parts["extrinsics"] = spaces.Box(-np.inf, np.inf, (4, 4), np.float32)
        parts["intrinsics"] = spaces.Box(-np.inf, np.inf, (3, 3), np.float32)
    return parts


def observation_arrays(
    observation: Mapping[str, Any], around: Surroundings, public_map: PublicMap, *, parts: Mapping[str, spaces.Box[Any]]
) -> dict[str, Array]:
    """Return an observation as arrays; see `PARTS`. Rows that nothing is told of are zeros."""
    pose = np.asarray(observation["pose"], np.float64)
    ahead = pose[3:]
    heading = math.atan2(ahead[1], ahead[0])
    state = observation["state"]
    inside = bool(state["room"])
    free = (
        np.zeros(RAYS)
        if inside
        else each(math.log1p, free_distances(public_map.walkable, pose[0], pose[1], heading)) / 3.0
    )
    heard = sorted(observation["events"], key=lambda said: -said["time"])[:HEARD]
    speakers = [NearbyEntity(said["speaker"], "", np.asarray(said["position"], np.float64)) for said in heard]
    angle = 2.0 * math.pi * state["time"] / 86_400.0
    found: dict[str, Array] = {
        "pose": np.concatenate([pose[:2] / public_map.half, pose[2:3] / 100.0, pose[3:]]),
        "clock": np.array([math.cos(angle), math.sin(angle)]),
        "self": _self(state),
        "free": free,
        "things": _rows(around.things, pose, heading, THINGS, _classes),
        "people": _rows(around.people, pose, heading, PEOPLE),
        "places": _rows(around.places, pose, heading, PLACES),
        "doors": _rows(around.doors, pose, heading, DOORS, lambda door: [float(door.kind == "outside")]),
        "heard": _rows(speakers, pose, heading, HEARD),
    }
    arrays: dict[str, Array] = {name: np.clip(values, LOW, HIGH).astype(np.float32) for name, values in found.items()}
    if "heard_text" in parts:
        arrays["heard_text"] = _texts([said["text"] for said in heard])
    for name, space in parts.items():
        if name.startswith("sensors."):
            value = observation["sensors"][name.removeprefix("sensors.")]
            arrays[name] = np.asarray(value, np.float32).reshape(space.shape)
        elif name not in arrays:
            arrays[name] = np.asarray(observation[name], space.dtype)
    return {name: arrays[name] for name in parts}


def direction(position: Any, pose: NDArray[np.float64], heading: float) -> list[float]:
    """Return the five numbers of a direction; see `DIRECTION`.

    Parameters
    ----------
    position
        Of what is told of, ENU metres, shape ``(2,)`` or ``(3,)``.
    heading
        Of the agent, radians.
    """
    east, north = float(position[0]) - pose[0], float(position[1]) - pose[1]
    above = float(position[2]) - pose[2] if len(position) > 2 else 0.0
    angle = math.atan2(north, east) - heading
    return [1.0, math.cos(angle), math.sin(angle), math.log1p(math.hypot(east, north)) / 6.0, above / 10.0]


def _self(state: Mapping[str, Any]) -> NDArray[np.float64]:
    vehicle = state["vehicle"]
    return np.array(
        [
            *(state["posture"] == posture for posture in _POSTURES),
            vehicle == "",
            vehicle == "bike",
            vehicle not in _VEHICLES,
            bool(state["room"]),
            *(bool(held) for held in state["held"]),
            state["cash"] / 100.0,
            *(state["action_status"] == status for status in _STATUSES),
        ],
        np.float64,
    )


def _classes(thing: NearbyEntity) -> list[float]:
    kind = "vehicle" if thing.kind in _VEHICLE_KINDS else thing.kind if thing.kind in CLASSES else "other"
    return [float(kind == one) for one in CLASSES]


def _rows(
    found: Sequence[NearbyEntity], pose: NDArray[np.float64], heading: float, most: int, more: Any = None
) -> NDArray[np.float64]:
    """Return a row for each, and rows of zeros up to their number."""
    width = DIRECTION + (0 if more is None else len(more(NearbyEntity("", "", np.zeros(3)))))
    rows = np.zeros((most, width))
    for k, one in enumerate(found[:most]):
        rows[k] = direction(one.position, pose, heading) + ([] if more is None else more(one))
    return rows


def _texts(texts: Sequence[str]) -> NDArray[np.uint8]:
    """Return texts as UTF-8, a row each, cut off at a whole character and filled up with zeros."""
    rows = np.zeros((HEARD, TEXT_BYTES), np.uint8)
    for k, text in enumerate(texts):
        told = text.encode("utf-8", "replace")[:TEXT_BYTES].decode("utf-8", "ignore").encode()
        rows[k, : len(told)] = np.frombuffer(told, np.uint8)
    return rows
