"""Husky, a four-wheeled carrier that turns by skidding.

Figures: Clearpath Robotics, Husky A200 data sheet (0.99 x 0.67 x 0.39 m, 50 kg, 0.33 m wheels, 1.0 m/s, 0.13 m of
ground clearance); axle positions and wheel mass from the manufacturer's public robot description.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from vico.assets.robots.model import (
    BUMP,
    BUMPER,
    TOUCH,
    ActionSpace,
    BatteryModel,
    DeckModel,
    RobotModel,
    Sensors,
    SkidSteering,
    velocity_space,
)
from vico.assets.robots.packs import husky_shapes
from vico.assets.shapes import box, cylinder, extrusion
from vico.world.mesh import Surface, merge_surfaces

# Of a wheel, metres.
RADIUS = 0.165
WIDTH = 0.1143
# Of its middle in the base's frame, metres.
AXLE = 0.256  # before or behind
TRACK = 0.2854  # aside
HUB = 0.0328  # above
MASS, WHEEL_MASS = 50.0, 2.637
# How much faster than by rolling alone the wheels have to turn for the base to turn, on pavement.
_SLIP = 2.2
WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
#: 24 V x 20 Ah (data sheet); what computer and motors take at rest is an estimate of ours.
BATTERY = BatteryModel(capacity=24.0 * 20.0 * 3600.0, idle_power=50.0, holding=0.05)
_YELLOW, _BLACK, _DARK, _GREY = (238, 186, 24), (34, 35, 38), (58, 60, 64), (150, 153, 158)
_STAND = RADIUS - HUB


def _place(wheel: str) -> tuple[float, float, float]:
    return (AXLE if "front" in wheel else -AXLE, TRACK if "left" in wheel else -TRACK, HUB)


def _mjcf() -> str:
    chassis = MASS - 4 * WHEEL_MASS
    # Weighed as cylinders, met as ellipsoids within them: those touch the ground in one point, at half the cost.
    along, across = WHEEL_MASS * RADIUS**2 / 2, WHEEL_MASS * (3 * RADIUS**2 + WIDTH**2) / 12
    wheels = "".join(
        f"""
      <body name="{name}" pos="{x} {y} {z}">
        <joint name="{name}" axis="0 1 0" armature="0.05" damping="0.1"/>
        <inertial pos="0 0 0" mass="{WHEEL_MASS}" diaginertia="{across} {along} {across}"/>
        <geom type="ellipsoid" size="{RADIUS} {WIDTH / 2} {RADIUS}" mass="0" condim="3"
          friction="0.7 0.01 0.001" priority="1" solref="0.05 1" contype="{TOUCH}" conaffinity="{TOUCH}"/>
      </body>"""
        for name, (x, y, z) in ((name, _place(name)) for name in WHEELS)
    )
    servos = "".join(f'<velocity name="{name}" joint="{name}" kv="25" forcerange="-45 45"/>' for name in WHEELS)
    touch = f'type="box" mass="0" contype="{TOUCH}" conaffinity="{TOUCH}"'
    # Bumper bars, plates over the wheels, rails around the deck and the camera: what links are met with, massless.
    parts = "".join(
        f"""
      <geom {touch} size="{size}" pos="{x} {y} {z}"/>"""
        for size, x, y, z in (
            ("0.01 0.267 0.014", 0.485, 0, 0.091),
            ("0.01 0.267 0.014", -0.485, 0, 0.091),
            ("0.045 0.21 0.0125", 0.44, 0, 0.091),
            ("0.045 0.21 0.0125", -0.44, 0, 0.091),
            ("0.405 0.05 0.006", 0, 0.25, 0.2),
            ("0.405 0.05 0.006", 0, -0.25, 0.2),
            ("0.2725 0.014 0.014", 0, 0.196, 0.237),
            ("0.2725 0.014 0.014", 0, -0.196, 0.237),
            ("0.014 0.21 0.014", 0.26, 0, 0.237),
            ("0.014 0.21 0.014", -0.26, 0, 0.237),
            ("0.025 0.06 0.055", 0.262, 0, 0.305),
        )
    )
    return f"""<mujoco model="husky">
  <compiler angle="radian" autolimits="true"/>
  <worldbody>
    <body name="base" pos="0 0 {_STAND}">
      <freejoint/>
      <geom type="box" size="0.404 0.205 0.06" pos="0 0 0.06" mass="{chassis * 0.85}"
        contype="{TOUCH}" conaffinity="{TOUCH}"/>
      <geom type="box" size="0.404 0.207 0.055" pos="0 0 0.175" mass="{chassis * 0.15}"
        contype="{TOUCH}" conaffinity="{TOUCH}"/>
      <geom name="{BUMPER}" type="box" size="0.495 0.3425 0.11" pos="0 0 0.14" mass="0" condim="1"
        contype="{BUMP}" conaffinity="{BUMP}"/>{parts}{wheels}
    </body>
  </worldbody>
  <actuator>{servos}</actuator>
</mujoco>"""


def _lying(radius: float, width: float, colour: tuple[int, int, int], sides: int) -> Surface:
    """Return a cylinder along y around the origin."""
    turn = np.array([[1, 0, 0, 0], [0, 0, -1, width / 2], [0, 1, 0, 0], [0, 0, 0, 1]], np.float64)
    return cylinder(radius, width, sides=sides, colour=colour).moved(turn)


def _wheel() -> list[Surface]:
    parts = [_lying(RADIUS * 0.94, WIDTH, _BLACK, 24), _lying(RADIUS * 0.5, WIDTH * 1.04, _GREY, 16)]
    parts.append(_lying(RADIUS * 0.14, WIDTH * 1.16, _DARK, 8))
    for k in range(18):  # the tread: lugs slanted one way and the other
        angle = 2 * np.pi * k / 18
        lug = box((0.026, WIDTH * 0.52, RADIUS * 0.1), (0, 0, 0), colour=_DARK, yaw=0.35 if k % 2 else -0.35)
        c, s = np.cos(angle), np.sin(angle)
        reach, side = RADIUS * 0.95, WIDTH * (0.23 if k % 2 else -0.23)
        turn = np.array([[c, 0, s, reach * s], [0, 1, 0, side], [-s, 0, c, reach * c], [0, 0, 0, 1]])
        parts.append(lug.moved(turn))
    return merge_surfaces(parts)


def _fittings() -> list[Surface]:
    """Return what physics lets things lie on and bump into, and the manufacturer's meshes leave out."""
    plates = [box((0.81, 0.1, 0.012), (0, sign * 0.25, 0.2), colour=_YELLOW) for sign in (1, -1)]  # over the wheels
    lid = box((0.808, 0.414, 0.012), (0, 0, 0.224), colour=_YELLOW)
    foot = cylinder(0.022, 0.07, sides=12, colour=_BLACK, centre=(0.26, 0, 0.25))  # of the camera
    return [*plates, lid, foot, box((0.05, 0.12, 0.035), (0.262, 0, 0.335), colour=_GREY)]


def _own_shapes() -> dict[str, list[Surface]]:
    side = [
        (-0.40, 0.02),
        (-0.34, 0.0),
        (0.34, 0.0),
        (0.40, 0.02),
        (0.40, 0.16),
        (0.36, 0.2),
        (-0.36, 0.2),
        (-0.40, 0.16),
    ]
    base = [extrusion(side, 0.42, colour=_YELLOW)]
    base.append(box((0.78, 0.43, 0.05), (0, 0, 0.115), colour=_BLACK))  # the band above the wheels
    for sign in (1, -1):
        base.append(box((0.545, 0.028, 0.028), (0, sign * 0.196, 0.237), colour=_DARK))  # user rails
        base.append(box((0.02, 0.534, 0.028), (sign * 0.485, 0, 0.091), colour=_DARK))  # bumpers
        for y in (-0.2, 0.2):
            base.append(box((0.09, 0.025, 0.025), (sign * 0.44, y, 0.091), colour=_DARK))
    base.append(box((0.028, 0.42, 0.028), (0.26, 0, 0.237), colour=_DARK))
    base.append(box((0.028, 0.42, 0.028), (-0.26, 0, 0.237), colour=_DARK))
    base.append(box((0.09, 0.14, 0.004), (-0.33, 0, 0.232), colour=_BLACK))  # the panel
    base.append(cylinder(0.018, 0.02, sides=10, colour=(200, 30, 30), centre=(-0.35, 0.15, 0.23)))  # emergency stop
    base += _fittings()
    wheel = _wheel()
    return {"base": merge_surfaces(base)} | dict.fromkeys(WHEELS, wheel)


@cache
def husky(packs: bool = True) -> RobotModel:
    """Return the model; with `packs` its shapes are the manufacturer's meshes if they are installed."""
    meshes = husky_shapes(RADIUS) if packs else None
    return RobotModel(
        name="husky",
        title="Clearpath Husky",
        source="pybullet 3.2.7 (meshes), own physics" if meshes else "own model",
        mjcf=_mjcf(),
        motors=WHEELS,
        servos=("velocity",) * 4,
        joints=WHEELS,
        rest=np.zeros(4),
        controller=SkidSteering(RADIUS, TRACK, _SLIP),
        action_spaces={
            "wheels": ActionSpace("motors", WHEELS, ("rad/s",) * 4, np.full(4, -8.0), np.full(4, 8.0)),
            "velocity": velocity_space(1.0, 0.0, 1.2),
        },
        control_period=0.02,
        sensors=Sensors(contacts=("base", *WHEELS), camera=(0.29, 0.0, 0.335), battery=True),
        battery=BATTERY,
        # The rails' tops, behind the camera's mast; between the rails is the lid of the chassis.
        deck=DeckModel((-0.095, 0.0, 0.252), 0.63, 0.62, DeckModel((-0.0045, 0.0, 0.23), 0.483, 0.364)),
        stand=_STAND,
        half_length=0.495,
        half_width=0.3425,
        height=0.39,
        grade=0.5,
        lookahead=0.9,
        arrival=0.4,
        shapes=_own_shapes() if meshes is None else {**meshes, "base": merge_surfaces([*meshes["base"], *_fittings()])},
    )
