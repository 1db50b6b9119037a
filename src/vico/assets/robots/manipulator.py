"""A mobile manipulator after Google's robot: a round base on two wheels, an arm of seven joints, a parallel jaw.

Lengths of the arm and the places of its joints are those of the Google robot in MuJoCo Menagerie
(`google_robot`, Apache-2.0). Base, jaw (0.32 m wide, fingers coupled), masses of the base and meshes are our own.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from vico.assets.robots.model import (
    BUMP,
    BUMPER,
    LIMB,
    TOUCH,
    ActionSpace,
    BatteryModel,
    MobileManipulator,
    RobotModel,
    Sensors,
    velocity_space,
)
from vico.assets.shapes import ball, box, cylinder, tube
from vico.world.mesh import Surface, merge_surfaces

ARM = ("torso", "shoulder", "bicep", "elbow", "forearm", "wrist", "gripper")
FINGERS = ("right_finger", "left_finger")
#: 24 V x 40 Ah, and what computer and motors take at rest: estimates of ours.
BATTERY = BatteryModel(capacity=24.0 * 40.0 * 3600.0, idle_power=120.0, holding=0.02)
BASE = ("forward", "yaw")
#: Each joint's place in the frame of the one before it, metres, its axis and its bounds, rad.
PLACES = np.array(
    [
        (0.0, 0.0, 0.5566),
        (0.0, -0.167289, 0.113),
        (0.0, 0.002289, 0.215029),
        (0.0, -0.064, 0.185036),
        (0.0, -0.101, 0.0914359),
        (0.0, -0.00604, 0.2735),
        (0.0, 0.0060384, 0.10911),
    ]
)
AXES = np.array([(0, 0, 1), (0, 1, 0), (0, 0, 1), (0, 1, 0), (0, 0, 1), (0, 1, 0), (0, 0, 1)], np.float64)
LOW = np.array([-4.49, -2.66, -2.13, -2.05, -2.92, -1.79, -4.49])
HIGH = np.array([1.35, 3.18, 3.71, 3.79, 2.92, 1.79, 1.35])
#: Middle between the pads in the frame of the gripper, metres; how wide the jaw opens, each finger's way.
GRIP, OPENING = 0.175, 0.16
WHEEL, TRACK = 0.1, 0.2
RADIUS, HEIGHT = 0.30, 1.35
#: Higher kerbs lift its wheels off the ground, as casters before and behind them stand on both sides, metres.
KERB = 0.06
#: Folded beside the torso, hand up.
REST = np.array([-0.2, -0.55, 0.0, 2.35, 0.0, 1.2, 0.0])
_MASSES = (2.47, 2.08, 1.4, 0.79, 0.82, 0.54, 0.6)
_SHELL, _DARK, _GREY, _BLUE = (226, 228, 230), (44, 46, 50), (120, 124, 130), (52, 104, 190)


def _arm() -> str:
    open_, close = "", ""
    touch = f'contype="{LIMB}" conaffinity="0"'
    for k, name in enumerate(ARM):
        x, y, z = PLACES[k]
        end = PLACES[k + 1] if k + 1 < len(ARM) else np.array([0.0, 0.0, 0.05])
        axis = " ".join(str(v) for v in AXES[k])
        open_ += f"""
      <body name="{name}" pos="{x} {y} {z}" gravcomp="1">
        <joint name="{name}" axis="{axis}" range="{LOW[k]} {HIGH[k]}" damping="2" armature="0.1"/>
        <geom type="capsule" size="{0.06 if k < 2 else 0.045}" fromto="0 0 0 {end[0]} {end[1]} {end[2]}"
          mass="{_MASSES[k]}" {touch}/>"""
        close += "</body>"
    pads = "".join(
        f"""
        <body name="{name}" pos="0 {sign * 0.012} 0.06" gravcomp="1">
          <joint name="{name}" type="slide" axis="0 {sign} 0" range="0 {OPENING}" damping="20" armature="0.2"/>
          <geom type="box" size="0.015 0.006 0.045" pos="0 {sign * 0.006} 0.045" mass="0.05" {touch}/>
          <geom type="box" size="0.02 0.008 0.035" pos="0 {sign * 0.004} 0.115" mass="0.05" friction="1 0.02 0.001"
            condim="4" solref="0.01 1" contype="{TOUCH}" conaffinity="{TOUCH}"/>
        </body>"""
        for name, sign in zip(FINGERS, (-1, 1), strict=True)
    )
    palm = f'<geom type="box" size="0.03 0.17 0.02" pos="0 0 0.045" mass="0.2" {touch}/>'
    return open_ + palm + pads + close


def _mjcf() -> str:
    touch = f'contype="{TOUCH}" conaffinity="{TOUCH}"'
    wheels = "".join(
        f"""
      <body name="{name}" pos="0 {y} 0"><joint name="{name}" axis="0 1 0" armature="0.02" damping="0.05"/>
        <geom type="ellipsoid" size="{WHEEL} 0.03 {WHEEL}" mass="1.5" condim="3" friction="0.9 0.01 0.001" priority="1"
          solref="0.02 1" {touch}/></body>"""
        for name, y in (("left_wheel", TRACK), ("right_wheel", -TRACK))
    )
    casters = "".join(
        f"""
      <geom type="sphere" size="0.04" pos="{x} {y} {0.04 - WHEEL + 0.002}" mass="0.3" condim="1" priority="2"
        solref="0.03 1" {touch}/>"""
        for x, y in ((0.22, 0.09), (0.22, -0.09), (-0.22, 0.09), (-0.22, -0.09))
    )
    servos = "".join(
        f'<position name="{name}" joint="{name}" kp="{1500 if k < 4 else 800}" kv="{80 if k < 4 else 40}" '
        f'forcerange="-150 150"/>'
        for k, name in enumerate(ARM)
    )
    servos += "".join(f'<position name="{n}" joint="{n}" kp="2000" kv="60" forcerange="-60 60"/>' for n in FINGERS)
    servos += '<velocity name="forward" tendon="forward" kv="800" forcerange="-160 160"/>'
    servos += '<velocity name="yaw" tendon="yaw" kv="120" forcerange="-45 45"/>'
    r = WHEEL
    return f"""<mujoco model="manipulator">
  <compiler angle="radian" autolimits="true"/>
  <worldbody>
    <body name="base" pos="0 0 {WHEEL}">
      <freejoint/>
      <geom type="cylinder" size="0.27 0.1" pos="0 0 0.07" mass="62" {touch}/>
      <geom type="cylinder" size="0.12 0.2" pos="-0.02 0 0.37" mass="10" contype="{LIMB}" conaffinity="0"/>
      <geom name="{BUMPER}" type="box" size="{RADIUS} {RADIUS} 0.58" pos="0 0 0.61" mass="0" condim="1"
        contype="{BUMP}" conaffinity="{BUMP}"/>{wheels}{casters}{_arm()}
    </body>
  </worldbody>
  <tendon>
    <fixed name="forward"><joint joint="left_wheel" coef="{r / 2}"/><joint joint="right_wheel" coef="{r / 2}"/></fixed>
    <fixed name="yaw"><joint joint="left_wheel" coef="{-r / (2 * TRACK)}"/>
      <joint joint="right_wheel" coef="{r / (2 * TRACK)}"/></fixed>
  </tendon>
  <equality><joint joint1="{FINGERS[0]}" joint2="{FINGERS[1]}" solref="0.005 1"/></equality>
  <actuator>{servos}</actuator>
</mujoco>"""


def _turned_y(surface: Surface, at: tuple[float, float, float]) -> Surface:
    matrix = np.array([[1, 0, 0, at[0]], [0, 0, -1, at[1]], [0, 1, 0, at[2]], [0, 0, 0, 1]], np.float64)
    return surface.moved(matrix)


def _link(k: int) -> list[Surface]:
    end = tuple(PLACES[k + 1]) if k + 1 < len(ARM) else (0.0, 0.0, 0.03)
    size = 0.07 if k < 2 else 0.052
    parts = []
    if AXES[k, 1]:  # a joint across: a drum
        parts.append(_turned_y(cylinder(size, 0.11, sides=20, colour=_GREY), (0.0, 0.055, 0.0)))
        parts.append(_turned_y(cylinder(size * 0.7, 0.118, sides=16, colour=_BLUE), (0.0, 0.059, 0.0)))
    else:
        parts.append(cylinder(size, 0.05, sides=20, colour=_GREY, centre=(0, 0, -0.025)))
    if float(np.linalg.norm(end)) > 0.05:
        parts.append(tube((0, 0, 0), (0, end[1] * 0.5, end[2] * 0.55), size * 0.92, _SHELL, sides=16))
        parts.append(
            tube((0, end[1] * 0.5, end[2] * 0.5), (0, end[1], end[2]), size * 0.88, _SHELL, sides=16, tip=size * 0.8)
        )
    parts.append(ball((size * 0.95,) * 3, (0, 0, 0), colour=_SHELL, sides=14, rings=7))
    if k == len(ARM) - 1:
        parts.append(box((0.06, 0.36, 0.035), (0, 0, 0.045), colour=_DARK))
        parts.append(box((0.03, 0.03, 0.03), (0.045, 0, 0.05), colour=_BLUE))
    return merge_surfaces(parts)


def _finger(sign: float) -> list[Surface]:
    return merge_surfaces(
        [
            box((0.03, 0.012, 0.09), (0, sign * 0.006, 0.045), colour=_GREY),
            box((0.04, 0.016, 0.07), (0, sign * 0.004, 0.115), colour=_DARK),
        ]
    )


def _body() -> list[Surface]:
    parts = [cylinder(0.27, 0.17, sides=36, colour=_SHELL, centre=(0, 0, -0.04))]
    parts.append(cylinder(0.275, 0.03, sides=36, colour=_DARK, centre=(0, 0, -0.07)))
    parts.append(cylinder(0.272, 0.012, sides=36, colour=_BLUE, centre=(0, 0, 0.1)))
    parts.append(cylinder(0.27, 0.05, top=0.2, sides=36, colour=_SHELL, centre=(0, 0, 0.13)))
    parts.append(cylinder(0.15, 0.36, top=0.12, sides=28, colour=_SHELL, centre=(-0.02, 0, 0.18)))
    parts.append(tube((-0.1, 0.05, 0.2), (-0.1, 0.05, 1.08), 0.035, _GREY, sides=12))  # the mast of the head
    parts.append(box((0.12, 0.2, 0.1), (-0.07, 0.05, 1.14), colour=_SHELL))
    parts.append(box((0.02, 0.16, 0.05), (0.0, 0.05, 1.14), colour=_DARK))
    for y in (0.0, 0.1):
        parts.append(ball((0.012, 0.014, 0.014), (0.01, y, 1.14), colour=_BLUE, sides=10, rings=6))
    return merge_surfaces(parts)


def _wheel() -> list[Surface]:
    tyre = _turned_y(cylinder(WHEEL, 0.04, sides=24, colour=_DARK), (0, 0.02, 0))
    return merge_surfaces([tyre, _turned_y(cylinder(WHEEL * 0.6, 0.046, sides=16, colour=_GREY), (0, 0.023, 0))])


@cache
def manipulator(packs: bool = True) -> RobotModel:
    """Return the model; there are no packages of it."""
    motors = (*ARM, *FINGERS, *BASE)
    low = np.concatenate([LOW, [0.0, 0.0], [-0.8, -1.2]])
    high = np.concatenate([HIGH, [OPENING, OPENING], [0.8, 1.2]])
    return RobotModel(
        name="manipulator",
        title="mobile manipulator",
        source="own model",
        mjcf=_mjcf(),
        motors=motors,
        servos=("position",) * 9 + ("velocity",) * 2,
        joints=(*ARM, *FINGERS),
        rest=np.concatenate([REST, [0.0, 0.0]]),
        controller=MobileManipulator(PLACES, AXES, LOW, HIGH, GRIP, OPENING),
        action_spaces={
            "joints": ActionSpace("motors", motors, ("rad",) * 7 + ("m",) * 2 + ("m/s", "rad/s"), low, high),
            "velocity": velocity_space(0.8, 0.0, 1.2),
        },
        control_period=0.02,
        sensors=Sensors(
            contacts=FINGERS, camera=(0.02, 0.05, 1.14), camera_pitch=float(np.radians(-35.0)), battery=True
        ),
        battery=BATTERY,
        stand=WHEEL,
        half_length=RADIUS,
        half_width=RADIUS,
        height=HEIGHT,
        grade=0.17,
        kerb=KERB,
        shapes={"base": _body(), "left_wheel": _wheel(), "right_wheel": _wheel()}
        | {name: _link(k) for k, name in enumerate(ARM)}
        | {name: _finger(sign) for name, sign in zip(FINGERS, (-1.0, 1.0), strict=True)},
    )
