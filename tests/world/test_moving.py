"""What a tile has, as its city has it."""

from __future__ import annotations

import numpy as np
import pytest

from vico.errors import SchemaError
from vico.world.city import TileShift
from vico.world.model import FIRST_BODY, FIRST_BUILDING, FIRST_FURNITURE, FIRST_ROOM, FIRST_STOP
from vico.world.world import World

HERE = TileShift(400.0, -800.0, 2_500_000, "1_-2")


def test_things_keep_their_shape_and_get_numbers_of_their_own(corner: World) -> None:
    for building in corner.buildings:
        moved = HERE.building(building)
        assert moved.entity == building.entity + 2_500_000
        away = np.array(moved.footprint[0]) - np.array(building.footprint[0])
        assert np.allclose(away, [400.0, -800.0], atol=1e-3)
    objects = HERE.objects(corner.objects)
    assert np.allclose(objects.position - corner.objects.position, [400.0, -800.0, 0.0])
    assert len(set(objects.id.tolist())) == len(objects)
    for room in corner.rooms[:20]:
        moved_room = HERE.room(room)
        assert moved_room.id == room.id
        for one, other in zip(moved_room.containers, room.containers, strict=True):
            assert one.entity == other.entity + 2_500_000
            assert one.centre[2] == other.centre[2]


def test_entities_of_the_ground_and_of_stops_are_the_citys_own() -> None:
    numbers = np.array(
        [0, 1, 6, FIRST_BUILDING, FIRST_STOP - 1, FIRST_STOP, FIRST_ROOM - 1, FIRST_ROOM, FIRST_FURNITURE]
    )
    moved = HERE.numbers(numbers)
    kept = [0, 1, 2, 5, 6]
    assert moved[kept].tolist() == numbers[kept].tolist()
    others = [3, 4, 7, 8]
    assert (moved[others] == numbers[others] + 2_500_000).all()
    assert moved[others].min() > FIRST_BODY
    with pytest.raises(SchemaError, match="tile 1_-2"):
        HERE.numbers(np.array([700_000]))


def test_ids_of_stops_are_kept_and_others_say_which_tile() -> None:
    assert HERE.id("entrance_3") == "1_-2.entrance_3"
    assert HERE.id("stop_12") == "stop_12"
    assert HERE.id("bikes_1") == "bikes_1"


def test_meshes_are_moved_whole(corner: World) -> None:
    for surface in corner.surfaces("roofs"):
        moved = HERE.surface(surface)
        assert np.allclose(moved.positions - surface.positions, [400.0, -800.0, 0.0], atol=1e-3)
        assert np.array_equal(moved.triangles, surface.triangles)
