"""The process of an isolated agent: makes it, asks it, and says what it answered. Holds nothing of the simulation."""

from __future__ import annotations

import fcntl
import os
import socket
import sys
import threading
from pathlib import Path
from typing import Any

from vico.agents.base import Action, Agent, FunctionAgent, Info, Observation, usage_of
from vico.errors import VicoError, sentence_of
from vico.runner.audit import AuditHook
from vico.runner.loading import AgentSeat, load_agent, make_agent, source_of
from vico.runner.messages import ClosedError, MalformedError, decode_info, digest_of, pack, plain_action, receive, send
from vico.world.folder import read_world
from vico.world.public import PublicMap

_LONGEST = 2**31


def main(channel_number: int, lifeline: int) -> None:
    """Serve one agent until the other side closes the channel."""
    channel = socket.socket(fileno=channel_number)
    threading.Thread(target=_end_with_the_run, args=(lifeline,), daemon=True).start()
    served = _Served()
    while True:
        try:
            message = receive(channel, limit=_LONGEST)
        except ClosedError:
            return
        try:
            answer = served.answer(message)
            usage = usage_of(served.agent)
            reply = {"answer": answer, "tokens": usage.tokens, "cost": usage.cost, "left": served.left}
            sent = pack(reply)
        except BaseException as error:
            kind = "malformed" if isinstance(error, MalformedError) else "crashed"
            sent = pack({"error": _error_text(error), "kind": kind})
        if unfair := served.unfair():
            sent = pack({"error": unfair[:1000], "kind": "unfair"})
        send(channel, sent)


class _Served:
    """The agent of this process, once it is made, and who watches it.

    Attributes
    ----------
    left
        Whether the agent left what it was last given as it was; looked at where that is asked for.
    """

    def __init__(self) -> None:
        self.left = True
        self._agent: Agent | None = None
        self._watch: AuditHook | None = None
        self._checked = False

    @property
    def agent(self) -> Agent:
        """The agent."""
        assert self._agent is not None
        return self._agent

    def unfair(self) -> str:
        """Return what the agent reached for and is not given, since this was last asked; empty if nothing."""
        return "" if self._watch is None else self._watch.take_notices()

    def answer(self, message: dict[str, Any]) -> Any:
        """Do what is asked."""
        if message["do"] == "make":
            self._make(message)
            return None
        if message["do"] == "act":
            return self._act(message["observation"], decode_info(message["info"]))
        if message["do"] == "state":
            return self.agent.state()
        self.agent.restore(message["state"])
        return None

    def _act(self, observation: Observation, info: Info) -> Action:
        before = digest_of(observation, info) if self._checked else b""
        action = plain_action(self.agent.act(observation, info))
        self.left = not self._checked or digest_of(observation, info) == before
        return action

    def _make(self, message: dict[str, Any]) -> None:
        _limit_memory(int(message["memory"]))
        self._checked = bool(message["checked"])
        world, spec = Path(message["world"]), message["spec"]
        watch = self._watch = AuditHook(world, source_of(spec))
        watch.start()

        def public_map() -> PublicMap:
            with watch.pause():
                return PublicMap.from_world(read_world(world))

        thing = load_agent(spec)
        # Without a seat it is only asked whether there is such an agent.
        seat = message["seat"]
        if seat is None:
            self._agent = FunctionAgent(lambda observation, info: {"type": "wait"})
        else:
            self._agent = make_agent(thing, AgentSeat(**seat), public_map)


def _limit_memory(megabytes: int) -> None:
    """Let whoever asks for more get a `MemoryError`; where the system knows no such limit, there is none."""
    try:
        import resource
    except ImportError:
        return
    size = megabytes * 2**20
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    most = size if hard == resource.RLIM_INFINITY else min(size, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (most, most))


def _end_with_the_run(lifeline: int) -> None:
    """Wait until nobody holds the other end of the lifeline, and end this process."""
    # By SIGIO, too, which ends a process by default: no Python code can run while compiled code keeps the interpreter.
    fcntl.fcntl(lifeline, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(lifeline, fcntl.F_SETFL, fcntl.fcntl(lifeline, fcntl.F_GETFL) | os.O_ASYNC)
    os.read(lifeline, 1)
    os._exit(1)


def _error_text(error: BaseException) -> str:
    try:
        text = str(error) if isinstance(error, (VicoError, MalformedError)) else sentence_of(error)
        return text.encode(errors="replace").decode()[:1000]
    except Exception:
        return type(error).__name__  # an error that can't even be shown


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
