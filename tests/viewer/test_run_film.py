"""Films of recorded runs: the same run once more, smooth between its steps, from a camera outside of walls."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import toy_city
from command_line import vico
from vico.agents.schedule import followers_of
from vico.assets.shapes import box, pose_matrix
from vico.cli.film import followed_name
from vico.errors import InputError, SchemaError
from vico.io.files import write_json
from vico.render import Scene
from vico.render.film import read_film
from vico.render.frames import PLAIN_QUALITY
from vico.render.limbs import LIMBS
from vico.render.motion import SceneMoment, interpolate_transforms, moment_of, show_interpolated
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.recording import Run, read_run
from vico.sim.recording.manifest import CastMember
from vico.sim.recording.recorder import Recorder
from vico.viewer.follow_camera import FollowCamera, Target, target_between, target_of
from vico.viewer.run_film import FilmSettings, RepeatedRun, Span, read_shots, still, write_film_of_shots, write_run_film
from vico.world.mesh import merge_surfaces
from vico.world.public import PublicMap

STEPS = 12


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Some seconds of the toy city, with a checkpoint in the middle."""
    config = SimConfig(start=8 * 3600 - 20, observe=())
    sim = Simulation(toy_city.world(), toy_city.community(), config)
    agents = followers_of(toy_city.community(), PublicMap.from_world(sim.world))
    out = tmp_path_factory.mktemp("film") / "run"
    with Recorder(out, sim, sources={}, wanted=STEPS, states_every=5) as recorder:
        observations, infos = sim.observe()
        recorder.begin(observations)
        for _ in range(STEPS):
            actions = {name: agent.act(observations[name], infos[name]) for name, agent in agents.items()}
            result = sim.step(actions)
            observations, infos = result.observations, result.infos
            recorder.write(result, actions=actions)
            if recorder.checkpoint_due:
                recorder.checkpoint({})
    return read_run(out)


def repeated(run: Run) -> RepeatedRun:
    return RepeatedRun(run, toy_city.world(), toy_city.community())


def test_a_run_is_the_same_once_more_and_smooth_in_between(run: Run) -> None:
    again = repeated(run)
    again.go_to(7)
    assert again.sim.state_hash() == run.hashes[7]
    name = max(again.sim.state.people.names[:4], key=lambda who: _travelled(run, who))
    seen = [target_of(again.sim.state, name)]
    for tenths in again.moments(STEPS, lambda state: target_of(state, name)):
        assert len(tenths) == 10
        seen += tenths
    assert again.sim.state_hash() == run.hashes[STEPS]
    moved = [float(np.linalg.norm(b.position - a.position)) for a, b in itertools.pairwise(seen)]
    assert 0 < max(moved) < 0.3


def _travelled(run: Run, name: str) -> float:
    entity = next(agent["entity"] for agent in run.agents if agent["name"] == name)
    tracks = run.tracks(7, STEPS)
    path = tracks.position[:, tracks.entity.tolist().index(entity), :2]
    return float(np.nan_to_num(np.linalg.norm(np.diff(path, axis=0), axis=1)).sum())


def test_a_film_has_all_its_frames_and_shows_who_is_followed(run: Run, tmp_path: Path) -> None:
    settings = FilmSettings(follow="resident_0", width=96, height=64, rate=20, samples=1, view="behind")
    frames = write_run_film(tmp_path / "film.mp4", repeated(run), settings, first=4, last=6)
    assert frames == 41
    shown = list(read_film(tmp_path / "film.mp4"))
    assert len(shown) == 41
    assert shown[0].shape == (64, 96, 3)
    eyes = FilmSettings(follow="resident_0", width=96, height=64, view="eyes", samples=1)
    assert still(repeated(run), eyes, 5).std() > 5


def test_a_film_cuts_between_the_shots_of_a_file(run: Run, tmp_path: Path) -> None:
    shots = [
        {"start": "4", "stop": "6", "follow": "resident_0", "view": "above", "speed": 2.0},
        {"start": "8", "stop": "9", "follow": "resident_1", "angle": {"away": 1.2, "around": 90.0}},
    ]
    path = tmp_path / "shots.json"
    write_json(path, {"schema_name": "vico.shots", "version": 1, "shots": shots})
    plain = FilmSettings(follow="", width=96, height=64, rate=10, samples=1, quality=PLAIN_QUALITY)
    read = [
        Span(replace(plain, follow=s.follow, view=s.view, angle=s.angle, speed=s.speed), int(s.start), int(s.stop))
        for s in read_shots(path)
    ]
    assert write_film_of_shots(tmp_path / "film.mp4", repeated(run), read) == 11 + 11
    shown = list(read_film(tmp_path / "film.mp4"))
    changes = [float(np.abs(b.astype(float) - a).mean()) for a, b in itertools.pairwise(shown)]
    assert int(np.argmax(changes)) == 10  # the cut
    with pytest.raises(InputError, match="filmed forwards"):
        write_film_of_shots(tmp_path / "film.mp4", repeated(run), read[::-1])
    write_json(path, {"schema_name": "vico.shots", "version": 1, "shots": [shots[0] | {"zoom": 2}]})
    with pytest.raises(SchemaError, match=r"shots\.json: shots\.0\.zoom: Extra inputs"):
        read_shots(path)


def test_a_thing_can_be_looked_at_from_near_by() -> None:
    sim = Simulation(toy_city.world(), toy_city.community(), SimConfig(observe=()))
    sim.scenario.add_object(
        "red box", "parcel", [box((0.2, 0.2, 0.2), (0, 0, 0.1))], (2.0, 1.0, 0.0), size=(0.2, 0.2, 0.2), yaw=0.5
    )
    target = target_of(sim.state, "red box")
    assert (target.yaw, target.size) == (pytest.approx(0.5), pytest.approx(0.2))
    eye = FollowCamera("close", 64, 36).look(Scene([box((80, 80, 1), (0, 0, -0.5))]), target, 0.04)
    assert 0.8 < float(np.linalg.norm(eye.position[0] - target.position)) < 1.5
    assert eye.hidden_entity == 0


def test_another_run_is_refused(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    again = repeated(run)
    monkeypatch.setattr(type(run), "hashes", [*run.hashes[:3], "0" * 64, *run.hashes[4:]])
    with pytest.raises(SchemaError, match="step 3 is another one than recorded"):
        again.go_to(4)


def test_who_is_not_there_cannot_be_followed(run: Run, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nobody is called 'Bob'"):
        write_run_film(tmp_path / "film.mp4", repeated(run), FilmSettings(follow="Bob"), first=0, last=2)
    assert not list(tmp_path.iterdir())


def test_people_are_filmed_by_name(run: Run, tmp_path: Path) -> None:
    agent, name = next((agent, name) for agent, name in run.names.items() if agent.startswith("resident"))
    assert name != agent
    assert followed_name(run, name.upper(), 0, run.last, option="film: --follow") == agent
    by_name = FilmSettings(follow=name, width=64, height=64, samples=1, quality=PLAIN_QUALITY)
    picture = still(repeated(run), by_name, 5)
    assert np.array_equal(picture, still(repeated(run), replace(by_name, follow=agent), 5))


def test_a_name_that_is_wrong_is_told_before_the_world_is_read(
    run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name = run.names["resident_0"]
    wrong, out = f"{name[:-1]}x", tmp_path / "film.mp4"
    shots = [{"start": "0", "stop": "2", "follow": wrong}]
    write_json(tmp_path / "shots.json", {"schema_name": "vico.shots", "version": 1, "shots": shots})
    for words, option in (
        (("film", run.path, "--follow", wrong, "--out", out), "film: --follow"),
        (("film", run.path, "--shots", tmp_path / "shots.json", "--out", out), "shot 1: follow"),
        (("still", run.path, "--follow", wrong, "--out", tmp_path / "still.png"), "still: --follow"),
    ):
        assert vico(*words) == 2
        told = capsys.readouterr().err
        assert f"{option}: nobody is called {wrong!r}; did you mean {name} (resident_0)?" in " ".join(told.split())
        assert "world" not in told


def test_what_is_there_for_a_part_of_the_run_alone_is_told_with_its_times(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    car = CastMember(1, "car", "car 7", (4.0, 1.8, 1.5), None, None, ((2, 6), (9, None)))
    monkeypatch.setattr(run, "cast", {1: car})
    assert followed_name(run, "car 7", 2, 5, option="film: --follow") == "car 7"
    assert followed_name(run, "car 7", 9, run.last, option="film: --follow") == "car 7"
    with pytest.raises(InputError, match=r"car 7 is there from 07:59:42 to 07:59:45, 07:59:49 to 07:59:52 alone"):
        followed_name(run, "car 7", 4, 10, option="film: --follow")


def test_half_way_is_half_turned_and_as_large() -> None:
    a, b = pose_matrix(0, 0, 0, 0.2)[None, :3], pose_matrix(1.0, 0, 2.0, 0.8)[None, :3]
    a, b = (m.astype(np.float32) * np.array([2, 2, 2, 1], np.float32) for m in (a, b))
    half = interpolate_transforms(a, b, 0.5)[0]
    assert math.atan2(half[1, 0], half[0, 0]) == pytest.approx(0.5, abs=1e-4)
    assert np.linalg.norm(half[:, 0]) == pytest.approx(2.0, abs=1e-4)
    assert half[:, 3].tolist() == [0.5, 0.0, 1.0]


def test_things_and_bodies_go_half_way_and_what_leaps_waits() -> None:
    scene = Scene([], {"cube": [box((1, 1, 1), (0, 0, 0))]})
    figure = box((0.5, 0.5, 1.8), (0, 0, 0.9)).of_entity(9)
    moments = []
    for x, leap in ((0.0, 0.0), (1.0, 50.0)):
        scene.set_rigid([0, 0], np.array([pose_matrix(x, 0, 0, 0), pose_matrix(leap, 5, 0, 0)]), [1, 2])
        vertices = (figure.positions + np.array([x, 0, 0])).astype(np.float32)
        limbs = np.full((1, len(LIMBS), 7), x, np.float32)
        scene.set_skinned(vertices, figure.normals, figure.triangles, figure.colour, figure.entity, limbs=limbs)
        moments.append(moment_of(scene, x))
    show_interpolated(*moments, 0.25)
    assert scene.arrays.instances.matrix[:2, 0, 3].tolist() == [0.25, 0.0]
    assert scene.arrays.avatars.low[0].tolist() == pytest.approx([0.0, -0.25, 0.0], abs=1e-6)
    assert np.unique(scene.arrays.avatars.limbs).tolist() == [0.25]
    assert scene.moment == 0.25


def test_avatars_that_are_not_drawn_at_a_moment_are_nowhere_in_its_frames() -> None:
    scene = Scene([box((40, 40, 1), (0, 0, -0.5)).of_entity(2)])
    bodies = merge_surfaces([box((0.4, 0.4, 1.0 + 0.2 * k), (0, 3.0 * k, 0.5)).of_entity(10 + k) for k in range(3)])[0]
    shape = bodies.normals, bodies.triangles, bodies.colour, bodies.entity

    def shown(x: float, drawn: list[int]) -> SceneMoment:
        positions = bodies.positions + np.array([x, 0, 0], np.float32)
        positions[~np.isin(bodies.entity, [10 + k for k in drawn])] = np.nan  # nobody makes those
        scene.set_skinned(positions, *shape, drawn=np.array(drawn, np.int64))
        return moment_of(scene, x)

    moments = [shown(x, drawn) for x, drawn in ((0.0, [1, 2]), (1.0, [1, 2]), (2.0, [0, 2]), (3.0, []))]

    def places() -> dict[int, float]:
        avatars = scene.arrays.avatars
        entity = scene.arrays.mesh.entity[avatars.span["first_triangle"]].tolist()
        return {one: round(float(x), 3) for one, x in zip(entity, (avatars.low + avatars.high)[:, 0] / 2, strict=True)}

    show_interpolated(moments[0], moments[1], 0.25)
    assert places() == {11: 0.25, 12: 0.25}
    show_interpolated(moments[1], moments[2], 1.0)
    assert places() == {10: 2.0, 12: 2.0}
    show_interpolated(moments[2], moments[3], 0.5)
    assert places() == {}
    show_interpolated(moments[0], moments[1], 1.0)
    assert places() == {11: 1.0, 12: 1.0}


def test_avatars_want_all_their_vertices() -> None:
    scene = Scene([box((40, 40, 1), (0, 0, -0.5)).of_entity(2)])
    body = box((0.4, 0.4, 1.0), (0, 0, 0.5)).of_entity(10)
    scene.set_skinned(body.positions, body.normals, body.triangles, body.colour, body.entity)
    with pytest.raises(InputError, match="for avatars of"):
        scene.repose(body.positions[1:], body.normals[1:])


@pytest.mark.parametrize("view", ["behind", "front", "side", "above", "orbit"])
def test_the_camera_follows_smoothly_and_stays_before_walls(view: str) -> None:
    """Along a street 5 m wide whose walls are nearer than the camera would like to be, round a corner."""
    scene = Scene(
        merge_surfaces([box((80, 1, 8), (0, 3, 4)), box((80, 1, 8), (0, -3, 4)), box((80, 80, 1), (0, 0, -0.5))])
    )
    camera = FollowCamera(view, 64, 36)
    last = None
    for k in range(100):
        yaw = 0.0 if k < 50 else math.pi / 2
        target = Target(np.array([0.05 * k - 5.0, 1.5, 0.0]), yaw, 0.0, 1.6, 1)
        eye = camera.look(scene, target, 0.04)
        place = eye.position[0]
        assert -2.45 < place[1] < 2.45
        assert place[2] > 0.1
        if last is not None:
            assert np.linalg.norm(place - last) < (0.9 if view == "above" else 0.6)
        last = place


def test_the_camera_rises_above_who_comes_near_it() -> None:
    """Somebody walks from behind the camera towards whom it looks at, right through where it would be."""
    scene = Scene([box((80, 80, 1), (0, 0, -0.5))])
    camera, top, last = FollowCamera("front", 64, 36), 1.8, None
    for k in range(200):
        other = np.array([[12.0 - 0.06 * k, 0.6, top]])
        eye = camera.look(scene, Target(np.zeros(3), 0.0, 0.0, 1.6, 1, others=other), 0.04)
        place = eye.position[0]
        if float(np.hypot(*(place[:2] - other[0, :2]))) < 0.5:
            assert place[2] > top + 0.1
        assert last is None or np.linalg.norm(place - last) < 0.12
        last = place
    assert place[2] < 1.8


def test_through_a_door_the_camera_is_there_at_once() -> None:
    a = Target(np.zeros(3), 0.0, 0.0, 1.6, 1)
    b = a._replace(position=np.array([30.0, 0, 0]), room=3)
    assert target_between(a, b, 0.9).position.tolist() == [0, 0, 0]
    assert target_between(a, b, 1.0).position.tolist() == [30, 0, 0]


@pytest.mark.parametrize("view", ["behind", "front", "side", "orbit"])
def test_in_a_shop_the_camera_sees_whom_it_follows_over_the_racks(view: str) -> None:
    """Between racks 1.4 m high, 1.2 m apart, under a ceiling: it never comes so near that nobody is drawn."""
    racks = [box((3.0, 0.5, 1.4), (0.0, y, 0.7)) for y in (-2.55, -0.85, 0.85, 2.55)]
    scene = Scene(merge_surfaces([box((20, 20, 1), (0, 0, -0.5)), box((20, 20, 1), (0, 0, 3.3)), *racks]))
    camera = FollowCamera(view, 64, 36)
    for k in range(80):
        # Along an aisle, and at its end round the rack.
        angle = 0.0 if k < 40 else (k - 40) / 40 * math.pi
        eye = camera.look(scene, Target(np.array([0.03 * k - 1.0, 0.0, 0.0]), angle, 0.0, 1.6, 7, room=2), 0.04)
        assert eye.hidden_entity == 0
        assert eye.position[0, 2] > 1.7
