"""Rooms: planned and furnished by use, reachable on every floor, closed, and never in each other's way."""

import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from vico.assets.models.library import furniture_models, read_models
from vico.assets.models.movable import movable_kinds
from vico.io.data_files import PACKAGED
from vico.rules import REACH
from vico.world.check.indoors import walkable_inside
from vico.world.model import FIRST_FURNITURE, Category, Entrance
from vico.world.world import World
from vico.worldgen.facts.fault_isolation import collect_losses
from vico.worldgen.indoor import catalogue, stage
from vico.worldgen.indoor.catalogue import use_of
from vico.worldgen.indoor.floorplans import OUTSIDE, sketch_of
from vico.worldgen.indoor.furnished_plans import plan_of, rooms_of_plan, uses
from vico.worldgen.indoor.stage import furnish

SMALL = set(read_models(PACKAGED / "assets" / "models" / "indoor" / "small_things.toml"))


def test_every_place_in_a_building_has_rooms(helsinki: World) -> None:
    assert [p.id for p in helsinki.places if p.building and not p.rooms] == []


def test_homes_have_a_bed_and_a_kitchen(helsinki: World) -> None:
    for home in (p for p in helsinki.places if p.kind == "apartments"):
        rooms = [helsinki.room_by_id[r] for r in home.rooms]
        kinds = {room.kind for room in rooms}
        assert {"hall", "bathroom"} <= kinds, home.id
        assert kinds & {"studio", "living_room"}, home.id
        assert "bed" in {c.kind for room in rooms for c in room.containers}, home.id


def test_rooms_lie_under_ground(helsinki: World) -> None:
    shallow = [r.id for r in helsinki.rooms if r.centre[2] + r.size[2] > float(helsinki.height(r.centre)) - 2.0]
    assert shallow == []


def test_in_all_of_helsinki_one_walks_to_every_room_and_container(helsinki: World) -> None:
    assert walkable_inside(helsinki.rooms, helsinki.objects) == []


@pytest.mark.parametrize("use", uses())
def test_one_walks_from_the_entrance_to_every_container_on_every_floor(use: str) -> None:
    for size, variant in ((0, 0), (2, 1)):
        rooms, objects = rooms_of_plan(plan_of(use, size, catalogue.uses().uses[use].storeys, variant))
        assert walkable_inside(rooms, objects) == []
        assert all(room.containers for room in rooms if room.kind not in ("stairs", "lift")), use


def test_a_piece_in_the_way_is_found() -> None:
    rooms, objects = rooms_of_plan(plan_of("cafe"))
    k = int(np.flatnonzero(objects.solid & (objects.room == rooms[0].id))[0])
    x, y = objects.x.copy(), objects.y.copy()
    x[k], y[k] = rooms[0].doors[1].inside[:2]
    found = {finding.id for finding in walkable_inside(rooms, replace(objects, x=x, y=y))}
    assert found & {"door blocked", "room blocked"}


def test_a_room_without_a_door_is_found() -> None:
    rooms, objects = rooms_of_plan(plan_of("cafe"))
    first = rooms[0].model_copy(update={"doors": rooms[0].doors[:1], "links": []})
    found = {finding.id for finding in walkable_inside([first, *rooms[1:]], objects)}
    assert {"room cut off", "door one-sided"} <= found


@pytest.mark.parametrize("use", uses())
def test_furniture_stands_within_its_room_and_apart(use: str) -> None:
    models = furniture_models()
    for room in plan_of(use, 1, catalogue.uses().uses[use].storeys).rooms:
        solid: list[tuple[float, float, float, float]] = []
        for item in room.items:
            wide, deep, _ = models[item.prototype].size
            c, s = abs(math.cos(item.yaw)), abs(math.sin(item.yaw))
            a, b = (c * wide + s * deep) / 2, (s * wide + c * deep) / 2
            x, y = item.x - room.centre[0], item.y - room.centre[1]
            half = (room.size[1], room.size[0]) if abs(math.sin(room.yaw)) > 0.5 else (room.size[0], room.size[1])
            assert abs(x) + a <= half[0] / 2 + 0.01, (room.kind, item)
            assert abs(y) + b <= half[1] / 2 + 0.01, (room.kind, item)
            if models[item.prototype].solid:
                for ox, oy, oa, ob in solid:
                    assert abs(x - ox) >= a + oa - 0.01 or abs(y - oy) >= b + ob - 0.01, (room.kind, item)
                solid.append((x, y, a, b))


@pytest.mark.parametrize("use", ["flat_medium", "restaurant", "office", "cafe", "school"])
def test_small_things_stand_on_furniture_apart_and_beside_what_is_left_for_others(use: str) -> None:
    models = furniture_models()
    count = 0
    for room in plan_of(use, 1).rooms:
        things = [item for item in room.items if item.prototype in SMALL]
        hosts = [item for item in room.items if models[item.prototype].top is not None]
        for k, thing in enumerate(things):
            count += 1
            outline = _outline(thing.prototype, thing.x, thing.y, thing.yaw)
            assert any(_on(outline, thing.z - room.centre[2], host) for host in hosts), (room.kind, thing)
            others = [_outline(o.prototype, o.x, o.y, o.yaw) for o in things[:k] if abs(o.z - thing.z) < 0.01]
            assert not any(_overlap(outline, other) for other in others), (room.kind, thing)
            for spot in room.spots:
                if spot.item >= 0 and abs(spot.centre[2] - thing.z) < 0.01:
                    assert not _overlap(outline, _rectangle(spot.centre, spot.size, spot.yaw)), (room.kind, thing)
    assert count >= 3


def _rectangle(centre: tuple[float, ...], size: tuple[float, ...], yaw: float) -> tuple[float, float, float, float]:
    c, s = abs(math.cos(yaw)), abs(math.sin(yaw))
    a, b = (c * size[0] + s * size[1]) / 2, (s * size[0] + c * size[1]) / 2
    return centre[0] - a, centre[1] - b, centre[0] + a, centre[1] + b


def _outline(prototype: str, x: float, y: float, yaw: float) -> tuple[float, float, float, float]:
    return _rectangle((x, y), furniture_models()[prototype].size, yaw)


def _on(outline: tuple[float, float, float, float], z: float, host: object) -> bool:
    top = furniture_models()[host.prototype].top  # type: ignore[attr-defined]
    c, s = math.cos(host.yaw), math.sin(host.yaw)  # type: ignore[attr-defined]
    x = host.x + c * top.centre[0] - s * top.centre[1]  # type: ignore[attr-defined, union-attr]
    y = host.y + s * top.centre[0] + c * top.centre[1]  # type: ignore[attr-defined, union-attr]
    low = _rectangle((x, y), top.size, host.yaw)  # type: ignore[attr-defined, union-attr]
    inside = all(outline[k] >= low[k] - 0.01 for k in (0, 1)) and all(outline[k] <= low[k] + 0.01 for k in (2, 3))
    return inside and abs(top.height - z) < 0.01  # type: ignore[union-attr]


def _overlap(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    return (
        one[0] < other[2] - 0.005
        and other[0] < one[2] - 0.005
        and one[1] < other[3] - 0.005
        and other[1] < one[3] - 0.005
    )


def test_small_things_are_no_goods_and_stop_nobody(helsinki: World) -> None:
    objects = helsinki.objects
    small = np.isin(objects.prototype, sorted(SMALL))
    assert small.sum() > 1000
    assert not objects.solid[small].any()
    assert not set(objects.kind[small].tolist()) & set(movable_kinds())


def test_containers_are_within_reach(helsinki: World) -> None:
    for room in helsinki.rooms:
        for container in room.containers:
            if container.kind != "floor":
                assert math.dist(container.reach, container.centre[:2]) <= REACH, container.id
            assert container.entity == room.entity or container.entity >= FIRST_FURNITURE


@pytest.mark.parametrize("use", [*catalogue.uses().uses])
def test_doors_are_wide_enough_and_lie_on_shared_walls(use: str) -> None:
    sketch = sketch_of(use, 1, catalogue.uses().uses[use].storeys)
    for door in sketch.doors:
        assert door.width >= 0.9
        for room in (sketch.rooms[k] for k in (door.a, door.b) if k != OUTSIDE and not door.lift):
            x0, y0, x1, y1 = room.box
            x, y = door.at
            on = (min(abs(x - x0), abs(x - x1)) < 0.01 and y0 + door.width / 2 <= y <= y1 - door.width / 2) or (
                min(abs(y - y0), abs(y - y1)) < 0.01 and x0 + door.width / 2 <= x <= x1 - door.width / 2
            )
            assert on, (use, door, room)
    assert sum(OUTSIDE in (door.a, door.b) for door in sketch.doors) == 1


def test_hotels_offices_and_schools_of_high_houses_have_stairs(helsinki: World) -> None:
    for use in ("hotel", "office", "school", "department_store", "maisonette"):
        kinds = Counter(room.kind for room in plan_of(use, 0, 2).rooms)
        assert kinds["stairs"] == 1, use
    assert Counter(room.kind for room in plan_of("hotel", 0, 3).rooms)["stairs"] == 2
    assert "stairs" in {room.kind for room in helsinki.rooms}


@pytest.mark.parametrize("use", ["flat_small", "cafe", "office"])
def test_walls_floor_and_ceiling_face_into_the_room(use: str) -> None:
    plan = plan_of(use, 0)
    for surface in plan.shell:
        if not surface.material.name.startswith(("wall_", "floor_", "room_ceiling")):
            continue
        for triangle in surface.triangles:
            room = plan.rooms[int(surface.entity[triangle[0]])]
            corners = surface.positions[triangle].astype(float)
            middle = np.array(room.centre) + np.array([0.0, 0.0, room.size[2] / 2])
            turned = np.cross(corners[1] - corners[0], corners[2] - corners[0])
            assert float(turned @ (middle - corners.mean(axis=0))) > 0, (room.kind, surface.material.name)


def test_a_house_full_of_places_has_room_for_all(helsinki: World) -> None:
    building = helsinki.buildings[0]
    template = next(p for p in helsinki.places if p.kind == "apartments")
    many = [template.model_copy(update={"id": f"p{k}", "building": building.id}) for k in range(60)]
    made = furnish(many, buildings=helsinki.buildings, height=helsinki.height)
    assert len(made.places) == 60
    assert all(place.rooms for place in made.places)
    spots = {room.centre for room in made.rooms}
    assert len(spots) == len(made.rooms)


def test_a_place_without_room_under_its_house_is_left_out_and_told(
    helsinki: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stage, "_DEEPEST", 0.0)
    building = helsinki.buildings[0]
    template = next(p for p in helsinki.places if p.kind == "apartments")
    many = [template.model_copy(update={"id": f"p{k}", "building": building.id}) for k in range(60)]
    with collect_losses() as losses:
        made = furnish(many, buildings=helsinki.buildings, height=helsinki.height)
    housed = {place.id for place in made.places}
    assert 0 < len(housed) < 60
    assert losses.ids == {place.id for place in many} - housed
    assert {one.reason for one in losses.dropped} == {f"no room for it under building {building.id}"}
    assert all(place.rooms for place in made.places)


def test_the_same_seed_gives_the_same_rooms(helsinki: World) -> None:
    some = [p.model_copy(update={"rooms": []}) for p in helsinki.places[:8]]
    one, two = (furnish(some, buildings=helsinki.buildings, height=helsinki.height, seed=4) for _ in range(2))
    assert one.rooms == two.rooms
    assert all(
        (getattr(one.furniture, n) == getattr(two.furniture, n)).all() for n in ("prototype", "x", "yaw", "entity")
    )


def test_a_building_with_a_door_but_no_place_gets_a_hall(helsinki: World) -> None:
    building = helsinki.buildings[0].model_copy(update={"use": "religious", "name": None})
    door = Entrance(id="e", building=building.id, position=(0.0, 0.0, 0.0), facing=0.0, approach=(1.0, 0.0))
    made = furnish([], buildings=[building], height=helsinki.height, entrances=[door])
    assert [p.building for p in made.places] == [building.id]
    assert "nave" in {room.kind for room in made.rooms}


def test_every_kind_of_place_has_a_use() -> None:
    assert use_of(Category.FOOD, "pub") == "bar"
    assert use_of(Category.STORE, "something new") == "shop"
    assert {use_of(category, "?") for category in Category} <= set(uses())
    assert use_of(Category.ACCOMMODATION, "apartments") == "flat"
    assert set(catalogue.uses().homes) <= set(uses())
    assert len(uses()) >= 40
