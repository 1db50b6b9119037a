"""The motions there are, how far a cycle of each carries, and what tells one person's movements from another's.

Phases advance by the distance over the stride, so feet never slide.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.people import JOINTS, J, SkinnedBody
from vico.errors import InputError
from vico.exact import each
from vico.io.compiled import compiled

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
    "carry_left",
    "carry_right",
    "sit_talk",
    "sit_wave",
    "sit_drink",
    "sit_eat",
    "open_door",
    "phone",
)
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


IDLE, WALK, RUN, TURN, SIT, SLEEP, TALK, WAVE, PICK, PUT, REACH, DRINK, EAT, CARRY = range(14)
RIDE_BIKE, RIDE_BUS, STAND, ENTER_VEHICLE, EXIT_VEHICLE, CARRY_LEFT, CARRY_RIGHT = range(14, 21)
SIT_TALK, SIT_WAVE, SIT_DRINK, SIT_EAT = range(21, 25)
OPEN_DOOR, PHONE = 25, 26


#: Metres that a turn of a bicycle's cranks covers.
TURN_OF_CRANKS = 4.0
_STRIDE, _POWER = 0.727, 0.45  # of a walk at 1 m/s, in statures; how strides grow with speed
_SLOWEST = 0.15  # shorter strides than at this speed nobody takes, m/s


@compiled
def stride_of(clip, speed, height):
    """Return the metres one cycle of one motion covers; see `stride_length`."""
    if clip in (WALK, CARRY, CARRY_LEFT, CARRY_RIGHT):
        return _STRIDE * height * max(speed, _SLOWEST) ** _POWER
    if clip == RUN:
        return height * (0.62 + 0.20 * speed)
    return TURN_OF_CRANKS if clip == RIDE_BIKE else np.inf


@compiled
def pace_of_step(step, height):
    """Return the speed at which somebody's steps are so long on level ground, m/s."""
    return max((2.0 * step / (_STRIDE * height)) ** (1.0 / _POWER), _SLOWEST)


def pace_on(treads: NDArray[np.float64], pace: NDArray[np.float64], height: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the speed that strides are those of, m/s: of a tread a step where treads are so deep, else `pace`."""
    on_treads = each(math.pow, np.maximum(2.0 * treads / (_STRIDE * height), 0.0), 1.0 / _POWER)
    return np.where(treads > 0.0, np.maximum(on_treads, _SLOWEST), pace)


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

    Notes
    -----
    Fitted to Grieve and Gear's relation of stride and speed.
    """
    number, v, tall = np.broadcast_arrays(
        np.asarray(clip, np.int64), np.asarray(speed, np.float64), np.asarray(height, np.float64)
    )
    found = np.empty(number.shape)
    _strides(number.flatten(), v.flatten(), tall.flatten(), found.reshape(-1))
    return found


@compiled
def _strides(clip, speed, height, found):
    for k in range(len(found)):
        found[k] = stride_of(clip[k], speed[k], height[k])


#: Pitches of a foot, toes down, at which `sole_depth` is measured, radians. Toes that would reach into the ground bend.
SOLE_PITCHES = np.linspace(-0.5, 1.0, 31)


def _style(real: type[np.floating[Any]]) -> np.dtype[np.void]:
    return np.dtype(
        [
            ("arm_swing", real),  # radians to each side
            ("trunk_lean", real),  # forward, radians
            ("foot_spread", real),  # distance of the feet, share of the hips'
            ("arm_abduction", real),  # of the arms off the body, radians
            ("toe_out", real),  # radians
            ("sway", real),  # to the planted foot, metres
            ("hip_turn", real),  # with the step, radians
            ("elbow_bend", real),  # at rest, radians
            ("asymmetry", real),  # which foot bears the weight at rest, how the head is held; 0..1
            ("rhythm", real),  # when weight is shifted and where the eyes go, of people who stand and wait; 0..1
            ("age_share", real),  # 0 up to 55 years, 1 from 90; the old stoop
            ("heel_length", real),  # how far the sole reaches behind the ankle, metres
            ("toe_length", real),  # ... and before it
            ("sole_depth", real, (2, len(SOLE_PITCHES))),  # below the ankle, of a foot so pitched, metres
            ("sole_roll", real, (2, len(SOLE_PITCHES))),  # how far the ankle goes ahead while the sole rolls so, metres
            ("height", real),  # stature, metres
            ("joints", real, (len(JOINTS), 3)),  # T-pose, body frame (x forward, y left, z up), metres
        ],
        align=True,
    )


STYLE = _style(np.float32)
# What kernels compute with.
KERNEL_STYLE = _style(np.float64)
# Numbers drawn for a person's manner; more than are used, so that another trait leaves later draws as they are.
_DRAWS = 16
_DRAWN = (
    "arm_swing",
    "trunk_lean",
    "foot_spread",
    "arm_abduction",
    "toe_out",
    "sway",
    "hip_turn",
    "elbow_bend",
    "asymmetry",
    "rhythm",
)


def style_of(body: SkinnedBody, generator: np.random.Generator | None = None, *, age: float = 35.0) -> Any:
    """Return what `pose` must know of somebody: measures and manner of moving.

    Parameters
    ----------
    body
        Measured for leg and arm lengths.
    generator
        Draws the manner (arm swing, step width, sway ...); None: the average of all.
    age
        Years; the old stoop and swing less.

    Returns
    -------
    numpy.void
        A `STYLE` record; stack one a person.
    """
    numbers = np.zeros(_DRAWS) if generator is None else np.clip(generator.standard_normal(_DRAWS), -2, 2)
    draw = dict(zip(_DRAWN, numbers, strict=False))
    old = float(np.clip((age - 55) / 35, 0, 1))
    style = np.zeros(1, STYLE)[0]
    style["arm_swing"] = (0.36 + 0.11 * draw["arm_swing"]) * (1 - 0.35 * old)
    style["trunk_lean"] = 0.03 + 0.03 * draw["trunk_lean"] + 0.10 * old
    style["foot_spread"] = 0.75 + 0.12 * draw["foot_spread"]
    style["arm_abduction"] = np.radians(10 + 3.5 * draw["arm_abduction"])
    style["toe_out"] = np.radians(6 + 3 * draw["toe_out"])
    style["sway"] = 0.018 + 0.005 * draw["sway"]
    style["hip_turn"] = np.radians(5 + 2 * draw["hip_turn"])
    style["elbow_bend"] = np.radians(20 + 9 * draw["elbow_bend"])
    style["asymmetry"] = 0.5 + 0.25 * draw["asymmetry"]
    style["rhythm"] = (0.5 + 0.37 * draw["rhythm"]) % 1.0
    style["age_share"] = old
    for k, side in enumerate(("left", "right")):
        style["sole_depth"][k], style["sole_roll"][k] = _sole(body, side)
    # Measured from the lowest vertices: how far the sole reaches behind the ankle and before it.
    feet = body.vertices[body.vertices[:, 2] < 0.03 * body.height]
    ankle = body.rest_joints[J["left_ankle"], 0]
    style["heel_length"] = ankle - feet[:, 0].min() if len(feet) else 0.06 * body.height
    style["toe_length"] = feet[:, 0].max() - ankle if len(feet) else 0.12 * body.height
    style["height"] = body.height
    style["joints"] = body.joints
    return style


def _sole(body: SkinnedBody, side: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return `sole_depth` and `sole_roll` of a foot.

    The skin of a foot that bends is no wheel and no hinge: the sole's own points say where the ankle has to be for the
    lowest of them to rest on the ground.
    """
    ankle, foot = J[f"{side}_ankle"], J[f"{side}_foot"]
    own = np.flatnonzero((body.weight_joints[:, 0] == ankle) | (body.weight_joints[:, 0] == foot))
    own = own[body.vertices[own, 2] < 0.05 * body.height]
    if not len(own):
        return np.full(len(SOLE_PITCHES), body.joints[ankle, 2]), np.zeros(len(SOLE_PITCHES))
    # Each vertex as each of its joints would have it at rest; then those of ankle and toes turn.
    joints = body.weight_joints[own]
    away = body.vertices[own][:, None] - body.rest_joints[joints]
    placed = np.einsum("vkrc,vkc->vkr", body.frames[joints], away) + body.joints[joints]
    x, z = (placed[:, :, axis] - body.joints[ankle, axis] for axis in (0, 2))
    ball_x, ball_z = (body.joints[foot, axis] - body.joints[ankle, axis] for axis in (0, 2))
    shares = [body.weights[own] * (joints == joint) for joint in (ankle, foot)]
    shares.append(body.weights[own] - shares[0] - shares[1])
    (heel_x, toes_x, still_x), (heel_z, toes_z, still_z) = (
        [(share * axis).sum(axis=1) for share in shares] for axis in (x, z)
    )
    s, c = np.sin(SOLE_PITCHES)[:, None], np.cos(SOLE_PITCHES)[:, None]
    # Toes bend as much as the foot is pitched down: they stay level before the joint that bends.
    level, toes = (SOLE_PITCHES > 0)[:, None], shares[1].sum(axis=1)
    level_x, level_z = (c * ball_x + s * ball_z - ball_x) * toes, (c * ball_z - s * ball_x - ball_z) * toes
    sole = np.empty((len(SOLE_PITCHES), 2, len(own)))
    sole[:, 0] = c * heel_x + s * heel_z + still_x + np.where(level, toes_x + level_x, c * toes_x + s * toes_z)
    sole[:, 1] = c * heel_z - s * heel_x + still_z + np.where(level, toes_z + level_z, c * toes_z - s * toes_x)
    bearing = (sole[1:, 1] + sole[:-1, 1]).argmin(axis=1)
    steps = np.arange(len(bearing))
    roll = np.concatenate([[0.0], np.cumsum(sole[steps, 0, bearing] - sole[steps + 1, 0, bearing])])
    return -sole[:, 1].min(axis=1), roll - roll[np.abs(SOLE_PITCHES).argmin()]
