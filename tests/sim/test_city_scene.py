"""Pictures in a city: the tiles around a camera in full, the others from afar, whatever is in memory."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from shared_folders import Shared
from vico.community.author import build_community
from vico.community.model import Community
from vico.errors import InputError, MissingFileError
from vico.render import Cameras
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.physics import mujoco_scene
from vico.sim.physics.surroundings import CityChunks, surroundings_of
from vico.sim.pictures import city as city_pictures
from vico.sim.pictures.buildings import RoomsInSight
from vico.sim.pictures.city import CityRenderer, Neighbourhood
from vico.sim.pictures.people import DrawnPeople
from vico.world.city_world import CityWorld
from vico.world.folder import read_world
from vico.world.model import ENTITY_BACKDROP
from vico.world.silhouettes import CitySilhouettes
from vico.worldgen.city_build import build_city, city_request
from vico.worldgen.request import Sources

EXTRACT = Path(__file__).parents[2] / "src" / "vico" / "data" / "helsinki.osm.pbf"
LAT, LON = 60.1690, 24.9435
# Metres in full around a camera: little enough that two tiles of 160 m do, and four in a row have three neighbourhoods.
NEAR = 60.0
CONFIG = SimConfig(cars=6, pedestrians=30, transit=False, image=64, outputs=("rgb", "segmentation", "flow"))


def test_who_is_in_the_middle_of_a_tile_and_who_at_its_edge_see_as_far() -> None:
    assert Neighbourhood.around(10.0, 10.0, 1.6, 400.0) == (0, 0, 1)
    assert Neighbourhood.around(-10.0, 390.0, 1.6, 400.0) == (-1, 0, 1)
    assert Neighbourhood.around(10.0, 10.0, 1.6, 400.0).tiles == [(0, 0), (1, 0), (0, 1), (1, 1)]
    for x in np.linspace(-300.0, 300.0, 61).tolist():
        for size in (160.0, 400.0, 800.0):
            found = Neighbourhood.around(x, 0.0, 1.6, size)
            west, east = ((found.column + side * found.rings + 0.5) * size for side in (-1, 1))
            assert min(x - west, east - x) >= city_pictures.NEAR


def test_who_is_high_up_sees_more_tiles_in_full() -> None:
    rings = [Neighbourhood.around(0.0, 0.0, height, 400.0).rings for height in (1.6, 25.0, 100.0, 300.0, 5000.0)]
    assert rings == sorted(rings)
    assert rings[0] == rings[1] == 1
    assert rings[-1] == 3


def test_a_budget_is_some_memory() -> None:
    for memory in (0.0, -1.0, float("inf"), float("nan")):
        with pytest.raises(InputError, match="memory"):
            replace(CONFIG, memory=memory)


@pytest.fixture(scope="module")
def city(shared: Shared) -> CityWorld:
    """Four tiles in a row."""

    def make(out: Path) -> None:
        box = LON - 0.0055, LAT - 0.0005, LON + 0.0035, LAT + 0.0005
        out.mkdir()
        build_city(city_request(Sources(EXTRACT), lat=LAT, lon=LON, extent=box, tile=160.0, out=out / "row"), workers=2)

    world = read_world(shared("row_of_tiles", make, ["worldgen"]) / "row")
    assert isinstance(world, CityWorld)
    assert len(world.city.manifest.tiles) == 4
    return world


@pytest.fixture(scope="module")
def people(city: CityWorld) -> Community:
    return build_community(city, 6)


@pytest.fixture
def _two_tiles_in_full(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(city_pictures, "NEAR", NEAR)


def _run(city: CityWorld, people: Community, steps: int = 12, **options: Any) -> tuple[list[Any], str]:
    """Return what all see in a run, step by step, and the state's hash at its end."""
    sim = Simulation(city, people, replace(CONFIG, **options))
    seen = []
    for _ in range(steps):
        step = sim.step({})
        told = {name: one for name, one in step.observations.items() if "rgb" in one}
        seen.append({name: {output: np.array(one[output]) for output in CONFIG.outputs} for name, one in told.items()})
    return seen, sim.state_hash()


def _are_equal(a: list[Any], b: list[Any]) -> bool:
    return all(
        np.array_equal(one[name][output], other[name][output])
        for one, other in zip(a, b, strict=True)
        for name in other
        for output in other[name]
    )


@pytest.mark.slow
@pytest.mark.usefixtures("_two_tiles_in_full")
def test_what_is_seen_and_what_happens_depend_neither_on_the_budget_nor_on_who_looks(
    city: CityWorld, people: Community, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen, state = _run(city, people)
    monkeypatch.setattr("vico.sim.loop.simulation._PAGES_EVERY", 1)
    assert any(np.abs(one["flow"]).max() > 0.0 for one in seen[-1].values())
    again, same = _run(city, people, memory=1e-6)
    assert _are_equal(seen, again)
    assert same == state
    alone = "resident_2"
    some, same = _run(city, people, observe=(alone,))
    assert same == state
    assert _are_equal(seen, [{alone: step[alone]} for step in some])
    assert _run(city, people, observe=())[1] == state


@pytest.mark.slow
@pytest.mark.usefixtures("_two_tiles_in_full")
def test_who_is_in_a_room_that_nobody_sees_has_no_body_and_pictures_are_the_same(
    city: CityWorld, monkeypatch: pytest.MonkeyPatch
) -> None:
    many = build_community(city, 16)
    chosen: list[int] = []
    choose = DrawnPeople.choose

    def counted(self: DrawnPeople, rows: NDArray[np.int64]) -> None:
        chosen.append(len(rows))
        choose(self, rows)

    monkeypatch.setattr(DrawnPeople, "choose", counted)
    some, state = _run(city, many, steps=40, quality="fine", start=28_500)
    of_some, chosen = max(chosen), []
    monkeypatch.setattr(RoomsInSight, "seen_from", lambda self, eyes: np.ones(len(city.rooms), np.bool_))
    everybody, same = _run(city, many, steps=40, quality="fine", start=28_500)
    assert state == same
    assert _are_equal(some, everybody)
    assert of_some < max(chosen)


@pytest.fixture
def renderer(_two_tiles_in_full: None, city: CityWorld, people: Community) -> tuple[Simulation, CityRenderer]:
    sim = Simulation(city, people, replace(CONFIG, memory=1e-6))
    found = sim.renderer
    assert isinstance(found, CityRenderer)
    return sim, found


def _camera(eye: tuple[float, float, float], ahead: tuple[float, float, float]) -> Cameras:
    return Cameras(np.array([eye]), np.array([ahead]), width=160, height=90)


@pytest.mark.slow
def test_each_scene_has_the_tiles_around_in_full_and_the_others_as_silhouettes(
    renderer: tuple[Simulation, CityRenderer], city: CityWorld
) -> None:
    sim, made = renderer
    triangles = {}
    for x in (-300.0, 0.0, 200.0):
        eye = np.array([x, 0.0, float(city.height(np.array([[x, 0.0]]))[0]) + 1.6])
        (where,) = made.neighbourhoods(eye[None])
        scene = made.show(sim.state, eye)
        shown = set(np.unique(scene.arrays.mesh.entity).tolist())
        for tile in city.city.manifest.tiles:
            part = city.part([(tile.column, tile.row)])
            houses = {building.entity for building in part.buildings}
            assert len(houses & shown) >= 0.9 * len(houses)
            is_near = (tile.column, tile.row) in where.tiles
            rooms = set(part.room_numbers.tolist())
            assert (bool(rooms) and (len(scene.rooms) >= len(rooms)) == is_near) or not is_near
        triangles[where] = len(scene.arrays.mesh.triangle)
    assert len(triangles) == 3


@pytest.mark.slow
def test_people_have_bodies_where_they_are_near_and_nobody_else_has(
    renderer: tuple[Simulation, CityRenderer], city: CityWorld
) -> None:
    sim, made = renderer
    for x in (-300.0, 100.0):
        eye = np.array([x, 0.0, 20.0])
        (where,) = made.neighbourhoods(eye[None])
        scene = made.show(sim.state, eye)
        first = int(scene.arrays.avatars.span["first_triangle"].min(initial=2**30))
        drawn = set(np.unique(scene.arrays.mesh.entity[first:]).tolist()) - {0}
        west, east = ((where.column + side * where.rings + 0.5) * 160.0 for side in (-1, 1))
        here: set[int] = set()
        away: set[int] = set()
        assert sim.state.traffic is not None
        for lot in (sim.state.people, sim.state.traffic.walkers):
            place: NDArray[np.float64] = lot.position
            inside = (place[:, 0] >= west) & (place[:, 0] <= east) & (np.abs(place[:, 1]) <= 80.0)
            here |= set(lot.entity[inside].tolist())
            # Who is nearer than that may have a body that is not drawn yet.
            away |= set(lot.entity[(place[:, 0] < west - 45.0) | (place[:, 0] > east + 45.0)].tolist())
        assert here
        assert here <= drawn
        assert away
        assert not away & drawn


def test_beyond_the_edge_the_city_is_seen_mirrored(city: CityWorld) -> None:
    size = city.city.manifest.size
    places = [(tile.column, tile.row) for tile in city.city.manifest.tiles]
    last = max(places)
    surfaces = CitySilhouettes(city.city).beyond({last}, 2)
    around = [surface for surface in surfaces if (surface.entity == ENTITY_BACKDROP).all()]
    # Of 25 places three are tiles of the city; each is of the ground and, where there are any, of walls with windows.
    assert 22 < len(around) <= 44
    edge = (last[0] + 0.5) * size
    beyond = np.concatenate([s.positions[s.triangles].reshape(-1, 3, 3) for s in around])
    low, high = (np.array(places).min(axis=0) - 0.5) * size, (np.array(places).max(axis=0) + 0.5) * size
    assert not ((beyond[..., :2] > low + 0.5) & (beyond[..., :2] < high - 0.5)).all(axis=-1).any()
    normals = np.concatenate([s.normals[s.triangles[:, 0]] for s in around])
    turn = np.cross(beyond[:, 1] - beyond[:, 0], beyond[:, 2] - beyond[:, 0])
    assert ((turn * normals).sum(axis=1) > 0.0).all()
    # The ground meets the city's at its edge, and houses stand on both sides of it as in a mirror.
    others = CitySilhouettes(city.city).beyond({(last[0] - 1, last[1])}, 1)
    inside = np.concatenate([s.positions for s in others if (s.entity != ENTITY_BACKDROP).any()])
    mirrored = np.concatenate([s.positions for s in around])
    beside = mirrored[(np.abs(mirrored[:, 0] - edge - 20.0) < 20.0) & (np.abs(mirrored[:, 1]) < size / 2)]
    near = {tuple(p) for p in np.round(beside, 1).tolist()}
    far = inside[np.abs(inside[:, 0] - edge + 20.0) < 20.0] * np.float32([-1, 1, 1]) + np.float32([2 * edge, 0, 0])
    assert len(near & {tuple(p) for p in np.round(far, 1).tolist()}) > 0.9 * len(near) > 50
    assert city.entities[ENTITY_BACKDROP]["kind"] == "backdrop"


# What robots meet.


def test_chunks_have_the_solids_of_a_city_whichever_tile_has_them(city: CityWorld) -> None:
    chunks = surroundings_of(city)
    assert isinstance(chunks, CityChunks)
    whole, along = chunks.whole(), round(2 * city.half / chunks.side)
    every = [(column, row) for column in range(along) for row in range(along)]
    joined = chunks.scene(every)
    assert [points.tobytes() for points in joined.hulls] == [points.tobytes() for points in whole.hulls]
    assert np.array_equal(joined.boxes, whole.boxes)
    assert np.array_equal(joined.pillars, whole.pillars)
    assert len(whole.hulls) > 50
    for column, row in every[along // 2 :: along]:
        west, south = np.array([column, row]) * chunks.side - city.half
        some = {points.tobytes() for points in chunks.scene([(column, row)]).hulls}
        inside = {
            points.tobytes()
            for points in whole.hulls
            if points[:, 0].min() <= west + chunks.side
            and points[:, 0].max() >= west
            and points[:, 1].min() <= south + chunks.side
            and points[:, 1].max() >= south
        }
        assert some == inside


def test_what_robots_do_is_the_same_whatever_of_a_city_is_loaded(
    city: CityWorld, people: Community, monkeypatch: pytest.MonkeyPatch
) -> None:
    states = []
    for needed, ahead in ((40.0, 160.0), (6.0, 6.0), (40.0, 2000.0)):
        monkeypatch.setattr(mujoco_scene, "_NEEDED", needed)
        monkeypatch.setattr(mujoco_scene, "_AHEAD", ahead)
        states.append(_run(city, people, 40, robots=("husky", "go2"), observe=())[1])
    assert states[0] == states[1] == states[2]


def test_a_tile_that_is_gone_when_a_robot_comes_near_is_named(city: CityWorld, tmp_path: Path) -> None:
    shutil.copytree(city.path, tmp_path / "row")
    copied = read_world(tmp_path / "row")
    assert isinstance(copied, CityWorld)
    chunks = CityChunks(copied)
    row, last = round(city.half / chunks.side), round(2 * city.half / chunks.side) - 1
    assert chunks.scene([(row, row)]).hulls
    shutil.rmtree(tmp_path / "row" / "tiles" / copied.city.manifest.tiles[0].name)
    with pytest.raises(MissingFileError, match=r"tile -2_0: .* is gone or not whole; the vico city build"):
        chunks.scene([(0, row)])
    assert chunks.scene([(last, row)]).squares is not None
