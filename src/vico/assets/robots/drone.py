"""An X500-class quadrotor: half a metre from motor to motor, two kilograms, with a camera under its nose.

Masses, inertias, places of rotors and legs, and the coefficients of rotors and motors are those of the X500 in
PX4-gazebo-models (`models/x500_base`, `models/x500`, BSD-3-Clause), the model that PX4 simulates Holybro's X500
development kit with. Holybro publishes about 18 minutes of hovering with a 4S battery of 5000 mAh (74 Wh); momentum
theory of four rotors gives that at an efficiency of 0.49. The drag of the body is an estimate of ours.

Shape and mesh are our own.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots.model import (
    BUMP,
    BUMPER,
    TOUCH,
    ActionSpace,
    Quadrotor,
    RobotModel,
    RotorModel,
    Sensors,
    flight_space,
)
from vico.assets.shapes import ball, box, cylinder, facing_x, pose_matrix, tube
from vico.world.mesh import Surface, merge_surfaces

ROTORS = ("front_right", "rear_left", "front_left", "rear_right")
REACH = 0.174  # of a rotor from the middle, along and across, metres
RISE = 0.06  # of a rotor above the base's origin, metres
RADIUS = 0.1396  # of a rotor, metres
PLACES = np.array([[1, -1], [-1, 1], [1, 1], [-1, -1]]) * REACH
#: To the left seen from above, by rotor.
TURNS = np.array([1.0, 1.0, -1.0, -1.0])
MASS, PROPELLER = 2.0, 0.016
INERTIA = np.array([0.0216667, 0.0216667, 0.04])
# Skids, metres.
SKID = 0.125  # half their length
SKID_Y = 0.132  # aside
SKID_Z = -0.2195
SKID_RADIUS = 0.0075
#: Rad/s.
FASTEST = 1000.0
HALF, HEIGHT = 0.315, 0.31
# Of rotors: newtons, metres, seconds.
_THRUST = 8.54858e-6  # motorConstant
_MOMENT = 0.016  # momentConstant
_UP = 0.0125  # timeConstantUp
_DOWN = 0.025  # timeConstantDown
_DRAG = 8.06428e-5  # rotorDragCoefficient
_CAPACITY = 74.0 * 3600.0
_STAND = -SKID_Z + SKID_RADIUS
_CAMERA = (0.125, 0.0, -0.045)
# As far as a camera under the nose is usually tilted to see where one flies and what is below.
_CAMERA_PITCH = np.radians(-25.0)
_CARBON, _DARK, _ALLOY, _BATTERY, _PROPELLER = (38, 39, 42), (24, 25, 27), (150, 154, 160), (52, 70, 120), (44, 45, 48)
_ORANGE, _GREEN, _RED = (226, 98, 30), (40, 200, 90), (220, 40, 40)


def _mjcf() -> str:
    touch = f'mass="0" contype="{TOUCH}" conaffinity="{TOUCH}"'
    skids = "".join(
        f"""
      <geom type="capsule" size="{SKID_RADIUS}" fromto="{-SKID} {y} {SKID_Z} {SKID} {y} {SKID_Z}" priority="1"
        friction="0.8 0.01 0.001" condim="3" solref="0.02 1" {touch}/>"""
        for y in (-SKID_Y, SKID_Y)
    )
    propellers = "".join(
        f"""
      <body name="{name}" pos="{x} {y} {RISE}"><inertial pos="0 0 0" mass="{PROPELLER}"
        diaginertia="2.6e-5 2.6e-5 2.6e-5"/></body>"""
        for name, (x, y) in zip(ROTORS, PLACES, strict=True)
    )
    inertia = " ".join(str(value) for value in INERTIA)
    # The outline ends above the skids: these stand on roofs, which outlines keep out of.
    return f"""<mujoco model="drone">
  <compiler angle="radian" autolimits="true"/>
  <worldbody>
    <body name="base" pos="0 0 {_STAND}">
      <freejoint/>
      <inertial pos="0 0 0" mass="{MASS}" diaginertia="{inertia}"/>
      <geom type="box" size="0.12 0.07 0.04" pos="0 0 0.01" {touch}/>
      <geom type="box" size="{REACH + RADIUS} {REACH + RADIUS} 0.012" pos="0 0 {RISE}" {touch}/>
      <geom name="{BUMPER}" type="box" size="0.33 0.33 0.135" pos="0 0 -0.065" mass="0" condim="1"
        contype="{BUMP}" conaffinity="{BUMP}"/>{skids}{propellers}
      <site name="air" pos="0 0 0"/>
    </body>
  </worldbody>
</mujoco>"""


def _tilt(surface: Surface, axis: tuple[float, float], angle: float, at: NDArray[np.float64]) -> Surface:
    """Turn a surface by an angle about a level axis, and move it."""
    u = np.array([axis[0], axis[1], 0.0])
    c, s = np.cos(angle), np.sin(angle)
    cross = np.array([[0.0, 0.0, u[1]], [0.0, 0.0, -u[0]], [-u[1], u[0], 0.0]])
    matrix = np.eye(4)
    matrix[:3, :3] = c * np.eye(3) + (1 - c) * np.outer(u, u) + s * cross
    matrix[:3, 3] = at
    return surface.moved(matrix)


def _propeller(turns: float) -> list[Surface]:
    """Two twisted blades around a hub; of the same pitch whichever way they turn."""
    # Distance from the hub, width and angle of a blade's sections.
    sections = ((0.010, 0.012, 0.5), (0.035, 0.028, 0.42), (0.07, 0.026, 0.3), (0.11, 0.02, 0.2), (RADIUS, 0.008, 0.12))
    parts = [cylinder(0.011, 0.012, sides=10, colour=_DARK, centre=(0, 0, -0.005))]
    parts.append(ball((0.006, 0.006, 0.006), (0, 0, 0.008), colour=_ALLOY))
    points = []
    for along, width, angle in sections:
        across, rise = np.cos(angle) * width / 2, np.sin(angle) * width / 2
        # The leading edge is the higher one.
        points += [(along, turns * across, rise), (along, -turns * across, -rise)]
    faces = []
    for k in range(len(sections) - 1):
        a, b, c, d = 2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2
        faces += [(a, b, c), (a, c, d), (c, b, a), (d, c, a)]
    colours = (_PROPELLER, _ORANGE)
    for half, yaw in enumerate((0.0, np.pi)):
        blade = Surface.from_triangles(np.array(points), np.array(faces), colour=colours[half])
        parts.append(blade.moved(pose_matrix(0, 0, 0, yaw)))
    return merge_surfaces(parts)


def _frame() -> list[Surface]:
    parts = [box((0.23, 0.11, 0.003), (0, 0, z), colour=_CARBON) for z in (0.0, 0.03)]
    for x, y in ((0.09, 0.045), (0.09, -0.045), (-0.09, 0.045), (-0.09, -0.045)):
        parts.append(cylinder(0.004, 0.03, sides=6, colour=_ALLOY, centre=(x, y, 0)))
    parts.append(box((0.145, 0.05, 0.034), (-0.01, 0, -0.022), colour=_BATTERY))
    for x in (-0.055, 0.035):
        parts.append(box((0.016, 0.054, 0.037), (x, 0, -0.022), colour=_DARK))  # straps
    parts.append(box((0.055, 0.045, 0.02), (0.0, 0, 0.042), colour=_ORANGE))  # flight controller
    parts.append(cylinder(0.005, 0.06, sides=8, colour=_DARK, centre=(-0.085, 0, 0.03)))
    parts.append(cylinder(0.028, 0.014, sides=16, colour=_DARK, centre=(-0.085, 0, 0.09)))  # satellite receiver
    parts.append(cylinder(0.003, 0.075, sides=5, colour=_DARK, centre=(-0.105, 0.045, 0.03)))  # antenna
    for (x, y), turns in zip(PLACES, TURNS, strict=True):
        root = np.array([x, y]) * 0.32
        parts.append(tube((root[0], root[1], 0.015), (x, y, 0.015), 0.0085, _CARBON, sides=8))
        parts.append(cylinder(0.02, 0.014, sides=12, colour=_DARK, centre=(x, y, 0.008)))
        parts.append(cylinder(0.024, 0.024, sides=16, colour=_ALLOY if turns > 0 else _DARK, centre=(x, y, 0.026)))
        lamp = _RED if y > 0 else _GREEN  # as on ships and aircraft: red on the left
        parts.append(ball((0.007, 0.007, 0.005), (x * 1.0, y * 1.0, 0.003), colour=lamp if x > 0 else (230, 230, 230)))
    for side in (1.0, -1.0):
        parts.append(tube((0, side * 0.055, 0.0), (0, side * SKID_Y, SKID_Z), 0.0075, _CARBON, sides=8))
        parts.append(tube((-SKID, side * SKID_Y, SKID_Z), (SKID, side * SKID_Y, SKID_Z), SKID_RADIUS, _CARBON, sides=8))
        for x in (-SKID, SKID):
            parts.append(ball((0.014, 0.011, 0.0075), (x * 0.97, side * SKID_Y, SKID_Z), colour=_DARK))
    x, _, z = _CAMERA
    parts.append(box((0.03, 0.06, 0.004), (x - 0.03, 0, -0.004), colour=_CARBON))
    for side in (1.0, -1.0):
        parts.append(box((0.012, 0.004, 0.05), (x - 0.02, side * 0.028, -0.026), colour=_DARK))
    at = np.array([x - 0.02, 0.0, z])
    parts.append(_tilt(box((0.03, 0.05, 0.032), (0, 0, 0), colour=_ALLOY), (0.0, 1.0), -_CAMERA_PITCH, at))
    lens = cylinder(0.011, 0.012, sides=12, colour=_DARK).moved(facing_x(0.015, 0, 0))
    parts.append(_tilt(lens, (0.0, 1.0), -_CAMERA_PITCH, at))
    return merge_surfaces(parts)


@cache
def drone(packs: bool = True) -> RobotModel:
    """Return the model; there are no packages of it."""
    across = 4 * PROPELLER * REACH**2
    return RobotModel(
        name="drone",
        title="X500 drone",
        source="own model",
        mjcf=_mjcf(),
        motors=ROTORS,
        servos=("rotor",) * 4,
        joints=(),
        rest=np.zeros(0),
        controller=Quadrotor(
            MASS + 4 * PROPELLER, INERTIA + across * np.array([1.0, 1.0, 2.0]), float(np.radians(45.0))
        ),
        action_spaces={
            "rotors": ActionSpace("motors", ROTORS, ("rad/s",) * 4, np.zeros(4), np.full(4, FASTEST)),
            "velocity": flight_space(8.0, 3.0, 1.5),
        },
        control_period=0.01,
        sensors=Sensors(
            contacts=("base",), camera=_CAMERA, camera_pitch=float(_CAMERA_PITCH), rotors=True, battery=True
        ),
        stand=_STAND,
        half_length=HALF,
        half_width=HALF,
        height=HEIGHT,
        arrival=0.4,
        fallen_below=0.3,
        shapes={"base": _frame()}
        | {name: _propeller(turns) for name, turns in zip(ROTORS, TURNS.tolist(), strict=True)},
        rotors=RotorModel(
            site="air",
            links=ROTORS,
            places=np.column_stack([PLACES, np.full(4, RISE)]),
            turns=TURNS,
            thrust=_THRUST,
            moment=_MOMENT,
            speed_up=_UP,
            slow_down=_DOWN,
            rotor_drag=_DRAG,
            drag_area=0.03,
            radius=RADIUS,
            efficiency=0.49,
            idle_power=8.0,
            capacity=_CAPACITY,
        ),
    )
