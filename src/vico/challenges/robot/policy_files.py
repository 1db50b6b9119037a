"""Files of trained policies, as methods of `vico eval robot`: checked before anything is played, told apart by hash."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from vico.agents.robot.body import ArmBody
from vico.agents.robot.chunk_policy import ChunkActor, ChunkPolicy
from vico.agents.robot.lerobot_policy import LeRobotActor
from vico.agents.robot.skill import ArmPolicy
from vico.challenges.learning.manipulation.controller import ArmController
from vico.challenges.learning.manipulation.motors import ACTIONS
from vico.challenges.learning.manipulation.observation import size_of
from vico.challenges.learning.manipulation.options import ManipulationOptions
from vico.challenges.learning.manipulation.policy import read_policy
from vico.challenges.records import Setting
from vico.challenges.robot.arm_policies import ImitatingArm, ReinforcedArm
from vico.challenges.robot.model import RobotTask
from vico.errors import InputError, MissingFileError, SchemaError, VicoError
from vico.io.files import read_json, sha256_of

#: Methods whose arm is moved by a policy that was learned.
LEARNED = ("rl", "rl-decomposed", "vla")
#: Side of robots' pictures in the challenge, pixels.
PICTURE = 256
_TRAIN = "scripts/train_manipulation.py"


class _Given(NamedTuple):
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
        return {"policy": path, "policy_sha256": _digest(_files_of(Path(path)))}
    files = _files(method, path)
    _given(method, path)
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
        given = _given(method, path)
        return ReinforcedArm(given.pick, given.place, lifts=given.lifts, period=period)
    return ImitatingArm(
        _imitator(Path(path), seed=task.seed),
        thing=task.thing.name,
        destination=task.destination.name,
        by_deck=task.category == "deliver",
        stand=body.stand,
        period=period,
    )


def _given(method: str, path: str) -> _Given:
    files = _files(method, path)
    if method == "rl":
        controller = _controller(files[0], "pickplace")
        return _Given(controller, controller, False)
    return _Given(_controller(files[0], "lift"), _controller(files[1], "place"), True)


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


def _files_of(path: Path) -> list[Path]:
    return sorted(one for one in path.iterdir() if one.is_file()) if path.is_dir() else [path]


def _digest(files: list[Path]) -> str:
    return hashlib.sha256("".join(f"{path.name} {sha256_of(path)}\n" for path in files).encode()).hexdigest()
