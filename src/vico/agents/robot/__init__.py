"""Robots that work with an arm: what they know of their body, see around it, and do with things."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vico.agents.base import Agent
from vico.agents.robot.carrier import Carrier, Scout, Team
from vico.agents.robot.heuristic import Manipulator
from vico.errors import InputError
from vico.world.public import PublicMap

#: Pairs of robots that come with the community robot challenge.
METHODS = ("heuristic", "alone", "ours")


def make_robots(
    method: str, told: Mapping[str, Any], public_map: PublicMap, team: Team, *, seed: int
) -> dict[str, Agent]:
    """Make the two robots of a method, by their names.

    Parameters
    ----------
    told
        What the task tells them.
    team
        Their bodies.

    Raises
    ------
    InputError
        If there is no such method.
    """
    if method not in METHODS:
        raise InputError(f"robot: no method called {method!r}; there are {', '.join(METHODS)}")
    arm = Manipulator(told, team, carrier="robot_1", uses_deck=method == "heuristic", pushes=method == "ours")
    carrier = Carrier("robot_0", period=float(told["period"])) if method != "ours" else Scout(told, "robot_0")
    return {"robot_0": arm, "robot_1": carrier}
