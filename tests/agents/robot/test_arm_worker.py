"""A robot picks things up and puts them down by what it sees and feels alone, and holds them by friction."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from robot_field import drawn_field
from vico.agents.robot.arm_interface import ArmStage
from vico.agents.robot.arm_skills import ArmWorker
from vico.agents.robot.body import Stance
from vico.assets.robots import robot_model
from vico.assets.shapes import box
from vico.challenges.robot_tasks import arm_body
from vico.errors import InputError
from vico.geometry import rotation_matrix
from vico.io.plain_data import decode, encode
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation

Triple = tuple[float, float, float]

PERIOD = 0.05
SIZES = {"box": (0.12, 0.2, 0.1), "tall": (0.09, 0.16, 0.28), "flat": (0.25, 0.07, 0.06)}
BODY = arm_body(robot_model("manipulator"))


class Trial:
    """A manipulator at the origin, alone or with a carrier, and a thing."""

    def __init__(
        self,
        size: tuple[float, float, float],
        at: tuple[float, float, float],
        *,
        table: float = 0.0,
        carrier: bool = False,
        assistants: int = 0,
    ) -> None:
        robots = ("manipulator", "husky") if carrier else ("manipulator",)
        places = {"robot_0": (0.0, 0.0, 0.0)} | ({"robot_1": (2.5, -3.0, 0.6)} if carrier else {})
        config = SimConfig(
            robots=robots,
            robot_places=places,
            assistants=assistants,
            periods=dict.fromkeys(places, PERIOD),
            observe=("robot_0",),
            outputs=("depth", "segmentation"),
            image=192,
        )
        self.sim = Simulation(drawn_field(table=table), None, config)
        shape = [box(size, (0, 0, size[2] / 2))]
        self.thing = int(self.sim.scenario.add_object("parcel", "parcel", shape, at, size=size, yaw=0.7))
        self.worker = ArmWorker(BODY, period=PERIOD)
        self.observations: dict[str, Any] = dict(self.sim.step({"robot_0": {"type": "wait"}}).observations)

    def until_done(self, seconds: float = 60.0, stage: ArmStage | None = None) -> None:
        """Let the worker work, to its end or to a stage."""
        for _ in range(round(seconds / PERIOD)):
            action = self.worker.act(self.observations["robot_0"])
            if not self.worker.busy or (stage is not None and self.worker.stage is stage):
                return
            self.observations = dict(self.sim.step({"robot_0": action}).observations)
            assert self.observations["robot_0"]["state"]["action_status"] in ("ok", "ongoing"), action
        raise AssertionError(f"still at {self.worker.stage} after {seconds} s")

    @property
    def position(self) -> np.ndarray:
        return np.asarray(self.sim.state.objects.position[0])

    @property
    def upright(self) -> float:
        return float(rotation_matrix(self.sim.state.objects.orientation[0])[2, 2])


@pytest.mark.parametrize(
    "size", [(0.12, 0.2, 0.1), (0.09, 0.16, 0.28), (0.25, 0.07, 0.06)], ids=["box", "tall", "flat"]
)
def test_a_thing_is_picked_from_the_ground_and_put_down_elsewhere(size: tuple[float, float, float]) -> None:
    trial = Trial(size, (2.2, 0.7, 0.0))
    trial.worker.pick(trial.thing, np.array([2.2, 0.7, 0.0]))
    trial.until_done()
    assert (trial.worker.outcome, trial.worker.why) == ("picked", "")
    assert trial.position[2] > 0.3
    assert trial.sim.state.objects.holder[0] == 0  # friction holds it
    assert trial.worker.forces > 20.0
    before = trial.position.copy()
    for _ in range(20):
        trial.sim.step({"robot_0": {"type": "stop"}})
    assert trial.position == pytest.approx(before, abs=0.006)  # what nobody moves does not creep out of the jaw
    trial.worker.place(np.array([0.5, -2.5, 0.0]))
    trial.until_done()
    assert trial.worker.outcome == "placed"
    for _ in range(20):
        trial.sim.step({"robot_0": {"type": "stop"}})
    assert trial.position == pytest.approx([0.5, -2.5, 0.0], abs=0.03)
    assert trial.upright > 0.98
    assert trial.worker.held is None


def test_from_a_table_onto_a_deck_that_it_sees() -> None:
    trial = Trial((0.12, 0.18, 0.2), (2.95, 0.1, 0.6), table=0.6, carrier=True)
    trial.worker.pick(trial.thing, np.array([2.95, 0.1, 0.6]))
    trial.until_done()
    assert trial.worker.outcome == "picked"
    carrier, deck = Stance.of(trial.observations["robot_1"]), robot_model("husky").deck
    assert deck is not None
    across = carrier.rotation[:2, 1]
    here = Stance.of(trial.observations["robot_0"]).position - carrier.position
    side = across if across @ here[:2] > 0.0 else -across
    spot = carrier.outside(np.array(deck.centre)) + np.array([*(0.12 * side), 0.0])
    trial.worker.place(spot, beside=side)
    trial.until_done()
    assert trial.worker.outcome == "placed"
    assert trial.position == pytest.approx(spot, abs=0.04)
    assert trial.upright > 0.95


def test_a_restored_worker_does_what_it_would_have_done() -> None:
    trial = Trial((0.12, 0.2, 0.1), (1.4, 0.2, 0.0))
    trial.worker.pick(trial.thing, np.array([1.4, 0.2, 0.0]))
    for stage in (ArmStage.LOOK, ArmStage.OVER, ArmStage.GRIP, ArmStage.CARRY):
        trial.until_done(stage=stage)
        again = ArmWorker(BODY, period=PERIOD)
        again.restore(decode(encode(trial.worker.state())))
        assert again.act(trial.observations["robot_0"]) == trial.worker.act(trial.observations["robot_0"])
        trial.worker = again
    trial.until_done()
    assert trial.worker.outcome == "picked"
    assert decode(encode(trial.worker.state()))["held"]["above"] > 0.0


@pytest.mark.parametrize(
    ("size", "why"),
    [((0.5, 0.45, 0.3), "too wide for the jaw"), (None, "not seen")],
)
def test_what_cannot_be_picked_is_said(size: Triple | None, why: str) -> None:
    trial = Trial(size or (0.1, 0.1, 0.1), (1.4, 0.2, 0.0))
    thing = trial.thing if size else trial.thing + 1
    trial.worker.pick(thing, np.array([1.4, 0.2, 0.0]))
    trial.until_done()
    assert (trial.worker.outcome, trial.worker.why) == ("failed", why)
    trial.worker.place(np.array([1.4, 0.2, 0.0]))
    trial.until_done()
    assert (trial.worker.outcome, trial.worker.why) == ("failed", "nothing in the jaw")


def test_what_is_taken_away_is_no_grip() -> None:
    trial = Trial((0.12, 0.2, 0.1), (1.4, 0.2, 0.0))
    trial.worker.pick(trial.thing, np.array([1.4, 0.2, 0.0]))
    trial.until_done(stage=ArmStage.THERE)
    trial.sim.state.objects.position[0] = (1.4, 8.0, 0.0)
    trial.until_done()
    assert trial.worker.outcome == "failed"
    assert trial.worker.why in ("not seen", "the jaw closed on nothing")


def test_a_robot_without_an_arm_has_no_body_of_one() -> None:
    with pytest.raises(InputError, match="has no arm on a base that drives"):
        arm_body(robot_model("husky"))


def test_what_is_held_out_is_let_go_of_once_a_person_takes_it() -> None:
    trial = Trial((0.12, 0.2, 0.1), (1.4, 0.2, 0.0), assistants=1)
    trial.sim.scenario.place_agent("assistant_0", (0.6, 2.6, 0.0))
    trial.worker.pick(trial.thing, np.array([1.4, 0.2, 0.0]))
    trial.until_done()
    assert trial.worker.outcome == "picked"
    person = np.array([0.6, 2.6, 0.0])
    trial.worker.offer(person)
    trial.until_done(stage=ArmStage.GRIP)
    for _ in range(60):
        action = trial.worker.act(trial.observations["robot_0"])
        trial.observations = dict(trial.sim.step({"robot_0": action}).observations)
    assert trial.worker.busy  # it waits, and holds on
    assert np.hypot(*(trial.position - person)[:2]) < 0.8
    assert 0.6 < trial.position[2] < 1.2
    takes = {"type": "pick", "hand": 0, "object": trial.thing}  # once the person is due: every second
    for _ in range(300):
        action = trial.worker.act(trial.observations["robot_0"])
        if not trial.worker.busy:
            break
        trial.observations = dict(trial.sim.step({"robot_0": action, "assistant_0": takes}).observations)
    assert (trial.worker.outcome, trial.worker.held) == ("handed_over", None)
    assert trial.sim.state.objects.holder[0] == trial.sim.state.people.entity[0]


def test_what_has_rolled_under_a_car_is_out_of_reach() -> None:
    trial = Trial((0.12, 0.14, 0.1), (3.0, 0.0, 0.0), table=0.22)
    trial.sim.state.objects.position[0] = (3.0, 0.0, 0.0)
    trial.worker.pick(trial.thing, np.array([3.0, 0.0, 0.0]))
    trial.until_done(seconds=90.0)
    assert trial.worker.outcome == "failed"
    assert trial.worker.why in ("not seen", "out of reach", "no way there")
