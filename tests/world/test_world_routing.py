"""Walking routes through central Helsinki."""

import math
import time
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np
import pytest

from vico.world.routing import Router
from vico.world.walkable import BLOCKED, OPEN, ROADWAY, SIDEWALK, WalkableMap
from vico.world.world import World


@pytest.fixture(scope="module")
def router(helsinki: World) -> Router:
    return Router(helsinki.walkable)


@pytest.fixture(scope="module")
def trips(helsinki: World) -> list[tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(11)
    return [(helsinki.walkable.random_point(rng), helsinki.walkable.random_point(rng)) for _ in range(40)]


def test_connected_points_always_have_a_way(router: Router, trips: list[tuple[np.ndarray, np.ndarray]]) -> None:
    assert all(router.path(a, b) is not None for a, b in trips)


def test_ways_begin_and_end_where_asked(router: Router, trips: list[tuple[np.ndarray, np.ndarray]]) -> None:
    for a, b in trips:
        route = router.path(a, b)
        assert route is not None
        np.testing.assert_allclose(route[0], a)
        np.testing.assert_allclose(route[-1], b)


def test_ways_keep_clear_of_everything_solid(
    helsinki: World, router: Router, trips: list[tuple[np.ndarray, np.ndarray]]
) -> None:
    for a, b in trips:
        route = router.path(a, b)
        assert route is not None
        for start, end in pairwise(route):
            steps = np.linspace(start, end, max(2, int(np.linalg.norm(end - start) / 0.1)))
            assert (helsinki.walkable.class_at(steps) != BLOCKED).all()


def test_a_way_is_as_long_back_as_there(router: Router, trips: list[tuple[np.ndarray, np.ndarray]]) -> None:
    for a, b in trips[:10]:
        assert router.length(a, b) == pytest.approx(router.length(b, a), rel=0.06)


def test_the_distance_field_agrees_with_the_search(router: Router, trips: list[tuple[np.ndarray, np.ndarray]]) -> None:
    a, b = trips[0]
    field = router.distance_field(b)
    ix, iy = router.walkable.cell_of(a)
    # A field counts metres of sidewalk: never less than the walk's own length, nor more than four times as much.
    assert router.length(a, b) * 0.94 <= field[iy, ix] <= router.length(a, b) * 4.1


def test_people_walk_round_by_the_crossing_rather_than_down_the_road() -> None:
    grid = np.full((80, 80), SIDEWALK, np.uint8)
    grid[36:44, :] = ROADWAY
    grid[36:44, 20:26] = 3
    route = Router(WalkableMap(grid, 20.0)).path((-2.0, -10.0), (-2.0, 10.0))
    assert route is not None
    crossing = route[np.abs(route[:, 1]) < 2.5]
    middle = np.array([np.interp(0.0, route[:, 1], route[:, 0])])
    assert (np.concatenate([crossing[:, 0], middle]) > -10.5).all()
    assert -10.5 < middle[0] < -6.5


def test_a_blocked_way_is_walked_round() -> None:
    walkable = WalkableMap(np.full((80, 80), OPEN, np.uint8), 20.0)
    router = Router(walkable)
    wall = np.zeros((80, 80), bool)
    wall[38:42, :70] = True
    direct, around = router.path((0, -10), (0, 10)), router.path((0, -10), (0, 10), blocked=wall)
    assert direct is not None
    assert around is not None
    assert len(direct) == 2
    assert around[:, 0].max() > 14.5


def test_where_there_is_no_way_there_is_none() -> None:
    grid = np.full((80, 80), OPEN, np.uint8)
    grid[38:42, :] = BLOCKED
    router = Router(WalkableMap(grid, 20.0))
    assert router.path((0, -10), (0, 10)) is None
    assert math.isinf(router.length((0, -10), (0, 10)))


def test_the_same_question_gets_the_same_answer(
    helsinki: World, router: Router, trips: list[tuple[np.ndarray, np.ndarray]]
) -> None:
    fresh = Router(helsinki.walkable)
    for a, b in trips[:10]:
        first, second = router.path(a, b), fresh.path(a, b)
        assert first is not None
        assert second is not None
        np.testing.assert_array_equal(first, second)


def test_a_walk_across_the_map_is_found_quickly(router: Router, trips: list[tuple[np.ndarray, np.ndarray]]) -> None:
    router.path(*trips[0])
    times = []
    for a, b in trips:
        start = time.process_time()
        router.path(a, b)
        times.append(time.process_time() - start)
    assert float(np.median(times)) < 0.03


def test_landmarks_change_no_way(helsinki: World, trips: list[tuple[np.ndarray, np.ndarray]]) -> None:
    plain, learned = Router(helsinki.walkable), Router(helsinki.walkable)
    for a, b in trips * 2:  # more searches than landmarks wait for
        learned.path(a, b)
    for a, b in trips[:12]:
        one, two = plain.path(a, b), learned.path(a, b)
        assert one is not None
        assert two is not None
        np.testing.assert_array_equal(one, two)


def test_learned_costs_change_no_way(helsinki: World, trips: list[tuple[np.ndarray, np.ndarray]]) -> None:
    plain, learned = Router(helsinki.walkable), Router(helsinki.walkable)
    learned.learn_costs(trips[0][0])
    learned.learn_costs(trips[1][1])
    for k, (a, b) in enumerate(trips[2:12]):
        closed = [(float((a[0] + b[0]) / 2), float((a[1] + b[1]) / 2), 2.0)] if k % 3 == 0 else []
        for start, goal in ((trips[0][0], b), (a, trips[0][0]), (trips[1][1], b), (a, trips[1][1])):
            one, two = plain.path(start, goal, closed=closed), learned.path(start, goal, closed=closed)
            assert one is not None
            assert two is not None
            np.testing.assert_array_equal(one, two)


def test_costs_are_learned_where_there_is_no_way_too() -> None:
    grid = np.full((80, 80), OPEN, np.uint8)
    grid[38:42, :] = BLOCKED
    router = Router(WalkableMap(grid, 20.0))
    router.learn_costs((0, -10))
    assert router.path((0, -10), (0, 10)) is None
    assert router.path((0, 10), (0, -10)) is None
    assert router.path((0, -10), (5, -10)) is not None


def test_threads_may_share_a_router(helsinki: World, trips: list[tuple[np.ndarray, np.ndarray]]) -> None:
    router = Router(helsinki.walkable)
    alone = [router.path(a, b) for a, b in trips]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda trip: router.path(*trip), trips * 3, timeout=100))
    for k, route in enumerate(together):
        expected = alone[k % len(trips)]
        assert route is not None
        assert expected is not None
        np.testing.assert_array_equal(route, expected)


def test_a_coarser_map_measures_walks_alike(helsinki: World, trips: list[tuple[np.ndarray, np.ndarray]]) -> None:
    fine, coarse = Router(helsinki.walkable), Router(helsinki.walkable.coarser())
    ratios = [coarse.length(a, b) / fine.length(a, b) for a, b in trips]
    assert np.median(ratios) == pytest.approx(1.0, abs=0.02)
    assert max(ratios) < 1.5


def test_closing_squares_is_blocking_their_cells(helsinki: World, trips: list[tuple[np.ndarray, np.ndarray]]) -> None:
    router = Router(helsinki.walkable)
    before = [router.path(a, b) for a, b in trips]
    for (a, b), route in list(zip(trips, before, strict=True))[:8]:
        assert route is not None
        middle = route[len(route) // 2]
        closed = [(float(middle[0]), float(middle[1]), reach) for reach in (0.5, 1.3)]
        mask = np.zeros(helsinki.walkable.cls.shape, bool)
        for x, y, reach in closed:
            ix, iy = helsinki.walkable.cell_of((x, y))
            k = math.ceil(reach / helsinki.walkable.cell)
            mask[max(0, iy - k) : iy + k + 1, max(0, ix - k) : ix + k + 1] = True
        around, masked = router.path(a, b, closed=closed), router.path(a, b, blocked=mask)
        assert (around is None) == (masked is None)
        if around is not None and masked is not None:
            np.testing.assert_array_equal(around, masked)
    # They are open again afterwards.
    for (a, b), route in list(zip(trips, before, strict=True))[:8]:
        np.testing.assert_array_equal(router.path(a, b), route)


def test_landmarks_are_learnt_of_the_open_map(helsinki: World, trips: list[tuple[np.ndarray, np.ndarray]]) -> None:
    plain, learned = Router(helsinki.walkable), Router(helsinki.walkable)
    for a, b in trips * 2:  # more searches than landmarks wait for, each with something closed
        learned.path(a, b, closed=[(float(a[0]) + 3.0, float(a[1]), 2.0)])
    for a, b in trips[:12]:
        np.testing.assert_array_equal(learned.path(a, b), plain.path(a, b))
