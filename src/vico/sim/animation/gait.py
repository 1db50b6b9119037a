"""Walking and running, driven from the feet. Compiled.

Timing of the gait cycle (62 % stance when walking, heel rise from 35 %, toe-off near 60 %) after Perry and Burnfield,
*Gait Analysis*.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from vico.io.compiled import compiled
from vico.sim.animation.limbs import (
    AHEAD,
    ANKLE,
    FOOT,
    HERE,
    LEVEL,
    NEXT,
    OVER,
    PELVIS,
    SIGN,
    TILT,
    Array,
    X,
    Y,
    Z,
    bend_trunk,
    compose,
    grip,
    hang_arm,
    hermite,
    highest_pelvis,
    place_foot,
    rotation_about,
    smoothstep,
    sole_depth,
    sole_roll,
)

_TAU = 2 * np.pi
_DOWN_EARLIER = 1.4  # how much sooner than the foot the body comes down
_UNEVEN = 0.06  # metres between the feet that legs take up without the body riding lower


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
    out
        How far the toes are turned out, radians.
    """

    stride: float
    duty: float
    strike: float
    push: float
    lift: float
    ahead_share: float
    out: float


class FootPose(NamedTuple):
    """The ankle before the hips, outward and above the floor, metres; the foot's pitch and its toes' bend, radians."""

    x: float
    y: float
    z: float
    pitch: float
    toes: float


# Of the cycle that a foot is on the ground, walking and running, and of that the share that lies before the hips.
WALK_DUTY, RUN_DUTY = 0.62, 0.36
_WALK_AHEAD, _RUN_AHEAD = 0.47, 0.42
#: Place in the cycle at which the left foot stands below the hips: where a walk or run starts from standing.
WALK_START, RUN_START = WALK_DUTY * _WALK_AHEAD, RUN_DUTY * _RUN_AHEAD


@compiled
def _foot_on_ground(body: Any, side: int, flat: float, pitch: float, gait: Any) -> Any:
    """Return a foot that rolls over the ground where it stands flat with its ankle at x = `flat`."""
    return _roll_foot(body, side, flat, pitch, gait.out, body.ground[side, HERE])


@compiled
def _roll_foot(body: Any, side: int, flat: float, pitch: float, out: float, ground: Array) -> Any:
    x, z = sole_roll(body.style, side, pitch), sole_depth(body.style, side, pitch)
    ball = body.joints[FOOT[side], X] - body.joints[ANKLE[side], X]
    borne = max(body.style.toe_length - ground[OVER], 0.0)
    if pitch > 0.0 and borne < ball:
        # Beyond an edge there is nothing to roll over: the foot turns about the edge, its ball comes down beside it.
        flat_depth = sole_depth(body.style, side, 0.0)
        x = borne * (1 - np.cos(pitch)) + flat_depth * np.sin(pitch)
        z = flat_depth * np.cos(pitch) + borne * np.sin(pitch)
    level, tilt = ground[LEVEL], ground[TILT]
    c, s = np.cos(tilt), np.sin(tilt)
    ahead = c * x + s * z
    return FootPose(
        flat + ground[AHEAD] + np.cos(out) * ahead,
        np.sin(out) * ahead,
        level - s * x + c * z,
        pitch + tilt,
        max(pitch, 0.0),
    )


@compiled
def foothold(p: float, gait: Any) -> tuple[float, float]:
    """Return how far before the hips a foot stands or stood last, and where it comes down next, metres."""
    here = gait.stride * (gait.duty * gait.ahead_share - p)
    return here, here if p < gait.duty else here + gait.stride


@compiled
def gait_of_walk(stride: float, style: Any) -> Any:
    """Return the gait of somebody who walks with such strides."""
    tall = style.height
    vigour = min(stride / (0.73 * tall), 1.5)
    strike, push = 0.34 * min(vigour, 1.15), 0.72 * min(vigour, 1.2)
    return Gait(stride, WALK_DUTY, strike, push, 0.035 * tall * vigour, _WALK_AHEAD, style.toe_out)


@compiled
def gait_of_run(stride: float, style: Any) -> Any:
    """Return the gait of somebody who runs with such strides."""
    return Gait(stride, RUN_DUTY, 0.12, 0.95, 0.155 * style.height, _RUN_AHEAD, 0.5 * style.toe_out)


@compiled
def foot_of_gait(body: Any, side: int, p: float, gait: Any) -> Any:
    """Return one foot of a gait at its own phase (0 = it touches down), a `FootPose`."""
    duty = gait.duty
    if p >= duty:
        return _swing(body, side, (p - duty) / (1 - duty), gait)
    flat, _ = foothold(p, gait)
    flat_from, rise_from = 0.16 * duty, 0.52 * duty
    pitch = 0.0
    if p < flat_from:
        pitch = -gait.strike * (1 - smoothstep(p / flat_from))
    elif p > rise_from:
        t = (p - rise_from) / (duty - rise_from)
        pitch = gait.push * t * t
    return _foot_on_ground(body, side, flat, pitch, gait)


@compiled
def _swing(body: Any, side: int, t: float, gait: Any) -> Any:
    """Return a foot on its way from where its toes left the ground to where its heel comes down, t = 0..1."""
    joints, style, push, ground = body.joints, body.style, gait.push, body.ground[side]
    first, _ = foothold(0.0, gait)
    last, _ = foothold(gait.duty, gait)
    off = _roll_foot(body, side, last, push, gait.out, ground[HERE])
    down = _roll_foot(body, side, first, -gait.strike, gait.out, ground[NEXT])
    # The body goes on over a foot that has not left yet or has come down: over the ground both ends are at rest.
    slope = -gait.stride * (1 - gait.duty)
    # Up a kerb the foot rises first and goes ahead then; down it goes ahead first.
    step = ground[NEXT, LEVEL] - ground[HERE, LEVEL]
    kerb = min(abs(step) / 0.1, 1.0)
    later = (0.24 if step > 0 else -0.2) * kerb * np.sin(np.pi * t) ** 2
    x = off.x + slope * t + (down.x - slope - off.x) * smoothstep(t - later)
    y = off.y + (down.y - off.y) * smoothstep(t)
    pitch = hermite(off.pitch, down.pitch, 1.6 * push, 0.0, t)
    toes = push * (1 - smoothstep(2.2 * t))
    rise = np.sin(np.pi * t)
    early = smoothstep((1 + 2.8 * kerb) * t if step > 0 else (1 + 2.2 * kerb) * t - 2.2 * kerb)
    z = off.z + (down.z - off.z) * early + gait.lift * rise * (0.25 + 0.75 * rise) + 0.3 * abs(step) * rise * rise
    # Neither toes nor heel touch the ground while the foot swings.
    floor = ground[HERE, LEVEL] + step * early
    tilt = ground[HERE, TILT] + (ground[NEXT, TILT] - ground[HERE, TILT]) * t
    level = pitch - tilt
    ahead = joints[FOOT[side], X] - joints[ANKLE[side], X]
    reach = np.sin(max(level - toes, 0.0)) * (style.toe_length - ahead)
    clear = 0.015 * smoothstep(10 * t) * smoothstep(8 * (1 - t))
    lowest = floor + np.cos(tilt) * (sole_depth(style, side, level) + reach) + clear
    return FootPose(x, y, max(z, lowest), pitch, toes)


@compiled
def ground_between(body: Any, p: float, gait: Any) -> float:
    """Return the height that the body rides over: between the feet, and smooth where the ground is not.

    Where one foot is much higher than the other, as on stairs, the body waits with the lower one. It comes down early,
    on the leg that bears it: else it would drop when the other one reaches the ground.
    """
    total, level = 0.0, np.empty(2)
    for side in range(2):
        t = (((p + 0.5 * side) % 1.0) - gait.duty) / (1 - gait.duty)
        here, after = body.ground[side, HERE, LEVEL], body.ground[side, NEXT, LEVEL]
        level[side] = here + (after - here) * smoothstep(t if after > here else _DOWN_EARLIER * t)
        total += level[side]
    return 0.5 * total - 0.5 * max(abs(level[0] - level[1]) - _UNEVEN, 0.0)


@compiled
def walk(body: Any, p: float, stride: float, carrying: tuple[bool, bool]) -> None:
    """Walk: the pelvis rides as high as the stiffer leg allows, arms swing against the legs unless they carry."""
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
    gait = gait_of_walk(stride, style)
    for side in range(2):
        own = (p + 0.5 * side) % 1.0
        foot = foot_of_gait(body, side, own, gait)
        ankles[side, X], ankles[side, Z] = joints[ANKLE[side], X] + foot.x, foot.z
        ankles[side, Y] = joints[ANKLE[side], Y] * style.foot_spread + SIGN[side] * foot.y
        pitch[side], toes[side] = foot.pitch, foot.toes
    # The pelvis rides on the stiffer leg; a soft minimum keeps the path round.
    high = np.empty(2)
    for side in range(2):
        high[side] = highest_pelvis(body, side, ankles[side], 0.992)
    low, top = min(high[0], high[1]), ground_between(body, p, gait) - (0.005 + 0.011 * vigour * vigour) * tall
    gap = abs(high[0] - high[1])
    low -= 0.006 * np.exp(-gap / 0.012)
    shift[Z] = min(low, top) if low < top - 0.004 else top - 0.004 * np.exp(-(low - top + 0.004) / 0.004)
    for side in range(2):
        place_foot(body, side, ankles[side], pitch[side], style.toe_out, toes[side])
    # Who carries on one side leans to the other.
    aside = 0.05 * (int(carrying[0]) - int(carrying[1]))
    bend_trunk(local, style.trunk_lean + 0.02 * vigour * double, aside, 1.7 * turned, 0.0, 0.5 * style.age_share)
    swing = style.arm_swing * vigour
    for side in range(2):
        beat = np.cos(_TAU * (p + 0.5 * side) + 0.25)
        forward = -swing * beat - 0.06
        bend = style.elbow_bend + max(forward, 0.0) * 0.9
        if carrying[0] and carrying[1]:
            hang_arm(local, side, style.arm_abduction + 0.05, 0.35 * forward + 0.12, style.elbow_bend + 0.5, 0.1)
            grip(body, side, 0.9)
        elif carrying[side]:
            # A weight pulls the arm straight, and keeps it from swinging.
            hang_arm(local, side, style.arm_abduction + 0.04, 0.25 * forward, 0.5 * style.elbow_bend, 0.1)
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
    duty = RUN_DUTY
    gait = gait_of_run(stride, style)
    # Lowest in mid-stance, highest in mid-flight.
    shift[Z] = ground_between(body, p, gait) - 0.035 * tall - 0.022 * tall * np.cos(2 * _TAU * (p - 0.5 * duty))
    for side in range(2):
        own = (p + 0.5 * side) % 1.0
        foot = foot_of_gait(body, side, own, gait)
        swing = min(max((own - duty) / (1 - duty), 0.0), 1.0)
        # The heel whips up behind in early swing.
        kick = np.sin(np.pi * min(swing * 1.5, 1.0))
        ankles[side, X] = joints[ANKLE[side], X] + foot.x - 0.05 * tall * kick
        ankles[side, Z] = foot.z + 0.05 * tall * kick
        ankles[side, Y] = joints[ANKLE[side], Y] * 0.6 + SIGN[side] * foot.y
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
