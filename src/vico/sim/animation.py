"""How people move: a library of procedural motions on the 55 joints, computed for everybody in one call.

A motion is a function of a phase in 0..1 (one cycle; two steps when walking), so it can be stopped, resumed, replayed
and stretched. Gaits are driven from the feet: a planted foot stays where it is while the body passes over it, legs
follow by two-bone inverse kinematics, the pelvis rides as high as the legs allow. The caller advances the phase by
distance / `stride_length`, so feet never slide.

Timing of the gait cycle (62 % stance when walking, heel rise from 35 %, toe-off near 60 %) after Perry and Burnfield,
*Gait Analysis*; stride by speed fitted to Grieve and Gear's relation.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vico.assets.people import JOINTS, PARENTS, Body, J
from vico.errors import InputError
from vico.render.skinning import forward_kinematics
from vico.sim.animation_clips import CLIPS, MANNER, animate

__all__ = ["CLIPS", "clip_index", "hand_frames", "hand_position", "pose", "stride_length", "style_of"]

_INDEX = {name: index for index, name in enumerate(CLIPS)}


def clip_index(name: str) -> int:
    """Return the number of a motion.

    Raises
    ------
    InputError
        If there is no motion of that name.
    """
    try:
        return _INDEX[name]
    except KeyError:
        raise InputError(f"animation: no motion {name!r}; known are {', '.join(CLIPS)}") from None


def stride_length(
    clip: NDArray[Any] | int, speed: NDArray[Any] | float, height: NDArray[Any] | float
) -> NDArray[np.float64]:
    """Return the metres one cycle (two steps, or a turn of the cranks) covers.

    Parameters
    ----------
    clip
        Motion numbers, shape ``(n,)``.
    speed
        Metres a second over the ground, shape ``(n,)``.
    height
        Stature, metres, shape ``(n,)``.

    Returns
    -------
    ndarray
        float64; infinite for motions that do not cover ground (their phase runs with time).
    """
    number, v, tall = np.broadcast_arrays(
        np.asarray(clip), np.asarray(speed, np.float64), np.asarray(height, np.float64)
    )
    stride = np.full(number.shape, np.inf)
    walking = (number == _INDEX["walk"]) | (number == _INDEX["carry"])
    stride[walking] = (0.727 * tall * np.maximum(v, 0.15) ** 0.45)[walking]
    running = number == _INDEX["run"]
    stride[running] = (tall * (0.62 + 0.20 * v))[running]
    stride[number == _INDEX["ride_bike"]] = 4.0
    return stride


def style_of(body: Body, generator: np.random.Generator | None = None, *, age: float = 35.0) -> NDArray[np.float32]:
    """Return what `pose` must know of somebody: their measures and their manner of moving.

    Parameters
    ----------
    body
        Measured for leg and arm lengths.
    generator
        Draws the manner (arm swing, step width, sway ...); None: everybody's average.
    age
        Years; the old stoop and swing less.

    Returns
    -------
    ndarray
        float32, shape ``(MANNER + 165,)``: opaque; stack one row a person.
    """
    draw = np.zeros(MANNER) if generator is None else np.clip(generator.standard_normal(MANNER), -2, 2)
    old = float(np.clip((age - 55) / 35, 0, 1))
    manner = np.zeros(MANNER, np.float32)
    manner[0] = (0.36 + 0.07 * draw[0]) * (1 - 0.35 * old)  # arm swing, radians
    manner[1] = 0.03 + 0.018 * draw[1] + 0.10 * old  # forward lean of the trunk, radians
    manner[2] = 0.75 + 0.12 * draw[2]  # distance of the feet, share of the hips'
    manner[3] = np.radians(9 + 2.5 * draw[3])  # arms off the body
    manner[4] = np.radians(6 + 3 * draw[4])  # toes out
    manner[5] = 0.018 + 0.005 * draw[5]  # sway to the planted foot, metres
    manner[6] = np.radians(5 + 1.5 * draw[6])  # hips' turn with the step
    manner[7] = np.radians(18 + 6 * draw[7])  # elbows' bend at rest
    manner[8] = 0.5 + 0.25 * draw[8]  # which foot bears the weight at rest, how the head is held
    manner[9] = old
    # Measured from the lowest vertices: how far the sole reaches behind the ankle and before it.
    feet = body.vertices[body.vertices[:, 2] < 0.03 * body.height]
    ankle = body.rest_joints[J["left_ankle"], 0]
    manner[10] = ankle - feet[:, 0].min() if len(feet) else 0.06 * body.height
    manner[11] = feet[:, 0].max() - ankle if len(feet) else 0.12 * body.height
    manner[12] = body.height
    return np.concatenate([manner, body.joints.astype(np.float32).ravel()])


def pose(
    clip: NDArray[Any], phase: NDArray[Any], speed: NDArray[Any], style: NDArray[Any]
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
        Rows of `style_of`, shape ``(n, k)``.

    Returns
    -------
    rotations
        Axis-angle relative to the parent joint, radians, float32, shape ``(n, 55, 3)``, T-pose = 0.
    offsets
        Shift of the pelvis from its place in the T-pose, body frame, metres, float32, shape ``(n, 3)``.
    """
    numbers = np.ascontiguousarray(clip, np.int64)
    rows = np.ascontiguousarray(style, np.float64)
    pace = np.ascontiguousarray(speed, np.float64)
    stride = stride_length(numbers, pace, rows[:, 12]) if len(rows) else np.zeros(0)
    rotations = np.zeros((len(numbers), len(JOINTS), 3), np.float32)
    offsets = np.zeros((len(numbers), 3), np.float32)
    animate(numbers, np.ascontiguousarray(phase, np.float64), pace, stride, rows, rotations, offsets)
    return rotations, offsets


def hand_frames(
    joints: NDArray[Any], rotations: NDArray[np.float32], offsets: NDArray[np.float32]
) -> NDArray[np.float64]:
    """Return where everybody's palms are, to attach what they hold.

    Parameters
    ----------
    joints
        `Crowd.joints`, shape ``(n, 55, 3)``.
    rotations, offsets
        Of `pose`.

    Returns
    -------
    ndarray
        Left and right palm to body frame, shape ``(n, 2, 4, 4)``; in the T-pose their axes are the body's.
    """
    frames = np.zeros((len(rotations), 2, 4, 4))
    wrists = np.array([J["left_wrist"], J["right_wrist"]], np.int64)
    knuckles = np.array([J["left_middle1"], J["right_middle1"]], np.int64)
    _hands(np.ascontiguousarray(joints, np.float64), rotations, offsets, PARENTS, wrists, knuckles, frames)
    return frames


def hand_position(
    rotations: NDArray[np.float32], offset: NDArray[np.float32], body: Body, hand: int
) -> NDArray[np.float64]:
    """Return the middle of one person's palm, body frame, metres, shape ``(3,)``; hand 0 is the left."""
    return hand_frames(body.joints[None], rotations[None], offset[None])[0, hand, :3, 3]


@njit(cache=True)
def _hands(
    joints: NDArray[Any],
    rotations: NDArray[Any],
    offsets: NDArray[Any],
    parents: NDArray[Any],
    wrists: NDArray[Any],
    knuckles: NDArray[Any],
    frames: NDArray[Any],
) -> None:
    turned = np.empty((len(parents), 3, 3))
    placed = np.empty((len(parents), 3))
    for i in range(len(rotations)):
        forward_kinematics(rotations[i], joints[i], parents, offsets[i], turned, placed)
        for hand in range(2):
            wrist = wrists[hand]
            for r in range(3):
                for c in range(3):
                    frames[i, hand, r, c] = turned[wrist, r, c]
                # The palm's hollow lies a little below the line from wrist to knuckle.
                middle = 0.3 * placed[wrist, r] + 0.7 * placed[knuckles[hand], r]
                frames[i, hand, r, 3] = middle - 0.025 * turned[wrist, r, 2]
            frames[i, hand, 3, 3] = 1.0
