"""People sit and lie on seats and beds alone: free ones, one person a place, their hips on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import toy_city
from vico.agents.schedule import ScheduleFollower
from vico.assets.models.library import furniture_models
from vico.assets.people import J
from vico.seeds import rng
from vico.sim.bodies.rooms import Indoor
from vico.sim.bodies.seats import Seats
from vico.sim.bodies.state_arrays import Posture
from vico.sim.config import SimConfig
from vico.sim.loop.checks import overlaps_of
from vico.sim.loop.simulation import Simulation
from vico.sim.people.placement import place_in_room
from vico.sim.pictures.scene import SceneRenderer
from vico.world.objects import Objects
from vico.world.public import PublicMap
from vico.world.world import World
from vico.worldgen.indoor.stage import furnish

FLOOR = toy_city.FLOOR


def _piece(name: str, x: float, y: float, yaw: float, size: tuple[float, float, float], room: str) -> dict[str, Any]:
    z = FLOOR if room else toy_city.SLOPE * x
    return {
        "id": f"{room}{name}{x}",
        "entity": 300_000 + int(10 * (x + 50)),
        "kind": name,
        "group": "indoor" if room else "amenity",
        "prototype": name,
        "x": x,
        "y": y,
        "z": z,
        "yaw": yaw,
        "scale": 1.0,
        "size_x": size[0],
        "size_y": size[1],
        "size_z": size[2],
        "solid": True,
        "room": room,
    }


def furnished(beds: Sequence[dict[str, Any]] | None = None) -> World:
    """The toy city with a sofa in the café, a double bed in the room behind it, and a bench in the street."""
    world = toy_city.world()
    pieces = [
        _piece("sofa", -8.4, 11.0, 0.0, (0.8, 1.9, 0.84), "r_cafe"),
        *([_piece("bed_double", 1.0, 10.0, np.pi / 2, (2.04, 1.64, 0.95), "r_back")] if beds is None else beds),
        _piece("bench", -20.0, -15.0, 0.0, (0.6, 1.7, 0.9), ""),
    ]

    from vico.assets.models.library import street_models

    models = furniture_models() | street_models()
    parts = {name: getattr(world, name) for name in ("height", "buildings", "places", "entrances", "rooms", "roads")}
    parts |= {"transit": world.transit, "walkable": world.walkable}
    layers = ("ground", "buildings", "roofs", "rooms", "collision")
    return World(
        world.manifest,
        objects=Objects.joined([world.objects, Objects.from_rows(pieces)]),
        layers={name: world.surfaces(name) for name in layers},
        models=world.prototypes() | {name: models[name].surfaces for name in ("sofa", "bed_double", "bench")},
        **parts,
    )


def act(sim: Simulation, agent: str, **action: Any) -> dict[str, Any]:
    state: dict[str, Any] = sim.step({agent: action}).observations[agent]["state"]
    return state


def _hips(sim: Simulation) -> NDArray[np.float64]:
    """Return where the first avatar's hips are drawn, ENU metres."""
    scene = SceneRenderer(sim)
    motion, joints = scene.motions(sim.state)
    at = joints[0, [J["left_hip"], J["right_hip"]]].mean(axis=0)
    c, s = np.cos(motion.yaw[0]), np.sin(motion.yaw[0])
    found: NDArray[np.float64] = motion.position[0] + np.array([c * at[0] - s * at[1], s * at[0] + c * at[1], at[2]])
    return found


def test_one_sits_on_a_free_seat_within_reach_or_not_at_all() -> None:
    sim = Simulation(furnished(), None, SimConfig(assistants=4, observe=()))
    people = sim.state.people
    for i in range(4):
        sim.scenario.place_agent(f"assistant_{i}", (-18.9, -15.0 + 0.6 * (i - 1)))
    assert act(sim, "assistant_0", type="sleep")["action_code"] == "no_seat"  # a bench is no bed
    for i in range(3):
        assert act(sim, f"assistant_{i}", type="sit")["posture"] == "sitting"
    assert len(set(people.seat[:3].tolist())) == 3
    refused = act(sim, "assistant_3", type="sit")
    assert (refused["posture"], refused["action_code"]) == ("standing", "no_seat")
    assert act(sim, "assistant_0", type="stand")["posture"] == "standing"
    assert abs(float(people.position[0, 2]) - float(sim.world.height(people.position[0, :2]))) < 1e-6
    sim.scenario.place_agent("assistant_3", (-18.9, -15.6))
    assert act(sim, "assistant_3", type="sit")["posture"] == "sitting"
    sim.scenario.place_agent("assistant_1", (10.0, -30.0))
    assert act(sim, "assistant_1", type="sit")["action_code"] == "no_seat"


def test_hips_are_on_the_seat_and_the_body_looks_as_the_seat_does() -> None:
    sim = Simulation(furnished(), None, SimConfig(assistants=1, observe=()))
    sim.scenario.place_agent("assistant_0", (-19.0, -15.0), yaw=np.pi)
    act(sim, "assistant_0", type="sit")
    seats, seat = sim.state.seats, int(sim.state.people.seat[0])
    sim.advance(1.0)
    hips = _hips(sim)
    assert np.abs(hips[:2] - seats.position[seat, :2]).max() < 0.08
    assert 0.05 < hips[2] - seats.position[seat, 2] < 0.14  # a hand above the seat
    act(sim, "assistant_0", type="turn_left", degrees=90.0)
    assert _hips(sim) == pytest.approx(hips, abs=0.01)


def test_a_body_neither_jumps_nor_sinks_as_it_sits_down_and_gets_up() -> None:
    sim = Simulation(furnished(), None, SimConfig(assistants=1, observe=()))
    sim.scenario.place_agent("assistant_0", (-18.9, -15.4), yaw=2.0)
    sim.advance(1.0)
    scene = SceneRenderer(sim)
    places = []

    def note() -> None:
        motion, joints = scene.motions(sim.state)
        c, s = np.cos(motion.yaw[0]), np.sin(motion.yaw[0])
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        places.append(motion.position[0] + joints[0] @ turn.T)

    for kind in ("sit", "stand"):
        note()
        sim.act({"assistant_0": {"type": kind}})
        for _ in range(100):
            sim.advance(0.01)
            note()
    moved = np.linalg.norm(np.diff(np.array(places), axis=0), axis=2)
    # From over a metre away within 0.9 s: fast, but no jump.
    assert moved[:, J["pelvis"]].max() < 0.2
    ankles = np.array(places)[:, [J["left_ankle"], J["right_ankle"]]]
    assert moved[:, [J["left_ankle"], J["right_ankle"]]].max() < 0.45
    assert (ankles[:, :, 2] - sim.world.height(ankles.reshape(-1, 3)[:, :2]).reshape(-1, 2)).min() > 0.03


def test_residents_go_to_bed_and_sit_where_there_are_seats() -> None:
    world = furnished()
    community = toy_city.community()
    night = [toy_city.item("sleep", "00:00:00", "23:59:59", toy_city.CAFE)]
    meal = [toy_city.item("meal", "00:00:00", "23:59:59", toy_city.CAFE)]
    people = [r.model_copy(update={"schedule": night if k < 2 else meal}) for k, r in enumerate(community.residents)]
    sim = Simulation(world, community.model_copy(update={"residents": people}), SimConfig(start=3600, observe=()))
    # Who sleeps when the run begins lies in bed; got out of it, they go back.
    assert sim.state.people.posture.tolist() == [Posture.LYING, Posture.LYING, Posture.STANDING]
    act(sim, "resident_0", type="wake")
    agents = {r.id: ScheduleFollower(r, PublicMap.from_world(world)) for r in people}
    observations, infos = sim.observe()
    for _ in range(40):
        actions = {name: agents[name].act(observations[name], infos[name]) for name in agents}
        result = sim.step(actions)
        observations, infos = result.observations, result.infos
    assert sim.state.people.posture.tolist() == [Posture.LYING, Posture.LYING, Posture.SITTING]
    assert len(set(sim.state.people.seat.tolist())) == 3


def _bed(x: float, y: float, yaw: float) -> dict[str, Any]:
    return _piece("bed_single", x, y, yaw, (2.1, 0.94, 0.95), "r_back")


def _asleep(beds: Sequence[dict[str, Any]], people: int = 1) -> Simulation:
    """Return the café at night with these things in the room behind it, and residents who sleep there."""
    community = toy_city.community()
    night = [toy_city.item("sleep", "00:00:00", "23:59:59", toy_city.CAFE)]
    residents = [r.model_copy(update={"schedule": night}) for r in community.residents[:people]]
    community = community.model_copy(update={"residents": residents})
    return Simulation(furnished(beds), community, SimConfig(start=3600, observe=()))


def test_one_gets_out_of_a_bed_on_the_side_that_has_room() -> None:
    # The bed's left side is at the south wall; there is room on the right alone.
    sim = _asleep([_bed(0.0, 8.5, np.pi)])
    assert sim.state.people.posture[0] == Posture.LYING
    assert act(sim, "resident_0", type="wake")["action_status"] == "ok"
    x, y, _ = sim.state.people.position[0]
    assert y > 8.5 + 0.47 + 0.25
    assert np.hypot(x, y - 8.5) < 1.0
    assert act(sim, "resident_0", type="sleep")["action_status"] == "ok"


def test_nobody_lies_down_in_a_bed_that_furniture_cuts_off_from_the_door() -> None:
    fence = [_piece("wardrobe", 0.4, 9.5, 0.0, (0.5, 3.0, 2.0), "r_back")]
    fence += [_piece("bookcase", 1.5, 11.0, 0.0, (3.0, 0.3, 2.0), "r_back")]
    sim = _asleep([_bed(1.9, 8.5, 0.0), *fence])
    # There is room beside it, but no way from there to the door.
    assert sim.state.people.posture.tolist() == [Posture.STANDING]
    place_in_room(0, sim.state.indoor.index["r_back"], sim.state, near=np.array([1.9, 9.6]))
    told = act(sim, "resident_0", type="sleep")
    assert told["action_code"] == "no_seat"
    assert "got out of" in told["action_reason"]
    sim = _asleep([_bed(1.9, 8.5, 0.0), *fence, _bed(-1.5, 8.5, 0.0)], people=2)
    bed = sim.state.seats.position[sim.state.people.seat[0]]
    assert sim.state.people.posture.tolist() == [Posture.LYING, Posture.STANDING]
    assert bed[0] < 0.0


def test_who_cannot_get_up_is_told_what_is_in_the_way() -> None:
    sim = _asleep([_bed(0.0, 8.5, np.pi)])
    state, bed = sim.state, int(sim.state.people.seat[0])
    crowd = np.stack(np.meshgrid(np.arange(-3.0, 3.1, 0.5), np.arange(8.0, 12.1, 0.5)), axis=-1).reshape(-1, 2)
    state.taken_in = lambda room, *, without=-1: crowd  # type: ignore[method-assign]
    assert "somebody is in the way" in act(sim, "resident_0", type="wake")["action_reason"]
    state.seats._stands[0][bed] = 1
    assert "walls and furniture" in act(sim, "resident_0", type="wake")["action_reason"]


def test_nobody_sits_down_into_whoever_stands_beside_the_seat() -> None:
    sim = _asleep([_piece("chair", 1.0, 9.0, 0.0, (0.44, 0.42, 0.9), "r_back")], people=2)
    room = sim.state.indoor.index["r_back"]
    place_in_room(1, room, sim.state, near=np.array([1.0, 9.47]))
    place_in_room(0, room, sim.state, near=np.array([1.9, 9.0]))
    # The next free seat is in the other room.
    assert sim.observe()[1]["resident_0"]["rest"]["sit"]["door"] == "r_cafe"
    told = act(sim, "resident_0", type="sit")
    assert told["action_code"] == "no_seat"
    assert "stands at" in told["action_reason"]
    place_in_room(1, room, sim.state, near=np.array([1.0, 10.5]))
    assert sim.observe()[1]["resident_0"]["rest"]["sit"]["door"] == ""
    assert act(sim, "resident_0", type="sit")["posture"] == "sitting"
    assert overlaps_of(sim.state) == []


def test_a_seat_in_a_hall_is_taken_only_where_no_room_has_one(monkeypatch: pytest.MonkeyPatch) -> None:
    sim = _asleep([_piece("chair", 1.0, 9.0, 0.0, (0.44, 0.42, 0.9), "r_back")])
    state, room = sim.state, sim.state.indoor.index["r_back"]
    place_in_room(0, room, state, near=np.array([1.9, 9.0]))

    def leads_to() -> str:
        return str(sim.observe()[1]["resident_0"]["rest"]["sit"]["door"])

    assert leads_to() == ""
    state.indoor.is_passage[room] = True
    assert leads_to() == "r_cafe"
    monkeypatch.setattr(type(state), "seats_taken", lambda self: self.seats.room != room)
    assert leads_to() == ""


def test_random_people_never_sit_in_the_air() -> None:
    sim = Simulation(furnished(), None, SimConfig(assistants=3, observe=()))
    draw = rng(1, "sitting")
    for i in range(3):
        sim.scenario.place_agent(f"assistant_{i}", (-19.0, -15.0 + i))
    kinds = ("sit", "stand", "sleep", "wake", "drink", "move_forward", "turn_left")
    copy = None
    for step in range(60):
        actions = {}
        for name in sim.due:
            kind = str(draw.choice(kinds))
            more = {"move_forward": {"distance": 0.4}, "turn_left": {"degrees": 120.0}}.get(kind, {})
            actions[name] = {"type": kind, **more}
        sim.step(actions)
        people = sim.state.people
        seated = people.posture != Posture.STANDING
        assert (seated == (people.seat >= 0)).all()
        taken = people.seat[people.seat >= 0].tolist()
        assert len(set(taken)) == len(taken)
        if step == 30:
            copy = sim.snapshot()
    assert copy is not None
    end = sim.state_hash()
    sim.restore(copy)
    assert sim.state_hash() != end


def test_a_thing_on_a_chair_keeps_people_off_it() -> None:
    sim = Simulation(furnished(), None, SimConfig(assistants=1, observe=()))
    state = sim.state
    bench = state.seats.position[state.seats.in_room(-1)]
    for k, place in enumerate(bench):
        sim.scenario.add_object(f"box {k}", "box", [], place, size=(0.2, 0.2, 0.2))
    sim.scenario.place_agent("assistant_0", (-19.0, -15.0))
    assert act(sim, "assistant_0", type="sit")["action_code"] == "no_seat"
    assert replace(state.seats).lies.sum() == 2


def test_all_beds_of_homes_can_be_got_out_of(helsinki: World) -> None:
    # Before, furniture cut one in twenty off from the door: half of the bunks in narrow children's rooms.
    homes = [place.model_copy(update={"rooms": []}) for place in helsinki.places if place.kind == "apartments"]
    made = furnish(homes, buildings=helsinki.buildings, height=helsinki.height, seed=1)
    indoor = Indoor.from_world(made.rooms, made.places, made.furniture)
    seats = Seats.of(made.furniture, furniture_models(), indoor, helsinki.height)
    beds = np.flatnonzero(seats.lies)
    assert len(beds) > 4 * len(homes)
    cut_off = [made.rooms[seats.room[bed]].id for bed in beds.tolist() if seats.stand_before(bed, indoor) is None]
    assert cut_off == []
