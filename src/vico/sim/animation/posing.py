"""Poses of everybody: joint rotations by motion and phase, the ground under the feet, and where the hands are.

For each foot it is found where it stands or comes down, how high it is there and how the ground slopes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.people import JOINTS, PARENTS, J, SkinnedBody
from vico.exact import each
from vico.io.compiled import compiled
from vico.render.skinning import forward_kinematics
from vico.sim.animation.clips import LONGEST_BLEND, Circumstances, Course, Hands, animate, is_gait, is_seated
from vico.sim.animation.gait import foothold, gait_of_run, gait_of_walk
from vico.sim.animation.limbs import AHEAD, ANKLE, LEVEL, OVER, TILT, WRIST, Y, stance
from vico.sim.animation.motions import CARRY, CARRY_LEFT, CARRY_RIGHT, KERNEL_STYLE, RUN, WALK, stride_length
from vico.sim.animation.postures import seated_foot

_KNUCKLE = (J["left_middle1"], J["right_middle1"])


class Transition(NamedTuple):
    """What people did before their present motion.

    Attributes
    ----------
    clip, phase, speed
        As in `pose`, of the motion before; its phase when it ended.
    since
        Seconds since then, shape ``(n,)``.
    ground
        As in `pose`, of the motion before.
    moved
        Where bodies were before they sat down, lay down or got up, in their frames of now: x, y, z, metres, and yaw,
        radians, shape ``(n, 4)``; None: where they are.
    over_ground
        Metres a second that they cover now, where that is not what their strides are those of, as on stairs; shape
        ``(n,)``; None: it is.
    """

    clip: NDArray[Any]
    phase: NDArray[Any]
    speed: NDArray[Any]
    since: NDArray[Any]
    ground: NDArray[np.float64] | None = None
    moved: NDArray[np.float64] | None = None
    over_ground: NDArray[np.float64] | None = None


def pose(
    clip: NDArray[Any],
    phase: NDArray[Any],
    speed: NDArray[Any],
    style: NDArray[Any],
    *,
    second: float = 0.0,
    after: Transition | None = None,
    ground: NDArray[np.float64] | None = None,
    hands: Hands | None = None,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Pose everybody.

    Parameters
    ----------
    clip
        Motion numbers (`clip_index`), shape ``(n,)``.
    phase
        Where in the cycle, 0..1, shape ``(n,)``. At 0 the left heel strikes; gestures are strongest at 0.5.
    speed
        Metres a second over the ground, shape ``(n,)``; the stride follows from it as in `stride_length`.
    style
        Of `style_of`, one a person, shape ``(n,)``.
    second
        Of the clock: who stands or sits shifts their weight and looks about by it, each in their own time.
    after
        What they did before, which for half a second shows in what they do now; None: nothing else.
    ground
        Of `ground_under_feet`; None: level ground at the height where everybody is.
    hands
        What people hold, and the hand they make gestures with; None: nothing, and the right one.

    Returns
    -------
    rotations
        Axis-angle relative to the parent joint, radians, float32, shape ``(n, 55, 3)``, T-pose = 0.
    offsets
        Shift of the pelvis from its place in the T-pose, body frame, metres, float32, shape ``(n, 3)``.
    """
    people = style.astype(KERNEL_STYLE)
    now = _course(clip, phase, speed, people, ground)
    before, since = now, np.full(len(people), LONGEST_BLEND)
    moved, over_ground = np.zeros((len(people), 4)), speed
    if after is not None:
        moved = moved if after.moved is None else np.ascontiguousarray(after.moved, np.float64)
        over_ground = speed if after.over_ground is None else after.over_ground
        before = _course(after.clip, after.phase, after.speed, people, after.ground)
        since = np.ascontiguousarray(after.since, np.float64)
    rotations = np.zeros((len(people), len(JOINTS), 3), np.float32)
    offsets = np.zeros((len(people), 3), np.float32)
    animate(
        now,
        Circumstances(
            before,
            since,
            moved,
            np.ascontiguousarray(over_ground, np.float64),
            float(second),
            hands or free_hands(len(people)),
        ),
        people,
        rotations,
        offsets,
    )
    return rotations, offsets


def free_hands(people: int) -> Hands:
    """Return the hands of people who hold nothing."""
    nothing = np.zeros(people)
    return Hands(np.ones(people, np.int64), np.zeros(people, np.int64), nothing, nothing)


def _course(
    clip: NDArray[Any],
    phase: NDArray[Any],
    speed: NDArray[Any],
    people: NDArray[Any],
    ground: NDArray[np.float64] | None,
) -> Course:
    """Return motions as kernels take them."""
    numbers = np.ascontiguousarray(clip, np.int64)
    stride = stride_length(numbers, np.asarray(speed, np.float64), people["height"])
    under = np.zeros((len(people), 2, 2, 4)) if ground is None else np.ascontiguousarray(ground, np.float64)
    return Course(numbers, np.ascontiguousarray(phase, np.float64), stride, under)


def hand_frames(
    joints: NDArray[Any], rotations: NDArray[np.float32], offsets: NDArray[np.float32]
) -> NDArray[np.float64]:
    """Return where everybody's palms are, to attach what they hold.

    Parameters
    ----------
    joints
        `BodyBatch.joints`, shape ``(n, 55, 3)``.
    rotations, offsets
        Of `pose`.

    Returns
    -------
    ndarray
        Left and right palm to body frame, shape ``(n, 2, 4, 4)``; in the T-pose their axes are the body's.
    """
    frames = np.zeros((len(rotations), 2, 4, 4))
    _hands(np.ascontiguousarray(joints, np.float64), rotations, offsets, PARENTS, frames)
    return frames


def joint_places(
    joints: NDArray[Any], rotations: NDArray[np.float32], offsets: NDArray[np.float32]
) -> NDArray[np.float64]:
    """Return where everybody's joints are, body frame, metres, shape ``(n, 55, 3)``; arguments as of `hand_frames`."""
    places = np.empty((len(rotations), len(PARENTS), 3))
    turned = np.empty((len(PARENTS), 3, 3))
    for i in range(len(rotations)):
        forward_kinematics(
            rotations[i], np.ascontiguousarray(joints[i], np.float64), PARENTS, offsets[i], turned, places[i]
        )
    return places


def hand_position(
    rotations: NDArray[np.float32], offset: NDArray[np.float32], body: SkinnedBody, hand: int
) -> NDArray[np.float64]:
    """Return the middle of one person's palm, body frame, metres, shape ``(3,)``; hand 0 is the left."""
    return hand_frames(body.joints[None], rotations[None], offset[None])[0, hand, :3, 3]


@compiled
def _hands(
    joints: NDArray[Any],
    rotations: NDArray[Any],
    offsets: NDArray[Any],
    parents: NDArray[Any],
    frames: NDArray[Any],
) -> None:
    """Write the palms' frames."""
    turned = np.empty((len(parents), 3, 3))
    placed = np.empty((len(parents), 3))
    for i in range(len(rotations)):
        forward_kinematics(rotations[i], joints[i], parents, offsets[i], turned, placed)
        for hand in range(2):
            wrist, knuckle = WRIST[hand], _KNUCKLE[hand]
            for r in range(3):
                for c in range(3):
                    frames[i, hand, r, c] = turned[wrist, r, c]
                # The palm's hollow lies a little below the line from wrist to knuckle.
                middle = 0.3 * placed[wrist, r] + 0.7 * placed[knuckle, r]
                frames[i, hand, r, 3] = middle - 0.025 * turned[wrist, r, 2]
            frames[i, hand, 3, 3] = 1.0


GAITS = (WALK, CARRY, CARRY_LEFT, CARRY_RIGHT, RUN)
# Heel and ball of a foot, shares of its length behind the ankle and before it.
_HEEL, _BALL = 1.0, 1.05
_HALF_WIDTH, _LONG = 0.035, 0.25  # of the sole, metres, on feet so long from heel to toes
# Steeper than this under one foot is an edge, and so is ground that bends by so many metres from heel to ball.
_EDGE, _BENT = 0.22, 0.006
# Where the ground is looked at around a foot on an edge, along it and across, and how far feet are moved, metres.
_ALONG, _ACROSS = np.linspace(-0.48, 0.56, 53), np.array([-_HALF_WIDTH, 0.0, _HALF_WIDTH])
_SHIFTS = np.linspace(-0.28, 0.28, 29)
# Room to the edge, and heights that are one level, metres.
_ROOM, _TOE_ROOM, _SAME = 0.03, 0.03, 0.006
_DROP = 0.03  # beyond an edge it is lower by more than this, metres: sloping ground is not
_ON_IT = 0.35  # what standing on an edge costs, as metres of a move
# The same where a move back would end as high: along a kerb hips would come down for legs to reach.
_ON_TOP = 0.15
# How much worse a move ahead is that ends lower: hips come down a long way for such a step.
_LUNGE = 2.0


def ground_under_feet(
    clip: NDArray[Any],
    phase: NDArray[Any],
    speed: NDArray[Any],
    style: NDArray[Any],
    place: tuple[NDArray[np.float64], NDArray[np.float64]],
    height: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    *,
    roughly: NDArray[np.bool_] | None = None,
) -> NDArray[np.float64]:
    """Return the ground where people's feet stand and where they come down next.

    Parameters
    ----------
    clip, phase, speed, style
        As in `vico.sim.animation.pose`.
    place
        Feet, ENU metres, shape ``(n, 3)``, and headings, radians, shape ``(n,)``.
    height
        Heights of the ground, or of the deck that is nearest, at points of shape ``(m, 3)``.
    roughly
        Whose feet are left across edges, such as those of people far away, shape ``(n,)``; None: nobody's.

    Returns
    -------
    ndarray
        For each left and right foot, where it is or was last and where it comes down next: height above where the
        person is, metres; slope, radians, toes down; how far ahead of its place in the gait it stands, so that all of
        it is on one side of an edge, metres; how much of its toes' end is over the edge all the same, metres; shape
        ``(n, 2, 2, 4)``.
    """
    position, yaw = place
    people = style.astype(KERNEL_STYLE)
    numbers = np.ascontiguousarray(clip, np.int64)
    stride = stride_length(numbers, np.asarray(speed, np.float64), people["height"])
    spots = np.empty((len(people), 2, 2, 5, 2))  # foot; here, next; heel left and right, ball so, middle; x, y
    _feet(numbers, np.ascontiguousarray(phase, np.float64), stride, people, spots)
    c, s = np.cos(yaw)[:, None, None, None], np.sin(yaw)[:, None, None, None]
    points = np.empty((*spots.shape[:-1], 3))
    points[..., 0] = c * spots[..., 0] - s * spots[..., 1] + position[:, 0, None, None, None]
    points[..., 1] = s * spots[..., 0] + c * spots[..., 1] + position[:, 1, None, None, None]
    points[..., 2] = position[:, 2, None, None, None]
    found = height(points.reshape(-1, 3)).reshape(points.shape[:-1]) - position[:, 2, None, None, None]
    heel, ball = 0.5 * (found[..., 0] + found[..., 1]), 0.5 * (found[..., 2] + found[..., 3])
    rise, run = ball - heel, spots[..., 2, 0] - spots[..., 0, 0]
    bent = np.abs(found[..., 4] - 0.5 * (heel + ball)) + np.abs(
        found[..., 0] - found[..., 1] - found[..., 2] + found[..., 3]
    )
    edge = (
        (np.abs(rise) > _EDGE * run)
        | (bent > _BENT)
        | (np.abs(found[..., 0] - found[..., 1]) > 2 * _EDGE * _HALF_WIDTH)
    )
    behind = _HEEL * people["heel_length"][:, None, None]
    ground = np.zeros((len(people), 2, 2, 4))
    ground[..., LEVEL] = np.where(edge, found.max(axis=-1), heel + rise * behind / run)
    ground[..., TILT] = np.where(edge, 0.0, -each(math.atan2, rise, run))
    steps = edge & np.isin(numbers, GAITS)[:, None, None]
    if roughly is not None:
        steps &= ~roughly[:, None, None]
    if steps.any():
        who, side, when = np.nonzero(steps)
        back, front = 0.5 * (points[..., 0, :] + points[..., 1, :]), 0.5 * (points[..., 2, :] + points[..., 3, :])
        ankle = (back + (front - back) * (behind / run)[..., None])[who, side, when]
        foot = people["heel_length"][who], people["toe_length"][who]
        out = yaw[who] + np.where(side == 0, 1.0, -1.0) * people["toe_out"][who]
        ahead, level, over = _off_the_edge(ankle, out, foot, height)
        ground[who, side, when, AHEAD], ground[who, side, when, LEVEL] = ahead, level - position[who, 2]
        ground[who, side, when, OVER] = over
    return ground


def _off_the_edge(
    ankle: NDArray[np.float64],
    yaw: NDArray[np.float64],
    foot: tuple[NDArray[np.float64], NDArray[np.float64]],
    height: Callable[[NDArray[np.float64]], NDArray[np.float64]],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return how far on or back feet stand that would be across an edge, how high, and how much of the toes is over.

    Metres, each of shape ``(k,)``.

    As near as can be to where the gait has them, on one level; on treads that are shorter than the foot, with the heel
    or the toes over the edge, never into the next riser.
    """
    c, s = np.cos(yaw)[:, None, None], np.sin(yaw)[:, None, None]
    wide = np.minimum((foot[0] + foot[1]) / _LONG, 1.0)  # feet of children are narrower
    u, v = _ALONG[None, :, None], _ACROSS[None, None, :] * wide[:, None, None]
    points = np.empty((len(ankle), len(_ALONG), len(_ACROSS), 3))
    points[..., 0] = ankle[:, 0, None, None] + c * u - s * v
    points[..., 1] = ankle[:, 1, None, None] + s * u + c * v
    points[..., 2] = ankle[:, 2, None, None]
    found = height(points.reshape(-1, 3)).reshape(points.shape[:-1])
    ahead, level, over = np.empty(len(ankle)), np.empty(len(ankle)), np.empty(len(ankle))
    _nearest_place(found, *foot, ahead, level)
    _toes_over(found, *foot, ahead, level, over)
    return ahead, level, over


@compiled
def _nearest_place(found: Any, heel: Any, toe: Any, ahead: Any, level: Any) -> None:
    """Write how far feet move and how high they stand there, from heights along them and across."""
    for i in range(len(found)):
        # Along an edge there is no room for a foot on either side: it stands on it.
        best, ahead[i], level[i] = _ON_IT, 0.0, -np.inf
        for j in range(len(_ALONG)):
            if -0.5 * heel[i] <= _ALONG[j] <= 0.7 * toe[i]:
                level[i] = max(level[i], found[i, j].max())
            elif -0.9 * heel[i] <= _ALONG[j] <= 0.9 * toe[i]:
                level[i] = max(level[i], found[i, j, 1])
        on_it, size = level[i], (heel[i] + toe[i]) / _LONG
        for shift in _SHIFTS:
            # Of two places as good the one ahead, however the numbers are rounded. To short legs a move is longer.
            cost = abs(shift) / size - 1e-4 * shift
            if cost < best:
                stands, more = _discomfort(found[i], shift, heel[i], toe[i])
                if shift > 0.0 and stands < on_it - _SAME:
                    more += (_LUNGE - 1.0) * cost
                is_level = shift < 0.0 and stands >= on_it - _SAME
                if cost + more < (min(best, _ON_TOP) if is_level else best) - 1e-9:
                    best, ahead[i], level[i] = cost + more, shift, stands


@compiled
def _toes_over(found: Any, heel: Any, toe: Any, ahead: Any, level: Any, over: Any) -> None:
    """Write how much of each foot's end is over an edge, where it stands at a level."""
    for i in range(len(found)):
        borne = -heel[i]
        for j in range(len(_ALONG)):
            place = _ALONG[j] - ahead[i]
            if borne < place <= toe[i] and found[i, j].max() > level[i] - _DROP:
                borne = place
        gap = toe[i] - borne
        over[i] = gap if gap > _ALONG[1] - _ALONG[0] + 1e-9 else 0.0


@compiled
def _discomfort(found: Any, shift: float, heel: float, toe: float) -> tuple[float, float]:
    """Return how high a foot so moved stands, and how bad it is there, as metres of a move."""
    stands, lowest, top = -np.inf, np.inf, -np.inf
    for j in range(len(_ALONG)):
        place = _ALONG[j] - shift
        if -heel - _ROOM <= place <= toe + _TOE_ROOM:
            high = found[j].max()
            top = max(top, high)
            if -0.5 * heel <= place <= 0.6 * toe:
                stands, lowest = max(stands, high), min(lowest, found[j].min())
    under, over = 0, 0
    for j in range(len(_ALONG)):
        if -heel - _ROOM <= _ALONG[j] - shift <= toe + _TOE_ROOM:
            under += 1
            over += found[j].min() < stands - _SAME
    into = max(top - stands - _SAME, 0.0) + 2.0 * max(stands - lowest - _SAME, 0.0)
    return stands, 0.6 * over / under + 20.0 * into


@compiled
def _feet(clip: Any, phase: Any, stride: Any, style: Any, spots: Any) -> None:
    """Write corners and middle of every foot where it stands and where it comes down, body frame, metres."""
    for i in range(len(clip)):
        one = style[i]
        for side in range(2):
            if is_gait(clip[i]):
                gait = gait_of_run(stride[i], one) if clip[i] == RUN else gait_of_walk(stride[i], one)
                ankle = one.joints[ANKLE[side]]
                y = ankle[Y] * (0.6 if clip[i] == RUN else one.foot_spread)
                here, after = foothold((phase[i] + 0.5 * side) % 1.0, gait)
                here, after = here + ankle[0], after + ankle[0]
            elif is_seated(clip[i]):
                here, y = seated_foot(one, side)
                after = here
            else:
                here, y = stance(one, side)
                after = here
            for k, x in enumerate((here, after)):
                heel, ball = x - _HEEL * one.heel_length, x + _BALL * one.toe_length
                for j in range(4):
                    spots[i, side, k, j, 0] = heel if j < 2 else ball
                    spots[i, side, k, j, 1] = y + (_HALF_WIDTH if j % 2 == 0 else -_HALF_WIDTH)
                spots[i, side, k, 4, 0], spots[i, side, k, 4, 1] = 0.5 * (heel + ball), y
