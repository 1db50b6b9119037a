"""A process that plays jobs: it is told which over a connection, and says what came of them, in JSON."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import threading
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from vico.challenges.episodes import Outcome, Player, record_of
from vico.challenges.records import Job
from vico.challenges.registry import load_challenge
from vico.errors import OutputError
from vico.runner.foreign import Terms
from vico.threads import WORKERS

_TOLD_EVERY = 10  # steps


@dataclass(frozen=True)
class WorkerOptions:
    """What a worker is told when it starts.

    Attributes
    ----------
    challenge
        Its name, or ``my_module:MY_CHALLENGE``.
    code
        `vico.challenges.episodes.code_digest` of who asks.
    threads
        How many it may use.
    """

    challenge: str
    folder: str
    code: str
    record: bool
    threads: int


def serve(connection: Connection, options: WorkerOptions) -> None:
    """Play jobs until the other side closes the connection."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for who started this process; it ends it then
    threading.Thread(target=_end_with_the_parent, daemon=True).start()
    os.environ[WORKERS] = str(options.threads)
    challenge = load_challenge(options.challenge)
    player = Player(challenge, Path(options.folder), code=options.code, record=options.record)

    def progress(label: str, step: int, limit: int) -> None:
        if step % _TOLD_EVERY == 0 or step == limit:
            _send(connection, {"progress": [label, step, limit]})

    while True:
        try:
            job = job_of(json.loads(connection.recv_bytes()))
        except EOFError:
            return
        try:
            _send(connection, {"outcome": plain_outcome(player.play(job, progress))})
        except OutputError as error:
            _send(connection, {"output_error": str(error)})


def plain_job(job: Job) -> dict[str, Any]:
    """Return a job as JSON has it; `job_of` makes the same of it."""
    return {**asdict(job), "world": str(job.world)}


def job_of(content: Mapping[str, Any]) -> Job:
    """Make a job of what `plain_job` returned."""
    return Job(**{**content, "world": Path(content["world"]), "terms": Terms(**content["terms"])})


def plain_outcome(outcome: Outcome) -> dict[str, Any]:
    """Return an outcome, without its job, as JSON has it; `outcome_of` makes the same of it."""
    record = None if outcome.record is None else asdict(outcome.record)
    return {"record": record, "reason": outcome.reason, "world_digest": outcome.world_digest, "kept": outcome.kept}


def outcome_of(job: Job, content: Mapping[str, Any]) -> Outcome:
    """Make an outcome of what `plain_outcome` returned."""
    record = content["record"]
    return Outcome(job, **{**content, "record": None if record is None else record_of(record)})


def _send(connection: Connection, message: Mapping[str, Any]) -> None:
    connection.send_bytes(json.dumps(message).encode())


def _end_with_the_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)
