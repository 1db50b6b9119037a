"""Reach: bring the open jaw round a box.

Task: the middle between the pads is where they can close on the box.

Randomizations: sides of the box (0.05 to 0.25 m each), mass (0.1 to 2 kg), friction (0.6 to 1); it stands on the
ground or on a table 0.15 to 0.5 m high, 0.54 to 0.7 m from the middle of the base and up to 0.45 rad off ahead, turned
anyhow; the arm's first angles, by 0.05 rad.

Success: the hand is within 0.04 m of the grasp point, points down within 0.35 rad, the jaw is square to the box within
0.26 rad and wider than it, and the box is within 0.05 m of where it stood.
"""

from __future__ import annotations

import math

import numpy as np

from vico.challenges.learning.manipulation.draws import standing_box
from vico.challenges.learning.manipulation.readings import Bools, Readings
from vico.challenges.learning.manipulation.rewards import approach
from vico.challenges.learning.manipulation.tasks import ManipulationTask

_NEAR, _TILT, _TURN, _MOVED = 0.04, 0.35, 0.26, 0.05


def evaluate(r: Readings) -> dict[str, Bools]:
    """Say what of the rule holds."""
    near = np.linalg.norm(r.grasp_point - r.hand, axis=1) < _NEAR
    aligned = (r.pointing > math.cos(_TILT)) & (r.squareness > math.cos(_TURN))
    is_open = r.gap > 0.0
    unmoved = np.linalg.norm(r.thing - r.start, axis=1) < _MOVED
    found = {"near": near, "aligned": aligned, "open": is_open, "unmoved": unmoved}
    return {**found, "success": near & aligned & is_open & unmoved}


REACH = ManipulationTask("reach", standing_box, evaluate, approach, ("object",))
