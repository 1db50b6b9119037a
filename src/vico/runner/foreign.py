"""Agents from elsewhere: submissions, planners under test, whatever is named as ``my_module:MyAgent``.

An isolated agent has a process of its own: it is sent what it observes, and its answers are taken as data, never as
code.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from vico.agents.base import Action, Agent, AgentState, Info, Observation
from vico.errors import InputError, SchemaError
from vico.runner.audit import UnfairError
from vico.runner.loading import AgentSeat, load, make_agent
from vico.runner.messages import ClosedError, MalformedError, copy_public_map, encode_info, pack, receive, send
from vico.world.public import PublicMap
from vico.world.world import World

#: Memory an agent's process may have, MiB.
MEMORY = 4096

_LONGEST_ANSWER = 2**20
_LONGEST_STATE = 2**28
_START = 300.0  # seconds a process may take until its agent is made: libraries are imported, weights are read
_STATE = 60.0


class EndedError(RuntimeError):
    """An agent's process is gone."""


class AgentProcessError(RuntimeError):
    """An agent failed in its process; the message is what it said."""


_ERRORS: dict[str, type[Exception]] = {"malformed": MalformedError, "unfair": UnfairError}
_FORMS = ({"error", "kind"}, {"answer", "tokens", "cost", "left"})


class IsolatedAgent:
    """An agent that is made and asked in a process of its own.

    The process never holds the simulation: it is sent observations and infos as plain data, and sends back actions
    and states as plain data. It is ended with the run, also if the run is killed.

    Parameters
    ----------
    spec
        ``my_module:MyAgent``, loaded in that process alone.
    seat
        What its constructor may ask for. None: it is loaded and not made.
    world
        Folder of the world whose public map it is given, if its constructor asks for it.
    memory
        MiB the process may have.
    checked
        Whether `left` is looked at.

    Attributes
    ----------
    left
        Whether it left what it was last given as it was.

    Raises
    ------
    UnfairError
        If it reaches for what it is not given while it is loaded or made.
    InputError
        If it can't be loaded or made; the message says why.
    """

    def __init__(
        self, spec: str, seat: AgentSeat | None, *, world: Path, memory: int = MEMORY, checked: bool = False
    ) -> None:
        name = f"agent {spec}" if seat is None else seat.name
        self.left = True
        self.tokens = 0
        self.cost = 0.0
        self._spec = spec
        self._channel, theirs = socket.socketpair()
        # Held open by this process as long as it lives; when it is gone, the agent's process ends itself.
        lifeline, self._lifeline = os.pipe()
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "vico.runner.child", str(theirs.fileno()), str(lifeline)],
                pass_fds=(theirs.fileno(), lifeline),
                stdin=subprocess.DEVNULL,
                stdout=sys.stderr.fileno() if _has_descriptor(sys.stderr) else subprocess.DEVNULL,
                start_new_session=True,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
            )
        finally:
            theirs.close()
            os.close(lifeline)
        told = {
            "spec": spec,
            "seat": None if seat is None else asdict(seat),
            "world": str(world.resolve()),
            "memory": memory,
            "checked": checked,
        }
        try:
            self._channel.settimeout(_START)
            self._ask({"do": "make", **told}, _LONGEST_ANSWER)
        except UnfairError as error:
            self.close()
            raise UnfairError(f"{name}: {error}") from None
        except (EndedError, AgentProcessError, SchemaError) as error:
            self.close()
            raise InputError(str(error) if seat is None else f"{name}: {error}") from None
        self._channel.settimeout(None)

    def act(self, observation: Observation, info: Info) -> Action:
        """Send what it observes, and wait for its action."""
        sent = {"do": "act", "observation": dict(observation), "info": encode_info(info)}
        try:
            action: Action = self._ask(sent, _LONGEST_ANSWER)
        except SchemaError as error:
            raise MalformedError(str(error)) from None
        return action

    def state(self) -> AgentState:
        """Ask it what it remembers."""
        self._channel.settimeout(_STATE)
        state: AgentState = self._ask({"do": "state"}, _LONGEST_STATE)
        self._channel.settimeout(None)
        if not isinstance(state, dict):
            raise SchemaError(f"state() has to be a dict, not {type(state).__name__}")
        return state

    def restore(self, state: AgentState) -> None:
        """Let it remember what `state` returned."""
        self._ask({"do": "restore", "state": state}, _LONGEST_ANSWER)

    def close(self) -> None:
        """End the process at once."""
        with suppress(OSError):
            self._channel.shutdown(socket.SHUT_RDWR)  # whoever waits for its answer waits no longer
        self._end_it()
        if self._lifeline >= 0:
            os.close(self._lifeline)
            self._lifeline = -1
        self._channel.close()

    def _ask(self, message: Mapping[str, Any], limit: int) -> Any:
        if self._process.poll() is not None:
            raise EndedError(self._end())
        try:
            send(self._channel, pack(message))
            reply = receive(self._channel, limit=limit)
        except ClosedError as error:
            # A process that closed its end, or did not answer in time, can't be spoken with any more.
            self._end_it()
            raise EndedError(self._end(str(error))) from None
        except SchemaError:
            self._end_it()  # what follows in the channel is anyone's guess
            raise
        if not isinstance(reply, dict) or reply.keys() not in _FORMS:
            raise SchemaError("an answer of another form than vico.runner.child gives")
        if "error" in reply:
            raise _ERRORS.get(str(reply["kind"]), AgentProcessError)(str(reply["error"])[:1000])
        self.left = reply["left"] is True
        self._note_usage(reply["tokens"], reply["cost"])
        return reply["answer"]

    def _note_usage(self, tokens: Any, cost: Any) -> None:
        if type(tokens) is int and 0 <= tokens < 2**53:
            self.tokens = tokens
        if type(cost) in (int, float) and 0 <= cost < 1e12:
            self.cost = float(cost)

    def _end_it(self) -> None:
        if self._process.poll() is None:
            with suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)  # with all that it started
        self._process.wait()

    def _end(self, why: str = "") -> str:
        code = self._process.returncode
        if code is not None and code < 0 and why != "timed out":
            return f"its process was ended by {signal.Signals(-code).name}"
        if why == "timed out":
            return "its process did not answer in time and was ended"
        return f"its process ended with exit status {code}"


def check_loads(spec: str, world: Path) -> None:
    """Make sure that an agent can be loaded, in a process of its own.

    Parameters
    ----------
    world
        Folder of a world that it is to take part in.

    Raises
    ------
    InputError, UnfairError
        If there is no such file, module or class, it can't be imported, or it is no agent.
    """
    IsolatedAgent(spec, None, world=world).close()


def _has_descriptor(stream: Any) -> bool:
    try:
        stream.fileno()
    except (AttributeError, OSError, ValueError):
        return False
    return True


@dataclass(frozen=True, kw_only=True)
class Terms:
    """On which terms agents from elsewhere take part.

    Attributes
    ----------
    deadline
        Seconds they have together each step; None as long as it takes.
    isolate
        Whether each is made and asked in a process of its own.
    workers
        How many are asked at a time where there is no deadline.
    memory
        MiB an isolated agent's process may have.
    checked
        Whether it is looked at if isolated agents leave what they are given as it is.
    """

    deadline: float | None = None
    isolate: bool = False
    workers: int = 1
    memory: int = MEMORY
    checked: bool = False

    def __post_init__(self) -> None:
        if self.deadline is not None and not 0.0 < self.deadline < 1e6:
            raise InputError(f"agents: a deadline of {self.deadline:g} s; give seconds above 0, or none")
        if self.workers < 1:
            raise InputError(f"agents: {self.workers} workers; it has to be 1 or more")
        if self.memory < 256:
            raise InputError(f"agents: {self.memory} MiB of memory; a process needs 256 or more")


class AbsentAgent:
    """In place of one that could not be made: it fails at every step, and says why.

    Parameters
    ----------
    reason
        Why it could not be made.
    """

    def __init__(self, reason: str) -> None:
        self.reason = reason

    def act(self, observation: Observation, info: Info) -> Action:
        """Fail."""
        raise RuntimeError(self.reason)

    def state(self) -> AgentState:
        """Return nothing."""
        return {}

    def restore(self, state: AgentState) -> None:
        """Remember nothing."""


def foreign_agents(spec: str, seats: Sequence[AgentSeat], world: World, terms: Terms) -> dict[str, Agent]:
    """Make an agent for every seat.

    Parameters
    ----------
    spec
        ``my_module:MyAgent``; see `vico.runner.loading.load`.
    world
        Whose public map they may ask for.

    Raises
    ------
    UnfairError
        If an isolated one reaches for what it is not given.
    InputError, MissingFileError
        If one can't be loaded or made, or isolated agents are asked for in a world that is in no folder.
    """
    if not terms.isolate:
        thing, public_map = load(spec), PublicMap.from_world(world)
        return {seat.name: make_agent(thing, seat, lambda: copy_public_map(public_map)) for seat in seats}
    if world.path is None:
        raise InputError("agents: isolated ones read their map from the world's folder, and this world is in none")
    made: dict[str, Agent] = {}
    try:
        for seat in seats:
            made[seat.name] = IsolatedAgent(spec, seat, world=world.path, memory=terms.memory, checked=terms.checked)
    except BaseException:
        for agent in made.values():
            if isinstance(agent, IsolatedAgent):
                agent.close()
        raise
    return made
