"""One person's motions as tables of joint rotations, from which a browser poses them at any phase and pace.

A gait's table has a row for each phase at each of some paces; other motions have one for each phase. Who stands and
waits has no cycle to speak of: their joints are a resting pose and what shifting the weight, turning the head and
nodding add to it (`vico.sim.animation.postures.restlessness`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.sim.animation import CLIPS, clip_index, pose
from vico.sim.animation.postures import restlessness

# Metres a second at which gaits are tabulated.
_WALKS, _RUNS = (0.3, 0.6, 1.0, 1.5, 2.2), (1.5, 2.5, 4.0)
_GAITS = {"run": _RUNS} | dict.fromkeys(("walk", "carry", "carry_left", "carry_right"), _WALKS)
# Motions of those who stand and wait, and at which place in their cycle they are looked at.
_RESTING = {"idle": 0.0, "stand": 0.0, "phone": 0.5}
_GAIT_PHASES, _PHASES = 32, 24
# Waves beat thrice a cycle, talk twice.
_FINE = {"wave": 48, "sit_wave": 48, "turn": 32, "open_door": 40}
_MOMENTS = 96  # at which a resting pose is looked at
_SHORT = 32767


def motion_tables(style: Any) -> tuple[list[dict[str, Any]], list[NDArray[Any]]]:
    """Tabulate all motions of a person.

    Parameters
    ----------
    style
        A `vico.sim.animation.STYLE` record.

    Returns
    -------
    list of dict
        Of each motion, in the order of `CLIPS`: ``name``, ``paces`` (empty for those without) and ``phases``, ``row``
        (its first row in the tables), or ``resting`` (its place among the resting poses).
    list of ndarray
        Joint rotations as quaternions x, y, z, w times 32767, int16, shape ``(rows, 55, 4)``; pelvis shifts, metres,
        float32, shape ``(rows, 3)``; and of resting poses the coefficients of 1, weight, turn of the head and nod for
        each joint's axis-angle and for the shift, float32, shape ``(resting, 4, 56, 3)``.
    """
    entries: list[dict[str, Any]] = []
    courses: list[tuple[int, float, float]] = []
    resting: list[NDArray[np.float64]] = []
    for name in CLIPS:
        clip = clip_index(name)
        if name in _RESTING:
            entries.append({"name": name, "resting": len(resting)})
            resting.append(_resting_pose(style, clip, _RESTING[name]))
            continue
        paces = _GAITS.get(name, ())
        phases = _FINE.get(name, _GAIT_PHASES if paces else _PHASES)
        entries.append({"name": name, "paces": list(paces), "phases": phases, "row": len(courses)})
        courses += [(clip, k / phases, pace) for pace in paces or (0.0,) for k in range(phases)]
    clips, places, speeds = (np.array(column) for column in zip(*courses, strict=True))
    rotations, offsets = pose(clips, places, speeds, np.repeat(style, len(courses)))
    return entries, [_quaternions(rotations), offsets, np.stack(resting).astype(np.float32)]


def _resting_pose(style: Any, clip: int, phase: float) -> NDArray[np.float64]:
    """Fit what shifting one's weight, turning one's head and nodding do to a pose; shape ``(4, 56, 3)``."""
    seconds = np.arange(_MOMENTS) * 3.7
    causes, poses = np.ones((_MOMENTS, 4)), np.empty((_MOMENTS, 56, 3))
    one = np.repeat(style, 1)
    for k, second in enumerate(seconds.tolist()):
        causes[k, 1:] = restlessness(second, float(style["asymmetry"]), float(style["rhythm"]))
        rotations, offsets = pose(np.array([clip]), np.array([phase]), np.zeros(1), one, second=second)
        poses[k, :55], poses[k, 55] = rotations[0], offsets[0]
    fitted, *_ = np.linalg.lstsq(causes, poses.reshape(_MOMENTS, -1), rcond=None)
    return np.asarray(fitted.reshape(4, 56, 3))


def _quaternions(rotations: NDArray[np.float32]) -> NDArray[np.int16]:
    angle = np.linalg.norm(rotations.astype(np.float64), axis=-1, keepdims=True)
    half = 0.5 * angle
    scale = np.where(angle > 1e-9, np.sin(half) / np.maximum(angle, 1e-9), 0.5)
    found = np.concatenate([rotations * scale, np.cos(half)], axis=-1)
    return np.round(found * _SHORT).astype(np.int16)
