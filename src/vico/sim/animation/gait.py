"""Walking and running, driven from the feet. Compiled.

Timing of the gait cycle (62 % stance when walking, heel rise from 35 %, toe-off near 60 %) after Perry and Burnfield,
*Gait Analysis*.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from vico.io.compiled import compiled
from vico.sim.animation.limbs import (
    ANKLE,
    FOOT,
    PELVIS,
    bend_trunk,
    grip,
    hang_arm,
    highest_pelvis,
    place_foot,
)
from vico.sim.animation.rotations import X, Y, Z, compose, hermite, rotation_about, smoothstep

_TAU = 2 * np.pi


class Gait(NamedTuple):
    """What tells one gait from another.

    Attributes
    ----------
    stride
        Metres a cycle covers.
    duty
        Share of the cycle that a foot is on the ground.
    strike, push
        Pitch of the foot when the heel touches down (toes up) and when the toes leave (toes down), radians.
    lift
        How far a foot is raised in mid-swing, metres.
    ahead_share
        Share of the stance that lies before the hips.
    """

    stride: float
    duty: float
    strike: float
    push: float
    lift: float
    ahead_share: float


class FootPose(NamedTuple):
    """The ankle before the hips and above the floor, metres; the foot's pitch and its toes' bend, radians."""

    x: float
    z: float
    pitch: float
    toes: float


@compiled
def _on_heel(flat: float, pitch: float, behind: float, tall: float) -> tuple[float, float]:
    """Return the ankle's x and z when the foot, flat at x = `flat`, is pitched about its heel."""
    c, s = np.cos(pitch), np.sin(pitch)
    return flat - behind + c * behind + s * tall, -s * behind + c * tall


@compiled
def _on_ball(flat: float, pitch: float, ahead: float, ball: float, tall: float) -> tuple[float, float]:
    """Return the same about the ball of the foot, whose joint is `ahead` of the ankle and `ball` above the floor."""
    c, s = np.cos(pitch), np.sin(pitch)
    return flat + ahead - c * ahead + s * (tall - ball), ball + s * ahead + c * (tall - ball)


@compiled
def foot_of_gait(body: Any, side: int, p: float, gait: Any) -> Any:
    """Return one foot of a gait at its own phase (0 = it touches down), a `FootPose`."""
    joints, style, duty, stride, push = body.joints, body.style, gait.duty, gait.stride, gait.push
    tall, ahead = joints[ANKLE[side], Z], joints[FOOT[side], X] - joints[ANKLE[side], X]
    ball, behind = joints[FOOT[side], Z], style.heel_length
    first = stride * duty * gait.ahead_share
    flat_from, rise_from = 0.16 * duty, 0.52 * duty
    if p < duty:
        flat = first - stride * p
        if p < flat_from:
            pitch = -gait.strike * (1 - smoothstep(p / flat_from))
            x, z = _on_heel(flat, pitch, behind, tall)
            return FootPose(x, z, pitch, 0.0)
        if p < rise_from:
            return FootPose(flat, tall, 0.0, 0.0)
        t = (p - rise_from) / (duty - rise_from)
        pitch = push * t * t
        x, z = _on_ball(flat, pitch, ahead, ball, tall)
        return FootPose(x, z, pitch, pitch)
    t = (p - duty) / (1 - duty)
    x0, z0 = _on_ball(first - stride * duty, push, ahead, ball, tall)
    x1, z1 = _on_heel(first, -gait.strike, behind, tall)
    slope = -stride * (1 - duty)
    x = hermite(x0, x1, 0.35 * slope, slope, t)
    pitch = hermite(push, -gait.strike, 1.6 * push, 0.0, t)
    rise = np.sin(np.pi * t)
    z = z0 + (z1 - z0) * smoothstep(t) + gait.lift * rise * rise
    # Neither toes nor heel touch the floor while the foot swings.
    toes = push * (1 - smoothstep(2.2 * t))
    reach = style.toe_length
    low = min(
        -np.sin(pitch) * ahead
        - np.cos(pitch) * (tall - ball)
        - ball
        - np.sin(max(pitch - toes, 0.0)) * (reach - ahead),
        np.sin(pitch) * behind - np.cos(pitch) * tall,
    )
    return FootPose(x, max(z, -low + 0.012 * rise), pitch, toes)


@compiled
def walk(body: Any, p: float, stride: float, carrying: bool) -> None:
    """Walk: the pelvis rides as high as the stiffer leg allows, arms swing against the legs or carry something."""
    local, shift, joints, style = body.local, body.shift, body.joints, body.style
    tall = style.height
    # Longer strides swing, bob and turn more; 1 at an ordinary walk.
    vigour = min(stride / (0.73 * tall), 1.5)
    wave, double = np.sin(_TAU * p), np.cos(2 * _TAU * p)
    turned = style.hip_turn * vigour * np.cos(_TAU * p)
    # At left heel strike the left hip is ahead: the pelvis is turned right.
    local[PELVIS] = compose(
        rotation_about(Z, -turned), rotation_about(X, np.radians(2.2) * vigour * np.sin(_TAU * (p - 0.02)) * -1.0)
    )
    shift[Y] = style.sway * wave
    shift[X] = 0.006 * vigour * np.sin(2 * _TAU * p)
    ankles = np.empty((2, 3))
    pitch, toes = np.empty(2), np.empty(2)
    gait = Gait(stride, 0.62, 0.34 * min(vigour, 1.15), 0.72 * min(vigour, 1.2), 0.035 * tall * vigour, 0.47)
    for side in range(2):
        own = (p + 0.5 * side) % 1.0
        foot = foot_of_gait(body, side, own, gait)
        ankles[side, X], ankles[side, Z] = joints[ANKLE[side], X] + foot.x, foot.z
        ankles[side, Y] = joints[ANKLE[side], Y] * style.foot_spread
        pitch[side], toes[side] = foot.pitch, foot.toes
    # The pelvis rides on the stiffer leg; a soft minimum keeps the path round.
    high = np.empty(2)
    for side in range(2):
        high[side] = highest_pelvis(body, side, ankles[side], 0.992)
    low, top = min(high[0], high[1]), -(0.005 + 0.011 * vigour * vigour) * tall
    gap = abs(high[0] - high[1])
    low -= 0.006 * np.exp(-gap / 0.012)
    shift[Z] = min(low, top) if low < top - 0.004 else top - 0.004 * np.exp(-(low - top + 0.004) / 0.004)
    for side in range(2):
        place_foot(body, side, ankles[side], pitch[side], style.toe_out, toes[side])
    bend_trunk(local, style.trunk_lean + 0.02 * vigour * double, 0.0, 1.7 * turned, 0.0, 0.5 * style.age_share)
    swing = style.arm_swing * vigour
    for side in range(2):
        beat = np.cos(_TAU * (p + 0.5 * side) + 0.25)
        forward = -swing * beat - 0.06
        bend = style.elbow_bend + max(forward, 0.0) * 0.9
        if carrying:
            hang_arm(local, side, style.arm_abduction + 0.05, 0.35 * forward + 0.12, style.elbow_bend + 0.5, 0.1)
            grip(body, side, 0.9)
        else:
            hang_arm(local, side, style.arm_abduction, forward, bend, 0.15)


@compiled
def run(body: Any, p: float, stride: float) -> None:
    """Run: lowest in mid-stance, highest in mid-flight, elbows bent."""
    local, shift, joints, style = body.local, body.shift, body.joints, body.style
    tall = style.height
    turned = 1.4 * style.hip_turn * np.cos(_TAU * p)
    local[PELVIS] = compose(rotation_about(Z, -turned), rotation_about(Y, 0.10))
    shift[Y] = 0.5 * style.sway * np.sin(_TAU * p)
    ankles = np.empty((2, 3))
    pitch, toes = np.empty(2), np.empty(2)
    duty = 0.36
    gait = Gait(stride, duty, 0.12, 0.95, 0.155 * tall, 0.42)
    # Lowest in mid-stance, highest in mid-flight.
    shift[Z] = -0.035 * tall - 0.022 * tall * np.cos(2 * _TAU * (p - 0.5 * duty))
    for side in range(2):
        own = (p + 0.5 * side) % 1.0
        foot = foot_of_gait(body, side, own, gait)
        swing = min(max((own - duty) / (1 - duty), 0.0), 1.0)
        # The heel whips up behind in early swing.
        kick = np.sin(np.pi * min(swing * 1.5, 1.0))
        ankles[side, X] = joints[ANKLE[side], X] + foot.x - 0.05 * tall * kick
        ankles[side, Z] = foot.z + 0.05 * tall * kick
        ankles[side, Y] = joints[ANKLE[side], Y] * 0.6
        pitch[side], toes[side] = foot.pitch + 0.5 * kick, foot.toes
        # A flying leg binds less and less, so that landing does not jolt the pelvis.
        slack = 1.5 * tall * max(min(own - duty, 1 - own), 0.0)
        high = highest_pelvis(body, side, ankles[side], 0.985) + slack
        shift[Z] = min(shift[Z], high)
    for side in range(2):
        place_foot(body, side, ankles[side], pitch[side], 0.5 * style.toe_out, toes[side])
    bend_trunk(local, 0.10, 0.0, 2.4 * turned, -0.04, 0.3 * style.age_share)
    for side in range(2):
        forward = -0.75 * np.cos(_TAU * (p + 0.5 * side) + 0.3)
        hang_arm(local, side, style.arm_abduction + 0.12, forward - 0.15, 1.55 + 0.25 * forward, 0.25)
        grip(body, side, 0.8)
