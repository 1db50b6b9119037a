"""What is handed out, what comes back, and who does it."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from vico.errors import InputError, OutputError, VicoError, line_of, sentence_of

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
Done = Callable[[int, Answer], None]
#: Called with what a task tells on its way; only where that is cheap: a cluster tells nothing.
Told = Callable[[Json], None]


class Executor(Protocol):
    """Does tasks side by side; closed with its block."""

    @property
    def one_machine(self) -> bool:
        """Whether all is done here, where files and code are those of whoever asks."""

    def run(self, service: Service, tasks: Sequence[Task], *, done: Done, told: Told | None = None) -> None:
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


def made(service: Service, tell: Tell) -> Work:
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
