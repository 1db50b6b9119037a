"""Things are bodies: two never lie in one place, people and cars are stopped by them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import toy_city
from vico.sim.bodies.state_arrays import RADIUS
from vico.sim.config import SimConfig
from vico.sim.loop.checks import overlaps_of
from vico.sim.loop.simulation import Simulation

CRATE = (0.4, 0.4, 0.4)


@pytest.fixture
def sim() -> Simulation:
    """Two assistants in the toy city, apart."""
    sim = Simulation(toy_city.world(), None, SimConfig(assistants=2, observe=()))
    sim.scenario.place_agent("assistant_0", (0.0, -15.0))
    sim.scenario.place_agent("assistant_1", (-10.0, -15.0))
    return sim


def add(sim: Simulation, name: str, x: float, y: float, size: tuple[float, ...] = CRATE, room: str = "") -> int:
    z = toy_city.FLOOR if room else float(sim.world.height((x, y)))
    return sim.scenario.add_object(name, "crate", [], (x, y, z), size=size, room=room)


def act(sim: Simulation, **action: Any) -> dict[str, Any]:
    """One step of assistant_0; return its state after it."""
    return sim.step({"assistant_0": action}).observations["assistant_0"]["state"]


@pytest.mark.parametrize("room", ["", "r_cafe"])
def test_an_object_added_onto_another_one_comes_to_lie_beside_it(sim: Simulation, room: str) -> None:
    where = (-6.0, 9.0) if room else (3.0, -15.0)
    for k in range(3):
        add(sim, f"crate {k}", *where, room=room)
    assert overlaps_of(sim.state) == []
    first, second, third = (sim.ground_truth.object_position(f"crate {k}") for k in range(3))
    assert first[:2] == pytest.approx(where)
    assert 0.39 <= np.hypot(*(second - first)[:2]) < 0.7
    assert 0.39 <= np.hypot(*(third - first)[:2]) < 1.2


def test_an_object_added_onto_somebody_comes_to_lie_beside_them(sim: Simulation) -> None:
    add(sim, "crate", 0.0, -15.0)
    assert overlaps_of(sim.state) == []
    x, y, _ = sim.ground_truth.object_position("crate")
    assert np.hypot(x, y + 15.0) < 1.0


def test_a_thing_put_onto_another_one_is_put_beside_it_and_that_is_told(sim: Simulation) -> None:
    add(sim, "crate", 0.9, -15.0)
    carried = add(sim, "box", 0.0, -14.2)
    act(sim, type="pick", hand=0, object=carried)
    z = float(sim.world.height((0.9, -15.0)))
    result = sim.step({"assistant_0": {"type": "put", "hand": 0, "target": [0.9, -15.0, z]}})
    assert "beside crate" in next(event.text for event in result.events if event.kind == "put")
    assert overlaps_of(sim.state) == []
    assert sim.state.objects.hand[sim.state.objects.index(carried)] == -1


def _carry(sim: Simulation, name: str, x: float, y: float, size: tuple[float, ...], room: str = "") -> int:
    """Have assistant_0 carry a thing."""
    entity = add(sim, name, x, y, size, room)
    assert act(sim, type="pick", hand=0, object=entity)["action_status"] == "ok"
    return entity


@pytest.mark.parametrize("room", ["", "r_cafe"])
def test_a_thing_put_onto_the_top_of_another_rests_there_and_comes_down_when_that_is_taken(
    sim: Simulation, room: str
) -> None:
    x, y = (-6.0, 8.4) if room else (0.0, -15.0)
    if room:
        people = sim.state.people
        people.room[0], people.place[0] = sim.state.indoor.index[room], 0
        people.position[0] = (x, y, toy_city.FLOOR)
    low = add(sim, "crate", x + 0.8, y, room=room)
    box = _carry(sim, "box", x, y + 0.6, (0.2, 0.2, 0.2), room)
    top = sim.ground_truth.object_position("crate")[2] + CRATE[2]
    act(sim, type="put", hand=0, target=[x + 0.9, y + 0.05, top])
    assert sim.ground_truth.object_position("box") == pytest.approx([x + 0.9, y + 0.05, top], abs=1e-3)
    cup = _carry(sim, "cup", x, y + 0.6, (0.1, 0.1, 0.1), room)
    act(sim, type="put", hand=0, target=[x + 0.9, y + 0.05, top + 0.2])
    assert sim.ground_truth.object_position("cup")[2] == pytest.approx(top + 0.2, abs=1e-3)
    assert overlaps_of(sim.state) == []
    # What was below is taken away: all of it comes down.
    assert act(sim, type="pick", hand=0, object=low)["action_status"] == "ok"
    floor = top - CRATE[2]
    assert sim.ground_truth.object_position("box")[2] == pytest.approx(floor, abs=0.02)
    assert sim.ground_truth.object_position("cup")[2] == pytest.approx(floor + 0.2, abs=0.02)
    assert overlaps_of(sim.state) == []
    assert {sim.state.objects.holder[sim.state.objects.index(e)] for e in (box, cup)} == {0}


def test_a_thing_whose_middle_is_over_no_top_falls_beside_it(sim: Simulation) -> None:
    add(sim, "crate", 0.8, -15.0)
    _carry(sim, "box", 0.0, -14.4, (0.3, 0.3, 0.3))
    z = float(sim.world.height((0.8, -15.0)))
    act(sim, type="put", hand=0, target=[0.8, -14.75, z + CRATE[2]])
    x, y, bottom = sim.ground_truth.object_position("box")
    assert bottom == pytest.approx(float(sim.world.height((x, y))), abs=1e-6)
    assert overlaps_of(sim.state) == []


def test_without_a_target_a_thing_is_put_clear_of_what_lies_ahead(sim: Simulation) -> None:
    add(sim, "crate", 0.6, -15.0, size=(0.2, 0.2, 0.2))
    carried = add(sim, "box", 0.0, -14.2, size=(0.2, 0.2, 0.2))
    act(sim, type="pick", hand=0, object=carried)
    act(sim, type="put", hand=0)
    assert overlaps_of(sim.state) == []
    assert sim.ground_truth.object_position("box")[0] > 0.7


@pytest.mark.parametrize(("height", "stopped"), [(0.05, False), (0.4, True)])
def test_a_thing_in_the_street_stops_people_unless_it_is_low(sim: Simulation, height: float, stopped: bool) -> None:
    add(sim, "crate", 1.5, -15.0, size=(0.4, 0.4, height))
    for _ in range(3):
        state = act(sim, type="move_forward", distance=1.0)
    x = float(sim.state.people.position[0, 0])
    if stopped:
        assert "stopped by object" in state["action_reason"]
        assert 1.3 - RADIUS - 0.01 < x <= 1.3 - RADIUS + 1e-9
    else:
        assert x == pytest.approx(3.0)


def test_a_thing_on_the_floor_of_a_room_stops_people_and_nobody_enters_onto_it(sim: Simulation) -> None:
    room = sim.state.indoor.index["r_cafe"]
    inside = sim.state.indoor.rooms[room].inside
    add(sim, "crate", inside[0], inside[1], room="r_cafe")
    sim.scenario.place_agent("assistant_0", (-5.0, 3.9), yaw=np.pi / 2)
    for _ in range(4):
        act(sim, type="enter", place=toy_city.CAFE)
    assert sim.state.people.room[0] == room
    assert overlaps_of(sim.state) == []
    crate = sim.ground_truth.object_position("crate")
    for _ in range(4):
        act(sim, type="look_at", target=crate.tolist())
        act(sim, type="move_forward", distance=1.0)
    assert overlaps_of(sim.state) == []


def test_a_room_or_street_without_a_free_spot_refuses_an_object(sim: Simulation) -> None:
    add(sim, "slab", 5.0, -15.0, size=(6.0, 6.0, 0.5))
    with pytest.raises(ValueError, match="slab is there"):
        add(sim, "crate", 5.0, -15.0)
