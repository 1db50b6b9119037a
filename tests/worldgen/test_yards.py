"""What the open ground between houses is where no map says so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmArea, OsmData, OsmWay
from vico.world.heights import HeightField
from vico.worldgen.facts.site import site_facts
from vico.worldgen.ground.yards import Yards, yards_of
from vico.worldgen.objects.stage import Surroundings, objects_from_osm
from vico.worldgen.objects.trees import lawn_placements

_NONE = shapely.MultiPolygon()
_HALF = 100.0


def _map(size: float, pitch: float, *more: OsmArea, tags: dict[str, str] | None = None, east: float = 0.0) -> OsmData:
    """A map of square houses in rows, seen from `east` metres east of its middle."""
    places = np.arange(-220.0, 221.0, pitch)
    built = [
        OsmArea(f"w{k}", shapely.box(x - east, y, x - east + size, y + size), tags or {"building": "yes"})
        for k, (x, y) in enumerate((x, y) for x in places for y in places)
    ]
    return OsmData(LocalFrame(55.8, 37.6), _HALF, 100.0, [], [], [*built, *more], [])


def _yards(osm: OsmData, carriageway: shapely.Geometry, reach: float) -> Yards:
    return yards_of(site_facts(osm), carriageway, reach=reach)


def _parts(yards: Yards) -> tuple[float, float, float]:
    return yards.gardens.area, yards.lawns.area, yards.lots.area


def test_small_houses_that_stand_by_themselves_have_gardens_slabs_lawns_and_blocks_paved_yards() -> None:
    gardens, lawns, lots = _parts(_yards(_map(11.0, 24.0), _NONE, reach=80.0))
    assert gardens > 8000.0
    assert lawns + lots == 0.0
    assert sum(_parts(_yards(_map(40.0, 50.0), _NONE, reach=80.0))) < 200.0
    gardens, lawns, lots = _parts(_yards(_map(28.0, 75.0), _NONE, reach=80.0))
    assert lawns > 8000.0
    assert gardens + lots == 0.0
    assert _yards(OsmData(LocalFrame(55.8, 37.6), _HALF, 0.0, [], [], [], []), _NONE, reach=80.0) == Yards(80.0)


def test_lots_lie_where_land_is_used_for_work_and_beside_sheds() -> None:
    land = OsmArea("w9", shapely.box(-80.0, -80.0, 0.0, 80.0), {"landuse": "industrial"})
    yards = _yards(_map(28.0, 75.0, land), _NONE, reach=80.0)
    assert yards.lots.within(land.polygon.buffer(0.01))
    assert yards.lots.area > 3000.0
    assert yards.lawns.area > 3000.0
    assert yards.lawns.intersection(yards.lots).area == pytest.approx(0.0, abs=1e-6)
    sheds = _yards(_map(28.0, 75.0, tags={"building": "warehouse"}), _NONE, reach=80.0)
    assert sheds.lots.area > 0.4 * (sheds.lots.area + sheds.lawns.area)


def test_yards_stay_paved_along_walls_and_kerbs() -> None:
    osm, street = _map(28.0, 75.0), shapely.box(-80.0, -4.0, 80.0, 4.0)
    green = _yards(osm, street, reach=80.0).green()
    assert green.area > 4000.0
    assert green.distance(street) > 2.6
    assert green.distance(shapely.union_all([area.polygon for area in osm.areas])) > 2.6


def test_neighbours_in_a_city_see_the_same_yards_at_their_border() -> None:
    west, east = (_yards(_map(28.0, 75.0, east=at), _NONE, reach=_HALF) for at in (-90.0, 110.0))
    lines = [shapely.LineString([(x, -90.0), (x, 90.0)]) for x in (99.5, -99.5)]
    one, other = west.lawns.intersection(lines[0]), east.lawns.intersection(lines[1])
    assert 40.0 < one.length < 179.0
    assert one.length == pytest.approx(other.length, abs=1.0)
    assert shapely.affinity.translate(one, -200.0 + 1.0).hausdorff_distance(other) < 1.0


def test_trees_and_shrubs_grow_on_lawns_and_off_streets() -> None:
    osm = _map(28.0, 75.0)
    street = shapely.MultiPolygon([shapely.box(-100.0, -4.0, 100.0, 4.0)])
    lawns = _yards(osm, street, reach=_HALF).green()
    houses, height = [area.polygon for area in osm.areas], HeightField.flat(160.0)
    bare, _ = objects_from_osm(osm, Surroundings(houses, street), height=height)
    grown, dropped = objects_from_osm(osm, Surroundings(houses, street, lawns=lawns), height=height)
    plants = np.isin(grown.kind, ("tree", "shrub"))
    assert not np.isin(bare.kind, ("tree", "shrub")).any()
    assert plants.sum() > 30
    assert not dropped
    assert shapely.contains_xy(lawns, *grown.position[plants, :2].T).all()
    again, _ = objects_from_osm(osm, Surroundings(houses, street, lawns=lawns), height=height)
    assert np.array_equal(grown.position, again.position)


def test_nothing_grows_in_water_nor_beside_rails() -> None:
    pond = OsmArea("w9", shapely.box(-60.0, -60.0, -10.0, -10.0), {"natural": "water"})
    lines = {"waterway": "canal", "railway": "rail"}
    ways = [
        OsmWay(k, [2 * k, 2 * k + 1], np.array([[-100.0, y], [100.0, y]]), False, {key: lines[key]})
        for k, (key, y) in enumerate((("waterway", 45.0), ("railway", -70.0)))
    ]
    osm = replace(_map(28.0, 75.0, pond), ways=ways)
    yards = _yards(osm, _NONE, reach=_HALF)
    grown, _ = objects_from_osm(
        osm, Surroundings(lawns=yards.green(), mapped=yards.mapped), height=HeightField.flat(160.0)
    )
    points = shapely.points(grown.position[:, :2])
    assert len(points) > 20
    assert not shapely.intersects(pond.polygon, points).any()
    assert shapely.distance(shapely.LineString(ways[0].line), points).min() > 3.5
    assert shapely.distance(shapely.LineString(ways[1].line), points).min() >= 4.0


def test_tiles_of_a_city_do_not_draw_their_lawns_alike() -> None:
    lawn, nothing = shapely.box(-90.0, -90.0, 90.0, 90.0), shapely.MultiPolygon()

    def grown(east: float) -> NDArray[np.float64]:
        frame = LocalFrame(55.8, 37.6, east=east)
        osm = OsmData(frame, _HALF, 100.0, [], [], [], [])
        return np.array([wish.xy for wish in lawn_placements(osm, lawn, nothing, [], 0, "temperate")])

    here, there = grown(0.0), grown(2 * _HALF)
    assert min(len(here), len(there)) > 20
    assert np.array_equal(here, grown(0.0))
    assert here.shape != there.shape or not np.allclose(here, there)
