"""Agents that misbehave, each in its own way; loaded by name, also into processes of their own."""

from __future__ import annotations

import gc
import importlib
import inspect
import logging
import os
import signal
import sys
import tempfile
import threading
from collections import namedtuple
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import numpy as np

Observation = dict[str, Any]
WAIT = {"type": "wait"}


class Honest:
    """Waits; remembers how often."""

    def __init__(self) -> None:
        self.count = 0
        self.tokens, self.cost = 0, 0.0

    def act(self, observation: Observation, info: dict[str, Any]) -> dict[str, Any]:
        self.count += 1
        self.tokens, self.cost = 10 * self.count, 0.5 * self.count
        return dict(WAIT)

    def state(self) -> dict[str, Any]:
        return {"count": self.count, "seen": np.arange(self.count)}

    def restore(self, state: dict[str, Any]) -> None:
        self.count = state["count"]


class Crasher(Honest):
    """Raises."""

    def act(self, observation: Observation, info: dict[str, Any]) -> dict[str, Any]:
        raise ZeroDivisionError("no plan")


class Unspeakable(Exception):
    """An error that can't be shown."""

    def __str__(self) -> str:
        raise RuntimeError("not even this")


class Mumbler(Honest):
    """Raises what can't be shown, and asks to leave."""

    def act(self, observation: Observation, info: dict[str, Any]) -> dict[str, Any]:
        self.count += 1
        if self.count % 2:
            raise Unspeakable
        sys.exit(0)


class Quitter(Honest):
    """Ends its process at the third step."""

    def act(self, observation: Observation, info: dict[str, Any]) -> dict[str, Any]:
        self.count += 1
        if self.count == 3:
            os._exit(7)
        return dict(WAIT)


class Sleeper(Honest):
    """Never answers."""

    def act(self, observation: Observation, info: dict[str, Any]) -> dict[str, Any]:
        threading.Event().wait()
        return dict(WAIT)


class Glutton(Honest):
    """Wants more memory than there is."""

    def act(self, observation: Observation, info: dict[str, Any]) -> dict[str, Any]:
        return {"type": "wait", "much": np.ones(2**31)}


def nested(depth: int) -> Any:
    """A list in a list in a list."""
    value: Any = []
    for _ in range(depth):
        value = [value]
    return value


class Odd:
    """An object."""


LIES: list[Any] = [
    {"type": "move_forward", "distance": float("nan")},
    {"type": "move_forward", "distance": np.inf},
    {"type": "move_forward", "distance": "far"},
    {"type": "move_forward", "distance": np.ones((2, 2))},
    {"type": "hand_over", "hand": 0, "agent": "nobody_7"},
    {"type": "enter", "place": "atlantis"},
    {"type": "communicate", "text": "x" * 10_000_000},
    {"type": "communicate", "text": "\ud800"},
    {"type": nested(2000)},
    {"type": "wait", "more": {"of": {"this": nested(5)}}},
    {"type": Odd()},
    {f"field_{k}": k for k in range(1000)},
    {1: 2},
    {"type": "control", "vector": [0.0] * 100_000},
    "wait",
    None,
    42,
    [dict(WAIT)],
]


class Liar(Honest):
    """Answers one thing after the other that is no action."""

    def act(self, observation: Observation, info: dict[str, Any]) -> Any:
        self.count += 1
        return LIES[(self.count - 1) % len(LIES)]


class StateLiar(Honest):
    """Its state is no state."""

    def state(self) -> Any:
        return {"self": self}


def reachable(thing: Any, seen: set[int]) -> Iterator[np.ndarray]:
    """Every array that can be got at from something, through attributes, items, bases and closures."""
    if id(thing) in seen or isinstance(thing, (str, bytes, int, float, type, type(sys))):
        return
    seen.add(id(thing))
    if isinstance(thing, np.ndarray):
        yield thing
        yield from reachable(thing.base, seen)
        return
    parts: list[Any] = []
    if isinstance(thing, dict):
        parts = [*thing.keys(), *thing.values()]
    elif isinstance(thing, (list, tuple, set, frozenset)):
        parts = list(thing)
    else:
        parts = [*vars(thing).values()] if hasattr(thing, "__dict__") else []
        parts += [cell.cell_contents for cell in getattr(thing, "__closure__", None) or ()]
        parts += [getattr(thing, "__self__", None)]
    for part in parts:
        yield from reachable(part, seen)


class Vandal(Honest):
    """Overwrites every array it can get at from what it is given."""

    def __init__(self, public_map: Any) -> None:
        super().__init__()
        self.public_map = public_map
        self.spoiled = 0

    def act(self, observation: Observation, info: dict[str, Any]) -> dict[str, Any]:
        for array in reachable([observation, info, self.public_map], set()):
            try:
                array.setflags(write=True)
            except ValueError:
                continue
            array.fill(array.dtype.type(1))
            self.spoiled += 1
        for given in (observation, info, observation["state"]):
            given.clear()
        return dict(WAIT)


class SideDoor(Honest):
    """Takes the state behind the run from the module that offers it to challenges."""

    def act(self, observation: Observation, info: dict[str, Any]) -> dict[str, Any]:
        from vico.runner.truth import GroundTruth

        return {"type": "communicate", "text": GroundTruth.__name__}


class Spy(Honest):
    """Looks for the simulation in all that lives in its process, and says how many it found."""

    def act(self, observation: Observation, info: dict[str, Any]) -> dict[str, Any]:
        from vico.sim.loop.simulation import Simulation
        from vico.sim.state.simulation_state import SimulationState

        found = [thing for thing in gc.get_objects() if isinstance(thing, (Simulation, SimulationState))]
        frame: Any = sys._getframe()
        while frame is not None:
            found += [value for value in frame.f_locals.values() if isinstance(value, (Simulation, SimulationState))]
            frame = frame.f_back
        return {"type": "communicate", "text": f"found {len(found)}"}


class Searcher(Honest):
    """Looks for the simulation among all objects, and goes where it says the goal is."""

    def act(self, observation: Observation, info: dict[str, Any]) -> dict[str, Any]:
        found = [thing for thing in gc.get_objects() if type(thing).__name__ == "Simulation"]
        return {"type": "communicate", "text": f"found {len(found)}"}


class FrameWalker(Honest):
    """Looks for the simulation in the frames that call it."""

    def act(self, observation: Observation, info: dict[str, Any]) -> dict[str, Any]:
        frame: Any = sys._getframe()
        while frame is not None:
            if "sim" in frame.f_locals:
                return {"type": "communicate", "text": "found it"}
            frame = frame.f_back
        return dict(WAIT)


class Inspector(Honest):
    """Does so with Python's own tools."""

    def act(self, observation: Observation, info: dict[str, Any]) -> dict[str, Any]:
        frame = inspect.currentframe()
        return {"type": "communicate", "text": f"called by {frame and frame.f_back}"}


class Thief(Honest):
    """Reads the task that lies beside the world, and what the world holds; the environment says where."""

    def act(self, observation: Observation, info: dict[str, Any]) -> dict[str, Any]:
        with open(os.path.join(os.environ["PLANTED_WORLD"], "task.json")) as file:
            return {"type": "communicate", "text": file.read()}


class Sly(Honest):
    """Reads it, and hides that it was refused."""

    def act(self, observation: Observation, info: dict[str, Any]) -> dict[str, Any]:
        with suppress(Exception):
            Thief.act(self, observation, info)
        return dict(WAIT)


class Generator(Honest):
    """Makes the task itself, with all its answers."""

    def act(self, observation: Observation, info: dict[str, Any]) -> dict[str, Any]:
        importlib.import_module("vico.challenges.assistant.generate")
        return dict(WAIT)


class Killer(Honest):
    """Ends the process that judges it."""

    def act(self, observation: Observation, info: dict[str, Any]) -> dict[str, Any]:
        os.kill(os.getppid(), signal.SIGTERM)
        return dict(WAIT)


class Teleporter(Honest):
    """Writes where it wants to be into what it is given."""

    def act(self, observation: Observation, info: dict[str, Any]) -> dict[str, Any]:
        observation["pose"][:2] = 30.0
        return dict(WAIT)


class Impostor(Honest):
    """Names somebody else as the one who acts."""

    def act(self, observation: Observation, info: dict[str, Any]) -> dict[str, Any]:
        return {"type": "move_forward", "distance": 1.0, "agent": "resident_0"}


class Puppeteer(Honest):
    """Answers with everybody's actions."""

    def act(self, observation: Observation, info: dict[str, Any]) -> Any:
        return {"assistant_0": dict(WAIT), "resident_0": {"type": "move_forward", "distance": 3.0}}


class Driver(Honest):
    """Sends a robot that is not its own."""

    def act(self, observation: Observation, info: dict[str, Any]) -> dict[str, Any]:
        return {"type": "go_to", "target": [0.0, 0.0, 0.0]}


class Respectable(Honest):
    """Does what an honest agent may: logs, warns, keeps a file of its own, uses libraries that look at frames."""

    def act(self, observation: Observation, info: dict[str, Any]) -> dict[str, Any]:
        logging.getLogger("mine").info("at %s", observation["pose"])
        kind = namedtuple("kind", "x y")
        with tempfile.TemporaryFile("w") as file:
            file.write(str(kind(*observation["pose"][:2])))
        importlib.import_module("vico.agents.base")
        gc.collect()
        return dict(WAIT)


def function(observation: Observation, info: dict[str, Any]) -> dict[str, Any]:
    """Says how many arrays it sees."""
    return {"type": "communicate", "text": f"{sum(isinstance(part, np.ndarray) for part in observation.values())}"}


class NoState:
    """Acts, and has neither state nor restore."""

    def act(self, observation: Observation, info: dict[str, Any]) -> dict[str, Any]:
        return dict(WAIT)


class Fussy(Honest):
    """Can't be made."""

    def __init__(self, moon: str) -> None:
        super().__init__()


class Broken(Honest):
    """Fails while it is made."""

    def __init__(self) -> None:
        raise LookupError("no weights")
