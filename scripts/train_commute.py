"""Train the PPO and A2C commuters in the abstract city (extra ``rl``: stable-baselines3 on a CPU build of torch).

    python scripts/train_commute.py --method ppo --worlds W1 W2 --out OUT --curve benchmarks/results

    python scripts/train_commute.py --method ppo --worlds W1 W2 --ray --out OUT --curve OUT      # a city a machine

With --processes each city is stepped in a process of its own, with --ray on a Ray cluster (extra ``ray``); both come to
the same policy, which is another one than without, where all cities draw their episodes from one stream.

The paper's reward and learning rate (3e-4), a million steps, one seed. It writes ``ppo.npz`` (layers as arrays, to be
evaluated by numpy alone) and ``commute_ppo.csv`` (a row for 10,000 steps); it prints steps a second and the hash.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import A2C, PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv

from vico.agents.commute.learning import CommuteVectorEnv, training_city
from vico.challenges.learning.commute import ShardedCommuters, shard_makers
from vico.envs.workers import Workers
from vico.jobs.cluster import RayActors
from vico.world.folder import read_world
from vico.world.public import PublicMap

#: The paper's.
RATE, STEPS = 3e-4, 1_000_000
#: Ours: the paper names neither. Rewards are divided by SCALE for the learner alone.
GAMMA, SCALE = 0.995, 100.0


class LearnersEnv(VecEnv):
    """The environment as stable-baselines3 wants it."""

    def __init__(self, env: CommuteVectorEnv | ShardedCommuters) -> None:
        self.env = env
        self.ended: list[tuple[float, float, bool]] = []
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)

    def reset(self) -> Any:
        """Begin everywhere."""
        return self.env.reset()[0]

    def step_async(self, actions: Any) -> None:
        """Note what is to be done."""
        self._actions = actions

    def step_wait(self) -> Any:
        """Do it."""
        seen, rewards, reached, given_up, found = self.env.step(self._actions)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if found:
            for k, i in enumerate(found["ended"].tolist()):
                infos[i] = {"terminal_observation": found["final_obs"][i], "TimeLimit.truncated": bool(given_up[i])}
                self.ended.append((float(found["returns"][k]), float(found["seconds"][k]), bool(found["arrived"][k])))
        return seen, (rewards / SCALE).astype(np.float32), reached | given_up, infos

    def close(self) -> None:
        """Nothing to let go of."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of the environment, for each agent."""
        return [getattr(self.env, attr_name, None)] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refuse."""
        raise NotImplementedError

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Refuse."""
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return that it is not."""
        return [False] * self.num_envs


class Curve(BaseCallback):
    """Keeps a row for every so many steps: episodes that ended, their mean return and seconds, how many arrived."""

    def __init__(self, env: LearnersEnv, every: int) -> None:
        super().__init__()
        self._env, self._every, self._next = env, every, every
        self.rows: list[dict[str, float]] = []

    def _on_step(self) -> bool:
        if self.num_timesteps >= self._next:
            self._next += self._every
            ended, self._env.ended = self._env.ended, []
            if ended:
                returns, seconds, arrived = (np.array(column, np.float64) for column in zip(*ended, strict=True))
                self.rows.append(
                    {
                        "steps": self.num_timesteps,
                        "episodes": len(ended),
                        "return": round(float(returns.mean()), 2),
                        "seconds": round(float(seconds.mean()), 1),
                        "arrived_percent": round(100.0 * float(arrived.mean()), 1),
                    }
                )
        return True


def layers_of(policy: Any) -> dict[str, Any]:
    """Return the layers of the actor as arrays ``w0``, ``b0`` and on."""
    linear = [m for m in policy.mlp_extractor.policy_net if isinstance(m, torch.nn.Linear)] + [policy.action_net]
    arrays: dict[str, Any] = {}
    for k, layer in enumerate(linear):
        arrays[f"w{k}"] = layer.weight.detach().numpy().T.astype(np.float32)
        arrays[f"b{k}"] = layer.bias.detach().numpy().astype(np.float32)
    return arrays


def make(method: str, env: LearnersEnv, seed: int) -> Any:
    """Return the learner."""
    common: dict[str, Any] = {"learning_rate": RATE, "gamma": GAMMA, "seed": seed, "device": "cpu", "verbose": 0}
    common["policy_kwargs"] = {"net_arch": {"pi": [64, 64], "vf": [64, 64]}}
    if method == "ppo":
        return PPO("MlpPolicy", env, n_steps=128, batch_size=4096, n_epochs=10, ent_coef=0.01, **common)
    return A2C("MlpPolicy", env, n_steps=16, ent_coef=0.01, use_rms_prop=False, gae_lambda=0.95, **common)


def environment(given: argparse.Namespace) -> CommuteVectorEnv | ShardedCommuters:
    """Return the environment: in this process, or a city a process, here or on a cluster."""
    if not given.processes and given.ray is None:
        cities = [training_city(PublicMap.from_world(read_world(path))) for path in given.worlds]
        return CommuteVectorEnv(cities, num_envs=given.envs, seed=given.seed)
    makers = shard_makers(given.worlds, num_envs=given.envs, seed=given.seed)
    group = Workers(makers, what="city") if given.ray is None else RayActors(makers, address=given.ray)
    return ShardedCommuters(group, num_envs=given.envs)


def main() -> None:
    """Train, and write what came of it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--method", choices=("ppo", "a2c"), required=True)
    parser.add_argument("--worlds", type=Path, nargs="+", required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--curve", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--envs", type=int, default=128)
    parser.add_argument("--seed", type=int, default=1)
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--processes", action="store_true", help="a process a city")
    where.add_argument("--ray", nargs="?", const="auto", metavar="ADDRESS", help="a task of a Ray cluster a city")
    given = parser.parse_args()
    torch.set_num_threads(1)
    env = LearnersEnv(environment(given))
    env.reset()
    env.step_async(np.zeros(given.envs, np.int64))
    env.step_wait()  # compiles
    model = make(given.method, env, given.seed)
    curve = Curve(env, 10_000)
    began, busy = time.perf_counter(), time.process_time()
    model.learn(given.steps, callback=curve)
    wall, busy = time.perf_counter() - began, time.process_time() - busy
    given.out.mkdir(parents=True, exist_ok=True)
    path = given.out / f"{given.method}.npz"
    np.savez(path, **layers_of(model.policy))
    with (given.curve / f"commute_{given.method}.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(curve.rows[0]))
        writer.writeheader()
        writer.writerows(curve.rows)
    steps = model.num_timesteps
    sys.stdout.write(
        f"{given.method}: {steps} steps in {wall:.1f} s ({steps / wall:,.0f}/s), "
        f"{busy:.1f} CPU-s ({steps / busy:,.0f}/s)\n"
        f"{path}: sha256 {hashlib.sha256(path.read_bytes()).hexdigest()}\nlast: {curve.rows[-1]}\n"
    )


if __name__ == "__main__":
    main()
