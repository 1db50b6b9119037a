"""Joint poses of recorded people: computed from motion and phase, as they were drawn; one person's as a motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.motions import HIP_HEIGHT, MotionClip
from vico.assets.motions.rotations import matrices_of, vectors_of
from vico.assets.people import Appearance, body_of
from vico.errors import InputError
from vico.exact import product
from vico.seeds import rng
from vico.sim.animation import STYLE, Hands, Hold, Transition, free_hands, pose, style_of
from vico.sim.names import name_called
from vico.sim.passers_by import looks_of_strangers, manner_of_pedestrian
from vico.sim.recording.cast import CastMember
from vico.sim.recording.run import Run


@dataclass(frozen=True)
class JointPoses:
    """How people hold themselves at a step.

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
    entity, posed = people[name_called(agent, names, option=f"{run.path}: agent")], PosedPeople(run)
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
    orientation = vectors_of(product(turned, matrices_of(rotations[:, 0])))
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
