"""Rooms of a city are read one by one, and are those of its tiles."""

from __future__ import annotations

from pathlib import Path

import pytest

from vico.errors import MissingFileError, SchemaError
from vico.world.city import TileShift
from vico.world.city_world import CityRooms, RoomsById
from vico.world.world import World, write_records

WEST, EAST = TileShift(-400.0, 0.0, 2_000_000, "-1_0"), TileShift(400.0, 0.0, 3_000_000, "1_0")


@pytest.fixture
def rooms(corner: World, tmp_path: Path) -> CityRooms:
    empty = tmp_path / "empty.json"
    write_records(empty, [])
    return CityRooms([(corner.file("rooms.json"), WEST), (empty, WEST), (corner.file("rooms.json"), EAST)])


def test_they_are_those_of_all_tiles_in_order(corner: World, rooms: CityRooms) -> None:
    expected = [shift.room(room) for shift in (WEST, EAST) for room in corner.rooms]
    assert len(rooms) == len(expected) == 2 * len(corner.rooms)
    assert list(rooms) == expected
    assert [rooms[k] for k in (0, 5, -1)] == [expected[k] for k in (0, 5, -1)]
    assert rooms[3:7] == expected[3:7]
    assert rooms[2] is rooms[2]  # kept
    for outside in (len(rooms), -len(rooms) - 1):
        with pytest.raises(IndexError, match="of"):
            rooms[outside]


def test_by_id_the_last_of_a_name_is_found(rooms: CityRooms) -> None:
    by_id = RoomsById(rooms)
    name = rooms[4].id
    assert by_id[name].id == name
    assert name in by_id
    assert len(by_id) == len({room.id for room in rooms})
    with pytest.raises(KeyError):
        by_id["no such room"]


def test_a_file_that_is_gone_or_damaged_is_named(corner: World, tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="nowhere"):
        CityRooms([(tmp_path / "nowhere.json", WEST)])
    damaged = tmp_path / "rooms.json"
    damaged.write_bytes(corner.file("rooms.json").read_bytes().replace(b'"kind"', b'"kinds"'))
    with pytest.raises(SchemaError, match=r"rooms\.json"):
        CityRooms([(damaged, WEST)])[0]
