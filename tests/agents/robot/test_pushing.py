"""A robot pushes what its jaw cannot hold along the ground, by what it sees."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from robot_field import drawn_field
from vico.agents.robot.pushing import FARTHEST, Pusher, PushStage
from vico.assets.robots import robot_model
from vico.assets.shapes import box
from vico.challenges.robot_tasks import arm_body
from vico.io.plain_data import decode, encode
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation

PERIOD = 0.05
BODY = arm_body(robot_model("manipulator"))


def field(size: tuple[float, float, float], at: tuple[float, float, float]) -> Simulation:
    config = SimConfig(
        robots=("manipulator",),
        robot_places={"robot_0": (0.0, 0.0, 0.0)},
        periods={"robot_0": PERIOD},
        observe=("robot_0",),
        outputs=("depth", "segmentation"),
        image=96,
    )
    sim = Simulation(drawn_field(), None, config)
    sim.scenario.add_object("crate", "crate", [box(size, (0, 0, size[2] / 2))], at, size=size, yaw=0.3)
    return sim


def pushed(sim: Simulation, pusher: Pusher, *, stop: PushStage | None = None) -> dict[str, Any]:
    """Let it push, to its end or to a stage; return what it observes then."""
    told: dict[str, Any] = dict(sim.step({"robot_0": {"type": "wait"}}).observations)["robot_0"]
    for _ in range(round(90.0 / PERIOD)):
        action = pusher.act(told)
        if not pusher.busy or pusher.stage is stop:
            return told
        sim.look_away = () if pusher.wants_picture else ("robot_0",)
        told = dict(sim.step({"robot_0": action}).observations)["robot_0"]
    raise AssertionError(f"still at {pusher.stage}")


def test_what_is_too_wide_for_the_jaw_is_pushed_to_where_it_is_to_be() -> None:
    sim = field((0.36, 0.4, 0.25), (1.9, 0.2, 0.0))
    pusher = Pusher(BODY, period=PERIOD)
    entity, goal = sim.ground_truth.object_entity("crate"), np.array([2.4, 0.33])
    pusher.push(entity, np.array([1.9, 0.2, 0.0]), goal)
    told = pushed(sim, pusher, stop=PushStage.PUSH)
    again = Pusher(BODY, period=PERIOD)
    again.restore(decode(encode(pusher.state())))
    assert again.act(told) == pusher.act(told)
    pushed(sim, pusher)
    assert (pusher.outcome, pusher.why) == ("pushed", "")
    where = np.asarray(sim.ground_truth.object_position("crate"))
    assert where[:2] == pytest.approx(goal, abs=0.2)
    assert where[2] == pytest.approx(0.0, abs=0.02)
    assert sim.state.objects.holder[0] == 0


def test_what_is_not_there_or_too_far_is_not_pushed() -> None:
    sim = field((0.36, 0.4, 0.25), (1.3, 0.0, 0.0))
    pusher = Pusher(BODY, period=PERIOD)
    pusher.push(1, np.array([1.3, 0.0, 0.0]), np.array([1.3 + FARTHEST + 0.1, 0.0]))
    assert (pusher.busy, pusher.outcome, pusher.why) == (False, "failed", "too far")
    unknown = sim.ground_truth.object_entity("crate") + 1
    pusher.push(unknown, np.array([1.3, 0.0, 0.0]), np.array([2.3, 0.0]))
    pushed(sim, pusher)
    assert (pusher.outcome, pusher.why) == ("failed", "not seen")
