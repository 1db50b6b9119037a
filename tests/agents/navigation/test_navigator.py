"""An assistant walks where pictures let it: through a hotel by its stairs, and round what maps do not show."""

from __future__ import annotations

import math

import numpy as np
import pytest

import toy_city
from vico.agents.assistant.skills import GRASP, OUTSIDE, AssistantSkills, ObservationView
from vico.agents.navigation.path_planning import Target
from vico.assets.models.library import furniture_models
from vico.io.plain_data import decode, encode
from vico.seeds import rng
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.world.heights import HeightField
from vico.world.model import Category
from vico.world.public import PublicMap
from vico.world.walkable import OPEN, WalkableMap
from vico.world.world import World
from vico.worldgen.indoor.stage import furnish

ME = "assistant_0"


def hotel() -> World:
    """The toy city, its café made into a hotel of three floors."""
    base = toy_city.world()
    house = base.buildings[0].model_copy(update={"levels": 9})
    changes = {"kind": "hotel", "category": Category.ACCOMMODATION, "rooms": []}
    place = base.places[0].model_copy(update=changes)
    made = furnish([place], buildings=[house], height=base.height, seed=0)
    return World(
        base.manifest, height=base.height, buildings=[house], places=[made.places[0], base.places[2]],
        entrances=base.entrances, rooms=made.rooms, objects=made.furniture, roads=base.roads, transit=base.transit,
        walkable=base.walkable, layers=base._layers,
        models=base.prototypes() | {name: model.surfaces for name, model in furniture_models().items()},
    )  # fmt: skip


class Visitor:
    """Carries out what the skills say, and counts collisions."""

    def __init__(self, world: World) -> None:
        self.sim = Simulation(world, None, SimConfig(assistants=1, observe=(ME,), cars=0, pedestrians=0))
        self.sim.scenario.place_agent(ME, (-5.0, 4.0), yaw=math.pi / 2)
        self.skills = AssistantSkills(PublicMap.from_world(world), rng(0, "navigation test"))
        self.collisions = 0
        self.look()

    def look(self) -> None:
        observations, infos = self.sim.observe()
        self.view = ObservationView(observations[ME], infos[ME])
        self.skills.notice(self.view)

    def do(self, action: dict) -> None:
        self.sim.step({ME: action})
        self.look()
        self.collisions += self.view.state["action_status"] == "collision"

    def until(self, act, done, limit: int) -> int:
        for step in range(limit):
            if done():
                return step
            action = {"type": "wait"} if self.view.info.get("coming_out") else act()
            assert action is not None
            self.do(action)
        raise AssertionError(f"still at {self.view.pose.round(2)} in {self.view.room} after {limit} steps")


@pytest.fixture(scope="module")
def visitor() -> Visitor:
    return Visitor(hotel())


def test_an_assistant_gets_up_and_down_the_stairs_of_a_hotel_and_out_again(visitor: Visitor) -> None:
    world, skills = visitor.sim.world, visitor.skills
    place = world.places[0]
    rooms = {room.id: room for room in world.rooms}
    visitor.until(lambda: skills.go_inside(visitor.view, place.id), lambda: visitor.view.place == place.id, 40)
    stairs = next(room for room in world.rooms if room.rise)
    lower = next(door for door in stairs.doors if door.position[2] < stairs.centre[2] + 0.5)
    upper = next(door for door in stairs.doors if door.position[2] > stairs.centre[2] + 0.5)
    way = [visitor.view.room]
    while way[-1] != lower.to:  # the rooms between the entrance and the stairs
        way.append(next(d.to for d in rooms[way[-1]].doors if d.to and d.to not in way and not rooms[d.to].rise))
    for room in [*way[1:], stairs.id, upper.to]:
        visitor.until(
            lambda room=room: skills.go_through(visitor.view, room), lambda room=room: visitor.view.room == room, 60
        )
    assert visitor.view.pose[2] == pytest.approx(stairs.centre[2] + stairs.rise, abs=0.1)
    visitor.until(lambda: skills.leave(visitor.view), lambda: visitor.view.room is None, 150)
    assert visitor.collisions <= 3


def test_an_assistant_gets_to_every_surface_of_its_first_room_without_bumping_into_things() -> None:
    visitor = Visitor(hotel())
    skills, place = visitor.skills, visitor.sim.world.places[0]
    visitor.until(lambda: skills.go_inside(visitor.view, place.id), lambda: visitor.view.place == place.id, 40)
    room = next(room for room in visitor.sim.world.rooms if room.id == visitor.view.room)
    for _ in range(4):
        visitor.do({"type": "turn_left", "degrees": 85.0})
    surfaces = [surface for surface in room.containers if surface.kind != "floor"]
    assert len(surfaces) >= 3
    for surface in surfaces:
        spot = np.array(surface.reach)
        box = Target(*surface.centre[:2], surface.yaw, surface.size[0] / 2, surface.size[1] / 2, near=0.7)
        visitor.until(
            lambda box=box: skills.walk_to_box(visitor.view, box),
            lambda box=box: box.away(*visitor.view.pose[:2]) <= 0.7,
            40,
        )
        visitor.until(
            lambda spot=spot: skills.approach(visitor.view, spot, near=GRASP),
            lambda spot=spot: visitor.view.away(spot) <= GRASP,
            40,
        )
    assert visitor.collisions <= 1
    out = next(door for door in visitor.view.state["doors"] if door["to"] == OUTSIDE)
    assert skills.walk_indoors(visitor.view, out["position"], near=50.0) is None


def test_a_navigator_goes_on_from_its_state_in_a_room(visitor: Visitor) -> None:
    one = Visitor(hotel())
    place = one.sim.world.places[0]
    one.until(lambda: one.skills.go_inside(one.view, place.id), lambda: one.view.place == place.id, 40)
    out = next(door for door in one.view.state["doors"] if door["to"] != OUTSIDE)["position"]
    for _ in range(3):
        one.do(one.skills.walk_indoors(one.view, out, near=0.5) or {"type": "wait"})
    other = AssistantSkills(one.skills.map, rng(1, "another"))
    other.restore(decode(encode(one.skills.state())))
    for _ in range(8):
        action = one.skills.walk_indoors(one.view, out, near=0.5)
        assert other.walk_indoors(one.view, out, near=0.5) == action
        if action is None:
            break
        one.do(action)
        other.notice(one.view)


def open_ground() -> PublicMap:
    return PublicMap(
        40.0, WalkableMap(np.full((160, 160), OPEN, np.uint8), 40.0), HeightField.flat(40.0), [], [], [], []
    )
