"""Masses, places and inertias of H1's links, as Unitree publishes them (BSD-3-Clause, https://github.com/unitreerobotics).

The left side's are given; the right one is its mirror image.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SIDES = ("left", "right")


class Inertia(NamedTuple):
    """Mass, kg, its middle, metres, the axes of its inertia as w, x, y, z, and that about them, kg m^2."""

    mass: float
    middle: tuple[float, float, float]
    axes: tuple[float, float, float, float]
    moments: tuple[float, float, float]


class Link(NamedTuple):
    """A link of the left side: its name, where it is in the one before it (metres; w, x, y, z), and its inertia."""

    name: str
    place: tuple[float, float, float]
    turned: tuple[float, float, float, float]
    inertia: Inertia


_LEVEL = (1.0, 0.0, 0.0, 0.0)
_PELVIS = Inertia(
    5.39, (-0.0002, 4e-05, -0.04522), (0.498303, 0.499454, -0.500496, 0.501741), (0.0490211, 0.0445821, 0.00824619)
)
_TORSO = Inertia(
    17.789,
    (0.000489, 0.002797, 0.20484),
    (0.999989, -0.00130808, -0.00282289, -0.00349105),
    (0.487315, 0.409628, 0.127837),
)
LEG = (
    Link(
        "hip_yaw",
        (0.0, 0.0875, -0.1742),
        _LEVEL,
        Inertia(
            2.244,
            (-0.04923, 0.0001, 0.0072),
            (0.69699, 0.219193, 0.233287, 0.641667),
            (0.00304494, 0.00296885, 0.00189201),
        ),
    ),
    Link(
        "hip_roll",
        (0.039468, 0.0, 0.0),
        _LEVEL,
        Inertia(
            2.232,
            (-0.0058, -0.00319, -9e-05),
            (0.0438242, 0.70721, -0.0729075, 0.701867),
            (0.00243264, 0.00225325, 0.00205492),
        ),
    ),
    Link(
        "hip_pitch",
        (0.0, 0.11536, 0.0),
        _LEVEL,
        Inertia(
            4.152,
            (0.00746, -0.02346, -0.08193),
            (0.979828, 0.0513522, -0.0169854, -0.192382),
            (0.0829503, 0.0821457, 0.00510909),
        ),
    ),
    Link(
        "knee",
        (0.0, 0.0, -0.4),
        _LEVEL,
        Inertia(
            1.721,
            (-0.00136, -0.00512, -0.1384),
            (0.626132, -0.034227, -0.0416277, 0.777852),
            (0.0125237, 0.0123104, 0.0019428),
        ),
    ),
    Link(
        "ankle",
        (0.0, 0.0, -0.4),
        _LEVEL,
        Inertia(
            0.446,
            (0.06722, 0.00015, -0.04497),
            (0.489101, 0.503197, 0.565782, 0.432972),
            (0.00220848, 0.00218961, 0.000214202),
        ),
    ),
)
ARM = (
    Link(
        "shoulder_pitch",
        (0.0055, 0.15535, 0.42999),
        (0.976296, 0.216438, 0.0, 0.0),
        Inertia(
            1.033,
            (0.005045, 0.053657, -0.015715),
            (0.814858, 0.579236, -0.0201072, -0.00936488),
            (0.00129936, 0.000987113, 0.000858198),
        ),
    ),
    Link(
        "shoulder_roll",
        (-0.0055, 0.0565, -0.0165),
        (0.976296, -0.216438, 0.0, 0.0),
        Inertia(
            0.793,
            (0.000679, 0.00115, -0.094076),
            (0.732491, 0.00917179, 0.0766656, 0.676384),
            (0.00170388, 0.00158256, 0.00100336),
        ),
    ),
    Link(
        "shoulder_yaw",
        (0.0, 0.0, -0.1343),
        _LEVEL,
        Inertia(
            0.839,
            (0.01365, 0.002767, -0.16266),
            (0.703042, -0.0331229, -0.0473362, 0.708798),
            (0.00408038, 0.00370367, 0.000622687),
        ),
    ),
    Link(
        "elbow",
        (0.0185, 0.0, -0.198),
        _LEVEL,
        Inertia(
            0.669,
            (0.15908, -0.000144, -0.015776),
            (0.0765232, 0.720327, 0.0853116, 0.684102),
            (0.00601829, 0.00600579, 0.000408305),
        ),
    ),
)
#: Angles the arms are held at, rad: shoulder pitch, roll (outwards) and yaw, elbow.
ARM_POSE = (0.1, 0.08, 0.0, 1.0)
_ARM_AXES = ((0, 1, 0), (1, 0, 0), (0, 0, 1), (0, 1, 0))


def matrix_of(quaternion: tuple[float, float, float, float]) -> Array:
    """Rotation matrix of w, x, y, z, of any length."""
    w, x, y, z = np.array(quaternion) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _turn(axis: tuple[int, int, int], angle: float) -> Array:
    half = np.sin(angle / 2)
    return matrix_of((float(np.cos(angle / 2)), axis[0] * half, axis[1] * half, axis[2] * half))


_MIRROR = np.diag([1.0, -1.0, 1.0])


def arm_places() -> dict[str, Array]:
    """Poses of the arms' links in the frame of the base, as they are held; shape ``(4, 4)`` each."""
    found = {}
    pose = np.eye(4)
    for link, axis, angle in zip(ARM, _ARM_AXES, ARM_POSE, strict=True):
        step = np.eye(4)
        step[:3, :3], step[:3, 3] = matrix_of(link.turned) @ _turn(axis, angle), link.place
        pose = pose @ step
        found[f"left_{link.name}"] = pose.copy()
        mirrored = pose.copy()
        mirrored[:3, :3], mirrored[1, 3] = _MIRROR @ pose[:3, :3] @ _MIRROR, -pose[1, 3]
        found[f"right_{link.name}"] = mirrored
    return found


def tensor_of(inertia: Inertia, side: str) -> tuple[Array, Array]:
    """Return the middle, and the inertia tensor about it, in the frame of its link."""
    axes = matrix_of(inertia.axes)
    tensor, middle = axes @ np.diag(inertia.moments) @ axes.T, np.array(inertia.middle)
    return (middle, tensor) if side == "left" else (_MIRROR @ middle, _MIRROR @ tensor @ _MIRROR)


def upper_body() -> str:
    """Return the `inertial` element of pelvis, torso and arms as one body."""
    parts = [(one.mass, *tensor_of(one, "left")) for one in (_PELVIS, _TORSO)]
    places = arm_places()
    for side in SIDES:
        for link in ARM:
            middle, tensor = tensor_of(link.inertia, side)
            r, p = places[f"{side}_{link.name}"][:3, :3], places[f"{side}_{link.name}"][:3, 3]
            parts.append((link.inertia.mass, r @ middle + p, r @ tensor @ r.T))
    mass = sum(part[0] for part in parts)
    middle = sum((m * p for m, p, _ in parts), np.zeros(3)) / mass
    tensor = np.zeros((3, 3))
    for m, p, inner in parts:
        d = p - middle
        tensor += inner + m * (d @ d * np.eye(3) - np.outer(d, d))
    return inertial(mass, middle, tensor)


def inertial(mass: float, middle: Array, t: Array) -> str:
    """Return an `inertial` element of MJCF."""
    full = (t[0, 0], t[1, 1], t[2, 2], t[0, 1], t[0, 2], t[1, 2])
    pos, tensor = (" ".join(f"{v:.8g}" for v in values) for values in (middle, full))
    return f'<inertial mass="{mass}" pos="{pos}" fullinertia="{tensor}"/>'
