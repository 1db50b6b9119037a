"""Cities look like themselves: families of one country, their roofs, gables, oriels and chimneys."""

import itertools
import math

import numpy as np
import pytest
import shapely
from shapely import Polygon

from stages_alone import buildings_of
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmArea, OsmData, OsmWay
from vico.seeds import rng
from vico.world.check.buildings import coplanar_overlaps
from vico.world.mesh import Surface
from vico.world.model import FIRST_BUILDING
from vico.worldgen.buildings.details import height_of, party_wall_stacks, projections, ridge_chimneys
from vico.worldgen.buildings.roof_details import stepped_gables
from vico.worldgen.buildings.solids import Footing, part_mesh
from vico.worldgen.buildings.stage import clad, is_flat_town, with_customary_roofs
from vico.worldgen.facades.facade_styles import facade_style_of, family_of, region_of, styles
from vico.worldgen.facades.textures.materials import material
from vico.worldgen.facades.textures.walls import STOREYS
from vico.worldgen.facts.building_plans import BuildingPlan, PartPlan
from vico.worldgen.facts.roofs import Roof
from vico.worldgen.ground.terrain import flat_terrain

STREET = shapely.STRtree([shapely.LineString([(-40, -8), (40, -8)])])
HOUSE = shapely.box(0, 0, 7, 12)  # its front is the edge from (0, 0) to (7, 0)
CITIES = {
    "Paris": (48.86, 2.35), "Berlin": (52.52, 13.4), "London": (51.515, -0.12), "New York": (40.72, -73.99),
    "Helsinki": (60.17, 24.94), "Rome": (41.9, 12.48), "Lisbon": (38.71, -9.14), "Garmisch": (47.49, 11.1),
    "Amsterdam": (52.37, 4.9), "Moscow": (55.75, 37.62), "Chicago": (41.88, -87.63), "Tokyo": (35.68, 139.75),
}  # fmt: skip


def plan_of(
    polygon: Polygon = HOUSE, roof: Roof | None = None, *, tags: dict[str, str] | None = None, rule: str = "levels tag"
) -> BuildingPlan:
    part = PartPlan(polygon, 0.0, 13.2, 4, roof or Roof("hipped", 2.4), tags or {})
    return BuildingPlan("w1", None, "residential", tags or {}, polygon, 4, 0, [part], rule=rule)


def roofed(plan: BuildingPlan, wall: str, region: str, **more: bool) -> PartPlan:
    return with_customary_roofs(plan, wall, STREET, region=region, random=rng(0, "roof"), **more).parts[0]


def commonest(place: tuple[float, float]) -> str:
    """Return what most old houses of a place wear."""
    old = styles().region(region_of(*place)).streets.old
    return max(old, key=lambda name: old[name])


def test_old_houses_of_twelve_cities_wear_twelve_things() -> None:
    assert len({commonest(place) for place in CITIES.values()}) == len(CITIES)


def test_what_is_said_to_be_of_one_country_says_from_where_that_is_known() -> None:
    told = [family for family in styles().families.values() if family.source]
    assert len(told) >= 15
    assert all(len(family.source.split()) > 8 for family in told)
    assert all(family.source for family in styles().families.values() if family.by_storey)


def test_brick_means_what_it_means_in_its_country() -> None:
    def wall(region: str) -> str:
        return family_of("residential", {"building:material": "brick"}, levels=4, area=200, region=region, draw=(0, 0))

    assert wall("british") == "wall_georgian"
    assert wall("low_countries") == "wall_canal_house"
    assert wall("northern") == "wall_brick"


def street(lat: float, lon: float, count: int = 10, **tags: str) -> OsmData:
    """Return a row of old houses along a street."""
    areas = [
        OsmArea(f"w{k + 1}", shapely.box(8 * k, 0, 8 * k + 8, 12), {
            "building": "apartments", "building:levels": str(4 + k % 2), "start_date": "1880", **tags})
        for k in range(count)
    ]  # fmt: skip
    line = np.array([(-40.0, -8.0), (8.0 * count + 40, -8.0)])
    ways = [OsmWay(900, [1, 2], line, False, {"highway": "residential"})]
    return OsmData(LocalFrame(lat, lon), 150.0, 60.0, [], ways, areas, [])


@pytest.mark.parametrize("city", ["Amsterdam", "London", "Berlin", "Helsinki", "Paris", "New York"])
def test_a_street_of_each_is_closed_and_has_no_flickering_faces(city: str) -> None:
    town = street(*CITIES[city])
    built = buildings_of(town, flat_terrain(half=150.0), seed=0)
    assert built.watertight == 10
    cladding = clad(built.bare, town, seed=0)
    corners = np.concatenate([s.positions[s.triangles] for s in (*cladding.walls, *cladding.roofs)])
    assert coplanar_overlaps(corners).flickering == 0


def test_the_lowest_row_of_a_picture_by_storey_is_the_first_floor() -> None:
    town = street(*CITIES["London"])
    built = buildings_of(town, flat_terrain(half=150.0), seed=0)
    (georgian,) = (
        surface for surface in clad(built.bare, town, seed=0).walls if surface.material.name == "wall_georgian"
    )
    upright = georgian.positions[:, 2] < 4.6  # a floor of 3.5 or 4 m below
    phase = georgian.uv[upright, 1] * STOREYS % STOREYS
    assert upright.any()
    assert np.minimum(phase, STOREYS - phase).max() < 0.2


def test_paris_has_mansards_and_amsterdam_gables_to_the_street() -> None:
    assert roofed(plan_of(), "wall_french", "french").roof.shape == "mansard"
    canal = roofed(plan_of(), "wall_canal_house", "low_countries")
    assert canal.roof.shape == "gabled"
    assert abs(math.sin(canal.roof.direction or 0.0)) == pytest.approx(1.0)
    assert canal.eaves == 13.2
    assert canal.roof.height > 3.0
    london = roofed(plan_of(roof=Roof("gabled", 2.0)), "wall_victorian", "british").roof
    assert london.shape != "gabled" or abs(math.cos(london.direction or 0.0)) == pytest.approx(1.0)


def test_what_the_map_says_of_a_roof_stays() -> None:
    for tags in ({"roof:shape": "hipped"}, {"roof:height": "2.4"}, {"roof:levels": "1"}):
        plan = plan_of(tags=tags)
        assert roofed(plan, "wall_french", "french") == plan.parts[0]
    told = plan_of(rule="height tag")
    for wall, region in (("wall_french", "french"), ("wall_large_panels", "eastern"), ("wall_jugend", "finnish")):
        assert roofed(told, wall, region).top == pytest.approx(told.parts[0].top, abs=0.7)


def test_a_flat_roof_that_nobody_mapped_is_pitched_in_a_town_of_pitched_roofs() -> None:
    flat = plan_of(roof=Roof("flat", 0.7))
    assert roofed(flat, "wall_jugend", "finnish").roof.shape in ("mansard", "gabled", "hipped")
    assert roofed(flat, "wall_jugend", "finnish", flat_town=True).roof.shape == "flat"
    assert roofed(plan_of(), "wall_grid", "finnish").roof.shape == "flat"
    below = PartPlan(HOUSE, 0.0, 7.0, 2, Roof("flat", 0.0), {})
    stacked = BuildingPlan(
        "w1", None, "office", {}, HOUSE, 4, 0, [below, PartPlan(HOUSE, 7.0, 13.2, 2, Roof("flat", 0.6), {})]
    )
    for wall in ("wall_jugend", "wall_grid"):
        assert roofed(stacked, wall, "finnish") == below
    assert is_flat_town([flat, flat, plan_of()])
    assert not is_flat_town([flat, plan_of(), plan_of()])


def test_a_stepped_gable_rises_in_steps_before_the_roof() -> None:
    plan = plan_of(roof=Roof("gabled", 4.0, math.pi / 2))
    front = np.array([edge == 0 for edge in range(4)])
    start = np.asarray(shapely.orient_polygons(HOUSE).exterior.coords)[:-1]
    along = np.roll(start, -1, axis=0) - start
    front = (start[:, 1] == 0) & (along[:, 1] == 0)
    steps = stepped_gables(plan, [front])
    assert len(steps) == 4
    assert all(a.eaves == b.low and a.polygon.area > b.polygon.area for a, b in itertools.pairwise(steps))
    assert steps[0].low == plan.parts[0].eaves
    assert steps[-1].eaves > plan.parts[0].top
    assert stepped_gables(plan_of(roof=Roof("hipped", 4.0)), [front]) == []


@pytest.mark.parametrize("shape", ["gabled", "hipped", "mansard"])
def test_no_chimney_is_higher_than_its_roof_asks(shape: str) -> None:
    part = PartPlan(shapely.box(0, 0, 24, 14), 0.0, 12.0, 4, Roof(shape, 5.0), {})
    mesh = part_mesh(part, Footing(-0.3, 0.0))
    for seed in range(12):
        for chimney in ridge_chimneys(part, part.polygon, mesh, 0.0, rng(seed, "chimney")):
            around = max(height_of(mesh, xy) for xy in np.asarray(chimney.polygon.exterior.coords)[:4, :2])
            assert 0.7 < chimney.eaves - around < 1.9
            assert chimney.polygon.area < 0.5


def test_british_stacks_carry_pots_and_stand_inside_the_walls_between_houses() -> None:
    part = PartPlan(HOUSE, 0.0, 12.0, 4, Roof("gabled", 3.0, 0.0), {})
    start = np.asarray(shapely.orient_polygons(HOUSE).exterior.coords)[:-1]
    front = (start[:, 1] == 0) & (np.roll(start, -1, axis=0)[:, 1] == 0)
    mesh = part_mesh(part, Footing(-0.3, 0.0))
    made = party_wall_stacks(part, HOUSE, mesh, 0.0, front, rng(0, "stacks"))
    assert [solid.finish for solid in made] == ["chimney", "pots"] * 2
    for stack in made[::2]:
        assert HOUSE.contains(stack.polygon)
        assert min(stack.polygon.bounds[0], 7.0 - stack.polygon.bounds[2]) < 0.1


def test_oriels_are_canted_hang_above_heads_and_wear_the_colour_of_their_wall() -> None:
    plan = plan_of(shapely.box(0, 0, 18, 12))
    look = facade_style_of(
        "residential", {"start_date": "1890"}, levels=4, area=600.0, region="german", random=rng(0, "x")
    )
    look = look.__class__(**{**look.__dict__, "wall": "wall_tenement_palace", "bay": 2.5})
    front = [np.ones(4, bool)]
    made = [
        piece
        for seed in range(8)
        for piece in projections(plan, look, front, lambda *_: True, "german", rng(seed, "hung"))
    ]
    oriels = [piece for piece in made if piece.finish == "oriel"]
    assert oriels
    assert any(piece.finish == "rail_iron" for piece in made)
    for oriel in oriels:
        assert oriel.low > 2.9
        assert oriel.levels >= 1
        assert oriel.polygon.intersection(plan.outline).area < 1e-6
        assert oriel.polygon.area < 0.9 * oriel.polygon.minimum_rotated_rectangle.area
    assert styles().finishes["oriel"].as_wall
    town = street(*CITIES["Berlin"])
    drawn = clad(buildings_of(town, flat_terrain(half=150.0), seed=0).bare, town, seed=0).walls
    walls = {tuple(c) for s in drawn if s.material.name == "wall_tenement_palace" for c in _colours(s)}
    shown = {tuple(c) for s in drawn if s.material.name == "oriel" for c in _colours(s)}
    assert shown
    assert shown <= walls


def _colours(surface: Surface) -> np.ndarray:
    return np.unique(surface.colour[surface.entity >= FIRST_BUILDING], axis=0)


@pytest.mark.parametrize("name", ["ground_shops", "ground_cafes"])
def test_a_shop_that_nobody_named_has_no_empty_board(name: str) -> None:
    texture = material(name).texture
    assert texture is not None
    band = texture[196:214, 40:216, :3].astype(float).mean(axis=2)  # where a fascia would be
    assert band.std(axis=1).min() > 4.0
