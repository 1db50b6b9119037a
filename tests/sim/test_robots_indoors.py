"""Robots go through doors, ride in lifts, find their way round furniture, and are refused where they do not fit."""

from dataclasses import replace as replaced
from typing import Any

import numpy as np
import pytest

import toy_city
from robot_field import ENGINES
from vico.assets.robots import robot_model
from vico.sim.config import SimConfig
from vico.sim.loop.checks import overlaps_of
from vico.sim.loop.simulation import Simulation
from vico.sim.people.placement import place_in_room
from vico.sim.robots import commands
from vico.sim.robots.path_planning import fits_doors
from vico.world.model import LIFT, Doorway, Room
from vico.world.world import World

GO2, HUSKY, DRONE = "robot_0", "robot_1", "robot_2"
NAMES = {"go2": GO2, "husky": HUSKY, "drone": DRONE}
#: In the café's upper room, beside its table.
UPSTAIRS = [0.0, 9.5, toy_city.FLOOR - 6.0]


def _room(name: str, kind: str, centre: tuple[float, float, float], size: tuple[float, float], **more: Any) -> Room:
    """A bare room of the café."""
    return Room(
        id=name,
        entity=more.pop("entity"),
        place=toy_city.CAFE,
        building="b1",
        kind=kind,
        centre=centre,
        size=(*size, 2.6),
        yaw=0.0,
        door=centre,
        inside=centre,
        **more,
    )


def _way(to: str, x: float, y: float, z: float, inside: tuple[float, float]) -> Doorway:
    return Doorway(to=to, position=(x, y, z), inside=(*inside, z))


def house() -> World:
    """The toy city, whose café has a lift to an upper room, which is further below ground, as rooms are."""
    world = toy_city.world()
    low, high = toy_city.FLOOR, toy_city.FLOOR - 6.0
    cafe, back, shop = world.rooms
    street = Doorway(to="", position=cafe.door, inside=cafe.inside)
    cafe = cafe.model_copy(
        update={
            "doors": [
                street,
                _way("r_back", -3.0, 11.0, low, (-3.8, 11.0)),
                _way("r_car_low", -9.0, 12.0, low, (-8.2, 12.0)),
            ]
        }
    )
    back = back.model_copy(update={"doors": [_way("r_cafe", -3.0, 11.0, low, (-2.2, 11.0))]})
    cars = [
        _room(
            name,
            LIFT,
            (-10.0, 12.0, z),
            (1.8, 1.8),
            entity=100_010 + k,
            doors=[_way(other, -10.0, 12.0, z, (-10.0, 12.0)), _way(beside, -9.1, 12.0, z, (-10.0, 12.0))],
        )
        for k, (name, z, other, beside) in enumerate(
            [("r_car_low", low, "r_car_high", "r_cafe"), ("r_car_high", high, "r_car_low", "r_upper")]
        )
    ]
    upper = _room(
        "r_upper",
        "lobby",
        (-3.0, 11.0, high),
        (12.0, 6.0),
        entity=100_020,
        doors=[_way("r_car_high", -9.0, 12.0, high, (-8.2, 12.0)), _way("r_attic", 3.0, 11.0, high, (2.2, 11.0))],
    )
    stairs = _room("r_attic", "stairs", (5.5, 11.0, high), (5.0, 2.4), entity=100_021, rise=3.0, doors=[])
    stairs = stairs.model_copy(update={"doors": [_way("r_upper", 3.0, 11.0, high, (3.5, 10.4))]})
    world.rooms[:] = [cafe, back, shop, *cars, upper, stairs]
    return world


@pytest.fixture(scope="module", params=ENGINES)
def engine(request: Any) -> str:
    return str(request.param)


WORLD = house()


PLACES = {GO2: (-5.0, 2.5, 1.57), HUSKY: (-2.0, 1.0, 2.0), DRONE: (12.0, -8.0, 0.0)}


def simulation(engine: str, kinds: tuple[str, ...]) -> Simulation:
    config = SimConfig(
        assistants=1,
        robots=kinds,
        robot_places={f"robot_{k}": PLACES[NAMES[kind]] for k, kind in enumerate(kinds)},
        observe=("robot_0",),
        image=48,
        physics=engine,
    )
    sim = Simulation(WORLD, None, config)
    sim.scenario.place_agent("assistant_0", (2.0, 0.0, 0.0))
    return sim


def go(sim: Simulation, actions: dict[str, Any], seconds: int, until: str = "") -> list[str]:
    """Act once and let time pass until something is told; return what was."""
    told: list[str] = []
    for second in range(seconds):
        sim.act(actions if second == 0 else {})
        sim.advance(1.0)
        assert overlaps_of(sim.state) == []
        told += [event.text for event in sim.state.events.log]
        rooms = [f"in {room_of(sim, robot)}" for robot in sim.state.robots.names] if until.startswith("in ") else []
        if until in told + rooms:
            break
    return told


def room_of(sim: Simulation, robot: str) -> str:
    return str(sim.observe([robot])[0][robot]["state"]["room"])


def refused(sim: Simulation, robot: str, target: list[float]) -> str:
    """Why a robot can't go somewhere."""
    sim.act({robot: {"type": "go_to", "target": target}})
    state = sim.observe([robot])[0][robot]["state"]
    assert state["action_status"] == "refused", state
    return str(state["action_reason"])


def test_go2_goes_in_takes_the_lift_sees_the_room_and_comes_out_again(engine: str) -> None:
    sim = simulation(engine, ("go2",))
    told = go(sim, {GO2: {"type": "go_to", "target": UPSTAIRS}}, 40, "enters Corner Café")
    assert told == ["enters Corner Café"]
    seen = sim.observe([GO2])[0][GO2]
    assert seen["state"]["room"] == "r_cafe"
    assert 100_001 in seen["segmentation"]  # the floor of that room
    go(sim, {}, 30, "in r_car_low")
    go(sim, {}, 2)
    assert room_of(sim, GO2) == "r_car_low"  # it rides
    saved = sim.snapshot()
    told = go(sim, {}, 30, "arrived")
    assert told[-1] == "arrived"
    after = sim.state_hash()
    base = sim.state.robots.base_poses()[0]
    assert np.hypot(*(base[:2] - UPSTAIRS[:2])) < 0.5
    assert base[2] - UPSTAIRS[2] == pytest.approx(0.28, abs=0.05)
    seen = sim.observe([GO2])[0][GO2]
    assert (seen["state"]["room"], seen["state"]["place"]) == ("r_upper", toy_city.CAFE)
    # All of that again, from where it rode, in another simulation.
    again = simulation(engine, ("go2",))
    again.restore(saved)
    assert again.snapshot().keys() == saved.keys()
    assert go(again, {}, 30, "arrived") == told
    assert again.state_hash() == after
    told = go(again, {GO2: {"type": "go_to", "target": [-5.0, 1.0, 0.0]}}, 60, "arrived")
    assert told[-2:] == ["leaves Corner Café", "arrived"]
    assert room_of(again, GO2) == ""
    assert (again.state.robots.rooms < 0).all()


def test_husky_follows_somebody_indoors_stops_there_and_no_wall_lets_it_through(engine: str) -> None:
    sim, husky = simulation(engine, ("husky",)), "robot_0"
    place_in_room(0, sim.state.indoor.index["r_back"], sim.state, near=np.array([-1.0, 9.0]))
    assert room_of(sim, "assistant_0") == "r_back"
    follow = {husky: {"type": "follow", "agent": "assistant_0"}}
    go(sim, follow, 60, "in r_back")
    go(sim, {}, 5)
    away = np.hypot(*(sim.state.robots.bodies().position[0] - sim.state.people.position[0])[:2])
    assert 0.7 < away < 2.0
    go(sim, {husky: {"type": "stop"}}, 1)
    go(sim, {husky: {"type": "control", "space": "velocity", "vector": [0.0, 0.0, 1.0]}}, 2)
    go(sim, {husky: {"type": "control", "space": "velocity", "vector": [-1.0, 0.0, 0.0]}}, 6)
    x, y, _ = sim.state.robots.bodies().position[0]
    assert abs(x) < 3.0
    assert abs(y - 11.0) < 3.0
    sim.scenario.place_agent("assistant_0", (2.0, 0.0, 0.0))
    assert go(sim, follow, 60, "leaves Corner Café")[-1] == "leaves Corner Café"
    assert room_of(sim, husky) == ""


def test_with_something_in_its_hand_a_robot_waits_outside_for_whom_it_follows(monkeypatch: pytest.MonkeyPatch) -> None:
    sim, husky = simulation("mujoco", ("husky",)), "robot_0"
    place_in_room(0, sim.state.indoor.index["r_back"], sim.state, near=np.array([-1.0, 9.0]))
    with monkeypatch.context() as patch:
        patch.setattr(commands, "object_in_hand", lambda run, robot: 7)
        go(sim, {husky: {"type": "follow", "agent": "assistant_0"}}, 30, "in r_back")
        assert room_of(sim, husky) == ""
    go(sim, {}, 60, "in r_back")
    assert room_of(sim, husky) == "r_back"


def test_robots_are_refused_in_words_where_they_do_not_fit() -> None:
    sim = simulation("mujoco", ("go2", "husky", "drone"))
    assert "fly do not go indoors" in refused(sim, DRONE, UPSTAIRS)
    attic = [5.0, 10.5, toy_city.FLOOR - 5.0]
    assert "no lift" in refused(sim, GO2, attic)
    shelf = [-6.0, 13.0, toy_city.FLOOR]
    assert "wide enough" in refused(sim, HUSKY, shelf)
    robots = sim.state.robots
    entrance = robots.scene.rooms.entrances[0]
    robots.scene.rooms.entrances[0] = entrance.model_copy(update={"position": (-5.0, 5.0, 0.5)})
    assert "has wheels" in refused(sim, HUSKY, UPSTAIRS)
    assert robots.trip_refusal(0, 0, (-6.0, 9.5, toy_city.FLOOR)) == ""
    robots.scene.rooms.entrances[0] = entrance
    wide = replaced(robot_model("husky"), half_width=0.5)
    assert not fits_doors(wide)
