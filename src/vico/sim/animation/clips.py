"""Which motion somebody makes, for everybody in one call. Compiled; called through `vico.sim.animation.pose`."""

from __future__ import annotations

from typing import Any

import numpy as np

from vico.io.compiled import compiled
from vico.sim.animation.gait import run, walk
from vico.sim.animation.limbs import BodyPose, curl_fingers
from vico.sim.animation.names import (
    CARRY,
    ENTER_VEHICLE,
    EXIT_VEHICLE,
    RIDE_BIKE,
    RIDE_BUS,
    RUN,
    SIT,
    SLEEP,
    WALK,
)
from vico.sim.animation.rotations import Array, axis_angle
from vico.sim.animation.seated import ride_bike, sit, sleep, step_up
from vico.sim.animation.standing import stand


@compiled
def animate(clips: Array, phase: Array, stride: Array, style: Array, rotations: Array, offsets: Array) -> None:
    """Write everybody's joint rotations and pelvis shifts; see `vico.sim.animation.pose`."""
    for i in range(len(clips)):
        joints = style[i].joints
        local = np.zeros((len(joints), 3, 3))
        for j in range(len(joints)):
            local[j, 0, 0] = local[j, 1, 1] = local[j, 2, 2] = 1.0
        body = BodyPose(local, np.zeros(3), joints, style[i])
        for side in range(2):
            curl_fingers(body, side, 0.38, 0.2)
        _move(body, clips[i], phase[i] - np.floor(phase[i]), stride[i])
        for j in range(len(joints)):
            axis_angle(local[j], rotations[i, j])
        for r in range(3):
            offsets[i, r] = body.shift[r]


@compiled
def _move(body: Any, clip: int, p: float, stride: float) -> None:
    if clip in (WALK, CARRY):
        walk(body, p, stride, clip == CARRY)
    elif clip == RUN:
        run(body, p, stride)
    elif clip == SLEEP:
        sleep(body, p)
    elif clip == RIDE_BIKE:
        ride_bike(body, p)
    elif clip in (SIT, RIDE_BUS):
        sit(body, p)
    elif clip in (ENTER_VEHICLE, EXIT_VEHICLE):
        step_up(body, p)
    else:
        stand(body, p, clip)
