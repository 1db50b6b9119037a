"""What is decided of a building before it is built: what counts, how high, what rests on what."""

import math
from collections.abc import Mapping
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import shapely
from shapely import MultiPolygon, Polygon

from stages_alone import buildings_of
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmArea, OsmData, OsmWay
from vico.geo.overlay import OverlayError
from vico.worldgen.buildings.stage import buildings_from_plans
from vico.worldgen.facts import building_outlines
from vico.worldgen.facts.building_outlines import building_plans, without_needles
from vico.worldgen.facts.building_plans import RULES, BuildingPlan, bearing_of
from vico.worldgen.ground.terrain import flat_terrain

Things = list[tuple[Polygon | MultiPolygon, Mapping[str, str]]]


def town(things: Things, streets: list[list[tuple[float, float]]] | None = None) -> OsmData:
    areas = [OsmArea(f"w{k}", shape, dict(tags)) for k, (shape, tags) in enumerate(things, 1)]
    ways = [
        OsmWay(9000 + k, [], np.array(line, float), False, {"highway": "residential"})
        for k, line in enumerate(streets or [])
    ]
    return OsmData(LocalFrame(50.0, 8.0), 100.0, 60.0, [], ways, areas, [])


def planned(things: Things, **more: list[list[tuple[float, float]]]) -> dict[str, BuildingPlan]:
    return {plan.id: plan for plan in building_plans(town(things, **more), seed=0).plans}


def reasons(things: Things) -> dict[str, str]:
    return {item.id: item.reason for item in building_plans(town(things), seed=0).dropped}


def test_what_is_no_building_here_is_left_out_with_its_reason() -> None:
    said = reasons(
        [
            (shapely.box(0, 0, 1, 1), {"building": "yes"}),
            (shapely.box(90, 0, 130, 9), {"building": "yes"}),
            (shapely.box(0, 20, 9, 29), {"building": "yes", "location": "underground"}),
            (shapely.box(20, 20, 29, 29), {"building": "yes", "layer": "-1"}),
            (shapely.box(40, 0, 50, 9), {"building": "yes"}),
            (shapely.box(40, 20, 50, 29), {"building": "yes", "level": "-1"}),
            (shapely.box(60, 20, 70, 29), {"building": "yes", "indoor": "room"}),
        ]
    )
    assert said["w1"] == "smaller than 2 m2"
    assert "outside" in said["w2"]
    assert said["w3"] == "underground"
    assert "w4" not in said  # layer alone says nothing of the ground
    assert "w5" not in said
    assert said["w6"] == "underground"
    assert said["w7"] == "indoors"


SPIKED = [
    # Out to a point and back, outwards and inwards; from corners in the wrong order; to a courtyard.
    Polygon([(0, 0), (12, 0), (12, 5), (30, 5.0), (12, 5.01), (12, 10), (0, 10)]),
    Polygon([(0, 0), (12, 0), (12, 5), (3, 5.0), (12, 5.01), (12, 10), (0, 10)]),
    Polygon([(0, 0), (12, 0), (12, 10.06), (0, 10), (25, 10.08)]).buffer(0),
    Polygon([(0, 0), (12, 0), (12, 10), (0, 10)], [[(0.002, 5), (6, 5.005), (6, 8), (3, 8), (3, 5.006)]]),
]


@pytest.mark.parametrize("drawn", SPIKED)
def test_spikes_and_slits_of_an_outline_are_no_walls(drawn: Polygon) -> None:
    (part,) = planned([(drawn, {"building": "yes"})])["w1"].parts
    assert abs(part.polygon.area - drawn.area) < 0.2
    for thin in (-0.05, 0.05):  # nothing of it, and nothing beside it, is thinner than a hand
        through = part.polygon.buffer(thin, join_style="mitre").buffer(-thin, join_style="mitre")
        assert through.symmetric_difference(part.polygon).area < 0.01


def test_an_outline_without_spikes_stays_as_it_is_drawn() -> None:
    for drawn in ([(0, 0), (40, 0), (0, 8)], [(0, 0), (20, 0), (20, 0.15), (0, 0.15)]):  # a wedge; a wall
        polygon = Polygon(drawn)
        assert without_needles(polygon) is polygon


def test_a_building_over_the_edge_with_its_middle_inside_stays_whole() -> None:
    assert planned([(shapely.box(70, 0, 120, 9), {"building": "yes"})])["w1"].outline.bounds[2] == pytest.approx(120)


def test_a_bow_tie_is_mended_into_its_two_triangles() -> None:
    plans = planned([(Polygon([(0, 0), (10, 10), (10, 0), (0, 10)]), {"building": "yes"})])
    assert sorted(plans) == ["w1.1", "w1.2"]
    assert sum(plan.outline.area for plan in plans.values()) == pytest.approx(50.0)


def test_three_thousand_corners_are_simplified_within_five_centimetres() -> None:
    ring = [(30 * math.cos(a), 20 * math.sin(a)) for a in np.linspace(0, 2 * math.pi, 3001)[:-1]]
    plan = planned([(Polygon(ring), {"building": "yes"})])["w1"]
    part = plan.parts[0].polygon
    assert len(part.exterior.coords) < 200
    assert shapely.hausdorff_distance(part, Polygon(ring)) < 0.07


def test_an_outline_that_begins_above_its_parts_leaves_nothing_upside_down() -> None:
    # Central Helsinki, way 29072452: an outline from the second storey on, with raised parts below that in it.
    things: Things = [
        (shapely.box(0, 0, 30, 30), {"building": "yes", "building:levels": "4", "building:min_level": "2"}),
        (shapely.box(0, 0, 30, 20), {"building:part": "yes", "building:levels": "3"}),
        (shapely.box(2, 21, 12, 29), {"building:part": "yes", "building:levels": "4", "building:min_level": "1"}),
    ]
    plan = planned(things)["w1"]
    assert all(part.eaves > part.low for part in plan.parts)
    result = buildings_of(town(things), flat_terrain(half=100), seed=0)
    assert result.watertight == len(result.records) == 1


def test_a_hole_of_a_multipolygon_stays_open() -> None:
    ring = Polygon(shapely.box(0, 0, 40, 30).exterior.coords, [shapely.box(12, 10, 28, 20).exterior.coords])
    built = buildings_of(town([(ring, {"building": "yes"})]), flat_terrain(half=100.0), seed=0)
    assert len(built.records[0].footprint) == 2
    assert built.watertight == 1


def test_heights_are_decided_in_the_order_of_the_rules() -> None:
    big = {"building": "apartments"}
    plans = planned(
        [
            (shapely.box(0, 0, 15, 15), {**big, "height": "20", "building:levels": "9"}),
            (shapely.box(20, 0, 35, 15), {**big, "building:levels": "6"}),
            (shapely.box(40, 0, 55, 15), {**big, "building:levels": "6"}),
            (shapely.box(60, 0, 75, 15), big),
            (shapely.box(60, 30, 65, 34), {"building": "garage"}),
            (shapely.box(0, 40, 15, 55), {"building": "house"}),
            (shapely.box(0, 70, 15, 85), {"building": "yes"}),
            (shapely.box(0, 70, 15, 85), {"building:part": "yes", "building:levels": "3"}),
        ]
    )
    assert plans["w1"].parts[0].top == pytest.approx(20.0, abs=1.1)
    rules = {name: plan.rule for name, plan in plans.items()}
    assert rules == {
        "w1": "height tag",
        "w2": "levels tag",
        "w3": "levels tag",
        "w4": "neighbours",
        "w5": "kind",
        "w6": "neighbours",
        "w7": "parts",
    }
    assert set(rules.values()) <= set(RULES)
    assert plans["w4"].levels in (5, 6, 7)
    assert plans["w5"].parts[0].eaves < 3.0


def test_nothing_known_anywhere_is_the_town_s_usual_height() -> None:
    plans = planned([(shapely.box(0, 0, 15, 15), {"building": "yes"})])
    assert plans["w1"].rule == "town"


def test_rules_are_counted() -> None:
    osm = town([(shapely.box(0, 0, 9, 9), {"building": "yes", "height": "7"})])
    assert buildings_of(osm, flat_terrain(half=100.0), seed=0).rules == {"height tag": 1}


def test_plans_can_be_changed_before_they_are_built() -> None:
    from dataclasses import replace

    osm = town([(shapely.box(0, 0, 9, 9), {"building": "yes", "roof:shape": "flat"})])
    decided = building_plans(osm, seed=0)
    raised = [replace(p, parts=[replace(part, eaves=33.0) for part in p.parts]) for p in decided.plans]
    built = buildings_from_plans(replace(decided, plans=raised), osm, flat_terrain(half=100.0), seed=0)
    assert built.records[0].height == pytest.approx(33.0, abs=1.1)


OUTLINE = {"building": "yes", "building:levels": "3", "roof:shape": "flat"}


def solids(plan: BuildingPlan) -> list[tuple[float, float]]:
    return sorted((round(part.low, 1), round(part.eaves, 1)) for part in plan.parts)


def test_a_lower_part_goes_on_under_one_that_juts_into_it() -> None:
    plan = planned(
        [
            (shapely.box(0, 0, 30, 20), OUTLINE),
            (shapely.box(0, 0, 30, 20), {"building:part": "yes", "height": "20", "roof:shape": "flat"}),
            (shapely.box(10, 5, 20, 15), {"building:part": "yes", "height": "40", "min_height": "12"}),
        ]
    )["w1"]
    volume = sum(part.polygon.area * (part.eaves - part.low) for part in plan.parts if part.roof.shape == "flat")
    assert volume > 0
    for i, one in enumerate(plan.parts):
        for other in plan.parts[i + 1 :]:
            apart = one.low >= other.top - 0.02 or other.low >= one.top - 0.02
            assert apart or shapely.intersection(one.polygon, other.polygon).area < 0.03
    assert (0.0, 12.0) in solids(plan)


def test_a_part_above_nothing_comes_down() -> None:
    plan = planned(
        [
            (shapely.box(0, 0, 30, 20), {"building": "yes"}),
            (shapely.box(0, 0, 15, 20), {"building:part": "yes", "height": "12"}),
            (shapely.box(15, 0, 30, 20), {"building:part": "yes", "height": "30", "min_height": "25"}),
        ]
    )["w1"]
    assert min(part.low for part in plan.parts if part.polygon.centroid.x > 15) == 0.0


def test_a_bridge_between_two_houses_over_a_street_stays_up() -> None:
    bridge = {"building:part": "yes", "height": "12", "min_height": "8", "roof:shape": "flat"}
    plans = planned(
        [
            (shapely.box(-20, 0, 0, 10), {"building": "yes", "height": "20", "roof:shape": "flat"}),
            (shapely.box(6, 0, 26, 10), {"building": "yes", "height": "20", "roof:shape": "flat"}),
            (shapely.box(0, 3, 6, 7), {**bridge, "building": "yes"}),
        ],
        streets=[[(3, -30), (3, 40)]],
    )
    assert plans["w3"].parts[0].low == pytest.approx(8.0)


@pytest.mark.parametrize("low", ["0.4", "1.95"])
def test_nothing_hangs_where_nobody_could_walk_below(low: str) -> None:
    fixed = {"building": "yes", "height": "9", "min_height": low}
    plans = planned(
        [(shapely.box(0, 0, 10, 10), {"building": "yes", "height": "9"}), (shapely.box(10, 0, 14, 10), fixed)]
    )
    assert plans["w2"].parts[0].low == 0.0


def test_a_part_tagged_a_little_too_high_is_let_down_on_what_it_rests_on() -> None:
    plan = planned(
        [
            (shapely.box(0, 0, 30, 20), {"building": "yes"}),
            (shapely.box(0, 0, 30, 20), {"building:part": "yes", "height": "10", "roof:shape": "flat"}),
            (shapely.box(5, 5, 25, 15), {"building:part": "yes", "height": "18", "min_height": "11"}),
        ]
    )["w1"]
    assert sorted(round(part.low, 2) for part in plan.parts) == [0.0, 10.0]


@pytest.mark.parametrize(
    ("text", "bearing"),
    [("135", 135.0), ("135°", 135.0), ("SW", 225.0), ("north_west", 315.0), ("South-East", 135.0), ("up", None)],
)
def test_bearings_are_read_in_degrees_and_words(text: str, bearing: float | None) -> None:
    assert bearing_of(text) == bearing


def test_an_outline_its_parts_cover_partly_keeps_the_rest() -> None:
    plan = planned(
        [
            (shapely.box(0, 0, 30, 20), OUTLINE),
            (shapely.box(0, 0, 10, 20), {"building:part": "yes", "height": "30", "roof:shape": "flat"}),
        ]
    )["w1"]
    assert sum(part.polygon.area for part in plan.parts) == pytest.approx(600.0, abs=1.0)


def test_what_goes_on_under_a_part_has_no_sliver_beside_another() -> None:
    plan = planned(
        [
            (shapely.box(0, 0, 30, 20), {"building": "yes", "height": "4"}),
            # As maps have it, a part ends a little before the outline: the lower storey would go on as a thin wall.
            (shapely.box(0, 0, 20, 19.95), {"building:part": "yes", "height": "10"}),
            (shapely.box(0, 0, 30, 20), {"building:part": "yes", "height": "12", "min_height": "4"}),
        ]
    )["w1"]
    low = [part.polygon for part in plan.parts if part.low == 0.0]
    assert sorted(round(polygon.area) for polygon in low) == [200, 399]
    assert all(len(polygon.exterior.coords) == 5 for polygon in low)


@pytest.mark.parametrize(
    ("module", "function"),
    [
        (building_outlines, "_settle_part"),
        (building_outlines, "_beside"),
        (building_outlines, "_pieces"),
        (building_outlines, "part_of"),
    ],
)
def test_an_outline_that_cant_be_cut_costs_its_building_alone(
    module: ModuleType, function: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = getattr(module, function)

    def failing(first: Any, *more: Any) -> Any:
        polygon = getattr(first, "polygon", first)
        if polygon.intersects(shapely.Point(5, 5)):
            raise OverlayError("side location conflict")
        return made(first, *more)

    monkeypatch.setattr(module, function, failing)
    levels = {"building": "yes", "building:levels": "5", "building:min_level": "3"}
    osm = town([(shapely.box(0, 0, 9, 9), levels), (shapely.box(8, 0, 20, 9), {"building": "yes", "height": "30"})])
    decided = building_plans(osm, seed=0)
    assert [plan.id for plan in decided.plans] == ["w2"]
    assert [(entry.id, entry.reason) for entry in decided.dropped] == [
        ("w1", "can't be made: OverlayError: side location conflict")
    ]
