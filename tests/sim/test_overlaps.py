"""Nobody is inside anybody or anything, and the check says so when somebody is."""

from __future__ import annotations

import json

import numpy as np
import pytest

import toy_city
from vico.sim.bodies.collisions import WALL
from vico.sim.bodies.state_arrays import Vehicle
from vico.sim.config import SimConfig
from vico.sim.loop.checks import FURNITURE, OverlapCheck, overlaps_of
from vico.sim.loop.simulation import Simulation


@pytest.fixture
def sim() -> Simulation:
    """Three assistants in the toy city."""
    return Simulation(toy_city.world(), None, SimConfig(assistants=3, observe=()))


def stand(sim: Simulation, *places: tuple[float, float], room: int = -1) -> None:
    """Put people where no action would: nothing is checked."""
    p = sim.state.people
    for i, (x, y) in enumerate(places):
        p.position[i] = x, y, 0.0 if room < 0 else sim.state.indoor.floor[room]
        p.room[i] = room


APART = ((-10.0, -15.0), (-5.0, -15.0), (0.0, -15.0))


def test_people_apart_do_not_overlap(sim: Simulation) -> None:
    stand(sim, *APART)
    assert overlaps_of(sim.state) == []


@pytest.mark.parametrize(("gap", "depth"), [(0.498, 0.002), (0.1, 0.4)])
def test_two_people_in_one_place_are_found_with_their_depth(sim: Simulation, gap: float, depth: float) -> None:
    stand(sim, APART[0], (APART[0][0] + gap, APART[0][1]), APART[2])
    found = overlaps_of(sim.state)
    assert [(one.entity, one.other) for one in found] == [tuple(sim.state.people.entity[:2])]
    assert found[0].depth == pytest.approx(depth)


def test_a_touch_of_less_than_a_millimetre_is_no_overlap(sim: Simulation) -> None:
    stand(sim, APART[0], (APART[0][0] + 0.4995, APART[0][1]), APART[2])
    assert overlaps_of(sim.state) == []


def test_a_cyclist_is_as_long_as_the_bicycle(sim: Simulation) -> None:
    stand(sim, APART[0], (APART[0][0] + 1.0, APART[0][1]), APART[2])
    assert overlaps_of(sim.state) == []
    sim.state.people.vehicle[0] = Vehicle.BIKE
    sim.state.people.yaw[0] = 0.0
    assert [one.depth for one in overlaps_of(sim.state)] == [pytest.approx(0.1)]


def test_people_in_a_wall_or_in_furniture_are_found(sim: Simulation) -> None:
    stand(sim, *APART)
    room = 0
    x, y, yaw, half_length, _ = sim.state.indoor.boxes[room]
    at_wall = (x + (half_length - 0.1) * np.cos(yaw), y + (half_length - 0.1) * np.sin(yaw))
    stand(sim, at_wall, room=room)
    assert WALL in [one.other for one in overlaps_of(sim.state)]
    fx, fy = sim.state.indoor.furniture[sim.state.indoor.furniture_start[room], :2]
    stand(sim, (fx, fy), room=room)
    assert FURNITURE in [one.other for one in overlaps_of(sim.state)]


def test_only_those_of_one_space_overlap(sim: Simulation) -> None:
    stand(sim, *APART)
    middle = tuple(sim.state.indoor.boxes[0][:2])
    stand(sim, middle, room=0)
    outside = [one for one in overlaps_of(sim.state) if one.other > 0]
    sim.state.people.position[1, :2] = middle
    assert [one for one in overlaps_of(sim.state) if one.other > 0] == outside == []


def test_a_person_inside_a_thing_that_lies_in_the_street_is_found_unless_it_is_low(sim: Simulation) -> None:
    stand(sim, *APART)
    ground = float(sim.world.height((APART[0][0], APART[0][1])))
    sim.state.people.position[0, 2] = ground
    at = np.array([*APART[0], ground])
    sim.state.objects.add("letter", "letter", at, -1, np.array([0.3, 0.2, 0.02]), 0.0)
    assert overlaps_of(sim.state) == []
    sim.state.objects.add("crate", "crate", at, -1, np.array([0.3, 0.2, 0.4]), 0.0)
    pairs = {(one.entity, one.other) for one in overlaps_of(sim.state)}
    crate, letter = int(sim.state.objects.entity[1]), int(sim.state.objects.entity[0])
    assert pairs == {(int(sim.state.people.entity[0]), crate), (letter, crate)}


def test_the_check_counts_sub_steps_and_tells_who(sim: Simulation) -> None:
    stand(sim, APART[0], (APART[0][0] + 0.2, APART[0][1]), APART[2])
    check = OverlapCheck(sim.state)
    check.look()
    check.look()
    record = check.record()
    assert (record["sub_steps"], record["count"], record["pairs"]) == (2, 2, 1)
    assert record["first"][0]["who"] == "assistant_0"
    assert record["first"][0]["with"] == "assistant_1"
    assert record["first"][0]["depth"] == pytest.approx(0.3)


def test_a_check_that_goes_on_from_another_ones_counts_tells_the_same(sim: Simulation) -> None:
    stand(sim, APART[0], APART[0], APART[1])
    unbroken, first, second = (OverlapCheck(sim.state) for _ in range(3))
    unbroken.look()
    first.look()
    second.restore(json.loads(json.dumps(first.state())))
    stand(sim, APART[0], APART[0], APART[0])
    unbroken.look()
    second.look()
    assert second.record() == unbroken.record()
    assert (second.looks, second.count) == (2, 4)


def test_a_simulation_looks_after_every_sub_step_and_is_not_changed_by_it(sim: Simulation) -> None:
    other = Simulation(toy_city.world(), None, SimConfig(assistants=3, observe=()))
    sim.check_overlaps()
    ahead = {name: {"type": "move_forward", "distance": 1.0} for name in sim.agents}
    for _ in range(3):
        assert sim.step(ahead).hash == other.step(ahead).hash
    assert sim.reports()["overlaps"]["sub_steps"] == 30
    assert sim.reports()["overlaps"]["count"] == 0
    assert "overlaps" not in other.reports()
