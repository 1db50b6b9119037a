"""Motion clips: each person's clip, and blending from one clip into the next, for everybody in one call. Compiled.

Joints turn over, feet step from where they stand to where they are needed. A foot that bears weight does not slide: who
stops brings the foot that is in the air down first and the other one after it, each lifted; who sets out goes on from
the foot below the hips. Called through `vico.sim.animation.pose`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.sim.animation.gait import RUN_DUTY, WALK_DUTY, run, walk
from vico.sim.animation.limbs import (
    AHEAD,
    ANKLE,
    HERE,
    LEVEL,
    NEXT,
    PELVIS,
    Array,
    BodyPose,
    X,
    Y,
    Z,
    axis_angle,
    bend_leg,
    compose,
    curl_fingers,
    highest_pelvis,
    joint_in_body,
    part_way,
    rotate,
    rotation_about,
    smoothstep,
    sole_depth,
    sole_roll,
)
from vico.sim.animation.motions import (
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
from vico.sim.animation.postures import (
    TURN_CYCLE,
    TURN_START,
    gesture_seated,
    hold_up,
    ride_bike,
    sit,
    sleep,
    stand,
    step_up,
)

#: Longest that one motion shows in the next, seconds.
LONGEST_BLEND = 1.3
_INTO_GAIT, _OUT_OF_GAIT, _DOWN_OR_UP, _OTHERWISE = 0.3, 0.5, 0.9, 0.45
# A swing of which less than this share is left changes nothing any more; steps are taken before a cycle is over.
_TOO_LATE, _CYCLE = 0.4, 0.99
_FIRST_UNTIL, _SECOND_FROM = 0.55, 0.45
_STEP_LIFT, _FULL_STEP = 0.03, 0.15


@compiled
def is_gait(clip: int) -> bool:
    """Return whether a motion walks or runs."""
    return clip in (WALK, CARRY, CARRY_LEFT, CARRY_RIGHT, RUN)


@compiled
def is_seated(clip: int) -> bool:
    """Return whether a motion is made sitting on a chair."""
    return clip == SIT or SIT_TALK <= clip <= SIT_EAT


@compiled
def blend_time(before: int, clip: int) -> float:
    """Return how long joints take from one motion to another, seconds; feet may take to the end of their step."""
    if is_seated(before) != is_seated(clip) or before == SLEEP or clip == SLEEP:
        return _DOWN_OR_UP
    if is_gait(clip):
        return _INTO_GAIT
    return _OUT_OF_GAIT if is_gait(before) else _OTHERWISE


@compiled
def duty_of(clip: int) -> float:
    """Return the share of a gait's cycle that a foot is on the ground."""
    return RUN_DUTY if clip == RUN else WALK_DUTY


@compiled
def write_feet(body: Any, ankles: Array, feet: Array) -> None:
    """Write where both ankles are, and how the feet are turned, in the body's frame."""
    for side in range(2):
        ankle, shin = joint_in_body(body, ANKLE[side])
        ankles[side] = ankle
        feet[side] = compose(shin, body.local[ANKLE[side]])


@compiled
def blend_joints(body: Any, before: Any, share: float) -> None:
    """Turn every joint from where it was a share of the way to where it is in the new motion; shift the pelvis so."""
    local, shift = body.local, body.shift
    for j in range(len(local)):
        local[j] = part_way(before.local[j], local[j], share)
    for axis in range(3):
        shift[axis] = before.shift[axis] + (shift[axis] - before.shift[axis]) * share


@compiled
def changes_seat(before: int, clip: int) -> bool:
    """Return whether somebody sits down, lies down or gets up between two motions."""
    return is_seated(before) != is_seated(clip) or (before == SLEEP) != (clip == SLEEP)


@compiled
def move_frame(body: Any, moved: Array) -> None:
    """Pose a body as it was in another frame: that is at `moved` x, y, z in this one, and turned by `moved` yaw."""
    turn, pelvis = rotation_about(Z, moved[3]), body.joints[PELVIS]
    body.shift[:] = rotate(turn, pelvis + body.shift) + moved[:3] - pelvis
    body.local[PELVIS] = compose(turn, body.local[PELVIS])


@compiled
def lie_down(body: Any, before: Any, u: float, floor: float) -> None:
    """Blend into a motion off one's feet, or out of it: nothing reaches into the floor, or into a bed above `floor`."""
    share = smoothstep(u)
    blend_joints(body, before, share)
    lowest = floor * (1 - share)
    for side in range(2):
        ankle, _ = joint_in_body(body, ANKLE[side])
        lowest = min(lowest, ankle[Z] - sole_depth(body.style, side, 0.0))
    body.shift[Z] -= lowest - floor * (1 - share)


@compiled
def stand_by_steps(body: Any, before: Any, turned: float, u: float) -> None:
    """Blend into standing, sitting or turning: one foot goes where it is needed, then the other one.

    `turned` says how far the body has turned to the left since; feet that stand do not turn with it.
    """
    ankles, feet = np.empty((2, 2, 3)), np.empty((2, 2, 3, 3))
    write_feet(before, ankles[0], feet[0])
    write_feet(body, ankles[1], feet[1])
    back = rotation_about(Z, -turned)
    for side in range(2):
        ankles[0, side] = rotate(back, ankles[0, side])
        feet[0, side] = compose(back, feet[0, side])
    blend_joints(body, before, smoothstep(u))
    # The foot in the air comes down first; of two on the ground that which has farther to go.
    away = ((ankles[1] - ankles[0]) ** 2).sum(axis=1)
    left_first = ankles[0, 0, Z] + 0.1 * away[0] > ankles[0, 1, Z] + 0.1 * away[1]
    for side in range(2):
        own = u / _FIRST_UNTIL if (side == 0) == left_first else (u - _SECOND_FROM) / (1 - _SECOND_FROM)
        step = smoothstep(own)
        lift = _STEP_LIFT * body.style.height * min(np.sqrt(away[side]) / _FULL_STEP, 1.0)
        ankles[0, side] += (ankles[1, side] - ankles[0, side]) * step
        ankles[0, side, Z] += lift * np.sin(np.pi * step)
        feet[0, side] = part_way(feet[0, side], feet[1, side], step)
    _bend_legs(body, ankles[0], feet[0], u)


@compiled
def roll_of(body: Any, side: int, foot: Array) -> Array:
    """Return where the ankle of a foot so turned is from where the foot stands flat, body frame, metres."""
    pitch = np.arcsin(min(max(-foot[2, 0], -1.0), 1.0))
    ahead = sole_roll(body.style, side, pitch) / np.sqrt(foot[0, 0] ** 2 + foot[1, 0] ** 2 + 1e-9)
    return np.array([ahead * foot[0, 0], ahead * foot[1, 0], sole_depth(body.style, side, pitch)])


@compiled
def walk_on(body: Any, before: Any, off: Any, steps: Array, flying: Array, share: float) -> None:
    """Blend into a gait: a foot on the ground stays where it is and comes to the gait's own place with its next step.

    `off` is how far the spots were where the feet would be flat, and `steps` how far each foot is in taking that step,
    0..1, of this moment. Soles roll over those spots while the feet turn from one motion to the other. A foot that flew
    as the gait began comes down in its own place: `flying` is how far it is in that, 0..1, and 1 for the others.
    """
    ankles, feet, was, were = np.empty((2, 3)), np.empty((2, 3, 3)), np.empty((2, 3)), np.empty((2, 3, 3))
    write_feet(body, ankles, feet)
    write_feet(before, was, were)
    blend_joints(body, before, share)
    for side in range(2):
        rest, rise = 1 - smoothstep(steps[side]), min(1 - smoothstep(2.5 * steps[side]), 1 - share)
        if flying[side] < 1:
            rest, rise = 1 - smoothstep(1.4 * flying[side]), 1 - smoothstep(flying[side])
            ankles[side, Z] += _STEP_LIFT * body.style.height * np.sin(np.pi * flying[side]) ** 2
        ankles[side] -= roll_of(body, side, feet[side])
        feet[side] = part_way(were[side], feet[side], share)
        ankles[side] += roll_of(body, side, feet[side])
        ankles[side, X] += rest * off[side, X]
        ankles[side, Y] += rest * off[side, Y]
        ankles[side, Z] += rise * off[side, Z]
        ground = min(body.ground[side, HERE, LEVEL], body.ground[side, NEXT, LEVEL])
        pitch = np.arcsin(min(max(-feet[side, 2, 0], -1.0), 1.0))
        ankles[side, Z] = max(ankles[side, Z], ground + sole_depth(body.style, side, pitch))
    _bend_legs(body, ankles, feet, share)


@compiled
def step_taken(was: float, now: float, duty: float) -> float:
    """Return how far a foot has come, 0..1, in the first step that it takes after place `was` in its cycle.

    `now` is its place now, 1 more after each cycle.
    """
    gone = now - was
    left = duty - was if was < duty else 0.0
    swing = 1 - max(was, duty)
    if duty == WALK_DUTY and swing < _TOO_LATE * (1 - duty):
        # It comes down where it was about to; the next step brings it to its own place, before the cycle is over.
        left = swing + duty
        swing = min(1 - duty, _CYCLE - left)
    return min(max((gone - left) / swing, 0.0), 1.0)


@compiled
def _bend_legs(body: Any, ankles: Array, feet: Array, share: float) -> None:
    """Bring both feet where they are to be, the pelvis as low as they need it."""
    # Legs that are all but straight snap: from as straight as they may have been to a little bent.
    stretch = 0.9995 - 0.0045 * min(3 * share, 1.0)
    for side in range(2):
        body.shift[Z] = min(body.shift[Z], highest_pelvis(body, side, ankles[side], stretch))
    for side in range(2):
        pole = np.array([feet[side, 0, 0], feet[side, 1, 0], 0.0])
        bend_leg(body, side, ankles[side], feet[side], pole)


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
        See `vico.sim.animation.posing.ground_under_feet`.
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
        How something is held, a `vico.sim.animation.postures.Hold`, int64, shape ``(n,)``.
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
