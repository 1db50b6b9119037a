"""Robots at work with a person or with each other, and the people they work with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vico.agents.base import Agent
from vico.agents.teaming.escort import Escort, Guide
from vico.agents.teaming.object_search import Finder, Spotter
from vico.agents.teaming.team_skills import IdleRobot
from vico.errors import InputError
from vico.world.public import PublicMap

#: Teams that come with the teaming challenge: with ``alone`` each robot does its part as if nobody else were there.
METHODS = ("heuristic", "alone")


def make_team(method: str, told: Mapping[str, Any], public_map: PublicMap, *, seed: int) -> dict[str, Agent]:
    """Make the robots of a task by a method, by their names.

    Parameters
    ----------
    told
        What the task tells them.

    Raises
    ------
    InputError
        If there is no such method or category.
    """
    if method not in METHODS:
        raise InputError(f"teaming: no method called {method!r}; there are {', '.join(METHODS)}")
    together = method == "heuristic"
    match told["category"]:
        case "accompany":
            return {"robot_0": Escort(told, public_map, stays_near=together)}
        case "guide":
            return {"robot_0": Guide(told, public_map, looks_back=together)}
        case "spot" if together:
            return {
                "robot_0": Spotter(told, public_map, other="robot_1"),
                "robot_1": Finder(told, spotter="robot_0"),
            }
        case "spot":
            return {"robot_0": IdleRobot(), "robot_1": Finder(told, spotter="")}
        case category:
            raise InputError(f"teaming: no category called {category!r}; there are accompany, guide and spot")
