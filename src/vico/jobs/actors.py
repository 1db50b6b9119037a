"""Objects on a Ray cluster that are asked side by side; one that is lost is made anew and told all it was told.

What `vico.envs.workers.Workers` is for processes of this machine: environments that learners roll out. An object must
be deterministic: what it answers depends on how it was made and on the calls so far, and nothing else. So one whose
process or machine dies comes back as it was, and who asks notices nothing but the time.
"""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Callable, Sequence
from typing import Any, Protocol

from vico.errors import InputError, SourceError
from vico.jobs.cluster import connect, first_line, ray_module

_log = logging.getLogger(__name__)
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
            self._made(ref)

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
            answers.append(None if one is None else self._received(k, one, ref))
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

    def _made(self, ref: Any) -> None:
        try:
            self._ray.get(ref)
        except self._ray.exceptions.RayTaskError as error:
            raise InputError(f"Ray: an object cannot be made: {first_line(error)}") from None

    def _received(self, k: int, one: tuple[str, tuple[Any, ...], dict[str, Any]], ref: Any) -> Any:
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
