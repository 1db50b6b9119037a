"""Train a policy with Stable-Baselines3 to walk to a point among the streets, without pictures; prints how it learns.

    python examples/14_train_with_sb3.py --world out/demo/world --steps 40000 --curve out/curve.csv

Needs ``pip install "virtual-community[rl]"``. After some 25,000 steps nine of ten points are reached.
"""

from __future__ import annotations

import argparse
from collections import deque
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.monitor import Monitor

import vico.envs  # noqa: F401  (registers the ids)


class Curve(BaseCallback):
    """Notes how the last hundred episodes went, every so many steps."""

    def __init__(self, every: int) -> None:
        super().__init__()
        self.every = every
        self.last: deque[tuple[bool, float]] = deque(maxlen=100)
        self.rows: list[tuple[int, float, float]] = []

    def _on_step(self) -> bool:
        for info in self.locals["infos"]:
            if "episode" in info:
                self.last.append((bool(info["is_success"]), float(info["episode"]["r"])))
        if self.num_timesteps % self.every == 0 and self.last:
            success, reward = (float(np.mean(values)) for values in zip(*self.last, strict=True))
            self.rows.append((self.num_timesteps, success, reward))
            print(f"{self.num_timesteps:7d} steps: success {success:.2f}, reward {reward:.2f}", flush=True)
        return True


def success_of(policy: Any, env: gymnasium.Env[Any, Any], *, episodes: int, seed: int) -> float:
    """Return the share of episodes in which a policy (None: random actions) gets there."""
    env.action_space.seed(seed)
    found = []
    for k in range(episodes):
        observation, _ = env.reset(seed=seed + k)
        over = False
        while not over:
            action = env.action_space.sample() if policy is None else policy.predict(observation)[0]
            observation, _, ended, cut, info = env.step(action)
            over = ended or cut
        found.append(info["is_success"])
    return float(np.mean(found))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--world", required=True)
    parser.add_argument("--steps", type=int, default=40_000)
    parser.add_argument("--episodes", type=int, default=50, help="episodes that are tested on")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--curve", type=Path, help="file for the learning curve, CSV")
    given = parser.parse_args()

    env = Monitor(gymnasium.make("vico/PointGoal-v0", world=given.world), info_keywords=("is_success",))
    # Deciding second by second over tens of metres: a long horizon, many steps a batch, some noise to begin with.
    model = PPO(
        "MultiInputPolicy", env, n_steps=1024, batch_size=256, n_epochs=5, gamma=0.98, ent_coef=0.01,
        learning_rate=5e-4, policy_kwargs={"net_arch": [64, 64]}, seed=given.seed, device="cpu",
    )  # fmt: skip
    # Episodes that nobody was trained on: training draws its own, far from these numbers.
    test = 10**6
    print(f"random actions: success {success_of(None, env, episodes=given.episodes, seed=test):.2f}")
    curve = Curve(every=1024)
    model.learn(given.steps, callback=curve)
    print(f"trained: success {success_of(model, env, episodes=given.episodes, seed=test):.2f}")
    if given.curve is not None:
        given.curve.parent.mkdir(parents=True, exist_ok=True)
        lines = ["steps,success,reward", *(f"{n},{s:.4f},{r:.4f}" for n, s, r in curve.rows)]
        given.curve.write_text("\n".join(lines) + "\n")
    env.close()


if __name__ == "__main__":
    main()
