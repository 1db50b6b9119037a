"""A trained policy: dense layers as arrays, and the agent that acts by them."""

from __future__ import annotations

import math
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import Action, Info, Observation, heading
from vico.agents.commute.learning.city import CityArrays, city_arrays
from vico.agents.commute.learning.fields import (
    ACTIONS,
    ALL_FIELDS,
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
    SEEN,
    TIME,
    TURN,
    VEHICLE,
    X,
    Y,
)
from vico.agents.commute.learning.kernels import see
from vico.agents.state import AgentState, generator_state, restore_generator
from vico.errors import MissingFileError, SchemaError
from vico.exact import each
from vico.io.npz import read_npz
from vico.rules import BIKE_SPEED, BUS_DWELL, WALK_SPEED
from vico.seeds import rng
from vico.world.public import PublicMap


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
        width = SEEN
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


class PolicyCommuter:
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

    def __init__(self, network: Network, public_map: PublicMap, *, seed: int) -> None:
        self._network = network
        self._city: CityArrays = city_arrays(public_map, dwell=BUS_DWELL)
        self._rng = rng(seed, "commute policy")
        self._state = np.zeros(ALL_FIELDS)
        self._seen = np.zeros(SEEN, np.float32)

    def act(self, observation: Observation, info: Info) -> Action:
        """Return an action drawn by the network's chances."""
        take_in(self._state, observation, info["commute"])
        see(self._city, self._state, self._seen)
        logits = self._network.logits(self._seen).astype(np.float64)
        chances = each(math.exp, logits - logits.max())
        kind = int(np.searchsorted(np.cumsum(chances), self._rng.random() * chances.sum()))
        name = ACTIONS[min(kind, len(ACTIONS) - 1)]
        if name == "move_forward":
            speed = BIKE_SPEED if self._state[VEHICLE] == BIKE else WALK_SPEED
            return {"type": "move_forward", "distance": speed}
        if name in ("turn_left", "turn_right"):
            return {"type": name, "degrees": math.degrees(TURN)}
        return {"type": name}

    def state(self) -> AgentState:
        """Return where its stream of chance stands."""
        return {"generator": generator_state(self._rng)}

    def restore(self, state: AgentState) -> None:
        """Go on where another one was."""
        restore_generator(self._rng, state["generator"])


def take_in(state: NDArray[np.float64], observation: Observation, commute: Mapping[str, Any]) -> None:
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
