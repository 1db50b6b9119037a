"""On foot from the street to everything a place of several floors holds, by stairs and by lift."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

import toy_city
from vico.agents.schedule import ScheduleFollower
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.world.model import Category, Room
from vico.world.public import PublicMap
from vico.world.world import World
from vico.worldgen.indoor.stage import furnish

CELL = 0.1


def world_with(kind: str, category: Category, levels: int, seed: int = 0) -> World:
    """The toy city, its café made into a place of several floors."""
    base = toy_city.world()
    house = base.buildings[0].model_copy(update={"levels": levels})
    place = base.places[0].model_copy(update={"kind": kind, "category": category, "rooms": []})
    made = furnish([place], buildings=[house], height=base.height, seed=seed)
    return World(
        base.manifest,
        height=base.height,
        buildings=[house],
        places=[made.places[0], base.places[2]],
        entrances=base.entrances,
        rooms=made.rooms,
        objects=made.furniture,
        roads=base.roads,
        transit=base.transit,
        walkable=base.walkable,
        layers={},
        models={},
    )


@pytest.fixture(scope="module")
def hotel() -> World:
    """A hotel of three floors."""
    return world_with("hotel", Category.ACCOMMODATION, 9)


def guest(world: World) -> Simulation:
    """Somebody at the door of the place."""
    sim = Simulation(world, None, SimConfig(assistants=1, observe=(), cars=0, pedestrians=0))
    sim.scenario.place_agent("assistant_0", (-5.0, 4.0), yaw=math.pi / 2)
    return sim


def act(sim: Simulation, **action: Any) -> dict[str, Any]:
    """Do one action, and return the state afterwards."""
    state: dict[str, Any] = sim.step({"assistant_0": action}).observations["assistant_0"]["state"]
    return state


def go_through(sim: Simulation, room: str) -> dict[str, Any]:
    """Enter a room, and wait until the lift is there if it is one."""
    state = act(sim, type="enter", place=room)
    while sim.state.people.lift_left[0] > 0.0:
        state = act(sim, type="wait")
    return state


class Raster:
    """Cells of a room where a body fits, and the steps between them."""

    def __init__(self, sim: Simulation, room: Room) -> None:
        indoor = sim.state.indoor
        index = indoor.index[room.id]
        reach = max(room.size[:2]) / 2 + CELL
        n = math.ceil(2 * reach / CELL)
        x = room.centre[0] - reach + (np.arange(n) + 0.5) * CELL
        y = room.centre[1] - reach + (np.arange(n) + 0.5) * CELL
        self.points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        gaps = -_box_gaps(self.points, indoor.boxes[index])
        for row in indoor.furniture[indoor.furniture_start[index] : indoor.furniture_start[index + 1]]:
            gaps = np.minimum(gaps, _box_gaps(self.points, row))
        self.free = np.flatnonzero(gaps >= 0.27)
        number = np.where(gaps >= 0.27, np.arange(n * n), -1).reshape(n, n)
        pairs = []
        for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
            a = number[: n - dy, max(0, -dx) : n - max(0, dx)].ravel()
            b = number[dy:, max(0, dx) : n - max(0, -dx)].ravel()
            both = (a >= 0) & (b >= 0)
            pairs.append(np.column_stack([a[both], b[both], np.full(both.sum(), math.hypot(dx, dy))]))
        a, b, cost = np.concatenate(pairs).T
        self.graph = coo_array((cost, (a.astype(int), b.astype(int))), (n * n, n * n)).tocsr()

    def nearest(self, point: ArrayLike) -> int:
        """The free cell nearest to a point."""
        away = np.hypot(*(self.points[self.free] - np.asarray(point)[:2]).T)
        return int(self.free[np.argmin(away)])


def _box_gaps(points: np.ndarray, box: np.ndarray) -> np.ndarray:
    """Signed distances from points to an oriented rectangle."""
    c, s = math.cos(box[2]), math.sin(box[2])
    d = points - box[:2]
    u, v = np.abs(c * d[:, 0] + s * d[:, 1]) - box[3], np.abs(c * d[:, 1] - s * d[:, 0]) - box[4]
    return np.where((u > 0) & (v > 0), np.hypot(u, v), np.maximum(u, v))


RASTERS: dict[tuple[int, str], Raster] = {}


def path(sim: Simulation, room: Room, goal: tuple[float, ...]) -> np.ndarray:
    """Points to a point of the room, on cells where a body fits."""
    key = (id(sim), room.id)
    raster = RASTERS.setdefault(key, Raster(sim, room)) if key not in RASTERS else RASTERS[key]
    here, there = raster.nearest(sim.state.people.position[0, :2]), raster.nearest(goal)
    _, before = dijkstra(raster.graph, directed=False, indices=here, return_predecessors=True)
    way = [there]
    while way[-1] != here:
        assert before[way[-1]] >= 0, f"no way through {room.id}"
        way.append(int(before[way[-1]]))
    return raster.points[way[::-1]]


def walk(sim: Simulation, room: Room, goal: tuple[float, ...]) -> None:
    """Walk to a point of the room by turning and stepping."""
    line = path(sim, room, goal)
    people = sim.state.people
    k = 0
    while k < len(line) - 1:
        ahead = next(
            (j for j in range(min(len(line) - 1, k + 24), k, -1) if _straight(line[k : j + 1])),
            k + 1,
        )
        k = ahead
        for _ in range(3):
            gap = line[k] - people.position[0, :2]
            away = float(np.hypot(*gap))
            if away < 0.02:
                break
            turn = (math.atan2(gap[1], gap[0]) - people.yaw[0] + math.pi) % (2 * math.pi) - math.pi
            act(sim, type="turn_left" if turn > 0 else "turn_right", degrees=abs(math.degrees(turn)))
            act(sim, type="move_forward", distance=min(away, 2.5))
    assert math.dist(people.position[0, :2], goal[:2]) < 0.25, room.id


def _straight(points: np.ndarray) -> bool:
    way = points[-1] - points[0]
    off = (points - points[0]) @ np.array([-way[1], way[0]]) / max(float(np.hypot(*way)), 1e-9)
    return bool(np.abs(off).max() < 0.015)


def test_a_guest_walks_from_the_street_to_every_container_on_every_floor() -> None:
    homes = (world_with("apartments", Category.ACCOMMODATION, 9, seed) for seed in range(50))
    world = next(home for home in homes if any(room.rise for room in home.rooms))
    assert len(_visit_everything(guest(world), world)) == 2


def test_a_guest_gets_to_every_room_of_a_hotel_of_three_floors(hotel: World) -> None:
    sim = guest(hotel)
    assert len(_visit_everything(sim, hotel, containers=False)) == 3


def _visit_everything(sim: Simulation, world: World, *, containers: bool = True) -> set[float]:
    """Enter, then go through all rooms depth first and back; heights of the floors on which people stood."""
    place = world.places[0]
    for _ in range(4):
        act(sim, type="enter", place=place.id)
    assert sim.state.people.room[0] >= 0
    seen: set[str] = set()
    floors: set[float] = set()

    def visit(name: str, back: str | None) -> None:
        room = world.room_by_id[name]
        seen.add(name)
        people = sim.state.people
        if not room.rise:
            floors.add(round(float(people.position[0, 2]), 2))
        for container in room.containers if containers else ():
            walk(sim, room, container.reach)
        for door in room.doors:
            if door.to and door.to not in seen:
                walk(sim, room, door.inside)
                assert abs(people.position[0, 2] - door.inside[2]) < 0.05, room.id
                state = go_through(sim, door.to)
                assert (state["action_status"], state["room"]) == ("ok", door.to), state["action_reason"]
                visit(door.to, name)
        if back is not None:
            way = next(door for door in room.doors if door.to == back)
            walk(sim, room, way.inside)
            assert go_through(sim, back)["room"] == back

    visit(place.rooms[0], None)
    assert seen == set(place.rooms)
    return floors


def test_on_stairs_one_climbs_step_by_step_and_cannot_reach_the_upper_door_from_below(hotel: World) -> None:
    sim = guest(hotel)
    stairs = next(room for room in hotel.rooms if room.kind == "stairs")
    lower, upper = stairs.doors
    people = sim.state.people
    people.room[0] = sim.state.indoor.index[stairs.id]
    people.place[0] = 0
    people.position[0] = lower.inside
    state = act(sim, type="enter", place=upper.to)
    assert "3.2 m further up; take the stairs" in state["action_reason"]
    assert stairs.floor_at(*lower.inside[:2]) == pytest.approx(stairs.centre[2])
    people.yaw[0] = stairs.yaw
    heights = []
    for _ in range(7):
        act(sim, type="move_forward", distance=0.8)  # half a metre a second is all that stairs allow
        heights.append(float(people.position[0, 2]))
    assert heights == sorted(heights)
    assert heights[-1] == pytest.approx(stairs.centre[2] + stairs.rise / 2, abs=0.01)
    walk(sim, stairs, upper.inside)
    assert people.position[0, 2] == pytest.approx(stairs.centre[2] + stairs.rise)
    assert act(sim, type="enter", place=upper.to)["room"] == upper.to


def test_a_lift_takes_one_to_the_floor_whose_car_is_named_and_to_no_other_room(hotel: World) -> None:
    sim = guest(hotel)
    cars = [room for room in hotel.rooms if room.kind == "lift"]
    assert len(cars) == 3
    people = sim.state.people
    people.room[0] = sim.state.indoor.index[cars[0].id]
    people.place[0] = 0
    people.position[0] = cars[0].centre
    state = act(sim, type="wait")
    assert {car.id for car in cars[1:]} <= set(state["accessible_places"])
    refused = act(sim, type="enter", place=hotel.places[0].rooms[-1])
    assert "no door leads from here" in refused["action_reason"]
    state = act(sim, type="enter", place=cars[2].id)
    assert (state["action_status"], state["room"]) == ("ok", cars[0].id)
    refused = act(sim, type="enter", place=cars[1].id)
    assert (refused["action_code"], refused["action_reason"][:29]) == ("moving", "enter: the lift is moving; it")
    seconds = 2
    while act(sim, type="enter", place=cars[2].id)["room"] != cars[2].id:
        seconds += 1
    # Doors, and two seconds for each of two floors.
    assert seconds + 1 == 8
    assert people.position[0, 2] == pytest.approx(cars[2].centre[2])


def test_who_follows_a_schedule_finds_the_way_out_of_a_bedroom_upstairs(hotel: World) -> None:
    sim = guest(hotel)
    room = [r for r in hotel.rooms if r.kind == "hotel_room"][-1]
    people = sim.state.people
    people.room[0] = sim.state.indoor.index[room.id]
    people.place[0] = 0
    people.position[0] = room.inside
    resident = toy_city.resident(0, "Ann", [toy_city.item("main", "00:00:00", "23:59:59", toy_city.PARK)])
    follower = ScheduleFollower(resident, PublicMap.from_world(hotel), seed=3)
    observation = sim.step({"assistant_0": {"type": "wait"}}).observations["assistant_0"]
    for _ in range(260):
        action = follower.act(observation, {"entities": {}})
        observation = sim.step({"assistant_0": action}).observations["assistant_0"]
        if not observation["state"]["room"]:
            break
    assert observation["state"]["room"] == ""
