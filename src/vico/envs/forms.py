"""The two forms in which agents are told and answer: rich, in nested spaces, and arrays of fixed shape."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from vico.envs.arrays.form import ArrayForm
from vico.envs.form_options import FormOptions
from vico.envs.rich import rich_observation
from vico.envs.spaces import action_space, observation_space, robot_space, short_form
from vico.sim.cameras import lenses_of
from vico.sim.loop.simulation import Simulation
from vico.sim.state.simulation_state import SimulationState
from vico.world.public import PublicMap


class Form(Protocol):
    """How one agent is told of what it observes, and how it answers."""

    observation_space: spaces.Space[Any]
    action_space: spaces.Space[Any]

    def encode(self, observation: Mapping[str, Any], info: Mapping[str, Any]) -> Any:
        """Return what the simulation tells as an element of `observation_space`."""

    def decode(self, action: Any) -> Any:
        """Return an action as the short form has it."""

    def mask(self, agent: int, state: SimulationState) -> NDArray[np.int8] | None:
        """Return which actions are possible now; None where the form has no masks."""


class RichForm:
    """Nested spaces; actions also in the short form."""

    def __init__(
        self, observations: spaces.Dict, actions: spaces.Dict, *, places: list[str], people: list[str]
    ) -> None:
        self.observation_space: spaces.Space[Any] = observations
        self.action_space: spaces.Space[Any] = actions
        self._places, self._people = places, people

    def encode(self, observation: Mapping[str, Any], info: Mapping[str, Any]) -> dict[str, Any]:
        """Return an observation as an element of the space."""
        return rich_observation(observation)

    def decode(self, action: Any) -> Any:
        """Return an action in the short form."""
        return short_form(action, self._places, self._people)

    def mask(self, agent: int, state: SimulationState) -> None:
        """Return nothing: these spaces have no masks."""


def forms_of(options: FormOptions, sim: Simulation, public_map: PublicMap) -> dict[str, Form]:
    """Return the form of each agent, by name.

    Raises
    ------
    InputError
        If pictures are asked for in one Box.
    """
    config, state, world = sim.config, sim.state, sim.world
    names, people, robots = list(sim.agents), list(state.people.names), state.robots
    seeing = {names[i] for i in sim.seeing}
    lenses = lenses_of(state, config)
    numbers = {} if robots is None else {name: k for k, name in enumerate(robots.names)}
    # What one may enter: places from the street, rooms from within.
    places = [place.id for place in world.places] + [room.id for room in world.rooms]
    found: dict[str, Form] = {}
    for name in names:
        lens = lenses[name] if name in seeing else None
        robot = numbers.get(name)
        readings = None if robots is None or robot is None else robots.readings(robot)
        vector = None if robots is None or robot is None else next(iter(robots.action_spaces(robot).values()))
        if options.name == "arrays":
            found[name] = ArrayForm(
                options, public_map, lens=lens, outputs=config.outputs, readings=readings, vector=vector
            )
            continue
        found[name] = RichForm(
            observation_space(lens, readings, outputs=config.outputs),
            robot_space(vector) if vector is not None else action_space(len(places), len(people), world.half),
            places=places,
            people=people,
        )
    return found
