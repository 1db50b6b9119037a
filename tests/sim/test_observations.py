"""What agents are shown: shapes, units, and that they see the others but not themselves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import toy_city
from vico.sim.config import SimConfig
from vico.sim.observations import distinct_entities
from vico.sim.simulation import Simulation

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
