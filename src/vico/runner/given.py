"""What agents are given: copies, through which nothing of the simulation can be reached or changed."""

from __future__ import annotations

import copy
import hashlib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.agents.base import Info, Observation
from vico.errors import InputError
from vico.io.plain_data import encode
from vico.sim.perception import SeenBody
from vico.world.public import PublicMap


class ListedInView:
    """What an agent has in view, as `vico.sim.perception.InView` tells it, in a list of its own.

    Parameters
    ----------
    bodies
        Nearest first.
    room, furniture
        As in `InView`.
    """

    def __init__(self, bodies: Sequence[SeenBody], room: ArrayLike, furniture: ArrayLike) -> None:
        self._bodies = list(bodies)
        self.distance: NDArray[np.float64] = np.array([body.distance for body in self._bodies], np.float64)
        self.room: NDArray[np.float64] = np.array(room, np.float64)
        self.furniture: NDArray[np.float64] = np.array(furniture, np.float64).reshape(-1, 5)

    def __len__(self) -> int:
        return len(self._bodies)

    def __iter__(self) -> Iterator[SeenBody]:
        return iter(self._bodies)

    def within(self, reach: float) -> Iterator[SeenBody]:
        """Yield what is no farther away than `reach` metres, nearest first."""
        return (body for body in self._bodies if body.distance <= reach)

    def agents_within(self, reach: float) -> Iterator[str]:
        """Yield the names of the agents that are no farther away than `reach` metres, nearest first."""
        return (body.agent for body in self._bodies if body.agent and body.distance <= reach)

    def nearest(self, kinds: tuple[str, ...]) -> float:
        """Return how far the nearest body of some kinds is, metres; infinite if none is in view."""
        return next((body.distance for body in self._bodies if body.kind in kinds), math.inf)

    def record(self) -> dict[str, Any]:
        """Return it as plain data; `of` makes the same of it."""
        bodies = [asdict(body) for body in self._bodies]
        return {"bodies": bodies, "room": self.room, "furniture": self.furniture}

    @classmethod
    def of(cls, record: Mapping[str, Any]) -> ListedInView:
        """Make one of what `record` returned."""
        bodies = [SeenBody(**{**body, "position": tuple(body["position"])}) for body in record["bodies"]]
        return cls(bodies, record["room"], record["furniture"])


def own_observation(observation: Mapping[str, Any]) -> Observation:
    """Return a copy of an observation; its arrays share no memory with the original."""
    return {name: _copied(value) for name, value in observation.items()}


def own_info(info: Mapping[str, Any]) -> Info:
    """Return a copy of an info; what is in view becomes a list."""
    return {name: _listed(value) if name == "in_view" else _copied(value) for name, value in info.items()}


def own_map(public_map: PublicMap) -> PublicMap:
    """Return a copy of a public map: whoever changes it changes nobody else's."""
    parts = ("walkable", "height", "places", "buildings", "stops", "lines", "bike_stations")
    mine = {name: copy.deepcopy(getattr(public_map, name)) for name in parts}
    return replace(public_map, **mine, shared_router=None)


def sent_info(info: Mapping[str, Any]) -> dict[str, Any]:
    """Return an info as plain data with text as keys, to be sent; `received_info` makes an info of it again."""
    sent = {name: value for name, value in info.items() if name not in ("entities", "in_view")}
    if "rest" in sent:
        sent["rest"] = dict(sent["rest"])
    sent["entities"] = [[entity, dict(about)] for entity, about in info.get("entities", {}).items()]
    sent["in_view"] = _listed(info["in_view"]).record() if "in_view" in info else None
    return sent


def received_info(sent: Mapping[str, Any]) -> Info:
    """Make an info of what `sent_info` returned."""
    info = dict(sent)
    info["entities"] = {int(entity): about for entity, about in sent["entities"]}
    in_view = info.pop("in_view")
    if in_view is not None:
        info["in_view"] = ListedInView.of(in_view)
    return info


def digest_of(observation: Mapping[str, Any], info: Mapping[str, Any]) -> bytes:
    """Return a hash of all that an agent is given; of what is no longer that, a fixed one."""
    try:
        return hashlib.blake2b(encode([observation, sent_info(info)])).digest()
    except (InputError, AttributeError, KeyError, TypeError, ValueError):
        return b"no longer what it was"


def _listed(in_view: Any) -> ListedInView:
    return ListedInView(list(in_view), in_view.room, in_view.furniture)


def _copied(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return np.array(value, copy=True)
    if isinstance(value, Mapping):
        return {key: _copied(part) for key, part in value.items()}
    return [_copied(part) for part in value] if isinstance(value, (list, tuple)) else value
