"""A policy has the place of the arm's skills: it is brought before a thing, told where that is, and judged by touch."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from felt_arm import sensors
from robot_field import drawn_field
from vico.agents.robot.arm_interface import PolicyErrand, PolicyStage, ReadyPose
from vico.agents.robot.body import Stance, follow_joint_path, rotate_aside
from vico.agents.robot.grasps import ObjectPose, ObjectTracker, candidate_grasps, object_in_jaw, pose_of_box
from vico.agents.robot.increments import PolicyClock
from vico.agents.robot.learned_arm import LearnedArm
from vico.agents.robot.reaching import ReachPlan, plan_grasp, plan_placement, room_around
from vico.assets.robots import robot_model
from vico.assets.shapes import box
from vico.challenges.learning.manipulation.scene import OPENING, ready_angles
from vico.challenges.robot_tasks import arm_body
from vico.errors import InputError
from vico.geometry import rotation_matrix, yaw_quaternion
from vico.io.plain_data import decode, encode
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation

PERIOD = 0.05
SIZE = (0.12, 0.2, 0.1)
BODY = arm_body(robot_model("manipulator"))
EMPTY = np.array([[9.0, 9.0, 9.0]])


class Planned:
    """Stands in for a policy: knows how to take a box, and how to put it down."""

    drives = False
    seconds = 20.0

    def __init__(self, *, ready: bool = True, gives: float | None = None) -> None:
        self.ready = ReadyPose(np.array(ready_angles()), OPENING) if ready else None
        self.gives = gives
        self.errands: list[PolicyErrand] = []
        self.servos = np.zeros(9)
        self.ways: list[tuple[np.ndarray, float]] = []
        self.waits = 0

    def begin(self, errand: PolicyErrand, servos: np.ndarray) -> None:
        self.errands.append(errand)
        self.servos = servos.copy()
        room = room_around(BODY, EMPTY)
        if errand.goal is None:
            thing = errand.thing.as_box()
            found: ReachPlan | None = plan_grasp(BODY, (room, room), servos[:7], candidate_grasps(thing, BODY))
            assert found is not None
            self.ways = [(found.over, found.opening), (found.there, found.opening), (found.away, 0.0)]
        else:
            held = object_in_jaw(BODY, servos[:7], errand.thing.as_box(), float(servos[7]))
            spot = errand.goal - np.array([0.0, 0.0, float(errand.thing.middle[2]) - errand.thing.low - 0.01])
            found = plan_placement(BODY, room, servos[:7], spot, held)
            assert found is not None
            self.ways = [(found.over, 0.0), (found.there, 0.0), (found.away, 0.14)]

    def act(self, observation: Mapping[str, Any], thing: ObjectPose) -> np.ndarray:
        if self.gives is not None:
            raise InputError(f"policy: its action holds {self.gives}")
        most = BODY.fastest * PERIOD * 0.5
        if self.ways:
            way, opening = self.ways[0]
            self.servos[7:] += np.clip(opening - self.servos[7:], -most[7:], most[7:])
            self.waits += 1
            if len(self.ways) > 1 or self.waits > 30:  # fingers first
                reached = follow_joint_path(way, 0, self.servos[:7], most[:7])
                rest = way[reached:]
                self.ways[0] = rest, opening
                felt = np.asarray(observation["sensors"]["joint_position"])[:7]
                if not len(rest) and float(np.abs(felt - way[-1]).max()) < 0.05:
                    self.ways.pop(0)
                    self.waits = 0
                elif not len(rest):
                    self.ways[0] = way[-1:], opening
        return np.concatenate([self.servos, [0.0, 0.0]])

    def state(self) -> dict[str, Any]:
        return {"servos": self.servos.copy(), "ways": [[w.copy(), o] for w, o in self.ways], "waits": self.waits}

    def restore(self, state: Mapping[str, Any]) -> None:
        self.servos, self.waits = np.array(state["servos"]), int(state["waits"])
        self.ways = [(np.array(w), float(o)) for w, o in state["ways"]]


class Trial:
    """A manipulator at the origin, and a box."""

    def __init__(
        self, policy: Planned, *, at: tuple[float, float, float] = (1.4, 0.2, 0.0), oracle: bool = False
    ) -> None:
        config = SimConfig(
            robots=("manipulator",),
            robot_places={"robot_0": (0.0, 0.0, 0.0)},
            periods={"robot_0": PERIOD},
            observe=("robot_0",),
            outputs=("depth", "segmentation"),
            image=160,
        )
        self.sim = Simulation(drawn_field(), None, config)
        shape = [box(SIZE, (0, 0, SIZE[2] / 2))]
        self.thing = int(self.sim.scenario.add_object("parcel", "parcel", shape, at, size=SIZE, yaw=0.7))
        self.policy = policy
        self.arm = LearnedArm(BODY, policy, period=PERIOD, truth=self.truth if oracle else None)
        self.observation = dict(self.sim.step({"robot_0": {"type": "wait"}}).observations)["robot_0"]

    def truth(self, entity: int) -> ObjectPose | None:
        objects = self.sim.state.objects
        rotation = rotation_matrix(objects.orientation[0])
        half = np.array(SIZE) / 2
        return (
            ObjectPose(objects.position[0] + rotation[:, 2] * half[2], rotation, half) if entity == self.thing else None
        )

    def until_done(self, *, seconds: float = 60.0, stage: PolicyStage | None = None) -> None:
        for _ in range(round(seconds / PERIOD)):
            action = self.arm.act(self.observation)
            if not self.arm.busy or self.arm.stage is stage:
                return
            self.observation = dict(self.sim.step({"robot_0": action}).observations)["robot_0"]
        raise AssertionError(f"still at {self.arm.stage} after {seconds} s")

    @property
    def position(self) -> np.ndarray:
        return np.asarray(self.sim.state.objects.position[0])


@pytest.mark.parametrize("oracle", [False, True], ids=["seen", "told"])
def test_what_a_policy_does_is_picking_and_placing(oracle: bool) -> None:
    trial = Trial(Planned(), oracle=oracle)
    trial.arm.pick(trial.thing, np.array([1.4, 0.2, 0.0]))
    trial.until_done(stage=PolicyStage.POLICY)
    # It begins as training did: hand down before the base, the thing where the arm reaches it, seen as it is.
    felt = np.asarray(trial.observation["sensors"]["joint_position"])
    np.testing.assert_allclose(felt[:7], ready_angles(), atol=0.06)
    assert felt[7:] == pytest.approx([OPENING, OPENING], abs=0.01)
    truth = trial.truth(trial.thing)
    assert truth is not None
    true, told = truth.inside(Stance.of(trial.observation)), trial.policy.errands[0].thing
    assert told.middle == pytest.approx(true.middle, abs=0.02)
    assert np.sort(told.half) == pytest.approx(np.sort(true.half), abs=0.015)
    assert 0.5 < float(np.hypot(*told.middle[:2])) < 0.72
    trial.until_done()
    assert (trial.arm.outcome, trial.arm.why) == ("picked", "")
    assert trial.arm.held is not None
    assert trial.position[2] > 0.25
    trial.arm.place(np.array([0.2, -1.6, 0.0]))
    trial.until_done(stage=PolicyStage.POLICY)
    errand = trial.policy.errands[1]
    assert errand.goal is not None
    beside = errand.thing.middle - errand.goal
    assert float(np.hypot(*beside[:2])) == pytest.approx(0.22, abs=0.06)
    assert 0.03 < float(beside[2]) < 0.25
    trial.until_done()
    assert (trial.arm.outcome, trial.arm.held) == ("placed", None)
    assert trial.position == pytest.approx([0.2, -1.6, 0.0], abs=0.05)


def test_a_restored_arm_does_what_it_would_have_done() -> None:
    trial = Trial(Planned())
    trial.arm.pick(trial.thing, np.array([1.4, 0.2, 0.0]))
    for stage in (PolicyStage.READY, PolicyStage.POLICY):
        trial.until_done(stage=stage)
        again = LearnedArm(BODY, Planned(), period=PERIOD)
        again.restore(decode(encode(trial.arm.state())))
        assert again.act(trial.observation) == trial.arm.act(trial.observation)


def test_a_policy_that_does_nothing_fails_in_time_and_one_that_gives_no_numbers_breaks() -> None:
    trial = Trial(Planned())
    trial.policy.seconds = 1.0
    trial.arm.pick(trial.thing, np.array([1.4, 0.2, 0.0]))
    trial.until_done(stage=PolicyStage.POLICY)
    trial.policy.ways = []
    trial.until_done()
    assert (trial.arm.outcome, trial.arm.why) == ("failed", "the jaw closed on nothing")
    trial.arm.fold()
    trial.until_done()
    assert (trial.arm.outcome, trial.arm.why) == ("folded", "")
    felt = np.asarray(trial.observation["sensors"]["joint_position"])
    np.testing.assert_allclose(felt[:7], BODY.rest, atol=0.06)
    trial.policy.gives = float("nan")
    trial.arm.pick(trial.thing, trial.position)
    with pytest.raises(InputError, match="holds nan"):
        trial.until_done()
    assert trial.arm.broken == "policy: its action holds nan"


def test_what_is_not_there_is_not_picked() -> None:
    trial = Trial(Planned(ready=False))
    trial.arm.pick(trial.thing + 1, np.array([1.4, 0.2, 0.0]))
    trial.until_done()
    assert (trial.arm.outcome, trial.arm.why) == ("failed", "not seen")
    trial.arm.place(np.array([1.4, 0.2, 0.0]))
    trial.until_done()
    assert (trial.arm.outcome, trial.arm.why) == ("failed", "not seen")
    assert trial.policy.errands == []


def observed(*, pixels: int, pressed: float, angle: float = 0.0) -> dict[str, Any]:
    """A picture whose middle is a thing a metre ahead of the camera, or nothing."""
    felt = sensors()
    felt["base_pose"] = np.array([0.0, 0.0, 0.1, *yaw_quaternion(0.0)])
    felt["joint_position"] = np.array([*ready_angles(), 0.05, 0.05])
    felt["joint_position"][0] += angle
    felt["contacts"] = np.full(2, pressed)
    segmentation = np.zeros((32, 32), np.int32)
    segmentation[16 - pixels : 16 + pixels, 16 - pixels : 16 + pixels] = 7
    camera = np.eye(4)
    camera[:3, 3] = [0.5, 0.0, 1.0]
    intrinsics = np.array([[32.0, 0.0, 16.0], [0.0, 32.0, 16.0], [0.0, 0.0, 1.0]])
    return {
        "sensors": felt, "depth": np.full((32, 32), 1.0, np.float32), "segmentation": segmentation,
        "extrinsics": camera, "intrinsics": intrinsics,
    }  # fmt: skip


def test_what_goes_out_of_view_is_where_it_was_or_goes_with_the_hand_that_presses_on_it() -> None:
    watch = ObjectTracker(BODY)
    assert watch.where(observed(pixels=0, pressed=0.0), 7) is None
    seen = watch.where(observed(pixels=6, pressed=0.0), 7)
    assert seen is not None
    hidden = watch.where(observed(pixels=0, pressed=0.0, angle=0.3), 7)
    assert hidden is not None
    np.testing.assert_allclose(hidden.middle, seen.middle, atol=1e-9)
    again = ObjectTracker(BODY)
    again.restore(decode(encode(watch.state())))
    held = again.where(observed(pixels=0, pressed=5.0, angle=0.6), 7)
    assert held is not None
    turn = BODY.hand(np.array([ready_angles()[0] + 0.6, *ready_angles()[1:]]))
    before = BODY.hand(np.array([ready_angles()[0] + 0.3, *ready_angles()[1:]]))
    wanted = turn[:, :3] @ before[:, :3].T @ (hidden.middle - before[:, 3]) + turn[:, 3]
    np.testing.assert_allclose(held.middle, wanted, atol=1e-9)
    assert np.linalg.det(held.rotation) == pytest.approx(1.0)


def test_boxes_and_poses_go_back_and_forth_and_axes_are_right_handed() -> None:
    for yaw in np.linspace(-1.5, 1.5, 7):
        pose = ObjectPose(
            np.array([0.6, 0.1, 0.2]), rotation_matrix(yaw_quaternion(float(yaw))), np.array([0.1, 0.05, 0.2])
        )
        found = pose_of_box(pose.as_box())
        assert np.linalg.det(found.rotation) == pytest.approx(1.0)
        assert found.middle == pytest.approx(pose.middle)
        assert found.half == pytest.approx([0.05, 0.1, 0.2])
        assert found.low == pytest.approx(0.0)
        np.testing.assert_allclose(np.abs(found.rotation[:, 0]), np.abs(pose.rotation[:, 1]), atol=1e-9)


@pytest.mark.parametrize("period", [0.01, 0.02, 0.05, 0.07, 0.1])
def test_a_policy_is_asked_at_its_own_rate(period: float) -> None:
    clock = PolicyClock(period, own=0.05)
    due = [clock.tick() for _ in range(round(7.0 / period))]
    assert sum(one.asks for one in due) == 140
    assert due[0].asks >= 1
    assert all(0.0 < one.share <= 1.0 for one in due)
    if period < 0.05:
        assert due[0].share == pytest.approx(period / 0.05)


def test_a_period_that_is_no_hundredth_is_refused() -> None:
    with pytest.raises(InputError, match=r"multiple of 0\.01"):
        PolicyClock(0.033, own=0.05)


def test_spots_aside_are_as_far_from_the_base() -> None:
    spot = np.array([0.6, 0.1, -0.1])
    for away in (0.22, -0.22):
        found = rotate_aside(spot, away)
        assert float(np.hypot(*found[:2])) == pytest.approx(float(np.hypot(*spot[:2])))
        assert float(np.linalg.norm(found - spot)) == pytest.approx(0.22)
        assert np.sign(found[1] - spot[1]) == np.sign(away)
