"""An arm at work, from what its robot sees and feels: picks things up, puts them down, hands them over."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.robot.body import ArmBody, Stance
from vico.agents.robot.driving import Drive
from vico.agents.robot.following import go_along
from vico.agents.robot.footing import reach_footing
from vico.agents.robot.grasps import ThingBox, grasps_of, thing_box
from vico.agents.robot.reaching import (
    Held,
    Reach,
    came_off,
    carry_way,
    held_out_at,
    held_thing,
    raise_way,
    reach_spot,
    reach_thing,
    room_around,
    seen_in_hand,
)
from vico.agents.robot.sight import Look, look, room_ahead
from vico.agents.robot.stages import Stage, Work
from vico.agents.state import AgentState

Array = NDArray[np.float64]
Action = dict[str, Any]

#: Metres from the base's middle to what its arm reaches for, tried one after the other.
STANDOFFS = (0.60, 0.54, 0.68, 0.62)
# Nearer than this the base is brought up by speeds of its own, metres; and how exactly.
_NEAR, _EXACT, _ALIGNED = 1.3, 0.03, 0.08
_BESIDE = 0.9  # cosine of the angle by which the side it comes from may be another one
_STRAIGHT, _TURN, _GAIN = 0.25, 0.7, 1.5
# Ground that is left between the base and what was seen ahead of it, metres.
_ROOM_AHEAD = 0.06
# Seconds: for fingers to close, for each stage, without getting nearer, for coming as near as it can.
_GRIP_TIME, _STALE, _STUCK, _SETTLES = 1.6, 20.0, 1.0, 12.0
# Newtons on both fingers that are a grip, and metres that fingers stay apart if there is something in between.
_FELT, _APART = 4.0, 0.004
# Angles, rad, that count as there, and that tell moving from leaning on something, from one look to the next.
_THERE, _MOVES = 0.03, 0.002
# Seconds after which a hand that still trembles where it leans on something is as far as it goes.
_LEANS = 8.0
# Seconds without a grip after which what was held is lost.
_LOST = 0.6
# Of its speed an arm goes with, and with something in the jaw.
_SPEED, _LADEN = 0.8, 0.5
_TAKES = 60.0  # seconds that people have to take what is held out to them
# What is so high above the ground is no ground; from there the base goes back so far first, metres.
_HIGH, _BACK = 0.2, 0.35


class ArmWorker:
    """Does one piece of work after the other; asked as often as its robot acts.

    Ask `act` for actions while it is `busy`; then `outcome` is what came of the work, ``"failed"`` or the value of
    `Work`, and `why` the reason of a failure.

    Parameters
    ----------
    body
        The arm.
    period
        Seconds between two actions.

    Attributes
    ----------
    held
        What is in the jaw, as far as it knows; None for nothing.
    outcome, why
        Of the last piece of work.
    forces
        Largest force on the weaker finger since the last grip, newtons.
    tries
        How often the last piece of work was begun anew.
    """

    def __init__(self, body: ArmBody, *, period: float) -> None:
        self.body, self.period = body, period
        self.work, self.stage = Work.NOTHING, Stage.IDLE
        self.held: Held | None = None
        self.outcome = self.why = ""
        self.forces = 0.0
        self._drive = Drive(period=period)
        self._entity = 0  # of what is picked, or held
        self._target = np.zeros(3)
        self._beside: Array | None = None
        self._set = np.concatenate([body.rest, [0.0, 0.0]])  # where servos are told to be
        self._angles = body.rest.copy()  # as they were felt last
        self._knows = False
        self._timer = self._stuck = 0.0
        self.tries = 0
        self._skip: set[int] = set()
        self._reach: Reach | None = None
        self._way: Array | None = None
        self._point = 0
        self._from = np.zeros(2)  # where going back began, ENU metres
        self._box: ThingBox | None = None  # round the thing, as it stood when the hand went there

    # What it is told.

    @property
    def busy(self) -> bool:
        """Whether it is at work."""
        return self.work is not Work.NOTHING

    @property
    def wants_picture(self) -> bool:
        """Whether it looks at what is around it the next time."""
        return self.busy and (
            self.stage in (Stage.ALIGN, Stage.LOOK, Stage.INSPECT) or (self.stage is Stage.CARRY and self._way is None)
        )

    def pick(self, entity: int, position: Array, *, beside: Array | None = None) -> None:
        """Begin to pick a thing up that is about at a position, ENU metres.

        Parameters
        ----------
        beside
            Unit vector from the thing to the side it is to come from, shape ``(2,)``; None for wherever it is.
        """
        self._begin(Work.PICK, position, entity)
        self._beside = None if beside is None else np.array(beside, np.float64)

    def place(self, spot: Array, *, beside: Array | None = None) -> None:
        """Begin to put down what is held, with its underside at a spot, ENU metres.

        Parameters
        ----------
        beside
            Unit vector from the spot to the side it is to come from, shape ``(2,)``; None for wherever it is.
        """
        self._begin(Work.PLACE, spot, self._entity)
        self._beside = None if beside is None else np.array(beside, np.float64)

    def offer(self, person: Array) -> None:
        """Begin to hold out what is held to somebody who stands at a point, ENU metres."""
        self._begin(Work.OFFER, person, self._entity)

    def fold(self) -> None:
        """Bring the arm to where things are carried, or to its rest with nothing in it."""
        self._begin(Work.FOLD, self._target, self._entity)
        self._next(Stage.CARRY)

    def moved(self, servos: Array) -> None:
        """Take in where somebody else has told the servos to be meanwhile, rad and metres, shape ``(9,)``."""
        self._set, self._knows = np.array(servos, np.float64), True

    def lost(self, observation: Mapping[str, Any]) -> bool:
        """Return whether a jaw that held something feels it no more; then nothing is held.

        Asked once a period while there is no work for it.
        """
        feels = self._by_oracle(observation) or float(np.min(observation["sensors"]["contacts"])) >= _FELT / 2
        self._stuck = 0.0 if feels or self.busy or self.held is None else self._stuck + self.period
        if self._stuck < _LOST:
            return False
        self.held, self._stuck = None, 0.0
        return True

    def _by_oracle(self, observation: Mapping[str, Any]) -> bool:
        """Return whether it is told that it holds the thing, as it is with oracle grasp."""
        return self._entity != 0 and self._entity in observation.get("state", {}).get("held", ())

    def _begin(self, work: Work, target: Array, entity: int) -> None:
        self.work, self._entity, self._target = work, entity, np.array(target, np.float64)
        self.outcome = self.why = ""
        self.tries, self._skip, self._beside = 0, set(), None
        self._next(Stage.COME)

    # What it does.

    def act(self, observation: Mapping[str, Any]) -> Action:
        """Return the action for the coming period.

        Parameters
        ----------
        observation
            With ``sensors``; depth and segmentation are looked at where it plans.
        """
        angles = np.asarray(observation["sensors"]["joint_position"], np.float64)
        if not self._knows:
            self._set, self._knows = angles.copy(), True
        self._timer += self.period
        self.forces = max(self.forces, float(np.min(observation["sensors"]["contacts"])))
        if self._timer > _STALE + _TAKES * (self.work is Work.OFFER) and self.stage is not Stage.COME:
            return self._fail(f"no end of {self.stage}")
        if self.wants_picture and "depth" not in observation:
            return self._hold()  # until there is one
        return _STAGES[self.stage](self, observation, angles)

    def _come(self, observation: Mapping[str, Any], angles: Array) -> Action:
        """Drive near the target on ways of the map."""
        at = Stance.of(observation).position
        away = at[:2] - self._target[:2]
        distance = float(np.hypot(*away))
        side = away / max(distance, 1e-6) if self._beside is None else self._beside
        if not self._drive.busy:
            if distance <= _NEAR and float(side @ away) > _BESIDE * distance:
                return self._is_near()
            self._drive.begin(self._target[:2] + side * (_NEAR - 0.35), near=_NEAR - 0.35)
        action = self._drive.act(observation)
        if self._drive.busy:
            return action
        if not self._drive.arrived:
            return self._fail("no way there")
        return self._is_near()

    def _is_near(self) -> Action:
        self._next(Stage.RAISE if self.work is Work.PLACE and self.held is not None else Stage.ALIGN)
        return self._hold()

    def _raise(self, observation: Mapping[str, Any], angles: Array) -> Action:
        """Lift what is held above what it is put on, before it is in the way of coming near."""
        assert self.held is not None
        if self._way is None:
            spot = Stance.of(observation).inside(self._target)
            self._way, self._point = raise_way(self.body, self._set[:7], self.held, float(spot[2])), 0
        if self._way is None or self._follow(angles):
            self._next(Stage.ALIGN)
        return self._hold()

    def _align(self, observation: Mapping[str, Any], angles: Array) -> Action:
        """Turn to the target and stand so far off it that the arm reaches it, as near as the ground is free."""
        stance = Stance.of(observation)
        target = stance.inside(self._goal(stance))
        error = math.atan2(float(target[1]), float(target[0]))
        missing = float(np.hypot(*target[:2])) - STANDOFFS[self.tries % len(STANDOFFS)]
        moves = float(np.abs(observation["sensors"]["base_velocity"]).max()) > 0.02
        # The square bumper's corners touch before the round base does.
        self._stuck = 0.0 if moves or abs(error) > _ALIGNED else self._stuck + self.period
        if missing > _EXACT and (
            self._stuck > _STUCK or room_ahead(self.body, look(observation, step=3).without(self._entity)) < _ROOM_AHEAD
        ):
            missing = 0.0  # as near as the ground is free
        forward = turn = 0.0
        if abs(error) > _ALIGNED:
            turn = min(max(_GAIN * error, -_TURN), _TURN)
        elif abs(missing) > _EXACT:
            forward, turn = min(max(missing, -_STRAIGHT), _STRAIGHT), error
        if self._timer > _SETTLES or (forward == turn == 0.0 and not moves):
            self._next(Stage.LOOK)  # as near as it comes, and turned as far
            return self._hold()
        return self._hold(forward, turn)

    def _look(self, observation: Mapping[str, Any], angles: Array) -> Action:
        """Plan from where the base stands now, by what is seen."""
        if self.held is None and self.work is not Work.PICK:
            return self._fail("nothing in the jaw")
        stance, seen = Stance.of(observation), look(observation)
        self._set = angles.copy() if self.held is None else self._set
        plan = {Work.PICK: self._plan_pick, Work.PLACE: self._plan_place, Work.OFFER: self._plan_offer}[self.work]
        self._reach = plan(stance, seen)
        if self._reach is None:
            return self._again(self.why or "out of reach")
        self._take(self._reach.over, Stage.OVER)
        return self._hold()

    def _plan_pick(self, stance: Stance, seen: Look) -> Reach | None:
        points = seen.of(self._entity)
        box = thing_box(points)
        if box is None:
            self.why = "not seen"
            return None
        self._target = stance.outside(np.array([*box.centre, box.low]))
        grasps = grasps_of(box, self.body, points)
        if not grasps:
            self.why = "too wide for the jaw"
            return None
        self._box = box
        rooms = room_around(self.body, seen.points), room_around(self.body, seen.without(self._entity))
        return reach_thing(self.body, rooms, self._set[:7], grasps, skip=self._skip)

    def _plan_place(self, stance: Stance, seen: Look) -> Reach | None:
        assert self.held is not None
        around, now = seen.without(self._entity), self._set[:7]
        return reach_footing(self.body, around, now, stance, self._target, self.held, beside=self._beside)

    def _plan_offer(self, stance: Stance, seen: Look) -> Reach | None:
        assert self.held is not None
        spot = stance.inside(self._goal(stance))
        room = room_around(self.body, seen.without(self._entity))
        return reach_spot(self.body, room, self._set[:7], spot, self.held)

    def _over(self, observation: Mapping[str, Any], angles: Array) -> Action:
        assert self._reach is not None
        if self.work is Work.PICK:
            self._fingers(self._reach.opening)
        if self._follow(angles):
            self._take(self._reach.there, Stage.THERE)
        return self._hold()

    def _down(self, observation: Mapping[str, Any], angles: Array) -> Action:
        """Go the last bit, or as far as something solid lets it."""
        there = self._follow(angles)
        moves = float(np.abs(angles[:7] - self._angles).max()) > _MOVES
        self._angles = angles[:7].copy()
        told = self._way is not None and self._point >= len(self._way)
        self._stuck = self._stuck + self.period if told and not moves else 0.0
        if there or self._stuck > _STUCK or self._timer > _LEANS:
            self._next(Stage.GRIP)
        return self._hold()

    def _grip(self, observation: Mapping[str, Any], angles: Array) -> Action:
        """Close past the thing, against the fingers' largest force; or open, once the thing stands, or is taken."""
        assert self._reach is not None
        felt = np.asarray(observation["sensors"]["contacts"], np.float64)
        if self.work is Work.PICK:
            self._fingers(0.0)
            self.forces = float(felt.min())
            done = self._timer > _GRIP_TIME
        elif self.work is Work.OFFER and felt.min() > _FELT / 2 and self._timer < _TAKES:
            return self._hold()
        else:
            if self.work is Work.OFFER and self._timer >= _TAKES:
                return self._fail("nobody took it")
            done = self._fingers(min(self._reach.opening + 0.03, self.body.opening))
        if done:
            self._take(self._reach.away, Stage.AWAY)
        return self._hold()

    def _away(self, observation: Mapping[str, Any], angles: Array) -> Action:
        if not self._follow(angles):
            return self._hold()
        assert self._reach is not None
        if self.work is Work.PICK:
            assert self._box is not None
            if not self._grips(observation, angles):
                return self._slipped()
            self.held = held_thing(self.body, self._reach.there[-1], self._box, float(angles[7:].min()))
        stance = Stance.of(observation)
        # Turned about on the spot, what is held sweeps over tables and decks.
        high = self.work is not Work.OFFER and float(stance.inside(self._target)[2]) > _HIGH - self.body.stand
        if self.work is not Work.PICK:
            assert self.held is not None
            off = came_off(self.body, angles[:7], self._reach.there[-1], self.held)
            high, self.held = high and off, None
        self._from = stance.position[:2].copy()
        self._next(Stage.BACK if high else Stage.CARRY)
        return self._hold()

    def _back(self, observation: Mapping[str, Any], angles: Array) -> Action:
        """Go back the way it came from a table, or a deck, before the arm comes down."""
        gone = float(np.hypot(*(Stance.of(observation).position[:2] - self._from)))
        moves = float(np.abs(observation["sensors"]["base_velocity"]).max()) > 0.02
        self._stuck = 0.0 if moves else self._stuck + self.period
        if gone < _BACK and self._stuck <= _STUCK:
            return self._hold(-_STRAIGHT)
        self._next(Stage.CARRY)
        return self._hold()

    def _carry(self, observation: Mapping[str, Any], angles: Array) -> Action:
        """Bring the arm to where it is in nobody's way."""
        if self._way is None:
            # What was put down, or slipped, is in the way from now on.
            mine = () if self.held is None else (self._entity,)
            room = room_around(self.body, look(observation).without(*mine))
            self._way = carry_way(self.body, room, self._set[:7], self.held, opening=float(angles[7:].max()))
            self._point = 0
            if self._way is None:
                return self._done()  # it stays where it is, which is free
        if not self._follow(angles):
            return self._hold()
        if self.work is not Work.PICK:
            return self._done()
        if not self._grips(observation, angles):
            return self._slipped()
        self._next(Stage.INSPECT)
        return self._hold()

    def _inspect(self, observation: Mapping[str, Any], angles: Array) -> Action:
        """Look at what is in the hand once more: on a table no more than one face of it may have been in view."""
        assert self.held is not None
        self.held = seen_in_hand(self.body, angles[:7], self.held, look(observation).of(self._entity))
        return self._done()

    # How it does it.

    def _grips(self, observation: Mapping[str, Any], angles: Array) -> bool:
        """Return whether both fingers feel something between them, or an oracle says that they hold the thing."""
        if self._by_oracle(observation):
            return True
        return float(angles[7:].min()) >= _APART and float(np.min(observation["sensors"]["contacts"])) >= _FELT

    def _slipped(self) -> Action:
        """Try another grasp for one that did not hold."""
        assert self._reach is not None
        self.held = None
        self._skip.add(self._reach.number)
        return self._again("it slipped" if self.forces > _FELT else "the jaw closed on nothing")

    def _goal(self, stance: Stance) -> Array:
        """Return what the base turns to and the arm reaches for, ENU metres."""
        if self.work is not Work.OFFER:
            return self._target
        return held_out_at(self._target, stance)

    def _follow(self, angles: Array) -> bool:
        """Bring the servos on along the way; return whether the arm is at its end."""
        way = self._way
        assert way is not None
        most = self.body.fastest[:7] * self.period * (_SPEED if self.held is None else _LADEN)
        self._point = go_along(way, self._point, self._set[:7], most)
        return self._point >= len(way) and float(np.abs(way[-1] - angles[:7]).max()) < _THERE

    def _fingers(self, goal: float) -> bool:
        """Bring the fingers' servos towards a way off the middle; return whether they are told to be there."""
        most = self.body.fastest[7:] * self.period
        self._set[7:] += np.clip(goal - self._set[7:], -most, most)
        return bool(np.abs(self._set[7:] - goal).max() < 1e-9)

    def _hold(self, forward: float = 0.0, turn: float = 0.0) -> Action:
        return {"type": "control", "vector": [*self._set.tolist(), forward, turn]}

    def _take(self, way: Array, stage: Stage) -> None:
        self._next(stage)
        self._way, self._point = way, 0

    def _next(self, stage: Stage) -> None:
        self.stage, self._timer, self._way, self._stuck = stage, 0.0, None, 0.0

    def _again(self, why: str) -> Action:
        """Try once more from another standoff, or give up."""
        self.tries += 1
        self.why = why
        if self.tries >= len(STANDOFFS):
            return self._fail(why)
        self._next(Stage.ALIGN)
        return self._hold()

    def _fail(self, why: str) -> Action:
        self.outcome, self.why = "failed", why
        self.work = Work.NOTHING
        self._next(Stage.IDLE)
        return self._hold()

    def _done(self) -> Action:
        self.outcome, self.why = str(self.work), ""
        self.work = Work.NOTHING
        self._next(Stage.IDLE)
        return self._hold()

    # Saved and restored.

    def state(self) -> AgentState:
        """Return all it remembers."""
        held, reach = self.held, self._reach
        return {
            "work": str(self.work),
            "stage": str(self.stage),
            "held": None if held is None else {**held._asdict()},
            "outcome": [self.outcome, self.why],
            "entity": self._entity,
            "target": self._target.copy(),
            "beside": None if self._beside is None else self._beside.copy(),
            "set": self._set.copy(),
            "angles": self._angles.copy(),
            "knows": self._knows,
            "numbers": [self._timer, self._stuck, self.forces],
            "tries": self.tries,
            "skip": sorted(self._skip),
            "reach": None if reach is None else {**reach._asdict()},
            "way": None if self._way is None else self._way.copy(),
            "point": self._point,
            "from": self._from.copy(),
            "drive": self._drive.state(),
            "box": None if self._box is None else {**self._box._asdict()},
        }

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self.work, self.stage = Work(state["work"]), Stage(state["stage"])
        self.held = None if state["held"] is None else Held(**state["held"])
        self.outcome, self.why = state["outcome"]
        self._entity, self.tries, self._point = int(state["entity"]), int(state["tries"]), int(state["point"])
        self._target, self._set = np.array(state["target"]), np.array(state["set"])
        self._beside = None if state["beside"] is None else np.array(state["beside"])
        self._angles = np.array(state["angles"])
        self._knows = bool(state["knows"])
        self._timer, self._stuck, self.forces = (float(value) for value in state["numbers"])
        self._skip = set(state["skip"])
        self._drive.restore(state["drive"])
        self._reach = None if state["reach"] is None else Reach(**state["reach"])
        self._way = None if state["way"] is None else np.array(state["way"])
        self._from = np.array(state["from"])
        self._box = None if state["box"] is None else ThingBox(**state["box"])


_STAGES = {
    Stage.IDLE: lambda worker, observation, angles: worker._hold(),
    Stage.COME: ArmWorker._come,
    Stage.RAISE: ArmWorker._raise,
    Stage.ALIGN: ArmWorker._align,
    Stage.LOOK: ArmWorker._look,
    Stage.OVER: ArmWorker._over,
    Stage.THERE: ArmWorker._down,
    Stage.GRIP: ArmWorker._grip,
    Stage.AWAY: ArmWorker._away,
    Stage.BACK: ArmWorker._back,
    Stage.CARRY: ArmWorker._carry,
    Stage.INSPECT: ArmWorker._inspect,
}


__all__ = ["STANDOFFS", "ArmWorker", "Stage", "Work"]
