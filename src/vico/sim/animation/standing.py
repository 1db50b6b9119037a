"""Standing still, and everything that is done standing. Compiled."""

from __future__ import annotations

from typing import Any

import numpy as np

from vico.io.compiled import compiled
from vico.sim.animation.limbs import (
    PELVIS,
    RIGHT,
    SIGN,
    WRIST,
    bend_trunk,
    grip,
    hang_arm,
    reach,
    reach_by,
    stand_on_feet,
)
from vico.sim.animation.names import (
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
from vico.sim.animation.rotations import X, Y, Z, compose, rotation_about, smoothstep

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
def _raised(p: float) -> float:
    """Return how far a phone is raised, 0..1: it comes up in the first of the cycle and goes down in the last."""
    return smoothstep(12.0 * p) * smoothstep(12.0 * (1.0 - p))


@compiled
def _look_at_phone(body: Any, p: float) -> None:
    """Hold a phone before the chest, the thumb on it."""
    tall, hand, up = body.style.height, body.hand, _raised(p)
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
            up = _raised(p)
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
