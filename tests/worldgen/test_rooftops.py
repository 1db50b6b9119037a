"""Cornices, chimneys, penthouses and posts: clear of each other and of what stands beside."""

import numpy as np
import shapely

from stages_alone import buildings_of
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmArea, OsmData
from vico.seeds import rng
from vico.world.check.buildings import coplanar_overlaps
from vico.worldgen.buildings.details import cornices, posts, rooftop_parts
from vico.worldgen.buildings.solids import Footing, part_mesh
from vico.worldgen.buildings.stage import clad
from vico.worldgen.facts.building_plans import BuildingPlan, PartPlan
from vico.worldgen.facts.roofs import Roof
from vico.worldgen.ground.terrain import flat_terrain


def plan_of(name: str, *parts: PartPlan) -> BuildingPlan:
    return BuildingPlan(name, None, "residential", {}, parts[0].polygon, 3, 0, list(parts))


def house(west: float, east: float, eaves: float = 10.0) -> BuildingPlan:
    return plan_of(f"w{west:.0f}", PartPlan(shapely.box(west, 0, east, 12), 0.0, eaves, 3, Roof("hipped", 3.0), {}))


def test_cornices_of_a_row_do_not_meet_nor_enter_the_next_house() -> None:
    row = [house(0, 12), house(12, 24), house(24, 36, eaves=16.0)]
    ledges = cornices(row, ["wall_classic"] * 3, [0.0] * 3, dropped=[])
    assert all(ledges)
    shapes = [shapely.union_all([ledge.polygon for ledge in mine]) for mine in ledges]
    assert shapely.intersection(shapes[0], shapes[1]).area == 0.0
    assert shapely.intersection(shapes[1], row[2].outline).area == 0.0
    # It runs along the street right up to the next house.
    assert shapes[0].bounds[2] > 11.9


def test_plain_walls_have_no_cornice() -> None:
    assert cornices([house(0, 12)], ["wall_glass"], [0.0], dropped=[]) == [[]]


def test_a_canopy_stands_on_posts_that_keep_off_the_street() -> None:
    canopy = plan_of("w1", PartPlan(shapely.box(0, 0, 20, 10), 4.0, 4.5, 0, Roof("flat", 0.0), {}))
    free = posts(canopy, shapely.STRtree([]))
    assert len(free) >= 6
    assert all(post.low == 0.0 and post.eaves > 4.0 and canopy.outline.contains(post.polygon) for post in free)
    street = shapely.LineString([(10, -20), (10, 30)])
    beside = posts(canopy, shapely.STRtree([street]))
    assert 0 < len(beside) < len(free)
    assert min(street.distance(post.polygon) for post in beside) >= 3.0


def test_nothing_is_put_where_another_part_stands() -> None:
    base = PartPlan(shapely.box(0, 0, 60, 40), 0.0, 10.0, 3, Roof("flat", 0.6), {})
    tower = PartPlan(shapely.box(10, 8, 50, 32), 10.0, 40.0, 9, Roof("flat", 0.6), {})
    for seed in range(5):
        plan, fronts = plan_of("w1", base, tower), [np.zeros(4, bool)] * 2
        meshes = [part_mesh(part, Footing(-1.0, 0.0)) for part in plan.parts]
        made = rooftop_parts(plan, meshes, 0.0, fronts, rng(seed, "rooftop"), region="german")
        low = [solid for solid in made if solid.low < 11.0]
        assert all(shapely.intersection(solid.polygon, tower.polygon).area == 0.0 for solid in low)


def test_a_street_of_stacked_and_touching_houses_has_no_flickering_faces() -> None:
    areas = []
    for k in range(6):
        shape = shapely.box(12 * k, 0, 12 * k + 12, 14)
        tags = {"building": "apartments", "building:levels": str(3 + k % 2), "roof:shape": ("flat", "gabled")[k % 2]}
        areas.append(OsmArea(f"w{k + 1}", shape, tags))
        stair = shapely.box(12 * k + 4, 4, 12 * k + 8, 14)
        areas.append(OsmArea(f"w{k + 50}", stair, {"building:part": "yes", "height": "22", "min_height": "6"}))
    osm = OsmData(LocalFrame(50.0, 8.0), 100.0, 60.0, [], [], areas, [])
    built = buildings_of(osm, flat_terrain(half=100.0), seed=0)
    assert built.watertight == 6
    cladding = clad(built.bare, osm, seed=0)
    corners = np.concatenate([s.positions[s.triangles] for s in (*cladding.walls, *cladding.roofs)])
    assert coplanar_overlaps(corners).flickering == 0
