"""One waits for a bus where one can board it, whatever the street looks like."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
import shapely

from road_city import road_city
from vico.rules import BUS_DOOR_REACH, BUS_WIDTH
from vico.world.check.outdoors import check_transit
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph
from vico.world.transit import Stop, Transit
from vico.world.world import World
from vico.worldgen.facts.streets import StreetPolygons
from vico.worldgen.transit.bus_lines import Kerbs
from vico.worldgen.transit.waiting import _SplitArea, front_door, waiting_places


@pytest.fixture(scope="module")
def stop() -> tuple[Stop, LaneGraph]:
    """A stop of a bus line in central Helsinki, and its lanes."""
    city = road_city()
    return next(stop for stop in city.transit.stops if stop.id == city.transit.lines[0].stops[0]), city.lanes


def street(stop: Stop, lanes: LaneGraph, kerb: float) -> StreetPolygons:
    """A straight street along the stop's lane whose pavement begins so many metres from the lane's middle."""
    x, y, yaw = lanes.at(lanes.index[stop.lane], stop.offset)
    side = 1.0 if lanes.lefthand else -1.0

    def strip(near: float, far: float) -> shapely.Polygon:
        corners = [(-40.0, near), (40.0, near), (40.0, far), (-40.0, far)]
        c, s = math.cos(yaw), math.sin(yaw)
        return shapely.Polygon([(x + a * c - side * b * s, y + a * s + side * b * c) for a, b in corners])

    nothing = shapely.MultiPolygon()
    return StreetPolygons(
        carriageway=shapely.MultiPolygon([strip(-12.0, kerb)]),
        sidewalk=shapely.MultiPolygon([strip(kerb, kerb + 3.0)]),
        crossing=nothing, pedestrian=nothing, path=nothing, cycleway=nothing, steps=nothing, parking=nothing,
        streets=[], crossings=[], rails=[],
    )  # fmt: skip


def wait(
    stop: Stop, lanes: LaneGraph, kerb: float, solids: list[shapely.Polygon] | None = None, *, served: bool = True
) -> shapely.Point:
    lines = road_city().transit.lines[:1] if served else []
    transit = Transit(stops=[stop], lines=lines, bike_stations=[], origin={})
    made = waiting_places(transit, street(stop, lanes, kerb), lanes, HeightField.flat(600.0), solids or [])
    return shapely.Point(made.stops[0].wait[:2])


@pytest.mark.parametrize("kerb", [1.5, 2.0, 3.0, 4.0, 5.0, 7.0])
def test_the_bus_can_be_boarded_from_where_one_waits(stop: tuple[Stop, LaneGraph], kerb: float) -> None:
    here, lanes = stop
    found = wait(here, lanes, kerb)
    door = shapely.Point(front_door(lanes, here.lane, here.offset))
    assert found.distance(door) < BUS_DOOR_REACH
    # And nobody stands where the bus does.
    middle = shapely.LineString(lanes.line(lanes.index[here.lane]))
    assert found.distance(middle) > BUS_WIDTH / 2 + 0.5
    pavement = street(here, lanes, kerb).sidewalk
    assert pavement.contains(found) == (kerb < BUS_WIDTH / 2 + 2.2)
    # Where it is too far off one goes as near to it as one can.
    assert found.distance(pavement) < max(kerb - BUS_WIDTH / 2 - 2.2, 0.01)


def test_at_a_stop_that_no_line_serves_one_waits_on_the_pavement_however_far_it_is(
    stop: tuple[Stop, LaneGraph],
) -> None:
    here, lanes = stop
    assert street(here, lanes, 5.0).sidewalk.contains(wait(here, lanes, 5.0, served=False))


def test_nobody_waits_in_a_wall(stop: tuple[Stop, LaneGraph]) -> None:
    here, lanes = stop
    free = wait(here, lanes, 2.0)
    wall = free.buffer(0.6)
    found = wait(here, lanes, 2.0, [wall])
    assert found.distance(wall) > 0.3
    assert found.distance(shapely.Point(front_door(lanes, here.lane, here.offset))) < BUS_DOOR_REACH


def house_along(stop: Stop, lanes: LaneGraph, first: float, last: float) -> shapely.Polygon:
    """A house at the edge of the stop's lane, between so many metres along it."""
    x, y, yaw = lanes.at(lanes.index[stop.lane], stop.offset)
    side = 1.0 if lanes.lefthand else -1.0
    c, s = math.cos(yaw), math.sin(yaw)
    corners = [(first, 1.5), (last, 1.5), (last, 9.0), (first, 9.0)]
    return shapely.Polygon([(x + a * c - side * b * s, y + a * s + side * b * c) for a, b in corners])


def test_no_bus_stops_where_a_house_leaves_no_room_to_wait(stop: tuple[Stop, LaneGraph]) -> None:
    here, lanes = stop
    kerbs = Kerbs(lanes, HeightField.flat(600.0), [house_along(here, lanes, -80.0, 80.0)])
    lane = lanes.index[here.lane]
    assert not kerbs.has_room(lane, here.offset)
    assert kerbs.with_room(lane, here.offset) is None
    spot = lanes.at(lane, here.offset)[:2]
    assert lane not in [found for _, found, _ in kerbs.near(spot, 12.0)]
    assert kerbs.passes(spot, 12.0)


def test_a_bus_stops_a_little_further_on_where_that_leaves_room_to_wait(stop: tuple[Stop, LaneGraph]) -> None:
    here, lanes = stop
    lane = lanes.index[here.lane]
    free = Kerbs(lanes, HeightField.flat(600.0))
    assert free.with_room(lane, here.offset) == free.offset_on(lane, here.offset)
    kerbs = Kerbs(lanes, HeightField.flat(600.0), [house_along(here, lanes, -12.0, 3.0)])
    found = kerbs.with_room(lane, here.offset)
    assert found is not None
    assert 2.0 <= abs(found - here.offset) <= 16.0


def test_a_good_waiting_place_stays(stop: tuple[Stop, LaneGraph]) -> None:
    here, lanes = stop
    found = wait(here, lanes, 2.0)
    again = here.model_copy(update={"wait": (found.x, found.y, 0.0)})
    assert wait(again, lanes, 2.0).equals(found)


def test_a_stop_that_cannot_be_boarded_at_is_a_finding(helsinki_city: World) -> None:
    assert list(check_transit(helsinki_city)) == []
    transit = helsinki_city.transit
    served = transit.lines[0].stops[0]

    def moved(by: float) -> list[str]:
        stops = [s.model_copy(update={"wait": (s.wait[0] + by, *s.wait[1:])}) if s.id == served else s
                 for s in transit.stops]  # fmt: skip
        world: Any = SimpleNamespace(
            lanes=helsinki_city.lanes,
            walkable=helsinki_city.walkable,
            transit=transit.model_copy(update={"stops": stops}),
        )
        return [finding.id for finding in check_transit(world) if finding.where == served]

    assert "stop out of reach" in moved(8.0)
    assert "stop blocked" in moved(10_000.0)


def test_what_of_a_large_pavement_lies_somewhere_is_found_without_the_rest() -> None:
    lines = [shapely.LineString([(x, 0.0), (x + 90.0, 700.0)]) for x in range(0, 900, 60)]
    pavement = shapely.union_all([line.buffer(4.0) for line in lines]).difference(shapely.box(300, 300, 340, 350))
    parted = _SplitArea(pavement)
    for x, y in ((0.0, 0.0), (100.0, 100.0), (310.0, 320.0), (455.0, 350.0), (990.0, 700.0), (2000.0, 0.0)):
        room = shapely.Point(x, y).buffer(9.0)
        found, plain = parted.within(room), pavement.intersection(room)
        assert found.symmetric_difference(plain).area < 1e-9
        assert found.is_empty == plain.is_empty
    assert _SplitArea(shapely.Polygon()).within(shapely.Point(0, 0).buffer(1.0)).is_empty
