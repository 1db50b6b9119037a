"""A learned arm in a city: random actions in `vico/RobotDeliver-v0`, then a policy as a method of the challenge.

    python examples/20_learned_arm.py --world WORLD [--policy runs/whole/policy.npz] [--method rl] [--seconds 60]

Without --policy the network has random weights. `vico eval robot` plays many such episodes and makes a table of them.
"""

from __future__ import annotations

import argparse
import tempfile
from itertools import pairwise
from pathlib import Path

import gymnasium
import numpy as np

import vico.envs  # noqa: F401  (registers the ids)
from vico.challenges.learning.manipulation import ArrayPolicy
from vico.challenges.learning.manipulation.observation import input_scaling
from vico.challenges.learning.manipulation.policies import write_policy
from vico.challenges.records import Job, load_challenge
from vico.challenges.robot.arm_policies import policy_setting
from vico.seeds import rng


def untrained(path: Path, *, seed: int) -> Path:
    """Write a network of random weights, of the shape that training gives it."""
    mean, deviation = input_scaling("full")
    draw, sizes = rng(seed, "untrained"), (len(mean), 64, 8)
    weights = tuple((draw.normal(size=(b, a)) / np.sqrt(a)).astype(np.float32) for a, b in pairwise(sizes))
    write_policy(path, ArrayPolicy(weights, tuple(np.zeros(b, np.float32) for b in sizes[1:]), mean, deviation))
    return path


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--world", type=Path, required=True)
    parser.add_argument("--policy", default="")
    parser.add_argument("--method", choices=["rl", "rl-decomposed", "vla"], default="rl")
    parser.add_argument("--category", choices=["deliver", "carry"], default="deliver")
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()

    # The challenge's task for a learner that moves every joint itself:
    env = gymnasium.make(f"vico/Robot{given.category.title()}-v0", world=given.world, seconds=2, period=0.1, image=64)
    seen, info = env.reset(seed=given.seed)
    print(info["instructions"]["text"])
    print(f"observations: {', '.join(seen)}; actions {env.action_space.shape}")
    env.action_space.seed(given.seed)
    total, over = 0.0, False
    while not over:
        _, reward, ended, cut, info = env.step(env.action_space.sample())
        total, over = total + float(reward), ended or cut
    print(f"random actions: reward {total:.2f} in 2 s")
    env.close()

    # The same task with a planner that drives, and a policy that moves the arm:
    with tempfile.TemporaryDirectory() as folder:
        policy = given.policy or str(untrained(Path(folder) / "policy.npz", seed=given.seed))
        setting = {"steps": given.seconds, "period": 0.1, **policy_setting(given.method, policy)}
        job = Job("robot", given.category, given.method, setting, given.world, given.seed)
        record = load_challenge("robot").play(job)
    print(f"{given.method}: SR {record.metrics['SR']:g}, {record.parts[0].cause or 'done'}, {record.steps} s")


if __name__ == "__main__":
    main()
