"""Reading a recorded run: finished, stopped, killed half-way, or still being written by another process.

Joint poses of recorded people are computed from motion and phase, as they were drawn; one person's as a motion.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from vico.assets.motions import HIP_HEIGHT, MotionClip
from vico.assets.motions.clip import rotation_matrices, rotation_vectors
from vico.assets.people import Appearance, body_of
from vico.errors import EmptyInputError, InputError
from vico.exact import product
from vico.io.files import read_json
from vico.rules import ActionStatus, code_name
from vico.seeds import rng
from vico.sim.animation import STYLE, Hands, Hold, Transition, free_hands, pose, style_of
from vico.sim.animation.motions import CLIPS
from vico.sim.config import find_by_name
from vico.sim.pictures.people import looks_of_strangers, manner_of_pedestrian
from vico.sim.recording.films import View
from vico.sim.recording.manifest import CastMember, read_cast, read_manifest
from vico.sim.recording.schema import (
    AGENTS,
    METRICS,
    TABLES,
    VIEWS,
    Checkpoint,
    Segment,
    checkpoint_steps,
    column_values,
    read_checkpoint,
    read_table,
    segments_of,
)

__all__ = [
    "AgentRecord",
    "JointPoses",
    "Moment",
    "PosedPeople",
    "Run",
    "Tracks",
    "looks_and_manners",
    "motion_of",
    "read_run",
]
#: Segments kept in memory by a reader that goes back and forth.
_KEPT = 4


@dataclass(frozen=True)
class Tracks:
    """Positions of everything in a range of steps.

    Attributes
    ----------
    steps
        Shape ``(s,)``.
    entity
        Bodies that were there at any of the steps, in ascending order, int32, shape ``(n,)``.
    position, yaw, speed
        Metres, radians, metres a second; float64, shapes ``(s, n, 3)``, ``(s, n)`` and ``(s, n)``; NaN where a body was
        not there.
    """

    steps: NDArray[np.int32]
    entity: NDArray[np.int32]
    position: NDArray[np.float64]
    yaw: NDArray[np.float64]
    speed: NDArray[np.float64]


@dataclass(frozen=True)
class AgentRecord:
    """An agent at a step.

    Attributes
    ----------
    action
        What it asked for in the step that ended here, as recorded; None if it asked for nothing.
    status, code, reason
        How that went: a `vico.rules.ActionStatus` in lower case, why (a `ReasonCode`), and why in words.
    clip, phase
        A person's motion (`vico.sim.animation.CLIPS`) and where in its cycle, 0..1; "" and 0 for robots.
    pitch
        Of the gaze, radians.
    posture, room, place, vehicle, held, cash
        As in `vico.sim.bodies.state_arrays.People`.
    joints
        A robot's joint angles, radians, in the order of its motors; empty for people.
    """

    action: Any
    status: str
    code: str
    reason: str
    clip: str
    phase: float
    pitch: float
    posture: int
    room: int
    place: int
    vehicle: int
    held: tuple[int, int]
    cash: float
    joints: NDArray[np.float64]


@dataclass(frozen=True)
class Moment:
    """Everything that was recorded of a step.

    Attributes
    ----------
    step, time, hash
        Its number, seconds since midnight of the first day, and the hash of the state.
    entity, position, yaw, speed
        Of all bodies, by ascending entity; shapes ``(n,)``, ``(n, 3)``, ``(n,)``, ``(n,)``.
    agents
        By name.
    events
        What happened in the step that ended here; messages among them.
    metrics
        Counts since the start of the run.
    """

    step: int
    time: float
    hash: str
    entity: NDArray[np.int32]
    position: NDArray[np.float64]
    yaw: NDArray[np.float64]
    speed: NDArray[np.float64]
    agents: dict[str, AgentRecord]
    events: list[dict[str, Any]]
    metrics: dict[str, int]


class Run:
    """A recorded run, as far as it came when it was opened or last refreshed; see `read_run`.

    Attributes
    ----------
    path
        Its folder.
    manifest
        ``run.json``.
    agents
        ``agents.json``: who takes part.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.manifest = read_manifest(path)
        self.agents: list[dict[str, Any]] = read_json(path / AGENTS)["agents"]
        self._segments = segments_of(path)
        self._table = lru_cache(maxsize=_KEPT * len(TABLES))(read_table)
        if not self._segments:
            raise EmptyInputError(f"{path}: the run was stopped before its first minute was written; run it anew")

    def __repr__(self) -> str:
        status = self.manifest.get("status", "unfinished")
        return f"Run({str(self.path)!r}: {self.last} steps, {len(self.agents)} agents, {status})"

    def refresh(self) -> bool:
        """Look for what was recorded meanwhile; return whether there is more."""
        before = self.last
        self.manifest = read_manifest(self.path)
        self._segments = segments_of(self.path)
        for name in ("_steps", "cast", "metrics"):
            self.__dict__.pop(name, None)
        return self.last > before

    # What there is.

    def source(self, what: Literal["world", "community"]) -> Path:
        """Return the folder of the world or the community of the run; it may be there no longer."""
        return Path(os.path.normpath(self.path / self.manifest[what]["path"]))

    @property
    def complete(self) -> bool:
        """Whether the run went to its end."""
        return bool(self.manifest["status"] == "complete")

    @property
    def last(self) -> int:
        """The last recorded step; the first is 0, the state before anything happened."""
        return self._segments[-1].last

    @property
    def steps(self) -> NDArray[np.int32]:
        """Numbers of all recorded steps."""
        return np.arange(self.last + 1, dtype=np.int32)

    @property
    def times(self) -> NDArray[np.float64]:
        """Seconds since midnight of the first day, of every step."""
        return np.asarray(self._steps["time"].to_numpy())

    @property
    def hashes(self) -> list[str]:
        """State hashes of every step."""
        found: list[str] = self._steps["hash"].to_pylist()
        return found

    @property
    def counts(self) -> dict[str, NDArray[np.int32]]:
        """Metrics over time: counts since the start, at every step."""
        return {name: self._steps[name].to_numpy() for name in _COUNTS}

    @cached_property
    def cast(self) -> dict[int, CastMember]:
        """Everybody and everything that was there at some step, by entity."""
        return read_cast(self.path, self.last)

    @property
    def names(self) -> dict[str, str]:
        """What everybody and everything that was there is called, by the name a simulation has for it."""
        return {member.agent or member.name: member.name for member in self.cast.values()}

    @cached_property
    def metrics(self) -> dict[str, Any]:
        """Counts and seconds; empty if the run was cut short before they were written."""
        path = self.path / METRICS
        content: dict[str, Any] = read_json(path) if path.exists() else {}
        return content

    @property
    def views(self) -> dict[str, View]:
        """Films of what agents saw, by agent's name; a frame for every step at which it observed."""
        folders = {agent["name"]: self.path / VIEWS / agent["name"] for agent in self.agents}
        return {name: View(folder, self.last) for name, folder in folders.items() if any(folder.glob("*.mp4"))}

    @property
    def checkpoints(self) -> list[int]:
        """Steps of which the exact state was kept."""
        return [step for step in checkpoint_steps(self.path) if step <= self.last]

    def checkpoint(self, step: int) -> Checkpoint:
        """Return the exact state at one of the `checkpoints`.

        Raises
        ------
        MissingFileError, SchemaError
            If there is none of that step, or it is damaged.
        """
        return read_checkpoint(self.path, step, owner=self.manifest["identity"])

    # What happened.

    def table(self, name: str, first: int = 0, last: int | None = None) -> pa.Table:
        """Return the rows of a table (`docs/formats.md`) from step `first` to step `last`, both included, as stored.

        Raises
        ------
        InputError
            If the steps were not recorded.
        SchemaError
            If a file is damaged.
        """
        end = self.last if last is None else last
        parts = [self._table(segment, name) for segment in self._covering(first, end)]
        table = pa.concat_tables(parts)
        steps = table["step"].to_numpy()
        inside = (steps >= first) & (steps <= end)
        return table if inside.all() else table.filter(pa.array(inside))

    def columns(self, name: str, first: int = 0, last: int | None = None) -> dict[str, NDArray[Any]]:
        """Return the same as arrays in the columns' quantities: metres, radians, seconds."""
        table = self.table(name, first, last)
        return {key: column_values(table, key, column) for key, column in TABLES[name].items()}

    def tracks(self, first: int = 0, last: int | None = None) -> Tracks:
        """Return where everything was from step `first` to step `last`, both included."""
        rows = self.columns("bodies", first, last)
        steps = np.arange(first, (self.last if last is None else last) + 1, dtype=np.int32)
        entity, column = np.unique(rows["entity"], return_inverse=True)
        place = rows["step"] - first, column

        def grid(*names: str) -> NDArray[np.float64]:
            values = np.full((len(steps), len(entity), len(names)), np.nan)
            for k, name in enumerate(names):
                values[(*place, np.full(len(column), k))] = rows[name]
            return values

        return Tracks(steps, entity, grid("x", "y", "z"), grid("yaw")[..., 0], grid("speed")[..., 0])

    @property
    def events(self) -> list[dict[str, Any]]:
        """Everything that happened, in its order; see `events_between`."""
        return self.events_between(0, self.last)

    def events_between(self, first: int, last: int) -> list[dict[str, Any]]:
        """Return what happened in the steps `first` to `last`: ``step`` is the one at whose end it is told."""
        table = self.columns("events", first, last)
        names = list(table)
        rows = zip(*(table[name].tolist() for name in names), strict=True)
        events = [dict(zip(names, row, strict=True)) for row in rows]
        return [event | {"data": json.loads(event["data"])} for event in events]

    def at(self, step: int) -> Moment:
        """Return everything that was recorded of a step, reading its segment alone.

        Raises
        ------
        InputError
            If it was not recorded.
        """
        head = {key: values[0] for key, values in self.columns("steps", step, step).items()}
        bodies = self.columns("bodies", step, step)
        return Moment(
            step,
            float(head["time"]),
            str(head["hash"]),
            bodies["entity"],
            np.column_stack([bodies["x"], bodies["y"], bodies["z"]]),
            bodies["yaw"],
            bodies["speed"],
            self._agents_at(step),
            self.events_between(step, step),
            {name: int(head[name]) for name in _COUNTS},
        )

    def _agents_at(self, step: int) -> dict[str, AgentRecord]:
        names = {agent["entity"]: agent["name"] for agent in self.agents}
        rows = self.columns("agents", step, step)
        people = self.columns("people", step, step)
        motion = {int(e): k for k, e in enumerate(people["entity"])}
        joints = self.columns("joints", step, step)
        found: dict[str, AgentRecord] = {}
        for k, entity in enumerate(rows["entity"].tolist()):
            row = {key: values[k] for key, values in rows.items()}
            moving = motion.get(entity)
            found[names[entity]] = AgentRecord(
                None if row["action"] is None else json.loads(row["action"]),
                ActionStatus(int(row["status"])).name.lower(),
                code_name(int(row["code"])),
                row["reason"],
                "" if moving is None else CLIPS[int(people["clip"][moving])],
                0.0 if moving is None else float(people["phase"][moving]),
                float(row["pitch"]),
                int(row["posture"]),
                int(row["room"]),
                int(row["place"]),
                int(row["vehicle"]),
                (int(row["held_left"]), int(row["held_right"])),
                float(row["cash"]),
                joints["angle"][joints["entity"] == entity],
            )
        return {agent["name"]: found[agent["name"]] for agent in self.agents if agent["name"] in found}

    def _covering(self, first: int, last: int) -> Sequence[Segment]:
        if not 0 <= first <= last <= self.last:
            raise InputError(
                f"{self.path}: steps {first} to {last} were not all recorded; there are steps 0 to {self.last}"
            )
        return [segment for segment in self._segments if segment.first <= last and segment.last >= first]

    @cached_property
    def _steps(self) -> pa.Table:
        return self.table("steps")


_COUNTS = tuple(name for name in TABLES["steps"] if name not in ("step", "time", "hash"))


def read_run(path: Path | str) -> Run:
    """Open a run folder; what is asked of the run is read when it is asked for.

    A run that is being written can be opened, too: it is read as far as it came, and `Run.refresh` looks for more.

    Raises
    ------
    MissingFileError, SchemaError, EmptyInputError
        If it is no run, damaged, of another version, or was stopped before anything was recorded.
    """
    return Run(Path(path))


@dataclass(frozen=True)
class JointPoses:
    """Poses of people at a step.

    Attributes
    ----------
    entity
        Who, int32, shape ``(n,)``.
    rotations
        Axis-angle of each of the 55 joints (`vico.assets.people.JOINTS`) relative to its parent, radians, float32,
        shape ``(n, 55, 3)``; all 0 is the T-pose.
    offsets
        Shift of the pelvis from its place in the T-pose, body frame, metres, float32, shape ``(n, 3)``.
    joints
        Joints in the T-pose, body frame (x forward, y left, z up), metres, float32, shape ``(n, 55, 3)``.
    """

    entity: NDArray[np.int32]
    rotations: NDArray[np.float32]
    offsets: NDArray[np.float32]
    joints: NDArray[np.float32]


class PosedPeople:
    """Gives the joint poses of everybody on legs at any step of a run: residents, assistants and pedestrians.

    They are those that were drawn, but as on level ground.

    Parameters
    ----------
    run
        The run; bodies of those asked for are made when they are first needed.
    """

    def __init__(self, run: Run) -> None:
        self._run = run
        self._styles: dict[int, Any] = {}
        self._looks, self._manners = looks_and_manners(run.manifest["seed"], run.agents, run.cast)

    def at(self, step: int, entities: Sequence[int] | None = None) -> JointPoses:
        """Return the joint poses at a step, of all people or of some.

        Raises
        ------
        InputError
            If the step was not recorded, or one of `entities` was not there as a person.
        """
        people = self._run.columns("people", step, step)
        second = float(self._run.columns("steps", step, step)["time"][0])
        there = {entity: row for row, entity in enumerate(people["entity"].tolist())}
        wanted = list(there) if entities is None else list(entities)
        absent = [entity for entity in wanted if entity not in there]
        if absent:
            raise InputError(f"{self._run.path}: at step {step} there is no person with the number {absent[0]}")
        rows = [there[entity] for entity in wanted]
        style = np.array([self._style(entity) for entity in wanted], STYLE)
        mine = {name: values[rows] for name, values in people.items()}
        after = Transition(*(mine[name] for name in ("clip_before", "phase_before", "pace_before", "clip_time")))
        hands = self._hands(step, mine)
        moves = mine["clip"], mine["phase"], mine["pace"], style
        rotations, offsets = pose(*moves, second=second, after=after, hands=hands)
        return JointPoses(np.array(wanted, np.int32), rotations, offsets, style["joints"])

    def _hands(self, step: int, people: Mapping[str, NDArray[Any]]) -> Hands:
        """Return what some people, rows of the table, hold up or before them."""
        width = np.zeros(len(people["entity"]))
        if (people["hold"] == int(Hold.BEFORE_CHEST)).any():
            agents, cast = self._run.columns("agents", step, step), self._run.cast
            for entity, *held in zip(*(agents[key] for key in ("entity", "held_left", "held_right")), strict=True):
                sizes = [cast[int(thing)].size[1] for thing in held if int(thing) in cast]
                width[people["entity"] == entity] = max(sizes, default=0.0)
        hold, share = people["hold"].astype(np.int64), people["hold_share"].astype(np.float64)
        return free_hands(len(hold))._replace(hold=hold, share=share, width=width)

    def _style(self, entity: int) -> Any:
        if entity not in self._styles:
            look, seed = self._looks[entity], self._run.manifest["seed"]
            stream = rng(seed, "manner", self._manners[entity])
            self._styles[entity] = style_of(body_of(look), stream, age=look.age)
        return self._styles[entity]


def motion_of(run: Run, agent: str) -> MotionClip:
    """Return how one person moved in a run, a frame a step.

    Raises
    ------
    InputError
        If no person of that name takes part in it, or was not recorded.
    """
    people = {a["name"]: a["entity"] for a in run.agents if a["kind"] != "robot"}
    names = {name: called for name, called in run.names.items() if name in people}
    entity, posed = people[find_by_name(agent, names, option=f"{run.path}: agent")], PosedPeople(run)
    rows = run.columns("bodies")
    mine = np.flatnonzero(rows["entity"] == entity)
    steps, yaw = rows["step"][mine], rows["yaw"][mine]
    poses = [posed.at(int(step), [entity]) for step in steps]
    if not poses:
        raise InputError(f"{run.path}: nothing was recorded of {agent}")
    turned = np.zeros((len(poses), 3, 3))
    turned[:, 0, 0] = turned[:, 1, 1] = np.cos(yaw)
    turned[:, 1, 0], turned[:, 0, 1], turned[:, 2, 2] = np.sin(yaw), -np.sin(yaw), 1.0
    rotations = np.concatenate([found.rotations for found in poses])
    pelvis = np.concatenate([found.joints[:, 0] + found.offsets for found in poses]).astype(np.float64)
    place = np.column_stack([rows[axis][mine] for axis in ("x", "y", "z")])
    standing = float(poses[0].joints[0, 0, 2])
    position = (place + product(turned, pelvis[:, :, None])[:, :, 0]) * (HIP_HEIGHT / standing)
    times = run.columns("steps")["time"]
    rate = (len(times) - 1) / float(times[-1] - times[0]) if len(times) > 1 else 1.0
    orientation = rotation_vectors(product(turned, rotation_matrices(rotations[:, 0])))
    return MotionClip(agent, rate, np.asarray(position, np.float32), orientation, rotations[:, 1:])


def looks_and_manners(
    seed: int, agents: Sequence[Mapping[str, Any]], cast: Mapping[int, CastMember]
) -> tuple[dict[int, Appearance], dict[int, str]]:
    """Return how the people of a run look, and names of the streams that decide their manner, by entity.

    Parameters
    ----------
    seed
        Of the run.
    agents
        Records of its ``agents.json``.
    cast
        Its bodies, pedestrians among them.
    """
    people = [agent for agent in agents if agent["kind"] != "robot"]
    assistants = [agent for agent in people if agent["person"] is None]
    pedestrians = {m.entity: m.pedestrian for m in cast.values() if m.pedestrian is not None}
    strangers = looks_of_strangers(seed, len(assistants) + max(pedestrians.values(), default=-1) + 1)
    looks = {a["entity"]: Appearance.from_dict(a["person"]["appearance"]) for a in people if a["person"] is not None}
    looks |= {a["entity"]: strangers[k] for k, a in enumerate(assistants)}
    looks |= {entity: strangers[len(assistants) + k] for entity, k in pedestrians.items()}
    manners = {a["entity"]: a["name"] for a in people}
    return looks, manners | {entity: manner_of_pedestrian(k) for entity, k in pedestrians.items()}
