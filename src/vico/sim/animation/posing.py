"""Poses of everybody: joint rotations by motion and phase, and where the hands are."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.people import JOINTS, PARENTS, J, SkinnedBody
from vico.io.compiled import compiled
from vico.render.skinning import forward_kinematics
from vico.sim.animation.blending import LONGEST_BLEND
from vico.sim.animation.clips import Circumstances, Course, Hands, animate
from vico.sim.animation.limbs import WRIST
from vico.sim.animation.stride import stride_length
from vico.sim.animation.style import KERNEL_STYLE

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
