"""Messages between a run and its agents: copies of observations, answers as plain data, messages to a process.

Agents are given copies, through which nothing of the simulation can be reached or changed. An action is a small dict
of text and numbers, whatever came. A message to an agent's process is plain data with its length before it, nothing
pickled. An isolated agent's process imports this module: it holds nothing of the simulation.
"""

from __future__ import annotations

import copy
import hashlib
import math
import socket
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.agents.base import Action, Info, Observation
from vico.errors import InputError, SchemaError
from vico.io.plain_data import decode, encode
from vico.sim.perception import SeenBody
from vico.world.public import PublicMap

_MOST_FIELDS = 32
_LONGEST_NAME = 64
_LONGEST_TEXT = 2000  # what is too long to be said is refused by the rules; this much too long is not even kept
_LONGEST_LIST = 256


class MalformedError(ValueError):
    """An answer is no action; the message says why."""


def plain_action(answer: Any) -> Action:
    """Return an answer as a dict of plain values: nothing of what the agent holds is kept.

    Raises
    ------
    MalformedError
        If it is no dict, is too large, or holds anything but text, finite numbers and lists of them.
    """
    if not isinstance(answer, Mapping):
        raise MalformedError(f"an action is a dict with a 'type', not {type(answer).__name__}")
    if len(answer) > _MOST_FIELDS:
        raise MalformedError(f"an action of {len(answer)} fields; the longest has {_MOST_FIELDS}")
    action: Action = {}
    for name, value in answer.items():
        if not isinstance(name, str) or len(name) > _LONGEST_NAME:
            raise MalformedError("a field whose name is no text, or very long")
        action[str(name)] = _plain_value(value, str(name))
    return action


def _plain_value(value: Any, name: str) -> Any:
    if isinstance(value, np.ndarray):
        if value.dtype.kind not in "biuf" or value.ndim > 1:
            raise MalformedError(f"{name} is an array of {value.dtype} of {value.ndim} dimensions")
        value = value.tolist() if value.size <= _LONGEST_LIST else [0.0] * value.size
    if isinstance(value, (list, tuple)):
        if len(value) > _LONGEST_LIST:
            raise MalformedError(f"{name} is a list of {len(value)}; the longest has {_LONGEST_LIST}")
        return [_plain_scalar(part, name) for part in value]
    return _plain_scalar(value, name)


def _plain_scalar(value: Any, name: str) -> Any:
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, str):
        if len(value) > _LONGEST_TEXT:
            raise MalformedError(f"{name} is a text of {len(value)} characters")
        try:
            return value.encode().decode()
        except UnicodeEncodeError:
            raise MalformedError(f"{name} is no Unicode text") from None
    if isinstance(value, int):
        if abs(value) >= 2**63:
            raise MalformedError(f"{name} is a number out of all range")
        return int(value)
    if isinstance(value, float):
        if not math.isfinite(value):
            raise MalformedError(f"{name} is {float(value)}; it has to be a finite number")
        return float(value)
    raise MalformedError(f"{name} is of type {type(value).__name__}; give text, numbers or a list of them")


class ListedInView:
    """Bodies that an agent has in view, as `vico.sim.perception.InView` tells it, in a list of its own.

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


def copy_observation(observation: Mapping[str, Any]) -> Observation:
    """Return a copy of an observation; its arrays share no memory with the original."""
    return {name: _copy_value(value) for name, value in observation.items()}


def copy_info(info: Mapping[str, Any]) -> Info:
    """Return a copy of an info; what is in view becomes a list."""
    return {name: _list_in_view(value) if name == "in_view" else _copy_value(value) for name, value in info.items()}


def copy_public_map(public_map: PublicMap) -> PublicMap:
    """Return a copy of a public map: whoever changes it changes nobody else's."""
    parts = ("walkable", "height", "places", "buildings", "stops", "lines", "bike_stations")
    mine = {name: copy.deepcopy(getattr(public_map, name)) for name in parts}
    return replace(public_map, **mine, shared_router=None)


def encode_info(info: Mapping[str, Any]) -> dict[str, Any]:
    """Return an info as plain data with text as keys, to be sent; `decode_info` makes an info of it again."""
    sent = {name: value for name, value in info.items() if name not in ("entities", "in_view")}
    if "rest" in sent:
        sent["rest"] = dict(sent["rest"])
    sent["entities"] = [[entity, dict(about)] for entity, about in info.get("entities", {}).items()]
    sent["in_view"] = _list_in_view(info["in_view"]).record() if "in_view" in info else None
    return sent


def decode_info(sent: Mapping[str, Any]) -> Info:
    """Make an info of what `encode_info` returned."""
    info = dict(sent)
    info["entities"] = {int(entity): about for entity, about in sent["entities"]}
    in_view = info.pop("in_view")
    if in_view is not None:
        info["in_view"] = ListedInView.of(in_view)
    return info


def digest_of(observation: Mapping[str, Any], info: Mapping[str, Any]) -> bytes:
    """Return a hash of all that an agent is given; of what is no longer that, a fixed one."""
    try:
        return hashlib.blake2b(encode([observation, encode_info(info)])).digest()
    except (InputError, AttributeError, KeyError, TypeError, ValueError):
        return b"no longer what it was"


def _list_in_view(in_view: Any) -> ListedInView:
    return ListedInView(list(in_view), in_view.room, in_view.furniture)


def _copy_value(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return np.array(value, copy=True)
    if isinstance(value, Mapping):
        return {key: _copy_value(part) for key, part in value.items()}
    return [_copy_value(part) for part in value] if isinstance(value, (list, tuple)) else value


_HEAD = 8


class ClosedError(EOFError):
    """The other side is gone."""


def pack(message: Any) -> bytes:
    """Return a message as `send` takes it.

    Raises
    ------
    InputError
        If it is no plain data.
    """
    content = encode(message)
    return len(content).to_bytes(_HEAD, "little") + content


def send(channel: socket.socket, message: bytes) -> None:
    """Send what `packed` returned.

    Raises
    ------
    ClosedError
        If nobody receives it any more.
    """
    try:
        channel.sendall(message)
    except OSError as error:
        raise ClosedError(str(error)) from None


def receive(channel: socket.socket, *, limit: int) -> Any:
    """Wait for a message and return it.

    Parameters
    ----------
    limit
        Most bytes it may have.

    Raises
    ------
    SchemaError
        If it is longer, or no plain data.
    ClosedError
        If the other side is gone.
    """
    size = int.from_bytes(_receive_exactly(channel, _HEAD), "little")
    if size > limit:
        raise SchemaError(f"an answer of {size} bytes; the longest may have {limit}")
    return decode(_receive_exactly(channel, size))


def _receive_exactly(channel: socket.socket, count: int) -> bytes:
    content = bytearray(count)
    view, filled = memoryview(content), 0
    while filled < count:
        try:
            got = channel.recv_into(view[filled:])
        except OSError as error:
            raise ClosedError(str(error)) from None
        if got == 0:
            raise ClosedError("closed")
        filled += got
    return bytes(content)
