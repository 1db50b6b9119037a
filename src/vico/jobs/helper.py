"""One more process of this machine that does tasks, in order, while this one goes on with something else."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from contextlib import suppress
from typing import Any

from vico import threads
from vico.jobs.contract import Answer, Json, Service, answer_of

_COMMAND = "from vico.jobs.worker import attend; attend({})"
_STDERR = 2


class Helper:
    """A process that is asked for tasks; closed with its block.

    It is started as a command of its own: a script that leads here needs no ``if __name__ == "__main__"``, as it would
    for processes that `multiprocessing` starts.

    Parameters
    ----------
    service
        What it does.
    share
        Threads it may use.

    Raises
    ------
    OSError
        If no process can be started.
    """

    def __init__(self, service: Service, *, share: int = 1) -> None:
        path = [folder or os.getcwd() for folder in sys.path]
        about = {threads.WORKERS: str(share), "PYTHONPATH": os.pathsep.join(path), "PYTHONSAFEPATH": "1"}
        # Answers have a pipe of their own: whatever prints must not get in between.
        ours, theirs = os.pipe()
        self._heard = os.fdopen(ours, "rb")
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-u", "-c", _COMMAND.format(theirs)],
                stdin=subprocess.PIPE,
                stdout=_STDERR,
                pass_fds=(theirs,),
                env=os.environ | about,
            )
        except OSError:
            self._heard.close()
            raise
        finally:
            os.close(theirs)
        self._asked = 0
        self._answers: dict[int, Answer] = {}
        self._withdrawn: dict[int, bool] = {}
        self._send({"maker": service.maker, "options": dict(service.options)})

    def __enter__(self) -> Helper:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def ask(self, content: Json) -> int:
        """Have a task done after those that were asked for before; return its number."""
        self._asked += 1
        self._send({"number": self._asked, "content": dict(content)})
        return self._asked

    def withdraw(self, number: int) -> bool:
        """Take a task back; False if it was begun: then it will be answered."""
        if number in self._answers:
            return False
        self._send({"withdraw": number})
        while number not in self._withdrawn and self._hear():
            pass
        return self._withdrawn.pop(number, True)

    def answer(self, number: int) -> Answer:
        """Wait for a task, and return what came of it.

        A process that died, or could not make the service, answers with the reason.

        Raises
        ------
        OutputError
            If nothing can be written.
        """
        while number not in self._answers and self._hear():
            pass
        return self._answers.pop(number, Answer(None, f"its process ended with exit status {self._process.poll()}"))

    def close(self) -> None:
        """End the process, whatever it is at: files are written whole or not at all."""
        self._process.kill()
        self._heard.close()
        assert self._process.stdin is not None
        with suppress(OSError):  # what it was told last it will never read
            self._process.stdin.close()
        self._process.wait()

    def _send(self, message: dict[str, Any]) -> None:
        assert self._process.stdin is not None
        with suppress(OSError):  # it is dead, which is noticed where its answer is waited for
            self._process.stdin.write(json.dumps(message).encode() + b"\n")
            self._process.stdin.flush()

    def _hear(self) -> bool:
        """Take the next message in; False if there will be none."""
        line = self._heard.readline()
        if not line.endswith(b"\n"):
            self._process.wait()
            return False
        message = json.loads(line)
        if "withdrawn" in message:
            self._withdrawn[message["number"]] = message["withdrawn"]
        else:
            self._answers[message["number"]] = answer_of(message)
        return True
