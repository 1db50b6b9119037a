"""Pushing a thing along the ground with the fingers of a hand that is held low: what a jaw cannot hold moves, too."""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import AgentState
from vico.agents.robot.body import ArmBody, ArmServos, Drive, Stance, view_points
from vico.agents.robot.grasps import object_box
from vico.agents.robot.reaching import room_around
from vico.exact import dot
from vico.geometry import distance
from vico.kinematics.hand_paths import downward, straight_path
from vico.kinematics.planning import Arm, collision_free_reach, plan_path

Array = NDArray[np.float64]
Action = dict[str, Any]

#: Farther than this a thing is not pushed, metres; it is where it was to be within so much.
FARTHEST, THERE = 8.0, 0.12
# Where the middle between the pads is as they push: ahead of the base, and above the ground, metres.
_AHEAD, _LOW = 0.62, 0.065
# Fingers point so far ahead, rad: where the palm touches a thing first, high up, it topples it.
_TILTS = (0.7, 0.5, 0.3)
# How far behind the middle of the thing the arm comes down, and how near to that point is there, metres.
_BEHIND, _NEAR = 1.15, 0.25
# So far the arm may be told to be higher than it is, and so much it may sink before it is, metres.
_LIFTS, _SINKS = 0.1, 0.003
# Fingers are so much nearer to each other than the thing is wide, on each side, and so far apart at least, metres.
_WITHIN, _NARROW = 0.03, 0.02
_SPEED = 0.15  # m/s, pushing
_HARD = 0.3  # m/s, where nothing moves yet
_BACK_SPEED = 0.2  # m/s, back
_TURN = 0.6  # rad/s, turning
_GAIN = 1.5  # 1/s, of turning to the thing
_STEER = 0.6  # rad/s a metre, of steering to where it is to be
_STEER_MOST = 0.2  # rad/s of steering, at most
# Angles, rad: turned to it; so far aside the thing has slipped off the fingers.
_ALIGNED, _ASIDE = 0.06, 0.5
_LOOKS = 0.4  # seconds between two looks
_STUCK = 4.0  # seconds without getting on
_A_METRE = 60.0  # seconds of pushing a metre, at most
_STALE = 25.0  # seconds of any other stage, at most
_STANDS = 0.02  # m/s below which nothing moves
_BACK = 0.35  # metres that one goes back
_REACHED = 0.04  # rad off that count as there
# Of its speed an arm goes with; how near to what was seen it comes, in a grid coarser than the room there is, metres.
_SHARE, _CLOSE = 0.8, -0.03


class PushStage(StrEnum):
    """What it is at."""

    IDLE = "idle"
    COME = "come"
    ALIGN = "align"
    LOOK = "look"
    LOWER = "lower"
    PUSH = "push"
    BACK = "back"
    RAISE = "raise"


class Pusher(ArmServos):
    """Pushes one thing after the other; asked as often as its robot acts, while it is `busy`.

    The robot goes round the thing, opens its jaw across the way as far as the thing is wide, holds it just above the
    ground, and drives: two fingers keep the thing from turning. It looks where the thing is as it goes, and steers.

    Parameters
    ----------
    body
        The arm.
    period
        Seconds between two actions.

    Attributes
    ----------
    outcome, why
        Of the last piece of work: ``"pushed"``, or ``"failed"`` and the cause.
    servos
        Where joints and fingers are told to be, rad and metres, shape ``(9,)``.
    thing
        Where the thing was seen last, ENU metres, shape ``(2,)``.
    """

    def __init__(self, body: ArmBody, *, period: float) -> None:
        super().__init__(body, period=period)
        self.stage = PushStage.IDLE
        self.outcome = self.why = ""
        self._drive = Drive(period=period)
        self._entity = 0
        self.thing, self._goal, self._from = np.zeros(2), np.zeros(2), np.zeros(2)
        self._knows = False
        self._timer = self._still = self._looked = 0.0
        self._opening = 0.0
        self._lifts, self._lifted = np.zeros((0, 7)), 0  # angles from where fingers push up, and which of them is told

    @property
    def busy(self) -> bool:
        """Whether it is at work."""
        return self.stage is not PushStage.IDLE

    @property
    def wants_picture(self) -> bool:
        """Whether it looks at the thing the next time."""
        looks = self.stage is PushStage.PUSH and self._looked + self.period >= _LOOKS
        return looks or self.stage in (PushStage.ALIGN, PushStage.LOOK)

    def push(self, entity: int, position: Array, goal: Array) -> None:
        """Begin to push a thing that is about at a position on the ground to another one, both ENU metres.

        Parameters
        ----------
        entity
            Its number in segmentation.
        """
        self._entity = entity
        self.thing, self._goal = np.array(position, np.float64)[:2], np.array(goal, np.float64)[:2]
        self.outcome = self.why = ""
        self._knows = False
        self._next(PushStage.COME)
        if distance(self._goal, self.thing) > FARTHEST:
            self._end("too far")

    def act(self, observation: Mapping[str, Any]) -> Action:
        """Return the action for the coming period.

        Parameters
        ----------
        observation
            With ``sensors``; depth and segmentation where it `wants_picture`.
        """
        angles = np.asarray(observation["sensors"]["joint_position"], np.float64)
        if not self._knows:
            self.servos, self._knows = angles.copy(), True
        self._timer += self.period
        self._looked += self.period
        if self._timer > self._longest() and self.stage is not PushStage.COME:
            return self._give_up(observation, f"no end of {self.stage}")
        if self.wants_picture and "depth" not in observation:
            return self.hold()
        return _PUSH_STAGES[self.stage](self, observation, angles)

    def _longest(self) -> float:
        way = distance(self._goal, self.thing)
        return _STALE + _A_METRE * way * (self.stage is PushStage.PUSH)

    def _come(self, observation: Mapping[str, Any], angles: Array) -> Action:
        """Go round the thing, to behind it."""
        behind = self.thing - self._along() * _BEHIND
        if not self._drive.busy:
            if float(np.hypot(*(Stance.of(observation).position[:2] - behind))) > _NEAR:
                self._drive.begin(behind, near=_NEAR)
            else:
                self._next(PushStage.ALIGN)
                return self.hold()
        action = self._drive.act(observation)
        if self._drive.busy:
            return action
        if not self._drive.arrived:
            return self._end("no way there")
        self._next(PushStage.ALIGN)
        return self.hold()

    def _align(self, observation: Mapping[str, Any], angles: Array) -> Action:
        """Turn to the thing."""
        error = self._bearing(observation)
        moves = float(np.abs(observation["sensors"]["base_velocity"]).max()) > _STANDS
        if abs(error) > _ALIGNED:
            return self.hold(turn=float(np.clip(_GAIN * error, -_TURN, _TURN)))
        if not moves:
            self._next(PushStage.LOOK)
        return self.hold()

    def _look(self, observation: Mapping[str, Any], angles: Array) -> Action:
        """See how wide the thing is, and plan the arm's way down before it."""
        seen = view_points(observation)
        box = object_box(seen.of(self._entity))
        if box is None:
            return self._end("not seen")
        self.thing = Stance.of(observation).outside(np.array([*box.centre, 0.0]))[:2]
        self._opening = min(max(float(box.half[0]) - _WITHIN, _NARROW), self.body.opening)
        arm = Arm(self.body.chain, self.body.limbs(self._opening), room_around(self.body, seen.points), _CLOSE)
        low = np.array([_AHEAD, 0.0, _LOW - self.body.stand])
        goals = [downward(low, np.array([0.0, sign]), sign * tilt) for tilt in _TILTS for sign in (1.0, -1.0)]
        found = collision_free_reach(arm, goals, angles[:7], posture=self.body.rest)
        way = None if found is None else plan_path(arm, angles[:7], found[0])
        if way is None or found is None:
            return self._end("out of reach")
        pose = self.body.hand(found[0])
        higher = pose.copy()
        higher[2, 3] += _LIFTS
        up = straight_path(self.body.chain, found[0], pose, higher)
        if up is None:
            return self._end("out of reach")
        self._lifts, self._lifted = np.vstack([found[0], up]), 0
        self._take(way, PushStage.LOWER)
        return self.hold()

    def _lower(self, observation: Mapping[str, Any], angles: Array) -> Action:
        self.fingers(self._opening)
        if self._follow(angles):
            self._next(PushStage.PUSH)
        return self.hold()

    def _push(self, observation: Mapping[str, Any], angles: Array) -> Action:
        """Drive on, towards where the thing is to be."""
        if self._looked >= _LOOKS and "depth" in observation:
            self._looked = 0.0
            box = object_box(view_points(observation).of(self._entity))
            if box is not None:
                self.thing = Stance.of(observation).outside(np.array([*box.centre, 0.0]))[:2]
        stance = Stance.of(observation)
        missing = self._goal - self.thing
        ahead = stance.rotation[:2, 0]
        if float(dot(missing, ahead)) < THERE / 2:
            self._from = stance.position[:2].copy()
            self._next(PushStage.BACK)
            return self.hold()
        if abs(self._bearing(observation)) > _ASIDE:
            return self._give_up(observation, "it slipped off")
        moves = float(np.abs(observation["sensors"]["base_velocity"][:2]).max()) > _STANDS
        self._still = 0.0 if moves else self._still + self.period
        if self._still > _STUCK:
            return self._give_up(observation, "it does not move")
        self._keep_up(angles, moves)
        off = math.atan2(float(ahead[0] * missing[1] - ahead[1] * missing[0]), float(dot(ahead, missing)))
        return self.hold(_SPEED if moves else _HARD, float(np.clip(_STEER * off, -_STEER_MOST, _STEER_MOST)))

    def _goes_back(self, observation: Mapping[str, Any], angles: Array) -> Action:
        gone = float(np.hypot(*(Stance.of(observation).position[:2] - self._from)))
        moves = float(np.abs(observation["sensors"]["base_velocity"]).max()) > _STANDS
        self._still = 0.0 if moves else self._still + self.period
        if gone < _BACK and self._still < _STUCK:
            return self.hold(-_BACK_SPEED)
        way = np.vstack([self.servos[:7], self.body.rest])
        self._take(way, PushStage.RAISE)
        return self.hold()

    def _raise(self, observation: Mapping[str, Any], angles: Array) -> Action:
        self.fingers(0.0)
        if not self._follow(angles):
            return self.hold()
        if self.why:
            return self._end(self.why)
        off = distance(self._goal, self.thing)
        return self._end("" if off < 2.0 * THERE else "off its way")

    # How it does it.

    def _keep_up(self, angles: Array, moves: bool) -> None:
        """Tell the arm to be higher where the thing does not move.

        An arm gives way to what it pushes, and sinks: then its fingers press the thing to the ground, the harder they
        push the more. Told to rise, they take weight off it.
        """
        sinks = float(self.body.hand(self._lifts[0])[2, 3] - self.body.hand(angles[:7])[2, 3])
        if not moves or abs(sinks) > _SINKS:
            step = 1 if not moves or sinks > 0.0 else -1
            self._lifted = min(max(self._lifted + step, 0), len(self._lifts) - 1)
        self.servos[:7] = self._lifts[self._lifted]

    def _along(self) -> Array:
        way = self._goal - self.thing
        return np.asarray(way / max(float(np.hypot(*way)), 1e-6))

    def _bearing(self, observation: Mapping[str, Any]) -> float:
        """Return by how much the thing is to the left of straight ahead, rad."""
        stance = Stance.of(observation)
        x, y, _ = stance.inside(np.array([*self.thing, stance.position[2]]))
        return math.atan2(float(y), float(x))

    def _follow(self, angles: Array) -> bool:
        return self.follow_way(angles, speed=_SHARE, tolerance=_REACHED)

    def _take(self, way: Array, stage: PushStage) -> None:
        self._next(stage)
        self.way, self.point = way, 0

    def _next(self, stage: PushStage) -> None:
        self.stage, self._timer, self._still, self.way = stage, 0.0, 0.0, None

    def _give_up(self, observation: Mapping[str, Any], why: str) -> Action:
        """End with a cause, once the arm is up again."""
        if self.stage not in (PushStage.LOWER, PushStage.PUSH):
            return self._end(why)
        self.why, self._from = why, Stance.of(observation).position[:2].copy()
        self._next(PushStage.BACK)
        return self.hold(-_BACK_SPEED)

    def _end(self, why: str) -> Action:
        self.outcome, self.why = "failed" if why else "pushed", why
        self._next(PushStage.IDLE)
        return self.hold()

    # Saved and restored.

    def state(self) -> AgentState:
        """Return all it remembers."""
        return {
            "stage": str(self.stage),
            "outcome": [self.outcome, self.why],
            "servos": self.servos.copy(),
            "drive": self._drive.state(),
            "entity": self._entity,
            "points": [self.thing.copy(), self._goal.copy(), self._from.copy()],
            "knows": self._knows,
            "numbers": [self._timer, self._still, self._looked, self._opening],
            "way": None if self.way is None else self.way.copy(),
            "point": self.point,
            "lifts": self._lifts.copy(),
            "lifted": self._lifted,
        }

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self.stage = PushStage(state["stage"])
        self.outcome, self.why = state["outcome"]
        self.servos = np.array(state["servos"])
        self._drive.restore(state["drive"])
        self._entity, self.point, self._knows = int(state["entity"]), int(state["point"]), bool(state["knows"])
        self.thing, self._goal, self._from = (np.array(point) for point in state["points"])
        self._timer, self._still, self._looked, self._opening = (float(value) for value in state["numbers"])
        self.way = None if state["way"] is None else np.array(state["way"])
        self._lifts, self._lifted = np.array(state["lifts"]).reshape(-1, 7), int(state["lifted"])


_PUSH_STAGES = {
    PushStage.IDLE: lambda pusher, observation, angles: pusher.hold(),
    PushStage.COME: Pusher._come,
    PushStage.ALIGN: Pusher._align,
    PushStage.LOOK: Pusher._look,
    PushStage.LOWER: Pusher._lower,
    PushStage.PUSH: Pusher._push,
    PushStage.BACK: Pusher._goes_back,
    PushStage.RAISE: Pusher._raise,
}
