"""Finding an agent by name, ``my_module:MyAgent``, and making it with what its constructor asks for."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import inspect
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from vico.agents.base import Agent, as_agent
from vico.errors import InputError, MissingFileError, line_of, sentence_of
from vico.world.public import PublicMap


@dataclass(frozen=True)
class AgentSeat:
    """Facts that an agent may have when it is made: its constructor names those that it wants as arguments.

    Attributes
    ----------
    name
        Of the agent in the simulation.
    seed
        Of the run or episode.
    instructions
        What a task tells its assistants; empty where there is no task.
    number, of
        Which of how many agents under test this is.
    """

    name: str
    seed: int = 0
    instructions: list[dict[str, Any]] = field(default_factory=list)
    number: int = 0
    of: int = 1


def load(spec: str) -> Any:
    """Return what ``module:name`` or ``path/to/file.py:name`` stands for; modules of the working directory, too.

    Raises
    ------
    InputError
        If it can't be imported, or there is nothing of that name; the message says which.
    MissingFileError
        If there is no such file.
    """
    place, _, name = spec.rpartition(":")
    if not place or not name:
        raise InputError(f"agent {spec!r}: give my_module:MyAgent, or path/to/file.py:MyAgent")
    try:
        if place.endswith(".py"):
            module = _module_of_file(Path(place))
        else:
            here = str(Path.cwd())
            if here not in sys.path and "" not in sys.path:
                sys.path.insert(0, here)
            module = importlib.import_module(place)
    except (InputError, MissingFileError):
        raise
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        raise InputError(
            f"agent {spec}: {place} cannot be imported: {sentence_of(error)} at {line_of(error)}"
        ) from None
    found: Any = module
    for part in name.split("."):
        if not hasattr(found, part):
            raise InputError(f"agent {spec}: {place} has no {name!r}")
        found = getattr(found, part)
    return found


def load_agent(spec: str) -> Any:
    """Return what `load` finds, if an agent can be made of it.

    Raises
    ------
    InputError, MissingFileError
        As of `load`; also if it is a class whose objects can't act, or a thing that can't.
    """
    found = load(spec)
    if not isinstance(found, type):
        as_agent(found, name=f"agent {spec}")
        return found
    made_later = any(hook in vars(base) for base in found.__mro__ for hook in ("__call__", "__getattr__"))
    if not made_later and not any(callable(getattr(found, name, None)) for name in ("act", "predict")):
        raise InputError(
            f"agent {spec}: {found.__name__} has neither act(observation, info) nor predict(observation); "
            "name a class that has, or a function"
        )
    return found


def source_digest(spec: str) -> str:
    """Return a hash of the file that `load` would read for a spec, without running it; "" if there is none."""
    path = source_of(spec)
    return hashlib.sha256(path.read_bytes()).hexdigest() if path is not None else ""


def source_of(spec: str) -> Path | None:
    """Return the file that `load` would read for a spec; None if there is none."""
    place = spec.rpartition(":")[0]
    path = Path(place) if place.endswith(".py") else Path.cwd() / (place.replace(".", "/") + ".py")
    if not path.is_file() and not place.endswith(".py"):
        try:
            found = importlib.util.find_spec(place.partition(".")[0])
        except (ImportError, ValueError):
            found = None
        path = Path((found and found.origin) or path)
    return path if path.is_file() else None


def make_agent(thing: Any, seat: AgentSeat, public_map: Callable[[], PublicMap]) -> Agent:
    """Make an agent of what `load` found.

    Parameters
    ----------
    thing
        A class, made with those of ``name``, ``seed``, ``instructions``, ``number``, ``of`` and ``public_map`` that its
        constructor has as arguments; or a function or object, see `vico.agents.base.as_agent`.
    public_map
        Called for the map if it is asked for.

    Raises
    ------
    InputError
        If it is no agent, or its constructor asks for anything else or fails.
    """
    if not isinstance(thing, type):
        return as_agent(thing, name=seat.name)
    offered = ("name", "seed", "instructions", "number", "of", "public_map")
    parameters = inspect.signature(thing).parameters.values()
    keywords = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    named = [p for p in parameters if p.kind in keywords]
    odd = [p.name for p in named if p.name not in offered and p.default is inspect.Parameter.empty]
    if odd:
        raise InputError(
            f"agent {thing.__name__}: its constructor asks for {odd[0]!r}; it may ask for {', '.join(offered)}"
        )
    given: dict[str, Any] = {}
    for parameter in named:
        if parameter.name == "public_map":
            given["public_map"] = public_map()
        elif parameter.name in offered:
            given[parameter.name] = getattr(seat, parameter.name)
    try:
        made = thing(**given)
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        raise InputError(f"agent {thing.__name__}: cannot be made: {sentence_of(error)} at {line_of(error)}") from None
    return as_agent(made, name=f"agent {thing.__name__}")


def _module_of_file(path: Path) -> Any:
    if not path.is_file():
        raise MissingFileError(f"agent: {path}: no such file")
    name = f"vico_agent_{path.stem}"
    found = importlib.util.spec_from_file_location(name, path)
    if found is None or found.loader is None:
        raise InputError(f"agent: {path}: not a Python file")
    module = importlib.util.module_from_spec(found)
    sys.modules[name] = module
    sys.path.insert(0, str(path.parent.resolve()))
    found.loader.exec_module(module)
    return module
