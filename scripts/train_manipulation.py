"""Train an arm to reach, lift, place, or pick and place, by PPO of rsl-rl (the extra `rsl`), on a CPU.

    python scripts/train_manipulation.py --task lift --reward staged --out runs/lift [--envs 1024] [--iterations 500]

Network and settings are those of the paper's table "RL training configuration for the community robot task". Writes
into --out: curve.csv, policy.npz (plain arrays), policy.json (what was trained, SHA-256) and checkpoint.pt, from which
the same command goes on after it was killed, with the same result. `--task decomposed` trains lift and place apart.
"""

from __future__ import annotations

import argparse
import csv
import io
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from vico.challenges.learning.manipulation import ArrayPolicy, ManipulationBatch, make_manipulation_vec
from vico.challenges.learning.manipulation.observation import input_scaling
from vico.challenges.learning.manipulation.policies import write_policy
from vico.errors import InputError, MissingExtraError, VicoError
from vico.io.files import new_file, read_json, sha256_of, write_bytes, write_json
from vico.seeds import rng
from vico.version import __version__

try:
    import torch
    from rsl_rl.env import VecEnv
    from rsl_rl.runners import OnPolicyRunner
    from tensordict import TensorDict
except ImportError as error:
    raise SystemExit(str(MissingExtraError(f'{error}; type: pip install "virtual-community[rsl]"'))) from None

TASKS = {"reach": "reach", "lift": "lift", "place": "place", "pickplace": "pick_place"}
STEPS = 24
#: Staged rewards of an episode sum up to hundreds, the paper's penalties to a few.
SCALE = {"staged": 0.1, "paper": 1.0}
LAYER = {
    "class_name": "rsl_rl.models.MLPModel",
    "hidden_dims": [256, 256, 128],
    "activation": "elu",
}


def settings() -> dict[str, Any]:
    """Return what rsl-rl is told: the paper's table; what it leaves open is rsl-rl's own default or said here."""
    return {
        "num_steps_per_env": STEPS,
        "save_interval": 1_000_000,
        "obs_groups": {"actor": ["policy"], "critic": ["policy"]},
        "actor": {
            **LAYER,
            "distribution_cfg": {
                "class_name": "rsl_rl.modules.distribution.GaussianDistribution",
                "init_std": 0.6,
                "std_type": "log",
            },
        },
        "critic": dict(LAYER),
        "algorithm": {
            "class_name": "rsl_rl.algorithms.PPO",
            "clip_param": 0.2,
            "entropy_coef": 0.001,
            "value_loss_coef": 1.0,
            "gamma": 0.99,
            "lam": 0.95,
            "learning_rate": 3e-4,
            "schedule": "adaptive",
            "desired_kl": 0.01,
            "num_learning_epochs": 5,
            "num_mini_batches": 4,
            "max_grad_norm": 1.0,
        },
    }


class Arms(VecEnv):
    """A batch of environments as rsl-rl asks for it; counts what episodes come to."""

    def __init__(self, batch: ManipulationBatch, scale: float, seed: int) -> None:
        self.batch, self.scale = batch, scale
        self.num_envs, self.num_actions = batch.num_envs, int(batch.single_action_space.shape[0])
        self.max_episode_length = batch.options.max_steps
        self.device, self.cfg = "cpu", {}
        self.mean, self.deviation = input_scaling(batch.options.observation)
        self.seen, _ = batch.reset(seed=seed)
        # Episodes that all end at once would make batches of nothing but beginnings, and of nothing but ends.
        batch.copies.steps[:] = rng(seed, "first episodes").integers(batch.options.max_steps, size=batch.num_envs)
        self.forget()

    def forget(self) -> None:
        """Count anew."""
        self.rewards, self.holds, self.ends = [], {}, []

    @property
    def episode_length_buf(self) -> torch.Tensor:
        """Steps of each episode so far."""
        return torch.from_numpy(self.batch.copies.steps.copy())

    def get_observations(self) -> TensorDict:
        """Return what is seen now."""
        seen = (self.seen - self.mean) / self.deviation
        return TensorDict({"policy": torch.from_numpy(seen)}, batch_size=[self.num_envs])

    def step(self, actions: torch.Tensor) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict[str, Any]]:
        """Act in all environments."""
        self.seen, reward, ended, cut, info = self.batch.step(actions.numpy())
        self.rewards.append(float(reward.mean()))
        for name, value in info.items():
            if value.dtype == bool and not name.startswith("_"):
                self.holds.setdefault(name, []).append(float(value.mean()))
        over = ended | cut
        self.ends += info["is_success"][over].tolist()
        rewards = torch.from_numpy((self.scale * reward).astype(np.float32))
        return self.get_observations(), rewards, torch.from_numpy(over), {"time_outs": torch.from_numpy(cut)}


class Training:
    """One task's training in a folder."""

    def __init__(self, given: argparse.Namespace, task: str, out: Path) -> None:
        self.given, self.task, self.out = given, task, out
        out.mkdir(parents=True, exist_ok=True)
        torch.manual_seed(given.seed)
        options = {"reward": given.reward, "observation": given.observation, "base": given.base}
        options |= {"surface": given.surface, "oracle_grasp": given.oracle_grasp}
        batch = make_manipulation_vec(TASKS[task], num_envs=given.envs, threads=given.threads, **options)
        self.env = Arms(batch, SCALE[given.reward], given.seed)
        self.runner = OnPolicyRunner(self.env, settings(), None, "cpu")
        self.about = {
            "task": f"vico/{task}", "options": options, "envs": given.envs, "seed": given.seed,
            "steps_per_iteration": STEPS, "producer": f"virtual-community {__version__}",
        }  # fmt: skip
        self.done, self.seconds, self.rows = 0, 0.0, []
        if (out / "checkpoint.pt").exists():
            self.go_on()

    def go_on(self) -> None:
        """Go on from where a killed training was."""
        kept = torch.load(self.out / "checkpoint.pt", weights_only=True)
        if kept["about"] != self.about:
            raise InputError(f"train: {self.out} holds another training ({kept['about']}); choose another --out")
        self.done, self.seconds, self.rows = kept["done"], kept["seconds"], kept["rows"]
        self.runner.alg.load(kept["algorithm"], None, True)
        self.env.seen = self.env.batch.restore_state({name: value.numpy() for name, value in kept["env"].items()})
        torch.set_rng_state(kept["random"])

    def run(self) -> None:
        """Train until as many iterations are done as were asked for."""
        while self.done < self.given.iterations:
            began = time.perf_counter()
            self.env.forget()
            losses = self.iterate()
            self.done += 1
            self.seconds += time.perf_counter() - began
            self.note(losses)
            if self.done % self.given.save_every == 0 or self.done == self.given.iterations:
                self.save()

    def iterate(self) -> dict[str, float]:
        """Collect a batch and learn from it, as `OnPolicyRunner.learn` does."""
        algorithm = self.runner.alg
        algorithm.train_mode()
        seen = self.env.get_observations()
        with torch.inference_mode():
            for _ in range(STEPS):
                seen, rewards, over, extras = self.env.step(algorithm.act(seen))
                algorithm.process_env_step(seen, rewards, over, extras)
            algorithm.compute_returns(seen)
        return algorithm.update()

    def note(self, losses: dict[str, float]) -> None:
        """Add a row to the curve."""
        env, algorithm = self.env, self.runner.alg
        row = {
            "iteration": self.done,
            "steps": self.done * STEPS * env.num_envs,
            "seconds": round(self.seconds, 2),
            "reward": float(np.mean(env.rewards)),
            "success_at_end": float(np.mean(env.ends)) if env.ends else float("nan"),
            **{name: float(np.mean(values)) for name, values in env.holds.items()},
            "spread": float(algorithm.get_policy().distribution.log_std_param.detach().exp().mean()),
            "learning_rate": algorithm.learning_rate,
            **{f"loss_{name}": float(value) for name, value in losses.items()},
        }
        self.rows.append({name: round(value, 6) for name, value in row.items()})
        if self.done % self.given.tell_every == 0:
            words = " ".join(f"{name} {value:.4g}" for name, value in row.items() if not name.startswith("loss"))
            sys.stderr.write(f"{self.task}: {words}\n")

    def save(self) -> None:
        """Write curve, weights, what they are, and the checkpoint, in this order."""
        text = io.StringIO()
        table = csv.DictWriter(text, list(self.rows[0]), lineterminator="\n")
        table.writeheader()
        table.writerows(self.rows)
        write_bytes(self.out / "curve.csv", text.getvalue().encode())
        write_policy(self.out / "policy.npz", policy_of(self.runner.alg.get_policy(), self.env))
        digest = sha256_of(self.out / "policy.npz")
        write_json(self.out / "policy.json", {**self.about, "iterations": self.done, "sha256": digest})
        env = {name: torch.from_numpy(value) for name, value in self.env.batch.save_state().items()}
        kept = {
            "about": self.about, "done": self.done, "seconds": self.seconds, "rows": self.rows,
            "algorithm": self.runner.alg.save(), "env": env, "random": torch.get_rng_state(),
        }  # fmt: skip
        with new_file(self.out / "checkpoint.pt") as temporary:
            torch.save(kept, temporary)


def policy_of(model: Any, env: Arms) -> ArrayPolicy:
    """Return a trained actor as plain arrays."""
    layers = [layer for layer in model.mlp.modules() if isinstance(layer, torch.nn.Linear)]

    def array(tensor: torch.Tensor) -> Any:
        return tensor.detach().numpy().astype(np.float32)

    return ArrayPolicy(
        tuple(array(layer.weight) for layer in layers),
        tuple(array(layer.bias) for layer in layers),
        env.mean,
        env.deviation,
    )


def main() -> int:
    """Train."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--task", choices=[*TASKS, "decomposed"], default="lift")
    parser.add_argument("--reward", choices=list(SCALE), default="staged")
    parser.add_argument("--observation", choices=["full", "paper"], default="full")
    parser.add_argument("--surface", choices=["any", "ground", "table"], default="any")
    parser.add_argument("--base", choices=["fixed", "wheels"], default="fixed")
    parser.add_argument("--oracle-grasp", action="store_true")
    parser.add_argument("--envs", type=int, default=1024)
    parser.add_argument("--iterations", type=int, default=500)
    parser.add_argument("--threads", type=int, default=1, help="of physics, and of torch")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--save-every", type=int, default=10, help="iterations between two checkpoints")
    parser.add_argument("--tell-every", type=int, default=5, help="iterations between two lines on stderr")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    torch.set_num_threads(given.threads)
    parts = ("lift", "place") if given.task == "decomposed" else (given.task,)
    try:
        for part in parts:
            out = given.out / part if given.task == "decomposed" else given.out
            training = Training(given, part, out)
            training.run()
            about = read_json(out / "policy.json")
            sys.stdout.write(f"{out / 'policy.npz'}: {about['iterations']} iterations, sha256 {about['sha256']}\n")
    except VicoError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
