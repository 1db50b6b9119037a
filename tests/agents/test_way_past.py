"""People who meet in a hall get past each other, and who only stands there moves on."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import toy_city
from vico.agents.indoor_steps import IndoorSteps
from vico.agents.room_ground import RoomGround
from vico.io.plain_data import decode, encode
from vico.seeds import rng
from vico.sim.config import SimConfig
from vico.sim.simulation import Simulation
from vico.sim.state import Posture
from vico.world.folder import World

MIDDLE = (-6.0, 11.0)
NAMES = ("resident_0", "resident_1")


def hall(width: float) -> World:
    """The toy city, its café made into a hall of 6 m."""
    base = toy_city.world()
    rooms = [
        room.model_copy(update={"size": (6.0, width, 2.6)}) if room.id == "r_cafe" else room for room in base.rooms
    ]
    parts = {
        name: getattr(base, name)
        for name in ("height", "buildings", "places", "entrances", "objects", "roads", "transit", "walkable")
    }
    return World(base.manifest, rooms=rooms, layers={}, models={}, **parts)


def two_in_a_hall(width: float, aside: tuple[float, float]) -> Simulation:
    """Two people at the ends of a hall who look at each other, each so far off its middle line."""
    sim = Simulation(hall(width), toy_city.community(), SimConfig(start=12 * 3600, observe=()))
    p = sim.state.people
    for i, along in enumerate((-2.2, 2.2)):
        p.room[i] = p.place[i] = 0
        p.posture[i] = Posture.STANDING
        p.position[i] = MIDDLE[0] + along, MIDDLE[1] + aside[i], toy_city.FLOOR
        p.yaw[i] = 0.0 if along < 0.0 else math.pi
    return sim


def walk(sim: Simulation, who: dict[str, IndoorSteps], seconds: int, *, saved: bool = False) -> list[int]:
    """Let people walk to the other end of the hall; return after how many seconds each was there."""
    ends = {"resident_0": MIDDLE[0] + 2.5, "resident_1": MIDDLE[0] - 2.5}
    there: dict[str, int] = {}
    observations, infos = sim.observe()
    for second in range(seconds):
        actions: dict[str, dict[str, Any]] = {}
        for name, steps in who.items():
            seen, told = observations[name], infos[name]
            if saved:
                fresh = IndoorSteps(name, rng(0, "test", name))
                fresh.restore(decode(encode(steps.state())))
                steps = who[name] = fresh
            action = steps.towards((ends[name], MIDDLE[1]), 0.6, seen, told)
            if action is None:
                there.setdefault(name, second)
            actions[name] = action or {"type": "wait"}
        if len(there) == len(who):
            break
        result = sim.step(actions)
        observations, infos = result.observations, result.infos
    return [there.get(name, seconds) for name in who]


def walkers() -> dict[str, IndoorSteps]:
    return {name: IndoorSteps(name, rng(0, "test", name)) for name in NAMES}


@pytest.mark.parametrize("width", [1.1, 1.4, 1.7, 2.5])
@pytest.mark.parametrize("aside", [(0.0, 0.0), (0.1, 0.1), (-0.1, -0.1), (0.1, -0.1), (-0.1, 0.1)])
def test_two_who_meet_in_a_hall_get_past_each_other(width: float, aside: tuple[float, float]) -> None:
    # Five seconds of it take the 4.1 m that each walks. Before, they took 20 s or so, at times 47.
    seconds = walk(two_in_a_hall(width, aside), walkers(), 60)
    assert max(seconds) <= (20 if width < 1.4 else 16)


def test_what_they_remember_can_be_saved_at_any_moment() -> None:
    as_ever = walk(two_in_a_hall(1.4, (0.1, 0.1)), walkers(), 60)
    assert walk(two_in_a_hall(1.4, (0.1, 0.1)), walkers(), 60, saved=True) == as_ever


def test_who_only_stands_in_a_narrow_hall_lets_one_pass() -> None:
    sim = two_in_a_hall(1.1, (0.0, 0.0))
    p = sim.state.people
    p.position[1, :2] = MIDDLE
    walker, stands = (IndoorSteps(name, rng(0, "test", name)) for name in NAMES)
    observations, infos = sim.observe()
    for _ in range(25):
        step = walker.towards((MIDDLE[0] + 2.5, MIDDLE[1]), 0.6, observations[NAMES[0]], infos[NAMES[0]])
        if step is None:
            break
        room = stands.make_room(observations[NAMES[1]], infos[NAMES[1]])
        result = sim.step({NAMES[0]: step, NAMES[1]: room or {"type": "wait"}})
        observations, infos = result.observations, result.infos
    assert p.position[0, 0] > p.position[1, 0] + 0.5


def test_no_way_leads_between_two_people_who_stand_close() -> None:
    room, nothing = np.array([0.0, 0.0, 0.0, 3.0, 1.0]), np.zeros((0, 5))
    apart = RoomGround((-1.0, 0.0), room, nothing, [(0.0, 0.6), (0.0, -0.6)])
    close = RoomGround((-1.0, 0.0), room, nothing, [(0.0, 0.4), (0.0, -0.4)])
    assert len(apart.way((1.0, 0.0), near=0.1))
    assert not len(close.way((1.0, 0.0), near=0.1))


def test_who_meets_nobody_is_told_of_nobody() -> None:
    sim = two_in_a_hall(1.4, (0.0, 0.0))
    _, infos = sim.observe()
    assert not {"stopped_by", "in_the_way_of"} & (set(infos[NAMES[0]]) | set(infos[NAMES[1]]))
