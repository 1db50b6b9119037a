"""Train H1's steps: proximal policy optimisation (Schulman et al., 2017) on MuJoCo, with numpy alone.

    OPENBLAS_NUM_THREADS=1 python scripts/train_h1.py --out runs/h1 --minutes 60 [--threads 1] [--seed 1]

The network corrects the plain steps of `vico.sim.robots.biped` and sees what it will see there; kernels are shared.
Robots train on a field of level ground, slopes, kerbs as the ground of a world has them, and bumps; they are pushed,
and friction and the length of physics' steps vary. Writes `policy.npz` and `curve.csv` after every 20 iterations.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
import time
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from h1_field import PERIOD, TERMS, Field
from numpy.typing import NDArray

from vico.sim.robots.biped import LEGS, OBSERVED

GAMMA, LAMBDA, CLIP, STEPS = 0.985, 0.95, 0.2, 48


class Network:
    """Dense layers with ELU between them, and their gradients."""

    def __init__(self, sizes: tuple[int, ...], rng: np.random.Generator, last: float) -> None:
        self.parameters: list[NDArray[np.float32]] = []
        for index, (a, b) in enumerate(pairwise(sizes)):
            gain = last if index == len(sizes) - 2 else 1.0
            w = np.linalg.qr(rng.normal(size=(max(a, b), min(a, b))))[0]
            w = w if w.shape == (a, b) else w.T
            self.parameters += [(gain * w).astype(np.float32), np.zeros(b, np.float32)]

    def __call__(self, x: NDArray[np.float32], kept: list[NDArray[np.float32]] | None = None) -> NDArray[np.float32]:
        """Return what the network says of each row, and keep the layers' inputs."""
        count = len(self.parameters) // 2
        for layer in range(count):
            if kept is not None:
                kept.append(x)
            x = x @ self.parameters[2 * layer] + self.parameters[2 * layer + 1]
            if layer < count - 1:
                x = np.where(x > 0, x, np.expm1(np.minimum(x, 0)))
        return x

    def gradients(self, kept: list[NDArray[np.float32]], slope: NDArray[np.float32]) -> list[NDArray[np.float32]]:
        """Return the gradients of the parameters, given those of the answers."""
        found: list[NDArray[np.float32]] = []
        for layer in reversed(range(len(self.parameters) // 2)):
            x = kept[layer]
            found = [x.T @ slope, slope.sum(axis=0), *found]
            if layer:
                slope = (slope @ self.parameters[2 * layer].T) * np.where(x > 0, np.float32(1), x + 1)
        return found


class Adam:
    """Kingma and Ba, 2015, with the gradients' norm bounded."""

    def __init__(self, parameters: list[NDArray[np.float32]]) -> None:
        self.parameters, self.count = parameters, 0
        self.mean = [np.zeros_like(p) for p in parameters]
        self.square = [np.zeros_like(p) for p in parameters]

    def step(self, gradients: list[NDArray[np.float32]], rate: float) -> None:
        """Move the parameters against their gradients."""
        self.count += 1
        norm = math.sqrt(sum(float((g * g).sum()) for g in gradients))
        scale = min(1.0, 1.0 / (norm + 1e-8))
        a, b = 1 - 0.9**self.count, 1 - 0.999**self.count
        for p, g, m, s in zip(self.parameters, gradients, self.mean, self.square, strict=True):
            m += 0.1 * (g * scale - m)
            s += 0.001 * ((g * scale) ** 2 - s)
            p -= np.float32(rate) * (m / a) / (np.sqrt(s / b) + 1e-5)


class Batch(NamedTuple):
    """What a few periods of all robots gave."""

    seen: NDArray[np.float32]
    actions: NDArray[np.float32]
    logp: NDArray[np.float32]
    advantage: NDArray[np.float32]
    returns: NDArray[np.float32]
    mean: NDArray[np.float32]


class Learner:
    """Actor, critic and their optimiser."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.actor = Network((OBSERVED, 128, 96, LEGS), rng, 0.01)
        self.critic = Network((OBSERVED, 128, 96, 1), rng, 1.0)
        self.spread = np.full(LEGS, -0.5, np.float32)
        self.adam = Adam([*self.actor.parameters, self.spread])
        self.critic_adam = Adam(self.critic.parameters)
        self.rate = 5e-4

    def act(self, seen: NDArray[np.float32]) -> tuple[NDArray[np.float32], ...]:
        """Return actions with noise, how likely they are, and those without."""
        mean = self.actor(seen)
        noise = self.rng.standard_normal(mean.shape).astype(np.float32)
        logp = (-0.5 * noise**2 - self.spread).sum(axis=1)
        return mean + noise * np.exp(self.spread), logp, mean

    def update(self, b: Batch, entropy: float) -> float:
        """Learn from what happened; return how far the policy went."""
        n, kls = len(b.seen), []
        for _ in range(4):
            order = self.rng.permutation(n)
            for part in np.array_split(order, 4):
                kls.append(self._minibatch(b, part, entropy))
            kl = float(np.mean(kls[-4:]))
            if kl > 0.03:
                break
        kl = float(np.mean(kls))
        if kl > 0.018:
            self.rate = max(self.rate / 1.4, 4e-5)
        elif kl < 0.010:
            self.rate = min(self.rate * 1.3, 1.5e-3)
        return kl

    def _minibatch(self, b: Batch, part: NDArray[np.int64], entropy: float) -> float:
        seen, actions, advantage = b.seen[part], b.actions[part], b.advantage[part]
        kept: list[NDArray[np.float32]] = []
        mean = self.actor(seen, kept)
        size = np.exp(self.spread)
        z = (actions - mean) / size
        logp = (-0.5 * z**2 - self.spread).sum(axis=1)
        ratio = np.exp(np.clip(logp - b.logp[part], -10, 10))
        inside = np.where(advantage > 0, ratio < 1 + CLIP, ratio > 1 - CLIP)
        slope = (-advantage * ratio * inside / len(part)).astype(np.float32)[:, None]
        gradients = self.actor.gradients(kept, (slope * z / size).astype(np.float32))
        gradients.append(((slope * (z**2 - 1)).sum(axis=0) - np.float32(entropy)).astype(np.float32))
        self.adam.step(gradients, self.rate)
        np.clip(self.spread, -2.3, 0.0, out=self.spread)
        kept = []
        value = self.critic(seen, kept)[:, 0]
        error = ((value - b.returns[part]) / len(part)).astype(np.float32)[:, None]
        self.critic_adam.step(self.critic.gradients(kept, error), self.rate)
        return float(np.mean((ratio - 1) - np.log(np.maximum(ratio, 1e-6))))


def collect(field: Field, learner: Learner, seen: NDArray[np.float32]) -> tuple[Batch, NDArray[np.float32], Any]:
    """Let all robots act for `STEPS` periods."""
    n = field.count
    kept: dict[str, list[Any]] = {name: [] for name in ("seen", "actions", "logp", "mean", "reward", "value", "done")}
    terms = np.zeros(len(TERMS))
    falls = 0
    for _ in range(STEPS):
        actions, logp, mean = learner.act(seen)
        value = learner.critic(seen)[:, 0]
        reward = 0.1 * field.step(actions)
        reward = np.where(field.done == 2, reward + GAMMA * value, reward)
        terms += field.terms.mean(axis=0) / STEPS
        falls += int((field.done == 1).sum())
        for name, one in zip(kept, (seen, actions, logp, mean, reward, value, field.done > 0), strict=True):
            kept[name].append(np.array(one))
        field.go_on()
        seen = field.look()
    value = learner.critic(seen)[:, 0]
    advantage, later = np.zeros((STEPS, n)), np.zeros(n)
    for t in reversed(range(STEPS)):
        following = value if t == STEPS - 1 else kept["value"][t + 1]
        goes_on = 1.0 - kept["done"][t]
        delta = kept["reward"][t] + GAMMA * following * goes_on - kept["value"][t]
        later = delta + GAMMA * LAMBDA * goes_on * later
        advantage[t] = later
    returns = advantage + np.array(kept["value"])
    normal = (advantage - advantage.mean()) / (advantage.std() + 1e-6)
    flat = {name: np.concatenate(kept[name]).astype(np.float32) for name in ("seen", "actions", "logp", "mean")}
    batch = Batch(
        flat["seen"], flat["actions"], flat["logp"], normal.ravel().astype(np.float32),
        returns.ravel().astype(np.float32), flat["mean"],
    )  # fmt: skip
    return batch, seen, (terms, falls)


def save(path: Path, learner: Learner) -> None:
    """Write actor, critic and spread."""
    arrays = {f"actor_{k}": p for k, p in enumerate(learner.actor.parameters)}
    arrays |= {f"critic_{k}": p for k, p in enumerate(learner.critic.parameters)}
    np.savez(path, spread=learner.spread, **arrays)


def load(path: Path, learner: Learner) -> None:
    """Go on from what `save` wrote."""
    with np.load(path) as arrays:
        for name, network in (("actor", learner.actor), ("critic", learner.critic)):
            for k, p in enumerate(network.parameters):
                p[...] = arrays[f"{name}_{k}"]
        learner.spread[...] = arrays["spread"]


def main() -> None:
    """Train."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--iterations", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--robots", type=int, default=192)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--level-until", type=int, default=170, help="iterations on level ground first")
    parser.add_argument("--start", type=Path)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(options.seed)
    learner = Learner(rng)
    if options.start:
        load(options.start, learner)
    began = time.monotonic()
    field = Field(options.robots, rng, 0.0, options.threads)
    seen = field.look()
    with (options.out / "curve.csv").open("w", newline="") as file:
        curve = csv.writer(file)
        curve.writerow(["iteration", "samples", "minutes", "falls_per_robot_minute", "reward", "spread", "kl", *TERMS])
        for iteration in range(options.iterations):
            if iteration == options.level_until:
                field = Field(options.robots, rng, 1.0, options.threads)
                seen = field.look()
            field.strength = 0.4 + 0.4 * min(1.0, iteration / 500)
            batch, seen, (terms, falls) = collect(field, learner, seen)
            kl = learner.update(batch, 0.002)
            minutes = (time.monotonic() - began) / 60
            if iteration % 10 == 0:
                rate = falls / (options.robots * STEPS * PERIOD / 60)
                row = [iteration, iteration * options.robots * STEPS, minutes, rate, terms.sum()]
                row += [float(np.exp(learner.spread).mean()), kl, *terms]
                curve.writerow([round(float(v), 4) for v in row])
                file.flush()
                sys.stdout.write(" ".join(f"{v:.3g}" for v in row) + "\n")
                sys.stdout.flush()
            if iteration % 20 == 19:
                save(options.out / "policy.npz", learner)
            if minutes > options.minutes:
                break
    save(options.out / "policy.npz", learner)


if __name__ == "__main__":
    main()
