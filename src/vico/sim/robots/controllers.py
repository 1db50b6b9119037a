"""Which controllers there are, by the name that a robot's model gives."""

from __future__ import annotations

from collections.abc import Callable

from vico.assets.robots import RobotModel
from vico.errors import InputError
from vico.sim.robots.controller import DirectMotors, MotorController
from vico.sim.robots.legs import Legs
from vico.sim.robots.manipulator import ArmOnWheels
from vico.sim.robots.quadrotor import FourRotors
from vico.sim.robots.walker import TwoLegWalker
from vico.sim.robots.wheels import SkidSteer

#: Makers of controllers by name.
CONTROLLERS: dict[str, Callable[[RobotModel], MotorController]] = {
    "motors": DirectMotors,
    "skid_steer": SkidSteer,
    "four_legs": Legs,
    "mobile_manipulator": ArmOnWheels,
    "quadrotor": FourRotors,
    "two_legs": TwoLegWalker,
}


def controller_for(model: RobotModel) -> MotorController:
    """Return what drives a kind of robot.

    Raises
    ------
    InputError
        If there is no controller of the name the model gives.
    """
    name = model.controller.name
    if name not in CONTROLLERS:
        known = ", ".join(CONTROLLERS)
        raise InputError(f"robot {model.name!r}: no controller is called {name!r}; choose among {known}")
    return CONTROLLERS[name](model)
