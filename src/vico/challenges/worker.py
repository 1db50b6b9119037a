"""What a process does that plays jobs: the service of `vico.jobs` that evaluations hand out, in plain data."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from vico.challenges.episodes import Outcome, Player, code_digest, record_of
from vico.challenges.records import Job
from vico.challenges.registry import load_challenge
from vico.io.stores import store_at
from vico.jobs import Service
from vico.jobs.shared import check_code, check_seen
from vico.runner.foreign import Terms
from vico.world.remote import fetch_world

_TOLD_EVERY = 10  # steps


def episodes_service(challenge: str, store: str, *, code: str, record: bool, seen: str = "") -> Service:
    """Return the service that plays the jobs of a challenge.

    Parameters
    ----------
    challenge
        Its name, or ``my_module:MY_CHALLENGE``.
    store, code, record
        As `vico.challenges.episodes.Player` has them.
    seen
        Name of a file of the store that whoever plays must see, for other machines; and their code must be ours then.
    """
    options = {"challenge": challenge, "store": store, "code": code, "record": record, "seen": seen}
    return Service("vico.challenges.worker:player", options)


def player(
    options: Mapping[str, Any], tell: Callable[[Mapping[str, Any]], None]
) -> Callable[[Mapping[str, Any]], dict[str, Any]]:
    """Return what plays a job, of `plain_job`, and returns what came of it, for `outcome_of`.

    Raises
    ------
    InputError
        If this machine does not see what the others see, or has other code: what it played would be filed wrongly.
    """
    store = store_at(options["store"])
    check_seen(store, options["seen"])
    if options["seen"]:
        check_code(options["code"], code_digest())
    episodes = Player(load_challenge(options["challenge"]), store, code=options["code"], record=options["record"])

    def progress(label: str, step: int, limit: int) -> None:
        if step % _TOLD_EVERY == 0 or step == limit:
            tell({"label": label, "step": step, "limit": limit})

    def play(content: Mapping[str, Any]) -> dict[str, Any]:
        url = content["world_url"]
        world = str(fetch_world(url)) if url else content["world"]
        outcome = plain_outcome(episodes.play(job_of({**content, "world": world}), progress))
        if options["seen"] and outcome["reason"] and not os.path.isdir(world):
            outcome["reason"] += f" (on the machine {os.uname().nodename})"
        return outcome

    return play


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
