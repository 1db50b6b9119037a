"""Places of central Helsinki: grounded in the map, entered by doors people can reach."""

import math

import shapely

from vico.world.model import Category
from vico.world.routing import Router
from vico.world.walkable import ROADWAY
from vico.world.world import World


def test_all_seven_categories_but_what_the_window_lacks_occur(helsinki: World) -> None:
    assert {place.category for place in helsinki.places} == set(Category)


def test_there_are_homes_for_fifteen_residents(helsinki: World) -> None:
    assert len([p for p in helsinki.places if p.kind == "apartments"]) >= 15


def test_names_of_homes_are_told_apart(helsinki: World) -> None:
    names = [p.name for p in helsinki.places if p.kind == "apartments"]
    assert len(set(names)) == len(names)


def test_every_door_is_on_its_wall_and_faces_out(helsinki: World) -> None:
    wrong = []
    for door in helsinki.entrances:
        building = helsinki.building_by_id[door.building]
        outline = shapely.Polygon(building.footprint[0], building.footprint[1:])
        front = (door.position[0] + 0.3 * math.cos(door.facing), door.position[1] + 0.3 * math.sin(door.facing))
        if outline.exterior.distance(shapely.Point(door.position[:2])) > 0.05 or outline.contains(shapely.Point(front)):
            wrong.append(door.id)
    assert wrong == []


def test_one_can_walk_from_any_place_to_any_other(helsinki: World) -> None:
    router = Router(helsinki.walkable)
    start = helsinki.places[0].position[:2]
    lost = [p.id for p in helsinki.places[1:] if router.path(start, p.position[:2]) is None]
    assert lost == []


def test_doors_open_to_the_pavement_rather_than_the_road(helsinki: World) -> None:
    onto_road = [e for e in helsinki.entrances if int(helsinki.walkable.class_at(e.approach)) == ROADWAY]
    assert len(onto_road) < 0.1 * len(helsinki.entrances)


def test_two_doors_are_never_one(helsinki: World) -> None:
    doors = helsinki.entrances
    close = [
        (a.id, b.id)
        for i, a in enumerate(doors)
        for b in doors[i + 1 :]
        if a.building == b.building and math.dist(a.position, b.position) < 2.5
    ]
    assert close == []


def test_a_building_is_accessible_if_it_has_a_door(helsinki: World) -> None:
    with_doors = {door.building for door in helsinki.entrances}
    assert {b.id for b in helsinki.buildings if b.accessible} == with_doors


def test_stops_and_stations_are_places_of_the_same_id(helsinki: World) -> None:
    stops = {stop.id for stop in helsinki.transit.stops} | {s.id for s in helsinki.transit.bike_stations}
    assert stops <= {p.id for p in helsinki.places if p.category is Category.TRANSIT}
