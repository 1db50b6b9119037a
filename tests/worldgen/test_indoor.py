"""Rooms: furnished by use, reachable, closed, and never in each other's way."""

import math

import numpy as np
import pytest

from vico.assets.furniture import furniture_models
from vico.world.folder import World
from vico.worldgen.indoor import furnish
from vico.worldgen.layouts import REACH, occupied, plan_of, uses


def test_every_place_in_a_building_has_rooms(helsinki: World) -> None:
    assert [p.id for p in helsinki.places if p.building and not p.rooms] == []


def test_homes_have_a_bed_and_a_kitchen(helsinki: World) -> None:
    home = next(p for p in helsinki.places if p.kind == "apartments")
    kinds = {helsinki.room_by_id[r].kind for r in home.rooms}
    assert {"living_room", "kitchen", "bedroom"} == kinds
    containers = {c.kind for r in home.rooms for c in helsinki.room_by_id[r].containers}
    assert {"floor", "bed", "sofa", "table", "chair", "desk"} == containers


def test_rooms_lie_under_ground(helsinki: World) -> None:
    shallow = [r.id for r in helsinki.rooms if r.centre[2] + r.size[2] > float(helsinki.height(r.centre)) - 2.0]
    assert shallow == []


@pytest.mark.parametrize("use", uses())
def test_furniture_stands_within_its_room(use: str) -> None:
    models = furniture_models()
    for room in plan_of(use, 0).rooms:
        for item in room.items:
            wide, deep, _ = models[item.prototype].size
            c, s = abs(math.cos(item.yaw)), abs(math.sin(item.yaw))
            assert abs(item.x) + (c * wide + s * deep) / 2 <= room.size[0] / 2 + 1e-6, item
            assert abs(item.y) + (s * wide + c * deep) / 2 <= room.size[1] / 2 + 1e-6, item


@pytest.mark.parametrize("use", uses())
@pytest.mark.parametrize("variant", [0, 1])
def test_everything_that_holds_things_is_within_reach(use: str, variant: int) -> None:
    for room in plan_of(use, variant).rooms:
        taken = occupied(room.items, room.size)
        for spot in room.spots:
            ix = int((spot.reach[0] + room.size[0] / 2) / 0.1)
            iy = int((spot.reach[1] + room.size[1] / 2) / 0.1)
            assert not taken[iy, ix], (room.kind, spot)
            assert spot.item < 0 or math.dist(spot.reach, spot.centre[:2]) <= REACH


@pytest.mark.parametrize("use", uses())
def test_walls_floor_and_ceiling_face_into_the_room(use: str) -> None:
    for room in plan_of(use, 0).rooms:
        shell = [s for s in room.shell if len(s.triangles) == 2]
        for surface in shell:
            normal = np.asarray(surface.normals[0], float)
            towards = np.array([0, 0, 1.35]) - surface.positions.mean(axis=0)
            assert float(normal @ towards) > 0, (room.kind, surface.positions)
            corners = surface.positions[surface.triangles[0]].astype(float)
            turned = np.cross(corners[1] - corners[0], corners[2] - corners[0])
            assert float(turned @ normal) > 0


def test_a_house_full_of_places_has_room_for_all(helsinki: World) -> None:
    building = helsinki.buildings[0]
    template = next(p for p in helsinki.places if p.kind == "apartments")
    many = [template.model_copy(update={"id": f"p{k}", "building": building.id}) for k in range(60)]
    made = furnish(many, buildings=helsinki.buildings, height=helsinki.height)
    assert len(made.rooms) == 180
    spots = {(r.centre[0], r.centre[1], r.centre[2]) for r in made.rooms}
    assert len(spots) == 180
