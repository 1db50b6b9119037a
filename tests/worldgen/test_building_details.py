"""Eaves, dormers, balconies, fire escapes and tanks: closed, outside the walls, clear of neighbours and of lanes."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import Polygon

from stages_alone import buildings_of
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmArea, OsmData
from vico.seeds import rng
from vico.world.check.buildings import coplanar_overlaps, open_edges
from vico.worldgen.buildings.details import projections, water_tank
from vico.worldgen.buildings.roof_details import dormers, eaves, edges_of, slopes_of
from vico.worldgen.buildings.solids import Footing, Mesh, part_mesh
from vico.worldgen.buildings.stage import clad
from vico.worldgen.buildings.walls import cut_at_heights, storeys_of, without_needless
from vico.worldgen.facades.facade_styles import FacadeStyle, distinct_styles, facade_style_of, styles
from vico.worldgen.facades.textures.materials import PAINTERS
from vico.worldgen.facts.building_plans import BuildingPlan, PartPlan
from vico.worldgen.facts.roofs import Roof
from vico.worldgen.ground.terrain import flat_terrain

NO_STREETS = shapely.STRtree([])
L_SHAPE = Polygon([(0, 0), (20, 0), (20, 9), (9, 9), (9, 18), (0, 18)])


def plan_of(
    polygon: Polygon, roof: Roof, *, levels: int = 3, use: str = "residential", name: str = "w1"
) -> BuildingPlan:
    part = PartPlan(polygon, 0.0, 3.3 * levels, levels, roof, {})
    return BuildingPlan(name, None, use, {}, polygon, levels, 0, [part])


def fringes(
    plans: list[BuildingPlan], *, reach: float = 0.5, streets: shapely.STRtree = NO_STREETS
) -> list[list[PartPlan]]:
    meshes = [[part_mesh(part, Footing(-0.3, 0.0)) for part in plan.parts] for plan in plans]
    return eaves(plans, meshes, [0.0] * len(plans), [reach] * len(plans), ["eaves"] * len(plans), streets, dropped=[])


def mesh_of(part: PartPlan) -> Mesh:
    return part_mesh(part, Footing(-0.3, 0.0))


def volume(mesh: Mesh) -> float:
    a, b, c = (mesh[0][mesh[1][:, k]] for k in range(3))
    return float(np.einsum("ni,ni->n", a, np.cross(b, c)).sum() / 6.0)


def look(wall: str, region: str) -> FacadeStyle:
    tags = {"building:material": {"wall_brick": "brick"}.get(wall, "")}
    made = facade_style_of("residential", tags, levels=5, area=300.0, region=region, random=rng(0, "look"))
    return made.__class__(**{**made.__dict__, "wall": wall, "bay": 3.0, "hall": False})


def hung(wall: str, region: str, *, levels: int = 6, area: Polygon | None = None) -> list[PartPlan]:
    """What hangs on all sides of a block, over several draws."""
    plan = plan_of(area or shapely.box(0, 0, 18, 14), Roof("flat", 0.6), levels=levels)
    front = [np.ones(len(edges_of(plan.parts[0].polygon).start), bool)]
    made = []
    for seed in range(6):
        made += projections(plan, look(wall, region), front, lambda *_: True, region, rng(seed, "hung"))
    return made


@pytest.mark.parametrize("shape", ["gabled", "hipped", "half-hipped", "gambrel", "saltbox", "skillion", "pyramidal"])
@pytest.mark.parametrize("polygon", [shapely.box(0, 0, 16, 10), L_SHAPE], ids=["box", "wings"])
def test_a_roof_reaches_out_over_all_its_walls_and_no_further(shape: str, polygon: Polygon) -> None:
    if shape == "pyramidal" and polygon is L_SHAPE:
        assert fringes([plan_of(polygon, Roof(shape, 2.4))]) == [[]]  # its faces are twisted: no plane to go on in
        return
    (made,) = fringes([plan_of(polygon, Roof(shape, 2.4))])
    (fringe,) = made
    assert fringe.mesh is not None
    points, faces = fringe.mesh
    assert not open_edges(faces).any()
    assert volume(fringe.mesh) > 0.0
    away = shapely.distance(polygon.exterior, shapely.points(points[:, :2]))
    assert away.max() < 0.5 * 2.3
    inside = shapely.buffer(polygon, -0.05).contains(shapely.points(points[:, :2]))
    assert not inside.any()
    # Each wall has some of it over the pavement.
    edges = edges_of(polygon)
    covered = shapely.MultiPoint(points[:, :2]).convex_hull
    middles = edges.start + edges.along * edges.length[:, None] / 2 + edges.out * 0.2
    assert covered.contains(shapely.points(middles)).sum() >= len(middles) - (2 if shape == "skillion" else 1)


@settings(max_examples=25, deadline=None)
@given(st.floats(7.0, 30.0), st.floats(6.0, 14.0), st.floats(1.2, 5.0), st.floats(0.0, 3.1), st.sampled_from(
    ["gabled", "hipped", "half-hipped", "gambrel"]))  # fmt: skip
def test_eaves_lie_in_the_planes_of_their_slopes(long: float, wide: float, rise: float, yaw: float, shape: str) -> None:
    c, s = np.cos(yaw), np.sin(yaw)
    corners = np.array([(0, 0), (long, 0), (long, wide), (0, wide)]) @ np.array([[c, s], [-s, c]])
    plan = plan_of(Polygon(corners), Roof(shape, rise))
    body = mesh_of(plan.parts[0])
    (made,) = fringes([plan])
    if not made:  # a spire's slopes have none; a gambrel's lower ones are the steeper
        assert rise / (min(long, wide) / 2) * (1.82 if shape == "gambrel" else 1.0) > 1.0
        return
    slopes = slopes_of(body, edges_of(plan.parts[0].polygon), plan.parts[0].eaves)
    points, faces = mesh_of(made[0])
    corner = points[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    size = np.linalg.norm(normal, axis=1)
    upper = (normal[:, 2] > 0.2 * size) & (size > 1e-3)
    for face in corner[upper]:
        off = min(float(np.abs(face[:, 2] - slope.height(face[:, :2])).max()) for slope in slopes)
        assert off < 0.02
    assert not open_edges(faces).any()


def test_no_eaves_over_a_shared_wall_nor_into_the_neighbour() -> None:
    row = [plan_of(shapely.box(10 * k, 0, 10 * k + 10, 9), Roof("gabled", 3.0), name=f"w{k}") for k in range(3)]
    made = fringes(row)
    for k, mine in enumerate(made):
        for fringe in mine:
            points = shapely.points(mesh_of(fringe)[0][:, :2])
            others = [shapely.buffer(plan.outline, -0.005) for j, plan in enumerate(row) if j != k]
            assert not any(other.contains(points).any() for other in others)
    corners = np.concatenate([m[0][m[1]] for plan, mine in zip(row, made, strict=True)
                              for m in (*map(mesh_of, plan.parts), *map(mesh_of, mine))])  # fmt: skip
    assert coplanar_overlaps(corners).flickering == 0


def test_low_eaves_keep_off_a_lane_and_off_heads() -> None:
    low = plan_of(shapely.box(0, 0, 12, 8), Roof("gabled", 2.0), levels=1)
    assert fringes([low])[0]
    lane = shapely.STRtree([shapely.LineString([(-10, -2), (30, -2)])])
    (made,) = fringes([low], streets=lane)
    lowest = [mesh_of(fringe)[0] for fringe in made]
    assert all(points[points[:, 1] < -0.05, 2].min(initial=9.0) >= 3.2 - 0.01 for points in lowest)
    shed = PartPlan(shapely.box(0, 0, 12, 8), 0.0, 2.0, 1, Roof("gabled", 2.0), {})
    assert fringes([BuildingPlan("w1", None, "other", {}, shed.polygon, 1, 0, [shed])]) == [[]]


@pytest.mark.parametrize("shape", ["gabled", "hipped", "mansard"])
def test_dormers_stand_on_long_steep_slopes_with_their_window_outwards(shape: str) -> None:
    plan = plan_of(shapely.box(0, 0, 30, 11), Roof(shape, 4.4))
    made = [d for seed in range(4) for d in dormers(plan, [mesh_of(plan.parts[0])], 0.0, [], "german", rng(seed, "d"))]
    assert made
    body = shapely.box(0, 0, 30, 11)
    for dormer in made:
        assert dormer.mesh is not None
        assert not open_edges(dormer.mesh[1]).any()
        assert volume(dormer.mesh) > 0.0
        assert body.contains(dormer.polygon)
        assert dormer.top < plan.parts[0].top
        first = np.asarray(dormer.polygon.exterior.coords)[:2].mean(axis=0)
        assert body.exterior.distance(shapely.Point(first)) < 0.6


def test_gentle_small_and_southern_roofs_have_no_dormers() -> None:
    for plan, region in (
        (plan_of(shapely.box(0, 0, 30, 11), Roof("gabled", 2.3)), "german"),
        (plan_of(shapely.box(0, 0, 7, 6), Roof("gabled", 3.5)), "german"),
        (plan_of(shapely.box(0, 0, 30, 11), Roof("gabled", 5.0)), "southern"),
    ):
        assert not any(dormers(plan, [mesh_of(plan.parts[0])], 0.0, [], region, rng(seed, "d")) for seed in range(6))


@pytest.mark.parametrize(
    ("wall", "region", "finishes"),
    [
        ("wall_balconies", "southern", {"rail_glass", "rail_iron"}),
        ("wall_french", "northern", {"rail_iron"}),
        ("wall_shuttered", "southern", {"rail_iron"}),
        ("wall_alpine", "alpine", {"rail_wood"}),
        ("wall_tenement", "american", {"rail_landing", "steps"}),
    ],
)
def test_what_hangs_on_a_wall_is_closed_outside_it_and_at_a_floor(wall: str, region: str, finishes: set[str]) -> None:
    made = hung(wall, region)
    assert made
    assert {piece.finish for piece in made} <= finishes
    walls = shapely.box(0, 0, 18, 14)
    plan = plan_of(walls, Roof("flat", 0.6), levels=6)
    storeys = storeys_of(plan, plan.parts[0], hall=False)
    floors = np.array([storeys.floor(k) for k in range(int(storeys.count))])
    for piece in made:
        assert not open_edges(mesh_of(piece)[1]).any()
        assert shapely.intersection(piece.polygon, walls).area < 1e-6
        assert piece.polygon.distance(walls) < 0.8
        assert piece.low > 2.9
        assert np.abs(piece.low - floors).min() < 0.45


def test_walls_without_the_custom_have_nothing_hanging() -> None:
    assert hung("wall_classic", "northern") == []
    assert hung("wall_tenement", "german") == []


def test_nothing_hangs_where_something_stands() -> None:
    plan = plan_of(shapely.box(0, 0, 18, 14), Roof("flat", 0.6), levels=6)
    front = [np.ones(4, bool)]
    taken = projections(plan, look("wall_alpine", "alpine"), front, lambda *_: False, "alpine", rng(0, "hung"))
    assert taken == []


def test_tanks_stand_on_high_flat_american_roofs_alone() -> None:
    high = plan_of(shapely.box(0, 0, 24, 20), Roof("flat", 0.6), levels=9)
    made = [water_tank(high, "american", rng(seed, "tank")) for seed in range(20)]
    assert 3 < sum(bool(tank) for tank in made) < 20
    for tank in filter(None, made):
        assert all(high.outline.contains(piece.polygon) for piece in tank)
        assert min(piece.low for piece in tank) < high.parts[0].eaves < max(piece.top for piece in tank) - 5.0
    assert not any(water_tank(high, "german", rng(seed, "tank")) for seed in range(20))
    low = plan_of(shapely.box(0, 0, 24, 20), Roof("flat", 0.6), levels=3)
    assert not any(water_tank(low, "american", rng(seed, "tank")) for seed in range(20))


def test_every_finish_names_materials_there_are() -> None:
    for name, finish in styles().finishes.items():
        named = {finish.side, finish.under, finish.picture or finish.side, finish.cover or finish.side}
        assert named <= set(PAINTERS), name


def test_a_cut_wall_keeps_closed_with_the_fewest_triangles() -> None:
    points, faces = mesh_of(PartPlan(shapely.box(0, 0, 12, 8), 0.0, 9.0, 3, Roof("flat", 0.0), {}))
    owner = np.zeros(len(faces), np.int64)
    before = len(points)
    for height in (0.5, 3.5):
        points, faces, owner = cut_at_heights(points, faces, owner, np.array([height]))
    cut = len(faces)
    faces, owner = without_needless(points, faces, owner, before)
    # Four walls of three bands, floor and roof: two triangles each.
    assert len(faces) == len(owner) == 4 * 3 * 2 + 4 < cut
    assert not open_edges(faces).any()
    assert volume((points, faces)) == pytest.approx(12 * 8 * 9.3)
    z = points[faces][..., 2]
    for height in (0.5, 3.5):
        assert not ((z.min(axis=1) < height - 0.01) & (z.max(axis=1) > height + 0.01)).any()


def test_neighbours_in_the_same_clothes_are_told_apart_unless_the_map_says_so() -> None:
    same = look("wall_shuttered", "southern")
    palette_colour = facade_style_of("residential", {}, levels=3, area=90.0, region="southern", random=rng(3, "x"))
    one = palette_colour
    made = distinct_styles([one, one, one], [(0, 1), (1, 2)], [True, True, True])
    assert made[0].tint != made[1].tint != made[2].tint
    kept = distinct_styles([one, one], [(0, 1)], [True, False])
    assert kept[0].tint == kept[1].tint
    assert same.wall == "wall_shuttered"


def test_a_building_s_own_draws_do_not_hang_on_who_else_is_there() -> None:
    def built(count: int) -> dict[str, bytes]:
        areas = [OsmArea(f"w{k + 1}", shapely.box(40 * k, 0, 40 * k + 14, 10),
                         {"building": "apartments", "building:levels": "4", "roof:shape": "gabled"})
                 for k in range(count)]  # fmt: skip
        osm = OsmData(LocalFrame(49.4, 8.7), 150.0, 120.0, [], [], areas, [])
        result = buildings_of(osm, flat_terrain(half=150.0), seed=1)
        cladding = clad(result.bare, osm, seed=1)
        found = {}
        for record in result.records:
            rows = []
            for surface in (*cladding.walls, *cladding.roofs):
                mine = surface.triangles[surface.entity[surface.triangles[:, 0]] == record.entity]
                # In no order: a cut puts a building's triangles in another place where there are others.
                packed = [surface.uv[row].tobytes() + surface.colour[row].tobytes() for row in mine]
                rows += [surface.material.name.encode() + row for row in packed]
            found[record.id] = b"".join(sorted(rows))
        return found

    two, three = built(2), built(3)
    assert {name: three[name] for name in two} == two
