"""What tells one person's movements from another's."""

from __future__ import annotations

from typing import Any

import numpy as np

from vico.assets.people import JOINTS, J, SkinnedBody


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
            ("age_share", real),  # 0 up to 55 years, 1 from 90; the old stoop
            ("heel_length", real),  # how far the sole reaches behind the ankle, metres
            ("toe_length", real),  # ... and before it
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
    style["arm_swing"] = (0.36 + 0.07 * draw["arm_swing"]) * (1 - 0.35 * old)
    style["trunk_lean"] = 0.03 + 0.018 * draw["trunk_lean"] + 0.10 * old
    style["foot_spread"] = 0.75 + 0.12 * draw["foot_spread"]
    style["arm_abduction"] = np.radians(9 + 2.5 * draw["arm_abduction"])
    style["toe_out"] = np.radians(6 + 3 * draw["toe_out"])
    style["sway"] = 0.018 + 0.005 * draw["sway"]
    style["hip_turn"] = np.radians(5 + 1.5 * draw["hip_turn"])
    style["elbow_bend"] = np.radians(18 + 6 * draw["elbow_bend"])
    style["asymmetry"] = 0.5 + 0.25 * draw["asymmetry"]
    style["age_share"] = old
    # Measured from the lowest vertices: how far the sole reaches behind the ankle and before it.
    feet = body.vertices[body.vertices[:, 2] < 0.03 * body.height]
    ankle = body.rest_joints[J["left_ankle"], 0]
    style["heel_length"] = ankle - feet[:, 0].min() if len(feet) else 0.06 * body.height
    style["toe_length"] = feet[:, 0].max() - ankle if len(feet) else 0.12 * body.height
    style["height"] = body.height
    style["joints"] = body.joints
    return style
