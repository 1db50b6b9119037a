"""What was seen, where and when; which rooms were looked at; and what is no longer where it was."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.navigation.voxels import MOVING
from vico.agents.perception import Sighting
from vico.agents.state import AgentState
from vico.exact import apply_matrix

#: With so many pixels, and after so many seconds for what moves, confidence has come to, or fallen to, 63 % and 37 %.
SURE_PIXELS, STALE_AFTER = 20.0, 60.0
#: Directions that a look around in a room is counted in, and how far a picture reaches to either side, radians.
DIRECTIONS, _SIDE = 8, math.radians(45.001)
#: Most things that are remembered; what was seen longest ago is forgotten first.
MOST = 512
# Seen within so many metres of where it was, it lies there still.
_SAME_PLACE = 0.5
_BEHIND = 0.35  # metres behind a thing's place that is seen: the thing is gone
_NEVER_GONE = 0.4  # metres before the camera within which nothing is missed


@dataclass(frozen=True)
class SeenThing:
    """Something that was seen.

    Attributes
    ----------
    position
        Where, ENU metres, shape ``(3,)``.
    room
        Id of the room one was in; empty outdoors.
    time
        Second of the day at which it was last seen.
    pixels
        How many showed it, at most, while it lay there.
    """

    entity: int
    kind: str
    name: str
    position: NDArray[np.float64]
    room: str
    time: float
    pixels: int

    def confidence(self, now: float) -> float:
        """How sure one may be, 0 to 1, that it is such a thing and there: by pixels, and by time for what moves."""
        sure = 1.0 - math.exp(-self.pixels / SURE_PIXELS)
        return sure * math.exp(-(now - self.time) / STALE_AFTER) if self.kind in MOVING else sure


class SeenMemory:
    """Remembers things with names, until they are seen to be gone, and from which rooms' corners one looked."""

    def __init__(self) -> None:
        self._rooms: dict[str, dict[int, SeenThing]] = {}
        # In which room each thing is known, the one that was seen longest ago first.
        self._room_of: dict[int, str] = {}
        self._looks: dict[str, int] = {}

    def notice(self, observation: Mapping[str, Any], things: Iterable[Sighting]) -> list[SeenThing]:
        """Take in a picture; return what is not where it was seen before, which is forgotten.

        Parameters
        ----------
        observation
            With pictures.
        things
            What they show, as `vico.agents.perception.sightings` found it.
        """
        state = observation["state"]
        room, now = str(state["room"] or ""), float(state["time"])
        if room:
            self._looks[room] = self._looks.get(room, 0) | _directions(np.asarray(observation["pose"], np.float64))
        for thing in things:
            before = self._taken(thing.entity)
            pixels = thing.pixels
            if before is not None and math.dist(before.position, thing.position) < _SAME_PLACE:
                pixels = max(pixels, before.pixels)
            self._put(SeenThing(thing.entity, thing.kind, thing.name, thing.position, room, now, pixels))
        hidden = [thing for thing in self._rooms.get(room, {}).values() if thing.time != now]
        missing = [thing for thing, gone in zip(hidden, _are_gone(hidden, observation), strict=True) if gone]
        missing += [seen for entity in state["held"] if entity and (seen := self._thing(int(entity))) is not None]
        for gone in missing:
            self.forget(gone.entity)
        while len(self._room_of) > MOST:
            self.forget(next(iter(self._room_of)))
        return missing

    def _thing(self, entity: int) -> SeenThing | None:
        return self._rooms[self._room_of[entity]].get(entity) if entity in self._room_of else None

    def _taken(self, entity: int) -> SeenThing | None:
        room = self._room_of.pop(entity, None)
        return None if room is None else self._rooms[room].pop(entity)

    def _put(self, thing: SeenThing) -> None:
        self._rooms.setdefault(thing.room, {})[thing.entity] = thing
        self._room_of[thing.entity] = thing.room

    def last_seen(self, name: str) -> SeenThing | None:
        """Return where something was seen last, by its name; None if it was not, or is gone."""
        found = [thing for thing in self._all() if thing.name == name]
        return max(found, key=lambda thing: (thing.time, thing.pixels, -thing.entity), default=None)

    def things(self, *, kind: str | None = None, room: str | None = None) -> list[SeenThing]:
        """Return what is remembered, the latest first; of one kind, or in one room (empty: outdoors)."""
        within = self._all() if room is None else self._rooms.get(room, {}).values()
        found = [thing for thing in within if kind is None or thing.kind == kind]
        return sorted(found, key=lambda thing: (-thing.time, thing.entity))

    def _all(self) -> list[SeenThing]:
        return [self._rooms[room][entity] for entity, room in self._room_of.items()]

    def looked_at(self, room: str) -> float:
        """Return the share of the directions that one looked in from within a room, 0 to 1."""
        return self._looks.get(room, 0).bit_count() / DIRECTIONS

    def forget(self, entity: int) -> None:
        """Forget a thing: it was picked up, say."""
        self._taken(entity)

    def state(self) -> AgentState:
        """Return all of it."""
        things = self._all()
        return {
            "entity": [thing.entity for thing in things],
            "kind": [thing.kind for thing in things],
            "name": [thing.name for thing in things],
            "room": [thing.room for thing in things],
            "position": np.array([thing.position for thing in things], np.float64).reshape(-1, 3),
            "time": [thing.time for thing in things],
            "pixels": [thing.pixels for thing in things],
            "looks": dict(self._looks),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Remember what `state` returned."""
        rows = zip(
            *(state[name] for name in ("entity", "kind", "name", "position", "room", "time", "pixels")), strict=True
        )
        things = [SeenThing(*row) for row in rows]
        self._rooms, self._room_of = {}, {}
        for thing in things:
            self._put(replace(thing, entity=int(thing.entity), position=np.array(thing.position, np.float64)))
        self._looks = {str(room): int(looks) for room, looks in state["looks"].items()}


def _directions(pose: NDArray[np.float64]) -> int:
    """Return the directions that a picture takes in, a bit each."""
    yaw = math.atan2(pose[4], pose[3])
    bits = 0
    for k in range(DIRECTIONS):
        away = (2 * math.pi * k / DIRECTIONS - yaw + math.pi) % (2 * math.pi) - math.pi
        bits |= (abs(away) <= _SIDE) << k
    return bits


def _are_gone(things: Sequence[SeenThing], observation: Mapping[str, Any]) -> NDArray[np.bool_]:
    """Tell of which things a picture shows what lies behind their places."""
    if not things:
        return np.zeros(0, np.bool_)
    extrinsics, intrinsics = observation["extrinsics"], observation["intrinsics"]
    depth = np.asarray(observation["depth"])
    places = np.array([thing.position for thing in things])
    x, y, z = apply_matrix(places, extrinsics[:3, :3]).T + extrinsics[:3, 3:]
    ahead = z >= _NEVER_GONE
    z = np.where(ahead, z, 1.0)
    column, row = intrinsics[0, 0] * x / z + intrinsics[0, 2], intrinsics[1, 1] * y / z + intrinsics[1, 2]
    inside = (column >= 1) & (column < depth.shape[1] - 1) & (row >= 1) & (row < depth.shape[0] - 1)
    column, row = (np.where(inside, k, 1).astype(np.int64) for k in (column, row))
    gone = ahead & inside
    # A little more than the pixel itself: what is small may lie beside it.
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            seen = depth[row + dy, column + dx]
            gone &= (seen == 0.0) | (seen > z + _BEHIND)
    return gone
