"""What our own model of H1 looks like: a slim torso, a round head, cylinders for motors."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from vico.assets.shapes import ball, box, cylinder, extrusion, tube
from vico.world.mesh import Surface, merge_surfaces

_BLACK, _DARK, _GREY, _LIGHT = (40, 41, 45), (66, 69, 74), (112, 116, 122), (226, 230, 234)


def _motor(radius: float, length: float, centre: tuple[float, float, float], axis: str) -> Surface:
    """Return a cylinder around `centre` along an axis."""
    turns = {
        "x": [[0, 0, 1], [0, 1, 0], [-1, 0, 0]],
        "y": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
        "z": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    }
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turns[axis], centre
    return cylinder(radius, length, sides=20, colour=_DARK, centre=(0, 0, -length / 2)).moved(matrix)


def _torso() -> list[Surface]:
    front = [(-0.07, 0.04), (0.05, 0.03), (0.075, 0.12), (0.09, 0.40), (0.07, 0.48), (-0.06, 0.48), (-0.085, 0.40)]
    side = [(-0.055, 0.06), (0.06, 0.06), (0.075, 0.40), (-0.075, 0.40)]
    return [
        extrusion(front, 0.20, colour=_BLACK),
        extrusion(side, 0.27, colour=_DARK),
        box((0.004, 0.11, 0.03), (0.084, 0, 0.33), colour=_LIGHT),  # the maker's sign
        cylinder(0.045, 0.1, sides=16, colour=_GREY, centre=(0.01, 0, 0.47)),  # neck
        ball((0.072, 0.066, 0.095), (0.04, 0, 0.655), colour=_BLACK, sides=18, rings=12),
        box((0.03, 0.09, 0.028), (0.098, 0.0, 0.69), colour=_GREY),  # camera
        _motor(0.055, 0.05, (0.05, 0, 0.62), "y"),
        cylinder(0.03, 0.03, sides=14, colour=_LIGHT, centre=(0.045, 0, 0.735)),  # lidar
        _motor(0.07, 0.08, (0, 0, 0.02), "z"),
        _motor(0.062, 0.31, (0.0, 0.0, 0.43), "y"),  # shoulders
    ]


def _arm(pose: Mapping[str, NDArray[np.float64]], side: str) -> list[Surface]:
    s = 1.0 if side == "left" else -1.0
    shoulder = [_motor(0.046, 0.09, (0, s * 0.055, -0.01), "y")]
    roll = [_motor(0.046, 0.085, (0, 0, -0.0), "x"), tube((0, 0, 0), (0, 0, -0.13), 0.036, _BLACK, sides=14)]
    upper = [tube((0, 0, 0), (0.015, 0, -0.2), 0.033, _BLACK, sides=14), _motor(0.04, 0.07, (0.018, 0, -0.198), "y")]
    fore = [
        tube((0, 0, 0), (0.25, 0, -0.014), 0.034, _BLACK, sides=14, tip=0.026),
        ball((0.04, 0.032, 0.032), (0.27, 0, -0.015), colour=_GREY, sides=14, rings=8),
    ]
    parts = {"shoulder_pitch": shoulder, "shoulder_roll": roll, "shoulder_yaw": upper, "elbow": fore}
    return [one.moved(pose[f"{side}_{link}"]) for link, shapes in parts.items() for one in shapes]


def _leg(s: float) -> dict[str, list[Surface]]:
    thigh = [(-0.055, 0.03), (-0.05, -0.2), (-0.04, -0.36), (0.03, -0.38), (0.05, -0.2), (0.06, 0.03)]
    shin = [(-0.035, 0.0), (-0.042, -0.12), (-0.022, -0.36), (0.02, -0.38), (0.036, -0.12), (0.035, 0.0)]
    foot = [
        (-0.06, -0.07),
        (0.165, -0.07),
        (0.175, -0.055),
        (0.12, -0.035),
        (0.03, -0.005),
        (-0.03, -0.005),
        (-0.062, -0.04),
    ]
    return {
        "hip_yaw": [_motor(0.06, 0.09, (0.0, 0, 0.02), "z"), box((0.09, 0.08, 0.06), (-0.04, 0, 0.0), colour=_BLACK)],
        "hip_roll": [_motor(0.056, 0.10, (-0.01, 0, 0), "x"), box((0.07, 0.09, 0.07), (0, s * 0.03, 0), colour=_BLACK)],
        "hip_pitch": [
            _motor(0.06, 0.12, (0, -s * 0.02, 0), "y"),
            extrusion(thigh, 0.085, colour=_BLACK),
            _motor(0.056, 0.10, (0, 0, -0.4), "y"),
        ],
        "knee": [extrusion(shin, 0.06, colour=_DARK), _motor(0.036, 0.06, (0, 0, -0.4), "y")],
        "ankle": [extrusion(foot, 0.08, colour=_BLACK)],
    }


def own_shapes(arms: Mapping[str, NDArray[np.float64]]) -> dict[str, list[Surface]]:
    """Return surfaces by link; `arms` are the poses of the arms' links in the frame of the base."""
    base = [_motor(0.07, 0.26, (0.0, 0, -0.03), "y"), box((0.12, 0.2, 0.07), (0, 0, -0.045), colour=_BLACK), *_torso()]
    for s in (1.0, -1.0):
        base.append(_motor(0.066, 0.08, (0.0, s * 0.0875, -0.10), "z"))
        base += _arm(arms, "left" if s > 0 else "right")
    shapes = {"base": merge_surfaces(base)}
    for side, s in (("left", 1.0), ("right", -1.0)):
        shapes |= {f"{side}_{link}": merge_surfaces(parts) for link, parts in _leg(s).items()}
    return shapes
