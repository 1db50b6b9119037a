"""Train an action-chunk policy on pick-and-place demonstrations (extra ``imitation``: a CPU build of torch).

    vico dataset build --challenge pick_place --episodes 1500 --successes --drop-below 0.01 --clip 0.01 --size 224 \\
        --to lerobot --validation 0.05 --out demos
    python scripts/train_chunk_policy.py demos --out policy [--side 96] [--steps 50000] [--minutes 300] [--seed 0]

Behaviour cloning with batches of 32, as in the paper; the loss is the mean absolute error of scaled actions. Episodes
of the dataset's split ``validation`` are kept apart; without such a split every tenth episode is. Training stops at
``--steps``, after ``--minutes``, or when the validation loss has not fallen for ``--patience`` looks at it. What was
stopped goes on from the last look by the same command, to the same weights as if it had not been. Writes ``policy.npz``
(the weights with the lowest validation loss) with ``policy.npz.sha256`` and ``policy.json`` beside, and ``curve.csv``.
"""

from __future__ import annotations

import argparse
import csv
import io
import math
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from vico.agents.robot.chunk_policy import SCALES, ChunkPolicy, new_network, relative_chunk, shrunk
from vico.agents.robot.chunk_policy import word_numbers as numbers_of
from vico.agents.robot.chunk_shape import ChunkShape
from vico.datasets.folder import Dataset
from vico.datasets.increments import SPACE
from vico.errors import InputError, VicoError
from vico.io.files import read_json, sha256_of, write_bytes, write_json
from vico.io.npz import read_npz
from vico.seeds import rng
from vico.version import __version__

BATCH, RATE, WARM, DECAY = 32, 3e-4, 200, 1e-4
#: Pixels that pictures are shifted by at most, and share by which they get lighter or darker.
SHIFT, LIGHT = 4, 0.15
#: Frames that the validation loss is measured on, and that scales are taken from, at most.
LOOKED_AT, SCALED_BY = 512, 20_000
COLUMNS = ("step", "train_loss", "validation_loss", "rate", "cpu_seconds")


@dataclass
class Frames:
    """All frames of a dataset: pictures, states, actions, and the instruction's words; where episodes begin."""

    pictures: NDArray[np.uint8]
    states: NDArray[np.float32]
    actions: NDArray[np.float32]
    words: NDArray[np.int64]
    ends: NDArray[np.int64]
    train: NDArray[np.int64]
    validation: NDArray[np.int64]

    def chunks(self, frames: NDArray[np.int64], size: int) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        """Return what is to be predicted at some frames, and which of it is within the episode."""
        targets = np.zeros((len(frames), size, self.actions.shape[1]), np.float32)
        there = np.zeros((len(frames), size), np.bool_)
        for k, frame in enumerate(frames.tolist()):
            end = min(frame + size, int(self.ends[frame]))
            targets[k, : end - frame] = relative_chunk(self.states[frame:end], self.actions[frame:end])
            there[k, : end - frame] = True
        return targets, there


def read_frames(dataset: Dataset, shape: ChunkShape, cache: Path) -> Frames:
    """Read a dataset; its pictures are kept, small, in a file of their own beside the policy."""
    about = dataset.about
    if about.action.get("space") != SPACE or "rgb" not in about.outputs:
        raise InputError(f"{dataset.path}: no pick-and-place demonstrations with pictures; see docs/imitation.md")
    if about.size < shape.side:
        raise InputError(f"{dataset.path}: pictures of {about.size} pixels; give --side {about.size} or less")
    n = about.frames
    mark, wanted = cache / f"pictures_{shape.side}.json", {"dataset": sha256_of(dataset.path / "dataset.json")}
    path = cache / f"pictures_{shape.side}.npy"
    whole = mark.exists() and read_json(mark) == wanted
    size = (n, shape.side, shape.side, 3)
    pictures = np.lib.format.open_memmap(path, "r" if whole else "w+", np.uint8, None if whole else size)
    states, actions = np.zeros((n, shape.state), np.float32), np.zeros((n, shape.action), np.float32)
    words, ends = np.zeros((n, shape.words), np.int64), np.zeros(n, np.int64)
    owner, before = np.zeros(n, np.int64), 0
    for row in dataset.episodes():
        told, first = numbers_of(row["instructions"][0], shape), before
        for frame in dataset.frames(row["episode_index"]):
            states[before], actions[before] = frame["observation.state"], frame["action"]
            if not whole:
                pictures[before] = shrunk(frame["pictures"]["rgb"], shape.side)
            before += 1
        words[first:before], ends[first:before], owner[first:before] = told, before, row["episode_index"]
    if not whole:
        pictures.flush()
        write_json(mark, wanted)
    split = about.splits.get("validation")
    held = (owner >= split[0]) & (owner < split[1]) if split else owner % 10 == 9
    test = about.splits.get("test", (0, 0))
    used = ~((owner >= test[0]) & (owner < test[1]))
    train, validation = np.flatnonzero(used & ~held), np.flatnonzero(used & held)
    if not len(train) or not len(validation):
        raise InputError(f"{dataset.path}: too few episodes to keep some apart; give --validation 0.1 when building it")
    return Frames(np.asarray(pictures), states, actions, words, ends, train, validation)


def scales_of(frames: Frames, shape: ChunkShape, seed: int) -> dict[str, NDArray[np.float32]]:
    """Return mean and spread of states and of actions over frames that are trained on."""
    some = frames.train
    if len(some) > SCALED_BY:
        some = np.sort(rng(seed, "chunk policy", "scales").choice(some, SCALED_BY, replace=False))
    targets, there = frames.chunks(some, shape.chunk)
    count = np.maximum(there.sum(axis=0), 1)[:, None]
    mean = (targets * there[..., None]).sum(axis=0) / count
    spread = np.sqrt((((targets - mean) * there[..., None]) ** 2).sum(axis=0) / count)
    states = frames.states[some]
    found = (states.mean(axis=0), np.maximum(states.std(axis=0), 1e-3), mean, np.maximum(spread, 2e-3))
    return {name: np.asarray(value, np.float32) for name, value in zip(SCALES, found, strict=True)}


class Trainer:
    """A network while it is trained; everything that decides what comes next can be saved."""

    def __init__(self, frames: Frames, shape: ChunkShape, *, seed: int, steps: int) -> None:
        torch.manual_seed(seed)
        _, network = new_network(shape)
        self.frames, self.shape, self.seed, self.steps = frames, shape, seed, steps
        self.policy = ChunkPolicy(shape, scales_of(frames, shape, seed), network)
        self.network = network
        self.optimiser = torch.optim.AdamW(network.parameters(), RATE, weight_decay=DECAY)
        self.step = 0
        chosen = rng(seed, "chunk policy", "validation").permutation(frames.validation)[:LOOKED_AT]
        self._validation = np.sort(chosen)

    @property
    def rate(self) -> float:
        """Learning rate of the next step: rising for a while, then a cosine."""
        return RATE * min(1.0, (self.step + 1) / WARM) * 0.5 * (1.0 + math.cos(math.pi * self.step / self.steps))

    def train(self) -> float:
        """Take a step; return the loss."""
        chance = rng(self.seed, "chunk policy", "batch", self.step)
        torch.manual_seed(int(chance.integers(2**31)))
        batch = self.frames.train[chance.integers(len(self.frames.train), size=BATCH)]
        pictures = _augmented(self.frames.pictures[batch], chance)
        for group in self.optimiser.param_groups:
            group["lr"] = self.rate
        self.network.train()
        loss = self._loss(batch, pictures)
        self.optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
        self.optimiser.step()
        self.step += 1
        return float(loss.detach())

    def validate(self) -> float:
        """Return the loss on frames of episodes that are not trained on."""
        self.network.eval()
        losses = []
        with torch.inference_mode():
            for first in range(0, len(self._validation), BATCH):
                batch = self._validation[first : first + BATCH]
                losses.append(float(self._loss(batch, self.frames.pictures[batch])) * len(batch))
        return sum(losses) / len(self._validation)

    def _loss(self, batch: NDArray[np.int64], pictures: NDArray[np.uint8]) -> Any:
        scales = self.policy.scales
        targets, there = self.frames.chunks(batch, self.shape.chunk)
        wanted = torch.from_numpy((targets - scales["action_mean"]) / scales["action_std"])
        states = (self.frames.states[batch] - scales["state_mean"]) / scales["state_std"]
        found = self.network(
            torch.from_numpy(np.ascontiguousarray(pictures)),
            torch.from_numpy(states.astype(np.float32)),
            torch.from_numpy(self.frames.words[batch]),
        )
        mask = torch.from_numpy(there)[..., None]
        return ((found - wanted).abs() * mask).sum() / (mask.sum() * wanted.shape[-1])

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return weights and the optimiser's memory."""
        kept = self.policy.arrays()
        for number, state in self.optimiser.state_dict()["state"].items():
            kept |= {f"adam/{number}/{name}": np.asarray(value) for name, value in state.items()}
        return kept

    def restore(self, arrays: dict[str, NDArray[Any]], step: int) -> None:
        """Go on where `arrays` was called."""
        weights = {k.removeprefix("weight/"): torch.from_numpy(v) for k, v in arrays.items() if k.startswith("weight/")}
        self.network.load_state_dict(weights)
        state: dict[int, dict[str, Any]] = {}
        for name, value in arrays.items():
            if name.startswith("adam/"):
                _, number, what = name.split("/")
                state.setdefault(int(number), {})[what] = torch.from_numpy(np.array(value))
        self.optimiser.load_state_dict(self.optimiser.state_dict() | {"state": state})
        self.step = step


def _augmented(pictures: NDArray[np.uint8], chance: np.random.Generator) -> NDArray[np.uint8]:
    """Return pictures shifted a little, and lighter or darker."""
    padded = np.pad(pictures, ((0, 0), (SHIFT, SHIFT), (SHIFT, SHIFT), (0, 0)), mode="edge")
    side, found = pictures.shape[1], np.empty_like(pictures)
    for k, (y, x) in enumerate(chance.integers(2 * SHIFT + 1, size=(len(pictures), 2)).tolist()):
        lit = padded[k, y : y + side, x : x + side] * chance.uniform(1.0 - LIGHT, 1.0 + LIGHT)
        found[k] = np.clip(lit, 0, 255).astype(np.uint8)
    return found


def write_arrays(path: Path, arrays: dict[str, NDArray[Any]]) -> None:
    """Write arrays as ``.npz``, whole or not at all."""
    sink = io.BytesIO()
    np.savez(sink, **arrays)
    write_bytes(path, sink.getvalue())


def write_curve(path: Path, rows: list[dict[str, float]]) -> None:
    """Write the curve."""
    sink = io.StringIO()
    writer = csv.DictWriter(sink, COLUMNS)
    writer.writeheader()
    writer.writerows(rows)
    write_bytes(path, sink.getvalue().encode())


def train(arguments: argparse.Namespace) -> None:
    """Train, or go on training."""
    out, began = arguments.out, time.monotonic()
    out.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(arguments.threads)
    dataset, shape = Dataset(arguments.dataset), ChunkShape(side=arguments.side)
    decides = {"dataset": sha256_of(dataset.path / "dataset.json"), "shape": asdict(shape), "seed": arguments.seed}
    decides |= {"steps": arguments.steps, "every": arguments.every}
    frames = read_frames(dataset, shape, out)
    trainer = Trainer(frames, shape, seed=arguments.seed, steps=arguments.steps)
    curve: list[dict[str, float]] = []
    best, stale, spent = math.inf, 0, 0.0
    saved = out / "training.json"
    if saved.exists():
        record = read_json(saved)
        if record["decides"] != decides:
            raise InputError(f"{out}: was trained otherwise (dataset, sizes, seed or steps); give another --out")
        best, stale, spent, curve = record["best"], record["stale"], record["cpu_seconds"], record["curve"]
        trainer.restore(read_npz((out / record["checkpoint"]).read_bytes()), record["step"])
        say(f"goes on from step {trainer.step}")
    say(f"{len(frames.train)} frames to train on, {len(frames.validation)} others; {parameters(trainer):.2f} M weights")
    losses: list[float] = []
    while trainer.step < arguments.steps and stale < arguments.patience:
        watch = time.process_time()
        losses.append(trainer.train())
        spent += time.process_time() - watch
        if trainer.step % arguments.every and trainer.step < arguments.steps:
            continue
        loss = trainer.validate()
        row = {"step": trainer.step, "train_loss": round(float(np.mean(losses)), 5), "validation_loss": round(loss, 5)}
        row |= {"rate": round(trainer.rate, 8), "cpu_seconds": round(spent, 1)}
        curve.append(row)
        pace = spent / trainer.step
        say(f"step {trainer.step}: loss {row['train_loss']:.4f}, validation {loss:.4f}, {pace:.3f} processor s a step")
        losses, stale = [], 0 if loss < best else stale + 1
        if loss < best:
            best = loss
            keep(out, trainer, {**decides, "step": trainer.step, "validation_loss": round(loss, 5)})
        checkpoint = f"checkpoint_{trainer.step}.npz"
        write_arrays(out / checkpoint, trainer.arrays())
        write_curve(out / "curve.csv", curve)
        record = {"decides": decides, "step": trainer.step, "best": best, "stale": stale, "cpu_seconds": spent}
        write_json(saved, {**record, "curve": curve, "checkpoint": checkpoint})
        for old in out.glob("checkpoint_*.npz"):
            if old.name != checkpoint:
                old.unlink()
        if time.monotonic() - began > 60.0 * arguments.minutes:
            break


def keep(out: Path, trainer: Trainer, about: dict[str, Any]) -> None:
    """Write the policy as it is now."""
    path = out / "policy.npz"
    write_arrays(path, trainer.policy.arrays())
    digest = sha256_of(path)
    write_bytes(out / "policy.npz.sha256", f"{digest}  policy.npz\n".encode())
    made = {"producer": f"vico {__version__}", "torch": torch.__version__, "batch": BATCH, "rate": RATE}
    write_json(out / "policy.json", {**about, **made, "sha256": digest})


def parameters(trainer: Trainer) -> float:
    """Return how many million weights there are."""
    return sum(parameter.numel() for parameter in trainer.network.parameters()) / 1e6


def say(text: str) -> None:
    """Print a line."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def main() -> None:
    """Train as the command line says."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--side", type=int, default=96, help="pixels of the pictures it sees")
    parser.add_argument("--steps", type=int, default=50_000)
    parser.add_argument("--minutes", type=float, default=math.inf, help="after which it stops, at the next look")
    parser.add_argument("--every", type=int, default=500, help="steps between two looks at the validation loss")
    parser.add_argument("--patience", type=int, default=20, help="looks without a better loss after which it stops")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--seed", type=int, default=0)
    try:
        train(parser.parse_args())
    except VicoError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
