"""An arm and a box: score random actions, the scripted expert, and a policy of your own on a manipulation task.

    python examples/18_manipulation.py --task lift --episodes 20 [--policy runs/lift/policy.npz]
    python examples/18_manipulation.py --task pick_place --policy runs/both/lift/policy.npz runs/both/place/policy.npz

Policies are what scripts/train_manipulation.py writes; two of them lift and place one after the other.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import gymnasium
import numpy as np

import vico.envs  # noqa: F401  (registers the ids)
from vico.challenges.learning.manipulation import MANIPULATION, make_manipulation, make_manipulation_vec, read_policy
from vico.challenges.learning.manipulation.environment import Policy, score
from vico.challenges.learning.manipulation.policies import DecomposedPolicy, ScriptedExpert

IDS = {"reach": "vico/Reach-v0", "lift": "vico/Lift-v0", "place": "vico/Place-v0", "pick_place": "vico/PickPlace-v0"}


def expert_success(task: str, episodes: int, seed: int) -> float:
    """Return the share of episodes that the scripted expert solves, one environment after the other."""
    env, found = make_manipulation(task), []
    for k in range(episodes):
        env.reset(seed=seed + k)
        expert, over = ScriptedExpert(env), False
        while not over:
            _, _, ended, cut, info = env.step(expert.act())
            over = ended or cut
        found.append(info["is_success"])
    return float(np.mean(found))


def policy_of(paths: list[Path], inputs: int) -> Policy:
    """Return a policy, or one that lifts by the first and places by the second."""
    read = [read_policy(path, inputs=inputs, outputs=8) for path in paths]
    return read[0].act if len(read) == 1 else DecomposedPolicy(*read).act


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--task", choices=sorted(MANIPULATION), default="lift")
    parser.add_argument("--episodes", type=int, default=20)
    parser.add_argument("--seed", type=int, default=10**6)
    parser.add_argument("--policy", type=Path, nargs="*", default=[])
    parser.add_argument("--reward", choices=["staged", "paper"], default="staged")
    parser.add_argument("--observation", choices=["full", "paper"], default="full")
    given = parser.parse_args()

    # One environment is Gymnasium's:
    env = gymnasium.make(IDS[given.task], reward=given.reward, observation=given.observation)
    seen, _ = env.reset(seed=0)
    print(f"{IDS[given.task]}: observations {seen.shape}, actions {env.action_space.shape}")

    # Many are stepped together:
    batch = make_manipulation_vec(
        given.task, num_envs=given.episodes, reward=given.reward, observation=given.observation
    )
    batch.action_space.seed(given.seed)
    print("random:", score(batch, lambda _: batch.action_space.sample(), seed=given.seed))
    print(f"expert: success {expert_success(given.task, given.episodes, given.seed):.2f} at the end")
    if given.policy:
        print("policy:", score(batch, policy_of(given.policy, seen.shape[0]), seed=given.seed))


if __name__ == "__main__":
    main()
