"""Streets are painted, paved and furnished as they are where the place lies."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from shapely import MultiPolygon

from vico.errors import SchemaError
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmData, OsmNode, OsmWay
from vico.io.data_files import VARIABLE
from vico.world.heights import HeightField
from vico.worldgen.facts.site import site_facts
from vico.worldgen.facts.street_habits import Markings, habits_at, street_habits
from vico.worldgen.facts.streets import Crossing, Street, StreetPolygons
from vico.worldgen.ground.markings import Quads, clip_quads, crossing_paint, road_markings
from vico.worldgen.ground.pavings import LOOKS, look_of
from vico.worldgen.ground.stage import street_bearing, tactile_fields, tree_pits
from vico.worldgen.ground.wires import CONTACT, contact_wires
from vico.worldgen.objects.mapped_objects import thing_of
from vico.worldgen.streets.polygons import crossings_of

WINDOW = shapely.box(-100.0, -100.0, 100.0, 100.0)
YELLOW = (226, 184, 70)


def city(*streets: Street, crossings: list[Crossing] | None = None) -> StreetPolygons:
    none = MultiPolygon()
    strips = [shapely.LineString(s.line).buffer(s.width / 2, cap_style="flat") for s in streets]
    road = shapely.union_all(strips)
    walk = shapely.union_all(strips).buffer(4.0).difference(road)
    parts = [MultiPolygon(shapely.get_parts(shape).tolist()) for shape in (road, walk)]
    return StreetPolygons(
        parts[0], parts[1], none, none, none, none, none, none, list(streets), crossings or [], [], parts[0]
    )


def street(way: int, *points: tuple[float, float], width: float = 8.0, kind: str = "secondary") -> Street:
    return Street(way, kind, np.array(points, float), width, 2, oneway=False)


def colours(quads: list[Quads]) -> set[tuple[int, int, int]]:
    return {group.colour for group in quads}


def test_plates_are_those_of_the_country() -> None:
    plates = {name: habits_at(*place).plates for name, place in
              {"us": (40.72, -73.98), "uk": (51.51, -0.09), "de_mosaic": (52.51, 13.39), "fr": (43.73, 7.42),
               "elsewhere": (35.7, 139.7)}.items()}  # fmt: skip
    assert [plates[name].names_on for name in plates] == ["posts", "walls", "posts", "walls", "walls"]
    assert sum(plates["uk"].ground) > sum(plates["uk"].letters)
    assert sum(plates["fr"].ground) < sum(plates["fr"].letters)
    assert plates["fr"].rim is not None
    assert plates["elsewhere"].rim is None
    assert len({(one.ground, one.rim) for one in plates.values()}) == 4


def test_habits_are_those_of_the_country_that_lies_there() -> None:
    places = {
        "us": (40.72, -73.98), "uk": (51.51, -0.09), "de": (47.49, 11.09), "de_mosaic": (52.51, 13.39),
        "fi": (60.17, 24.94), "fr": (43.73, 7.42), "latin_american": (-22.9, -43.2), "elsewhere": (35.7, 139.7),
    }  # fmt: skip
    assert [habits_at(*place).name for place in places.values()] == list(places)
    assert habits_at(*places["de_mosaic"]).family == "de"
    assert habits_at(*places["de_mosaic"]).markings == habits_at(*places["de"]).markings


def test_the_country_that_addresses_name_goes_before_the_outlines() -> None:
    nodes = [OsmNode(1, np.zeros(2), {"addr:country": "FR"})]
    assert street_habits(OsmData(LocalFrame(48.99, 8.2), 50.0, 0.0, nodes, [], [], [])).name == "fr"


def test_lines_between_directions_are_yellow_in_america_and_broken_white_ones_in_germany() -> None:
    plan = city(street(1, (-80.0, 0.0), (80.0, 0.0)))
    american = road_markings(plan, WINDOW, habits=habits_at(40.72, -73.98).markings)
    german = road_markings(plan, WINDOW, habits=habits_at(47.49, 11.09).markings)
    assert YELLOW in colours(american)
    assert YELLOW not in colours(german)
    assert len(german[0].corners) == 18  # dashes of 3 m every 9 m on 160 m


def test_double_yellow_lines_follow_both_kerbs_of_main_streets_in_britain() -> None:
    plan = city(street(1, (-80.0, 0.0), (80.0, 0.0)))
    quads = road_markings(plan, WINDOW, habits=habits_at(51.51, -0.09).markings)
    across = np.concatenate([group.corners for group in quads if group.colour == YELLOW])[..., 1]
    assert across.max() > 3.5
    assert across.min() < -3.5
    assert np.abs(across).max() < 4.0


def test_one_dash_alone_is_not_painted() -> None:
    quads = road_markings(city(street(1, (-3.5, 0.0), (3.5, 0.0))), WINDOW, habits=Markings())
    assert quads == []


@pytest.mark.parametrize("turned", [0.0, 0.3, 0.8, 1.5])
def test_marks_across_a_border_are_drawn_by_both_tiles_up_to_it(turned: float) -> None:
    c, s = math.cos(turned), math.sin(turned)
    bars = [
        np.array([(-3, y), (3, y), (3, y + 0.5), (-3, y + 0.5)]) @ np.array([[c, s], [-s, c]]) for y in range(-4, 4)
    ]
    west, east = clip_quads(bars, shapely.box(-50, -50, 0, 50)), clip_quads(bars, shapely.box(0, -50, 50, 50))
    assert west[..., 0].max() == pytest.approx(0.0, abs=1e-9)
    assert east[..., 0].min() == pytest.approx(0.0, abs=1e-9)
    shapes = [shapely.Polygon(quad) for quad in (*west, *east)]
    assert all(shape.exterior.is_ccw for shape in shapes)
    assert sum(shape.area for shape in shapes) == pytest.approx(8 * 6 * 0.5, rel=1e-3)
    assert shapely.union_all(shapes).area == pytest.approx(8 * 6 * 0.5, rel=1e-3)


def test_no_lanes_are_painted_on_natural_stones() -> None:
    paved = replace(street(1, (-80.0, 0.0), (80.0, 0.0)), setts=True)
    assert road_markings(city(paved), WINDOW, habits=Markings()) == []


def test_marks_of_crossings_that_lie_over_each_other_are_painted_once() -> None:
    first = Crossing((0.0, -4.0), (0.0, 4.0), 4.0, painted=True, id="w1")
    askew = Crossing((-1.5, -4.0), (2.5, 4.0), 4.0, painted=True, id="w2")
    beside = Crossing((10.0, -4.0), (10.0, 4.0), 4.0, painted=True, id="w3")
    streets = [street(1, (-80.0, 0.0), (80.0, 0.0), kind="residential", width=8.0)]
    count = {}
    for name, crossings in {"one": [first], "over": [first, askew], "beside": [first, beside]}.items():
        quads = road_markings(city(*streets, crossings=crossings), WINDOW, habits=replace(Markings(), dash=1e3))
        shapes = [shapely.Polygon(quad) for group in quads for quad in group.corners]
        count[name] = len(shapes)
        shared = sum(a.intersection(b).area for k, a in enumerate(shapes) for b in shapes[:k])
        assert shared < 0.1 * sum(shape.area for shape in shapes)
    assert count["beside"] == 2 * count["one"]
    assert count["one"] <= count["over"] < count["beside"]


def test_lines_end_where_carriageways_meet_at_a_sharp_angle() -> None:
    roads = [
        street(1, (0.0, 0.0), (90.0, 0.0)),
        street(2, (0.0, 0.0), (90.0, 22.0)),
        street(3, (-90.0, 0.0), (0.0, 0.0)),
    ]
    quads = road_markings(city(*roads), WINDOW, habits=Markings())
    strips = [shapely.LineString(road.line).buffer(road.width / 2, cap_style="flat") for road in roads[:2]]
    both = strips[0].intersection(strips[1]).buffer(-0.3)
    assert not any(both.intersects(shapely.Polygon(quad)) for group in quads for quad in group.corners)


@pytest.mark.parametrize(
    ("place", "marking"), [((47.49, 11.09), "broken_lines"), ((51.51, -0.09), "studs"), ((60.17, 24.94), "zebra")]
)
def test_crossings_with_signals_are_painted_as_the_country_does(place: tuple[float, float], marking: str) -> None:
    line = np.array([(0.0, -9.0), (0.0, 9.0)])
    way = OsmWay(7, [1, 2], line, False, {"highway": "footway", "crossing": "traffic_signals"})
    road = street(1, (-50.0, 0.0), (50.0, 0.0))
    plan = city(road)
    osm = OsmData(LocalFrame(*place), 60.0, 0.0, [], [way], [], [])
    found = crossings_of(osm, plan.carriageway, [road], [way])
    assert [crossing.marking for crossing in found] == [marking]
    said = OsmWay(7, [1, 2], line, False, {**way.tags, "crossing:markings": "ladder"})
    assert crossings_of(osm, plan.carriageway, [road], [said])[0].marking == "ladder"


@pytest.mark.parametrize("marking", ["zebra", "lines", "ladder", "dashes", "dots", "broken_lines", "studs"])
def test_every_marking_stays_on_the_crossing(marking: str) -> None:
    crossing = Crossing((0.0, -4.0), (0.0, 4.0), 3.6, True, marking)
    quads = np.stack(crossing_paint(crossing))
    assert np.abs(quads[..., 0]).max() < 1.9
    assert np.abs(quads[..., 1]).max() < 4.0


def test_footways_are_paved_as_usual_and_streets_as_the_map_says() -> None:
    usual = habits_at(40.72, -73.98).pavings
    assert look_of("sidewalk", usual).material == look_of("sidewalk:concrete", usual).material == "ground_flags"
    assert look_of("carriageway:concrete", usual).material == "ground_concrete"
    assert look_of("grass", usual) == LOOKS["grass"]
    assert look_of("sidewalk") == LOOKS["sidewalk"]


def test_every_paving_of_ours_is_a_material() -> None:
    for place in [(40.72, -73.98), (51.51, -0.09), (47.49, 11.09), (52.51, 13.39), (48.86, 2.35), (52.37, 4.9)]:
        usual = habits_at(*place).pavings
        for kind in ("sidewalk", "sidewalk:stones", "yard", "kerb", "tactile"):
            assert look_of(kind, usual).material.startswith("ground_")


def test_stones_lie_along_the_streets() -> None:
    turn = np.radians(29.0)
    along = np.array([np.cos(turn), np.sin(turn)]) * 80.0
    plan = city(street(1, (0.0, 0.0), tuple(along)), street(2, (0.0, 0.0), (-along[1], along[0])))
    assert street_bearing(plan) == pytest.approx(turn, abs=0.01)
    uv = look_of("sidewalk", bearing=float(turn)).uv(np.array([[0.0, 0.0], along / 20.0]))
    assert uv[1] == pytest.approx([1.0, 0.0], abs=1e-9)  # four metres, a picture


def test_ribbed_fields_lie_along_the_kerb_and_not_over_each_other() -> None:
    slanting = [Crossing((0.0, -4.0), (3.0, 4.0), 3.6, True), Crossing((0.6, -4.0), (-3.0, 4.0), 3.6, True)]
    plan = city(street(1, (-50.0, 0.0), (50.0, 0.0)), crossings=slanting)
    fields = tactile_fields(plan, WINDOW)
    assert fields
    assert all(plan.sidewalk.covers(field.buffer(-0.01)) for field in fields)
    assert all(field.distance(plan.carriageway) > 0.2 for field in fields)
    assert sum(field.area for field in fields) == pytest.approx(shapely.union_all(fields).area)


def test_trees_on_paving_stand_in_pits_and_those_on_lawns_do_not() -> None:
    walks = [shapely.box(0, 0, 5.5, 4), shapely.box(5.5, 0, 20, 4)]
    pieces = {"sidewalk:asphalt": walks, "grass": [shapely.box(0, 4, 20, 20)]}
    quads = tree_pits(np.array([(5.0, 2.0), (9.0, 12.0), (15.0, 3.9)]), pieces, 0.0)
    assert [len(group.corners) for group in quads] == [1, 1]
    assert quads[0].corners[0].mean(axis=0) == pytest.approx([5.0, 2.0])


def test_hydrants_signals_and_lamps_are_those_of_the_country() -> None:
    hydrant, pillar = {"emergency": "fire_hydrant"}, {"emergency": "fire_hydrant", "fire_hydrant:type": "pillar"}
    assert [thing_of(hydrant, where=where) for where in ("us", "de", "fr")] == [
        "fire_hydrant",
        "hydrant_lid",
        "hydrant_post",
    ]
    assert [thing_of(pillar, where=where) for where in ("us", "de")] == ["fire_hydrant", "hydrant_post"]
    assert thing_of({"highway": "traffic_signals"}, where="us") == "traffic_signals_yellow"
    assert thing_of({"highway": "street_lamp"}, where="us") == "street_lamp_cobra"
    assert thing_of({"highway": "street_lamp"}, where="fi") == "street_lamp"


def test_a_users_habits_replace_ours_and_wrong_ones_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "worldgen/streets"
    folder.mkdir(parents=True)
    ring = "[[139.0, 35.0], [141.0, 35.0], [141.0, 36.5], [139.0, 36.5]]"
    text = f'[[habits]]\nname = "jp"\ncountries = ["JP"]\noutlines = [{ring}]\n[habits.markings]\ndash = 5.0\n'
    (folder / "habits_japan.toml").write_text(text)
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    assert (habits_at(35.7, 139.7).name, habits_at(35.7, 139.7).markings.dash) == ("jp", 5.0)
    (folder / "habits_japan.toml").write_text(text + 'colour = "red"\n')
    monkeypatch.setenv(VARIABLE, str(tmp_path / "."))
    monkeypatch.setenv(VARIABLE, f"{tmp_path}/")
    with pytest.raises(SchemaError, match="habits_japan"):
        habits_at(35.7, 139.7)


def test_wires_hang_over_tram_tracks_and_are_held_by_walls_at_both_sides() -> None:
    track = OsmWay(5, [1, 2], np.array([(-50.0, 0.0), (50.0, 0.0)]), False, {"railway": "tram"})
    bare = OsmWay(6, [3, 4], np.array([(-50.0, 30.0), (50.0, 30.0)]), False, {"railway": "tram", "electrified": "no"})
    site = site_facts(OsmData(LocalFrame(60.17, 24.94), 60.0, 0.0, [], [track, bare], [], []))
    rows = [shapely.box(-60, 9, 60, 20), shapely.box(-60, -20, 60, -9)]
    wires = contact_wires(site, HeightField.flat(60.0), rows, 60.0)
    (wire,) = wires
    assert wire.positions[:, 2].min() > CONTACT - 0.1
    assert wire.positions[:, 2].max() > CONTACT + 1.0
    assert np.abs(wire.positions[:, 1]).max() == pytest.approx(9.0, abs=0.1)
    free = contact_wires(site, HeightField.flat(60.0), rows[:1], 60.0)
    assert np.abs(free[0].positions[:, 1]).max() < 0.1
    assert (
        contact_wires(
            site_facts(OsmData(LocalFrame(60.0, 25.0), 60.0, 0.0, [], [bare], [], [])),
            HeightField.flat(60.0),
            rows,
            60.0,
        )
        == []
    )


def test_rails_of_trams_beside_the_street_lie_as_high_as_the_ground_there() -> None:
    line = np.array([(-60.0, 0.0), (0.0, 0.0), (0.0, 60.0)])
    plan = replace(city(street(1, (-80.0, 0.0), (80.0, 0.0))), rails=[line])
    quads = [group for group in road_markings(plan, WINDOW) if group.colour == (134, 131, 127)]
    inside = {group.low: np.abs(group.corners[..., 1]).max(axis=1) <= 4.6 for group in quads}
    assert set(inside) == {True, False}
    assert inside[True].all()
    assert not inside[False].any()


def test_tracks_lie_on_sleepers_but_where_a_street_or_a_footway_leads_across() -> None:
    streets, window = city(street(1, (0.0, -30.0), (0.0, 30.0))), shapely.box(-50, -50, 50, 50)
    groups = road_markings(streets, window, tracks=[np.array([[-20.0, 0.0], [20.0, 0.0]])])
    # Rails beside the street lie as high as what is beside it; those across it are let in.
    sleepers = next(group.corners for group in groups if not group.low and group.rank == 0)
    rails = next(group.corners for group in groups if not group.low and group.rank == 1)
    across = next(group.corners for group in groups if group.low and group.rank == 2)
    assert np.abs(rails.mean(axis=1)[:, 0]).min() > 4.0
    assert np.abs(across[..., 0]).max() == pytest.approx(4.0, abs=1.0)
    assert len(sleepers) == pytest.approx((40.0 - 8.0 - 2 * 4.0) / 0.65, abs=3)
    assert np.abs(sleepers.mean(axis=1)[:, 0]).min() > 8.0
    assert (rails[..., 0].min(), rails[..., 0].max()) == (-20.0, 20.0)
    assert all(group.low for group in road_markings(streets, window))
