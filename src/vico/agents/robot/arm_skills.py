"""Arm skills: stages that bring the base near, plan, grasp, place and hand over, and the worker that runs them.

`ArmWorker` does one piece of work after the other from what its robot sees and feels. `ArmJob` is what it remembers of
one piece of work; each stage is a function of the job, the observation and the angles that were felt.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import AgentState
from vico.agents.robot.arm_interface import ArmStage, ArmTask
from vico.agents.robot.body import (
    ArmBody,
    ArmServos,
    Drive,
    PointView,
    Stance,
    free_distance_ahead,
    view_points,
)
from vico.agents.robot.grasps import (
    HeldObject,
    ObjectBox,
    candidate_grasps,
    has_released,
    object_box,
    object_in_jaw,
    offer_point,
    refine_held_object,
)
from vico.agents.robot.reaching import (
    ReachPlan,
    plan_carry,
    plan_grasp,
    plan_placement,
    plan_raise,
    plan_supported_placement,
    room_around,
)
from vico.exact import dot

__all__ = [
    "GRIP_FORCE",
    "HAND_OVER_PATIENCE",
    "STANDOFFS",
    "STUCK_TIME",
    "Action",
    "ArmJob",
    "ArmWorker",
    "Array",
    "align_base",
    "approach",
    "back_off",
    "inspect_held",
    "move_down",
    "move_jaw",
    "move_over",
    "move_to_carry",
    "plan_reach",
    "raise_held",
    "withdraw",
]
Array = NDArray[np.float64]
Action = dict[str, Any]

#: Metres from the base's middle to what its arm reaches for, tried one after the other.
STANDOFFS = (0.60, 0.54, 0.68, 0.62)
#: Seconds without getting nearer, and that people have to take what is held out to them.
STUCK_TIME, HAND_OVER_PATIENCE = 1.0, 60.0
#: Newtons on both fingers that are a grip.
GRIP_FORCE = 4.0
# Metres that fingers stay apart if there is something in between.
_APART = 0.004
# Angles, rad, that count as there.
_THERE = 0.03
# Of its speed an arm goes with, and with something in the jaw.
_SPEED, _LADEN = 0.8, 0.5


class ArmJob(ArmServos):
    """What an arm at work remembers; stages are functions of it, the observation and the angles it felt.

    Attributes
    ----------
    held
        What is in the jaw, as far as it knows; None for nothing.
    outcome, why
        Of the last piece of work, and the reason of a failure.
    forces
        Largest force on the weaker finger since the last grip, newtons.
    tries
        How often the work was begun anew.
    entity, target
        What is picked, or held; where, ENU metres, shape ``(3,)``.
    beside
        Unit vector to the side the base is to come from, shape ``(2,)``; None for wherever it is.
    servos, knows
        Where servos are told to be, rad and metres, shape ``(9,)``, and whether that is known yet.
    angles
        Of the arm as they were felt last, rad.
    timer, stuck
        Seconds of this stage, and of getting no nearer.
    reach, skip
        Ways to a grasp or a spot, and the grasps that are not tried again.
    way, point
        That the arm goes, angles of shape ``(m, 7)``, and which of its points is next.
    start
        Where going back began, ENU metres, shape ``(2,)``.
    box
        Round the thing, as it stood when the hand went there.
    """

    def __init__(self, body: ArmBody, *, period: float) -> None:
        super().__init__(body, period=period)
        self.work, self.stage = ArmTask.NOTHING, ArmStage.IDLE
        self.held: HeldObject | None = None
        self.outcome = self.why = ""
        self.forces = 0.0
        self.drive = Drive(period=period)
        self.entity = 0
        self.target = np.zeros(3)
        self.beside: Array | None = None
        self.angles = body.rest.copy()
        self.knows = False
        self.timer = self.stuck = 0.0
        self.tries = 0
        self.skip: set[int] = set()
        self.reach: ReachPlan | None = None
        self.start = np.zeros(2)
        self.box: ObjectBox | None = None

    # What it feels, and is after.

    def by_oracle(self, observation: Mapping[str, Any]) -> bool:
        """Return whether it is told that it holds the thing, as it is with oracle grasp."""
        return self.entity != 0 and self.entity in observation.get("state", {}).get("held", ())

    def grips(self, observation: Mapping[str, Any], angles: Array) -> bool:
        """Return whether both fingers feel something between them, or an oracle says that they hold the thing."""
        if self.by_oracle(observation):
            return True
        return float(angles[7:].min()) >= _APART and float(np.min(observation["sensors"]["contacts"])) >= GRIP_FORCE

    def aim(self, stance: Stance) -> Array:
        """Return what the base turns to and the arm reaches for, ENU metres."""
        if self.work is not ArmTask.OFFER:
            return self.target
        return offer_point(self.target, stance)

    def follow(self, angles: Array) -> bool:
        """Bring the servos on along the way; return whether the arm is at its end."""
        return self.follow_way(angles, speed=_SPEED if self.held is None else _LADEN, tolerance=_THERE)

    def begin_way(self, way: Array, stage: ArmStage) -> None:
        """Enter a stage in which the arm goes a way."""
        self.enter(stage)
        self.way, self.point = way, 0

    def enter(self, stage: ArmStage) -> None:
        """Enter a stage, with no way yet."""
        self.stage, self.timer, self.way, self.stuck = stage, 0.0, None, 0.0

    def retry(self, why: str) -> Action:
        """Try once more from another standoff, or give up."""
        self.tries += 1
        self.why = why
        if self.tries >= len(STANDOFFS):
            return self.fail(why)
        self.enter(ArmStage.ALIGN)
        return self.hold()

    def fail(self, why: str) -> Action:
        """End the work: it failed."""
        self.outcome, self.why = "failed", why
        self.work = ArmTask.NOTHING
        self.enter(ArmStage.IDLE)
        return self.hold()

    def finish(self) -> Action:
        """End the work: it is done."""
        self.outcome, self.why = str(self.work), ""
        self.work = ArmTask.NOTHING
        self.enter(ArmStage.IDLE)
        return self.hold()

    # Saved and restored.

    def state(self) -> AgentState:
        """Return all it remembers."""
        held, reach = self.held, self.reach
        return {
            "work": str(self.work),
            "stage": str(self.stage),
            "held": None if held is None else {**held._asdict()},
            "outcome": [self.outcome, self.why],
            "entity": self.entity,
            "target": self.target.copy(),
            "beside": None if self.beside is None else self.beside.copy(),
            "set": self.servos.copy(),
            "angles": self.angles.copy(),
            "knows": self.knows,
            "numbers": [self.timer, self.stuck, self.forces],
            "tries": self.tries,
            "skip": sorted(self.skip),
            "reach": None if reach is None else {**reach._asdict()},
            "way": None if self.way is None else self.way.copy(),
            "point": self.point,
            "from": self.start.copy(),
            "drive": self.drive.state(),
            "box": None if self.box is None else {**self.box._asdict()},
        }

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self.work, self.stage = ArmTask(state["work"]), ArmStage(state["stage"])
        self.held = None if state["held"] is None else HeldObject(**state["held"])
        self.outcome, self.why = state["outcome"]
        self.entity, self.tries, self.point = int(state["entity"]), int(state["tries"]), int(state["point"])
        self.target, self.servos = np.array(state["target"]), np.array(state["set"])
        self.beside = None if state["beside"] is None else np.array(state["beside"])
        self.angles = np.array(state["angles"])
        self.knows = bool(state["knows"])
        self.timer, self.stuck, self.forces = (float(value) for value in state["numbers"])
        self.skip = set(state["skip"])
        self.drive.restore(state["drive"])
        self.reach = None if state["reach"] is None else ReachPlan(**state["reach"])
        self.way = None if state["way"] is None else np.array(state["way"])
        self.start = np.array(state["from"])
        self.box = None if state["box"] is None else ObjectBox(**state["box"])


_NEAR = 1.3  # metres from which on the base is brought up by speeds of its own
_EXACT = 0.03  # metres off its place that count as there
_ALIGNED = 0.08  # rad off its heading that count as aligned
_BESIDE = 0.9  # cosine of the angle by which the side it comes from may be another one
_STRAIGHT = 0.25  # speed ahead, m/s
_TURN = 0.7  # speed of turning, rad/s
_GAIN = 1.5  # of turning, 1/s
# Ground that is left between the base and what was seen ahead of it, metres.
_ROOM_AHEAD = 0.06
_SETTLES = 12.0  # seconds for coming as near as it can
_BACK_OFF = 0.35  # metres that the base goes back from what is high


def approach(job: ArmJob, observation: Mapping[str, Any], angles: Array) -> Action:
    """Drive near the target on ways of the map."""
    at = Stance.of(observation).position
    away = at[:2] - job.target[:2]
    distance = float(np.hypot(*away))
    side = away / max(distance, 1e-6) if job.beside is None else job.beside
    if not job.drive.busy:
        if distance <= _NEAR and float(dot(side, away)) > _BESIDE * distance:
            return _is_near(job)
        job.drive.begin(job.target[:2] + side * (_NEAR - 0.35), near=_NEAR - 0.35)
    action = job.drive.act(observation)
    if job.drive.busy:
        return action
    if not job.drive.arrived:
        return job.fail("no way there")
    return _is_near(job)


def _is_near(job: ArmJob) -> Action:
    job.enter(ArmStage.RAISE if job.work is ArmTask.PLACE and job.held is not None else ArmStage.ALIGN)
    return job.hold()


def raise_held(job: ArmJob, observation: Mapping[str, Any], angles: Array) -> Action:
    """Lift what is held above what it is put on, before it is in the way of coming near."""
    assert job.held is not None
    if job.way is None:
        spot = Stance.of(observation).inside(job.target)
        job.way, job.point = plan_raise(job.body, job.servos[:7], job.held, float(spot[2])), 0
    if job.way is None or job.follow(angles):
        job.enter(ArmStage.ALIGN)
    return job.hold()


def align_base(job: ArmJob, observation: Mapping[str, Any], angles: Array) -> Action:
    """Turn to the target and stand so far off it that the arm reaches it, as near as the ground is free."""
    stance = Stance.of(observation)
    target = stance.inside(job.aim(stance))
    error = math.atan2(float(target[1]), float(target[0]))
    missing = float(np.hypot(*target[:2])) - STANDOFFS[job.tries % len(STANDOFFS)]
    moves = float(np.abs(observation["sensors"]["base_velocity"]).max()) > 0.02
    # The square bumper's corners touch before the round base does.
    job.stuck = 0.0 if moves or abs(error) > _ALIGNED else job.stuck + job.period
    if missing > _EXACT and (
        job.stuck > STUCK_TIME
        or free_distance_ahead(job.body, view_points(observation, step=3).without(job.entity)) < _ROOM_AHEAD
    ):
        missing = 0.0  # as near as the ground is free
    forward = turn = 0.0
    if abs(error) > _ALIGNED:
        turn = min(max(_GAIN * error, -_TURN), _TURN)
    elif abs(missing) > _EXACT:
        forward, turn = min(max(missing, -_STRAIGHT), _STRAIGHT), error
    if job.timer > _SETTLES or (forward == turn == 0.0 and not moves):
        job.enter(ArmStage.LOOK)  # as near as it comes, and turned as far
        return job.hold()
    return job.hold(forward, turn)


def back_off(job: ArmJob, observation: Mapping[str, Any], angles: Array) -> Action:
    """Go back the way it came from a table, or a deck, before the arm comes down."""
    gone = float(np.hypot(*(Stance.of(observation).position[:2] - job.start)))
    moves = float(np.abs(observation["sensors"]["base_velocity"]).max()) > 0.02
    job.stuck = 0.0 if moves else job.stuck + job.period
    if gone < _BACK_OFF and job.stuck <= STUCK_TIME:
        return job.hold(-_STRAIGHT)
    job.enter(ArmStage.CARRY)
    return job.hold()


_GRIP_TIME = 1.6  # seconds for fingers to close
_LEANS = 8.0  # seconds after which a hand that leans on something, and trembles, is as far as it goes
_MOVES = 0.002  # rad from one look to the next that tell moving from leaning
# What is so high above the ground is no ground, metres.
_HIGH = 0.2


def plan_reach(job: ArmJob, observation: Mapping[str, Any], angles: Array) -> Action:
    """Plan from where the base stands now, by what is seen."""
    if job.held is None and job.work is not ArmTask.PICK:
        return job.fail("nothing in the jaw")
    stance, seen = Stance.of(observation), view_points(observation)
    job.servos = angles.copy() if job.held is None else job.servos
    job.reach = _PLANS[job.work](job, stance, seen)
    if job.reach is None:
        return job.retry(job.why or "out of reach")
    job.begin_way(job.reach.over, ArmStage.OVER)
    return job.hold()


def _plan_pick(job: ArmJob, stance: Stance, seen: PointView) -> ReachPlan | None:
    points = seen.of(job.entity)
    box = object_box(points)
    if box is None:
        job.why = "not seen"
        return None
    job.target = stance.outside(np.array([*box.centre, box.low]))
    grasps = candidate_grasps(box, job.body, points)
    if not grasps:
        job.why = "too wide for the jaw"
        return None
    job.box = box
    rooms = room_around(job.body, seen.points), room_around(job.body, seen.without(job.entity))
    return plan_grasp(job.body, rooms, job.servos[:7], grasps, skip=job.skip)


def _plan_place(job: ArmJob, stance: Stance, seen: PointView) -> ReachPlan | None:
    assert job.held is not None
    around = seen.without(job.entity)
    return plan_supported_placement(job.body, around, job.servos[:7], stance, job.target, job.held, beside=job.beside)


def _plan_offer(job: ArmJob, stance: Stance, seen: PointView) -> ReachPlan | None:
    assert job.held is not None
    spot = stance.inside(job.aim(stance))
    room = room_around(job.body, seen.without(job.entity))
    return plan_placement(job.body, room, job.servos[:7], spot, job.held)


def move_over(job: ArmJob, observation: Mapping[str, Any], angles: Array) -> Action:
    """Bring the hand over the thing, or the spot."""
    assert job.reach is not None
    if job.work is ArmTask.PICK:
        job.fingers(job.reach.opening)
    if job.follow(angles):
        job.begin_way(job.reach.there, ArmStage.THERE)
    return job.hold()


def move_down(job: ArmJob, observation: Mapping[str, Any], angles: Array) -> Action:
    """Go the last bit, or as far as something solid lets it."""
    there = job.follow(angles)
    moves = float(np.abs(angles[:7] - job.angles).max()) > _MOVES
    job.angles = angles[:7].copy()
    told = job.way is not None and job.point >= len(job.way)
    job.stuck = job.stuck + job.period if told and not moves else 0.0
    if there or job.stuck > STUCK_TIME or job.timer > _LEANS:
        job.enter(ArmStage.GRIP)
    return job.hold()


def move_jaw(job: ArmJob, observation: Mapping[str, Any], angles: Array) -> Action:
    """Close past the thing, against the fingers' largest force; or open, once the thing stands, or is taken."""
    assert job.reach is not None
    felt = np.asarray(observation["sensors"]["contacts"], np.float64)
    if job.work is ArmTask.PICK:
        job.fingers(0.0)
        job.forces = float(felt.min())
        done = job.timer > _GRIP_TIME
    elif job.work is ArmTask.OFFER and felt.min() > GRIP_FORCE / 2 and job.timer < HAND_OVER_PATIENCE:
        return job.hold()
    else:
        if job.work is ArmTask.OFFER and job.timer >= HAND_OVER_PATIENCE:
            return job.fail("nobody took it")
        done = job.fingers(min(job.reach.opening + 0.03, job.body.opening))
    if done:
        job.begin_way(job.reach.away, ArmStage.AWAY)
    return job.hold()


def withdraw(job: ArmJob, observation: Mapping[str, Any], angles: Array) -> Action:
    """Lift what was gripped, or leave what was let go of."""
    if not job.follow(angles):
        return job.hold()
    assert job.reach is not None
    if job.work is ArmTask.PICK:
        assert job.box is not None
        if not job.grips(observation, angles):
            return _retry_grasp(job)
        job.held = object_in_jaw(job.body, job.reach.there[-1], job.box, float(angles[7:].min()))
    stance = Stance.of(observation)
    # Turned about on the spot, what is held sweeps over tables and decks.
    high = job.work is not ArmTask.OFFER and float(stance.inside(job.target)[2]) > _HIGH - job.body.stand
    if job.work is not ArmTask.PICK:
        assert job.held is not None
        off = has_released(job.body, angles[:7], job.reach.there[-1], job.held)
        high, job.held = high and off, None
    job.start = stance.position[:2].copy()
    job.enter(ArmStage.BACK if high else ArmStage.CARRY)
    return job.hold()


def move_to_carry(job: ArmJob, observation: Mapping[str, Any], angles: Array) -> Action:
    """Bring the arm to where it is in nobody's way."""
    if job.way is None:
        # What was put down, or slipped, is in the way from now on.
        mine = () if job.held is None else (job.entity,)
        room = room_around(job.body, view_points(observation).without(*mine))
        job.way = plan_carry(job.body, room, job.servos[:7], job.held, opening=float(angles[7:].max()))
        job.point = 0
        if job.way is None:
            return job.finish()  # it stays where it is, which is free
    if not job.follow(angles):
        return job.hold()
    if job.work is not ArmTask.PICK:
        return job.finish()
    if not job.grips(observation, angles):
        return _retry_grasp(job)
    job.enter(ArmStage.INSPECT)
    return job.hold()


def inspect_held(job: ArmJob, observation: Mapping[str, Any], angles: Array) -> Action:
    """Look at what is in the hand once more: on a table no more than one face of it may have been in view."""
    assert job.held is not None
    job.held = refine_held_object(job.body, angles[:7], job.held, view_points(observation).of(job.entity))
    return job.finish()


def _retry_grasp(job: ArmJob) -> Action:
    """Try another grasp for one that did not hold."""
    assert job.reach is not None
    job.held = None
    job.skip.add(job.reach.number)
    return job.retry("it slipped" if job.forces > GRIP_FORCE else "the jaw closed on nothing")


_PLANS = {ArmTask.PICK: _plan_pick, ArmTask.PLACE: _plan_place, ArmTask.OFFER: _plan_offer}


# Seconds for each stage, and without a grip after which what was held is lost.
_STAGE_TIMEOUT, _GRIP_LOST_AFTER = 20.0, 0.6


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
    body, period
        As they were given.
    """

    def __init__(self, body: ArmBody, *, period: float) -> None:
        self.body, self.period = body, period
        self._job = ArmJob(body, period=period)

    # What came of it.

    @property
    def work(self) -> ArmTask:
        """What it is at."""
        return self._job.work

    @property
    def stage(self) -> ArmStage:
        """How far it is with that."""
        return self._job.stage

    @property
    def held(self) -> HeldObject | None:
        """What is in the jaw, as far as it knows; None for nothing."""
        return self._job.held

    @held.setter
    def held(self, held: HeldObject | None) -> None:
        self._job.held = held

    @property
    def outcome(self) -> str:
        """What came of the last piece of work; "" while it is at one."""
        return self._job.outcome

    @property
    def why(self) -> str:
        """Why the last piece of work failed."""
        return self._job.why

    @property
    def forces(self) -> float:
        """Largest force on the weaker finger since the last grip, newtons."""
        return self._job.forces

    @property
    def tries(self) -> int:
        """How often the last piece of work was begun anew."""
        return self._job.tries

    # What it is told.

    @property
    def busy(self) -> bool:
        """Whether it is at work."""
        return self.work is not ArmTask.NOTHING

    @property
    def wants_picture(self) -> bool:
        """Whether it looks at what is around it the next time."""
        stage = self._job.stage
        looks = stage in (ArmStage.ALIGN, ArmStage.LOOK, ArmStage.INSPECT) or (
            stage is ArmStage.CARRY and self._job.way is None
        )
        return self.busy and looks

    def pick(self, entity: int, position: Array, *, beside: Array | None = None) -> None:
        """Begin to pick a thing up that is about at a position, ENU metres.

        Parameters
        ----------
        beside
            Unit vector from the thing to the side it is to come from, shape ``(2,)``; None for wherever it is.
        """
        self._begin(ArmTask.PICK, position, entity)
        self._job.beside = None if beside is None else np.array(beside, np.float64)

    def place(self, spot: Array, *, beside: Array | None = None) -> None:
        """Begin to put down what is held, with its underside at a spot, ENU metres.

        Parameters
        ----------
        beside
            Unit vector from the spot to the side it is to come from, shape ``(2,)``; None for wherever it is.
        """
        self._begin(ArmTask.PLACE, spot, self._job.entity)
        self._job.beside = None if beside is None else np.array(beside, np.float64)

    def offer(self, person: Array) -> None:
        """Begin to hold out what is held to somebody who stands at a point, ENU metres."""
        self._begin(ArmTask.OFFER, person, self._job.entity)

    def fold(self) -> None:
        """Bring the arm to where things are carried, or to its rest with nothing in it."""
        self._begin(ArmTask.FOLD, self._job.target, self._job.entity)
        self._job.enter(ArmStage.CARRY)

    def set_servos(self, servos: Array) -> None:
        """Take in where somebody else has told the servos to be meanwhile, rad and metres, shape ``(9,)``."""
        self._job.servos, self._job.knows = np.array(servos, np.float64), True

    def has_lost(self, observation: Mapping[str, Any]) -> bool:
        """Return whether a jaw that held something feels it no more; then nothing is held.

        Asked once a period while there is no work for it.
        """
        job = self._job
        feels = job.by_oracle(observation) or float(np.min(observation["sensors"]["contacts"])) >= GRIP_FORCE / 2
        job.stuck = 0.0 if feels or self.busy or job.held is None else job.stuck + self.period
        if job.stuck < _GRIP_LOST_AFTER:
            return False
        job.held, job.stuck = None, 0.0
        return True

    def _begin(self, work: ArmTask, target: Array, entity: int) -> None:
        job = self._job
        job.work, job.entity, job.target = work, entity, np.array(target, np.float64)
        job.outcome = job.why = ""
        job.tries, job.skip, job.beside = 0, set(), None
        job.enter(ArmStage.COME)

    # What it does.

    def act(self, observation: Mapping[str, Any]) -> Action:
        """Return the action for the coming period.

        Parameters
        ----------
        observation
            With ``sensors``; depth and segmentation are looked at where it plans.
        """
        job = self._job
        angles = np.asarray(observation["sensors"]["joint_position"], np.float64)
        if not job.knows:
            job.servos, job.knows = angles.copy(), True
        job.timer += self.period
        job.forces = max(job.forces, float(np.min(observation["sensors"]["contacts"])))
        if (
            job.timer > _STAGE_TIMEOUT + HAND_OVER_PATIENCE * (job.work is ArmTask.OFFER)
            and job.stage is not ArmStage.COME
        ):
            return job.fail(f"no end of {job.stage}")
        if self.wants_picture and "depth" not in observation:
            return job.hold()  # until there is one
        return _STAGES[job.stage](job, observation, angles)

    # Saved and restored.

    def state(self) -> AgentState:
        """Return all it remembers."""
        return self._job.state()

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self._job.restore(state)


def _hold_still(job: ArmJob, observation: Mapping[str, Any], angles: Array) -> Action:
    return job.hold()


_STAGES: dict[ArmStage, Callable[[ArmJob, Mapping[str, Any], Array], Action]] = {
    ArmStage.IDLE: _hold_still,
    ArmStage.COME: approach,
    ArmStage.RAISE: raise_held,
    ArmStage.ALIGN: align_base,
    ArmStage.LOOK: plan_reach,
    ArmStage.OVER: move_over,
    ArmStage.THERE: move_down,
    ArmStage.GRIP: move_jaw,
    ArmStage.AWAY: withdraw,
    ArmStage.BACK: back_off,
    ArmStage.CARRY: move_to_carry,
    ArmStage.INSPECT: inspect_held,
}
