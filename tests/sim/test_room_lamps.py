"""Which rooms and windows are lit: by the hour, by who is in, and by the power."""

from __future__ import annotations

from dataclasses import replace
from datetime import date

import numpy as np
import pytest

import toy_city
from vico.assets.interior import WINDOW
from vico.assets.shapes import box
from vico.errors import InputError
from vico.render import Cameras, Lighting, Scene, render
from vico.render.records import UPPER_WINDOWS
from vico.sim.bodies.state_arrays import Posture
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.pictures.buildings import RoomLamps, WindowLights
from vico.sim.pictures.scene import SceneRenderer
from vico.world.mesh import Material
from vico.world.model import Category

CAFE, BACK, SHOP = range(3)


def lit(hour: int, *, cut: bool = False, lies: bool = False) -> list[bool]:
    """Which rooms of the toy city are lit with one person in the shop, on a winter Thursday."""
    config = SimConfig(seed=3, assistants=1, observe=(), start=hour * 3600, date="2026-01-15", weather="clear")
    state = Simulation(toy_city.world(), toy_city.community(), config).state
    state.people.room[:] = -1
    state.people.room[0], state.people.posture[0] = SHOP, Posture.LYING if lies else Posture.STANDING
    if cut:
        state.environment.start_event("power_cut", region=(-6.0, 11.0, 5.0))
    return RoomLamps(state.world, date(2026, 6, 11)).lit_rooms(state).tolist()


def test_rooms_are_lit_by_day_when_they_are_open_and_when_somebody_is_awake_in_them() -> None:
    assert lit(12) == [True, True, True]
    assert lit(3) == [False, False, True]
    assert lit(3, lies=True) == [False, False, False]
    assert lit(18)[CAFE]


def test_a_power_cut_puts_the_lamps_of_its_district_out_and_no_others() -> None:
    assert lit(12, cut=True) == [False, True, True]


def test_rooms_have_less_daylight_under_clouds_and_none_at_night(monkeypatch: pytest.MonkeyPatch) -> None:
    let_in: list[float] = []
    monkeypatch.setattr(Scene, "light_rooms", lambda self, lamp, daylight: let_in.append(daylight))
    for hour, weather in ((1, "clear"), (12, "rain"), (12, "clear")):
        config = SimConfig(seed=3, observe=(), start=hour * 3600, date="2026-06-15", weather=weather)
        sim = Simulation(toy_city.world(), None, config)
        SceneRenderer(sim).show(sim.state)
    night, rain, day = let_in
    assert night == 0.0 < rain < 0.7 * day


def test_people_in_unlit_rooms_are_noticed_only_from_close_by() -> None:
    config = SimConfig(seed=3, observe=(), start=23 * 3600, date="2026-01-15", weather="clear")
    environment = Simulation(toy_city.world(), toy_city.community(), config).state.environment
    environment.start_event("power_cut", region=(0.0, 0.0, 30.0))
    points, indoors = np.zeros((2, 3)), np.array([True, False])
    assert np.asarray(environment.sight_of(points, indoors)).tolist() == [3.0, 15.0]


def room() -> Scene:
    """A room with a grey floor and wall, and a white window in that."""
    glass = Material(WINDOW, np.full((4, 4, 3), 255, np.uint8), emission=1.0)
    wall, floor = box((0.2, 8, 3), (4, 0, 1.5), colour=(150, 150, 150)), box((8, 8, 0.2), (0, 0, -0.1))
    pane = box((0.1, 2, 1), (3.9, 0, 1.5), colour=(255, 255, 255))
    return Scene(
        [],
        indoor=[wall, floor, replace(pane, material=glass, uv=pane.positions[:, 1:])],
        rooms=[[0, 0, 0, 4, 4, 3, 0.0]],
    )


def test_unlit_rooms_have_the_light_of_their_windows() -> None:
    made = room()
    camera = Cameras(np.array([[-3.0, 0, 1.6]]), np.array([[1.0, 0, 0]]), width=64, height=64)
    seen = {}
    for name, lamp, daylight in (("lamp", 1.0, 1.0), ("evening", 1.0, 0.0), ("day", 0.0, 1.0), ("night", 0.0, 0.0)):
        made.light_rooms(lamp, daylight)
        picture = render(made, camera).rgb[0].astype(int).mean(axis=2)
        seen[name] = picture[32, 32], picture[48, 32]
    pane, ground = ({name: both[k] for name, both in seen.items()} for k in (0, 1))
    assert min(pane["lamp"], pane["day"]) > 150 > 80 > max(pane["evening"], pane["night"])
    assert ground["lamp"] == ground["evening"] > ground["day"] > 3 * ground["night"]
    # In one without windows it is as dark by day.
    made.rooms["windows"] = 0.0
    made.light_rooms(0.0, 1.0)
    assert render(made, camera).rgb[0, 48, 32].mean() == ground["night"]


def city_with_homes() -> Simulation:
    """The toy city with the café's rooms as the home of its residents, at three at night."""
    world = toy_city.world()
    home = {"category": Category.ACCOMMODATION, "kind": "apartments"}
    world.places[0] = world.places[0].model_copy(update=home)
    config = SimConfig(seed=3, observe=(), start=3 * 3600, date="2026-01-15", weather="clear")
    return Simulation(world, toy_city.community(), config)


def test_windows_of_a_home_shine_while_somebody_is_awake_in_it_and_shops_while_they_are_open() -> None:
    sim = city_with_homes()
    people, world = sim.state.people, sim.world
    lights = WindowLights(world, sim.residents, RoomLamps(world, date(2026, 6, 11)))
    scene = Scene([], lighting=Lighting.at(3 * 3600.0))
    seen = []
    for place, posture in ((0, Posture.STANDING), (0, Posture.LYING), (-1, Posture.STANDING), (1, Posture.STANDING)):
        people.place[:], people.posture[:] = place, posture
        lights.set(scene, sim.state)
        windows = scene.arrays.windows
        assert windows["building"].tolist() == sorted(building.entity for building in world.buildings)
        first = np.flatnonzero(windows["building"] == world.buildings[0].entity)[0]
        seen.append(windows["shares"][first].tolist())
    home, asleep, away, shop = seen
    assert home[0] == 1.0 > 0.1 > asleep[0] == away[0] == shop[0]
    assert home[1] == asleep[1] == away[1] < 0.5 < shop[1]
    nobody = np.zeros(len(world.places), bool)
    assert lights.shares(11 * 3600.0, nobody)[0, 1] == 1.0
    scene.lighting = Lighting.at(12 * 3600.0)
    lights.set(scene, sim.state)
    assert not len(scene.arrays.windows)


def test_windows_of_one_building_go_out_and_those_of_another_stay() -> None:
    glass = Material("wall", np.full((4, 4, 4), 255, np.uint8), emission=1.0)
    number, beside = 80_000_010, 80_000_011
    houses = [box((1, 4, 4), (8, y, 2)).of_entity(entity) for y, entity in ((2.5, number), (-2.5, beside))]
    made = Scene(
        [replace(house, material=glass, uv=house.positions[:, 1:]) for house in houses], lighting=Lighting.at(82_800.0)
    )
    made.arrays.textures.materials["windows"][made.material_names.index("wall")] = UPPER_WINDOWS
    camera = Cameras(np.array([[0.0, 0, 2]]), np.array([[1.0, 0, 0]]), width=64, height=64)
    before = render(made, camera).rgb[0].astype(int)
    for given in ([number], [number, beside], [90_000_000, 3, number], [5, number, 70]):  # in any order, with others
        made.light_windows(given, [[float(entity != number), 0.0 if entity != beside else 1.0] for entity in given])
        after = render(made, camera).rgb[0].astype(int)
        assert after[32, 22].mean() < 0.5 * before[32, 22].mean()
        assert after[32, 42].tolist() == before[32, 42].tolist()
    for none in ([], None, [9, 12]):
        made.light_windows(none, np.zeros((len(none or []), 2)))
        assert np.array_equal(render(made, camera).rgb[0], before)
    with pytest.raises(InputError, match="shares of windows"):
        made.light_windows([number, beside], [[1.0, 1.0]])
