"""H1, a humanoid on two legs with five motors each: links, joints, and our own shapes.

Masses, places, inertias, joints and their limits are those of Unitree's public description (BSD-3-Clause,
https://github.com/unitreerobotics; as MuJoCo Menagerie has it). The left side's are given; the right one is its mirror
image. Torso and arms are held as stiff as they would be by their servos: they are one body with the pelvis. Our own
model is a slim torso, a round head, and cylinders for motors. With the package that ships them, Unitree's meshes are
drawn instead; physics is the same with and without.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots.model import (
    BUMP,
    BUMPER,
    FOOT_CONTACT,
    LIMB,
    TOUCH,
    ActionSpace,
    BatteryModel,
    RobotModel,
    Sensors,
    TwoLegs,
    velocity_space,
)
from vico.assets.robots.packs import h1_shapes
from vico.assets.shapes import ball, box, cylinder, extrusion, tube
from vico.io.arrays import read_npz
from vico.world.mesh import Surface, merge_surfaces

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


_BLACK, _DARK, _GREY, _LIGHT = (40, 41, 45), (66, 69, 74), (112, 116, 122), (226, 230, 234)


def _motor_surface(radius: float, length: float, centre: tuple[float, float, float], axis: str) -> Surface:
    """Return a cylinder around `centre` along an axis."""
    turns = {
        "x": [[0, 0, 1], [0, 1, 0], [-1, 0, 0]],
        "y": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
        "z": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    }
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turns[axis], centre
    return cylinder(radius, length, sides=20, colour=_DARK, centre=(0, 0, -length / 2)).moved(matrix)


def _torso_surfaces() -> list[Surface]:
    front = [(-0.07, 0.04), (0.05, 0.03), (0.075, 0.12), (0.09, 0.40), (0.07, 0.48), (-0.06, 0.48), (-0.085, 0.40)]
    side = [(-0.055, 0.06), (0.06, 0.06), (0.075, 0.40), (-0.075, 0.40)]
    return [
        extrusion(front, 0.20, colour=_BLACK),
        extrusion(side, 0.27, colour=_DARK),
        box((0.004, 0.11, 0.03), (0.084, 0, 0.33), colour=_LIGHT),  # the maker's sign
        cylinder(0.045, 0.1, sides=16, colour=_GREY, centre=(0.01, 0, 0.47)),  # neck
        ball((0.072, 0.066, 0.095), (0.04, 0, 0.655), colour=_BLACK, sides=18, rings=12),
        box((0.03, 0.09, 0.028), (0.098, 0.0, 0.69), colour=_GREY),  # camera
        _motor_surface(0.055, 0.05, (0.05, 0, 0.62), "y"),
        cylinder(0.03, 0.03, sides=14, colour=_LIGHT, centre=(0.045, 0, 0.735)),  # lidar
        _motor_surface(0.07, 0.08, (0, 0, 0.02), "z"),
        _motor_surface(0.062, 0.31, (0.0, 0.0, 0.43), "y"),  # shoulders
    ]


def _arm_surfaces(pose: Mapping[str, NDArray[np.float64]], side: str) -> list[Surface]:
    s = 1.0 if side == "left" else -1.0
    shoulder = [_motor_surface(0.046, 0.09, (0, s * 0.055, -0.01), "y")]
    roll = [_motor_surface(0.046, 0.085, (0, 0, -0.0), "x"), tube((0, 0, 0), (0, 0, -0.13), 0.036, _BLACK, sides=14)]
    upper = [
        tube((0, 0, 0), (0.015, 0, -0.2), 0.033, _BLACK, sides=14),
        _motor_surface(0.04, 0.07, (0.018, 0, -0.198), "y"),
    ]
    fore = [
        tube((0, 0, 0), (0.25, 0, -0.014), 0.034, _BLACK, sides=14, tip=0.026),
        ball((0.04, 0.032, 0.032), (0.27, 0, -0.015), colour=_GREY, sides=14, rings=8),
    ]
    parts = {"shoulder_pitch": shoulder, "shoulder_roll": roll, "shoulder_yaw": upper, "elbow": fore}
    return [one.moved(pose[f"{side}_{link}"]) for link, shapes in parts.items() for one in shapes]


def _leg_surfaces(s: float) -> dict[str, list[Surface]]:
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
        "hip_yaw": [
            _motor_surface(0.06, 0.09, (0.0, 0, 0.02), "z"),
            box((0.09, 0.08, 0.06), (-0.04, 0, 0.0), colour=_BLACK),
        ],
        "hip_roll": [
            _motor_surface(0.056, 0.10, (-0.01, 0, 0), "x"),
            box((0.07, 0.09, 0.07), (0, s * 0.03, 0), colour=_BLACK),
        ],
        "hip_pitch": [
            _motor_surface(0.06, 0.12, (0, -s * 0.02, 0), "y"),
            extrusion(thigh, 0.085, colour=_BLACK),
            _motor_surface(0.056, 0.10, (0, 0, -0.4), "y"),
        ],
        "knee": [extrusion(shin, 0.06, colour=_DARK), _motor_surface(0.036, 0.06, (0, 0, -0.4), "y")],
        "ankle": [extrusion(foot, 0.08, colour=_BLACK)],
    }


def own_shapes(arms: Mapping[str, NDArray[np.float64]]) -> dict[str, list[Surface]]:
    """Return surfaces by link; `arms` are the poses of the arms' links in the frame of the base."""
    base = [
        _motor_surface(0.07, 0.26, (0.0, 0, -0.03), "y"),
        box((0.12, 0.2, 0.07), (0, 0, -0.045), colour=_BLACK),
        *_torso_surfaces(),
    ]
    for s in (1.0, -1.0):
        base.append(_motor_surface(0.066, 0.08, (0.0, s * 0.0875, -0.10), "z"))
        base += _arm_surfaces(arms, "left" if s > 0 else "right")
    shapes = {"base": merge_surfaces(base)}
    for side, s in (("left", 1.0), ("right", -1.0)):
        shapes |= {f"{side}_{link}": merge_surfaces(parts) for link, parts in _leg_surfaces(s).items()}
    return shapes


PARTS = ("hip_yaw", "hip_roll", "hip_pitch", "knee", "ankle")
JOINTS = tuple(f"{side}_{part}" for side in SIDES for part in PARTS)
#: Angles of a leg at rest, rad, in the order of `PARTS`.
REST = np.array([0.0, 0.0, -0.18, 0.5, -0.32])
# Of a leg, metres.
THIGH = 0.4
SHIN = 0.4
SOLE = 0.07
STAND = 0.1742 + (THIGH + SHIN) * float(np.cos(0.25)) + SOLE
# Of the outline, metres.
HALF_LENGTH = 0.26
HALF_WIDTH = 0.32
HEIGHT = 1.8
MASS = 51.4
#: 864 Wh (data sheet); what computer and motors take at rest is an estimate of ours.
BATTERY = BatteryModel(capacity=864.0 * 3600.0, idle_power=120.0, holding=0.03)
#: Seconds of two steps, as the network was trained.
STRIDE = 0.76
#: Site where it is pushed, and lifted after a fall.
CHEST = "chest"
#: Of the left leg's joints, rad; yaw and roll of the right are mirrored.
LIMITS = {
    "hip_yaw": (-0.43, 0.43),
    "hip_roll": (-0.43, 0.43),
    "hip_pitch": (-1.57, 1.57),
    "knee": (-0.26, 2.05),
    "ankle": (-0.87, 0.52),
}
TORQUE = {"hip_yaw": 200.0, "hip_roll": 200.0, "hip_pitch": 200.0, "knee": 300.0, "ankle": 40.0}
#: Stiffness and damping of the servos, Nm/rad and Nms/rad.
GAINS = {
    "hip_yaw": (150.0, 3.0),
    "hip_roll": (200.0, 4.0),
    "hip_pitch": (200.0, 4.0),
    "knee": (250.0, 5.0),
    "ankle": (60.0, 2.0),
}
# Of the camera in the head, in the frame of the base; it looks down.
_EYE, _EYE_PITCH = (0.1085, 0.0175, 0.6932), -0.887
_AXES = {"hip_yaw": "0 0 1", "hip_roll": "1 0 0", "hip_pitch": "0 1 0", "knee": "0 1 0", "ankle": "0 1 0"}


_TOUCHES = f'contype="{TOUCH}" conaffinity="{TOUCH}"'
_LIMB = f'contype="{LIMB}" conaffinity="0"'


def _collision_shapes(part: str, s: int) -> str:
    """Collision shapes of a leg's link; `s` is 1 on the left, -1 on the right."""
    if part == "hip_pitch":
        return f'<geom type="capsule" size="0.055" fromto="0 0 -0.02 0 0 -0.34" {_LIMB}/>'
    if part == "knee":
        return f'<geom type="capsule" size="0.04" fromto="0 0 0 0 0 -0.33" {_TOUCHES}/>'
    if part != "ankle":
        return ""
    contact = f'solref="{FOOT_CONTACT[0]}" solimp="{FOOT_CONTACT[1]}" priority="1" condim="3" friction="0.8 0.02 0.01"'
    return "".join(
        f'<geom type="sphere" size="0.02" pos="{x} {y} {0.02 - SOLE}" {contact} {_TOUCHES}/>'
        for x in (-0.045, 0.155)
        for y in (-0.02, 0.02)
    )


def _leg_mjcf(side: str) -> str:
    s, inner = (1 if side == "left" else -1), ""
    for link in reversed(LEG):
        x, y, z = link.place
        limits = limit_of(f"{side}_{link.name}")
        middle, tensor = tensor_of(link.inertia, side)
        inner = (
            f'<body name="{side}_{link.name}" pos="{x} {s * y} {z}">'
            f"{inertial(link.inertia.mass, middle, tensor)}"
            f'<joint name="{side}_{link.name}" axis="{_AXES[link.name]}" range="{limits[0]} {limits[1]}" '
            f'damping="1" armature="0.1"/>{_collision_shapes(link.name, s)}{inner}</body>'
        )
    return inner


def limit_of(joint: str) -> tuple[float, float]:
    """Least and largest angle of a joint, rad."""
    side, part = joint.split("_", 1)
    low, high = LIMITS[part]
    return (-high, -low) if side == "right" and part in ("hip_yaw", "hip_roll") else (low, high)


def h1_mjcf() -> str:
    """Return the robot as MJCF."""
    servos = "".join(
        f'<position name="{joint}" joint="{joint}" kp="{GAINS[part][0]}" kv="{GAINS[part][1]}" '
        f'forcerange="-{TORQUE[part]} {TORQUE[part]}"/>'
        for joint in JOINTS
        for part in (joint.split("_", 1)[1],)
    )
    return f"""<mujoco model="h1">
  <compiler angle="radian" autolimits="true"/>
  <worldbody>
    <body name="base" pos="0 0 {STAND:.4f}">
      <freejoint/>{upper_body()}
      <site name="{CHEST}" pos="0.08 0 0.2"/>
      <geom type="capsule" size="0.09" fromto="0 -0.09 -0.1 0 0.09 -0.1" {_TOUCHES}/>
      <geom type="box" size="0.09 0.15 0.26" pos="0.01 0 0.24" {_TOUCHES}/>
      <geom type="capsule" size="0.08" fromto="0.04 0 0.6 0.04 0 0.68" {_TOUCHES}/>
      <geom type="capsule" size="0.05" fromto="0.01 0.25 0.4 0.03 0.27 0.1" {_TOUCHES}/>
      <geom type="capsule" size="0.05" fromto="0.01 -0.25 0.4 0.03 -0.27 0.1" {_TOUCHES}/>
      <geom name="{BUMPER}" type="box" size="{HALF_LENGTH} {HALF_WIDTH} 0.62" pos="0 0 0.13" mass="0" condim="1"
        contype="{BUMP}" conaffinity="{BUMP}"/>{"".join(_leg_mjcf(side) for side in SIDES)}
    </body>
  </worldbody>
  <actuator>{servos}</actuator>
</mujoco>"""


@cache
def _network() -> tuple[tuple[NDArray[np.float32], ...], tuple[NDArray[np.float32], ...]]:
    """Weights, shape ``(inputs, outputs)``, and biases of the layers that `scripts/train_h1.py` made."""
    arrays = read_npz((files("vico") / "data" / "assets" / "robots" / "h1_policy.npz").read_bytes())
    count = sum(name.startswith("weights") for name in arrays)
    return tuple(arrays[f"weights_{k}"] for k in range(count)), tuple(arrays[f"biases_{k}"] for k in range(count))


@cache
def h1(packs: bool = True) -> RobotModel:
    """Return the model; with `packs` its shapes are the manufacturer's meshes if they are installed."""
    meshes = h1_shapes(arm_places()) if packs else None
    low, high = (np.array([limit_of(joint)[end] for joint in JOINTS]) for end in (0, 1))
    weights, biases = _network()
    return RobotModel(
        name="h1",
        title="Unitree H1",
        source="robosuite-models 1.0.0 (meshes), own physics" if meshes else "own model",
        mjcf=h1_mjcf(),
        motors=JOINTS,
        servos=("position",) * 10,
        joints=JOINTS,
        rest=np.tile(REST, 2),
        controller=TwoLegs(
            weights, biases, STRIDE, MASS, CHEST, np.array([*(link.place for link in LEG), (0.055, 0.0, -SOLE)])
        ),
        action_spaces={
            "joints": ActionSpace("motors", JOINTS, ("rad",) * len(JOINTS), low, high),
            "velocity": velocity_space(1.0, 0.1, 0.8),
        },
        control_period=0.02,
        sensors=Sensors(
            contacts=tuple(f"{side}_ankle" for side in SIDES), camera=_EYE, camera_pitch=_EYE_PITCH, battery=True
        ),
        battery=BATTERY,
        stand=STAND,
        half_length=HALF_LENGTH,
        half_width=HALF_WIDTH,
        height=HEIGHT,
        grade=0.12,
        lookahead=0.9,
        arrival=0.35,
        shapes=meshes or own_shapes(arm_places()),
    )
