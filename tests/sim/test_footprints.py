"""Bodies' footprints and extents: one shape for all who ask."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from vico.sim.bodies.arrays import CAR, OBJECT, RESIDENT, STEP_HEIGHT, Bodies
from vico.sim.bodies.footprints import body_gap, can_touch, neighbour_grid, records_of, search
from vico.world.heights import HeightField

FLAT = HeightField.flat(50.0)


def bodies(*rows: tuple[int, float, float, float, float, float], z: float = 0.0, height: float = 1.5) -> Bodies:
    """Kind, x, y, yaw, half length, half width of each."""
    table = np.array(rows, float)
    n = len(table)
    return Bodies(
        np.arange(1, n + 1, dtype=np.int32),
        table[:, 0].astype(np.int8),
        np.column_stack([table[:, 1:3], np.full(n, z)]),
        table[:, 3],
        table[:, 4],
        table[:, 5],
        np.full(n, height),
        np.zeros((n, 2)),
    )


def outline(row: NDArray[np.float64]) -> shapely.Geometry:
    """The footprint as a polygon; round ends as polygons of many sides."""
    kind, x, y, yaw, a, b = row
    ahead, left = np.array([math.cos(yaw), math.sin(yaw)]), np.array([-math.sin(yaw), math.cos(yaw)])
    middle = np.array([x, y])
    if kind == RESIDENT:
        ends = [middle - (a - b) * ahead, middle + (a - b) * ahead]
        return (shapely.LineString(ends) if a > b else shapely.Point(middle)).buffer(b, quad_segs=64)
    return shapely.Polygon([middle + u * a * ahead + v * b * left for u, v in [(1, 1), (-1, 1), (-1, -1), (1, -1)]])


def test_gaps_between_discs_stadiums_and_rectangles_are_exact() -> None:
    random = np.random.default_rng(1)
    shapes = [(RESIDENT, 0.25, 0.25), (RESIDENT, 0.85, 0.25), (CAR, 2.2, 0.9), (OBJECT, 0.2, 0.15)]
    for _ in range(400):
        rows = []
        for k in random.integers(0, 4, 2):
            kind, a, b = shapes[k]
            rows.append((kind, *random.uniform(-2.5, 2.5, 2), random.uniform(-4, 4), a, b))
        one, other = records_of(bodies(*rows))
        gap, (first, second) = body_gap(one, other), (outline(np.array(row)) for row in rows)
        truth = first.distance(second)
        if truth > 0.0:
            assert gap == pytest.approx(truth, abs=1e-4)
        else:
            # How deep they are in each other: moved apart by so much, and no less, they touch no more.
            assert gap <= 1e-4
            assert not touching(first, second, -gap + 1e-3).all()
            assert touching(first, second, -gap - 1e-3).all()


def touching(first: shapely.Geometry, second: shapely.Geometry, distance: float) -> NDArray[np.bool_]:
    """Whether they touch when the second is moved so far, in each of 720 directions."""
    turn = np.linspace(0, 2 * math.pi, 720, endpoint=False)
    moves = distance * np.column_stack([np.cos(turn), np.sin(turn)])
    shapely.prepare(first)
    return shapely.intersects(first, shapely.polygons(shapely.get_coordinates(second) + moves[:, None, :]))


def test_two_rectangles_are_as_deep_in_each_other_as_the_shortest_way_out() -> None:
    deep = records_of(bodies((CAR, 0, 0, 0, 2, 1), (CAR, 2.5, 1.7, math.pi / 2, 1, 1)))
    assert body_gap(*deep) == pytest.approx(-0.3)


def test_a_disc_and_a_stadium_touch_where_their_outlines_do() -> None:
    cyclist, walker = records_of(bodies((RESIDENT, 0, 0, 0, 0.85, 0.25), (RESIDENT, 0.6, 0.5, 0, 0.25, 0.25)))
    assert body_gap(cyclist, walker) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("z", "touches"), [(0.0, True), (1.6, True), (1.8, False), (30.0, False)])
def test_bodies_on_different_levels_do_not_touch(z: float, touches: bool) -> None:
    person = bodies((RESIDENT, 0, 0, 0, 0.25, 0.25), height=1.75)
    other = bodies((CAR, 0, 0, 0, 2, 1), z=z)
    assert bool(can_touch(records_of(person)[0], records_of(other)[0])) is touches


@pytest.mark.parametrize(("height", "steps_over"), [(0.05, True), (STEP_HEIGHT, True), (0.2, False)])
def test_people_step_over_low_things_and_cars_do_not(height: float, steps_over: bool) -> None:
    thing = records_of(bodies((OBJECT, 0, 0, 0, 0.2, 0.2), height=height))[0]
    person = records_of(bodies((RESIDENT, 0, 0, 0, 0.25, 0.25)))[0]
    car = records_of(bodies((CAR, 0, 0, 0, 2, 1)))[0]
    assert bool(can_touch(person, thing)) is not steps_over
    assert can_touch(car, thing)


def test_levels_are_measured_from_the_ground_below() -> None:
    hill = HeightField(np.linspace(0, 10, 11)[None, :] * np.ones((11, 1)), 50.0)
    x = 20.0
    ground = float(hill(np.array([x, 0.0])))
    bottom, top = bodies((CAR, x, 0, 0, 2, 1), z=ground + 3.0, height=1.5).levels(hill)
    assert (bottom[0], top[0]) == (pytest.approx(3.0), pytest.approx(4.5))


def test_a_grid_finds_whoever_is_within_reach_in_order() -> None:
    random = np.random.default_rng(2)
    x, y = random.uniform(-300, 300, (2, 500))
    x[-1] = 1e7
    grid = neighbour_grid(x, y, 8.0, 1.0)
    buffer = np.empty(len(x), np.int64)
    for _ in range(200):
        px, py, reach = random.uniform(-300, 300), random.uniform(-300, 300), random.uniform(0, 60)
        found = search(grid, px, py, reach, buffer).tolist()
        near = np.flatnonzero(np.hypot(x - px, y - py) <= reach + 1.0).tolist()
        assert found == sorted(set(found))
        assert set(near) <= set(found)
