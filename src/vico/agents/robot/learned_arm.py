"""An arm whose policy was learned: a planner brings it before a thing, the policy picks and places.

As in the paper's rows of reinforcement learning, whoever drives is a planner; the policy has the place of the arm's own
skills (`vico.agents.robot.arm_skills.ArmWorker`), behind the same interface. The arm is first brought to where the
policy takes over: as episodes of its training began.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import AgentState
from vico.agents.robot.arm_interface import ArmPolicy, PolicyErrand, PolicyStage, ReadyPose
from vico.agents.robot.arm_interface import ArmStage as WorkerStage
from vico.agents.robot.arm_skills import ArmWorker
from vico.agents.robot.body import ArmBody, Stance, follow_joint_path, rotate_aside, view_points
from vico.agents.robot.grasps import HeldObject, ObjectPose, ObjectTracker, PoseOracle, finger_contacts, object_in_jaw
from vico.agents.robot.reaching import GAP, plan_placement, room_around
from vico.errors import InputError
from vico.kinematics.planning import Arm, plan_path

Array = NDArray[np.float64]

# Before it is put down a thing is held so far beside its goal, metres, on either side of it.
_BESIDE_GOAL = 0.22
# Gaps that are tried on the way, metres.
_READY_GAPS = (GAP, 0.0, -0.02)


def path_to_ready_pose(body: ArmBody, observation: Mapping[str, Any], now: Array, ready: ReadyPose) -> Array | None:
    """Return a way from angles to those a policy picks from, shape ``(m, 7)``; None if none is free."""
    room, limbs = room_around(body, view_points(observation).points), body.limbs(ready.opening)
    for gap in _READY_GAPS:
        way = plan_path(Arm(body.chain, limbs, room, gap), now, ready.angles)
        if way is not None:
            return way
    return None


def path_beside_goal(
    body: ArmBody, observation: Mapping[str, Any], now: Array, held: HeldObject, spot: Array, *, entity: int
) -> Array:
    """Return a way on which what is held comes beside its goal, a little above what that lies on, shape ``(m, 7)``.

    Where no such place can be reached the policy begins with the arm as it is.

    Parameters
    ----------
    spot
        The goal, ENU metres, shape ``(3,)``.
    entity
        Of what is held.
    """
    seen, inside = view_points(observation), Stance.of(observation).inside(spot)
    room = room_around(body, seen.without(entity))
    for side in (_BESIDE_GOAL, -_BESIDE_GOAL):
        reach = plan_placement(body, room, now, rotate_aside(inside, side), held)
        if reach is not None:
            return reach.over
    return now[None]


Action = dict[str, Any]

_FACES = 0.4  # rad off facing the thing at which a policy that drives takes over
_LIFTED = 0.08  # metres that a thing is lifted once it was picked
_HOLDS = 0.25  # seconds that it is pressed on until then
_LETS_GO = 0.5  # seconds without a finger on it after which it was put down
# Fingers that did not pick a thing open by so much, metres.
_LETS_GO_BY = 0.02
_SPEED = 0.5  # share of its speed at which the arm goes to where a policy begins
_THERE = 0.03  # rad off that count as there
_READY_TIME = 20.0  # seconds for it, at most
_SERVOS = 9


class LearnedArm:
    """Picks and places by a policy.

    Parameters
    ----------
    body
        The arm.
    policy
        That moves it.
    period
        Seconds between two actions.
    truth
        Where things really are, if an oracle tells it; None for what is seen.

    Attributes
    ----------
    outcome, why
        Of the last piece of work.
    broken
        Why the policy can't act any more: it gave numbers that are none; empty while it can.
    """

    def __init__(self, body: ArmBody, policy: ArmPolicy, *, period: float, truth: PoseOracle | None = None) -> None:
        self.body, self.policy, self.period = body, policy, period
        self.stage = PolicyStage.IDLE
        self.outcome = self.why = self.broken = ""
        self._worker = ArmWorker(body, period=period)
        self._watch = ObjectTracker(body, truth=truth)
        self._places = False
        self._entity = 0
        self._spot = np.zeros(3)
        self._servos = np.zeros(_SERVOS)
        self._way = np.zeros((0, 7))
        self._point = 0
        self._timer = self._counted = self._low = 0.0

    # What it is told.

    @property
    def busy(self) -> bool:
        """Whether it is at work."""
        return self.stage is not PolicyStage.IDLE

    @property
    def wants_picture(self) -> bool:
        """Whether it looks at what is around it the next time."""
        if self.stage is PolicyStage.POLICY:
            return self._watch.looks or self.policy.drives
        return self.stage is PolicyStage.READY or self._worker.wants_picture

    @property
    def held(self) -> HeldObject | None:
        """What is in the jaw, as far as it knows; None for nothing."""
        return self._worker.held

    def pick(self, entity: int, position: Array, *, beside: Array | None = None) -> None:
        """Begin to pick a thing up that is about at a position, ENU metres; see `ArmWorker.pick`."""
        if entity != self._entity:
            self._watch.forget()
        self._places, self._entity, self._spot = False, entity, np.array(position, np.float64)
        self._worker.pick(entity, position, beside=beside)
        self._next(PolicyStage.COME)

    def place(self, spot: Array, *, beside: Array | None = None) -> None:
        """Begin to put down what is held, with its underside at a spot, ENU metres; see `ArmWorker.place`."""
        self._places, self._spot = True, np.array(spot, np.float64)
        self._worker.place(spot, beside=beside)
        self._next(PolicyStage.COME)

    def fold(self) -> None:
        """Begin to bring the arm to where things are carried, or to its rest; no policy is asked."""
        self.outcome, self.why = "folded", ""
        self._worker.fold()
        self._next(PolicyStage.FOLD)

    def has_lost(self, observation: Mapping[str, Any]) -> bool:
        """Return whether a jaw that held something feels it no more; see `ArmWorker.has_lost`."""
        return not self.busy and self._worker.has_lost(observation)

    # What it does.

    def act(self, observation: Mapping[str, Any]) -> Action:
        """Return the action for the coming period.

        Parameters
        ----------
        observation
            With ``sensors``, depth and segmentation, and whatever the policy looks at.

        Raises
        ------
        InputError
            If the policy gives no usable action.
        """
        self._timer += self.period
        if self.stage in (PolicyStage.READY, PolicyStage.POLICY) and self.wants_picture and "depth" not in observation:
            return self._hold()  # until there is one
        return _POLICY_STAGES[self.stage](self, observation)

    def _come(self, observation: Mapping[str, Any]) -> Action:
        """Drive to where the policy takes over."""
        action = self._worker.act(observation)
        if action["type"] == "control":
            self._servos = np.array(action["vector"][:_SERVOS])
        if not self._worker.busy:
            return self._end("failed", self._worker.why, action)
        aligned = self._worker.stage is WorkerStage.LOOK
        faces = self.policy.drives and self._worker.stage is WorkerStage.ALIGN and self._faces(observation)
        if not (aligned or faces) or "depth" not in observation:
            return action
        thing = self._watch.where(observation, self._entity)
        if thing is None or (self._places and self.held is None):
            return self._finish(observation, "failed", "not seen" if thing is None else "nothing in the jaw", thing)
        ready = self.policy.ready
        if ready is None:
            return self._begin(observation, thing)
        now = self._servos[:7].copy()
        if self._places:
            assert self.held is not None
            way: Array | None = path_beside_goal(
                self.body, observation, now, self.held, self._spot, entity=self._entity
            )
        else:
            way = path_to_ready_pose(self.body, observation, now, ready)
        if way is None:
            return self._finish(observation, "failed", "no way to where the policy begins", thing)
        self._next(PolicyStage.READY)
        self._way, self._point = way, 0
        return self._hold()

    def _ready(self, observation: Mapping[str, Any]) -> Action:
        """Bring the arm to where the policy begins."""
        ready, angles = self.policy.ready, np.asarray(observation["sensors"]["joint_position"], np.float64)
        assert ready is not None
        most = self.body.fastest * self.period * _SPEED
        self._point = follow_joint_path(self._way, self._point, self._servos[:7], most[:7])
        if not self._places:
            self._servos[7:] += np.clip(ready.opening - self._servos[7:], -most[7:], most[7:])
        told = self._point >= len(self._way)
        there = told and float(np.abs(self._servos[:7] - angles[:7]).max()) < _THERE
        opened = self._places or float(np.abs(self._servos[7:] - ready.opening).max()) < 1e-9
        thing = self._watch.where(observation, self._entity)
        if thing is not None and there and opened:
            return self._begin(observation, thing)
        if self._timer > _READY_TIME:
            return self._finish(observation, "failed", "no end of getting ready", thing)
        return self._hold()

    def _begin(self, observation: Mapping[str, Any], thing: ObjectPose) -> Action:
        """Let the policy begin."""
        goal = None
        if self._places:
            goal = Stance.of(observation).inside(self._spot) + np.array([0.0, 0.0, float(thing.middle[2]) - thing.low])
        self._low = thing.low
        self.policy.begin(PolicyErrand(self._entity, thing, goal), self._servos)
        self._next(PolicyStage.POLICY)
        return self._ask(observation)

    def _ask(self, observation: Mapping[str, Any]) -> Action:
        """Do what the policy says, until its errand is over."""
        thing = self._watch.where(observation, self._entity)
        felt = finger_contacts(observation, self._entity)
        if thing is None:  # who knows the truth is told of things that are gone
            return self._finish(observation, "failed", "not there any more", thing)
        counts = not felt.any() if self._places else felt.all() and thing.low - self._low > _LIFTED
        self._counted = self._counted + self.period if counts else 0.0
        if self._counted >= (_LETS_GO if self._places else _HOLDS):
            return self._finish(observation, "placed" if self._places else "picked", "", thing)
        if self._timer > self.policy.seconds:
            why = "still held" if self._places else "it slipped" if felt.any() else "the jaw closed on nothing"
            return self._finish(observation, "failed", why, thing)
        try:
            vector = self.policy.act(observation, thing)
        except InputError as error:
            self.broken = str(error)
            raise
        self._servos = np.array(vector[:_SERVOS])
        return {"type": "control", "vector": vector.tolist()}

    def _finish(self, observation: Mapping[str, Any], outcome: str, why: str, thing: ObjectPose | None) -> Action:
        """Bring the arm to where things are carried, or fold it; then the work is over."""
        self.outcome, self.why = outcome, why
        angles = np.asarray(observation["sensors"]["joint_position"], np.float64)
        if outcome == "failed" and not self._places:
            # What was not picked is let go of where it is, rather than dropped later.
            self._servos[7:] = np.minimum(angles[7:] + _LETS_GO_BY, self.body.opening)
            self._worker.held = None
        elif thing is not None and finger_contacts(observation, self._entity).all():
            self._worker.held = object_in_jaw(self.body, angles[:7].copy(), thing.as_box(), float(angles[7:].min()))
        elif thing is not None:
            self._worker.held = None
        self._worker.set_servos(self._servos)
        self._worker.fold()
        self._next(PolicyStage.FOLD)
        return self._hold()

    def _fold(self, observation: Mapping[str, Any]) -> Action:
        action = self._worker.act(observation)
        if self._worker.busy:
            return action
        if self.outcome == "picked" and not finger_contacts(observation, self._entity).all():
            self._worker.held = None
            return self._end("failed", "it slipped", action)
        return self._end(self.outcome, self.why, action)

    # How it does it.

    def _faces(self, observation: Mapping[str, Any]) -> bool:
        x, y, _ = Stance.of(observation).inside(self._spot).tolist()
        return abs(math.atan2(y, x)) < _FACES

    def _hold(self) -> Action:
        return {"type": "control", "vector": [*self._servos.tolist(), 0.0, 0.0]}

    def _next(self, stage: PolicyStage) -> None:
        self.stage, self._timer, self._counted = stage, 0.0, 0.0

    def _end(self, outcome: str, why: str, action: Action) -> Action:
        self.outcome, self.why = outcome, why
        self._next(PolicyStage.IDLE)
        return action

    # Saved and restored.

    def state(self) -> AgentState:
        """Return all it remembers."""
        return {
            "worker": self._worker.state(),
            "watch": self._watch.state(),
            "policy": self.policy.state(),
            "stage": str(self.stage),
            "said": [self.outcome, self.why, self.broken],
            "places": self._places,
            "entity": self._entity,
            "spot": self._spot.copy(),
            "servos": self._servos.copy(),
            "way": self._way.copy(),
            "point": self._point,
            "numbers": [self._timer, self._counted, self._low],
        }

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self._worker.restore(state["worker"])
        self._watch.restore(state["watch"])
        self.policy.restore(state["policy"])
        self.stage = PolicyStage(state["stage"])
        self.outcome, self.why, self.broken = (str(text) for text in state["said"])
        self._places, self._entity, self._point = bool(state["places"]), int(state["entity"]), int(state["point"])
        self._spot, self._servos, self._way = (np.array(state[name]) for name in ("spot", "servos", "way"))
        self._timer, self._counted, self._low = (float(value) for value in state["numbers"])


_POLICY_STAGES = {
    PolicyStage.IDLE: lambda arm, observation: arm._worker.act(observation),
    PolicyStage.COME: LearnedArm._come,
    PolicyStage.READY: LearnedArm._ready,
    PolicyStage.POLICY: LearnedArm._ask,
    PolicyStage.FOLD: LearnedArm._fold,
}
