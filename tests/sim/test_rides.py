"""Buses and bicycles in real streets: who gets on, what it costs, and where one gets off."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import ndimage

from vico.rules import BIKE_ASTRAY, BIKE_RATE, BUS_FARE
from vico.sim.actions.model import Refusal
from vico.sim.actions.table import check
from vico.sim.bodies.avatars import clearances, cyclist_fits
from vico.sim.bodies.state_arrays import RADIUS, Posture, Vehicle
from vico.sim.config import SimConfig
from vico.sim.loop.checks import overlapping
from vico.sim.loop.simulation import Simulation
from vico.sim.people import rides
from vico.world.walkable import CROSSING, ROADWAY
from vico.world.world import World


@pytest.fixture
def sim(helsinki_city: World) -> Simulation:
    """Central Helsinki with its buses and bicycles, and one assistant with money."""
    simulation = Simulation(helsinki_city, None, SimConfig(assistants=1, observe=()))
    simulation.state.people.cash[0] = 50.0
    return simulation


def act(sim: Simulation, **action: Any) -> dict[str, Any]:
    """Do one action; return the assistant's state."""
    state: dict[str, Any] = sim.step({"assistant_0": action}).observations["assistant_0"]["state"]
    return state


def at_the_bus(sim: Simulation) -> None:
    """Wait at a stop until a bus stands there."""
    transit = sim.state.transit
    assert transit is not None
    bus = next(b for b in range(transit.traffic.buses) if transit.stopped_at(b) is not None)
    sim.scenario.place_agent("assistant_0", transit.exit_spots(bus)[0])


def test_boarding_costs_the_fare_and_carries_one_along(sim: Simulation) -> None:
    at_the_bus(sim)
    state = act(sim, type="enter_bus")
    assert (state["action_status"], state["vehicle"], state["cash"]) == ("ok", "bus", 50.0 - BUS_FARE)
    before = sim.state.people.position[0].copy()
    for _ in range(600):
        act(sim, type="wait")
        if np.linalg.norm(sim.state.people.position[0] - before) > 20.0:
            break
    assert np.linalg.norm(sim.state.people.position[0] - before) > 20.0


def test_a_moving_bus_lets_nobody_off(sim: Simulation) -> None:
    at_the_bus(sim)
    act(sim, type="enter_bus")
    transit = sim.state.transit
    assert transit is not None
    bus = int(sim.state.people.vehicle_entity[0]) - transit.entity_of(0)
    for _ in range(600):
        if transit.stopped_at(bus) is None:
            break
        act(sim, type="wait")
    assert "moving" in act(sim, type="exit_bus")["action_reason"]


def test_at_a_stop_one_gets_off_beside_the_bus(sim: Simulation) -> None:
    at_the_bus(sim)
    act(sim, type="enter_bus")
    state = act(sim, type="exit_bus")
    assert (state["action_status"], state["vehicle"]) == ("ok", "")
    others = sim.state.obstacles_to(0)
    away = np.hypot(*(others.position[:, :2] - sim.state.people.position[0, :2]).T)
    assert away.min() > 0.5


def test_a_bicycle_is_ridden_away_and_left_astray_costs_more(sim: Simulation) -> None:
    transit = sim.state.transit
    assert transit is not None
    for bike in range(len(transit.bicycles.xy)):
        sim.scenario.place_agent("assistant_0", transit.bicycles.xy[bike])
        state = act(sim, type="enter_bike")
        if state["action_status"] == "ok":
            break
    assert state["vehicle"] == "bike"
    start = sim.state.people.position[0, :2].copy()
    chance = np.random.default_rng(0)
    for _ in range(200):
        state = act(sim, type="move_forward", distance=3.0)
        if state["action_status"] == "collision":
            act(sim, type="turn_left", degrees=float(chance.uniform(20, 160)))
        if np.linalg.norm(sim.state.people.position[0, :2] - start) > 12.0:
            break
    assert np.linalg.norm(sim.state.people.position[0, :2] - start) > 5.0
    bike = int(sim.state.people.vehicle_entity[0]) - transit.bicycles.first_entity
    assert transit.bicycles.xy[bike] == pytest.approx(sim.state.people.position[0, :2])
    state = act(sim, type="exit_bike")
    paid = 50.0 - state["cash"]
    minutes = round((paid % BIKE_ASTRAY) / BIKE_RATE)
    assert paid == pytest.approx(minutes * BIKE_RATE + (BIKE_ASTRAY if paid > BIKE_ASTRAY else 0.0))
    assert 1 <= minutes <= 7


def test_indoors_or_far_from_a_stop_nobody_boards(sim: Simulation) -> None:
    assert sim.state.transit is not None
    away = np.hypot(*(sim.state.transit.doors(0)[0] - sim.state.people.position[0, :2]))
    if away > 10.0:
        assert "door" in act(sim, type="enter_bus")["action_reason"]
    assert "not in a bus" in act(sim, type="exit_bus")["action_reason"]


def test_sixty_riders_have_sixty_places(helsinki_city: World) -> None:
    sim = Simulation(helsinki_city, None, SimConfig(assistants=61, observe=()))
    state, transit = sim.state, sim.state.transit
    assert transit is not None
    state.people.cash[:] = 10.0
    bus = next(b for b in range(transit.traffic.buses) if transit.stopped_at(b) is not None)
    for i in range(61):
        sim.scenario.place_agent(f"assistant_{i}", transit.exit_spots(bus)[0])
        refused = check({"type": "enter_bus"}, i, state)
        if i < 60:
            rides.board_bus(i, state)
    assert isinstance(refused, Refusal)
    assert "full" in refused.reason
    where = state.people.position[:60, :2]
    apart = np.hypot(*(where[:, None] - where[None]).transpose(2, 0, 1))
    assert apart[np.triu_indices(60, 1)].min() > 0.39
    seated = state.people.posture[:60] == Posture.SITTING
    assert 30 <= seated.sum() < 60
    assert seated[: seated.sum()].all()


def test_a_place_that_somebody_left_is_taken_by_the_next(helsinki_city: World) -> None:
    sim = Simulation(helsinki_city, None, SimConfig(assistants=3, observe=()))
    transit = sim.state.transit
    assert transit is not None
    sim.state.people.cash[:] = 10.0
    bus = next(b for b in range(transit.traffic.buses) if transit.stopped_at(b) is not None)
    for i in (0, 1):
        sim.scenario.place_agent(f"assistant_{i}", transit.exit_spots(bus)[0])
        rides.board_bus(i, sim.state)
    first = sim.state.people.position[0].copy()
    rides.alight_bus(0, sim.state)
    assert sim.state.people.posture[0] == Posture.STANDING
    sim.scenario.place_agent("assistant_2", transit.exit_spots(bus)[1])
    rides.board_bus(2, sim.state)
    assert np.allclose(sim.state.people.position[2], first)


def test_riders_are_seen_through_the_windows(helsinki_city: World) -> None:
    sim = Simulation(helsinki_city, None, SimConfig(assistants=2, observe=("assistant_1",), image=256))
    transit = sim.state.transit
    assert transit is not None
    sim.state.people.cash[:] = 10.0
    bus = next(b for b in range(transit.traffic.buses) if transit.stopped_at(b) is not None)
    sim.scenario.place_agent("assistant_0", transit.exit_spots(bus)[0])
    rides.board_bus(0, sim.state)
    rider = sim.state.people.position[0]
    beside = np.array([-np.sin(transit.bus_pose(bus)[2]), np.cos(transit.bus_pose(bus)[2])])
    views = sim.renderer.render(
        sim.state,
        np.array([[*(rider[:2] + 4.0 * beside), rider[2] + 1.3, *-beside, 0.0]]),
        np.array([0], np.int32),
    )
    views.wait_for(0)
    assert int((views.pictures["segmentation"][0] == sim.state.people.entity[0]).sum()) > 100


def on_a_bicycle(sim: Simulation) -> int:
    """Put the assistant on some bicycle; return its number."""
    transit = sim.state.transit
    assert transit is not None
    for bike in range(len(transit.bicycles.xy)):
        sim.scenario.place_agent("assistant_0", transit.bicycles.xy[bike])
        if act(sim, type="enter_bike")["action_status"] == "ok":
            return int(sim.state.people.vehicle_entity[0]) - transit.bicycles.first_entity
    raise AssertionError("no bicycle can be mounted")


def test_cash_never_falls_below_zero_and_who_owes_rides_no_more(sim: Simulation) -> None:
    transit = sim.state.transit
    assert transit is not None
    sim.state.people.cash[0] = 5.0
    bike = on_a_bicycle(sim)
    transit.bicycles.since[bike] -= 3600.0
    price = BIKE_RATE * 61
    state = act(sim, type="exit_bike")
    assert (state["action_status"], state["cash"]) == ("ok", 0.0)
    owed = float(sim.state.people.owed[0])
    assert owed == pytest.approx(price - 5.0) or owed == pytest.approx(price + BIKE_ASTRAY - 5.0)
    sim.state.people.cash[0] = 50.0
    sim.scenario.place_agent("assistant_0", transit.bicycles.xy[bike])
    assert "owe" in act(sim, type="enter_bike")["action_reason"]


def test_without_money_nobody_gets_on_a_bicycle(sim: Simulation) -> None:
    transit = sim.state.transit
    assert transit is not None
    on_a_bicycle(sim)
    act(sim, type="exit_bike")
    sim.state.people.cash[0] = 0.1
    reasons = set()
    for spot in transit.bicycles.xy:
        sim.scenario.place_agent("assistant_0", spot)
        reasons.add(act(sim, type="enter_bike")["action_reason"].split(",")[0])
    assert "enter_bike: the first minute costs 0.2" in reasons


def test_without_free_ground_nobody_gets_off_a_bicycle(sim: Simulation, monkeypatch: pytest.MonkeyPatch) -> None:
    on_a_bicycle(sim)
    monkeypatch.setattr(rides, "free_ground", lambda *args, **kwargs: None)
    before = sim.state.people.cash[0]
    state = act(sim, type="exit_bike")
    assert (state["action_status"], state["vehicle"]) == ("refused", "bike")
    assert "no free ground" in state["action_reason"]
    assert sim.state.people.cash[0] == before


def test_who_gets_off_stands_beside_the_bicycle(sim: Simulation) -> None:
    transit = sim.state.transit
    assert transit is not None
    bike = on_a_bicycle(sim)
    chance = np.random.default_rng(1)
    for _ in range(100):
        if act(sim, type="move_forward", distance=3.0)["action_status"] == "collision":
            act(sim, type="turn_left", degrees=float(chance.uniform(20, 160)))
    act(sim, type="exit_bike")
    standing = transit.bicycles.standing_bodies(np.array([bike]))
    assert clearances(sim.state.people.position[0, :2], standing).min() >= RADIUS
    assert np.hypot(*(transit.bicycles.xy[bike] - sim.state.people.position[0, :2])) < 8.0


def test_a_bicycle_that_is_left_in_the_street_is_wheeled_off_it(sim: Simulation) -> None:
    transit, walkable = sim.state.transit, sim.world.walkable
    assert transit is not None
    # On roadways so near their edge that a few steps lead off them, far from stations.
    middle = slice(walkable.n // 4, -walkable.n // 4)
    off = ndimage.distance_transform_edt(np.isin(walkable.cls, (ROADWAY, CROSSING))) * walkable.cell
    rows, columns = np.nonzero((off[middle, middle] > 1.2) & (off[middle, middle] < 1.8))
    spots = walkable.centre_of(np.column_stack([columns, rows]) + middle.start)
    bike, left, tried = on_a_bicycle(sim), 0, 0
    for spot in spots[:: len(spots) // 40]:
        if not cyclist_fits(walkable, spot, 0.3, sim.state.obstacles_to(0)):
            continue
        sim.state.people.position[0, :2], sim.state.people.yaw[0] = spot, 0.3
        transit.bicycles.carry(bike, float(spot[0]), float(spot[1]), 0.3)
        if transit.bicycles.is_at_station(bike):
            continue
        rides.dismount_bicycle(0, sim.state)
        tried += 1
        body = transit.bicycles.standing_bodies(np.array([bike]))
        others = sim.state.obstacles_to(0)
        others = others.where(others.entity != body.entity[0])
        assert cyclist_fits(walkable, transit.bicycles.xy[bike], float(transit.bicycles.yaw[bike]), others)
        assert clearances(sim.state.people.position[0, :2], body).min() >= RADIUS
        left += int(walkable.class_of(*transit.bicycles.xy[bike].tolist()) in (ROADWAY, CROSSING))
        transit.bicycles.mount(bike, 0, float(transit.clock[0]))
        sim.state.people.vehicle[0], sim.state.people.vehicle_entity[0] = Vehicle.BIKE, int(body.entity[0])
    # Where cars are parked along the kerb there may be no way through.
    assert tried >= 20
    assert left <= tried // 10


def test_a_bicycle_left_takes_the_room_its_rider_took_with_it(sim: Simulation) -> None:
    transit = sim.state.transit
    assert transit is not None
    bike = on_a_bicycle(sim)
    rider, left = sim.state.people.bodies(), transit.bicycles.standing_bodies(np.array([bike]))
    for name in ("half_length", "half_width", "rounding", "yaw"):
        assert np.array_equal(getattr(left, name), getattr(rider, name)), name
    assert np.array_equal(left.position[:, :2], rider.position[:, :2])


def test_bicycles_left_end_to_end_do_not_overlap(sim: Simulation) -> None:
    transit = sim.state.transit
    assert transit is not None
    on_a_bicycle(sim)
    both = np.array([0, 1])
    ahead = transit.bicycles.standing_bodies(both[:1]).half_length[0] - RADIUS
    # The ends' circles touch at half past one, where rectangles would have corners.
    reach = np.array([ahead + 2 * RADIUS * np.cos(np.pi / 4) + ahead, 2 * RADIUS * np.sin(np.pi / 4)])
    transit.bicycles.carry(0, 0.0, 0.0, 0.0)
    transit.bicycles.carry(1, *(reach + 0.002), 0.0)
    assert overlapping(transit.bicycles.standing_bodies(both)) == []


def test_bicycles_are_named_wherever_they_stand(sim: Simulation) -> None:
    transit = sim.state.transit
    assert transit is not None
    drawn = transit.draw()
    bicycles = drawn.entity[drawn.index == drawn.prototypes.index("bicycle")]
    assert len(bicycles) > 0
    for entity in bicycles.tolist():
        assert sim.entity(entity)["kind"] == "bicycle"
