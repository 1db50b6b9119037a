"""Episodes on disk: played once, kept by all that decides them, marked with the reason where they can't be played."""

from __future__ import annotations

import hashlib
import json
import logging
import math
import os
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from vico.challenges.records import Challenge, EpisodeRecord, Job, Progress, foreign_parts, setting_of_task
from vico.errors import OutputError, SchemaError, VicoError, line_of, sentence_of
from vico.io.data_files import own_folder
from vico.io.files import json_bytes
from vico.io.stores import Store
from vico.runner.loading import source_digest
from vico.version import __version__
from vico.world.folder import read_world
from vico.world.world import World

SCHEMA = "vico.episode"
VERSION = 1

_log = logging.getLogger(__name__)
_LLM_VARIABLES = ("VICO_LLM_BASE_URL", "OPENAI_BASE_URL", "VICO_LLM_MODEL", "VICO_LLM_EPISODE_TOKENS")
# What no episode depends on: worlds are told apart by their digests, and tables are made of what was played.
_UNUSED = ("cli", "viewer", "datasets", "jobs", "worldgen", "geo", "challenges/tables", "data/challenges")


@dataclass(frozen=True)
class Outcome:
    """What became of a job.

    Attributes
    ----------
    record
        What the episode came to; None if it was not played.
    reason
        Why it was not; empty if it was.
    world_digest
        Identity of the world it was played in; empty if it was not.
    kept
        Whether it had been played before, and was read.
    """

    job: Job
    record: EpisodeRecord | None
    reason: str = ""
    world_digest: str = ""
    kept: bool = False


def code_digest() -> str:
    """Return a hash of the installed package and of the user's own data, as far as episodes depend on them."""
    return _folder_digest(Path(__file__).parents[1], own_folder())


@cache
def _folder_digest(package: Path, own: Path | None) -> str:
    digest = hashlib.sha256()
    unused = {package: _UNUSED} | ({own: ("challenges",)} if own is not None else {})
    for root, prefixes in unused.items():
        for path in sorted(root.rglob("*")):
            name = path.relative_to(root).as_posix()
            if path.suffix in (".pyc", ".nbi", ".nbc") or not path.is_file() or name.startswith(prefixes):
                continue
            digest.update(f"{name}\0".encode() + hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


class Player:
    """Plays the jobs of a challenge one by one; those whose episode is on disk are read.

    Parameters
    ----------
    store
        Where ``episodes``, ``tasks`` and, if runs are recorded, ``runs`` lie.
    code
        `code_digest` of who asks for the episodes.
    record
        Whether each episode is recorded as a run.
    """

    def __init__(self, challenge: Challenge, store: Store, *, code: str, record: bool = False) -> None:
        self.challenge, self.store, self.code, self.record = challenge, store, code, record
        self._last_task: tuple[tuple[str | int, ...], Mapping[str, object]] | None = None

    def play(self, job: Job, progress: Progress | None = None) -> Outcome:
        """Play a job, or read what it came to; what makes it impossible becomes the outcome's reason.

        Raises
        ------
        OutputError
            If nothing can be written: that is no episode's fault, and there is no use in going on.
        """
        told: Progress | None = (
            None if progress is None else lambda _, step, limit: progress(label_of(job), step, limit)
        )
        try:
            return self._play(job, told)
        except OutputError:
            raise
        except VicoError as error:
            return Outcome(job, None, _sentence(str(error)))
        except Exception as error:  # of the challenge: it must not take the other episodes with it
            _log.warning("%s: not played", label_of(job), exc_info=error)
            said = f"{sentence_of(error)} at {line_of(error)}: a fault of the challenge; please report it"
            return Outcome(job, None, _sentence(said))

    def _play(self, job: Job, progress: Progress | None) -> Outcome:
        world = read_world(job.world).digest
        task = self._task(job, world)
        key = _key(self.challenge, job, world, task, self.code)
        name = f"{_slug(job.category)}.{_slug(job.method)}.{_slug(job.world.name)}.{job.seed}.{key[:16]}"
        path = f"episodes/{name}.json"
        run = f"runs/{name}" if self.record else None
        record = read_episode(self.store, path, key)
        kept = record is not None and (run is None or self.store.has(run))
        if record is None or not kept:
            record = self._play_job(job, run, progress)
            # Only now: nobody who plays the task should find its answers lying about.
            self.store.write(f"tasks/{_task_name(job, task)}", json_bytes(task))
            write_episode(self.store, path, key, record)
        return Outcome(job, record, world_digest=world, kept=kept)

    def _play_job(self, job: Job, run: str | None, progress: Progress | None) -> EpisodeRecord:
        """Play an episode, and record it as a run of that name."""
        if run is None:
            record = self.challenge.play(job, progress=progress)
        else:
            self.store.remove(run)  # of an episode that was cut short
            with self.store.new_folder(run) as folder:
                record = self.challenge.play(job, recording=folder, progress=progress)
                if not folder.exists():
                    _log.warning("%s: the challenge recorded no run", label_of(job))
        _check(self.challenge, record)
        return record

    def _task(self, job: Job, world: str) -> Mapping[str, object]:
        """Return a job's task; methods that follow each other in it share it."""
        which = (job.category, json.dumps(dict(setting_of_task(job.setting)), sort_keys=True), world, job.seed)
        if self._last_task is None or self._last_task[0] != which:
            self._last_task = (which, self.challenge.task(job))
        return self._last_task[1]


def write_episode(store: Store, name: str, key: str, record: EpisodeRecord) -> None:
    """Write what an episode came to, whole or not at all.

    Parameters
    ----------
    key
        Digest of all that decides the episode.
    """
    content = {"schema_name": SCHEMA, "version": VERSION, "key": key, "episode": asdict(record)}
    store.write(name, json_bytes(content))


def read_episode(store: Store, name: str, key: str) -> EpisodeRecord | None:
    """Read what `write_episode` wrote; None if there is none, it is of another episode, or it is damaged."""
    content = store.read(name)
    if content is None:
        return None
    try:
        found = json.loads(content)
        known = (SCHEMA, VERSION, key)
        if not isinstance(found, dict) or known != tuple(found.get(n) for n in ("schema_name", "version", "key")):
            return None
        return record_of(found.get("episode"))
    except (SchemaError, ValueError, RecursionError) as error:
        _log.warning("%s/%s: damaged, and played again (%s)", store, name, error)
        return None


def for_size(number: int, world: World) -> int:
    """Return how many there are in a world, of so many in a window of 800 m."""
    return min(number, round(number * (world.half / 400.0) ** 2))


def record_of(content: Any) -> EpisodeRecord:
    """Return an `EpisodeRecord` of plain data.

    Raises
    ------
    SchemaError
        If a field is missing or of another type.
    """
    try:
        return TypeAdapter(EpisodeRecord).validate_python(content)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise SchemaError(f"episode: {where}: {first['msg'].lower()}") from None


def _key(challenge: Challenge, job: Job, world: str, task: Mapping[str, object], code: str) -> str:
    """Return a digest of all that decides an episode."""
    decides: dict[str, Any] = {
        "version": __version__,
        "code": code,
        "challenge": job.challenge,
        "category": job.category,
        # A policy is told by its hash, wherever it lies.
        "setting": {name: value for name, value in job.setting.items() if name != "policy"},
        "seed": job.seed,
        "world": world,
        "task": task,
        "method": job.method,
    }
    if foreign := foreign_parts(challenge, job.method):
        decides["sources"] = [source_digest(part) for part in foreign]
        decides["terms"] = [job.terms.deadline, job.terms.isolate, job.terms.memory]
    if "llm" in job.method.lower() or any(name.endswith("_model") for name in job.setting):
        decides["model"] = [os.environ.get(name, "") for name in _LLM_VARIABLES]
    return hashlib.sha256(json.dumps(decides, sort_keys=True).encode()).hexdigest()


def _check(challenge: Challenge, record: EpisodeRecord) -> None:
    """Make sure that a record says only what its challenge can say."""
    metrics = {metric.key for metric in challenge.metrics(record.category)}
    odd = [key for key, value in record.metrics.items() if key not in metrics or not math.isfinite(value)]
    if odd:
        raise ValueError(f"metric {odd[0]!r} is none of the challenge's, or no finite number")
    causes = set(challenge.causes(record.category))
    for part in record.parts:
        if part.success is bool(part.cause) or (part.cause and part.cause not in causes):
            raise ValueError(f"part {part.name!r}: success {part.success} with the cause {part.cause!r}")


def _task_name(job: Job, task: Mapping[str, object]) -> str:
    digest = hashlib.sha256(json.dumps(task, sort_keys=True).encode()).hexdigest()
    return f"{_slug(job.category)}.{_slug(job.world.name)}.{job.seed}.{digest[:8]}.json"


def _slug(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9_+-]+", "_", text)[-60:] or "_"


def _sentence(text: str) -> str:
    return " ".join(text.split())[:500]


def label_of(job: Job) -> str:
    """Say in words which episode a job is."""
    return f"{job.category}, {job.world.name}, seed {job.seed}, {job.method}"
