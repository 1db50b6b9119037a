"""Robots of teaming tasks: what they say and understand, where they wait and look from, and that they remember."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import toy_city
from vico.agents.teaming import METHODS, make_team
from vico.agents.teaming.escort import Escort, Guide, waiting_spots
from vico.agents.teaming.object_search import Finder, Spotter, viewpoints
from vico.agents.teaming.people import LETS_GO
from vico.agents.teaming.team_skills import (
    ON_MY_WAY,
    caller_of,
    messages_from,
    object_location_message,
    parse_object_location,
)
from vico.errors import InputError
from vico.io.plain_data import decode, encode
from vico.world.public import PublicMap
from vico.world.walkable import OPEN, SIDEWALK

AREA = {"kind": "outdoor", "name": "the square", "place": None, "centre": [0.0, -10.0, 0.0], "radius": 15.0}
SHOP = {"kind": "place", "name": "Shop", "place": toy_city.SHOP, "centre": [5.0, 4.0, 0.0], "radius": 0.0}


@pytest.fixture(scope="module")
def public_map() -> PublicMap:
    return PublicMap.from_world(toy_city.world())


def told(category: str, **more: Any) -> dict[str, Any]:
    return {
        "category": category,
        "person": {"agent": "resident_2", "name": "Cleo Ek", "looks": "a woman"},
        "waits_at": [0.0, -8.0],
        "object": "red toolbox",
        "destination": SHOP if category == "accompany" else AREA,
        "period": 0.5,
    } | more


def felt(x: float, y: float, z: float = 0.3, *, yaw: float = 0.0, heard: Any = (), **state: Any) -> dict[str, Any]:
    quaternion = [np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]
    return {
        "pose": np.array([x, y, z, 1.0, 0.0, 0.0]),
        "sensors": {"base_pose": np.array([x, y, z, *quaternion]), "base_velocity": np.zeros(3)},
        "state": {"action_status": "ok", "action_reason": ""} | state,
        "events": [{"speaker": who, "text": text, "position": np.array(at, float)} for who, text, at in heard],
    }


def test_where_a_thing_lies_is_said_and_understood() -> None:
    text = object_location_message("red toolbox", np.array([-3.254, 41.0]))
    at = parse_object_location(text, "red toolbox")
    assert at is not None
    assert np.allclose(at, [-3.25, 41.0])
    assert parse_object_location(text, "blue toolbox") is None
    assert parse_object_location("The red toolbox lies somewhere.", "red toolbox") is None


def test_a_call_is_one_by_name_from_a_robot_near_by() -> None:
    here = (0.0, 0.0, 0.0)
    assert caller_of(felt(1, 1, heard=[("robot_1", "Cleo, come!", here)]), "Cleo Ek") == "robot_1"
    assert caller_of(felt(1, 1, heard=[("robot_1", "Ada, come!", here)]), "Cleo Ek") == ""
    assert caller_of(felt(30, 1, heard=[("robot_1", "Cleo, come!", here)]), "Cleo Ek") == ""
    assert caller_of(felt(1, 1, heard=[("resident_1", "Cleo, come!", here)]), "Cleo Ek") == ""
    assert [text for text, _ in messages_from(felt(0, 0, heard=[("robot_1", "Yes.", here)]), "robot_1")] == ["Yes."]


def test_one_waits_beside_a_door_on_free_ground_and_out_of_the_way(public_map: PublicMap) -> None:
    place = public_map.place_by_id[toy_city.SHOP]
    assert place.entrance is not None
    door, before = np.array(place.entrance), np.array(place.position)
    spots = waiting_spots(public_map, door, before, np.array([-20.0, -8.0]))
    assert spots
    for spot in spots:
        assert public_map.walkable.class_of(*spot.tolist()) in (OPEN, SIDEWALK)
        assert 2.0 < np.hypot(*(spot - door[:2])) < 4.0
        out = (before - door)[:2] / np.hypot(*(before - door)[:2])
        assert abs((spot - door[:2]) @ np.array([-out[1], out[0]])) > 1.0
    away = [float(np.hypot(*(spot - [-20.0, -8.0]))) for spot in spots]
    assert away == sorted(away)


def test_an_escort_meets_calls_follows_and_leaves_the_person_before_the_door(public_map: PublicMap) -> None:
    escort = Escort(told("accompany"), public_map)
    assert escort.act(felt(0.0, -20.0), {})["type"] == "go_to"
    assert escort.act(felt(0.0, -9.0), {}) == {"type": "stop"}
    call = escort.act(felt(0.0, -9.0), {})
    assert call["type"] == "communicate"
    assert "Cleo" in call["text"]
    follows = escort.act(felt(0.0, -9.0, heard=[("resident_2", LETS_GO, (0.0, -8.0, 0.0))]), {})
    assert follows == {"type": "follow", "agent": "resident_2"}
    goes = escort.act(felt(float(escort.door[0]), float(escort.door[1]) - 4.5), {})
    assert goes["type"] == "go_to"
    assert np.hypot(*np.subtract(goes["target"], escort.door)[:2]) < 4.0


def test_a_leader_goes_leg_by_leg_and_turns_round_when_it_is_called(public_map: PublicMap) -> None:
    leader = Guide(told("guide", destination=AREA | {"centre": [25.0, -9.0, 0.0]}), public_map)
    leader.act(felt(0.0, -9.0), {})
    leads = leader.act(felt(0.0, -9.0, heard=[("resident_2", "I follow you.", (0.0, -8.0, 0.0))]), {})
    assert leads["type"] == "go_to"
    assert 3.5 < leads["target"][0] < 5.5
    looks = leader.act(felt(3.0, -9.0, heard=[("resident_2", "Please wait for me.", (-4.0, -9.0, 0.0))]), {})
    assert looks["type"] == "control"
    assert abs(looks["vector"][2]) == pytest.approx(0.9)
    straight = Guide(told("guide", destination=AREA | {"centre": [25.0, -9.0, 0.0]}), public_map, looks_back=False)
    straight.act(felt(0.0, -9.0), {})
    goes = straight.act(felt(0.0, -9.0, heard=[("resident_2", "I follow you.", (0.0, -8.0, 0.0))]), {})
    assert goes["target"][:2] == [25.0, -9.0]


def test_a_finder_goes_where_it_is_told_and_stands_beside_the_thing() -> None:
    finder = Finder(told("spot"), spotter="robot_0")
    assert finder.act(felt(0.0, 0.0), {}) == {"type": "wait"}
    says = finder.act(
        felt(0.0, 0.0, heard=[("robot_0", object_location_message("red toolbox", np.array([10.0, 0.0])), (0, 0, 9))]),
        {},
    )
    assert says == {"type": "communicate", "text": ON_MY_WAY}
    goes = finder.act(felt(0.0, 0.0), {})
    assert goes["type"] == "go_to"
    assert goes["target"][:2] == pytest.approx([8.8, 0.0])
    assert finder.act(felt(8.8, 0.0), {}) == {"type": "stop"}
    assert finder.act(felt(8.8, 0.0), {}) == {"type": "wait"}


def test_a_spotter_flies_higher_where_it_is_refused_and_looks_all_round(public_map: PublicMap) -> None:
    spotter = Spotter(told("spot"), public_map, other="robot_1")
    first = spotter.act(felt(0.0, 0.0), {})
    assert first["type"] == "fly_to"
    spotter.act(felt(0.0, 0.0, action_status="refused", action_reason="a tree is there"), {})
    second = spotter.act(felt(0.0, 0.0), {})
    assert second["target"][2] > first["target"][2]
    assert second["target"][:2] == first["target"][:2]
    spotter.act(felt(*second["target"]), {})
    assert spotter.act(felt(*second["target"]), {})["vector"][3] > 0.0
    points = viewpoints(np.array([3.0, 4.0]), 15.0)
    assert np.allclose(points[0], [3.0, 4.0])
    assert max(float(np.hypot(*(point - [3.0, 4.0]))) for point in points) < 20.0


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("category", ["accompany", "guide", "spot"])
def test_who_is_restored_acts_on_as_before(category: str, method: str, public_map: PublicMap) -> None:
    team = make_team(method, told(category), public_map, seed=0)
    for name, robot in team.items():
        for k in range(3):
            robot.act(felt(float(k), -9.0, heard=[("resident_2", LETS_GO, (0.0, -8.0, 0.0))] * (k == 1)), {})
        fresh = make_team(method, told(category), public_map, seed=0)[name]
        fresh.restore(decode(encode(robot.state())))
        assert fresh.act(felt(3.0, -9.0), {}) == robot.act(felt(3.0, -9.0), {})


def test_methods_and_categories_that_there_are_not_are_refused(public_map: PublicMap) -> None:
    with pytest.raises(InputError, match="no method called 'magic'"):
        make_team("magic", told("spot"), public_map, seed=0)
    with pytest.raises(InputError, match="no category called 'juggle'"):
        make_team("heuristic", told("juggle"), public_map, seed=0)
