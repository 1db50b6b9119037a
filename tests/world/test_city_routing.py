"""Walks through a city of tiles: from gate to gate, and as good as a search of all its cells finds."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise, permutations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from vico.errors import SchemaError
from vico.io.arrays import mapped_array
from vico.world import city_routing
from vico.world.city import COST, GATES, REACHED, ROOM, STEPS, SURFACES, whole_walkable
from vico.world.city_gates import Gates, WindowSearch, border_gates, tile_gates
from vico.world.city_routing import CityRouter, CityWalkLengths
from vico.world.grid_search import cells_along
from vico.world.routing import Router
from vico.world.walkable import BLOCKED, OPEN, ROADWAY, SIDEWALK, WalkableMap, write_walkable
from vico.worldgen.seams.joins import TileGrid, tile_name
from vico.worldgen.seams.mosaic import MOST_ROOM, cells_of_tile, write_gates, write_walking

SIDE = 300  # cells of a tile
GRID = TileGrid(SIDE * 0.5, (-1, -1), (1, 1))


def _town(rng: np.random.Generator) -> WalkableMap:
    """Blocks of houses with streets between them, some closed by walls."""
    n = 3 * SIDE
    cls = np.full((n, n), OPEN, np.uint8)
    for x in range(15, n - 60, 90):
        for y in range(15, n - 60, 90):
            cls[y - 10 : y + 70, x - 10 : x + 70] = SIDEWALK
            cls[y : y + 60, x : x + 60] = BLOCKED
            if rng.random() < 0.4:
                cls[y + 20 : y + 30, x - 30 : x] = BLOCKED
    cls[:, 80:84] = ROADWAY
    return WalkableMap(cls, n * 0.25)


@pytest.fixture(scope="module")
def town() -> WalkableMap:
    return _town(np.random.default_rng(3))


def _opened(folder: Path, town: WalkableMap) -> CityRouter:
    """Write a map tile by tile, as a city's build does, and open it."""
    tiles = {}
    for tile in GRID:
        part = town.cls[cells_of_tile(tile, GRID, SIDE)]
        tiles[tile] = folder / f"{tile_name(tile)}.npz"
        write_walkable(tiles[tile], WalkableMap(np.ascontiguousarray(part), SIDE * 0.25))
    write_walking(folder, GRID, tiles)
    cost = mapped_array(folder / COST)
    room = mapped_array(folder / ROOM)
    write_gates(folder, [tile_gates(cost, room, cells_of_tile(tile, GRID, SIDE), cell=0.5) for tile in GRID])
    gates = Gates.read(folder / GATES, mapped_array(folder / STEPS))
    return CityRouter(whole_walkable(folder, town.half), cost, gates, SIDE)


@pytest.fixture(scope="module")
def router(town: WalkableMap, tmp_path_factory: pytest.TempPathFactory) -> CityRouter:
    return _opened(tmp_path_factory.mktemp("town"), town)


def test_a_city_has_the_walkable_map_of_its_tiles(town: WalkableMap, router: CityRouter) -> None:
    whole = router.walkable
    assert np.array_equal(whole.cls, town.cls)
    assert np.array_equal(whole.connected, town.connected)
    assert np.array_equal(whole.clearance, np.minimum(town.clearance, np.float32(MOST_ROOM)))
    assert np.array_equal(router._cost, Router(town)._cost)


def _length(way: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_long_walks_are_hardly_longer_than_the_cheapest(seed: int, town: WalkableMap, router: CityRouter) -> None:
    rng = np.random.default_rng(seed)
    a, b = town.random_point(rng), town.random_point(rng)
    whole = Router(town)
    exact, found = whole.path(a, b), router.path(a, b)
    assert exact is not None
    assert found is not None
    assert np.allclose(found[0], a)
    assert np.allclose(found[-1], b)
    for p, q in pairwise(found):
        steps = np.linspace(p, q, max(2, int(np.linalg.norm(q - p) / 0.2)))
        assert (town.class_at(steps) != BLOCKED).all()
    # Dearer stretches are roadway, which both avoid; gates may lie a little off the way.
    assert _length(found) <= _length(exact) * 1.06 + 20.0
    again = router.path(a, b)
    assert again is not None
    assert np.array_equal(found, again)
    of_many = router.path(a, b, often=True)
    assert of_many is not None
    assert _length(of_many) <= _length(exact) * 1.06 + 20.0


def test_short_walks_are_the_cheapest(town: WalkableMap, router: CityRouter) -> None:
    whole, rng = Router(town), np.random.default_rng(5)
    for _ in range(10):
        a = town.random_point(rng)
        b = town.random_point(rng, near=a, radius=80.0)
        exact, found = whole.path(a, b), router.path(a, b)
        assert exact is not None
        assert found is not None
        assert _length(found) == pytest.approx(_length(exact), abs=0.5)


def test_what_is_closed_is_gone_round_on_long_walks_too(town: WalkableMap, router: CityRouter) -> None:
    a, b = np.array([-215.0, -215.0]), np.array([210.0, 212.0])
    usual = router.path(a, b)
    assert usual is not None
    middle = usual[len(usual) // 2]
    squares = [(float(middle[0]), float(middle[1]), 6.0)]
    around = router.path(a, b, closed=squares)
    assert around is not None
    steps = np.concatenate([np.linspace(p, q, 200) for p, q in pairwise(around)])
    assert np.abs(steps - middle).max(axis=1).min() > 5.0
    again = router.path(a, b)
    assert again is not None
    assert np.array_equal(again, usual)


def test_walks_are_the_same_however_much_of_the_map_is_in_memory(
    town: WalkableMap, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    walks = []
    for tiles in (0, 1000):
        monkeypatch.setattr(city_routing, "_TILES", tiles)
        router = _opened(tmp_path / str(tiles), town)
        ends = [town.random_point(np.random.default_rng(k), clearance=1.0) for k in range(12)]
        found = []
        for start, goal in pairwise(ends):
            middle = np.mean([start, goal], axis=0)
            for closed in (
                (),
                ((float(middle[0]), float(middle[1]), 8.0), (float(start[0]) + 9.0, float(start[1]), 5.0)),
            ):
                found.append(router.path(start, goal, closed=closed))
                if not tiles:
                    router.drop_pages()
        walks.append(found)
    assert all(walk is not None for found in walks for walk in found[::2])
    for one, other in zip(*walks, strict=True):
        np.testing.assert_equal(one, other)


def test_walks_from_gate_to_gate_are_kept_cell_by_cell(router: CityRouter) -> None:
    n, graph = router.walkable.n, router.graph
    looked_at = 0
    for tile in ((0, 0), (1, 1), (2, 1)):
        cells = graph.cells[graph.of_tile(tile)].tolist()
        square = tuple(slice(k * SIDE, (k + 1) * SIDE) for k in tile)
        window = WindowSearch(np.ascontiguousarray(router._cost[square]), square[0].start, square[1].start, n)
        for a, b in permutations(cells, 2):
            kept, searched = graph.walk(a, b), window.walk(a, b)
            assert (kept is None) == (searched is None)
            if kept is None or searched is None:
                continue
            walk, costs = cells_along(router._cost, a, *kept)
            assert (walk[0], walk[-1]) == (a, b)
            # Of several that cost the same, either may be the one that is found the other way round.
            assert costs[-1] == searched[1][-1]
            if a < b:
                assert np.array_equal(walk, searched[0])
                assert np.array_equal(costs, searched[1])
            looked_at += 1
    assert looked_at > 100
    assert graph.walk(0, int(graph.cells[0])) is None
    assert graph.walk(int(graph.cells[0]), n * n - 1) is None


def test_steps_of_other_walks_are_refused(router: CityRouter, tmp_path: Path) -> None:
    cost, room = router._cost, router.walkable.clearance
    write_gates(tmp_path, [tile_gates(cost, room, cells_of_tile((0, 0), GRID, SIDE), cell=0.5)])
    with pytest.raises(SchemaError, match="steps beside it"):
        Gates.read(tmp_path / GATES, mapped_array(tmp_path / STEPS)[1:])


@pytest.mark.parametrize("direction", [0, 2, 5, 200])
def test_damaged_steps_are_told_and_lead_nowhere(town: WalkableMap, router: CityRouter, direction: int) -> None:
    cost, room = router._cost, router.walkable.clearance
    gates = Gates.joined([tile_gates(cost, room, cells_of_tile(tile, GRID, SIDE), cell=0.5) for tile in GRID])
    torn = replace(gates, steps=np.full_like(gates.steps, direction))
    with pytest.raises(SchemaError, match=r"steps\.npy: the walk from cell \d+ to \d+ is damaged; build the city anew"):
        CityRouter(router.walkable, cost, torn, SIDE).path((-215.0, -215.0), (210.0, 212.0))


def test_there_is_no_way_into_a_yard_without_a_gate(tmp_path: Path) -> None:
    cls = np.full((3 * SIDE, 3 * SIDE), OPEN, np.uint8)
    cls[400:500, 400:500] = BLOCKED
    cls[420:480, 420:480] = OPEN
    town = WalkableMap(cls, 3 * SIDE * 0.25)
    router = _opened(tmp_path, town)
    assert router.path((-200.0, -200.0), (0.0, 0.0)) is None
    assert not router.walkable.connected[450, 450]
    assert (tmp_path / SURFACES).exists()
    assert (tmp_path / ROOM).exists()
    assert (tmp_path / REACHED).exists()


@given(st.lists(st.sampled_from([0, 100, 120, 400]), min_size=1, max_size=300))
def test_every_stretch_of_a_border_that_can_be_walked_over_has_a_gate(costs: list[int]) -> None:
    row = np.array(costs, np.int32)
    gates = border_gates(row, row)
    assert all(row[k] > 0 for k in gates)
    start = None
    for k, value in enumerate([*costs, 0]):
        if value and start is None:
            start = k
        elif not value and start is not None:
            inside = [g for g in gates if start <= g < k]
            assert inside
            if any(0 < v < 400 for v in costs[start:k]):
                assert all(row[g] < 400 for g in inside)
            start = None


def test_lengths_of_many_walks_are_those_of_walks(town: WalkableMap, router: CityRouter) -> None:
    """Cells of a metre and gates between: hardly longer, and hardly shorter where they cut a corner."""
    lengths, whole, rng = CityWalkLengths(router, SIDE), Router(town), np.random.default_rng(8)
    far = 0
    for _ in range(150):
        a, b = (tuple(town.random_point(rng).tolist()) for _ in range(2))
        exact, found = whole.path(a, b), lengths.between(a, b)
        assert exact is not None
        assert _length(exact) * 0.97 - 3.0 <= found.metres <= _length(exact) * 1.06 + 20.0
        assert found == lengths.between(a, b)
        far += max(abs(p - q) for p, q in zip(a, b, strict=True)) > 400.0
    assert far >= 3
    assert math.isinf(lengths.between((0.0, 0.0), (5_000.0, 0.0)).metres)


def test_walks_begin_and_end_in_gates_too(town: WalkableMap, router: CityRouter) -> None:
    n, gates = town.n, router.graph.cells
    far = max(gates.tolist(), key=lambda cell: cell % n + cell // n)
    near = min(gates.tolist(), key=lambda cell: cell % n + cell // n)
    ends = [town.centre_of([cell % n, cell // n]) for cell in (near, far)]
    ask = router._ask(None, 0.0, ())
    for often in (False, True):
        found = router._far(ask, near, far, often=often)
        assert found is not None
        assert (found[0][0], found[0][-1]) == (near, far)
        assert len(found[0]) == len(found[1])
        assert (np.diff(found[1]) > 0).all()
        assert router.path(*ends, often=often) is not None


def test_walks_that_need_room_begin_and_end_where_there_is_room(town: WalkableMap, router: CityRouter) -> None:
    whole, rng, far = Router(town), np.random.default_rng(11), 0
    for _ in range(12):
        a, b = town.random_point(rng), town.random_point(rng)
        exact, found = whole.path(a, b, room=0.9), router.path(a, b, room=0.9)
        assert exact is not None
        assert found is not None
        assert np.linalg.norm(found[0] - exact[0]) < 1e-9
        assert np.linalg.norm(found[-1] - exact[-1]) < 1e-9
        assert _length(found) <= _length(exact) * 1.06 + 20.0
        again = router.path(a, b, room=0.9)
        assert again is not None
        assert np.array_equal(found, again)
        far += bool(np.abs(a - b).max() > 200.0)
    assert far >= 3


def test_exits_are_chosen_by_all_that_is_left_to_go(town: WalkableMap, router: CityRouter) -> None:
    """The walk out of a tile is the one that the costs of all its cells to all gates say is cheapest."""
    graph, rng, compared = router.graph, np.random.default_rng(4), 0
    count = len(graph.cells)
    apart = dijkstra(csr_matrix((graph._costs, graph._ends, graph._first), (count, count)))
    for _ in range(12):
        a, b = (router._nearest_cell(town.random_point(rng), router._free, 6.0) for _ in range(2))
        ask = router._ask(None, 0.0, ())
        if ask.tile(a) == ask.tile(b):
            continue
        walk, of_many = (router._far(ask, a, b, often=often) for often in (False, True))
        assert walk is not None
        assert of_many is not None
        (leave, leaving), (arrive, arriving) = router._to_gates(ask, a), router._to_gates(ask, b)
        starts, ends = leaving >= 0, arriving >= 0
        total = leaving[starts][:, None] + apart[np.ix_(leave[starts], arrive[ends])] + arriving[ends]
        assert walk[1][-1] == of_many[1][-1] == total.min()
        compared += 1
    assert compared >= 6
