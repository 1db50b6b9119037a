"""The simulation as environments: a PettingZoo `ParallelEnv`, and a Gymnasium environment of one agent.

Residents, assistants and robots act at once; in the environment of one agent, the others act by policies of their
own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from textwrap import indent
from typing import Any, Protocol, Unpack

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from vico.community import read_community
from vico.community.model import Community
from vico.envs.forms import Form, FormOptions, forms_of
from vico.envs.spec import EnvOptions, EnvSpec, option_docs
from vico.errors import InputError
from vico.seeds import rng
from vico.sim.actions import AgentFault
from vico.sim.loop.simulation import Simulation, StepResult
from vico.sim.state.steps import Event
from vico.world.folder import read_world
from vico.world.public import PublicMap
from vico.world.world import World

Setup = Callable[[Simulation], None]
#: Folders, or what was read from them.
WorldSource = World | Path | str
CommunitySource = Community | Path | str | None


class CommunityEnv(ParallelEnv):  # type: ignore[misc]
    """A community in a world.

    Agents are called ``resident_0``, ``assistant_0``, ``robot_0`` and so on. Observations and actions are described
    in `vico.envs.spaces`, and in `vico.envs.array_observations` for ``spec.form`` ``"arrays"``. There is no reward of
    its own (0 for everybody): tasks judge the state. An episode ends, truncated, after ``spec.max_steps`` steps.

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
        self._arranged = False
        # Made at once, so that the agents and their spaces are known before the first reset.
        self._simulation: Simulation | None = self._fresh(self.config.seed)
        self._last: StepResult | None = None
        self.possible_agents: list[str] = list(self.sim.agents)
        self.agents: list[str] = []
        #: How each agent is told of what it observes, and how it answers.
        options = FormOptions.of(self.spec.form)
        self.forms: dict[str, Form] = forms_of(options, self.sim, self.public_map)
        self._plain_infos = options.name == "arrays"
        self._index = {name: i for i, name in enumerate(self.possible_agents)}

    def __repr__(self) -> str:
        agents = self.possible_agents
        first = ", ".join(agents[:3]) + (", ..." if len(agents) > 3 else "")
        return (
            f"{type(self).__name__}(world {self.world.manifest.name!r}, {len(agents)} agents ({first}), episodes of "
            f"{self.max_steps} steps)"
        )

    @property
    def sim(self) -> Simulation:
        """The simulation under way; for evaluators, not for agents."""
        if self._simulation is None:
            raise InputError("env: closed; make a new one with vico.make")
        return self._simulation

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Space of an agent's observations; the same object each time."""
        return self.forms[self._require_agent(agent)].observation_space

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Space of an agent's actions; the same object each time."""
        return self.forms[self._require_agent(agent)].action_space

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Start an episode.

        Parameters
        ----------
        seed
            Decides the episode. Without one, the first episode takes the configuration's, and later ones follow
            from it.
        options
            Not used.
        """
        result = self.begin(seed)
        return self._observations_of(result)

    def step(
        self, actions: Mapping[str, Any], agent_faults: Mapping[str, AgentFault] | None = None
    ) -> tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Let time pass until somebody is due; who has no action waits, bad actions are refused with a reason.

        `infos` hold ``entities`` (kind and name of what is in view), ``hash`` (of the whole state) and more; see
        `vico.sim.observations.observe`. In the array form they hold people's ``action_mask`` alone: libraries for many
        agents make tensors of them.
        """
        result = self.advance(actions, agent_faults)
        observations, infos = self._observations_of(result)
        over = not self.agents
        return (
            observations,
            dict.fromkeys(observations, 0.0),
            dict.fromkeys(observations, False),
            dict.fromkeys(observations, over),
            infos,
        )

    def begin(self, seed: int | None = None) -> StepResult:
        """Start an episode as `reset` does; return what the simulation tells, in no form: each part when asked for."""
        if seed is not None:
            self.config, self._episode = replace(self.config, seed=seed), 0
        number = self._episode
        self._episode += 1
        drawn = self.config.seed if number == 0 else int(rng(self.config.seed, "episode", number).integers(2**31))
        unused = self.sim.metrics.steps == 0 and self.sim.config.seed == drawn and not self.agents
        if self._arranged or not unused:
            self._arranged = False
            self._simulation = self._fresh(drawn)
        self.agents = list(self.possible_agents)
        self.events = []
        self._last = StepResult(*self.sim.observe(), [], lambda: "")
        return self._last

    def arrange(self, setup: Setup | None = None, **changes: Any) -> None:
        """Have the episodes from the next one on begin otherwise.

        Parameters
        ----------
        setup
            Called with the fresh simulation at each reset, instead of the one before; None leaves that.
        changes
            Fields of the simulation's configuration (`vico.sim.config.SimConfig`) that decide neither who takes part
            nor what they observe: ``start``, ``robot_places``, ``weather`` and the like.
        """
        self.config = replace(self.config, **changes)
        self._setup = self._setup if setup is None else setup
        self._arranged = True

    def advance(self, actions: Mapping[str, Any], agent_faults: Mapping[str, AgentFault] | None = None) -> StepResult:
        """Make a step as `step` does; return what the simulation tells, in no form: each part when asked for.

        Raises
        ------
        InputError
            If the episode is over, or has not begun, or an action is for nobody of the environment.
        """
        if not self.agents:
            raise InputError("env: the episode is over (or has not begun); call reset() before step()")
        short = {name: self.forms[self._require_agent(name)].decode(action) for name, action in actions.items()}
        result = self.sim.step(short, agent_faults)
        if self.sim.metrics.steps >= self.max_steps:
            if len(result.observations) < len(self.agents):
                observations, infos = self.sim.observe()
                result = replace(result, observations=observations, infos=infos)
            self.agents = []
        self.events = result.events
        self._last = result
        return result

    def told(self, name: str, result: StepResult) -> tuple[Any, dict[str, Any]]:
        """Return one agent's observation, in its form, and its info."""
        observation, found = result.observations[name], result.infos[name]
        # Copies: what is told may be kept and changed.
        info = dict(found)
        if "entities" in info:
            info["entities"] = {entity: dict(about) for entity, about in info["entities"].items()}
        if result.hash:
            info["hash"] = result.hash
        form = self.forms[name]
        encoded = form.encode(observation, found)
        if (mask := form.mask(self._index[name], self.sim.state)) is not None:
            info["action_mask"] = mask
        return encoded, info

    def __reduce__(self) -> tuple[Any, ...]:
        """Let other processes make the same environment: they read the world's folder, and begin with a reset.

        Raises
        ------
        InputError
            If the world has no folder.
        """
        if self.world.path is None:
            raise InputError("env: one of a world in memory cannot go to another process; write the world first")
        return _rebuild_env, (self.world.path, self.community, self.spec, self._setup)

    def _observations_of(self, result: StepResult) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        observations: dict[str, Any] = {}
        infos: dict[str, dict[str, Any]] = {}
        for name in result.observations:
            observations[name], info = self.told(name, result)
            infos[name] = {k: v for k, v in info.items() if k == "action_mask"} if self._plain_infos else info
        return observations, infos

    def render(self) -> NDArray[np.uint8]:
        """Return what the seeing agents see, side by side, uint8, shape ``(image, k * image, 3)``."""
        seeing = [self.possible_agents[i] for i in self.sim.seeing]
        seen = {} if self._last is None else self._last.observations
        pictures = [seen[name]["rgb"] for name in seeing if name in seen and "rgb" in seen[name]]
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
        self._simulation = self._last = None
        self.agents = []

    def _fresh(self, seed: int) -> Simulation:
        previous = getattr(self, "_simulation", None)
        renderer = previous.existing_renderer if previous is not None else None
        simulation = Simulation(self.world, self.community, replace(self.config, seed=seed), renderer=renderer)
        if self._setup is not None:
            self._setup(simulation)
        return simulation

    def _require_agent(self, agent: str) -> str:
        if agent not in self.forms:
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
    world, community
        What to simulate; a community of None is nobody.
    setup
        Called with the fresh `Simulation` at each reset.
    options
        The fields of `vico.envs.spec.EnvSpec`, each with its default:

    Raises
    ------
    InputError
        If the community belongs to another world, or a name or number is not usable.
    """
    spec = EnvSpec.of(world, community, options)
    return CommunityEnv(_world(world), _community(community), spec=spec, setup=setup)


make.__doc__ = (make.__doc__ or "").replace(
    "each with its default:\n", f"each with its default:\n\n{indent(option_docs(), ' ' * 8)}\n"
)


def _rebuild_env(world: Path, community: Community | None, spec: EnvSpec, setup: Setup | None) -> CommunityEnv:
    return CommunityEnv(_world(world), community, spec=spec, setup=setup)


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


class Policy(Protocol):
    """Turns observations into actions; see `vico.agents.base.Agent`."""

    def act(self, observation: dict[str, Any], info: dict[str, Any]) -> dict[str, Any]:
        """Return the action for the coming second."""


#: Given what all observe and their infos, as the simulation tells them, the actions of some agents by name.
Answers = Callable[[Mapping[str, dict[str, Any]], Mapping[str, dict[str, Any]]], Mapping[str, dict[str, Any]]]
#: Given the community's environment and the seed of an episode, the policies of agents by name, or what asks them all.
Others = Callable[[CommunityEnv, int], Mapping[str, Policy] | Answers]


class SingleAgentEnv(gymnasium.Env[Any, Any]):
    """One agent among others.

    Parameters
    ----------
    env
        The community.
    agent
        Whose observations and actions they are.
    others
        Gives those who act beside it; without it, and for whom it gives no policy, the others wait.

    Raises
    ------
    InputError
        If there is no such agent.
    """

    metadata = {"render_modes": ["rgb_array"]}  # noqa: RUF012
    render_mode = "rgb_array"

    def __init__(self, env: CommunityEnv, agent: str, *, others: Others | None = None) -> None:
        self.community = env
        self.agent = agent
        self.observation_space = env.observation_space(agent)
        self.action_space = env.action_space(agent)
        self._make_others = others
        self._others: Answers = _no_actions
        self._last: StepResult | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start an episode; see `CommunityEnv.reset`."""
        super().reset(seed=seed)
        self._last = self.community.begin(seed)
        if self._make_others is not None:
            made = self._make_others(self.community, self.community.sim.config.seed)
            self._others = made if callable(made) else _ask_policies(made)
        return self.community.told(self.agent, self._last)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Advance until the agent is due again; the others act upon what they saw last."""
        own = {self.agent: action}
        while True:
            others = {} if self._last is None else self._others(self._last.observations, self._last.infos)
            self._last = self.community.advance({**others, **own})
            if self.agent in self._last.observations:
                observation, info = self.community.told(self.agent, self._last)
                return observation, 0.0, False, not self.community.agents, info
            own = {}

    def action_masks(self) -> NDArray[np.bool_]:
        """Return which actions are possible now, as `sb3_contrib.MaskablePPO` asks for it.

        Raises
        ------
        InputError
            If the form of the environment has no masks.
        """
        community = self.community
        mask = community.forms[self.agent].mask(community.possible_agents.index(self.agent), community.sim.state)
        if mask is None:
            raise InputError("env: there are masks with form='arrays' alone, and for people alone")
        return mask.astype(bool)

    def render(self) -> NDArray[np.uint8]:
        """Return what the agent sees, uint8, shape ``(image, image, 3)``."""
        seen = {} if self._last is None else self._last.observations[self.agent]
        return seen["rgb"] if "rgb" in seen else self.community.render()

    def close(self) -> None:
        """Let go of the simulation."""
        self.community.close()


def _no_actions(
    observations: Mapping[str, dict[str, Any]], infos: Mapping[str, dict[str, Any]]
) -> Mapping[str, dict[str, Any]]:
    return {}


def _ask_policies(policies: Mapping[str, Policy]) -> Answers:
    """Ask each of some policies that has an observation."""

    def answers(
        observations: Mapping[str, dict[str, Any]], infos: Mapping[str, dict[str, Any]]
    ) -> Mapping[str, dict[str, Any]]:
        return {n: one.act(observations[n], infos[n]) for n, one in policies.items() if n in observations}

    return answers
