"""Stages in which the base is brought to where its arm reaches what it is after, and back off it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from vico.agents.robot.arm_job import STANDOFFS, STUCK, Action, ArmJob, Array
from vico.agents.robot.body import Stance
from vico.agents.robot.reaching import raise_way
from vico.agents.robot.sight import look, room_ahead
from vico.agents.robot.stages import Stage, Work
from vico.exact import dot

# Nearer than this the base is brought up by speeds of its own, metres; and how exactly.
_NEAR, _EXACT, _ALIGNED = 1.3, 0.03, 0.08
_BESIDE = 0.9  # cosine of the angle by which the side it comes from may be another one
_STRAIGHT, _TURN, _GAIN = 0.25, 0.7, 1.5
# Ground that is left between the base and what was seen ahead of it, metres.
_ROOM_AHEAD = 0.06
_SETTLES = 12.0  # seconds for coming as near as it can
_BACK = 0.35  # metres that the base goes back from what is high


def come(job: ArmJob, observation: Mapping[str, Any], angles: Array) -> Action:
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
    job.enter(Stage.RAISE if job.work is Work.PLACE and job.held is not None else Stage.ALIGN)
    return job.hold()


def raise_held(job: ArmJob, observation: Mapping[str, Any], angles: Array) -> Action:
    """Lift what is held above what it is put on, before it is in the way of coming near."""
    assert job.held is not None
    if job.way is None:
        spot = Stance.of(observation).inside(job.target)
        job.way, job.point = raise_way(job.body, job.servos[:7], job.held, float(spot[2])), 0
    if job.way is None or job.follow(angles):
        job.enter(Stage.ALIGN)
    return job.hold()


def align(job: ArmJob, observation: Mapping[str, Any], angles: Array) -> Action:
    """Turn to the target and stand so far off it that the arm reaches it, as near as the ground is free."""
    stance = Stance.of(observation)
    target = stance.inside(job.aim(stance))
    error = math.atan2(float(target[1]), float(target[0]))
    missing = float(np.hypot(*target[:2])) - STANDOFFS[job.tries % len(STANDOFFS)]
    moves = float(np.abs(observation["sensors"]["base_velocity"]).max()) > 0.02
    # The square bumper's corners touch before the round base does.
    job.stuck = 0.0 if moves or abs(error) > _ALIGNED else job.stuck + job.period
    if missing > _EXACT and (
        job.stuck > STUCK or room_ahead(job.body, look(observation, step=3).without(job.entity)) < _ROOM_AHEAD
    ):
        missing = 0.0  # as near as the ground is free
    forward = turn = 0.0
    if abs(error) > _ALIGNED:
        turn = min(max(_GAIN * error, -_TURN), _TURN)
    elif abs(missing) > _EXACT:
        forward, turn = min(max(missing, -_STRAIGHT), _STRAIGHT), error
    if job.timer > _SETTLES or (forward == turn == 0.0 and not moves):
        job.enter(Stage.LOOK)  # as near as it comes, and turned as far
        return job.hold()
    return job.hold(forward, turn)


def back(job: ArmJob, observation: Mapping[str, Any], angles: Array) -> Action:
    """Go back the way it came from a table, or a deck, before the arm comes down."""
    gone = float(np.hypot(*(Stance.of(observation).position[:2] - job.start)))
    moves = float(np.abs(observation["sensors"]["base_velocity"]).max()) > 0.02
    job.stuck = 0.0 if moves else job.stuck + job.period
    if gone < _BACK and job.stuck <= STUCK:
        return job.hold(-_STRAIGHT)
    job.enter(Stage.CARRY)
    return job.hold()
