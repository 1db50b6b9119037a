"""Episodes of pick and place in the real simulation: whoever acts, what came of it, and demonstrations.

The demonstrator drives up to the thing, and picks and places by what the robot sees and feels. A demonstrated episode
is what policies are taught by: what the robot saw and felt, and what it did next.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.agents.robot.arm_interface import ArmStage
from vico.agents.robot.arm_skills import ArmWorker
from vico.agents.robot.body import Stance
from vico.agents.robot.increments import INCREMENTS, JOINTS, PERIOD, STATE, arm_state, increments_of
from vico.assets.models.movable import movable_prototype, movable_surfaces
from vico.assets.robots import robot_model
from vico.challenges.pick_place.tasks import NEXT_TO, TABLE, PickPlaceTask, draw_task, level_field
from vico.challenges.robot_tasks import arm_body
from vico.clock import clock_of
from vico.envs import Simulation, make
from vico.world.world import World

__all__ = [
    "FPS",
    "INCREMENTS",
    "METHOD",
    "PERIOD",
    "ROBOT",
    "SIDE",
    "STATE",
    "Actor",
    "DemonstratedEpisode",
    "Demonstrator",
    "Observation",
    "ObservationHook",
    "Played",
    "Verdict",
    "demonstrate",
    "play",
    "simulation_of",
]
#: The robot's name.
ROBOT = "robot_0"
#: Side of its pictures unless told, pixels, as in the paper.
SIDE = 224
_HEIGHT = 0.05  # metres that a thing may be off the height of what it lies on
_STILL = 0.02  # m/s below which it lies still
_TOUCHED = 0.5  # newtons of a finger that touches it
# Seconds that a thing is given to come to rest once the robot is done.
_RESTS = 1.0

Observation = dict[str, Any]


class Actor(Protocol):
    """Who controls the robot, twenty times a second."""

    def act(self, observation: Observation, instruction: str) -> dict[str, Any] | None:
        """Return a ``control`` action; None once all is done, or given up."""


class Verdict:
    """Why an episode ended as it did."""

    DONE, NOT_TAKEN, DROPPED, NOT_PLACED, HELD, TIMEOUT, FALLEN = (
        "done", "not taken", "dropped on the way", "not where it was to be", "still held", "out of time", "fallen",
    )  # fmt: skip


@dataclass(frozen=True)
class Played:
    """What came of an episode.

    Attributes
    ----------
    success
        Whether the thing lies where it was to be.
    cause
        One of `Verdict`.
    why
        What the actor says of it; empty where it has nothing to say.
    seconds
        It took.
    off
        Metres from the thing's middle to that of what it was to be put beside, or onto.
    states, actions
        As a policy is taught, before each action: float32, shapes ``(n, 20)`` and ``(n, 11)``.
    """

    success: bool
    cause: str
    why: str
    seconds: float
    off: float
    states: NDArray[np.float32]
    actions: NDArray[np.float32]


#: Told what the robot observed, and what it does next.
ObservationHook = Callable[[Observation], None]


def play(
    task: PickPlaceTask,
    world: World | None,
    actor: Actor,
    *,
    side: int = SIDE,
    outputs: tuple[str, ...] = ("rgb", "depth", "segmentation"),
    seen: ObservationHook | None = None,
    to_the_end: bool = False,
) -> Played:
    """Play an episode.

    Parameters
    ----------
    world
        That the task was drawn in; None for its field.
    side
        Of the robot's pictures, pixels.
    outputs
        That it is given.
    seen
        Told each observation that the robot acted upon, in their order.
    to_the_end
        Whether the actor goes on until it says that it is done; else the episode is over once the thing has been where
        it was to be for a second, in nobody's jaw.
    """
    sim = simulation_of(task, world, side=side, outputs=outputs)
    observation = _step(sim, {"type": "wait"})
    if callable(getattr(actor, "begin", None)):
        actor.begin(task, sim.ground_truth.object_entity("thing"))  # type: ignore[attr-defined]
    states: list[NDArray[np.float32]] = []
    actions: list[NDArray[np.float32]] = []
    lifted, done, cause = False, 0, Verdict.TIMEOUT
    for _ in range(round(task.seconds / PERIOD)):
        action = actor.act(observation, task.instruction)
        if action is None:
            cause = ""
            break
        state = arm_state(observation)
        states.append(state)
        actions.append(increments_of(action["vector"], state))
        if seen is not None:
            seen(observation)
        observation = _step(sim, action)
        lifted = lifted or float(sim.ground_truth.object_position("thing")[2] - task.thing.position[2]) > 0.05
        if observation["sensors"]["fallen"][0]:
            cause = Verdict.FALLEN
            break
        done = done + 1 if lifted and _judge(sim, task, observation, lifted=lifted)[0] == Verdict.DONE else 0
        if done * PERIOD >= _RESTS and not to_the_end:
            cause = ""
            break
    before = np.zeros(3)
    for _ in range(round(_RESTS / PERIOD)):
        before = sim.ground_truth.object_position("thing").copy()
        observation = _step(sim, {"type": "stop"})
    found, off = _judge(sim, task, observation, lifted=lifted)
    still = float(np.linalg.norm(sim.ground_truth.object_position("thing") - before)) < _STILL * PERIOD
    success = found == Verdict.DONE and still and cause != Verdict.FALLEN
    if not cause and not success and found == Verdict.DONE:
        found = Verdict.NOT_PLACED  # it rolls, or topples
    return Played(
        success,
        found if success or not cause else cause,
        str(getattr(actor, "why", "")),
        len(states) * PERIOD,
        off,
        np.array(states, np.float32).reshape(-1, len(STATE)),
        np.array(actions, np.float32).reshape(-1, len(INCREMENTS)),
    )


def simulation_of(task: PickPlaceTask, world: World | None, *, side: int, outputs: tuple[str, ...]) -> Simulation:
    """Return the simulation of a task before its first step: the robot, the thing and the one beside it."""
    env = make(
        level_field(task.seed, table=task.table) if world is None else world,
        seed=task.seed,
        residents=0,
        robots=("manipulator",),
        robot_places={ROBOT: task.robot},
        periods={ROBOT: PERIOD},
        observe=(ROBOT,),
        transit=False,
        outputs=outputs,
        image=side,
        start=clock_of(task.start),
        weather=task.weather,
        setup=lambda sim: _set_up(sim, task),
    )
    return env.sim


def _set_up(sim: Simulation, task: PickPlaceTask) -> None:
    for name, thing in (("thing", task.thing), ("landmark", task.landmark)):
        sim.scenario.add_object(
            name,
            movable_prototype(thing.kind, thing.colour),
            movable_surfaces(thing.kind, thing.colour),
            thing.position,
            size=thing.size,
            yaw=thing.yaw,
        )


def _step(sim: Simulation, action: dict[str, Any]) -> Observation:
    """Advance by a period; return what the robot observes then."""
    sim.act({ROBOT: action})
    sim.advance(PERIOD)
    observations, _ = sim.observe([ROBOT])
    return observations[ROBOT]


def _judge(sim: Simulation, task: PickPlaceTask, observation: Observation, *, lifted: bool) -> tuple[str, float]:
    """Return what is to be said of where the thing is, and how far off it is."""
    at = sim.ground_truth.object_position("thing")
    if task.destination == "table":
        assert task.table is not None
        off = at - np.array(task.table)
        there = abs(off[0]) <= TABLE[0] / 2 and abs(off[1]) <= TABLE[1] / 2
    else:
        off = at - sim.ground_truth.object_position("landmark")
        off[2] = at[2] - float(sim.world.height(at[:2]))
        there = float(np.hypot(off[0], off[1])) <= NEXT_TO
    distance = float(np.hypot(off[0], off[1]))
    if float(np.min(observation["sensors"]["contacts"])) > _TOUCHED:
        return Verdict.HELD, distance
    if there and abs(float(off[2])) <= _HEIGHT and lifted:
        return Verdict.DONE, distance
    if not lifted:
        return Verdict.NOT_TAKEN, distance
    return Verdict.NOT_PLACED, distance


#: What it is called in the records of a dataset.
METHOD = "arm_worker"
_NEAR = 1.2  # metres from which on the arm's own skills bring the base up
_FASTEST = 0.5  # m/s on the way there
_TURNS = 0.8  # rad/s on the way there
_GAIN = 1.5  # of turning, 1/s
_AHEAD = 0.15  # rad off its heading at which it goes ahead


class Demonstrator:
    """An `ArmWorker` that is told which thing it is about and where to put it.

    All it does are speeds of the base and places of the servos: what a policy can do, too.

    Attributes
    ----------
    why
        What did not work; empty if all did.
    """

    def __init__(self, *, period: float) -> None:
        self._worker = ArmWorker(arm_body(robot_model("manipulator")), period=period)
        self._task: PickPlaceTask | None = None
        self._entity = 0
        self._begun = 0
        self._servos: list[float] = []
        self.why = ""

    def begin(self, task: PickPlaceTask, entity: int) -> None:
        """Take up a task; the thing is the entity in what the robot sees."""
        self._task, self._entity = task, entity

    def act(self, observation: Observation, instruction: str) -> dict[str, Any] | None:
        """Return the action for the coming period; None once all is done, or given up."""
        assert self._task is not None
        if not self._servos:
            self._servos = [float(angle) for angle in observation["sensors"]["joint_position"]]
        worker = self._worker
        if self._begun and not worker.busy:
            self.why = worker.why
            if worker.outcome == "failed" or self._begun == 2:
                return None
        goal = np.array(self._task.spot if self._begun and not worker.busy else self._task.thing.position)
        if not worker.busy:
            way = self._approach(observation, goal)
            if way is not None:
                return way
            self._begun += 1
            if self._begun == 1:
                worker.pick(self._entity, goal)
            else:
                worker.place(goal)
        action = worker.act(observation)
        if action["type"] != "control":  # it would drive by the map, which is no speeds
            self.why = "drifted off"
            return None
        self._servos = action["vector"][: len(JOINTS)]
        return action if worker.busy or worker.stage is ArmStage.IDLE else None

    def _approach(self, observation: Observation, goal: NDArray[np.float64]) -> dict[str, Any] | None:
        """Return speeds that bring the base straight near a goal; None if it is there."""
        x, y, _ = Stance.of(observation).inside(goal).tolist()
        distance, bearing = math.hypot(x, y), math.atan2(y, x)
        if distance <= _NEAR:
            return None
        turn = min(max(_GAIN * bearing, -_TURNS), _TURNS)
        forward = min(0.08 + distance - _NEAR, _FASTEST) if abs(bearing) < _AHEAD else 0.0
        return {"type": "control", "vector": [*self._servos, forward, turn]}


#: Frames a second.
FPS = round(1.0 / PERIOD)


@dataclass(frozen=True)
class DemonstratedEpisode:
    """An episode that was shown.

    Attributes
    ----------
    task, played
        What was asked for, and what came of it.
    kept
        Numbers of the steps that are frames of it, int64, ascending, shape ``(m,)``.
    """

    task: PickPlaceTask
    played: Played
    kept: NDArray[np.int64]


def demonstrate(
    seed: int,
    world: World | None,
    *,
    seconds: int,
    side: int,
    drop_below: float = 0.0,
    seen: Callable[[int, dict[str, Any]], None] | None = None,
) -> DemonstratedEpisode:
    """Draw the task of a seed and show how it is done.

    Parameters
    ----------
    world
        Whose streets it is set in; None for a level field.
    seconds
        That it may last.
    side
        Of the pictures that are wanted, pixels; the robot sees no fewer than 224, for it plans by what it sees.
    drop_below
        Steps whose largest increment is smaller are left out, rad and metres, as in the paper (0.01).
    seen
        Told the number of each step and what the robot observed then.
    """
    task = draw_task(seed, world, seconds=seconds)
    count = 0

    def count_observation(observation: Observation) -> None:
        nonlocal count
        if seen is not None:
            seen(count, observation)
        count += 1

    played = play(
        task, world, Demonstrator(period=PERIOD), side=max(side, SIDE), seen=count_observation, to_the_end=True
    )
    largest = np.abs(played.actions).max(axis=1, initial=0.0)
    return DemonstratedEpisode(task, played, np.flatnonzero(largest >= drop_below))
