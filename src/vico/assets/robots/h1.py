"""H1, a humanoid on two legs with five motors each.

Masses, inertias, joints and their limits are those of Unitree's public description (BSD-3-Clause; as MuJoCo Menagerie
has it). Torso and arms are held as stiff as they would be by their servos: they are one body with the pelvis. With the
package that ships them, Unitree's meshes are drawn instead of our own shapes; physics is the same with and without.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots.control_settings import TwoLegs
from vico.assets.robots.h1_links import LEG, SIDES, arm_places, inertial, tensor_of, upper_body
from vico.assets.robots.h1_shapes import own_shapes
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
    velocity_space,
)
from vico.assets.robots.packs import h1_shapes
from vico.io.npz import read_npz

PARTS = ("hip_yaw", "hip_roll", "hip_pitch", "knee", "ankle")
JOINTS = tuple(f"{side}_{part}" for side in SIDES for part in PARTS)
#: Angles of a leg at rest, rad, in the order of `PARTS`.
REST = np.array([0.0, 0.0, -0.18, 0.5, -0.32])
THIGH, SHIN, SOLE = 0.4, 0.4, 0.07
STAND = 0.1742 + (THIGH + SHIN) * float(np.cos(0.25)) + SOLE
HALF_LENGTH, HALF_WIDTH, HEIGHT = 0.26, 0.32, 1.8
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


def _shapes_of(part: str, s: int) -> str:
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


def _leg(side: str) -> str:
    s, inner = (1 if side == "left" else -1), ""
    for link in reversed(LEG):
        x, y, z = link.place
        limits = limit_of(f"{side}_{link.name}")
        middle, tensor = tensor_of(link.inertia, side)
        inner = (
            f'<body name="{side}_{link.name}" pos="{x} {s * y} {z}">'
            f"{inertial(link.inertia.mass, middle, tensor)}"
            f'<joint name="{side}_{link.name}" axis="{_AXES[link.name]}" range="{limits[0]} {limits[1]}" '
            f'damping="1" armature="0.1"/>{_shapes_of(link.name, s)}{inner}</body>'
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
        contype="{BUMP}" conaffinity="{BUMP}"/>{"".join(_leg(side) for side in SIDES)}
    </body>
  </worldbody>
  <actuator>{servos}</actuator>
</mujoco>"""


@cache
def _network() -> tuple[tuple[NDArray[np.float32], ...], tuple[NDArray[np.float32], ...]]:
    """Weights, shape ``(inputs, outputs)``, and biases of the layers that `scripts/train_h1.py` made."""
    arrays = read_npz((files("vico") / "data" / "h1_policy.npz").read_bytes())
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
