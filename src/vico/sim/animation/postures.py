"""Standing, sitting, lying and riding, what is done meanwhile, and arms that hold something beside. Compiled."""

from __future__ import annotations

from enum import IntEnum
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
    SHOULDER,
    SIGN,
    SPINE3,
    TILT,
    WRIST,
    X,
    Y,
    Z,
    bend_trunk,
    compose,
    grip,
    hang_arm,
    joint_in_body,
    part_way,
    place_foot,
    reach,
    reach_by,
    rotation_about,
    smoothstep,
    sole_depth,
    stand_on_feet,
)
from vico.sim.animation.motions import (
    DRINK,
    EAT,
    IDLE,
    OPEN_DOOR,
    PHONE,
    PICK,
    PUT,
    REACH,
    SIT_EAT,
    SIT_TALK,
    SIT_WAVE,
    STAND,
    TALK,
    TURN,
    WAVE,
)

_TAU = 2 * np.pi
#: Angle that a cycle of `turn`, two steps, turns the body by, radians; the cycle runs backward to the right.
TURN_CYCLE = np.radians(120.0)
#: Place in it at which both feet point ahead.
TURN_START = 0.25


@compiled
def stand(body: Any, p: float, clip: int) -> None:
    """Stand on both feet, and make the gesture of a motion."""
    _stand_upright(body, p, clip)
    if clip == TALK:
        _talk(body, p, 0.0)
    elif clip == WAVE:
        _wave(body, p, 0.0)
    elif clip in (PICK, PUT, REACH):
        _reach_out(body, p, clip)
    elif clip in (DRINK, EAT):
        _consume(body, p, clip, 0.0)
    elif clip == OPEN_DOOR:
        _open_door(body, p)
    elif clip == PHONE:
        _look_at_phone(body, p)
    elif clip == STAND:
        _hold_on(body)


@compiled
def gesture_seated(body: Any, p: float, clip: int) -> None:
    """Make a gesture on a chair, as it is made standing."""
    low = body.shift[Z]
    if clip == SIT_TALK:
        _talk(body, p, low + 0.06 * body.style.height)  # above the thighs
    elif clip == SIT_WAVE:
        _wave(body, p, low)
    else:
        _consume(body, p, EAT if clip == SIT_EAT else DRINK, low)


@compiled
def _hold_on(body: Any) -> None:
    """Hold on to a rail overhead, as those do who find no seat."""
    tall = body.style.height
    reach(body, RIGHT, np.array([0.10 * tall, -0.12 * tall, 1.02 * tall]), np.array([0.2, -1.0, -0.3]))
    grip(body, RIGHT, 1.0)


@compiled
def _open_door(body: Any, p: float) -> None:
    """Lay a hand on a door and push it open; from half the cycle on one is through, and the hand lets go behind."""
    tall, hand = body.style.height, body.hand
    sign, out = SIGN[hand], np.zeros(3)
    pushed, behind = smoothstep(5.0 * (p - 0.28)), smoothstep(6.0 * (p - 0.5))
    share = smoothstep(4.5 * p) * smoothstep(4.0 * (0.95 - p))
    out[X] = ((0.235 + 0.045 * pushed) * (1.0 - behind) - 0.10 * behind) * tall
    out[Y], out[Z] = sign * (0.07 + 0.19 * behind) * tall, 0.59 * tall
    reach_by(body, hand, out, np.array([-0.6, sign * 0.4, 0.2 * behind - 0.7 * (1.0 - behind)]), share)
    grip(body, hand, 0.35 + 0.4 * share)


@compiled
def _phone_height(p: float) -> float:
    """Return how far a phone is raised, 0..1: it comes up in the first of the cycle and goes down in the last."""
    return smoothstep(12.0 * p) * smoothstep(12.0 * (1.0 - p))


@compiled
def _look_at_phone(body: Any, p: float) -> None:
    """Hold a phone before the chest, the thumb on it."""
    tall, hand, up = body.style.height, body.hand, _phone_height(p)
    sign, out = SIGN[hand], np.zeros(3)
    out[X], out[Y], out[Z] = 0.17 * tall, sign * 0.045 * tall, 0.68 * tall
    reach_by(body, hand, out, np.array([-0.4, sign * 0.5, -0.9]), up)
    body.local[WRIST[hand]] = rotation_about(Y, -0.25 * up)
    grip(body, hand, 0.38 + 0.3 * up)


@compiled
def _strength(p: float) -> float:
    """Return how far a gesture has gone, 0..1: most at half the cycle."""
    return np.sin(np.pi * p) ** 2


@compiled
def _stand_upright(body: Any, p: float, clip: int) -> None:
    """Bear the weight on the feet, breathe, lean and look as the motion asks for; let the arms hang."""
    local, shift, style = body.local, body.shift, body.style
    breath = np.sin(_TAU * p)
    side_lean = (style.asymmetry - 0.5) * 2
    strength = _strength(p)
    lifts, pivots = np.zeros(2), np.zeros(2)
    lean, yaw, nod, crouch = 0.35 * style.trunk_lean, 0.0, 0.0, 0.0
    shift[Y] = 0.02 * side_lean
    roll = np.radians(2.0) * side_lean
    if clip in (PICK, PUT):
        lean, crouch = lean + 0.75 * strength, 0.16 * style.height * strength
        nod = 0.25 * strength
    elif clip == REACH:
        lean = lean + 0.18 * strength
    elif clip == TALK:
        yaw, nod = 0.06 * np.sin(_TAU * p + style.asymmetry), 0.06 * np.sin(2 * _TAU * p)
    elif clip in (EAT, DRINK):
        nod = (0.10 if clip == EAT else -0.22) * strength
    elif clip == OPEN_DOOR:
        through = smoothstep(6.0 * (p - 0.5)) * smoothstep(4.0 * (0.95 - p))
        yaw = 0.22 * SIGN[body.hand] * through
        lean = lean + 0.06 * smoothstep(5.0 * (p - 0.28)) * (1.0 - smoothstep(6.0 * (p - 0.5)))
    elif clip == TURN:
        for side in range(2):
            lifts[side], pivots[side] = _pivot((p + 0.5 * side) % 1.0)
        shift[Y] = 0.025 * np.sin(_TAU * p)
    elif clip in (IDLE, STAND, PHONE):
        weight, yaw, glance = restlessness(body.second, style.asymmetry, style.rhythm)
        if clip == PHONE:
            up = _phone_height(p)
            yaw, glance = yaw * (1.0 - up), glance * (1.0 - up) + 0.5 * up
        shift[Y], roll = shift[Y] + 0.028 * weight, roll + np.radians(2.5) * weight
        nod = glance
    local[PELVIS] = compose(rotation_about(X, -roll), rotation_about(Y, 0.35 * (lean - 0.35 * style.trunk_lean)))
    shift[Z] = -0.004 - crouch
    shift[X] = -0.45 * crouch
    stand_on_feet(body, lifts, pivots)
    bend_trunk(local, lean + 0.008 * breath, 1.3 * roll, yaw, nod, 0.6 * style.age_share - 0.006 * breath)
    for side in range(2):
        swing = 0.04 + 0.02 * SIGN[side] * side_lean
        hang_arm(local, side, style.arm_abduction + 0.01 * breath, swing, style.elbow_bend, 0.2)


@compiled
def _pivot(p: float) -> tuple[float, float]:
    """Return lift and turn of a foot while the body turns on the spot: it stays for half a cycle, then steps after."""
    quarter = 0.25 * TURN_CYCLE
    if p < 0.5:
        return 0.0, quarter * (1 - 4 * p)
    t = 2 * p - 1
    return 0.045 * np.sin(np.pi * t) ** 2, quarter * (2 * smoothstep(t) - 1)


@compiled
def _whim(second: float, every: float, stream: float, rhythm: float) -> float:
    """Return a number in -1..1 that rests, and is another one about every so many seconds."""
    at = second / every + 17.0 * rhythm
    k = np.floor(at)
    numbers = np.empty(2)
    for j in range(2):
        wild = np.sin((k - 1 + j) * 12.9898 + stream * 78.233 + rhythm * 37.719) * 43758.5453
        numbers[j] = 2 * (wild - np.floor(wild)) - 1
    # The change takes a second and a half.
    return numbers[0] + (numbers[1] - numbers[0]) * smoothstep((at - k) * every / 1.5)


@compiled
def restlessness(second: float, asymmetry: float, rhythm: float) -> Any:
    """Return where the weight is (-1 right, 1 left), where the head turns and how it nods, of who stands and waits."""
    weight = _whim(second, 6.0 + 5.0 * asymmetry, 1.0, rhythm)
    look = _whim(second, 4.0 + 3.0 * rhythm, 2.0, rhythm)
    # Mostly people look ahead.
    away = 0.9 * (look - 0.35 * min(max(look / 0.35, -1.0), 1.0))
    return weight, away, 0.12 * _whim(second, 5.5, 3.0, rhythm) ** 2


@compiled
def _outward(side: int) -> Any:
    """Return where an elbow points that hangs at ease."""
    return np.array([-0.3, SIGN[side] * 0.7, -0.6])


@compiled
def _talk(body: Any, p: float, low: float) -> None:
    """Beat with one hand, lively people with both."""
    tall, asymmetry, hand = body.style.height, body.style.asymmetry, body.hand
    sign, out = SIGN[hand], np.zeros(3)
    beat, slow = np.sin(2 * _TAU * p + 3 * asymmetry), np.sin(_TAU * p)
    out[X], out[Y], out[Z] = 0.22 * tall, sign * (0.14 + 0.03 * slow) * tall, (0.62 + 0.035 * beat) * tall + low
    reach(body, hand, out, _outward(hand))
    if asymmetry > 0.4:
        out[X], out[Y], out[Z] = 0.20 * tall, -sign * 0.13 * tall, (0.60 - 0.03 * beat) * tall + low
        reach(body, 1 - hand, out, _outward(1 - hand))
    body.local[WRIST[hand]] = rotation_about(Y, -0.5)


@compiled
def _wave(body: Any, p: float, low: float) -> None:
    """Raise a hand and sweep it thrice."""
    tall, hand = body.style.height, body.hand
    sign, out = SIGN[hand], np.zeros(3)
    up = smoothstep(3.5 * p) * smoothstep(3.5 * (1 - p))
    sweep = np.sin(3 * _TAU * p)
    out[X], out[Y], out[Z] = 0.10 * tall, sign * (0.20 + 0.045 * sweep) * tall, 0.98 * tall + low
    reach_by(body, hand, out, np.array([0.0, sign, -0.4]), up)
    body.local[WRIST[hand]] = rotation_about(X, -sign * 0.35 * sweep * up)
    grip(body, hand, 0.35 * (1 - up))


@compiled
def _reach_out(body: Any, p: float, clip: int) -> None:
    """Reach for something before the body, or on the ground; a hand opens to put and closes to pick."""
    tall, strength, hand = body.style.height, _strength(p), body.hand
    out = np.zeros(3)
    level = 0.12 if clip != REACH else 0.66
    ahead = 0.24 if clip != REACH else 0.33
    out[X], out[Y], out[Z] = ahead * tall, SIGN[hand] * 0.06 * tall, level * tall
    reach_by(body, hand, out, _outward(hand), strength)
    grip(body, hand, 0.35 + 0.55 * (strength if clip == PUT else 1 - strength))


@compiled
def _consume(body: Any, p: float, clip: int, low: float) -> None:
    """Bring a hand to the mouth and back."""
    tall, strength, hand = body.style.height, _strength(p), body.hand
    sign, out = SIGN[hand], np.zeros(3)
    out[X], out[Y], out[Z] = 0.14 * tall, sign * 0.14 * tall, 0.62 * tall + low
    reach(body, hand, out, _outward(hand))
    out[X], out[Y], out[Z] = 0.125 * tall, sign * 0.035 * tall, (0.845 if clip == EAT else 0.825) * tall + low
    reach_by(body, hand, out, np.array([0.2, sign * 0.6, -1.0]), strength)
    body.local[WRIST[hand]] = rotation_about(Y, -0.5 * strength)
    grip(body, hand, 0.85)


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


class Hold(IntEnum):
    """How something is held."""

    NOTHING = 0
    UMBRELLA_LEFT = 1
    UMBRELLA_RIGHT = 2
    BEFORE_CHEST = 3
    PLACARD_RIGHT = 4


_UMBRELLA_LEFT, _UMBRELLA_RIGHT = int(Hold.UMBRELLA_LEFT), int(Hold.UMBRELLA_RIGHT)
_PLACARD_RIGHT = int(Hold.PLACARD_RIGHT)


@compiled
def hold_up(body: Any, hold: int, share: float, width: float) -> None:
    """Bring the arms from what the motion has them do a share of the way to where they hold something.

    `width` is that of what is held before the chest, metres.
    """
    part = smoothstep(share)
    if hold == _UMBRELLA_LEFT:
        _hold_umbrella(body, LEFT, part)
    elif hold in (_UMBRELLA_RIGHT, _PLACARD_RIGHT):
        _hold_umbrella(body, RIGHT, part)
    else:
        _hold_before_chest(body, part, width)


@compiled
def _hold_umbrella(body: Any, side: int, part: float) -> None:
    """Bend an elbow, the fist before the shoulder."""
    tall, sign = body.style.height, SIGN[side]
    shoulder, _ = joint_in_body(body, SHOULDER[side])
    goal = shoulder.copy()
    goal[X] += 0.135 * tall
    goal[Y] -= sign * 0.02 * tall
    goal[Z] -= 0.12 * tall
    wrist = body.local[WRIST[side]].copy()
    reach_by(body, side, goal, np.array([-0.5, sign * 0.5, -1.0]), part)
    body.local[WRIST[side]] = part_way(wrist, rotation_about(X, 0.0), part)
    grip(body, side, 0.38 + 0.62 * part)


@compiled
def _hold_before_chest(body: Any, part: float, width: float) -> None:
    """Bring both hands to the sides of a box, its middle before the belly."""
    tall = body.style.height
    apart = min(max(0.5 * width, 0.06 * tall), 0.16 * tall)
    for side in range(2):
        sign = SIGN[side]
        shoulder, _ = joint_in_body(body, SHOULDER[side])
        goal = np.array([shoulder[X] + 0.17 * tall, sign * apart, shoulder[Z] - 0.21 * tall])
        wrist = body.local[WRIST[side]].copy()
        reach_by(body, side, goal, np.array([-0.6, sign * 1.0, -0.8]), part)
        body.local[WRIST[side]] = part_way(wrist, rotation_about(Z, -sign * 0.35), part)
        grip(body, side, 0.3)
