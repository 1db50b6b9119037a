"""The two forms of observations and actions: rich, in nested spaces, and arrays of fixed shape.

`FormOptions` says which; `ArrayForm` puts the arrays of one agent together.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Protocol

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from vico.envs.array_actions import PHRASES, ActionTable, Entry
from vico.envs.array_observations import Surroundings, observation_arrays, observation_parts, surroundings_of
from vico.envs.spaces import action_space, observation_space, rich_observation, robot_space, short_form
from vico.errors import InputError
from vico.sim.cameras import Lens, lenses_of
from vico.sim.loop.simulation import Simulation
from vico.sim.robots import ActionSpace, Reading
from vico.sim.state.simulation_state import SimulationState
from vico.world.public import PublicMap

NAMES = ("rich", "arrays")
OBSERVATIONS = ("dict", "box")
ACTIONS = ("multi", "discrete")


@dataclass(frozen=True, kw_only=True)
class FormOptions:
    """In which form observations and actions are given.

    Attributes
    ----------
    name
        ``"rich"``: all that agents are told (`vico.envs.spaces`); ``"arrays"``: arrays of fixed shape.
    observation
        Of the arrays: ``"dict"``, a flat dict of Boxes, or ``"box"``, one Box of all its numbers.
    actions
        Of people in the array form: ``"multi"``, type, level, choice and hand (MultiDiscrete), or ``"discrete"``, the
        number of an entry of the list of all actions.
    kinds
        Actions that people may do in the array form; None for all.
    texts
        Whether the dict of arrays holds what was said, as bytes.
    """

    name: str = "rich"
    observation: str = "dict"
    actions: str = "multi"
    kinds: tuple[str, ...] | None = None
    texts: bool = False

    @classmethod
    def of(cls, given: str | Mapping[str, Any]) -> FormOptions:
        """Return options by name, or from the fields of this record.

        Raises
        ------
        InputError
            If a field or its value is unknown.
        """
        content: dict[str, Any] = {"name": given} if isinstance(given, str) else dict(given)
        known = [field.name for field in fields(cls)]
        if odd := [name for name in content if name not in known]:
            raise InputError(f"env: form has no {odd[0]!r}; it has {', '.join(known)}")
        if content.get("kinds") is not None:
            content["kinds"] = tuple(content["kinds"])
        found = cls(**content)
        for name, options in (("name", NAMES), ("observation", OBSERVATIONS), ("actions", ACTIONS)):
            if getattr(found, name) not in options:
                raise InputError(f"env: form {name} is {getattr(found, name)!r}; use {' or '.join(options)}")
        return found


class ArrayForm:
    """Turns what one agent is told into arrays, and its numbers into actions.

    Parameters
    ----------
    options
        Which arrays, and which space of actions.
    public_map
        Where the agent is.
    lens, outputs
        Of its pictures; a lens of None: it is given none.
    readings, vector
        What a robot's sensors give, and the space of its vectors; None for people.

    Raises
    ------
    InputError
        If one Box is asked for, and pictures too.
    """

    def __init__(
        self,
        options: FormOptions,
        public_map: PublicMap,
        *,
        lens: Lens | None,
        outputs: Sequence[str],
        readings: Mapping[str, Reading] | None = None,
        vector: ActionSpace | None = None,
    ) -> None:
        self.options, self.public_map = options, public_map
        self.parts = observation_parts(lens, readings, outputs=outputs, texts=options.texts)
        self.table = ActionTable(options.kinds)
        #: What the agent's last observation told of.
        self.around = Surroundings()
        #: What the rules of a task allow beside those of the simulation; everything unless told.
        self.allows: Callable[[Mapping[str, Any]], bool] = lambda action: True
        self._riding = False
        self._is_flat = options.observation == "box"
        if self._is_flat and lens is not None:
            raise InputError("env: one Box holds no pictures; use observe='none', or the form's observation='dict'")
        self.observation_space: spaces.Space[Any] = self._observations()
        self.action_space: spaces.Space[Any] = self._actions(vector)

    def say(self, phrases: Sequence[str]) -> None:
        """Give `communicate` these phrases, the usual ones after them."""
        given = [*phrases, *PHRASES][: len(PHRASES)]
        self.table = ActionTable(self.options.kinds, phrases=given)

    def encode(self, observation: Mapping[str, Any], info: Mapping[str, Any]) -> Any:
        """Return an observation as an element of `observation_space`, and remember what choices are made of."""
        self.around = surroundings_of(observation, info, self.public_map)
        self._riding = observation["state"]["vehicle"] == "bike"
        arrays = observation_arrays(observation, self.around, self.public_map, parts=self.parts)
        if not self._is_flat:
            return arrays
        return np.concatenate([arrays[name].reshape(-1) for name in self.numeric]).astype(np.float32)

    def decode(self, action: Any) -> Any:
        """Return an element of `action_space` as the short form has it; what already is in the short form stays."""
        if isinstance(action, Mapping):
            return action
        numbers = np.asarray(action)
        if isinstance(self.action_space, spaces.Box):
            return {"type": "control", "vector": [float(value) for value in numbers.reshape(-1)]}
        return self.table.action_of(self._entry(numbers), self.around, riding=self._riding)

    def number(self, action: Mapping[str, Any]) -> Any:
        """Return the element of `action_space` that stands for an action in the short form, for demonstrations.

        Raises
        ------
        InputError
            If there is none; see `ActionTable.entry_of`.
        """
        if isinstance(self.action_space, spaces.Box):
            return np.asarray(action["vector"], np.float32)
        entry = self.table.entry_of(action, self.around)
        if isinstance(self.action_space, spaces.Discrete):
            return np.int64(self.table.number_of(entry))
        return np.array(entry, np.int64)

    def mask(self, agent: int, state: SimulationState) -> NDArray[np.int8] | None:
        """Return which numbers are possible now, as libraries with masks take it; None for a robot's vector.

        Parameters
        ----------
        agent
            Its index in ``state.names``.
        """
        if isinstance(self.action_space, spaces.Box):
            return None
        mask = self.table.mask(agent, state, self.around, allows=self.allows, riding=self._riding)
        return mask if isinstance(self.action_space, spaces.Discrete) else self.table.parts_mask(mask)

    @property
    def numeric(self) -> list[str]:
        """Names of the arrays that one Box is made of, in its order."""
        return [name for name, space in self.parts.items() if space.dtype == np.float32]

    def _entry(self, numbers: NDArray[Any]) -> Entry:
        if isinstance(self.action_space, spaces.Discrete):
            number = int(numbers.reshape(-1)[0])
            if not 0 <= number < len(self.table.menu):
                raise InputError(f"env: action {number}; there are 0 to {len(self.table.menu) - 1}")
            return self.table.menu[number]
        values = numbers.reshape(-1).astype(np.int64)
        if not self.table.space.contains(values):
            raise InputError(f"env: action {values.tolist()} is not in {self.table.space}")
        return Entry(*values.tolist())

    def _observations(self) -> spaces.Space[Any]:
        if not self._is_flat:
            return spaces.Dict(dict(self.parts))
        low = np.concatenate([np.asarray(self.parts[name].low, np.float32).reshape(-1) for name in self.numeric])
        high = np.concatenate([np.asarray(self.parts[name].high, np.float32).reshape(-1) for name in self.numeric])
        return spaces.Box(low, high, dtype=np.float32)

    def _actions(self, vector: ActionSpace | None) -> spaces.Space[Any]:
        if vector is not None:
            return spaces.Box(vector.low.astype(np.float32), vector.high.astype(np.float32))
        return spaces.Discrete(len(self.table.menu)) if self.options.actions == "discrete" else self.table.space


class Form(Protocol):
    """Form of one agent's observations and actions."""

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
