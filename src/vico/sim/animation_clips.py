"""The motions themselves: what each joint does at each phase. Compiled; called through `vico.sim.animation`.

Signs, in the body's axes (x forward, y left, z up): turning about +y leans forward or points toes down; about +x
lowers the right side; about +z turns left. Arms lie along y in the T-pose, so an arm is lowered about x, swung about
y, and its elbow bends about z.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vico.render.skinning import rotation_matrix
from vico.sim.animation_math import (
    applied,
    axis_angle,
    crossed,
    hermite,
    product,
    smooth,
    turn,
    two_bones,
    undone,
)

# The order is the recording format's: add at the end only.
CLIPS = (
    "idle",
    "walk",
    "run",
    "turn",
    "sit",
    "sleep",
    "talk",
    "wave",
    "pick",
    "put",
    "reach",
    "drink",
    "eat",
    "carry",
    "ride_bike",
    "ride_bus",
    "stand",
    "enter_vehicle",
    "exit_vehicle",
)
MANNER = 16

_IDLE, _WALK, _RUN, _TURN, _SIT, _SLEEP, _TALK, _WAVE, _PICK, _PUT, _REACH, _DRINK, _EAT, _CARRY = range(14)
_BIKE, _BUS, _STAND, _ENTER, _EXIT = range(14, 19)
_TAU = 2 * np.pi


@njit(cache=True)
def animate(
    clip: NDArray[Any],
    phase: NDArray[Any],
    speed: NDArray[Any],
    stride: NDArray[Any],
    style: NDArray[Any],
    rotations: NDArray[Any],
    offsets: NDArray[Any],
) -> None:
    """Write everybody's joint rotations and pelvis shifts."""
    for i in range(len(clip)):
        manner, joints = style[i, :MANNER], style[i, MANNER:].reshape(-1, 3)
        local = np.zeros((len(joints), 3, 3))
        for j in range(len(joints)):
            local[j, 0, 0] = local[j, 1, 1] = local[j, 2, 2] = 1.0
        shift = np.zeros(3)
        number, p = clip[i], phase[i] - np.floor(phase[i])
        for side in range(2):
            _close(local, joints, side, 0.38, 0.2)
        if number in (_WALK, _CARRY):
            _walk(local, shift, joints, manner, p, stride[i], speed[i], number == _CARRY)
        elif number == _RUN:
            _run(local, shift, joints, manner, p, stride[i])
        elif number == _SLEEP:
            _sleep(local, shift, joints, manner, p)
        elif number == _BIKE:
            _bike(local, shift, joints, manner, p)
        elif number in (_SIT, _BUS):
            _sit(local, shift, joints, manner, p)
        elif number in (_ENTER, _EXIT):
            _step_up(local, shift, joints, manner, p)
        else:
            _stand(local, shift, joints, manner, p, number)
        for j in range(len(joints)):
            axis_angle(local[j], rotations[i, j])
        for r in range(3):
            offsets[i, r] = shift[r]


@njit(cache=True)
def _close(local: NDArray[Any], joints: NDArray[Any], side: int, curl: float, thumb: float) -> None:
    """Bring the fingers together and curl each of their joints; radians."""
    sign = -1.0 if side == 0 else 1.0
    base = 25 + 15 * side
    for finger in range(5):
        first = base + 3 * finger
        along = joints[first + 1] - joints[first]
        spread = np.arctan2(along[0], abs(along[1]))
        share, bend = (0.8, curl) if finger < 4 else (0.35, thumb)
        local[first] = product(turn(2, -sign * share * spread), turn(0, sign * 0.8 * bend))
        for k in range(1, 3):
            local[first + k] = turn(0, sign * bend)


@njit(cache=True)
def _grip(local: NDArray[Any], joints: NDArray[Any], side: int, curl: float) -> None:
    """Close a hand around something."""
    _close(local, joints, side, curl, 0.6 * curl)


@njit(cache=True)
def _arm(local: NDArray[Any], side: int, off: float, swing: float, bend: float, twist: float) -> None:
    """Hang an arm: `off` the body sideways, `swing` forward, elbow `bend`, palm `twist`ed backward; radians."""
    sign = 1.0 if side == 0 else -1.0
    lowered = product(turn(0, -sign * (0.5 * np.pi - off)), turn(1, twist))
    local[16 + side] = product(turn(1, -swing), lowered)
    local[18 + side] = turn(2, -sign * bend)


@njit(cache=True)
def _placed(local: NDArray[Any], joints: NDArray[Any], shift: NDArray[Any], joint: int) -> tuple[Any, Any]:
    """Where a joint is and how its parent is turned, by following the chain from the pelvis."""
    chain = np.empty(12, np.int64)
    count, j = 0, joint
    while j > 0:
        chain[count] = j
        count += 1
        j = _parent(j)
    turned = local[0].copy()
    place = joints[0] + shift
    previous = 0
    for k in range(count - 1, -1, -1):
        j = chain[k]
        place = place + applied(turned, joints[j] - joints[previous])
        if k > 0:
            turned = product(turned, local[j])
        previous = j
    return place, turned


@njit(cache=True)
def _parent(j: int) -> int:
    """Parents of the joints between pelvis and wrists, as in `people.PARENTS`."""
    if j == 3:
        return 0
    if j == 13 or j == 14 or j == 12:
        return 9
    if j == 16 or j == 17:
        return j - 3
    if j == 18 or j == 19:
        return j - 2
    if j < 3:
        return 0
    return j - 3


@njit(cache=True)
def _reach(
    local: NDArray[Any], joints: NDArray[Any], shift: NDArray[Any], side: int, goal: NDArray[Any], pole: NDArray[Any]
) -> None:
    """Bring a wrist to a point of the body's frame, the elbow towards `pole`."""
    shoulder, elbow, wrist = 16 + side, 18 + side, 20 + side
    start, parent = _placed(local, joints, shift, shoulder)
    first = np.sqrt(((joints[elbow] - joints[shoulder]) ** 2).sum())
    second = np.sqrt(((joints[wrist] - joints[elbow]) ** 2).sum())
    upper, lower, hinge = two_bones(start, goal, pole, first, second)
    sign = 1.0 if side == 0 else -1.0
    # The left elbow bends about -z, the right one about +z.
    up = hinge * -sign
    arm, forearm = np.empty((3, 3)), np.empty((3, 3))
    arm[:, 1], arm[:, 2] = upper * sign, up
    arm[:, 0] = crossed(arm[:, 1].copy(), up)
    forearm[:, 1], forearm[:, 2] = lower * sign, up
    forearm[:, 0] = crossed(forearm[:, 1].copy(), up)
    local[shoulder] = undone(parent, arm)
    local[elbow] = undone(arm, forearm)
    local[wrist] = turn(0, 0.0)


@njit(cache=True)
def _reach_by(
    local: NDArray[Any],
    joints: NDArray[Any],
    shift: NDArray[Any],
    side: int,
    goal: NDArray[Any],
    pole: NDArray[Any],
    share: float,
) -> None:
    """Go a share of the way from the arm's present pose to reaching a point, joint by joint."""
    shoulder, elbow = local[16 + side].copy(), local[18 + side].copy()
    _reach(local, joints, shift, side, goal, pole)
    local[16 + side] = _towards(shoulder, local[16 + side], share)
    local[18 + side] = _towards(elbow, local[18 + side], share)


@njit(cache=True)
def _towards(a: NDArray[Any], b: NDArray[Any], share: float) -> NDArray[Any]:
    """Rotation a share of the way from one to another."""
    way, step = np.empty(3), np.empty((3, 3))
    axis_angle(undone(a, b), way)
    rotation_matrix(way * share, step)
    return product(a, step)


@njit(cache=True)
def _leg(
    local: NDArray[Any],
    joints: NDArray[Any],
    shift: NDArray[Any],
    side: int,
    ankle: NDArray[Any],
    pitch: float,
    out: float,
    toes: float,
) -> None:
    """Bring an ankle to a point; the foot pitched toes down, turned out, its toes bent up; radians."""
    hip, knee = 1 + side, 4 + side
    sign = 1.0 if side == 0 else -1.0
    start = joints[0] + shift + applied(local[0], joints[hip] - joints[0])
    first = np.sqrt(((joints[knee] - joints[hip]) ** 2).sum())
    second = np.sqrt(((joints[7 + side] - joints[knee]) ** 2).sum())
    pole = np.array([1.0, sign * np.sin(out), 0.0])
    upper, lower, hinge = two_bones(start, ankle, pole, first, second)
    thigh, shin = np.empty((3, 3)), np.empty((3, 3))
    # Knees bend backward about +y: the hinge turns the thigh into the shin.
    thigh[:, 1], thigh[:, 2] = hinge, -upper
    thigh[:, 0] = crossed(hinge, -upper)
    shin[:, 1], shin[:, 2] = hinge, -lower
    shin[:, 0] = crossed(hinge, -lower)
    foot = product(turn(2, sign * out), turn(1, pitch))
    local[hip] = undone(local[0], thigh)
    local[knee] = undone(thigh, shin)
    local[7 + side] = undone(shin, foot)
    local[10 + side] = turn(1, -toes)


@njit(cache=True)
def _on_heel(flat: float, pitch: float, behind: float, tall: float) -> tuple[float, float]:
    """Ankle's x and z when the foot, flat at x = `flat`, is pitched about its heel."""
    c, s = np.cos(pitch), np.sin(pitch)
    return flat - behind + c * behind + s * tall, -s * behind + c * tall


@njit(cache=True)
def _on_ball(flat: float, pitch: float, ahead: float, ball: float, tall: float) -> tuple[float, float]:
    """The same about the ball of the foot, whose joint is `ahead` of the ankle and `ball` above the floor."""
    c, s = np.cos(pitch), np.sin(pitch)
    return flat + ahead - c * ahead + s * (tall - ball), ball + s * ahead + c * (tall - ball)


@njit(cache=True)
def _step(
    p: float,
    stride: float,
    duty: float,
    joints: NDArray[Any],
    manner: NDArray[Any],
    side: int,
    strike: float,
    push: float,
    lift: float,
    ahead_share: float,
) -> tuple[float, float, float, float]:
    """One foot of a gait at its own phase (0 = it touches down).

    Returns
    -------
    x, z, pitch, toes
        Ankle before the hips and above the floor, foot's pitch, toes' bend.
    """
    tall, ahead = joints[7 + side, 2], joints[10 + side, 0] - joints[7 + side, 0]
    ball, behind = joints[10 + side, 2], manner[10]
    first = stride * duty * ahead_share
    flat_from, rise_from = 0.16 * duty, 0.52 * duty
    if p < duty:
        flat = first - stride * p
        if p < flat_from:
            pitch = -strike * (1 - smooth(p / flat_from))
            x, z = _on_heel(flat, pitch, behind, tall)
            return x, z, pitch, 0.0
        if p < rise_from:
            return flat, tall, 0.0, 0.0
        t = (p - rise_from) / (duty - rise_from)
        pitch = push * t * t
        x, z = _on_ball(flat, pitch, ahead, ball, tall)
        return x, z, pitch, pitch
    t = (p - duty) / (1 - duty)
    x0, z0 = _on_ball(first - stride * duty, push, ahead, ball, tall)
    x1, z1 = _on_heel(first, -strike, behind, tall)
    slope = -stride * (1 - duty)
    x = hermite(x0, x1, 0.35 * slope, slope, t)
    pitch = hermite(push, -strike, 1.6 * push, 0.0, t)
    rise = np.sin(np.pi * t)
    z = z0 + (z1 - z0) * smooth(t) + lift * rise * rise
    # Neither toes nor heel touch the floor while the foot swings.
    toes = push * (1 - smooth(2.2 * t))
    reach = manner[11]
    low = min(
        -np.sin(pitch) * ahead
        - np.cos(pitch) * (tall - ball)
        - ball
        - np.sin(max(pitch - toes, 0.0)) * (reach - ahead),
        np.sin(pitch) * behind - np.cos(pitch) * tall,
    )
    return x, max(z, -low + 0.012 * rise), pitch, toes


@njit(cache=True)
def _highest(
    joints: NDArray[Any], shift: NDArray[Any], pelvis: NDArray[Any], side: int, ankle: NDArray[Any], stretch: float
) -> float:
    """How far up the pelvis may shift for a leg to reach its ankle."""
    length = np.sqrt(((joints[4 + side] - joints[1 + side]) ** 2).sum())
    length = stretch * (length + np.sqrt(((joints[7 + side] - joints[4 + side]) ** 2).sum()))
    hip = joints[0] + shift + applied(pelvis, joints[1 + side] - joints[0])
    dx, dy = ankle[0] - hip[0], ankle[1] - hip[1]
    up = np.sqrt(max(length * length - dx * dx - dy * dy, 0.01))
    return ankle[2] + up - hip[2] + shift[2]


@njit(cache=True)
def _trunk(local: NDArray[Any], lean: float, roll: float, yaw: float, nod: float, stoop: float) -> None:
    """Bend the spine: lean forward, roll to the right, turn left; the head stays level but for `nod`."""
    third = product(turn(2, yaw / 3), product(turn(0, roll / 3), turn(1, lean / 3)))
    local[3] = third
    local[6] = third
    local[9] = product(third, turn(1, 0.6 * stoop))
    local[12] = turn(1, 0.15 * stoop - 0.4 * lean)
    back = product(turn(1, -0.6 * lean - 0.75 * stoop + nod), turn(0, -0.7 * roll))
    local[15] = product(back, turn(2, -0.8 * yaw))


@njit(cache=True)
def _walk(
    local: NDArray[Any],
    shift: NDArray[Any],
    joints: NDArray[Any],
    manner: NDArray[Any],
    p: float,
    stride: float,
    speed: float,
    carrying: bool,
) -> None:
    tall = manner[12]
    # Longer strides swing, bob and turn more; 1 at an ordinary walk.
    vigour = min(stride / (0.73 * tall), 1.5)
    wave, double = np.sin(_TAU * p), np.cos(2 * _TAU * p)
    turned = manner[6] * vigour * np.cos(_TAU * p)
    # At left heel strike the left hip is ahead: the pelvis is turned right.
    local[0] = product(turn(2, -turned), turn(0, np.radians(2.2) * vigour * np.sin(_TAU * (p - 0.02)) * -1.0))
    shift[1] = manner[5] * wave
    shift[0] = 0.006 * vigour * np.sin(2 * _TAU * p)
    ankles = np.empty((2, 3))
    pitch, toes = np.empty(2), np.empty(2)
    duty = 0.62
    for side in range(2):
        own = (p + 0.5 * side) % 1.0
        x, z, a, b = _step(
            own,
            stride,
            duty,
            joints,
            manner,
            side,
            0.34 * min(vigour, 1.15),
            0.72 * min(vigour, 1.2),
            0.035 * tall * vigour,
            0.47,
        )
        ankles[side, 0], ankles[side, 2] = joints[7 + side, 0] + x, z
        ankles[side, 1] = joints[7 + side, 1] * manner[2]
        pitch[side], toes[side] = a, b
    # The pelvis rides on the stiffer leg; a soft minimum keeps the path round.
    high = np.empty(2)
    for side in range(2):
        high[side] = _highest(joints, shift, local[0], side, ankles[side], 0.992)
    low, top = min(high[0], high[1]), -(0.005 + 0.011 * vigour * vigour) * tall
    gap = abs(high[0] - high[1])
    low -= 0.006 * np.exp(-gap / 0.012)
    shift[2] = min(low, top) if low < top - 0.004 else top - 0.004 * np.exp(-(low - top + 0.004) / 0.004)
    for side in range(2):
        _leg(local, joints, shift, side, ankles[side], pitch[side], manner[4], toes[side])
    _trunk(local, manner[1] + 0.02 * vigour * double, 0.0, 1.7 * turned, 0.0, 0.5 * manner[9])
    swing = manner[0] * vigour
    for side in range(2):
        beat = np.cos(_TAU * (p + 0.5 * side) + 0.25)
        forward = -swing * beat - 0.06
        bend = manner[7] + max(forward, 0.0) * 0.9
        if carrying:
            _arm(local, side, manner[3] + 0.05, 0.35 * forward + 0.12, manner[7] + 0.5, 0.1)
            _grip(local, joints, side, 0.9)
        else:
            _arm(local, side, manner[3], forward, bend, 0.15)


@njit(cache=True)
def _run(
    local: NDArray[Any], shift: NDArray[Any], joints: NDArray[Any], manner: NDArray[Any], p: float, stride: float
) -> None:
    tall = manner[12]
    turned = 1.4 * manner[6] * np.cos(_TAU * p)
    local[0] = product(turn(2, -turned), turn(1, 0.10))
    shift[1] = 0.5 * manner[5] * np.sin(_TAU * p)
    ankles = np.empty((2, 3))
    pitch, toes = np.empty(2), np.empty(2)
    duty = 0.36
    # Lowest in mid-stance, highest in mid-flight.
    shift[2] = -0.035 * tall - 0.022 * tall * np.cos(2 * _TAU * (p - 0.5 * duty))
    for side in range(2):
        own = (p + 0.5 * side) % 1.0
        x, z, a, b = _step(own, stride, duty, joints, manner, side, 0.12, 0.95, 0.155 * tall, 0.42)
        swing = min(max((own - duty) / (1 - duty), 0.0), 1.0)
        # The heel whips up behind in early swing.
        kick = np.sin(np.pi * min(swing * 1.5, 1.0))
        ankles[side, 0], ankles[side, 2] = joints[7 + side, 0] + x - 0.05 * tall * kick, z + 0.05 * tall * kick
        ankles[side, 1] = joints[7 + side, 1] * 0.6
        pitch[side], toes[side] = a + 0.5 * kick, b
        # A flying leg binds less and less, so that landing does not jolt the pelvis.
        slack = 1.5 * tall * max(min(own - duty, 1 - own), 0.0)
        high = _highest(joints, shift, local[0], side, ankles[side], 0.985) + slack
        shift[2] = min(shift[2], high)
    for side in range(2):
        _leg(local, joints, shift, side, ankles[side], pitch[side], 0.5 * manner[4], toes[side])
    _trunk(local, 0.10, 0.0, 2.4 * turned, -0.04, 0.3 * manner[9])
    for side in range(2):
        forward = -0.75 * np.cos(_TAU * (p + 0.5 * side) + 0.3)
        _arm(local, side, manner[3] + 0.12, forward - 0.15, 1.55 + 0.25 * forward, 0.25)
        _grip(local, joints, side, 0.8)


@njit(cache=True)
def _plant(
    local: NDArray[Any], shift: NDArray[Any], joints: NDArray[Any], manner: NDArray[Any], lifts: NDArray[Any]
) -> None:
    """Stand on both feet wherever the pelvis is; `lifts` raises each foot, metres."""
    high = 0.0
    ankles = np.empty((2, 3))
    for side in range(2):
        ankles[side, 0] = joints[7 + side, 0] + (0.02 if side == 0 else -0.02) * manner[8]
        ankles[side, 1] = joints[7 + side, 1] * (0.6 + 0.5 * manner[2])
        ankles[side, 2] = joints[7 + side, 2] + lifts[side]
        high = min(high, _highest(joints, shift, local[0], side, ankles[side], 0.999))
    shift[2] = min(shift[2], high)
    for side in range(2):
        _leg(local, joints, shift, side, ankles[side], min(lifts[side] * 3, 0.5), 1.6 * manner[4], 0.0)


@njit(cache=True)
def _stand(
    local: NDArray[Any], shift: NDArray[Any], joints: NDArray[Any], manner: NDArray[Any], p: float, number: int
) -> None:
    """Idle and everything that is done standing."""
    tall = manner[12]
    breath = np.sin(_TAU * p)
    side_lean = (manner[8] - 0.5) * 2
    strength = np.sin(np.pi * p) ** 2
    lifts = np.zeros(2)
    lean, yaw, nod, crouch = 0.35 * manner[1], 0.0, 0.0, 0.0
    shift[1] = 0.02 * side_lean
    roll = np.radians(2.0) * side_lean
    if number in (_PICK, _PUT):
        lean, crouch = lean + 0.75 * strength, 0.16 * tall * strength
        nod = 0.25 * strength
    elif number == _REACH:
        lean = lean + 0.18 * strength
    elif number == _TALK:
        yaw, nod = 0.06 * np.sin(_TAU * p + manner[8]), 0.06 * np.sin(2 * _TAU * p)
    elif number in (_EAT, _DRINK):
        nod = (0.10 if number == _EAT else -0.22) * strength
    elif number == _TURN:
        lifts[0] = 0.06 * max(np.sin(_TAU * p), 0.0)
        lifts[1] = 0.06 * max(-np.sin(_TAU * p), 0.0)
        shift[1] = -0.03 * np.sin(_TAU * p)
    local[0] = product(turn(0, -roll), turn(1, 0.35 * (lean - 0.35 * manner[1])))
    shift[2] = -0.004 - crouch
    shift[0] = -0.45 * crouch
    _plant(local, shift, joints, manner, lifts)
    _trunk(local, lean + 0.008 * breath, 1.3 * roll, yaw, nod, 0.6 * manner[9] - 0.006 * breath)
    for side in range(2):
        sign = 1.0 if side == 0 else -1.0
        _arm(local, side, manner[3] + 0.01 * breath, 0.04 + 0.02 * sign * side_lean, manner[7], 0.2)
    out = np.zeros(3)
    right = np.array([-0.3, -0.7, -0.6])
    left = np.array([-0.3, 0.7, -0.6])
    if number == _TALK:
        beat, slow = np.sin(2 * _TAU * p + 3 * manner[8]), np.sin(_TAU * p)
        out[0], out[1], out[2] = 0.22 * tall, -0.14 * tall, (0.62 + 0.035 * beat) * tall
        out[1] -= 0.03 * tall * slow
        _reach(local, joints, shift, 1, out, right)
        if manner[8] > 0.4:
            out[0], out[1], out[2] = 0.20 * tall, 0.13 * tall, (0.60 - 0.03 * beat) * tall
            _reach(local, joints, shift, 0, out, left)
        local[21] = turn(1, -0.5)
    elif number == _WAVE:
        up = smooth(3.5 * p) * smooth(3.5 * (1 - p))
        sweep = np.sin(3 * _TAU * p)
        out[0], out[1], out[2] = 0.10 * tall, (-0.20 - 0.045 * sweep) * tall, 0.98 * tall
        _reach_by(local, joints, shift, 1, out, np.array([0.0, -1.0, -0.4]), up)
        local[21] = turn(0, 0.35 * sweep * up)
        _grip(local, joints, 1, 0.35 * (1 - up))
    elif number in (_PICK, _PUT, _REACH):
        level = 0.12 if number != _REACH else 0.66
        ahead = 0.24 if number != _REACH else 0.33
        out[0], out[1], out[2] = ahead * tall, -0.06 * tall, level * tall
        _reach_by(local, joints, shift, 1, out, right, strength)
        _grip(local, joints, 1, 0.35 + 0.55 * (strength if number == _PUT else 1 - strength))
    elif number in (_DRINK, _EAT):
        out[0], out[1], out[2] = 0.125 * tall, -0.035 * tall, 0.845 * tall
        _reach_by(local, joints, shift, 1, out, np.array([0.2, -0.6, -1.0]), strength)
        local[21] = turn(1, -0.5 * strength)
        _grip(local, joints, 1, 0.85)
        if number == _EAT:
            out[0], out[1], out[2] = 0.20 * tall, 0.05 * tall, 0.66 * tall
            _reach(local, joints, shift, 0, out, left)
            _grip(local, joints, 0, 0.7)


@njit(cache=True)
def _sit(local: NDArray[Any], shift: NDArray[Any], joints: NDArray[Any], manner: NDArray[Any], p: float) -> None:
    """On a seat of ordinary height behind the feet, hands on the thighs."""
    tall = manner[12]
    breath = np.sin(_TAU * p)
    # Hip joints sit a hand above the seat; seats are 0.45 m high, lower for the small.
    seat = min(0.45, 0.27 * tall) + 0.052 * tall
    shift[2] = seat - joints[1, 2]
    local[0] = turn(1, -0.12)
    for side in range(2):
        thigh = joints[1 + side, 2] - joints[4 + side, 2]
        ankle = np.array([0.98 * thigh + 0.03, joints[7 + side, 1] * 1.25, joints[7 + side, 2]])
        _leg(local, joints, shift, side, ankle, 0.0, 1.5 * manner[4], 0.0)
    _trunk(local, 0.10 + 0.008 * breath, 0.0, 0.0, 0.04, 0.6 * manner[9])
    for side in range(2):
        sign = 1.0 if side == 0 else -1.0
        goal = np.array([0.17 * tall, sign * 0.075 * tall, seat + 0.055 * tall])
        _reach(local, joints, shift, side, goal, np.array([-0.5, sign * 1.0, -0.3]))
        local[20 + side] = turn(0, -sign * 0.1)


@njit(cache=True)
def _sleep(local: NDArray[Any], shift: NDArray[Any], joints: NDArray[Any], manner: NDArray[Any], p: float) -> None:
    """On the back, head towards -x; the ground is the bed's top."""
    tall = manner[12]
    breath = np.sin(_TAU * p)
    local[0] = turn(1, -0.5 * np.pi)
    shift[0] = 0.02 * tall
    shift[2] = 0.098 * tall - joints[0, 2]
    for side in range(2):
        sign = 1.0 if side == 0 else -1.0
        local[1 + side] = product(turn(1, -0.06), turn(0, sign * 0.08))
        local[4 + side] = turn(1, 0.10)
        local[7 + side] = turn(1, 0.45)
    local[9] = turn(1, 0.02 * breath)
    local[15] = product(turn(1, 0.12), turn(2, 0.5 * (manner[8] - 0.5)))
    for side in range(2):
        _arm(local, side, 0.22, 0.05, 0.25, 0.3)
    _arm(local, 1, 0.18, 0.05, 0.3, 0.3)


@njit(cache=True)
def _bike(local: NDArray[Any], shift: NDArray[Any], joints: NDArray[Any], manner: NDArray[Any], p: float) -> None:
    """On a bicycle that stands at the origin: feet on the pedals, hands on the bar."""
    leg = joints[1, 2] - joints[7, 2]
    # The bicycle of `assets.vehicles`: cranks, saddle and bar where that model has them.
    crank, middle, bracket = 0.15, -0.08, 0.29
    # Who is too short for the saddle sits in front of it, lower.
    saddle = min(1.03, bracket - crank + 0.95 * leg + joints[7, 2])
    shift[0] = -0.25 - joints[1, 0]
    shift[2] = saddle - joints[1, 2]
    local[0] = turn(1, 0.22)
    for side in range(2):
        angle = _TAU * (p + 0.5 * side)
        ball = joints[10 + side, 0] - joints[7 + side, 0]
        pitch = 0.25 + 0.15 * np.sin(angle)
        # The ball of the foot is on the pedal, so the ankle is behind and above.
        x = middle + crank * np.cos(angle) - ball * np.cos(pitch)
        z = bracket - crank * np.sin(angle) + 0.02 + joints[7 + side, 2] + ball * np.sin(pitch)
        sign = 1.0 if side == 0 else -1.0
        _leg(local, joints, shift, side, np.array([x, sign * 0.10, z]), pitch, 0.0, 0.5 * pitch)
    _trunk(local, 0.34, 0.0, 0.02 * np.sin(_TAU * p), -0.1, 0.3 * manner[9])
    for side in range(2):
        sign = 1.0 if side == 0 else -1.0
        goal = np.array([0.20, sign * 0.25, 1.08])
        _reach(local, joints, shift, side, goal, np.array([-0.3, sign * 0.7, -0.8]))
        _grip(local, joints, side, 1.0)


@njit(cache=True)
def _step_up(local: NDArray[Any], shift: NDArray[Any], joints: NDArray[Any], manner: NDArray[Any], p: float) -> None:
    """One step of ordinary height, a hand on the rail; getting off runs the same way."""
    tall = manner[12]
    strength = np.sin(np.pi * p) ** 2
    lifts = np.array([0.0, 0.20 * strength])
    local[0] = turn(1, 0.08)
    shift[1] = 0.03 * strength
    shift[2] = -0.004
    _plant(local, shift, joints, manner, lifts)
    _trunk(local, 0.15 * strength + manner[1], 0.0, 0.0, 0.05, 0.5 * manner[9])
    for side in range(2):
        _arm(local, side, manner[3], 0.1, manner[7], 0.2)
    goal = np.array([0.26 * tall, -0.16 * tall, 0.66 * tall])
    _reach_by(local, joints, shift, 1, goal, np.array([-0.3, -0.7, -0.6]), strength)
    _grip(local, joints, 1, 0.4 + 0.5 * strength)
