"""The process of an isolated agent: makes it, asks it, and says what it answered. Holds nothing of the simulation."""

from __future__ import annotations

import fcntl
import os
import socket
import sys
import threading
from pathlib import Path
from typing import Any

from vico.agents.base import Agent
from vico.agents.wrappers import usage_of
from vico.errors import VicoError, sentence_of
from vico.runner.answers import MalformedError, plain_action
from vico.runner.given import received_info
from vico.runner.loading import AgentSeat, load, make_agent
from vico.runner.wire import ClosedError, packed, receive, send
from vico.world.folder import read_world
from vico.world.public import PublicMap

_LONGEST = 2**31


def main(channel_number: int, lifeline: int) -> None:
    """Serve one agent until the other side closes the channel."""
    channel = socket.socket(fileno=channel_number)
    threading.Thread(target=_end_with_the_run, args=(lifeline,), daemon=True).start()
    agent: Agent | None = None
    while True:
        try:
            message = receive(channel, limit=_LONGEST)
        except ClosedError:
            return
        try:
            if message["do"] == "make":
                agent, answer = _make(message), None
            else:
                assert agent is not None
                answer = _do(agent, message)
            usage = usage_of(agent)
            reply = packed({"answer": answer, "tokens": usage.tokens, "cost": usage.cost})
        except BaseException as error:
            reply = packed({"error": _said(error), "malformed": isinstance(error, MalformedError)})
        send(channel, reply)


def _do(agent: Agent, message: dict[str, Any]) -> Any:
    if message["do"] == "act":
        return plain_action(agent.act(message["observation"], received_info(message["info"])))
    if message["do"] == "state":
        return agent.state()
    agent.restore(message["state"])
    return None


def _make(message: dict[str, Any]) -> Agent:
    _limit_memory(int(message["memory"]))
    seat = AgentSeat(**message["seat"])
    return make_agent(load(message["spec"]), seat, lambda: PublicMap.from_world(read_world(Path(message["world"]))))


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


def _said(error: BaseException) -> str:
    try:
        text = str(error) if isinstance(error, (VicoError, MalformedError)) else sentence_of(error)
        return text.encode(errors="replace").decode()[:1000]
    except Exception:
        return type(error).__name__  # an error that can't even be shown


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
