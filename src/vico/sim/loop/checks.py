"""Checks and reports of a run: overlaps and jams.

`OverlapCheck` looks at every pair of bodies, exactly, after every sub-step. Counted is what `docs/bodies.md` rules out:
two bodies of one space deeper in each other than `TOLERANCE`; a person inside a wall, furniture or another solid; two
passengers in one seat. `run_reports` says beside it who got stuck and who was taken out of a jam.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vico.clock import DAY, clock_of
from vico.io.compiled import compiled
from vico.rules import TRAM_SECTIONS
from vico.sim.bodies.arrays import OBJECT, Bodies
from vico.sim.bodies.collisions import WALL, SolidMap, gap_to, map_gap, room_gap
from vico.sim.bodies.footprints import BODY, IN_BUS, OUTDOORS, body_gap, can_touch, neighbour_grid, records_of, search
from vico.sim.bodies.state_arrays import FIRST_TRAM, FIRST_UMBRELLA, RADIUS
from vico.sim.traffic.jams import Jam
from vico.world.heights import HeightField

if TYPE_CHECKING:
    from vico.sim.state.simulation_state import SimulationState
#: Deeper than this two bodies overlap, metres.
TOLERANCE = 1e-3
#: Overlaps that are told one by one; the rest is counted.
REPORTED = 20
#: What a person can be inside of, beside bodies: entities are positive.
FURNITURE = -2
_CELL = 4.0  # of the grid, metres
_SEAT = 0.05  # passengers of one bus who are nearer to each other than this sit in one seat, metres
_SPACING = 0.2  # along a cyclist's line the map is asked at points this far apart, metres


@dataclass(frozen=True)
class Overlap:
    """Two that are in one place.

    Attributes
    ----------
    entity
        Whose body.
    other
        The other's entity; `vico.sim.bodies.collisions.WALL` for a wall, building or the map's edge, or `FURNITURE`.
    depth
        How deep they are in each other, metres.
    position
        Centre of the first one, ENU metres.
    space
        Room they are in, ``-1`` outdoors, ``-2`` in a bus.
    """

    entity: int
    other: int
    depth: float
    position: tuple[float, float, float]
    space: int


class OverlapCheck:
    """Counts the overlaps of a run.

    Parameters
    ----------
    state
        Of the simulation that is watched.

    Attributes
    ----------
    looks
        Sub-steps looked at.
    count
        Overlaps found, each once a sub-step that it lasts.
    """

    def __init__(self, state: SimulationState) -> None:
        self._state = state
        self.looks = self.count = 0
        self._worst = 0.0
        self._pairs: dict[tuple[int, int], dict[str, Any]] = {}

    def look(self) -> None:
        """Count the overlaps there are now."""
        self.looks += 1
        for one in overlaps_of(self._state):
            self.count += 1
            self._worst = max(self._worst, one.depth)
            pair = min(one.entity, one.other), max(one.entity, one.other)
            if pair in self._pairs:
                record = self._pairs[pair]
                record["sub_steps"] += 1
                record["depth"] = max(record["depth"], round(one.depth, 4))
            else:
                self._pairs[pair] = self._record(one)

    def record(self) -> dict[str, Any]:
        """Return counts and the first overlaps: who with whom, where, when first, for how long, how deep (metres)."""
        told = list(self._pairs.values())[:REPORTED]
        return {
            "sub_steps": self.looks,
            "count": self.count,
            "pairs": len(self._pairs),
            "deepest": round(self._worst, 4),
            "first": told,
        }

    def state(self) -> dict[str, Any]:
        """Return all that was counted, as plain data; `restore` goes on from there."""
        pairs = [{"pair": list(pair), **record} for pair, record in self._pairs.items()]
        return {"looks": self.looks, "count": self.count, "worst": self._worst, "pairs": pairs}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on counting where `state` was asked for."""
        self.looks, self.count, self._worst = state["looks"], state["count"], state["worst"]
        self._pairs = {
            (record["pair"][0], record["pair"][1]): {name: value for name, value in record.items() if name != "pair"}
            for record in state["pairs"]
        }

    def _record(self, one: Overlap) -> dict[str, Any]:
        state = self._state
        solids = {WALL: "something solid", FURNITURE: "furniture"}
        return {
            "who": state.entity(one.entity)["name"],
            "with": solids.get(one.other) or state.entity(one.other)["name"],
            "kinds": [state.entity(one.entity)["kind"], state.entity(one.other)["kind"] if one.other > 0 else "solid"],
            "where": [round(value, 2) for value in one.position],
            "room": state.indoor.rooms[one.space].id if one.space >= 0 else "",
            "look": self.looks,
            "sub_steps": 1,
            "depth": round(one.depth, 4),
        }


def overlaps_of(state: SimulationState) -> list[Overlap]:
    """Return all overlaps of a state, in a fixed order."""
    people, objects = state.people, state.objects
    others = Bodies.joined(
        [owner.bodies() for owner in state.owners() if owner is not state.avatars and owner is not state.robots]
    )
    robots = np.zeros(0, BODY)
    if state.robots is not None:
        others = Bodies.joined([others, state.robots.outdoor_bodies()])
        inside = np.flatnonzero(state.robots.rooms >= 0)
        robots = records_of(state.robots.bodies().where(inside), state.robots.rooms[inside])
    lying = objects.in_rooms()
    everybody = people.bodies_of(np.arange(len(people)))
    avatars = records_of(everybody, state.avatars.space())
    avatars = avatars[avatars["space"] < len(state.indoor.rooms)]  # the rest is nowhere yet
    records = np.concatenate(
        [
            avatars,
            _on_slopes(others, state.world.height),
            robots,
            records_of(objects.bodies_of(lying), objects.room[lying]),
        ]
    )
    # Who sits or lies is in furniture, and shoulder to shoulder with others; each place has one person by rule.
    seated = set(people.entity[people.seat >= 0].tolist())
    found = [(records[i], int(records[j]["entity"]), depth) for i, j, depth in pairs(records, TOLERANCE)]
    found = [it for it in found if int(it[0]["entity"]) not in seated or it[1] not in seated]
    avatars = avatars[~np.isin(avatars["entity"], people.entity[people.seat >= 0])]
    found = [row for row in found if not _are_coupled(int(row[0]["entity"]), row[1])]
    # Who walks through an open door is in the wall's opening.
    avatars = avatars[~np.isin(avatars["entity"], people.entity[people.passing != 0])]
    inside = persons_in_solids(avatars, state.avatars.solids, TOLERANCE)
    found += [(avatars[i], FURNITURE if furniture else WALL, depth) for i, furniture, depth in inside]
    found += _in_one_seat(avatars[avatars["space"] == IN_BUS], state)
    return [_overlap(one, other, float(depth)) for one, other, depth in found]


def _are_coupled(one: int, other: int) -> bool:
    """Whether two bodies are sections of one tram: in bends their corners reach into the bellows."""
    first, last = min(one, other), max(one, other)
    if first < FIRST_TRAM or last >= FIRST_UMBRELLA:
        return False
    return (first - FIRST_TRAM) // TRAM_SECTIONS == (last - FIRST_TRAM) // TRAM_SECTIONS


def _in_one_seat(riders: NDArray[np.void], state: SimulationState) -> list[tuple[Any, int, float]]:
    """Return the passengers who sit where another one of the same bus does."""
    people = state.people
    bus = {int(entity): int(people.vehicle_entity[i]) for i, entity in enumerate(people.entity)}
    found = []
    for k, one in enumerate(riders):
        for other in riders[k + 1 :]:
            away = np.hypot(other["x"] - one["x"], other["y"] - one["y"])
            if bus[int(one["entity"])] == bus[int(other["entity"])] and away < _SEAT:
                found.append((one, int(other["entity"]), 2 * RADIUS))
    return found


def overlapping(bodies: Bodies, tolerance: float = TOLERANCE) -> list[tuple[int, int, float]]:
    """Return the pairs of bodies outdoors that are deeper in each other than `tolerance`: indices and depth, metres."""
    entity = bodies.entity.tolist()
    found = pairs(records_of(bodies), tolerance)
    return [(int(i), int(j), float(depth)) for i, j, depth in found if not _are_coupled(entity[i], entity[j])]


def _overlap(one: Any, other: int, depth: float) -> Overlap:
    where = float(one["x"]), float(one["y"]), float(one["bottom"])
    return Overlap(int(one["entity"]), other, depth, where, int(one["space"]))


def _on_slopes(bodies: Bodies, ground: HeightField) -> NDArray[np.void]:
    """Return records whose extents follow the ground: on a slope a bus stands lower at one end than at its middle.

    Those of loose things are their boxes, so that one may lie on another.
    """
    records = records_of(bodies)
    c, s = records["cos"], records["sin"]
    here = ground.near(bodies.position)
    along = bodies.half_length[:, None] * np.column_stack([c, s, np.zeros(len(c))])
    ends = np.array([ground.near(bodies.position + u * along) for u in (-1.0, 1.0)])
    slanted = bodies.kind != OBJECT
    records["bottom"] -= slanted * (here - np.minimum(here, ends.min(axis=0)))
    records["top"] += slanted * (np.maximum(here, ends.max(axis=0)) - here)
    return records


@compiled
def pairs(bodies, tolerance):
    """Return the pairs among some bodies, dtype `BODY`, that are deeper in each other than `tolerance` metres.

    Returns
    -------
    list of tuple
        Two indices, the lower one first, and the depth, metres; in ascending order.
    """
    found = [(0, 0, 0.0) for _ in range(0)]
    x, y = np.empty(len(bodies)), np.empty(len(bodies))
    for k in range(len(bodies)):
        x[k], y[k] = bodies[k].x, bodies[k].y
    grid = neighbour_grid(x, y, _CELL, 0.0)
    buffer = np.empty(len(bodies), np.int64)
    for i in range(len(bodies)):
        one = bodies[i]
        # Each pair is looked at from the wider one, so that a few long bodies make no long searches of all the rest.
        for j in search(grid, one.x, one.y, 2.0 * one.radius, buffer):
            other = bodies[j]
            is_mine = other.radius < one.radius or (other.radius == one.radius and j > i)
            if not is_mine or not can_touch(one, other):
                continue
            dx, dy = other.x - one.x, other.y - one.y
            reach = one.radius + other.radius
            if dx * dx + dy * dy < reach * reach:
                depth = -body_gap(one, other)
                if depth > tolerance:
                    found.append((min(i, j), max(i, j), depth))
    found.sort()
    return found


@compiled
def persons_in_solids(people, solids, tolerance):
    """Return who of some people, dtype `BODY`, is inside a wall or furniture: index, whether furniture, depth."""
    found = [(0, False, 0.0) for _ in range(0)]
    for i in range(len(people)):
        one = people[i]
        if one.space == OUTDOORS:
            depth = RADIUS - _map_gap_along(one, solids)
            if depth > tolerance:
                found.append((i, False, depth))
        if one.space < 0:
            continue
        depth = RADIUS - room_gap(one.x, one.y, solids.rooms[one.space])
        if depth > tolerance:
            found.append((i, False, depth))
        for f in range(solids.furniture_start[one.space], solids.furniture_start[one.space + 1]):
            depth = RADIUS - gap_to(one.x, one.y, solids.furniture[f])
            if depth > tolerance:
                found.append((i, True, depth))
    return found


@compiled
def _map_gap_along(one: Any, solids: SolidMap) -> float:
    """Return the least free room on the walkable map along the core of a person's footprint, metres."""
    reach = one.half_length - one.rounding
    points = int(np.ceil(2.0 * reach / _SPACING)) + 1
    least = 1e18
    for k in range(points):
        s = reach * (2.0 * k / (points - 1) - 1.0) if points > 1 else 0.0
        least = min(least, map_gap(one.x + s * one.cos, one.y + s * one.sin, solids.clearance, solids.half))
    return least


def run_reports(state: SimulationState, check: OverlapCheck | None) -> dict[str, Any]:
    """Return what goes beside a run's counts.

    Returns
    -------
    dict
        ``rescued``: how many vehicles were taken out of jams, and the first of them by name, place, time, how long
        they had stood and why; ``stuck``: the same of who gets nowhere now; ``reentered``: how often cars that had
        left the map came back in; ``junctions``: by which rule vehicles enter them;
        ``cyclists`` where some ride: how many, and how far all of them have;
        ``buses`` where there are buses or bicycles: how late, see `vico.sim.transit.TransitSystem.lateness`;
        ``physics`` where there are robots: engine and frames; ``overlaps``
        where they were checked, see `vico.sim.loop.checks.OverlapCheck`.
    """
    traffic = state.traffic
    rescued, stuck = (traffic.jams.rescued(), traffic.stuck()) if traffic is not None else ([], [])
    now = float(traffic.jams.elapsed[0]) if traffic is not None else 0.0
    found: dict[str, Any] = {
        "rescued": {
            "count": traffic.jams.count if traffic is not None else 0,
            "who": [_jam_record(jam, state.second - now, state) for jam in rescued],
        },
        "stuck": {"count": len(stuck), "who": [_jam_record(jam, state.second - now, state) for jam in stuck]},
        "reentered": traffic.reentered if traffic is not None else 0,
    }
    if traffic is not None:
        found["junctions"] = str(traffic.junction_rule)
        if traffic.cyclists:
            found["cyclists"] = {"count": traffic.cyclists, "kilometres": round(float(traffic.ridden.sum()) / 1e3, 3)}
    if state.transit is not None:
        found["buses"] = state.transit.lateness()
        if len(state.transit.trams):
            found["trams"] = state.transit.tram_lateness()
    if state.robots is not None:
        found["physics"] = state.robots.physics_record()
    return found if check is None else found | {"overlaps": check.record()}


def _jam_record(jam: Jam, began: float, state: SimulationState) -> dict[str, Any]:
    kind = state.entity(jam.entity)["kind"]
    why = f"behind {state.entity(jam.before)['name']}" if jam.before else ""
    return {
        "who": state.entity(jam.entity)["name"],
        "where": [round(value, 1) for value in jam.position],
        "since": clock_of(round(began + jam.at - jam.stood) % DAY),
        "seconds": round(jam.stood),
        "why": why or ("no way past" if kind == "pedestrian" else "waits for a junction or room on its way"),
    }
