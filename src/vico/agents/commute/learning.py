"""Learning to commute: the environment to train in (Gymnasium), training cities from public maps, trained policies.

The environment holds many agents in some abstract cities at once, a second a step. An episode is one commute: from a
point of the streets to a place, with slack drawn as the challenge draws it. It ends at the place, or is cut off two
minutes after the appointment's start. The reward is the paper's (appendix "Single Agent Task"): 1000 at the place, the
metres that one got nearer, -1 a step on foot, -1 a unit of money, -0.1 an action.

What differs from the full simulation: no cars, pedestrians and signals; buses keep the timetable and go straight from
stop to stop; a bicycle needs no room to get on or off, and stations never run out; turns are of 30 degrees.

A trained policy is dense layers as arrays; `PolicyCommuter` is the agent that acts by them.
"""

from __future__ import annotations

import math
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from numpy.typing import NDArray

from vico.agents.base import (
    Action,
    FieldState,
    Info,
    Observation,
    heading,
)
from vico.agents.commute.abstract_city import (
    ACTIONS,
    BEGAN,
    BIKE,
    BUS,
    CASH,
    DUE,
    FOOT,
    GOAL_X,
    GOAL_Y,
    HEADING,
    HIT,
    LAST,
    OBSERVATION_SIZE,
    SINCE,
    STATE_SIZE,
    TIME,
    TURN,
    VEHICLE,
    CityArrays,
    X,
    Y,
    city_arrays,
    clearance_at,
    observe,
    observe_all,
    step_all,
)
from vico.errors import EmptyInputError, InputError, MissingFileError, SchemaError
from vico.exact import each
from vico.geometry import distance
from vico.io.arrays import read_npz
from vico.rules import BIKE_SPEED, BUS_DWELL, WALK_SPEED
from vico.seeds import rng
from vico.world.public import PublicMap
from vico.world.walkable import OPEN, SIDEWALK

#: Seconds after the start of an appointment at which a commute is given up.
CUTOFF_AFTER = 120.0
_DRAW_TRIES = 20


class EpisodeDraws(NamedTuple):
    """From what episodes are drawn.

    Attributes
    ----------
    least, most
        Metres as the crow flies between start and goal of a commute.
    near, near_share
        Metres of episodes that begin near their goal, and their share.
    riding_share
        Share of the episodes that begin on a bicycle, as one was kept; those are not near.
    last_share
        Share of a day's last commutes, at whose end one has to be on foot.
    slack
        Share of the walking time as the crow flies that one has beside it.
    hours
        Of the day, between which they begin.
    cash
        Money at the start.
    reach
        Metres from the goal at which one is there.
    """

    least: float = 250.0
    most: float = 700.0
    near: tuple[float, float] = (4.0, 60.0)
    near_share: float = 0.45
    riding_share: float = 0.35
    last_share: float = 0.2
    slack: tuple[float, float] = (0.3, 1.1)
    hours: tuple[float, float] = (8.0, 16.0)
    cash: tuple[float, float] = (100.0, 600.0)
    reach: float = 3.0


class TrainingCity(NamedTuple):
    """A city to train in.

    Attributes
    ----------
    goals
        Points of places, ENU metres, shape ``(k, 2)``.
    starts
        Points of streets and squares, shape ``(k, 2)``.
    """

    arrays: CityArrays
    goals: NDArray[np.float64]
    starts: NDArray[np.float64]


class CommuteVectorEnv(VectorEnv[Any, Any, Any]):
    """Commuters in some cities, as many in each.

    Parameters
    ----------
    cities
        Where.
    num_envs
        Agents in all, a multiple of the number of cities.
    seed
        Decides all episodes.
    draws
        From what they are drawn.
    """

    metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012

    def __init__(
        self, cities: Sequence[TrainingCity], *, num_envs: int, seed: int = 0, draws: EpisodeDraws | None = None
    ) -> None:
        if not cities or num_envs < 1 or num_envs % len(cities):
            raise InputError(f"commute training: {num_envs} agents in {len(cities)} cities; give a multiple of them")
        for city in cities:
            if not len(city.goals) or not len(city.starts):
                raise EmptyInputError("commute training: a city without places or streets")
        self.num_envs = num_envs
        self.cities, self.draws = list(cities), draws or EpisodeDraws()
        self.single_observation_space = spaces.Box(-10.0, 10.0, (OBSERVATION_SIZE,), np.float32)
        self.single_action_space = spaces.Discrete(len(ACTIONS))
        self.observation_space = gymnasium.vector.utils.batch_space(self.single_observation_space, num_envs)
        self.action_space = gymnasium.vector.utils.batch_space(self.single_action_space, num_envs)
        self.states = np.zeros((num_envs, STATE_SIZE))
        self._each = num_envs // len(cities)
        self._seen = np.zeros((num_envs, OBSERVATION_SIZE), np.float32)
        self._rewards, self._reached = np.zeros(num_envs), np.zeros(num_envs, np.bool_)
        self._returns = np.zeros(num_envs)
        self._chance = rng(seed, "commute training")

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode for every agent; a seed decides all that follow."""
        if isinstance(seed, int):
            self._chance = rng(seed, "commute training")
        self._returns[:] = 0.0
        for i in range(self.num_envs):
            self._begin(i)
        self._see()
        return self._seen.copy(), {}

    def step(
        self, actions: NDArray[np.int64]
    ) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Advance all by a second; who is done begins anew at once.

        ``infos`` hold ``final_obs`` (what all saw before that), who ``ended``, and of those, in the same order,
        ``returns``, ``seconds``, ``arrived`` and ``late``.
        """
        chosen = np.ascontiguousarray(actions, np.int64)
        for city, part in self._parts():
            step_all(
                city.arrays,
                self.states[part],
                chosen[part],
                self.draws.reach,
                self._rewards[part],
                self._reached[part],
            )
        self._returns += self._rewards
        reached = self._reached.copy()
        given_up = ~reached & (self.states[:, TIME] >= self.states[:, DUE] + CUTOFF_AFTER)
        ended = np.flatnonzero(reached | given_up)
        infos: dict[str, Any] = {}
        if len(ended):
            self._see()
            now, states = self.states[ended, TIME], self.states[ended]
            infos = {
                "final_obs": self._seen.copy(),
                "ended": ended,
                "returns": self._returns[ended].copy(),
                "seconds": now - states[:, BEGAN],
                "arrived": reached[ended],
                "late": ~reached[ended] | (now > states[:, DUE]),
            }
            self._returns[ended] = 0.0
            for i in ended.tolist():
                self._begin(i)
        self._see()
        return self._seen.copy(), self._rewards.copy(), reached, given_up, infos

    def _parts(self) -> list[tuple[TrainingCity, slice]]:
        return [(city, slice(k * self._each, (k + 1) * self._each)) for k, city in enumerate(self.cities)]

    def _see(self) -> None:
        for city, part in self._parts():
            observe_all(city.arrays, self.states[part], self._seen[part])

    def _near(self, city: TrainingCity, goal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Draw a start near a goal, so that a beginner comes upon it."""
        for _ in range(_DRAW_TRIES):
            away, angle = self._chance.uniform(*self.draws.near), self._chance.uniform(-np.pi, np.pi)
            start = goal + away * np.array([np.cos(angle), np.sin(angle)])
            if clearance_at(city.arrays, start[0], start[1]) > 0.0:
                return np.asarray(start)
        return self._far(city, goal)

    def _far(self, city: TrainingCity, goal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Draw a start as far from a goal as commutes are."""
        start = city.starts[int(self._chance.integers(len(city.starts)))]
        for _ in range(_DRAW_TRIES):
            if self.draws.least <= distance(start, goal) <= self.draws.most:
                break
            start = city.starts[int(self._chance.integers(len(city.starts)))]
        return start

    def _begin(self, i: int) -> None:
        city, draws, chance = self.cities[i // self._each], self.draws, self._chance
        goal = city.goals[int(chance.integers(len(city.goals)))]
        kind = float(chance.random())
        start = self._near(city, goal) if kind < draws.near_share else self._far(city, goal)
        away = distance(start, goal)
        time = 3600.0 * chance.uniform(*draws.hours)
        state = self.states[i]
        state[:] = 0.0
        state[X], state[Y] = start
        state[GOAL_X], state[GOAL_Y] = goal
        state[HEADING] = chance.uniform(-np.pi, np.pi)
        state[TIME] = state[BEGAN] = round(time)
        state[DUE] = state[TIME] + away * (1.0 + chance.uniform(*draws.slack))
        if draws.near_share <= kind < draws.near_share + draws.riding_share:
            state[VEHICLE], state[SINCE] = BIKE, state[TIME]
        state[LAST] = float(chance.random() < draws.last_share)
        state[CASH] = chance.uniform(*draws.cash)


# Room that starts have around them, metres.
_START_CLEARANCE = 0.5


def training_city(public_map: PublicMap) -> TrainingCity:
    """Return a city to train in: goals are the places one can reach, starts sidewalks and squares."""
    walkable = public_map.walkable
    points = np.array([place.position[:2] for place in public_map.places], np.float64).reshape(-1, 2)
    free = walkable.connected & np.isin(walkable.cls, (OPEN, SIDEWALK)) & (walkable.clearance >= _START_CLEARANCE)
    rows, columns = np.nonzero(free)
    starts = walkable.centre_of(np.column_stack([columns, rows]))
    return TrainingCity(city_arrays(public_map, dwell=BUS_DWELL), points[walkable.is_connected(points)], starts)


class Network:
    """Dense layers with tanh between them; the last gives a logit for each action.

    Parameters
    ----------
    layers
        Weights, shape ``(in, out)``, and biases, shape ``(out,)``, in turn.
    """

    def __init__(self, layers: list[NDArray[np.float32]]) -> None:
        self._layers = layers

    @classmethod
    def read(cls, path: Path) -> Network:
        """Read a network from an archive of arrays ``w0``, ``b0``, ``w1`` and on.

        Raises
        ------
        MissingFileError
            If there is no such file.
        SchemaError
            If it is damaged, or its layers do not fit each other, what is seen, or the actions.
        """
        try:
            arrays = read_npz(path.read_bytes())
        except FileNotFoundError:
            raise MissingFileError(f"{path}: no such file; train it with scripts/train_commute.py") from None
        except (ValueError, OSError, EOFError, zipfile.BadZipFile, zlib.error) as error:
            raise SchemaError(f"{path}: not a policy ({error}); train it with scripts/train_commute.py") from None
        layers: list[NDArray[np.float32]] = []
        width = OBSERVATION_SIZE
        for k in range(len(arrays) // 2):
            w, b = arrays.get(f"w{k}"), arrays.get(f"b{k}")
            if w is None or b is None or w.shape != (width, *b.shape) or not np.isfinite(w).all():
                raise SchemaError(f"{path}: layer {k} does not fit; train it anew with scripts/train_commute.py")
            layers += [w.astype(np.float32), b.astype(np.float32)]
            width = len(b)
        if width != len(ACTIONS) or not layers:
            raise SchemaError(f"{path}: {width} actions, and there are {len(ACTIONS)}; train it anew")
        return cls(layers)

    def logits(self, seen: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the logit of each action, shape ``(actions,)``, for what is seen, shape ``(SEEN,)``."""
        x = seen
        for k in range(0, len(self._layers), 2):
            # Summed input by input, in one order whatever the machine's BLAS.
            x = (x[:, None] * self._layers[k]).sum(axis=0) + self._layers[k + 1]
            if k < len(self._layers) - 2:
                x = each(math.tanh, x).astype(np.float32)
        return x


class PolicyCommuter(FieldState):
    """Acts by a trained network, one second after the other, as it was trained: actions are drawn by their chances.

    Parameters
    ----------
    network
        The policy.
    public_map
        From which it takes what it sees beside its pose: free ground, stops with their timetable, stations.
    seed
        Of the episode.
    """

    _generator: np.random.Generator

    def __init__(self, network: Network, public_map: PublicMap, *, seed: int) -> None:
        self._network = network
        self._city: CityArrays = city_arrays(public_map, dwell=BUS_DWELL)
        self._generator = rng(seed, "commute policy")
        self._state = np.zeros(STATE_SIZE)
        self._seen = np.zeros(OBSERVATION_SIZE, np.float32)

    def act(self, observation: Observation, info: Info) -> Action:
        """Return an action drawn by the network's chances."""
        fill_state(self._state, observation, info["commute"])
        observe(self._city, self._state, self._seen)
        logits = self._network.logits(self._seen).astype(np.float64)
        chances = each(math.exp, logits - logits.max())
        kind = int(np.searchsorted(np.cumsum(chances), self._generator.random() * chances.sum()))
        name = ACTIONS[min(kind, len(ACTIONS) - 1)]
        if name == "move_forward":
            speed = BIKE_SPEED if self._state[VEHICLE] == BIKE else WALK_SPEED
            return {"type": "move_forward", "distance": speed}
        if name in ("turn_left", "turn_right"):
            return {"type": name, "degrees": math.degrees(TURN)}
        return {"type": name}


def fill_state(state: NDArray[np.float64], observation: Observation, commute: Mapping[str, Any]) -> None:
    """Note what an agent observes and is told in the fields that `kernels.see` reads.

    Parameters
    ----------
    state
        Filled in, shape ``(ALL_FIELDS,)``.
    commute
        The appointment it is on its way to, as ``info["commute"]`` has it.
    """
    told = observation["state"]
    state[X], state[Y] = observation["pose"][:2]
    state[HEADING] = heading(observation)
    state[VEHICLE] = {"": FOOT, "bike": BIKE}.get(told["vehicle"], BUS)
    state[TIME], state[DUE] = told["time"], commute["start"]
    state[GOAL_X], state[GOAL_Y] = commute["position"]
    state[CASH] = told["cash"]
    state[LAST] = float(commute["last"])
    state[HIT] = float(told["action_status"] == "collision")
