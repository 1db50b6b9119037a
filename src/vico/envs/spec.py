"""Specification of an environment, a record that goes to JSON and back, and environments by id.

``gymnasium.make("vico/Community-v0", ...)`` works once `register_ids` has run, and PettingZoo's registry where it has
one.
"""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, asdict, dataclass, fields
from inspect import cleandoc
from pathlib import Path
from textwrap import wrap
from typing import Any, TypedDict

import gymnasium
import pettingzoo
from pydantic import TypeAdapter, ValidationError

from vico.clock import seconds_of_day
from vico.errors import InputError, SchemaError
from vico.sim.config import SimConfig, SimSettings, check_types

SCHEMA = "vico.env"
VERSION = 1


class EnvOptions(TypedDict, total=False):
    """Options of an environment: the fields of `EnvSpec`, which describes them, but for the world and community."""

    seed: int
    start: str
    residents: int | None
    assistants: int
    robots: tuple[str, ...]
    physics: str
    robot_places: Mapping[str, Sequence[float]]
    assistant_places: Mapping[str, Sequence[float]]
    errands: bool
    oracle_grasp: bool
    cars: int
    cyclists: int
    pedestrians: int
    junctions: str
    traffic: str | Mapping[str, Any]
    transit: bool
    observe: str | tuple[str, ...]
    image: int
    outputs: tuple[str, ...]
    cameras: Mapping[str, Mapping[str, Any]]
    worn: Mapping[str, str]
    quality: str | Mapping[str, bool]
    renderer: str
    memory: float
    date: str | None
    utc_offset: float | None
    weather: str | Mapping[str, Any]
    events: str | Mapping[str, Any]
    opening_hours: bool
    periods: Mapping[str, float | str]
    max_steps: int
    form: str | Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class EnvSpec(SimSettings):
    """Specification of an environment: its options beside the settings of its simulation.

    Attributes
    ----------
    world, community
        Folders, if the environment was made from folders; a community of None is nobody.
    start
        Time of day, ``HH:MM`` or ``HH:MM:SS``.
    observe
        Whose views are rendered: ``"all"``, ``"none"``, or names.
    max_steps
        Length of an episode, steps: seconds, unless `periods` ask for others.
    form
        In which observations and actions are given: ``"rich"``, ``"arrays"``, or the fields of
        `vico.envs.forms.FormOptions`.
    """

    world: str | None = None
    community: str | None = None
    start: str = "08:00"
    observe: str | tuple[str, ...] = "all"
    max_steps: int = 1500
    form: str | Mapping[str, Any] = "rich"

    def __post_init__(self) -> None:
        check_types(self, "env")
        names = isinstance(self.observe, tuple | list) and all(isinstance(one, str) for one in self.observe)
        if not isinstance(self.observe, str) and not names:
            raise InputError(f"env: observe is {self.observe!r}; it has to be 'all', 'none', or names of agents")

    @classmethod
    def of(cls, world: Any, community: Any, options: EnvOptions) -> EnvSpec:
        """Make a spec from what `make` is given; worlds and communities in memory have no folder to name.

        Raises
        ------
        InputError
            If an option is not known.
        """
        known = [field.name for field in fields(cls)]
        unknown = [name for name in options if name not in known]
        if unknown:
            near = difflib.get_close_matches(unknown[0], known, n=1)
            meant = f"did you mean {near[0]!r}?" if near else f"options are {', '.join(known)}"
            raise InputError(f"env: there is no option {unknown[0]!r}; {meant}")
        return cls(world=_folder(world), community=_folder(community), **options)

    @property
    def config(self) -> SimConfig:
        """The simulation's configuration."""
        shared = {field.name: getattr(self, field.name) for field in fields(SimSettings)}
        shared["robots"] = tuple(self.robots)
        return SimConfig(**shared, start=seconds_of_day(self.start), observe=self._observers())

    def _observers(self) -> tuple[str, ...] | None:
        if isinstance(self.observe, str):
            return {"all": None, "none": ()}.get(self.observe, (self.observe,))
        return tuple(self.observe)

    def to_json(self) -> str:
        """Return the spec as JSON text."""
        return json.dumps({"schema_name": SCHEMA, "version": VERSION, "world": self.world} | asdict(self), indent=1)

    @classmethod
    def from_json(cls, text: str) -> EnvSpec:
        """Read what `to_json` wrote.

        Raises
        ------
        SchemaError
            If it is no such text, of another version, or a field is unknown or not usable.
        """
        try:
            content = json.loads(text)
        except json.JSONDecodeError as error:
            raise SchemaError(f"env spec: not JSON ({error}); write it with EnvSpec.to_json") from None
        found = (content.pop("schema_name", None), content.pop("version", None)) if isinstance(content, dict) else None
        if found != (SCHEMA, VERSION):
            raise SchemaError(f"env spec: not {SCHEMA} version {VERSION}; write it with EnvSpec.to_json")
        known = {field.name for field in fields(cls)}
        unknown = sorted(set(content) - known)
        if unknown:
            raise SchemaError(f"env spec: {unknown[0]}: no such field; fields are {', '.join(sorted(known))}")
        try:
            return TypeAdapter(cls).validate_python(content)
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(str(part) for part in first["loc"])
            raise SchemaError(f"env spec: {where}: {first['msg']}") from None


def option_docs() -> str:
    """Return what the options of an environment mean, with their defaults, as the docs of `EnvSpec`'s fields say it."""
    defaults = {
        field.name: field.default if field.default_factory is MISSING else field.default_factory()
        for field in fields(EnvSpec)
    }
    found: list[str] = []
    for record in (SimSettings, EnvSpec):
        listed = cleandoc(record.__doc__ or "").partition("Attributes\n----------\n")[2]
        for names, text in re.findall(r"^(\w.*)\n((?:    .*\n?)+)", listed, re.MULTILINE):
            if names != "world, community":
                options = ", ".join(f"``{name}={defaults[name]!r}``" for name in names.split(", "))
                found += wrap(f"- {options}: {' '.join(text.split())}", 112, subsequent_indent="  ")
    return "\n".join(found)


def _folder(source: Any) -> str | None:
    return str(source) if isinstance(source, (str, Path)) else None


#: One agent among residents (Gymnasium), and everybody at once (PettingZoo, parallel).
COMMUNITY_ID = "vico/Community-v0"


#: Tasks for one learner, by id, and what makes them in `vico.challenges.learning.make`: that stands on a higher floor,
#: and is imported when one is made.
TASKS = {
    "vico/PointGoal-v0": "make_point_goal",
    "vico/RobotPointGoal-v0": "make_robot_point_goal",
    "vico/Commute-v0": "make_commute",
    "vico/Carry-v0": "make_carry",
    "vico/Delivery-v0": "make_delivery",
    "vico/Search-v0": "make_search",
    "vico/RobotCarry-v0": "make_robot_carry",
    "vico/RobotDeliver-v0": "make_robot_deliver",
    "vico/Influence-v0": "make_influence",
}
#: Tasks for two robots at once, in PettingZoo's registry.
TEAM_TASKS = {
    "vico/RobotCarry-v0": "make_robot_carry_team",
    "vico/RobotDeliver-v0": "make_robot_deliver_team",
}
_LEARNING = "vico.challenges.learning.make"
#: Tasks of an arm and a box, which need no world, and what makes them.
ARM_TASKS = {
    "vico/Reach-v0": "make_reach",
    "vico/Lift-v0": "make_lift",
    "vico/Place-v0": "make_place",
    "vico/PickPlace-v0": "make_pick_place",
}
_MANIPULATION = "vico.challenges.learning.manipulation.environment"


def register_ids() -> None:
    """Register the environments; once is enough, and more does no harm.

    They take a world's folder as `world`, a community's as `community` where people are needed, and the options of
    `vico.envs.spec.EnvSpec`; those of `ARM_TASKS` take neither, but `ManipulationOptions`.
    """
    if COMMUNITY_ID not in gymnasium.registry:
        # The checks of Gymnasium's own wrapper would refuse the short form of actions.
        gymnasium.register(
            COMMUNITY_ID,
            entry_point="vico.agents.single:make_single",
            vector_entry_point="vico.agents.single:make_vec",
            disable_env_checker=True,
        )
    for module, tasks in ((_LEARNING, TASKS), (_MANIPULATION, ARM_TASKS)):
        for name, maker in tasks.items():
            if name not in gymnasium.registry:
                gymnasium.register(
                    name,
                    entry_point=f"{module}:{maker}",
                    vector_entry_point=f"{module}:{maker}_vec",
                    disable_env_checker=True,
                )
    registry = getattr(pettingzoo, "parallel_registry", None)
    if registry is None:
        return
    teams = {name: f"{_LEARNING}:{maker}" for name, maker in TEAM_TASKS.items()}
    for name, entry_point in ({COMMUNITY_ID: "vico.envs.parallel:make"} | teams).items():
        if name not in registry:
            pettingzoo.register("parallel", name, entry_point=entry_point)
