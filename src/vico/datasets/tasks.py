"""What an episode was about: the task it was given, in words, and what it came to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from vico.challenges.assistant.model import Task
from vico.challenges.episodes import record_of
from vico.challenges.records import EpisodeRecord
from vico.errors import SchemaError
from vico.io.files import read_json

EPISODE, TASK = "episode.json", "task.json"


@dataclass(frozen=True)
class EpisodeFacts:
    """What a dataset tells of the episode that a demonstration is of.

    Attributes
    ----------
    challenge, category, method
        What was played, and by whom; empty for a run that was no episode of a challenge.
    seed
        Of the episode or the run.
    success
        Whether all that was asked for was done; None where nobody judged.
    done
        Which parts of it were.
    instructions
        As assistants are given them, one a part; empty without a task.
    persons
        Ids of the residents who ask.
    """

    challenge: str = ""
    category: str = ""
    method: str = ""
    seed: int = 0
    success: bool | None = None
    done: Sequence[bool] = ()
    instructions: Sequence[Mapping[str, Any]] = field(default_factory=list)
    persons: Sequence[str] = ()

    def record(self) -> dict[str, Any]:
        """Return it as JSON."""
        return asdict(self)


def facts_of_episode(record: EpisodeRecord, task: Mapping[str, Any]) -> EpisodeFacts:
    """Return what an episode's record and its task tell."""
    done = [part.success for part in record.parts]
    instructions: list[dict[str, Any]] = []
    persons: list[str] = []
    if record.challenge == "assistant":
        asked = _assistant_task(task)
        instructions = asked.instructions()
        persons = [subtask.person.agent for subtask in asked.subtasks]
    return EpisodeFacts(
        record.challenge,
        record.category,
        record.method,
        record.seed,
        success=bool(done) and all(done),
        done=done,
        instructions=instructions,
        persons=list(dict.fromkeys(persons)),
    )


def facts_of_run(run: Path, seed: int) -> EpisodeFacts:
    """Return what lies beside a recorded run about the episode it is of.

    ``RUN/episode.json`` and ``RUN/task.json`` are looked for, then what `vico eval --record` leaves: ``episodes`` and
    ``tasks`` beside the folder ``runs``. A run that is no episode has neither: nobody asked for anything, or judged.

    Raises
    ------
    SchemaError
        If a file is damaged.
    """
    episode = next((path for path in (run / EPISODE, _beside(run, "episodes")) if path.exists()), None)
    if episode is None:
        return EpisodeFacts(seed=seed)
    content = read_json(episode)
    record = record_of(content.get("episode") if isinstance(content, dict) else None)
    task = next((path for path in (run / TASK, *_tasks_for(run, record)) if path.exists()), None)
    if task is None:
        raise SchemaError(f"{episode}: the task of the episode is not beside it (tasks/*.json, or {run / TASK})")
    return facts_of_episode(record, read_json(task))


def _beside(run: Path, folder: str) -> Path:
    return run.resolve().parent.parent / folder / f"{run.resolve().name}.json"


def _tasks_for(run: Path, record: EpisodeRecord) -> list[Path]:
    """Return the files of tasks that an evaluation left for an episode; one, unless it has several settings."""
    path = run.resolve()
    parts = path.name.split(".")  # category, method, world, seed, key
    world = parts[2] if len(parts) == 5 else "*"
    return sorted((path.parent.parent / "tasks").glob(f"{record.category}.{world}.{record.seed}.*.json"))


def _assistant_task(task: Mapping[str, Any]) -> Task:
    try:
        return Task.model_validate(task)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "task"
        raise SchemaError(f"task: {where}: {first['msg']}; play the episode anew") from None


def current_part(actions: Sequence[Any], parts: int) -> list[int]:
    """Return which part of a task an agent is about at each step: the one that it reports next.

    After its last report it is the first one that it never reported, or the last.

    Parameters
    ----------
    actions
        What the agent asked for, a step each.
    parts
        How many there are.
    """
    reports = [_reported(action) for action in actions]
    never = next((k for k in range(parts) if k not in reports), max(parts - 1, 0))
    found: list[int] = []
    coming = never
    for report in reversed(reports):
        if report is not None and report < parts:
            coming = report
        found.append(coming)
    return found[::-1]


def _reported(action: Any) -> int | None:
    if not isinstance(action, Mapping) or action.get("type") != "task_complete":
        return None
    index = action.get("index")
    return int(index) if isinstance(index, int | float) else None
