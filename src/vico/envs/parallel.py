"""The simulation as a PettingZoo `ParallelEnv`: residents, assistants and robots act at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Unpack

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from vico.community import read_community
from vico.community.model import Community
from vico.envs.spaces import action_space, observation_space, robot_space, short_form
from vico.envs.spec import EnvOptions, EnvSpec
from vico.errors import InputError
from vico.seeds import rng
from vico.sim.actions import AgentFault
from vico.sim.events import Event
from vico.sim.eyes import lenses_of
from vico.sim.simulation import Simulation
from vico.world.folder import World, read_world
from vico.world.public import PublicMap

Setup = Callable[[Simulation], None]
#: Folders, or what was read from them.
WorldSource = World | Path | str
CommunitySource = Community | Path | str | None


class CommunityEnv(ParallelEnv):  # type: ignore[misc]
    """A community in a world.

    Agents are called ``resident_0``, ``assistant_0``, ``robot_0`` and so on. Observations and actions are described
    in `vico.envs.spaces`. There is no reward of its own (0 for everybody): tasks judge the state. An episode ends,
    truncated, after ``spec.max_steps`` steps.

    A step is a second, unless ``spec.periods`` give some agents other control periods: then it lasts until the next
    agent is due, and what `step` returns holds those alone who are due, while ``agents`` lists all as ever. Only when
    the episode ends is everybody there.

    Parameters
    ----------
    world, community
        What to simulate.
    spec
        Everything else; `reset(seed=...)` replaces its seed.
    setup
        Called with the fresh simulation at each reset: to add objects and place agents.
    """

    metadata = {"render_modes": ["rgb_array"], "name": "vico/Community-v0", "is_parallelizable": True}  # noqa: RUF012
    render_mode = "rgb_array"

    def __init__(
        self,
        world: World,
        community: Community | None = None,
        *,
        spec: EnvSpec | None = None,
        setup: Setup | None = None,
    ) -> None:
        self.spec = spec or EnvSpec()
        if self.spec.max_steps < 1:
            raise InputError(f"env: max_steps is {self.spec.max_steps}; it has to be 1 or more")
        self.world = world
        self.community = community
        self.config = self.spec.config
        self.max_steps = self.spec.max_steps
        self.public_map = PublicMap.from_world(world)
        self.events: list[Event] = []
        self._setup = setup
        self._episode = 0
        # What one may enter: places from the street, rooms from within.
        self._places = [place.id for place in world.places] + [room.id for room in world.rooms]
        # Made at once, so that the agents and their spaces are known before the first reset.
        self._simulation: Simulation | None = self._fresh(self.config.seed)
        self._views: dict[str, Any] = {}
        self.possible_agents: list[str] = list(self.sim.agents)
        self.agents: list[str] = []
        seeing = {self.possible_agents[i] for i in self.sim.seeing}
        people = self.sim.state.people.names
        robots = self.sim.state.robots
        numbers = {} if robots is None else {name: k for k, name in enumerate(robots.names)}
        lenses = lenses_of(self.sim.state, self.config)
        self._observation_spaces = {
            name: observation_space(
                lenses[name] if name in seeing else None,
                robots.readings(numbers[name]) if robots is not None and name in numbers else None,
                outputs=self.config.outputs,
            )
            for name in self.possible_agents
        }
        self._action_spaces: dict[str, spaces.Dict] = {
            name: action_space(len(self._places), len(people), world.half) for name in people
        }
        if robots is not None:
            own = {name: next(iter(robots.action_spaces(k).values())) for name, k in numbers.items()}
            self._action_spaces |= {name: robot_space(space) for name, space in own.items()}

    @property
    def sim(self) -> Simulation:
        """The simulation under way; for evaluators, not for agents."""
        if self._simulation is None:
            raise InputError("env: closed; make a new one with vico.make")
        return self._simulation

    def observation_space(self, agent: str) -> spaces.Dict:
        """Space of an agent's observations; the same object each time."""
        return self._observation_spaces[self._known(agent)]

    def action_space(self, agent: str) -> spaces.Dict:
        """Space of an agent's actions; the same object each time."""
        return self._action_spaces[self._known(agent)]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, dict[str, Any]], dict[str, dict[str, Any]]]:
        """Start an episode.

        Parameters
        ----------
        seed
            Decides the episode. Without one, the first episode takes the configuration's, and later ones follow
            from it.
        options
            Not used.
        """
        if seed is not None:
            self.config, self._episode = replace(self.config, seed=seed), 0
        number = self._episode
        self._episode += 1
        drawn = self.config.seed if number == 0 else int(rng(self.config.seed, "episode", number).integers(2**31))
        unused = self.sim.metrics.steps == 0 and self.sim.config.seed == drawn and not self.agents
        if not unused:
            self._simulation = self._fresh(drawn)
        self.agents = list(self.possible_agents)
        self.events = []
        told, infos = self.sim.observe()
        self._views = observations = dict(told)
        return observations, dict(infos)

    def step(
        self, actions: Mapping[str, Any], agent_faults: Mapping[str, AgentFault] | None = None
    ) -> tuple[
        dict[str, dict[str, Any]], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]
    ]:
        """Let time pass until somebody is due; who has no action waits, bad actions are refused with a reason.

        `infos` hold ``entities`` (kind and name of what is in view) and ``hash`` (of the whole state).
        """
        if not self.agents:
            raise InputError("env: the episode is over (or has not begun); call reset() before step()")
        short = {
            name: short_form(action, self._places, self.sim.state.people.names) for name, action in actions.items()
        }
        result = self.sim.step(short, agent_faults)
        over = self.sim.metrics.steps >= self.max_steps
        observations, found = result.observations, result.infos
        if over:
            if len(observations) < len(self.agents):
                observations, found = self.sim.observe()
            self.agents = []
        names = list(observations)
        self.events = result.events
        self._views = dict(observations)
        infos = {name: {**found[name], "hash": result.hash} for name in names}
        return (
            self._views,
            dict.fromkeys(names, 0.0),
            dict.fromkeys(names, False),
            dict.fromkeys(names, over),
            infos,
        )

    def render(self) -> NDArray[np.uint8]:
        """Return what the seeing agents see, side by side, uint8, shape ``(image, k * image, 3)``."""
        pictures = [view["rgb"] for view in self._views.values() if "rgb" in view]
        if not pictures:
            raise InputError("env: nobody's views are rendered; make the env with observe='all', and reset it")
        return np.concatenate(pictures, axis=1)

    def state_hash(self) -> str:
        """Hash of the whole state."""
        return self.sim.state_hash()

    def snapshot(self) -> dict[str, NDArray[Any]]:
        """Return a copy of the whole state; see `Simulation.snapshot`."""
        return self.sim.snapshot()

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to a snapshot of this episode, or of one of an environment made in the same way."""
        self.sim.restore(arrays)
        self.agents = list(self.possible_agents) if self.sim.metrics.steps < self.max_steps else []
        self.events = []

    def close(self) -> None:
        """Let go of the simulation."""
        self._simulation = None
        self.agents = []

    def _fresh(self, seed: int) -> Simulation:
        previous = getattr(self, "_simulation", None)
        renderer = previous.existing_renderer if previous is not None else None
        simulation = Simulation(self.world, self.community, replace(self.config, seed=seed), renderer=renderer)
        if self._setup is not None:
            self._setup(simulation)
        return simulation

    def _known(self, agent: str) -> str:
        if agent not in self._action_spaces:
            raise InputError(f"env: no agent is called {agent!r}; there are {', '.join(self.possible_agents)}")
        return agent


def make(
    world: WorldSource,
    community: CommunitySource = None,
    *,
    setup: Setup | None = None,
    **options: Unpack[EnvOptions],
) -> CommunityEnv:
    """Make an environment from a world and a community, or from their folders.

    Parameters
    ----------
    setup
        Called with the fresh `Simulation` at each reset.
    options
        `seed`, `start`, `residents`, `assistants`, `robots`, `robot_places`, `errands`, `cars`, `cyclists`,
        `pedestrians`, `junctions`, `traffic`, `transit`, `observe`, `image`, `periods` and `max_steps`, as
        `vico.envs.spec.EnvSpec` has them.

    Raises
    ------
    InputError
        If the community belongs to another world, or a name or number is not usable.
    """
    spec = EnvSpec.of(world, community, options)
    return CommunityEnv(_world(world), _community(community), spec=spec, setup=setup)


def make_from_spec(spec: EnvSpec, *, setup: Setup | None = None) -> CommunityEnv:
    """Make an environment from a spec that names its folders.

    Raises
    ------
    InputError
        If it names no world: it was made of one in memory.
    """
    if spec.world is None:
        raise InputError("env: the spec names no folder of a world; set it with dataclasses.replace(spec, world=...)")
    return CommunityEnv(_world(spec.world), _community(spec.community), spec=spec, setup=setup)


def _world(source: WorldSource) -> World:
    return source if isinstance(source, World) else read_world(Path(source))


def _community(source: CommunitySource) -> Community | None:
    return source if source is None or isinstance(source, Community) else read_community(Path(source))
