"""What stairs and corridors cost."""

from __future__ import annotations

import math

import pytest

from vico.world.model import LANDING, Doorway, Point3, Room
from vico.world.walk_lengths import DOOR, IndoorWays, walk_within
from vico.world.world import World


def room(name: str, centre: Point3, size: Point3, doors: list[Doorway], rise: float = 0.0) -> Room:
    return Room(
        id=name, entity=1, place="p", building="b", kind="hall", centre=centre, size=size, yaw=0.0,
        door=doors[0].position, inside=doors[0].inside, doors=doors, rise=rise,
    )  # fmt: skip


def house() -> list[Room]:
    """A hall, a corridor of ten metres behind it, and a room at its end."""
    return [
        room("hall", (2.0, 0.0, 0.0), (4.0, 4.0, 2.7), [
            Doorway(to="", position=(0.0, 0.0, 0.0), inside=(0.5, 0.0, 0.0)),
            Doorway(to="corridor", position=(4.0, 0.0, 0.0), inside=(3.5, 0.0, 0.0)),
        ]),
        room("corridor", (9.0, 0.0, 0.0), (10.0, 1.7, 2.7), [
            Doorway(to="hall", position=(4.0, 0.0, 0.0), inside=(4.5, 0.0, 0.0)),
            Doorway(to="office", position=(14.0, 0.0, 0.0), inside=(13.5, 0.0, 0.0)),
        ]),
        room("office", (16.0, 0.0, 0.0), (4.0, 4.0, 2.7), [
            Doorway(to="corridor", position=(14.0, 0.0, 0.0), inside=(14.5, 0.0, 0.0)),
        ]),
    ]  # fmt: skip


def _by_id(rooms: list[Room]) -> dict[str, Room]:
    return {room.id: room for room in rooms}


def test_a_room_costs_the_walk_through_those_before_it_and_a_moment_at_each_door() -> None:
    found = IndoorWays(_by_id(house())).from_street("hall")
    assert found == pytest.approx({"hall": DOOR, "corridor": 3.0 + 2 * DOOR, "office": 3.0 + 9.0 + 3 * DOOR})
    assert IndoorWays(_by_id(house())).seconds(["hall", "corridor", "office"]) == pytest.approx(15.0)
    assert IndoorWays(_by_id(house())).seconds([]) == 0.0


def test_on_stairs_one_goes_up_one_flight_and_back_on_the_other() -> None:
    stairs = room("s", (0.0, 0.0, 0.0), (5.0, 2.5, 6.0), [
        Doorway(to="a", position=(-2.5, -0.6, 0.0), inside=(-2.0, -0.6, 0.0)),
        Doorway(to="b", position=(-2.5, 0.6, 3.2), inside=(-2.0, 0.6, 3.2)),
    ], rise=3.2)  # fmt: skip
    below, above = stairs.doors[0].inside, stairs.doors[1].inside
    to_landing = 2.5 - LANDING / 2 + 2.0
    assert walk_within(stairs, below, above) == pytest.approx(2 * math.hypot(to_landing, 0.6))
    assert walk_within(stairs, below, (1.0, -0.6, 1.0)) == pytest.approx(3.0)


def test_every_room_of_a_real_city_is_reached_and_upper_floors_take_longer(helsinki: World) -> None:
    ways = IndoorWays(helsinki.room_by_id)
    floor = {r.id: r.centre[2] for r in helsinki.rooms}
    higher = []
    for place in helsinki.places:
        if place.rooms:
            found = ways.from_street(place.rooms[0])
            assert set(found) == set(place.rooms)
            assert found[place.rooms[0]] == DOOR
            ground = floor[place.rooms[0]]
            higher += [found[name] for name in place.rooms if abs(floor[name] - ground) > 2.5]
    assert higher
    # A flight and its way back are five metres at least, or a lift is some doors away.
    assert min(higher) > 5.0
