"""Ways are the cheapest ones, kept ways are those that searching anew would find, and stairs are climbed."""

import heapq
import math

import numpy as np
import pytest

from vico.agents.navigation.path_planning import (
    LAYERS,
    PathKeeper,
    Target,
    furthest_straight_cell,
    search_memory,
    search_path,
)
from vico.agents.navigation.voxels import FREE_COST
from vico.seeds import rng

# Ways lead at most half a grid from their start: what is asked about is a quarter of it.
N, SIDE = 128, 64


def random_grid(chance: np.random.Generator, share: float) -> np.ndarray:
    """Free, dearer and blocked cells; blocked at the rim, where indices wrap around."""
    costs = chance.choice(np.array([10, 11, 16, 40], np.uint8), size=(N, N))
    costs[chance.random((N, N)) < share] = 0
    return rimmed(costs)


def rimmed(costs: np.ndarray) -> np.ndarray:
    costs[:2] = costs[SIDE - 2 :] = costs[:, :2] = costs[:, SIDE - 2 :] = 0
    return costs


def least_costs(costs: np.ndarray, start: tuple[int, int]) -> np.ndarray:
    """Dijkstra in plain Python: a start that is free goes through free cells only."""
    found = np.full((N, N), np.inf)
    found[start[1], start[0]] = 0
    queue = [(0, *start)]
    while queue:
        cost, x, y = heapq.heappop(queue)
        if cost > found[y, x]:
            continue
        for dy in (-1, 0, 1):
            for dx in (-1, 0, 1):
                i, j = x + dx, y + dy
                if (dx or dy) and costs[j, i]:
                    new = cost + int(costs[j, i]) * (7 if dx and dy else 5)
                    if new < found[j, i]:
                        found[j, i] = new
                        heapq.heappush(queue, (new, i, j))
    return found


def random_target(chance: np.random.Generator) -> Target:
    """A box or a disc; its metres are tenths of cells, as in the voxels."""
    x, y, yaw, length, width, near = chance.random(6)
    box = chance.random() < 0.5
    return Target(0.5 + 5 * x, 0.5 + 5 * y, 3 * yaw, 0.6 * length * box, 0.3 * width * box, 0.05 + 0.5 * near)


@pytest.mark.parametrize("seed", range(25))
def test_a_way_is_as_cheap_as_any_into_a_box_or_disc(seed: int) -> None:
    chance = rng(seed, "navigation test, ways")
    costs, target = random_grid(chance, 0.3), random_target(chance)
    costs[5, 5] = FREE_COST
    masks = np.zeros((N, N), np.uint64)
    cells, reached = search_path((costs, masks), search_memory(N), np.array([5, 5, 0.0]), target.values(0.0), False)
    least = least_costs(costs, (5, 5))
    inside = [
        least[j, i]
        for j in range(N)
        for i in range(N)
        if target.away((i + 0.5) / 10, (j + 0.5) / 10) <= target.near and np.isfinite(least[j, i])
    ]
    assert reached == bool(inside)
    assert cells[-1, 2] == least[cells[-1, 1], cells[-1, 0]]
    if reached:
        assert cells[-1, 2] == min(inside)
    else:
        away = [target.away((i + 0.5) / 10, (j + 0.5) / 10) for j, i in np.argwhere(np.isfinite(least))]
        assert target.away((cells[-1, 0] + 0.5) / 10, (cells[-1, 1] + 0.5) / 10) == pytest.approx(min(away))
    steps = np.abs(np.diff(cells[:, :2], axis=0))
    assert steps.max(initial=0) <= 1


@pytest.mark.parametrize("seed", range(30))
def test_keeping_a_way_costs_what_searching_anew_at_every_step_does(seed: int) -> None:
    chance = rng(seed, "navigation test, changes")
    costs, target = random_grid(chance, 0.25), random_target(chance)
    masks = np.zeros((N, N), np.uint64)
    keeper, memory, at = PathKeeper(N), search_memory(N), (5, 5)
    costs[5, 5] = FREE_COST
    for _ in range(40):
        start = (*at, 0.0)
        kept = keeper.way(costs, masks, start, target.values(0.0))
        fresh, reached = search_path((costs, masks), memory, np.array(start), target.values(0.0), False)
        assert keeper.reached == reached
        if reached:
            assert kept[-1, 2] - kept[0, 2] == fresh[-1, 2]
        else:
            ends = [target.away((way[-1, 0] + 0.5) / 10, (way[-1, 1] + 0.5) / 10) for way in (kept, fresh)]
            assert ends[0] == pytest.approx(ends[1])
        if len(kept) > 1:
            at = (int(kept[1, 0]), int(kept[1, 1]))
        # Something comes, something goes: anywhere, and on the way.
        for _ in range(int(chance.integers(0, 3))):
            x, y = chance.integers(2, SIDE - 2, 2)
            costs[y, x] = chance.choice(np.array([0, 10, 16, 40], np.uint8))
        if len(kept) > 4 and chance.random() < 0.3:
            x, y = kept[int(chance.integers(2, len(kept))), :2]
            costs[y, x] = 0
        costs[at[1], at[0]] = max(costs[at[1], at[0]], FREE_COST)


def test_a_way_is_kept_while_nothing_better_can_be_known() -> None:
    costs = np.full((N, N), FREE_COST, np.uint8)
    rimmed(costs)
    costs[10:50, 30] = 0
    costs[60, 60] = 0
    masks, keeper, target = np.zeros((N, N), np.uint64), PathKeeper(N), Target(5.0, 3.0, near=0.1).values(0.0)
    way = keeper.way(costs, masks, (10, 30, 0.0), target)
    assert way[-1, 2] > 40 * 5 * FREE_COST  # around the wall
    costs[60, 60] = FREE_COST  # far from any better way
    keeper.way(costs, masks, (int(way[1, 0]), int(way[1, 1]), 0.0), target)
    assert keeper.searches == 1
    costs[30, 30] = FREE_COST  # a door in the wall
    short = keeper.way(costs, masks, (int(way[1, 0]), int(way[1, 1]), 0.0), target)
    assert keeper.searches == 2
    assert short[-1, 2] < way[-1, 2] / 1.4


def test_a_kept_way_goes_on_from_its_state() -> None:
    chance = rng(3, "navigation test, state")
    costs = random_grid(chance, 0.2)
    costs[5, 5] = FREE_COST
    masks, target = np.zeros((N, N), np.uint64), Target(5.0, 5.0, near=0.3).values(0.0)
    keeper = PathKeeper(N)
    way = keeper.way(costs, masks, (5, 5, 0.0), target)
    changed = costs.copy()
    changed[3, 60] = FREE_COST if changed[3, 60] == 0 else 0
    other = PathKeeper(N)
    other.restore(keeper.state(changed), changed)
    start = (int(way[2, 0]), int(way[2, 1]), 0.0)
    np.testing.assert_array_equal(other.way(changed, masks, start, target), keeper.way(changed, masks, start, target))


def test_a_start_that_touches_something_may_be_left() -> None:
    costs = np.full((N, N), FREE_COST, np.uint8)
    costs[20:30, 20:30] = 0
    cells, reached = search_path(
        (costs, np.zeros((N, N), np.uint64)), search_memory(N), np.array([22, 25, 0.0]),
        Target(4.0, 2.55, near=0.1).values(0.0), False,
    )  # fmt: skip
    assert reached
    outside = costs[cells[:, 1], cells[:, 0]] > 0
    assert not outside[0]
    assert (np.diff(outside.astype(int)) >= 0).all()  # once out, never in again


def staircase() -> tuple[np.ndarray, np.ndarray]:
    """Half-turn stairs: up along y = 10..19, back along y = 21..30, a wall between, 16 levels a flight."""
    costs = np.full((N, N), FREE_COST, np.uint8)
    costs[:10] = costs[31:] = costs[:, :10] = costs[:, 50:] = 0
    costs[20, 10:42] = 0
    masks = np.zeros((N, N), np.uint64)
    for x in range(10, 50):
        climbed = min(max(x - 20, 0) * 16 // 20, 16)
        masks[10:20, x] = np.uint64(1) << np.uint64(2 + climbed)
        masks[21:31, x] = np.uint64(1) << np.uint64(2 + 32 - climbed)
    masks[20, 42:50] = masks[10, 42:50]
    return costs, masks


@pytest.mark.parametrize("seen", [True, False])
def test_stairs_are_climbed_around_the_wall_between_their_flights(seen: bool) -> None:
    costs, masks = staircase()
    if not seen:
        masks[20:, :] = 0  # the upper flight and the wall's far side were not in view yet
    door = Target(1.1, 2.55, near=0.3, z=3.4)
    cells, reached = search_path(
        (costs, masks), search_memory(N, layers=LAYERS), np.array([12, 15, 2.0]), door.values(0.0), True
    )
    assert reached
    assert cells[:, 0].max() >= 42  # by the landing at the far end
    below_it = Target(1.1, 1.55, near=0.3, z=3.4).values(0.0)
    assert not search_path((costs, masks), search_memory(N, layers=LAYERS), np.array([12, 15, 2.0]), below_it, True)[1]


def test_straight_pieces_go_through_nothing_dearer_than_the_way() -> None:
    costs = np.full((N, N), FREE_COST, np.uint8)
    rimmed(costs)
    costs[20:40, 30] = 0
    target = Target(5.0, 3.05, near=0.05).values(0.0)
    masks = np.zeros((N, N), np.uint64)
    cells, _ = search_path((costs, masks), search_memory(N), np.array([15, 30, 0.0]), target, False)
    which, limit = furthest_straight_cell(costs, cells, 15.5, 30.5, 80.0)
    assert 0 < which < len(cells) - 1
    assert limit == FREE_COST
    for share in np.linspace(0, 1, 100):
        x = 15.5 + share * (cells[which, 0] - 15.0)
        y = 30.5 + share * (cells[which, 1] - 30.0)
        assert costs[math.floor(y), math.floor(x)] == FREE_COST
