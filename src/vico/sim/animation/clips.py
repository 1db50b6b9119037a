"""Which motion somebody makes, for everybody in one call. Compiled; called through `vico.sim.animation.pose`."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.sim.animation.blending import (
    LONGEST_BLEND,
    blend_time,
    changes_seat,
    duty_of,
    is_gait,
    lie_down,
    move_frame,
    roll_of,
    stand_by_steps,
    step_taken,
    walk_on,
    write_feet,
)
from vico.sim.animation.gait import run, walk
from vico.sim.animation.holds import hold_up
from vico.sim.animation.limbs import AHEAD, HERE, BodyPose, curl_fingers
from vico.sim.animation.names import (
    CARRY,
    CARRY_LEFT,
    CARRY_RIGHT,
    ENTER_VEHICLE,
    EXIT_VEHICLE,
    RIDE_BIKE,
    RIDE_BUS,
    RUN,
    SIT,
    SIT_EAT,
    SIT_TALK,
    SLEEP,
    TURN,
    WALK,
)
from vico.sim.animation.rotations import Array, X, Z, axis_angle, smoothstep
from vico.sim.animation.seated import ride_bike, sit, sleep, step_up
from vico.sim.animation.standing import TURN_CYCLE, TURN_START, gesture_seated, stand


class Course(NamedTuple):
    """How far everybody is in a motion.

    Attributes
    ----------
    clip
        Motion numbers, int64, shape ``(n,)``.
    phase
        Place in its cycle, 0..1, float64, shape ``(n,)``.
    stride
        Metres a cycle covers, float64, shape ``(n,)``.
    ground
        See `vico.sim.animation.footing.ground_under_feet`.
    """

    clip: NDArray[np.int64]
    phase: NDArray[np.float64]
    stride: NDArray[np.float64]
    ground: NDArray[np.float64]


class Hands(NamedTuple):
    """What people do with their hands beside the motion.

    Attributes
    ----------
    gesture
        Which hand makes gestures, 0 left, 1 right, int64, shape ``(n,)``.
    hold
        How something is held, a `vico.sim.animation.holds.Hold`, int64, shape ``(n,)``.
    share
        How far the arms have come to hold it so, 0..1, float64, shape ``(n,)``.
    width
        Of what is held before the chest, metres, float64, shape ``(n,)``.
    """

    gesture: NDArray[np.int64]
    hold: NDArray[np.int64]
    share: NDArray[np.float64]
    width: NDArray[np.float64]


class Circumstances(NamedTuple):
    """What poses depend on beside motion and manner.

    Attributes
    ----------
    before
        The motion that this one follows, a `Course`.
    since
        Seconds since then, float64, shape ``(n,)``.
    moved
        Where the body was then, in its frame of now: x, y, z, metres, and yaw, radians, float64, shape ``(n, 4)``.
    speed
        Metres a second over the ground, float64, shape ``(n,)``.
    second
        Of the clock.
    hands
        See `Hands`.
    """

    before: Course
    since: NDArray[np.float64]
    moved: NDArray[np.float64]
    speed: NDArray[np.float64]
    second: float
    hands: Hands


@compiled
def animate(course: Any, around: Any, style: Array, rotations: Array, offsets: Array) -> None:
    """Write everybody's joint rotations and pelvis shifts; see `vico.sim.animation.pose`."""
    for i in range(len(course.clip)):
        one = style[i]
        joints, count = one.joints, len(one.joints)
        hand = around.hands.gesture[i]
        # Made here, for compiled functions cannot return records.
        body = BodyPose(np.zeros((count, 3, 3)), np.zeros(3), joints, one, around.second, course.ground[i], hand)
        _pose_one(body, course.clip[i], course.phase[i], course.stride[i])
        if around.since[i] < LONGEST_BLEND:
            _blend(body, i, course, around)
        if around.hands.share[i] > 0:
            hold_up(body, around.hands.hold[i], around.hands.share[i], around.hands.width[i])
        for j in range(count):
            axis_angle(body.local[j], rotations[i, j])
        for r in range(3):
            offsets[i, r] = body.shift[r]


@compiled
def _blend(body: Any, i: int, course: Any, around: Any) -> None:
    """Let one person's motion show that which came before it."""
    before, since = around.before, around.since[i]
    was, now = before.clip[i], course.clip[i]
    u = since / blend_time(was, now)
    count = len(body.joints)
    old = BodyPose(
        np.zeros((count, 3, 3)), np.zeros(3), body.joints, body.style, body.second, before.ground[i], body.hand
    )
    if is_gait(now):
        if since * around.speed[i] < course.stride[i] and not _off_their_feet(was):
            _set_out(body, old, i, course, around)
        return
    if u >= 1:
        return
    _pose_one(old, was, before.phase[i], before.stride[i])
    if changes_seat(was, now):
        move_frame(old, around.moved[i])
    if _off_their_feet(was) or _off_their_feet(now):
        lie_down(body, old, u, min(around.moved[i, Z], 0.0) if now == SLEEP else 0.0)
    else:
        # Turning began at TURN_START, and it goes on from there as far as the body has turned.
        turned = ((course.phase[i] - TURN_START + 0.5) % 1.0 - 0.5) * TURN_CYCLE if now == TURN else 0.0
        stand_by_steps(body, old, turned, u)


@compiled
def _off_their_feet(clip: int) -> bool:
    return clip in (SLEEP, RIDE_BIKE, RIDE_BUS)


@compiled
def _set_out(body: Any, old: Any, i: int, course: Any, around: Any) -> None:
    """Blend into a gait, or from one pace of it to another."""
    before, since = around.before, around.since[i]
    was, now, stride = before.clip[i], course.clip[i], course.stride[i]
    gone = since * around.speed[i] / stride
    first = course.phase[i] - gone  # where the gait began
    ankles, feet = np.empty((2, 2, 3)), np.empty((2, 2, 3, 3))
    start = BodyPose(
        np.zeros_like(body.local), np.zeros(3), body.joints, body.style, body.second, np.zeros((2, 2, 4)), body.hand
    )
    level = BodyPose(
        np.zeros_like(body.local), np.zeros(3), body.joints, body.style, body.second, start.ground, body.hand
    )
    _pose_one(level, was, before.phase[i], before.stride[i])
    write_feet(level, ankles[0], feet[0])
    _pose_one(start, now, first, stride)
    write_feet(start, ankles[1], feet[1])
    _pose_one(old, was, before.phase[i] + (gone if is_gait(was) else 0.0), before.stride[i])
    steps, flying = np.empty(2), np.ones(2)
    share = min(since / blend_time(was, now), 1.0)
    for side in range(2):
        for k in range(2):
            ankles[k, side] -= roll_of(body, side, feet[k, side])
        if not is_gait(was):
            ankles[0, side, X] -= body.ground[side, HERE, AHEAD]
        at = (first + 0.5 * side) % 1.0
        steps[side] = step_taken(at, at + gone, duty_of(now))
        flew = is_gait(was) and (before.phase[i] + 0.5 * side) % 1.0 > duty_of(was)
        if flew and at < duty_of(now):
            flying[side], steps[side] = share, 1.0
    walk_on(body, old, ankles[0] - ankles[1], steps, flying, smoothstep(share))


@compiled
def _pose_one(body: Any, clip: int, phase: float, stride: float) -> None:
    """Write one person's pose in a motion."""
    local = body.local
    for j in range(len(local)):
        local[j, 0, 0] = local[j, 1, 1] = local[j, 2, 2] = 1.0
    for side in range(2):
        curl_fingers(body, side, 0.38, 0.2)
    _move(body, clip, phase - np.floor(phase), stride)


@compiled
def _move(body: Any, clip: int, p: float, stride: float) -> None:
    if clip in (WALK, CARRY, CARRY_LEFT, CARRY_RIGHT):
        walk(body, p, stride, (clip in (CARRY, CARRY_LEFT), clip in (CARRY, CARRY_RIGHT)))
    elif clip == RUN:
        run(body, p, stride)
    elif clip == SLEEP:
        sleep(body, p)
    elif clip == RIDE_BIKE:
        ride_bike(body, p)
    elif clip in (SIT, RIDE_BUS):
        sit(body, p)
    elif SIT_TALK <= clip <= SIT_EAT:
        sit(body, p)
        gesture_seated(body, p, clip)
    elif clip in (ENTER_VEHICLE, EXIT_VEHICLE):
        step_up(body, p)
    else:
        stand(body, p, clip)
