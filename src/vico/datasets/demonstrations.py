"""From a recorded run to demonstrations: what one agent saw, knew, was asked for and did, an agent step a frame.

The task of an episode in words, and what it came to, are read from the files beside the run.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from vico.assets.robots import robot_model
from vico.challenges.assistant.tasks import Task
from vico.challenges.episodes import record_of
from vico.challenges.records import EpisodeRecord
from vico.datasets.vectors import (
    PERSON_STATE,
    ActionForm,
    VectorForm,
    goal_vector,
    recorded_person_states,
    recorded_robot_states,
    robot_state_names,
)
from vico.errors import EmptyInputError, InputError, SchemaError
from vico.io.files import read_json
from vico.sim.recording import Run
from vico.sim.state.steps import TICKS_PER_SECOND

EPISODE_FILE, TASK_FILE = "episode.json", "task.json"


@dataclass(frozen=True)
class EpisodeFacts:
    """Facts of the episode that a demonstration is of.

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
        try:
            asked = Task.model_validate(task)
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(str(part) for part in first["loc"]) or "task"
            raise SchemaError(f"task: {where}: {first['msg']}; play the episode anew") from None
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
    beside = run.resolve().parent.parent / "episodes" / f"{run.resolve().name}.json"
    episode = next((path for path in (run / EPISODE_FILE, beside) if path.exists()), None)
    if episode is None:
        return EpisodeFacts(seed=seed)
    content = read_json(episode)
    record = record_of(content.get("episode") if isinstance(content, dict) else None)
    # The files of tasks that an evaluation left for an episode: one, unless it has several settings.
    path = run.resolve()
    parts = path.name.split(".")  # category, method, world, seed, key
    world = parts[2] if len(parts) == 5 else "*"
    tasks = sorted((path.parent.parent / "tasks").glob(f"{record.category}.{world}.{record.seed}.*.json"))
    task = next((path for path in (run / TASK_FILE, *tasks) if path.exists()), None)
    if task is None:
        raise SchemaError(f"{episode}: the task of the episode is not beside it (tasks/*.json, or {run / TASK_FILE})")
    return facts_of_episode(record, read_json(task))


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
    reports = [_reported_subtask(action) for action in actions]
    never = next((k for k in range(parts) if k not in reports), max(parts - 1, 0))
    found: list[int] = []
    coming = never
    for report in reversed(reports):
        if report is not None and report < parts:
            coming = report
        found.append(coming)
    return found[::-1]


def _reported_subtask(action: Any) -> int | None:
    if not isinstance(action, Mapping) or action.get("type") != "task_complete":
        return None
    index = action.get("index")
    return int(index) if isinstance(index, int | float) else None


#: What stands for an instruction where nobody gave one.
NO_INSTRUCTION = "No instruction."
_WORLD_POSE = ("x", "y", "z", "yaw")


@dataclass(frozen=True)
class Demonstration:
    """One agent's part in one run: frame *t* holds what it observed then and what it did next.

    Attributes
    ----------
    agent, kind
        Its name, and ``resident``, ``assistant`` or ``robot``.
    body
        What acts: ``person``, or a robot's model.
    person
        Id of the resident it is; empty for others.
    steps
        Recorded step of each frame, shape ``(n,)``.
    fps
        Frames a second of simulated time: how often the agent acts.
    state_names, form
        What the numbers of `state` are, and how `action` is made and read.
    state, action
        float32, shapes ``(n, len(state_names))`` and ``(n, len(form.names))``.
    goal
        float32, shape ``(n, len(GOAL))``; None where there is no task.
    text
        Text of each action; see `vico.datasets.vectors`.
    status
        How each action went, `vico.rules.ActionStatus`, int64, shape ``(n,)``.
    instructions
        Of each frame, in words.
    success
        Whether what was asked for was done in the end; None where nobody judged.
    facts
        What the episode was.
    """

    agent: str
    kind: str
    body: str
    person: str
    steps: NDArray[np.int64]
    fps: int
    state_names: tuple[str, ...]
    form: VectorForm
    state: NDArray[np.float32]
    action: NDArray[np.float32]
    goal: NDArray[np.float32] | None
    text: list[str]
    status: NDArray[np.int64]
    instructions: list[str]
    success: bool | None
    facts: EpisodeFacts

    def __len__(self) -> int:
        return len(self.steps)


def demonstrations_of(
    run: Run, facts: EpisodeFacts, agents: Sequence[str], *, instruction: str = ""
) -> list[Demonstration]:
    """Return the demonstrations of some agents of a run.

    Parameters
    ----------
    facts
        What the run was an episode of.
    agents
        Names.
    instruction
        What to say where no task and no schedule says what was asked for.

    Raises
    ------
    InputError
        If nobody has a name, an agent's period gives no whole number of frames a second, or an action fits into no
        vector.
    EmptyInputError
        If the run has no step yet.
    """
    known = {agent["name"]: agent for agent in run.agents}
    if unknown := [name for name in agents if name not in known]:
        raise InputError(f"{run.path}: nobody is called {unknown[0]!r}; there are {', '.join(known)}")
    if run.last < 1:
        raise EmptyInputError(f"{run.path}: the run has no step; nothing was done in it")
    return [_demonstration(run, facts, known[name], instruction) for name in agents]


def _demonstration(run: Run, facts: EpisodeFacts, agent: Mapping[str, Any], instruction: str) -> Demonstration:
    period = _period(run, agent)
    # An agent acts at multiples of its period, but not at the run's last step.
    ticks = np.rint((run.times - run.times[0]) * TICKS_PER_SECOND).astype(np.int64)
    steps = np.flatnonzero(ticks[:-1] % period == 0)
    rows = _rows_of(run, "agents", agent["entity"]) | {"time": run.times}
    body = _rows_of(run, "bodies", agent["entity"])
    pose = np.column_stack([body[name] for name in _WORLD_POSE])
    actions = [None if text is None else json.loads(text) for text in rows["action"]]
    # What a row says of actions happened on the way to its step.
    taken = [actions[step + 1] for step in steps]
    own = [int(step) for step in steps]
    if agent["kind"] == "robot":
        names, state, form, model = _robot(run, agent, rows)
    else:
        model, form, names = "person", ActionForm(), PERSON_STATE
        state = recorded_person_states(rows | {name: body[name] for name in _WORLD_POSE})
    poses = pose[own]
    who = f"{run.path}: {agent['name']}"
    vectors = np.zeros((len(taken), len(form.names)), np.float32)
    texts: list[str] = []
    for k, action in enumerate(taken):
        try:
            vectors[k], text = form.encode(action, poses[k].tolist())
        except InputError as error:
            raise InputError(f"{who}: step {k}: {error}") from None
        texts.append(text)
    parts = current_part(taken, len(facts.instructions))
    # An agent that shares the task with others is told of all of it.
    told = [facts.instructions[part] if facts.instructions else None for part in parts]
    goal = None
    if facts.instructions:
        goal = np.array([goal_vector(pose[k], one) for k, one in zip(own, told, strict=True)], np.float32)
    return Demonstration(
        agent=agent["name"],
        kind=agent["kind"],
        body=model,
        person=agent["resident"] or "",
        steps=steps,
        fps=round(TICKS_PER_SECOND / period),
        state_names=tuple(names),
        form=form,
        state=state[own],
        action=vectors,
        goal=goal,
        text=texts,
        status=rows["status"][steps + 1].astype(np.int64),
        instructions=_instructions(agent, told, run.times[own], instruction),
        success=facts.success,
        facts=facts,
    )


def _rows_of(run: Run, table: str, entity: int) -> dict[str, NDArray[Any]]:
    """Return the columns of a table that are about one entity, a row a step."""
    columns = run.columns(table)
    mine = columns["entity"] == entity
    found = {name: values[mine] for name, values in columns.items()}
    order = np.argsort(found["step"], kind="stable")
    return {name: values[order] for name, values in found.items()}


def _robot(
    run: Run, agent: Mapping[str, Any], rows: Mapping[str, NDArray[Any]]
) -> tuple[tuple[str, ...], NDArray[np.float32], ActionForm, str]:
    """Return names and values of a robot's state, the form of its actions, and its model."""
    model = str(run.manifest["config"]["robots"][int(str(agent["name"]).rpartition("_")[2])]).partition(":")[0]
    joints = run.columns("joints")
    mine = joints["entity"] == agent["entity"]
    steps = run.last + 1
    order = np.lexsort([joints["joint"][mine], joints["step"][mine]])
    angles = joints["angle"][mine][order].reshape(steps, -1) if mine.any() else np.zeros((steps, 0))
    state = recorded_robot_states(dict(rows) | _rows_of(run, "robots", agent["entity"]), angles)
    space, own = next(iter(robot_model(model).action_spaces.items()))
    return robot_state_names(angles.shape[1]), state, ActionForm(robot=True, width=len(own), space=space), model


def _period(run: Run, agent: Mapping[str, Any]) -> int:
    """Return how often an agent acts, ticks.

    Raises
    ------
    InputError
        If that is no whole number of frames a second.
    """
    config = run.manifest["config"]
    robot, asked = agent["kind"] == "robot", config.get("periods", {})
    period = asked.get(agent["name"], asked.get("robots", 1.0) if robot else 1.0)
    if period == "model":
        model = str(config["robots"][int(str(agent["name"]).rpartition("_")[2])]).partition(":")[0]
        period = robot_model(model).control_period
    ticks = round(float(period) * TICKS_PER_SECOND)
    if ticks <= 0 or TICKS_PER_SECOND % ticks:
        raise InputError(
            f"{run.path}: {agent['name']} acts every {float(period):g} s, which is no whole number of times a second, "
            "as formats of trainers want it; record it with a period like 1, 0.5, 0.2 or 0.1"
        )
    return ticks


def _instructions(
    agent: Mapping[str, Any],
    told: Sequence[Mapping[str, Any] | None],
    times: NDArray[np.float64],
    instruction: str,
) -> list[str]:
    """Return what was asked for at each frame: by the task, by the person's schedule, or as the caller says."""
    items = (agent.get("person") or {}).get("schedule") or []
    entries = [(_seconds(item["start"]), _seconds(item["end"]), str(item["activity"])) for item in items]
    found: list[str] = []
    for one, time in zip(told, times, strict=True):
        if one is not None:
            found.append(str(one["text"]))
        else:
            second = math.fmod(float(time), 86400.0)
            planned = next((activity for start, end, activity in entries if start <= second < end), "")
            found.append(instruction or planned or NO_INSTRUCTION)
    return found


def _seconds(clock: str) -> float:
    hours, minutes, *rest = (float(part) for part in str(clock).split(":"))
    return 3600.0 * hours + 60.0 * minutes + (rest[0] if rest else 0.0)
