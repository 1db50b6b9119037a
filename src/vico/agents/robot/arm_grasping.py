"""Stages in which the arm plans its ways, goes them, closes or opens its jaw, and comes back with what it holds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vico.agents.robot.arm_job import FELT, STUCK, TAKES, Action, ArmJob, Array
from vico.agents.robot.body import Stance
from vico.agents.robot.footing import reach_footing
from vico.agents.robot.grasps import grasps_of, thing_box
from vico.agents.robot.held import came_off, held_thing, seen_in_hand
from vico.agents.robot.reaching import Reach, carry_way, reach_spot, reach_thing, room_around
from vico.agents.robot.sight import Look, look
from vico.agents.robot.stages import Stage, Work

# Seconds for fingers to close, and after which a hand that still trembles where it leans on something is as far as it
# goes; angles, rad, that tell moving from leaning, from one look to the next.
_GRIP_TIME, _LEANS, _MOVES = 1.6, 8.0, 0.002
# What is so high above the ground is no ground, metres.
_HIGH = 0.2


def plan(job: ArmJob, observation: Mapping[str, Any], angles: Array) -> Action:
    """Plan from where the base stands now, by what is seen."""
    if job.held is None and job.work is not Work.PICK:
        return job.fail("nothing in the jaw")
    stance, seen = Stance.of(observation), look(observation)
    job.servos = angles.copy() if job.held is None else job.servos
    job.reach = _PLANS[job.work](job, stance, seen)
    if job.reach is None:
        return job.retry(job.why or "out of reach")
    job.begin_way(job.reach.over, Stage.OVER)
    return job.hold()


def _plan_pick(job: ArmJob, stance: Stance, seen: Look) -> Reach | None:
    points = seen.of(job.entity)
    box = thing_box(points)
    if box is None:
        job.why = "not seen"
        return None
    job.target = stance.outside(np.array([*box.centre, box.low]))
    grasps = grasps_of(box, job.body, points)
    if not grasps:
        job.why = "too wide for the jaw"
        return None
    job.box = box
    rooms = room_around(job.body, seen.points), room_around(job.body, seen.without(job.entity))
    return reach_thing(job.body, rooms, job.servos[:7], grasps, skip=job.skip)


def _plan_place(job: ArmJob, stance: Stance, seen: Look) -> Reach | None:
    assert job.held is not None
    around = seen.without(job.entity)
    return reach_footing(job.body, around, job.servos[:7], stance, job.target, job.held, beside=job.beside)


def _plan_offer(job: ArmJob, stance: Stance, seen: Look) -> Reach | None:
    assert job.held is not None
    spot = stance.inside(job.aim(stance))
    room = room_around(job.body, seen.without(job.entity))
    return reach_spot(job.body, room, job.servos[:7], spot, job.held)


def over(job: ArmJob, observation: Mapping[str, Any], angles: Array) -> Action:
    """Bring the hand over the thing, or the spot."""
    assert job.reach is not None
    if job.work is Work.PICK:
        job.fingers(job.reach.opening)
    if job.follow(angles):
        job.begin_way(job.reach.there, Stage.THERE)
    return job.hold()


def down(job: ArmJob, observation: Mapping[str, Any], angles: Array) -> Action:
    """Go the last bit, or as far as something solid lets it."""
    there = job.follow(angles)
    moves = float(np.abs(angles[:7] - job.angles).max()) > _MOVES
    job.angles = angles[:7].copy()
    told = job.way is not None and job.point >= len(job.way)
    job.stuck = job.stuck + job.period if told and not moves else 0.0
    if there or job.stuck > STUCK or job.timer > _LEANS:
        job.enter(Stage.GRIP)
    return job.hold()


def grip(job: ArmJob, observation: Mapping[str, Any], angles: Array) -> Action:
    """Close past the thing, against the fingers' largest force; or open, once the thing stands, or is taken."""
    assert job.reach is not None
    felt = np.asarray(observation["sensors"]["contacts"], np.float64)
    if job.work is Work.PICK:
        job.fingers(0.0)
        job.forces = float(felt.min())
        done = job.timer > _GRIP_TIME
    elif job.work is Work.OFFER and felt.min() > FELT / 2 and job.timer < TAKES:
        return job.hold()
    else:
        if job.work is Work.OFFER and job.timer >= TAKES:
            return job.fail("nobody took it")
        done = job.fingers(min(job.reach.opening + 0.03, job.body.opening))
    if done:
        job.begin_way(job.reach.away, Stage.AWAY)
    return job.hold()


def away(job: ArmJob, observation: Mapping[str, Any], angles: Array) -> Action:
    """Lift what was gripped, or leave what was let go of."""
    if not job.follow(angles):
        return job.hold()
    assert job.reach is not None
    if job.work is Work.PICK:
        assert job.box is not None
        if not job.grips(observation, angles):
            return _slipped(job)
        job.held = held_thing(job.body, job.reach.there[-1], job.box, float(angles[7:].min()))
    stance = Stance.of(observation)
    # Turned about on the spot, what is held sweeps over tables and decks.
    high = job.work is not Work.OFFER and float(stance.inside(job.target)[2]) > _HIGH - job.body.stand
    if job.work is not Work.PICK:
        assert job.held is not None
        off = came_off(job.body, angles[:7], job.reach.there[-1], job.held)
        high, job.held = high and off, None
    job.start = stance.position[:2].copy()
    job.enter(Stage.BACK if high else Stage.CARRY)
    return job.hold()


def carry(job: ArmJob, observation: Mapping[str, Any], angles: Array) -> Action:
    """Bring the arm to where it is in nobody's way."""
    if job.way is None:
        # What was put down, or slipped, is in the way from now on.
        mine = () if job.held is None else (job.entity,)
        room = room_around(job.body, look(observation).without(*mine))
        job.way = carry_way(job.body, room, job.servos[:7], job.held, opening=float(angles[7:].max()))
        job.point = 0
        if job.way is None:
            return job.finish()  # it stays where it is, which is free
    if not job.follow(angles):
        return job.hold()
    if job.work is not Work.PICK:
        return job.finish()
    if not job.grips(observation, angles):
        return _slipped(job)
    job.enter(Stage.INSPECT)
    return job.hold()


def inspect(job: ArmJob, observation: Mapping[str, Any], angles: Array) -> Action:
    """Look at what is in the hand once more: on a table no more than one face of it may have been in view."""
    assert job.held is not None
    job.held = seen_in_hand(job.body, angles[:7], job.held, look(observation).of(job.entity))
    return job.finish()


def _slipped(job: ArmJob) -> Action:
    """Try another grasp for one that did not hold."""
    assert job.reach is not None
    job.held = None
    job.skip.add(job.reach.number)
    return job.retry("it slipped" if job.forces > FELT else "the jaw closed on nothing")


_PLANS = {Work.PICK: _plan_pick, Work.PLACE: _plan_place, Work.OFFER: _plan_offer}
