"""Sitting, lying, riding and getting on. Compiled."""

from __future__ import annotations

from typing import Any

import numpy as np

from vico.io.compiled import compiled
from vico.sim.animation.limbs import (
    ANKLE,
    FOOT,
    HEAD,
    HERE,
    HIP,
    KNEE,
    LEFT,
    LEVEL,
    PELVIS,
    RIGHT,
    SIGN,
    SPINE3,
    TILT,
    WRIST,
    bend_trunk,
    grip,
    hang_arm,
    place_foot,
    reach,
    reach_by,
    sole_depth,
    stand_on_feet,
)
from vico.sim.animation.rotations import X, Y, Z, compose, rotation_about

_TAU = 2 * np.pi


@compiled
def seat_height(tall: float) -> float:
    """Return how high the seat is that somebody sits on, above the body's origin, metres: lower for the small."""
    return min(0.45, 0.27 * tall)


@compiled
def seated_foot(style: Any, side: int) -> tuple[float, float]:
    """Return where the ankle of somebody is who sits: its x and y, metres."""
    joints = style.joints
    thigh = joints[HIP[side], Z] - joints[KNEE[side], Z]
    return 0.98 * thigh + 0.03, joints[ANKLE[side], Y] * 1.25


@compiled
def sit(body: Any, p: float) -> None:
    """Sit on a seat of ordinary height behind the feet, hands on the thighs."""
    local, shift, joints, style = body.local, body.shift, body.joints, body.style
    tall = style.height
    breath = np.sin(_TAU * p)
    # Hip joints sit a hand above the seat.
    seat = seat_height(tall) + 0.052 * tall
    shift[Z] = seat - joints[HIP[LEFT], Z]
    local[PELVIS] = rotation_about(Y, -0.12)
    for side in range(2):
        x, y = seated_foot(style, side)
        level, tilt = body.ground[side, HERE, LEVEL], body.ground[side, HERE, TILT]
        ankle = np.array([x, y, level + sole_depth(style, side, 0.0)])
        place_foot(body, side, ankle, tilt, 1.5 * style.toe_out, 0.0)
    bend_trunk(local, 0.10 + 0.008 * breath, 0.0, 0.0, 0.04, 0.6 * style.age_share)
    for side in range(2):
        sign = SIGN[side]
        goal = np.array([0.17 * tall, sign * 0.075 * tall, seat + 0.055 * tall])
        reach(body, side, goal, np.array([-0.5, sign * 1.0, -0.3]))
        local[WRIST[side]] = rotation_about(X, -sign * 0.1)


@compiled
def sleep(body: Any, p: float) -> None:
    """Lie on the back, head towards -x; the ground is the bed's top."""
    local, shift, joints, style = body.local, body.shift, body.joints, body.style
    tall = style.height
    breath = np.sin(_TAU * p)
    local[PELVIS] = rotation_about(Y, -0.5 * np.pi)
    shift[X] = 0.02 * tall
    shift[Z] = 0.098 * tall - joints[PELVIS, Z]
    for side in range(2):
        sign = SIGN[side]
        local[HIP[side]] = compose(rotation_about(Y, -0.06), rotation_about(X, sign * 0.08))
        local[KNEE[side]] = rotation_about(Y, 0.10)
        local[ANKLE[side]] = rotation_about(Y, 0.45)
    local[SPINE3] = rotation_about(Y, 0.02 * breath)
    local[HEAD] = compose(rotation_about(Y, 0.12), rotation_about(Z, 0.5 * (style.asymmetry - 0.5)))
    for side in range(2):
        hang_arm(local, side, 0.22, 0.05, 0.25, 0.3)
    hang_arm(local, RIGHT, 0.18, 0.05, 0.3, 0.3)


@compiled
def ride_bike(body: Any, p: float) -> None:
    """Ride a bicycle that stands at the origin: feet on the pedals, hands on the bar."""
    local, shift, joints, style = body.local, body.shift, body.joints, body.style
    leg = joints[HIP[LEFT], Z] - joints[ANKLE[LEFT], Z]
    # The bicycle of `assets.vehicles`: cranks, saddle and bar where that model has them.
    crank, middle, bracket = 0.15, -0.08, 0.29
    # Who is too short for the saddle sits in front of it, lower.
    saddle = min(1.03, bracket - crank + 0.95 * leg + joints[ANKLE[LEFT], Z])
    shift[X] = -0.25 - joints[HIP[LEFT], X]
    shift[Z] = saddle - joints[HIP[LEFT], Z]
    local[PELVIS] = rotation_about(Y, 0.22)
    for side in range(2):
        angle = _TAU * (p + 0.5 * side)
        ball = joints[FOOT[side], X] - joints[ANKLE[side], X]
        pitch = 0.25 + 0.15 * np.sin(angle)
        # The ball of the foot is on the pedal, so the ankle is behind and above.
        x = middle + crank * np.cos(angle) - ball * np.cos(pitch)
        z = bracket - crank * np.sin(angle) + 0.02 + joints[ANKLE[side], Z] + ball * np.sin(pitch)
        sign = SIGN[side]
        place_foot(body, side, np.array([x, sign * 0.10, z]), pitch, 0.0, 0.5 * pitch)
    bend_trunk(local, 0.34, 0.0, 0.02 * np.sin(_TAU * p), -0.1, 0.3 * style.age_share)
    for side in range(2):
        sign = SIGN[side]
        goal = np.array([0.20, sign * 0.25, 1.08])
        reach(body, side, goal, np.array([-0.3, sign * 0.7, -0.8]))
        grip(body, side, 1.0)


@compiled
def step_up(body: Any, p: float) -> None:
    """Take one step of ordinary height, a hand on the rail; getting off runs the same way."""
    local, shift, style = body.local, body.shift, body.style
    tall = style.height
    strength = np.sin(np.pi * p) ** 2
    lifts = np.array([0.0, 0.20 * strength])
    local[PELVIS] = rotation_about(Y, 0.08)
    shift[Y] = 0.03 * strength
    shift[Z] = -0.004
    stand_on_feet(body, lifts, np.zeros(2))
    bend_trunk(local, 0.15 * strength + style.trunk_lean, 0.0, 0.0, 0.05, 0.5 * style.age_share)
    for side in range(2):
        hang_arm(local, side, style.arm_abduction, 0.1, style.elbow_bend, 0.2)
    goal = np.array([0.26 * tall, -0.16 * tall, 0.66 * tall])
    reach_by(body, RIGHT, goal, np.array([-0.3, -0.7, -0.6]), strength)
    grip(body, RIGHT, 0.4 + 0.5 * strength)
