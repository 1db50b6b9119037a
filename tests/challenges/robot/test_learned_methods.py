"""Trained policies as methods of `vico eval robot`: told what they were trained on, refused where they do not fit."""

from __future__ import annotations

import importlib.util
import pickle
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from command_line import vico
from robot_field import drawn_field
from vico.agents.robot.arm_interface import PolicyErrand, PolicyStage
from vico.agents.robot.chunk_policy import ChunkPolicy, new_network
from vico.agents.robot.grasps import ObjectPose
from vico.agents.robot.increments import ChunkShape
from vico.agents.robot.learned_arm import LearnedArm
from vico.assets.robots import robot_model
from vico.assets.shapes import box
from vico.challenges.episodes import Outcome
from vico.challenges.learning.manipulation import ArrayPolicy, make_manipulation
from vico.challenges.learning.manipulation.policies import write_policy
from vico.challenges.records import Job, load_challenge
from vico.challenges.robot import challenge
from vico.challenges.robot.arm_policies import (
    ImitatingArm,
    ReinforcedArm,
    _controller,
    policy_setting,
    policy_settings,
    read_arm_policy,
)
from vico.challenges.robot_tasks import arm_body
from vico.challenges.tables.summary import summarise
from vico.errors import InputError, MissingExtraError, MissingFileError, SchemaError
from vico.io.files import sha256_of, write_json
from vico.io.plain_data import decode, encode
from vico.seeds import rng
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation

HAS_TORCH = importlib.util.find_spec("torch") is not None
BODY = arm_body(robot_model("manipulator"))


def network(inputs: int = 42, outputs: int = 8, *, seed: int = 0, scale: float = 0.2) -> ArrayPolicy:
    draw = rng(seed, "test policy")
    sizes = [(16, inputs), (outputs, 16)]
    weights = tuple((scale * draw.normal(size=size)).astype(np.float32) for size in sizes)
    biases = tuple(np.zeros(size[0], np.float32) for size in sizes)
    return ArrayPolicy(weights, biases, np.zeros(inputs, np.float32), np.ones(inputs, np.float32))


def written(path: Path, policy: ArrayPolicy | None = None) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    write_policy(path, network() if policy is None else policy)
    return path


def felt(env: Any) -> tuple[dict[str, Any], ObjectPose, np.ndarray]:
    """What a robot in a city would feel and see in the state of an environment, and where the goal is."""
    r, state, scene = env.readings, env.copies.state[0], env.copies.scene
    stand = np.array([0.0, 0.0, scene.stand])
    positions, rates = state[1 : 1 + scene.model.nq], state[1 + scene.model.nq :]
    sensors = {
        "joint_position": positions[scene.joints],
        "joint_velocity": rates[scene.joint_rates],
        "contacts": r.pressure[0],
    }
    return {"sensors": sensors}, ObjectPose(r.thing[0] - stand, r.thing_rotation[0], r.half[0]), r.goal[0] - stand


@pytest.mark.parametrize("observation", ["full", "paper"])
def test_a_policy_does_in_a_city_what_it_does_where_it_was_trained(observation: str, tmp_path: Path) -> None:
    env = make_manipulation("place", observation=observation)
    policy = network(len(env.reset(seed=4)[0]))
    path = written(tmp_path / "policy.npz", policy)
    arm = ReinforcedArm(_controller(path, "place"), _controller(path, "place"), lifts=True, period=0.05)
    seen, _ = env.reset(seed=4)
    told, thing, goal = felt(env)
    arm.begin(PolicyErrand(7, thing, goal), np.append(env.readings.targets[0], env.readings.targets[0, 7]))
    for _ in range(15):
        told, thing, _ = felt(env)
        again = ReinforcedArm(_controller(path, "place"), _controller(path, "place"), lifts=True, period=0.05)
        again.restore(decode(encode(arm.state())))
        vector = arm.act(told, thing)
        np.testing.assert_array_equal(again.act(told, thing), vector)
        seen = env.step(policy.act(seen))[0]
        targets = env.readings.targets[0]
        np.testing.assert_allclose(vector, [*targets, targets[7], 0.0, 0.0], atol=1e-5)


def test_goals_of_picking_are_those_of_training(tmp_path: Path) -> None:
    path = written(tmp_path / "policy.npz")
    thing = ObjectPose(np.array([0.6, 0.05, -0.05]), np.eye(3), np.array([0.05, 0.1, 0.05]))
    goals = []
    for lifts in (True, False):
        arm = ReinforcedArm(_controller(path, "lift"), _controller(path, "place"), lifts=lifts, period=0.05)
        arm.begin(PolicyErrand(7, thing, None), np.zeros(9))
        goals.append(np.array(arm.state()["goal"]))
    assert goals[0] - thing.middle == pytest.approx([0.0, 0.0, 0.2])
    assert goals[1][2] == pytest.approx(thing.middle[2])
    assert 0.2 < float(np.linalg.norm(goals[1] - thing.middle)) < 0.25


@pytest.mark.parametrize("period", [0.02, 0.1])
def test_another_period_of_the_robot_makes_no_other_speed_of_the_arm(period: float, tmp_path: Path) -> None:
    policy = network(scale=0.0)
    policy.biases[-1][:] = [0.5, 0, 0, 0, 0, 0, 0, 0]
    path = written(tmp_path / "policy.npz", policy)
    arm = ReinforcedArm(_controller(path, "lift"), _controller(path, "place"), lifts=True, period=period)
    thing = ObjectPose(np.array([0.6, 0.0, -0.05]), np.eye(3), np.full(3, 0.05))
    servos = np.array([0.1, 0.3, 0.0, -1.0, 0.0, 0.8, 0.0, 0.08, 0.08])
    arm.begin(PolicyErrand(7, thing, None), servos)
    told: dict[str, Any] = {"joint_velocity": np.zeros(9), "contacts": np.zeros(2)}
    at, steps = servos, round(0.2 / period)
    for _ in range(steps):  # joints that follow at once
        at = arm.act({"sensors": {**told, "joint_position": at}}, thing)[:9]
    # Half an increment of 0.06 rad, 20 times a second.
    assert at[0] - servos[0] == pytest.approx(0.5 * 0.06 * 20 * 0.2, abs=1e-6)


class Shown:
    """Stands in for a policy that was shown how."""

    def __init__(self, gives: float = 0.01) -> None:
        self.gives, self.asked, self.instructions = gives, 0, []

    def reset(self) -> None:
        self.asked = 0

    def act(self, observation: Any, instruction: str) -> dict[str, Any]:
        self.asked += 1
        self.instructions.append(instruction)
        return {"type": "control", "vector": [self.gives * self.asked] * 9 + [0.1 * self.asked, 0.0]}


def test_who_was_shown_is_told_in_the_words_of_training_and_asked_at_its_rate() -> None:
    actor = Shown()
    arm = ImitatingArm(
        actor, thing="red toolbox", destination="Cafe", by_deck=True, stand=BODY.stand, period=0.1
    )  # fmt: skip
    thing = ObjectPose(np.array([0.6, 0.0, 0.05 - BODY.stand]), np.eye(3), np.full(3, 0.05))
    arm.begin(PolicyErrand(7, thing, None), np.zeros(9))
    vector = arm.act({}, thing)
    assert actor.asked == 2
    assert vector == pytest.approx([0.02] * 9 + [0.15, 0.0])
    assert actor.instructions[-1] == "Pick up the red toolbox and put it on the table."
    arm.begin(PolicyErrand(7, thing, thing.middle), np.zeros(9))
    assert arm.instruction == "Pick up the red toolbox and put it down next to the Cafe."
    arm.begin(PolicyErrand(7, thing, thing.middle + np.array([0.0, 0.0, 0.4])), np.zeros(9))
    assert arm.instruction == "Pick up the red toolbox and put it on the table."
    with pytest.raises(InputError, match="no run can be saved"):
        arm.state()
    actor.gives = float("nan")
    with pytest.raises(InputError, match="holds NaN or infinity"):
        arm.act({}, thing)


def test_numbers_that_are_none_are_said(tmp_path: Path) -> None:
    policy = network(scale=0.0)
    policy.weights[0][:] = 3e38  # overflows, to infinity less infinity
    policy.weights[1][:, ::2], policy.weights[1][:, 1::2] = 3e38, -3e38
    path = written(tmp_path / "policy.npz", policy)
    arm = ReinforcedArm(_controller(path, "lift"), _controller(path, "place"), lifts=True, period=0.05)
    thing = ObjectPose(np.array([0.6, 0.0, -0.05]), np.eye(3), np.full(3, 0.05))
    arm.begin(PolicyErrand(7, thing, None), np.zeros(9))
    sensors = {"joint_position": np.ones(9), "joint_velocity": np.ones(9), "contacts": np.zeros(2)}
    with np.errstate(all="ignore"), pytest.raises(InputError, match="holds NaN or infinity"):
        arm.act({"sensors": sensors}, thing)


def test_a_policy_that_does_not_fit_is_refused_before_anything_is_played(tmp_path: Path) -> None:
    good = written(tmp_path / "good" / "policy.npz")
    (tmp_path / "pickle.npz").write_bytes(pickle.dumps({"weight_0": 1}))
    odd = {
        "small": (network(7), "has 7 inputs; observations have 31 or 42"),
        "few": (network(42, 5), "has 5 outputs, not 8"),
    }
    for name, (policy, says) in odd.items():
        written(tmp_path / f"{name}.npz", policy)
        with pytest.raises(SchemaError, match=says):
            policy_setting("rl", str(tmp_path / f"{name}.npz"))
    with pytest.raises(SchemaError, match="pickled objects are refused"):
        policy_setting("rl", str(tmp_path / "pickle.npz"))
    with pytest.raises(MissingFileError, match=r"none\.npz: no such file; train one with .*--task pickplace"):
        policy_setting("rl", str(tmp_path / "none.npz"))
    with pytest.raises(MissingFileError, match=r"lift.policy\.npz: no such file"):
        policy_setting("rl-decomposed", str(tmp_path / "good"))
    with pytest.raises(InputError, match=r"rl-decomposed has two of them"):
        policy_setting("rl-decomposed", str(good))
    with pytest.raises(InputError, match=r"rl needs --policy with what scripts/train_manipulation\.py has written"):
        policy_setting("rl", "")
    with pytest.raises(InputError, match="heuristic has no policy"):
        policy_setting("heuristic", str(good))
    two = policy_setting("rl-decomposed", f"{good},{good}")
    assert two["policy_sha256"] != policy_setting("rl", str(good))["policy_sha256"]


def test_what_is_said_beside_a_policy_has_to_be_true(tmp_path: Path) -> None:
    path = written(tmp_path / "policy.npz")
    about: dict[str, Any] = {"task": "vico/pickplace", "sha256": sha256_of(path), "options": {"observation": "full"}}
    for change, says in (
        ({}, ""),
        ({"task": "vico/lift"}, "was trained for vico/lift, not for vico/pickplace"),
        ({"sha256": "0" * 64}, "is of another policy"),
        ({"options": {"observation": "smell"}}, "does not say how .* observation is 'smell'"),
        ({"options": {"observation": "paper"}}, "has 42 inputs, not 31"),
    ):
        write_json(tmp_path / "policy.json", about | change)
        if says:
            with pytest.raises(SchemaError, match=says):
                policy_setting("rl", str(tmp_path))
        else:
            policy_setting("rl", str(tmp_path))


@pytest.mark.skipif(HAS_TORCH, reason="torch is installed")
def test_what_a_policy_runs_on_is_asked_for(tmp_path: Path) -> None:
    about = b'{"schema_name": "vico.chunk_policy", "version": 1}'
    np.savez(tmp_path / "policy.npz", shape=np.frombuffer(about, np.uint8))
    with pytest.raises(MissingExtraError, match="virtual-community\\[imitation\\]"):
        policy_setting("vla", str(tmp_path / "policy.npz"))


def test_vla_takes_a_file_or_a_folder_and_nothing_else(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="no such file"):
        policy_setting("vla", str(tmp_path / "none.npz"))
    (tmp_path / "policy").mkdir()
    (tmp_path / "policy" / "pytorch_model.bin").write_bytes(b"pickle")
    with pytest.raises(SchemaError, match="never read"):
        policy_setting("vla", str(tmp_path / "policy"))


@pytest.mark.skipif(not HAS_TORCH, reason="needs pip install 'virtual-community[imitation]'")
@pytest.mark.filterwarnings("ignore")  # of torch, which the project's own warnings-are-errors is not about
def test_a_policy_of_pictures_drives_and_moves_the_arm(tmp_path: Path) -> None:
    shape = ChunkShape(side=32, chunk=4, words=8, vocabulary=16, width=32, heads=2, encoders=1, decoders=1)
    torch, _ = new_network(shape)
    torch.manual_seed(0)
    sizes = {"state_mean": (20,), "state_std": (20,), "action_mean": (4, 11), "action_std": (4, 11)}
    scales = {name: np.full(size, 0.01 * ("std" in name), np.float32) for name, size in sizes.items()}
    scales["state_std"][:] = 1.0
    np.savez(tmp_path / "policy.npz", **ChunkPolicy(shape, scales, new_network(shape)[1]).arrays())
    setting = policy_setting("vla", str(tmp_path / "policy.npz"))
    names = {"thing": SimpleNamespace(name="red toolbox"), "destination": SimpleNamespace(name="Cafe")}
    task: Any = SimpleNamespace(category="deliver", seed=0, **names)
    places = {"robot_0": (0.0, 0.0, 0.0)}
    config = SimConfig(
        robots=("manipulator",), robot_places=places, periods={"robot_0": 0.1}, observe=("robot_0",), image=64
    )
    sim = Simulation(drawn_field(), None, config)
    size = (0.12, 0.2, 0.2)
    thing = sim.scenario.add_object("p", "parcel", [box(size, (0, 0, 0.1))], (1.1, 0.3, 0.0), size=size, yaw=0.3)
    arm = LearnedArm(BODY, read_arm_policy("vla", setting, task, BODY, period=0.1), period=0.1)
    arm.pick(int(thing), np.array([1.1, 0.3, 0.0]))
    observation = sim.step({"robot_0": {"type": "wait"}}).observations["robot_0"]
    vectors: list[list[float]] = []
    while len(vectors) < 8:
        action = arm.act(observation)
        if arm.stage is PolicyStage.POLICY:
            vectors.append(action["vector"])
        observation = sim.step({"robot_0": action}).observations["robot_0"]
        assert observation["state"]["action_status"] in ("ok", "ongoing")
    assert np.isfinite(vectors).all()
    assert np.ptp(vectors, axis=0)[:9].min() > 0.0
    assert np.abs(np.array(vectors)[:, 9:]).max() > 0.0
    again = LearnedArm(BODY, read_arm_policy("vla", setting, task, BODY, period=0.1), period=0.1)
    again.restore(decode(encode(arm.state())))
    assert again.act(observation) == arm.act(observation)


def test_each_method_is_given_its_own_policy(tmp_path: Path) -> None:
    one, other = written(tmp_path / "a.npz"), written(tmp_path / "b.npz", network(31))
    alone = policy_settings(["heuristic", "rl"], [str(one)])
    assert alone == {"rl": policy_setting("rl", str(one))}
    both = policy_settings(["rl", "rl-decomposed"], [f"rl={one}", f"rl-decomposed={one},{other}"])
    assert set(both) == {"rl", "rl-decomposed"}
    for methods, given, says in (
        (["rl", "vla"], [str(one)], "say whose it is"),
        (["heuristic"], [str(one)], "none of them is asked for"),
        (["rl"], [f"vla={one}"], "not asked for; add --method"),
        (["rl"], [f"rl={one}", f"rl={other}"], "given twice"),
        (["rl"], [], "rl needs --policy"),
    ):
        with pytest.raises(InputError, match=says):
            policy_settings(methods, given)


def test_the_command_line_says_what_is_wrong_with_a_policy(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("eval", "robot", "--method", "rl", "--worlds", tmp_path, "--out", tmp_path / "out")
    assert vico(*words) == 2
    assert "rl needs --policy" in capsys.readouterr().err
    assert vico(*words, "--policy", tmp_path / "none.npz") == 2
    assert "none.npz: no such file" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def job(world: Path, method: str, **setting: Any) -> Job:
    return Job("robot", "deliver", method, {"steps": 4, "period": 0.1, **setting}, world, 3)


def test_an_episode_of_a_policy_is_the_same_again_and_compares_with_others(helsinki_path: Path, tmp_path: Path) -> None:
    challenge = load_challenge("robot")
    setting = policy_setting("rl", str(written(tmp_path / "policy.npz")))
    learned = job(helsinki_path, "rl", **setting)
    first, again = challenge.play(learned), challenge.play(learned)
    assert first.state_hash == again.state_hash
    assert first.setting["policy_sha256"] == setting["policy_sha256"]
    assert (first.fault_counts, first.parts[0].cause) == ({}, "not found")
    planned = job(helsinki_path, "heuristic")
    assert challenge.task(planned) == challenge.task(learned)
    summary = summarise(challenge, [Outcome(learned, first), Outcome(planned, challenge.play(planned))])
    assert summary.setting == {"steps": 4, "period": 0.1}
    written(tmp_path / "policy.npz", network(seed=1))
    with pytest.raises(SchemaError, match="has changed since"):
        challenge.play(learned)


def test_an_arm_that_cannot_act_any_more_ends_the_episode_with_its_cause(
    helsinki_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    setting = policy_setting("rl", str(written(tmp_path / "policy.npz")))
    made = challenge._learned_arm

    def broken(*given: Any) -> Any:
        arm = made(*given)
        arm.broken = "policy: its action holds NaN or infinity"
        return arm

    monkeypatch.setattr(challenge, "_learned_arm", broken)
    record = load_challenge("robot").play(job(helsinki_path, "rl", **setting))
    assert record.parts[0].cause == "unusable action"
    assert (record.metrics["SR"], record.metrics["Ts"], record.steps) == (0.0, 4.0, 0)
