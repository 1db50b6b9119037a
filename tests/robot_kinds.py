"""Two robots that the package does not know: a chain of thirteen joints, and four rotors without any joint."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import numpy as np

from vico.assets.robots import (
    BUMP,
    BUMPER,
    TOUCH,
    ActionSpace,
    DeckModel,
    NoController,
    RobotModel,
    Sensors,
    catalogue,
    register_robot,
)
from vico.assets.shapes import box

TOUCHING = f'contype="{TOUCH}" conaffinity="{TOUCH}"'
BUMPING = f'name="{BUMPER}" mass="0" condim="1" contype="{BUMP}" conaffinity="{BUMP}"'
JOINTS = tuple(f"j{k}" for k in range(13))
ROTORS = ("front_left", "front_right", "rear_left", "rear_right")


@cache
def chain(packs: bool) -> RobotModel:
    """A heavy foot with thirteen hinges one above the other; nothing about it is legs or wheels."""
    links = ""
    for k in range(13):
        links += (
            f'<body name="link{k}" pos="0 0 {0.2 if k == 0 else 0.06}"><joint name="hinge{k}" '
            f'axis="{k % 2} {(k + 1) % 2} 0" range="-1 1" damping="0.5"/>'
            f'<geom type="capsule" size="0.02" fromto="0 0 0 0 0 0.05" mass="0.05" {TOUCHING}/>'
        )
    mjcf = f"""<mujoco model="chain"><compiler angle="radian" autolimits="true"/><worldbody>
      <body name="base" pos="0 0 0.1"><freejoint/>
        <geom type="box" size="0.3 0.3 0.1" mass="20" {TOUCHING}/>
        <geom type="box" size="0.3 0.3 0.05" pos="0 0 0.05" {BUMPING}/>{links}{"</body>" * 13}</body></worldbody>
      <actuator>{"".join(f'<position name="j{k}" joint="hinge{k}" kp="60" kv="2"/>' for k in range(13))}</actuator>
    </mujoco>"""
    space = ActionSpace("motors", JOINTS, ("rad",) * 13, np.linspace(-1.0, -0.4, 13), np.linspace(0.4, 1.0, 13))
    return RobotModel(
        name="chain",
        title="Chain",
        source="test",
        mjcf=mjcf,
        motors=JOINTS,
        servos=("position",) * 13,
        joints=JOINTS,
        rest=np.zeros(13),
        controller=NoController(),
        action_spaces={"joints": space},
        control_period=0.02,
        sensors=Sensors(odometry=False),
        deck=DeckModel((0.2, 0.0, 0.1), 0.2, 0.5),
        stand=0.1,
        half_length=0.3,
        half_width=0.3,
        height=1.2,
        shapes={"base": [box((0.6, 0.6, 0.2), (0, 0, 0), colour=(90, 90, 90))]},
    )


@cache
def rotors(packs: bool) -> RobotModel:
    """Four rotors that push along their axes: motors without joints, and nothing that could fall."""
    places = {"front_left": (0.15, 0.15), "front_right": (0.15, -0.15), "rear_left": (-0.15, 0.15)}
    places["rear_right"] = (-0.15, -0.15)
    sites = "".join(f'<site name="{name}" pos="{x} {y} 0.02"/>' for name, (x, y) in places.items())
    push = "".join(
        f'<motor name="{name}" site="{name}" gear="0 0 1 0 0 {0.02 * (-1) ** k}" ctrlrange="0 8"/>'
        for k, name in enumerate(ROTORS)
    )
    mjcf = f"""<mujoco model="rotors"><compiler angle="radian" autolimits="true"/><worldbody>
      <body name="base" pos="0 0 0.05"><freejoint/><geom type="box" size="0.2 0.2 0.04" mass="1" {TOUCHING}/>
      <geom type="box" size="0.2 0.2 0.04" {BUMPING}/>{sites}</body></worldbody><actuator>{push}</actuator></mujoco>"""
    return RobotModel(
        name="rotors",
        title="Rotors",
        source="test",
        mjcf=mjcf,
        motors=ROTORS,
        servos=("force",) * 4,
        joints=(),
        rest=np.zeros(0),
        controller=NoController(),
        action_spaces={"thrust": ActionSpace("motors", ROTORS, ("N",) * 4, np.zeros(4), np.full(4, 8.0))},
        control_period=0.01,
        sensors=Sensors(joints=False, camera=(0.2, 0.0, 0.0)),
        stand=0.04,
        half_length=0.2,
        half_width=0.2,
        height=0.1,
        fallen_below=None,
        shapes={"base": [box((0.4, 0.4, 0.08), (0, 0, 0), colour=(40, 40, 40))]},
    )


@contextmanager
def known() -> Iterator[None]:
    """Both robots are known by name inside the block."""
    for name, maker in (("chain", chain), ("rotors", rotors)):
        register_robot(name, maker)
    try:
        yield
    finally:
        for name in ("chain", "rotors"):
            del catalogue._MAKERS[name]
