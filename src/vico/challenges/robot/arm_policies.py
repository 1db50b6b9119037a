"""Trained policies as a robot's arm in a city, and their files as methods of `vico eval robot`.

Each policy is told what it was trained on, at the rate it was trained at. Files are checked before anything is
played, and told apart by hash.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import AgentState
from vico.agents.robot.arm_interface import ArmPolicy, PolicyErrand, ReadyPose
from vico.agents.robot.body import ArmBody, rotate_aside
from vico.agents.robot.chunk_policy import ChunkActor, ChunkPolicy
from vico.agents.robot.grasps import ObjectPose, finger_contacts
from vico.agents.robot.increments import PERIOD, PolicyClock
from vico.agents.robot.lerobot_policy import LeRobotActor
from vico.challenges.learning.manipulation.observation import size_of
from vico.challenges.learning.manipulation.policies import ArmController, ArmState, read_policy
from vico.challenges.learning.manipulation.scene import (
    ACTIONS,
    APART,
    OPENING,
    RAISED,
    RATE,
    ManipulationOptions,
    ready_angles,
)
from vico.challenges.records import Setting
from vico.challenges.robot.tasks import RobotTask
from vico.errors import InputError, MissingFileError, SchemaError, VicoError
from vico.io.files import read_json, sha256_of

Array = NDArray[np.float64]

#: Seconds that policies are given for an errand: those of an episode of training by reinforcement (the paper's 250
#: steps at 20 Hz), and half of an episode of imitation, which has a minute for either part.
RL_SECONDS, IMITATION_SECONDS = 12.5, 60.0
# What lies higher than this above the ground is put on something, metres.
_RAISED_GROUND = 0.15


class ReinforcedArm:
    """Acts with dense networks that `scripts/train_manipulation.py` has trained.

    The observation is the environments' own (`vico.challenges.learning.manipulation.observation`), made from joints,
    finger contacts and the box of the thing, all in the frame of the base, which is told as standing where it is.

    Parameters
    ----------
    pick, place
        For either part; twice the same for a policy of PickPlace.
    lifts
        Whether the first was trained to lift: its goal is above the thing, else beside it on what it stands on.
    period
        Seconds between two actions of the robot.
    """

    drives = False
    seconds = RL_SECONDS

    def __init__(self, pick: ArmController, place: ArmController, *, lifts: bool, period: float) -> None:
        self.ready: ReadyPose | None = ReadyPose(np.array(ready_angles()), OPENING)
        self._pick, self._place = pick, place
        self._lifts = lifts
        self._clock = PolicyClock(period, own=1.0 / RATE)
        self._places = False
        self._entity = 0
        self._goal = np.zeros(3)
        self._from = self._to = np.zeros(9)

    def begin(self, errand: PolicyErrand, servos: Array) -> None:
        """Begin an errand."""
        self._places, self._entity = errand.goal is not None, errand.entity
        self._goal = self._picking_goal(errand.thing) if errand.goal is None else errand.goal.copy()
        self._from = self._to = servos.copy()
        self._clock.ticks = 0

    def act(self, observation: Mapping[str, Any], thing: ObjectPose) -> Array:
        """Return what the robot is told for the coming period, shape ``(11,)``; the base stands.

        Raises
        ------
        InputError
            If the policy's action holds NaN or infinity.
        """
        due = self._clock.tick()
        controller = self._place if self._places else self._pick
        moment = moment_of(observation, thing, self._goal, pressing=finger_contacts(observation, self._entity))
        for _ in range(due.asks):
            self._from = self._to
            controller.reset(self._from)
            self._to = controller.targets(moment)
            if not np.isfinite(self._to).all():
                raise InputError("policy: its action holds NaN or infinity")
        return np.concatenate([self._from + due.share * (self._to - self._from), [0.0, 0.0]])

    def _picking_goal(self, thing: ObjectPose) -> Array:
        """Return a goal as training draws it, metres."""
        if self._lifts:
            return thing.middle + np.array([0.0, 0.0, sum(RAISED) / 2])
        # On the side where the arm has more room, as far off as goals are at least and a little more.
        return rotate_aside(thing.middle, -1.1 * APART if thing.middle[1] > 0.0 else 1.1 * APART)

    def state(self) -> AgentState:
        """Return all it remembers."""
        return {
            "ticks": self._clock.ticks,
            "places": self._places,
            "entity": self._entity,
            "goal": self._goal.copy(),
            "servos": np.stack([self._from, self._to]),
        }

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self._clock.ticks, self._places = int(state["ticks"]), bool(state["places"])
        self._entity, self._goal = int(state["entity"]), np.array(state["goal"])
        self._from, self._to = np.array(state["servos"])


class Imitator(Protocol):
    """A policy that was shown how: `ChunkActor`, `LeRobotActor`."""

    def reset(self) -> None:
        """Forget what was to be done: a new episode begins."""

    def act(self, observation: Mapping[str, Any], instruction: str) -> dict[str, Any]:
        """Return the action for a twentieth of a second."""


class ImitatingArm:
    """Acts with a policy that looks at pictures, feels joints, and reads an instruction.

    Parameters
    ----------
    actor
        The policy; it drives the base, too.
    thing, destination
        As the instruction names them.
    by_deck
        Whether what is picked is going to be put on a deck.
    stand
        Height of the base's frame above the ground, metres.
    period
        Seconds between two actions of the robot.
    """

    ready: ReadyPose | None = None
    drives = True
    seconds = IMITATION_SECONDS

    def __init__(
        self, actor: Imitator, *, thing: str, destination: str, by_deck: bool, stand: float, period: float
    ) -> None:
        self._actor, self._thing, self._destination = actor, thing, destination
        self._by_deck, self._stand = by_deck, stand
        self._clock = PolicyClock(period, own=PERIOD)
        self.instruction = ""
        self._from = self._to = np.zeros(11)

    def begin(self, errand: PolicyErrand, servos: Array) -> None:
        """Begin an errand, told in the words of training."""
        raised = self._by_deck
        if errand.goal is not None:
            underside = float(errand.goal[2] - errand.thing.middle[2]) + errand.thing.low
            raised = underside + self._stand > _RAISED_GROUND
        where = "on the table" if raised else f"down next to the {self._destination}"
        self.instruction = f"Pick up the {self._thing} and put it {where}."
        self._actor.reset()
        self._from = self._to = np.concatenate([servos, [0.0, 0.0]])
        self._clock.ticks = 0

    def act(self, observation: Mapping[str, Any], thing: ObjectPose) -> Array:
        """Return what the robot is told for the coming period, shape ``(11,)``.

        Raises
        ------
        InputError
            If the policy's action is none.
        """
        due = self._clock.tick()
        speeds = []
        for _ in range(due.asks):
            self._from = self._to
            self._to = np.asarray(self._actor.act(observation, self.instruction)["vector"], np.float64)
            if not np.isfinite(self._to).all():
                raise InputError("policy: its action holds NaN or infinity")
            speeds.append(self._to[9:])
        servos = self._from[:9] + due.share * (self._to[:9] - self._from[:9])
        return np.concatenate([servos, np.mean(speeds, axis=0) if speeds else self._to[9:]])

    def state(self) -> AgentState:
        """Return all it remembers.

        Raises
        ------
        InputError
            If the policy keeps what it is at to itself, as LeRobot's do.
        """
        remembered = getattr(self._actor, "state", None)
        if remembered is None:
            raise InputError("policy: LeRobot's policies keep their actions inside: no run can be saved in the middle")
        said = {"instruction": self.instruction, "ticks": self._clock.ticks, "servos": np.stack([self._from, self._to])}
        return {**said, "actor": remembered()}

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self._actor.restore(state["actor"])  # type: ignore[attr-defined]
        self.instruction, self._clock.ticks = str(state["instruction"]), int(state["ticks"])
        self._from, self._to = np.array(state["servos"])


def moment_of(
    observation: Mapping[str, Any], thing: ObjectPose, goal: Array, *, pressing: NDArray[np.bool_]
) -> ArmState:
    """Return what a policy is told of an arm and its thing; all in the frame of the base."""
    sensors = observation["sensors"]
    return ArmState(
        joints=np.asarray(sensors["joint_position"], np.float64),
        joint_rates=np.asarray(sensors["joint_velocity"], np.float64),
        box=thing.middle,
        box_rotation=thing.rotation,
        half=thing.half,
        goal=goal,
        pressing=pressing,
    )


#: Methods whose arm is moved by a policy that was learned.
LEARNED = ("rl", "rl-decomposed", "vla")
#: Side of robots' pictures in the challenge, pixels.
PICTURE = 256
_TRAIN = "scripts/train_manipulation.py"


class _Controllers(NamedTuple):
    """The controllers of a method of reinforcement learning."""

    pick: ArmController
    place: ArmController
    lifts: bool


def policy_setting(method: str, path: str) -> Setting:
    """Return what an episode's setting says of a policy: where it lies, and its hash.

    The policy is read whole, so that what is wrong with it is said before anything is played.

    Raises
    ------
    MissingFileError
        If there is no such file or folder.
    SchemaError
        If it is no such policy, or one for something else; pickles are never read.
    MissingExtraError
        If what it runs on is not installed.
    InputError
        If the method needs no policy.
    """
    if method not in LEARNED:
        raise InputError(f"robot: {method} has no policy; methods that have one are {', '.join(LEARNED)}")
    if not path:
        writes = "scripts/train_chunk_policy.py or LeRobot" if method == "vla" else _TRAIN
        raise InputError(f"robot: {method} needs --policy with what {writes} has written")
    if method == "vla":
        _imitator(Path(path), seed=0)
        whole = Path(path)
        files = sorted(one for one in whole.iterdir() if one.is_file()) if whole.is_dir() else [whole]
        return {"policy": path, "policy_sha256": _digest(files)}
    files = _files(method, path)
    _controllers(method, path)
    return {"policy": path, "policy_sha256": _digest(files)}


def policy_settings(methods: Sequence[str], given: Sequence[str]) -> dict[str, Setting]:
    """Return what settings say of the policies of methods, by method.

    Parameters
    ----------
    methods
        That are to be judged; those that were not learned need none.
    given
        ``METHOD=PATH``, or a path alone where one of them was learned.

    Raises
    ------
    VicoError
        If one is missing or too many, or as `policy_setting` does.
    """
    learned = [method for method in methods if method in LEARNED]
    paths: dict[str, str] = {}
    for one in given:
        method, _, path = one.partition("=")
        if method not in LEARNED:
            if len(learned) != 1:
                raise InputError(
                    f"eval: --policy {one}: say whose it is, METHOD={one}; methods that have one are "
                    f"{', '.join(LEARNED)}, and {', '.join(learned) or 'none of them'} is asked for"
                )
            method, path = learned[0], one
        if method not in learned or method in paths:
            why = "is given twice" if method in paths else "is for a method that is not asked for; add --method"
            raise InputError(f"eval: --policy {one}: {method} {why}")
        paths[method] = path
    return {method: policy_setting(method, paths.get(method, "")) for method in learned}


def read_arm_policy(method: str, setting: Setting, task: RobotTask, body: ArmBody, *, period: float) -> ArmPolicy:
    """Return the policy of an episode.

    Parameters
    ----------
    setting
        With ``policy``, and ``policy_sha256`` where somebody has looked at the file before.
    period
        Seconds between two actions of the robot.

    Raises
    ------
    VicoError
        As `policy_setting` does; and if the file has changed since then.
    """
    path = str(setting.get("policy", ""))
    found, wanted = policy_setting(method, path)["policy_sha256"], setting.get("policy_sha256", "")
    if wanted and found != wanted:
        raise SchemaError(f"policy: {path} has changed since the evaluation began; begin it anew with --force")
    if method != "vla":
        given = _controllers(method, path)
        return ReinforcedArm(given.pick, given.place, lifts=given.lifts, period=period)
    return ImitatingArm(
        _imitator(Path(path), seed=task.seed),
        thing=task.thing.name,
        destination=task.destination.name,
        by_deck=task.category == "deliver",
        stand=body.stand,
        period=period,
    )


def _controllers(method: str, path: str) -> _Controllers:
    files = _files(method, path)
    if method == "rl":
        controller = _controller(files[0], "pickplace")
        return _Controllers(controller, controller, False)
    return _Controllers(_controller(files[0], "lift"), _controller(files[1], "place"), True)


def _files(method: str, path: str) -> list[Path]:
    """Return the files of a policy: of one, or of lifting and of placing."""
    if method == "rl":
        folder = Path(path)
        return [folder / "policy.npz" if folder.is_dir() else folder]
    parts = [Path(part) for part in path.split(",")]
    if len(parts) == 1 and (parts[0].is_dir() or parts[0].suffix != ".npz"):
        return [parts[0] / part / "policy.npz" for part in ("lift", "place")]
    if len(parts) != 2:
        raise InputError(
            f"policy: {path}: rl-decomposed has two of them: give the folder that {_TRAIN} --task decomposed wrote, or "
            "LIFT.npz,PLACE.npz"
        )
    return parts


def _controller(path: Path, task: str) -> ArmController:
    """Read a policy, and what is said of its training beside it."""
    options = _options_beside(path, task)
    try:
        policy = read_policy(path, inputs=None if options is None else size_of(options.observation), outputs=ACTIONS)
    except MissingFileError:
        raise MissingFileError(f"policy: {path}: no such file; train one with {_TRAIN} --task {task}") from None
    if options is None:
        sizes = {size_of(name): name for name in ("paper", "full")}
        if policy.inputs not in sizes:
            raise SchemaError(
                f"policy: {path} has {policy.inputs} inputs; observations have {' or '.join(map(str, sizes))} numbers: "
                f"train it with {_TRAIN}"
            )
        options = ManipulationOptions(observation=sizes[policy.inputs])
    return ArmController(policy.act, options)


def _options_beside(path: Path, task: str) -> ManipulationOptions | None:
    """Return what a policy was trained with, by the file beside it; None without one.

    Raises
    ------
    SchemaError
        If that says that it was trained for another task, or is of another policy.
    """
    about = path.with_suffix(".json")
    if not about.is_file() or not path.is_file():
        return None
    content: Any = read_json(about)
    try:
        said, digest, options = content["task"], content["sha256"], ManipulationOptions(**content["options"])
    except (KeyError, TypeError, VicoError) as error:
        raise SchemaError(f"{about}: does not say how {path.name} was trained ({error}); train it anew") from None
    if digest != sha256_of(path):
        raise SchemaError(f"{about}: is of another policy than {path.name} (sha256 differs); keep both together")
    if said != f"vico/{task}":
        raise SchemaError(f"{path}: was trained for {said}, not for vico/{task}; train it with {_TRAIN} --task {task}")
    return options


def _imitator(path: Path, *, seed: int) -> ChunkActor | LeRobotActor:
    """Read our chunk policy (a file), or one of LeRobot's (a folder)."""
    if path.is_dir():
        return LeRobotActor.read(path, seed=seed)
    policy = ChunkPolicy.read(path)
    if policy.shape.side > PICTURE:
        raise SchemaError(
            f"policy: {path} looks at pictures of {policy.shape.side} pixels; robots of the challenge see {PICTURE}"
        )
    return ChunkActor(policy, every=max(1, policy.shape.chunk // 2))


def _digest(files: list[Path]) -> str:
    return hashlib.sha256("".join(f"{path.name} {sha256_of(path)}\n" for path in files).encode()).hexdigest()
