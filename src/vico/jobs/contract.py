"""Services, tasks, answers and executors; checks that machines share one store and one code.

A `Service` names a function that makes the worker; a `Task` is plain JSON; an `Answer` is what came of it. An
`Executor` does tasks side by side.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Protocol

from vico.errors import InputError, OutputError, VicoError, line_of, sentence_of
from vico.io.stores import Store
from vico.version import __version__

#: Plain data, as JSON has it.
Json = Mapping[str, Any]
#: Tells how far a task is; what it says is the service's own.
Tell = Callable[[Json], None]
#: Does one task.
Work = Callable[[Json], Json]


@dataclass(frozen=True)
class Service:
    """What workers do.

    Attributes
    ----------
    maker
        A function, ``module:function``, that each process calls once, with `options` and with what tells how far a
        task is (a `Tell`). It returns the function that does a task (a `Work`), and may keep in it what the next task
        can use.
    options
        Plain data.
    """

    maker: str
    options: Json = field(default_factory=dict)


@dataclass(frozen=True)
class Task:
    """One thing to do; doing it twice comes to the same.

    Attributes
    ----------
    content
        Plain data.
    near
        Tasks of the same word go to the same process where that costs nothing: it has read the same world.
    """

    content: Json
    near: str = ""


@dataclass(frozen=True)
class Answer:
    """What came of a task.

    Attributes
    ----------
    content
        What the service returned; None if it could not.
    reason
        Why not; empty if it could.
    """

    content: Json | None
    reason: str = ""


#: Called with the index of a task and what came of it, as soon as it is over; in no fixed order.
AnswerHandler = Callable[[int, Answer], None]
#: Called with what a task tells on its way; only where that is cheap: a cluster tells nothing.
MessageHandler = Callable[[Json], None]


class Executor(Protocol):
    """Does tasks side by side; closed with its block."""

    @property
    def one_machine(self) -> bool:
        """Whether all is done here, where files and code are those of whoever asks."""

    def run(
        self, service: Service, tasks: Sequence[Task], *, done: AnswerHandler, told: MessageHandler | None = None
    ) -> None:
        """Do all tasks.

        Raises
        ------
        InputError
            If a process cannot make the service: none could do anything.
        OutputError
            If a task says that nothing can be written: there is no use in going on.
        """

    def __enter__(self) -> Executor: ...

    def __exit__(self, *_: object) -> None: ...


def make_service(service: Service, tell: Tell) -> Work:
    """Make a service in this process.

    Raises
    ------
    InputError
        If there is no such function, or it refuses; the message says why.
    """
    module, _, name = service.maker.partition(":")
    try:
        work: Work = getattr(importlib.import_module(module), name)(service.options, tell)
    except VicoError as error:
        raise InputError(str(error)) from error
    except Exception as error:
        raise InputError(f"{service.maker}: cannot be made: {sentence_of(error)} at {line_of(error)}") from error
    return work


def message_of(work: Work, content: Json) -> dict[str, Any]:
    """Do a task, and return as plain data what came of it; `answer_of` reads it."""
    try:
        return {"answer": work(content)}
    except OutputError as error:
        return {"output_error": str(error)}
    except VicoError as error:
        return {"reason": str(error)}
    except Exception as error:  # of the service: it must not take the other tasks with it
        return {"reason": f"{sentence_of(error)} at {line_of(error)}"}


def answer_of(message: Json) -> Answer:
    """Return what a message of `message_of` says.

    Raises
    ------
    InputError
        If the process could not make the service.
    OutputError
        If nothing can be written.
    """
    if "refused" in message:
        raise InputError(message["refused"])
    if "output_error" in message:
        raise OutputError(message["output_error"])
    return Answer(message.get("answer"), message.get("reason", ""))


@contextmanager
def shared_store_marker(store: Store, executor: Executor) -> Iterator[str]:
    """Give the name of a file of a store that every machine must see; empty where there is but one machine."""
    if executor.one_machine:
        yield ""
        return
    name = f".seen-{os.uname().nodename}-{os.getpid()}"
    store.write(name, b"Written by the machine that shares out the work; the others look for it here.\n")
    try:
        yield name
    finally:
        store.remove(name)


def check_shared_store(store: Store, name: str) -> None:
    """Make sure that this machine sees the file that `shared_store_marker` gave the name of.

    Raises
    ------
    InputError
        If it does not: what it made would be nowhere.
    """
    if name and not store.has(name):
        raise InputError(
            f"{store}: not the same folder on every machine; give an --out that all of them share, or a URL like "
            "s3://BUCKET/results"
        )


def check_same_code(asked: str, here: str) -> None:
    """Make sure that the code of this machine, by its digest, is that of whoever asks.

    Raises
    ------
    InputError
        If it is not: what it made would be filed as something else.
    """
    if asked != here:
        raise InputError(
            f"vico {__version__} there is other code, or its $VICO_DATA holds other data, than where the work is asked "
            "for; install the same on every machine"
        )
