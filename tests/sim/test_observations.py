"""What agents are shown: shapes, units, and that they see the others but not themselves."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
import pytest

import toy_city
from vico.envs import CommunityEnv, EnvSpec
from vico.errors import InputError
from vico.sim.cameras import CLASSES
from vico.sim.config import SimConfig, SimSettings
from vico.sim.loop.simulation import Simulation
from vico.sim.observations import distinct_entities

Seen = tuple[dict[str, dict[str, Any]], dict[str, dict[str, Any]]]


@pytest.fixture(scope="module")
def sim() -> Simulation:
    """Two assistants three metres apart, one looking at the other."""
    simulation = Simulation(toy_city.world(), toy_city.community(), SimConfig(start=8 * 3600 - 20, assistants=2))
    simulation.scenario.place_agent("assistant_0", (0.0, -15.0), yaw=0.0)
    simulation.scenario.place_agent("assistant_1", (3.0, -15.0), yaw=0.0)
    return simulation


@pytest.fixture(scope="module")
def seen(sim: Simulation) -> Seen:
    """What everybody sees at the start."""
    return sim.observe()


def test_every_part_has_the_promised_shape_and_type(seen: Seen) -> None:
    view = seen[0]["assistant_0"]
    kinds = {name: (view[name].shape, view[name].dtype.name) for name in ("rgb", "depth", "segmentation", "pose")}
    assert kinds == {
        "rgb": ((256, 256, 3), "uint8"),
        "depth": ((256, 256), "float32"),
        "segmentation": ((256, 256), "int32"),
        "pose": ((6,), "float64"),
    }
    assert (view["extrinsics"].shape, view["intrinsics"].shape) == ((4, 4), (3, 3))


def test_one_sees_the_other_three_metres_ahead(sim: Simulation, seen: Seen) -> None:
    view = seen[0]["assistant_0"]
    other = int(sim.state.people.entity[4])
    shown = view["segmentation"] == other
    assert shown.sum() > 300
    assert np.median(view["depth"][shown]) == pytest.approx(2.9, abs=0.25)
    assert seen[1]["assistant_0"]["entities"][other] == {
        "kind": "assistant",
        "name": "assistant_1",
        "agent": "assistant_1",
    }


def test_nobody_sees_their_own_body(sim: Simulation, seen: Seen) -> None:
    for i, name in enumerate(sim.agents):
        assert int(sim.state.people.entity[i]) not in seen[1][name]["entities"]


def test_a_pixel_with_its_depth_leads_back_to_the_ground(sim: Simulation, seen: Seen) -> None:
    view = seen[0]["assistant_0"]
    row, column = 230, 30
    assert view["segmentation"][row, column] == 1
    k, depth = view["intrinsics"], float(view["depth"][row, column])
    ray = np.array([(column + 0.5 - k[0, 2]) / k[0, 0], (row + 0.5 - k[1, 2]) / k[1, 1], 1.0]) * depth
    point = np.linalg.inv(view["extrinsics"]) @ np.append(ray, 1.0)
    assert point[2] == pytest.approx(float(sim.world.height(point[:2])), abs=0.02)


def test_rooms_are_seen_from_inside_only(seen: Seen) -> None:
    inside = {what["kind"] for what in seen[1]["resident_0"]["entities"].values()}
    outside = {what["kind"] for what in seen[1]["assistant_0"]["entities"].values()}
    assert "room" in inside
    assert "building" not in inside
    assert "room" not in outside


def test_the_pose_is_position_and_unit_gaze(seen: Seen) -> None:
    pose = seen[0]["assistant_1"]["pose"]
    assert pose[:2] == pytest.approx([3.0, -15.0])
    assert np.linalg.norm(pose[3:]) == pytest.approx(1.0)


def test_views_are_the_same_each_time(sim: Simulation, seen: Seen) -> None:
    again = sim.observe()[0]
    assert all(np.array_equal(again[name]["rgb"], seen[0][name]["rgb"]) for name in again)


@pytest.mark.parametrize("shape", [(1, 1), (3, 40), (70, 33), (64, 256), (7, 100)])
def test_every_entity_in_a_picture_is_found(shape: tuple[int, int]) -> None:
    generator = np.random.default_rng(5)
    image = np.repeat(np.repeat(generator.integers(0, 9, shape), 5, axis=0), 9, axis=1)[: shape[0], : shape[1]]
    image = image.astype(np.int32)
    for _ in range(30):
        image[generator.integers(shape[0]), generator.integers(shape[1])] = generator.integers(10, 10_000)
    assert distinct_entities(image) == np.unique(image[image > 0]).tolist()


def test_each_agent_sees_through_its_own_lens_what_was_asked_for() -> None:
    config = SimConfig(
        assistants=2,
        robots=("husky",),
        residents=0,
        image=32,
        outputs=("semantic", "rgb", "flow", "normals"),
        cameras={"robots": {"projection": "panorama"}, "assistant_1": {"width": 48, "height": 20}},
    )
    spec = EnvSpec(**{field.name: getattr(config, field.name) for field in fields(SimSettings)})
    env = CommunityEnv(toy_city.world(), toy_city.community(), spec=spec)
    env.sim.scenario.place_agent("assistant_0", (0.0, -15.0), yaw=0.0)
    env.sim.scenario.place_agent("assistant_1", (3.0, -15.0), yaw=0.0)
    observations, _ = env.reset()
    for name, seen in observations.items():
        assert env.observation_space(name).contains(seen)
    assert observations["assistant_1"]["rgb"].shape == (20, 48, 3)
    assert observations["robot_0"]["flow"].shape == (32, 64, 2)
    assert "depth" not in observations["assistant_0"]
    seen = observations["assistant_0"]["semantic"]
    assert {CLASSES[k] for k in np.unique(seen)} >= {"person", "nothing"}
    turned = env.step({"assistant_0": {"type": "turn_left", "degrees": 6.0}})[0]["assistant_0"]
    # Turning to the left moves what is far away to the right.
    assert np.median(turned["flow"][..., 0]) == pytest.approx(2.0, abs=0.3)


def test_views_are_asked_for_by_a_persons_name_too() -> None:
    person = toy_city.community().residents[0]
    config = SimConfig(observe=(person.name.lower(), "assistant_0"), assistants=1)
    sim = Simulation(toy_city.world(), toy_city.community(), config)
    assert [sim.state.names[k] for k in sim.seeing] == [person.id, "assistant_0"]


def test_a_camera_of_nobody_is_refused() -> None:
    with pytest.raises(InputError, match="nobody is called 'robot_9'"):
        Simulation(toy_city.world(), None, SimConfig(cameras={"robot_9": {}}, assistants=1)).observe()
