"""A Ray cluster (the extra ``ray``): tasks that are done on it, and objects that are asked side by side.

Machines may come and go; a task whose machine dies is done again. `RayActors` is for a cluster what
`vico.envs.workers.Workers` is for processes of this machine: environments that learners roll out. An object must be
deterministic: what it answers depends on how it was made and on the calls so far, and nothing else. So one whose
process or machine dies is made anew, gets the same calls again, and its caller notices nothing but the time.
"""

from __future__ import annotations

import json
import logging
import os
import secrets
import socket
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Any, Protocol

from vico.errors import InputError, MissingExtraError, SourceError
from vico.jobs.contract import Answer, AnswerHandler, MessageHandler, Service, Task, answer_of
from vico.jobs.worker import answer_in_cluster

INSTALL = "Ray is not installed: pip install 'virtual-community[ray]'"
#: How often a task is done again whose process or machine died.
RETRIES = 2
#: Handed to the cluster at a time; it waits for free processors (and more machines) by itself.
_IN_FLIGHT = 1000
_KNOCK = 10.0  # seconds that a cluster has to answer at all
_PATIENCE = 60.0  # seconds without a processor until that is said
#: Of the environment, what decides what a task comes to or where it looks; keys and passwords stay where they are.
FORWARDED = (
    "VICO_DATA", "VICO_LLM_BASE_URL", "OPENAI_BASE_URL", "VICO_LLM_MODEL", "VICO_LLM_EPISODE_TOKENS", "VICO_LLM_PRICE",
    "VICO_OVERPASS", "AWS_ENDPOINT_URL", "AWS_ENDPOINT_URL_S3", "AWS_DEFAULT_REGION",
)  # fmt: skip
_log = logging.getLogger(__name__)


class RayCluster:
    """A Ray cluster that does tasks, a processor each.

    Nothing of its own is kept there: tasks write what they make where their service says. A task is done again, on
    another machine if need be, up to `RETRIES` times if its process or machine dies.

    Parameters
    ----------
    address
        ``auto``, ``local``, ``host:port`` or ``ray://host:port``; see `vico.jobs.executors.open_executor`.
    processors
        Of a cluster that is started for the occasion.

    Raises
    ------
    MissingExtraError
        If Ray is not installed.
    InputError
        If there is no such cluster, or it runs another version of Ray or Python.
    """

    def __init__(self, address: str, *, processors: int) -> None:
        self._ray = ray_module()
        self._mine = not self._ray.is_initialized()
        if self._mine:
            connect(address, processors)

    @property
    def one_machine(self) -> bool:
        """Whether all is done here; never taken for granted of a cluster."""
        return False

    def __enter__(self) -> RayCluster:
        return self

    def __exit__(self, *_: object) -> None:
        if self._mine:
            self._ray.shutdown()

    def run(
        self, service: Service, tasks: Sequence[Task], *, done: AnswerHandler, told: MessageHandler | None = None
    ) -> None:
        """Do all tasks; say what came of each as it is over.

        Raises
        ------
        InputError
            If a machine of the cluster cannot make the service; the message names it.
        OutputError
            If a task can't write what it did.
        SourceError
            If the cluster goes away.
        """
        place = json.dumps(
            {
                "environment": {name: os.environ[name] for name in FORWARDED if name in os.environ},
                "folder": os.getcwd(),
                "path": sys.path,
            }
        )
        ray = self._ray
        do = ray.remote(num_cpus=1, max_retries=RETRIES)(answer_in_cluster)
        flying: dict[Any, int] = {}
        try:
            options = ray.put(json.dumps(dict(service.options)))
            waiting = iter(range(len(tasks)))
            while True:
                for index in islice(waiting, _IN_FLIGHT - len(flying)):
                    content = json.dumps(dict(tasks[index].content))
                    flying[do.remote(service.maker, options, place, content)] = index
                if not flying:
                    return
                for ref in self._over(list(flying)):
                    done(flying.pop(ref), self._answer(ref))
        finally:
            for ref in flying:
                with suppress(Exception):  # the cluster may be gone
                    ray.cancel(ref, force=True)

    def _over(self, flying: Sequence[Any]) -> Sequence[Any]:
        """Wait until a task is over, or several."""
        try:
            while True:
                over, _ = self._ray.wait(flying, num_returns=1, timeout=_PATIENCE)
                if over:
                    # Those that are over by now, too: looking at a thousand for each of them would take long.
                    return self._ray.wait(flying, num_returns=len(flying), timeout=0)[0]
                if self._ray.cluster_resources().get("CPU", 0) < 1:
                    _log.warning("Ray: %d tasks wait, and no machine of the cluster has a processor", len(flying))
        except (ConnectionError, self._ray.exceptions.RaySystemError) as error:
            raise SourceError(f"the Ray cluster went away ({first_line(error)}); give the same command again") from None

    def _answer(self, ref: Any) -> Answer:
        """Return what came of a task; that its process died too often is one, too."""
        try:
            return answer_of(json.loads(self._ray.get(ref)))
        except self._ray.exceptions.RayTaskError as error:
            raise InputError(f"Ray: {first_line(error)}; is the same vico installed on every machine?") from None
        except self._ray.exceptions.RayError as error:
            how = f"{type(error).__name__}, {RETRIES + 1} times"
            return Answer(None, f"its process or its machine died ({how}); it may lack memory")


def connect(address: str, processors: int) -> None:
    """Let this process be one that a cluster works for; start one where that is what `address` means.

    Raises
    ------
    InputError
        If there is no such cluster, or it cannot be used from here.
    """
    ray = ray_module()
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
    how = {"log_to_driver": False, "logging_level": logging.ERROR}
    try:
        found = _known_address() if address == "auto" else address
        if found in ("", "local"):
            # A cluster on this machine listens on all interfaces, whatever it is told: with a token nobody gets in
            # unasked. Ray (2.60 on) would write its own into the home folder; this one lasts as long as the process.
            if not {"RAY_AUTH_MODE", "RAY_AUTH_TOKEN", "RAY_AUTH_TOKEN_PATH"} & set(os.environ):
                os.environ["RAY_AUTH_TOKEN"] = secrets.token_hex(32)
            ray.init("local", num_cpus=processors, include_dashboard=False, **how)
        else:
            _check_answer(found)  # Ray itself tries for minutes
            ray.init(found, **how)
    except (ConnectionError, RuntimeError, ValueError, TimeoutError, ray.exceptions.RayError) as error:
        raise InputError(
            f"--ray {address}: {first_line(error)}; start a cluster with ray start --head, or give the address of one"
        ) from None


def _known_address() -> str:
    """Return the address of the cluster that the environment names, or that ``ray start`` has noted on this machine."""
    note = Path(os.environ.get("RAY_TMPDIR", "/tmp")) / "ray" / "ray_current_cluster"
    with suppress(OSError):
        return os.environ.get("RAY_ADDRESS") or note.read_text(encoding="utf-8").strip()
    return ""


def _check_answer(address: str) -> None:
    """Make sure that something answers at ``host:port``, with or without ``ray://``.

    Raises
    ------
    ConnectionError
        If nothing does.
    """
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if host and port.isdigit():
        try:
            socket.create_connection((host.strip("[]"), int(port)), timeout=_KNOCK).close()
        except OSError as error:
            raise ConnectionError(f"nothing answers at {address} ({error.strerror or error})") from None


def ray_module() -> Any:
    """Return Ray.

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    try:
        import ray
    except ImportError:
        raise MissingExtraError(INSTALL) from None
    return ray


def first_line(error: BaseException) -> str:
    """Return the line of what Ray says that says most."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return (lines[-1] if "Traceback" in str(error) else lines[0])[:300] if lines else type(error).__name__


_TRIES = 3


class Call(Protocol):
    """A method of an object, and what it is called with; `vico.envs.workers.Call` is one."""

    @property
    def method(self) -> str:
        """Name of the method, or of an attribute that is read."""

    @property
    def arguments(self) -> tuple[Any, ...]:
        """By position."""

    @property
    def keywords(self) -> dict[str, Any]:
        """By name."""


class _Holder:
    """Holds an object, in a process of the cluster."""

    def look_in(self, path: list[str]) -> None:
        """Look for modules where whoever asks looks for them, too; before `make`, whose argument may need them."""
        sys.path += [folder for folder in path if folder not in sys.path and os.path.exists(folder)]

    def make(self, maker: Callable[[], Any]) -> None:
        """Make the object."""
        self._made = maker()

    def ask(self, method: str, arguments: tuple[Any, ...], keywords: dict[str, Any]) -> Any:
        """Call a method, or read an attribute."""
        found = getattr(self._made, method)
        return found(*arguments, **keywords) if callable(found) else found

    def replay(self, calls: list[tuple[str, tuple[Any, ...], dict[str, Any]]]) -> None:
        """Make calls again, and keep what they return to itself."""
        for call in calls:
            self.ask(*call)


class RayActors:
    """One object a processor of a Ray cluster.

    Parameters
    ----------
    makers
        Make the objects: functions of a module, or `functools.partial` of them, that every machine has.
    address
        Of the cluster; see `vico.jobs.open_executor`.

    Raises
    ------
    InputError
        If there are no makers, or no such cluster.
    MissingExtraError
        If Ray is not installed.
    """

    def __init__(self, makers: Sequence[Callable[[], Any]], *, address: str = "auto") -> None:
        if not makers:
            raise InputError("Ray: there are 0 objects to make; ask for 1 or more")
        self._ray = ray_module()
        self._mine = not self._ray.is_initialized()
        if self._mine:
            connect(address, len(makers))
        self._makers = list(makers)
        self._told: list[list[tuple[str, tuple[Any, ...], dict[str, Any]]]] = [[] for _ in makers]
        pairs = [self._make(maker) for maker in makers]
        self._actors = [actor for actor, _ in pairs]
        for _, ref in pairs:
            self._wait_until_made(ref)

    def __len__(self) -> int:
        return len(self._makers)

    def ask(self, calls: Sequence[Call | None]) -> list[Any]:
        """Make one call of each object, all at the same time; return what they return, None where none was made.

        Raises
        ------
        InputError
            If they are closed, or an object fails; the message says how.
        SourceError
            If the cluster lost an object again and again.
        """
        if len(calls) != len(self._actors):
            raise InputError(f"Ray: {len(calls)} calls for {len(self._actors)} objects; give one for each")
        asked = [None if call is None else (call.method, call.arguments, call.keywords) for call in calls]
        refs = [None if one is None else self._actors[k].ask.remote(*one) for k, one in enumerate(asked)]
        answers = []
        for k, (one, ref) in enumerate(zip(asked, refs, strict=True)):
            answers.append(None if one is None else self._receive(k, one, ref))
            if one is not None:
                self._told[k].append(one)
        return answers

    def ask_all(self, method: str) -> list[Any]:
        """Make the same call of every object."""
        return self.ask([_Plain(method)] * len(self._actors))

    def close(self) -> None:
        """Let go of the objects."""
        for actor in self._actors:
            self._ray.kill(actor)
        self._actors = []
        if self._mine:
            self._ray.shutdown()

    def _make(self, maker: Callable[[], Any]) -> tuple[Any, Any]:
        """Return an actor, which does what it is told in order, and what says that its object is made."""
        actor = self._ray.remote(num_cpus=1)(_Holder).remote()
        actor.look_in.remote(sys.path)
        return actor, actor.make.remote(maker)

    def _wait_until_made(self, ref: Any) -> None:
        try:
            self._ray.get(ref)
        except self._ray.exceptions.RayTaskError as error:
            raise InputError(f"Ray: an object cannot be made: {first_line(error)}") from None

    def _receive(self, k: int, one: tuple[str, tuple[Any, ...], dict[str, Any]], ref: Any) -> Any:
        """Wait for an answer; make the object anew if it is lost."""
        for _ in range(_TRIES):
            try:
                return self._ray.get(ref)
            except self._ray.exceptions.RayActorError as error:
                _log.warning("object %d of %d was lost (%s): it is made anew", k, len(self), first_line(error))
                self._actors[k], _ = self._make(self._makers[k])
                self._actors[k].replay.remote(self._told[k])
                ref = self._actors[k].ask.remote(*one)
            except self._ray.exceptions.RayTaskError as error:
                raise InputError(f"Ray: object {k} of {len(self)} failed in {one[0]}: {first_line(error)}") from None
        raise SourceError(f"Ray: object {k} of {len(self)} was lost {_TRIES} times; is there memory enough?")


class _Plain:
    """A call without arguments."""

    def __init__(self, method: str) -> None:
        self.method = method
        self.arguments: tuple[Any, ...] = ()
        self.keywords: dict[str, Any] = {}
