"""The walkable map of central Helsinki: walls are closed, streets are open, free cells leave room for a body."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from vico.errors import InputError
from vico.world.walkable import BLOCKED, BODY, OPEN, ROADWAY, SIDEWALK, WalkableMap, fill_polygon, stroke
from vico.world.world import World


def test_no_free_cell_comes_nearer_to_a_wall_than_a_body_needs(helsinki: World) -> None:
    walkable = helsinki.walkable
    rows, columns = np.nonzero(walkable.cls != BLOCKED)
    points = shapely.points(walkable.centre_of(np.column_stack([columns, rows])))
    low = helsinki.height((0.0, 0.0)) + 2.0
    walls = [
        shapely.Polygon(body.positions[: len(body.positions) // 2, :2].astype(float))
        for body in helsinki.surfaces("collision")
        if body.positions[:, 2].min() < low
    ]
    near = shapely.STRtree(walls).query(points, predicate="dwithin", distance=BODY - 0.01)[0]
    assert len(near) == 0


def test_every_kind_of_surface_occurs(helsinki: World) -> None:
    assert set(np.unique(helsinki.walkable.cls)) == {0, 1, 2, 3, 4}


def test_outside_the_square_everything_is_blocked(helsinki: World) -> None:
    assert int(helsinki.walkable.class_at((helsinki.half + 1.0, 0.0))) == BLOCKED


def test_random_points_are_reachable_and_of_the_class_asked_for(helsinki: World) -> None:
    rng = np.random.default_rng(3)
    points = np.array([helsinki.walkable.random_point(rng, classes=(SIDEWALK,)) for _ in range(50)])
    assert (helsinki.walkable.class_at(points) == SIDEWALK).all()
    assert helsinki.walkable.is_connected(points).all()


def test_a_point_where_nobody_can_stand_is_refused(helsinki: World) -> None:
    building = max(helsinki.buildings, key=lambda b: shapely.Polygon(b.footprint[0]).area)
    middle = shapely.Polygon(building.footprint[0]).representative_point().coords[0]
    with pytest.raises(InputError, match="no reachable"):
        helsinki.walkable.random_point(np.random.default_rng(0), near=middle, radius=1.0)


def test_a_walled_yard_is_not_connected() -> None:
    grid = np.full((60, 60), OPEN, np.uint8)
    grid[20:40, 20:40] = BLOCKED
    grid[25:35, 25:35] = OPEN
    walkable = WalkableMap(grid, 15.0)
    assert not walkable.connected[30, 30]
    assert walkable.connected[0, 0]


@given(
    st.lists(
        st.tuples(st.floats(-9, 9, allow_subnormal=False), st.floats(-9, 9, allow_subnormal=False)),
        min_size=3,
        max_size=7,
        unique=True,
    )
)
def test_filled_cells_are_those_whose_centres_lie_inside(corners: list[tuple[float, float]]) -> None:
    polygon = shapely.convex_hull(shapely.MultiPoint(corners))
    if polygon.geom_type != "Polygon" or polygon.area < 0.5:
        return
    grid = np.zeros((40, 40), np.uint8)
    ring = np.array(polygon.exterior.coords)[:-1]
    fill_polygon(grid, ring[:, 0].copy(), ring[:, 1].copy(), np.array([0, len(ring)]), 10.0, 0.5, 1)
    axis = (np.arange(40) + 0.5) * 0.5 - 10.0
    x, y = np.meshgrid(axis, axis)
    away = shapely.distance(shapely.points(x, y), polygon.exterior)
    inside = shapely.contains_xy(polygon, x, y)
    clear = away > 1e-6  # centres on the outline may go either way
    assert (grid.astype(bool) == inside)[clear].all()


def test_a_stroke_closes_exactly_the_cells_within_its_radius() -> None:
    grid = np.zeros((40, 40), np.uint8)
    stroke(grid, np.array([[-3.0, -2.0]]), np.array([[4.0, 5.0]]), 0.3, 10.0, 0.5, 1)
    axis = (np.arange(40) + 0.5) * 0.5 - 10.0
    x, y = np.meshgrid(axis, axis)
    away = shapely.distance(shapely.points(x, y), shapely.LineString([(-3, -2), (4, 5)]))
    assert (grid.astype(bool) == (away < 0.3)).all()


def test_roadways_are_wide_enough_to_drive(helsinki: World) -> None:
    roadway = int((helsinki.walkable.cls == ROADWAY).sum()) * helsinki.walkable.cell**2
    drivable = sum(
        shapely.LineString(r.line).length * r.width for r in helsinki.roads.roads if r.lanes and r.layer >= 0
    )
    assert roadway > 0.5 * drivable


def test_one_point_is_told_what_many_are(helsinki: World) -> None:
    walkable = helsinki.walkable
    points = np.random.default_rng(5).uniform(-1.05 * walkable.half, 1.05 * walkable.half, (400, 2))
    assert [walkable.class_of(x, y) for x, y in points.tolist()] == walkable.class_at(points).tolist()
    rooms = [walkable.clearance_of(x, y) for x, y in points.tolist()]
    np.testing.assert_allclose(rooms, walkable.clearance_at(points), atol=1e-6)


def test_random_points_near_a_place_are_near_it(helsinki: World) -> None:
    walkable, rng = helsinki.walkable, np.random.default_rng(6)
    # At the edge of the map, too.
    for corner in (np.array([0.0, 0.0]), np.array([-walkable.half, walkable.half])):
        points = np.array([walkable.random_point(rng, near=corner, radius=60.0) for _ in range(40)])
        assert (np.hypot(*(points - corner).T) <= 60.0).all()
        assert walkable.is_connected(points).all()
        assert len(np.unique(points, axis=0)) > 20
