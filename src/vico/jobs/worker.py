"""The other side: a process, or a task of a cluster, that does what it is told."""

from __future__ import annotations

import gc
import json
import multiprocessing
import os
import signal
import sys
import threading
from functools import lru_cache
from multiprocessing.connection import Connection, wait
from typing import Any

from vico.errors import InputError
from vico.jobs.contract import Json, Service, Work, make_service, message_of
from vico.threads import WORKERS


def serve(connection: Connection, maker: str, options: str, environment: dict[str, str]) -> None:
    """Do tasks until the other side closes the connection.

    Parameters
    ----------
    options
        Of the service, as JSON.
    environment
        Variables to set first.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for who started this process; it ends it then
    threading.Thread(target=_end_with_the_parent, daemon=True).start()
    os.environ |= environment

    def send(message: dict[str, Any]) -> None:
        connection.send_bytes(json.dumps(message).encode())

    try:
        work = make_service(Service(maker, json.loads(options)), lambda told: send({"told": told}))
    except InputError as error:
        send({"refused": str(error)})
        return
    while True:
        try:
            content = json.loads(connection.recv_bytes())
        except EOFError:
            return
        send(message_of(work, content))


def attend(answers: int) -> None:
    """Do tasks for a `Helper`: lines of JSON come in, and go out to `answers`, a pipe; ends with whoever asks."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for who started this process; it ends it then
    gc.set_threshold(20_000, 20, 20)  # as the command line does: what is imported is never garbage
    asked = json.loads(sys.stdin.readline())
    tasks = _Tasks(answers)
    threading.Thread(target=tasks.take_in, daemon=True).start()
    try:
        work = make_service(Service(asked["maker"], asked["options"]), lambda _: None)
    except InputError as error:
        work = _refusal(str(error))
    while True:
        number, content = tasks.next()
        tasks.say({"number": number, **message_of(work, content)})


class _Tasks:
    """What a helper has still to do, while it is at something."""

    def __init__(self, answers: int) -> None:
        self._answers = os.fdopen(answers, "w")
        self._waiting: dict[int, Json] = {}
        self._changed = threading.Condition()

    def take_in(self) -> None:
        """Take in what is asked for and taken back, to the end."""
        for line in sys.stdin:
            message = json.loads(line)
            with self._changed:
                if "withdraw" in message:
                    number = message["withdraw"]
                    self.say({"number": number, "withdrawn": self._waiting.pop(number, None) is not None})
                else:
                    self._waiting[message["number"]] = message["content"]
                    self._changed.notify()
        os._exit(0)

    def next(self) -> tuple[int, Json]:
        """Wait for the next task: its number, and what it is."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting)
            number = next(iter(self._waiting))
            return number, self._waiting.pop(number)

    def say(self, message: dict[str, Any]) -> None:
        """Send a message."""
        with self._changed:  # whole lines, whoever says them
            print(json.dumps(message), file=self._answers, flush=True)


def _refusal(reason: str) -> Work:
    def work(_: Json) -> Json:
        raise InputError(reason)

    return work


def answer_in_cluster(maker: str, options: str, place: str, content: str) -> str:
    """Do one task in a process that a cluster lends, and keep the service for the next; all of it is JSON.

    Parameters
    ----------
    place
        Where whoever asks is: ``environment`` to set, ``folder`` to work in and ``path`` of modules. What of it is not
        there on this machine is passed over.
    """
    told = json.loads(place)
    os.environ |= told["environment"]
    if os.path.isdir(told["folder"]):
        os.chdir(told["folder"])  # what is named by a relative path is looked for where it was meant
    sys.path += [folder for folder in told["path"] if folder not in sys.path and os.path.exists(folder)]
    # Ray gives a task as many threads as it was promised processors.
    os.environ.setdefault(WORKERS, os.environ.get("OMP_NUM_THREADS", "1"))
    try:
        work = _cached_service(maker, options)
    except InputError as error:
        return json.dumps({"refused": f"{error} (on the machine {os.uname().nodename})"})
    return json.dumps(message_of(work, json.loads(content)))


@lru_cache(maxsize=1)
def _cached_service(maker: str, options: str) -> Work:
    """Return a service of this process; the last one is kept, with the worlds it has read."""
    return make_service(Service(maker, json.loads(options)), lambda _: None)


def _end_with_the_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)
