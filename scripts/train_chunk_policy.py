"""Train an action-chunk policy on pick-and-place demonstrations (extra ``imitation``: a CPU build of torch).

    vico dataset build --challenge pick_place --episodes 1500 --successes --drop-below 0.01 --clip 0.01 --size 224 \\
        --to lerobot --validation 0.05 --out demos
    python scripts/train_chunk_policy.py demos --out policy [--side 96] [--steps 50000] [--minutes 300] [--seed 0]
    python scripts/train_chunk_policy.py demos --out policy --device cuda --batch 256 --rate 6e-4 --workers 16

Behaviour cloning with batches of 32, as in the paper, unless told otherwise; the loss is the mean absolute error of
scaled actions. Episodes of the dataset's split ``validation`` are kept apart; without such a split every tenth episode
is. Training stops at ``--steps``, after ``--minutes``, or when the validation loss has not fallen for ``--patience``
looks at it. What was stopped goes on from the last look by the same command, on a CPU to the same weights as if it had
not been. Writes ``policy.npz`` (the weights with the lowest validation loss) with ``policy.npz.sha256`` and
``policy.json`` beside, and ``curve.csv``.

With ``--device cuda`` all frames lie in the graphics card's memory (28 kB each at 96 pixels) and sums are made in
bfloat16 where torch holds that safe; cards do not promise the same sums twice.
"""

from __future__ import annotations

import argparse
import csv
import io
import math
import multiprocessing
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from vico.agents.robot.chunk_policy import SCALES, ChunkPolicy, downscale_picture, new_network, relative_chunk
from vico.agents.robot.chunk_policy import word_ids as numbers_of
from vico.agents.robot.increments import ChunkShape
from vico.datasets.folder import Dataset
from vico.datasets.vectors import SPACE
from vico.errors import InputError, VicoError
from vico.io.arrays import read_npz
from vico.io.files import read_json, sha256_of, write_bytes, write_json
from vico.seeds import rng
from vico.version import __version__

BATCH, RATE, WARM, DECAY = 32, 3e-4, 200, 1e-4
#: Frames that are looked at together where nothing is learned from them.
LOOKED_AT_ONCE = 64
#: Pixels that pictures are shifted by at most, and share by which they get lighter or darker.
SHIFT, LIGHT = 4, 0.15
#: Frames that the validation loss is measured on, and that scales are taken from, at most.
LOOKED_AT, SCALED_BY = 512, 20_000
COLUMNS = ("step", "train_loss", "validation_loss", "rate", "cpu_seconds", "seconds")


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


def read_frames(dataset: Dataset, shape: ChunkShape, cache: Path, *, workers: int = 1) -> Frames:
    """Read a dataset; what was read is kept, its pictures small, in files of their own beside the policy."""
    about = dataset.about
    if about.action.get("space") != SPACE or "rgb" not in about.outputs:
        raise InputError(f"{dataset.path}: no pick-and-place demonstrations with pictures; see docs/imitation.md")
    if about.size < shape.side:
        raise InputError(f"{dataset.path}: pictures of {about.size} pixels; give --side {about.size} or less")
    n, rows = about.frames, dataset.episodes()
    mark, wanted = cache / f"frames_{shape.side}.json", {"dataset": sha256_of(dataset.path / "dataset.json")}
    sizes = {"pictures": (np.uint8, (n, shape.side, shape.side, 3))}
    sizes |= {"states": (np.float32, (n, shape.state)), "actions": (np.float32, (n, shape.action))}
    paths = {name: cache / f"{name}_{shape.side}.npy" for name in sizes}
    first = np.concatenate([[0], np.cumsum([row["frames"] for row in rows])])
    if not (mark.exists() and read_json(mark) == wanted):
        for name, (kind, size) in sizes.items():
            np.lib.format.open_memmap(paths[name], "w+", kind, size).flush()
        tasks = [(dataset.path, row["episode_index"], int(first[k]), paths, shape.side) for k, row in enumerate(rows)]
        if workers > 1:
            with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
                list(pool.map(read_episode, tasks))
        else:
            for task in tasks:
                read_episode(task)
        write_json(mark, wanted)
    arrays = {name: np.load(path, mmap_mode="r") for name, path in paths.items()}
    words, ends, owner = np.zeros((n, shape.words), np.int64), np.zeros(n, np.int64), np.zeros(n, np.int64)
    for k, row in enumerate(rows):
        here = slice(int(first[k]), int(first[k + 1]))
        words[here] = numbers_of(row["instructions"][0], shape)
        ends[here], owner[here] = here.stop, row["episode_index"]
    split = about.splits.get("validation")
    held = (owner >= split[0]) & (owner < split[1]) if split else owner % 10 == 9
    test = about.splits.get("test", (0, 0))
    used = ~((owner >= test[0]) & (owner < test[1]))
    train, validation = np.flatnonzero(used & ~held), np.flatnonzero(used & held)
    if not len(train) or not len(validation):
        raise InputError(f"{dataset.path}: too few episodes to keep some apart; give --validation 0.1 when building it")
    states, actions = np.array(arrays["states"]), np.array(arrays["actions"])
    return Frames(arrays["pictures"], states, actions, words, ends, train, validation)


def read_episode(task: tuple[Path, int, int, dict[str, Path], int]) -> None:
    """Write an episode's frames to where they belong in the arrays of all."""
    dataset, episode, row, paths, side = task
    arrays = {name: np.load(path, mmap_mode="r+") for name, path in paths.items()}
    for frame in Dataset(dataset).frames(episode):
        arrays["states"][row], arrays["actions"][row] = frame["observation.state"], frame["action"]
        arrays["pictures"][row] = downscale_picture(frame["pictures"]["rgb"], side)
        row += 1


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

    def __init__(self, frames: Frames, shape: ChunkShape, options: argparse.Namespace) -> None:
        torch.manual_seed(options.seed)
        _, network = new_network(shape)
        self.frames, self.shape, self.options = frames, shape, options
        self.device = torch.device(options.device)
        self.policy = ChunkPolicy(shape, scales_of(frames, shape, options.seed), network)
        self.network = network.to(self.device)
        self.optimiser = torch.optim.AdamW(network.parameters(), options.rate, weight_decay=DECAY)
        self.step = 0
        chosen = rng(options.seed, "chunk policy", "validation").permutation(frames.validation)[:LOOKED_AT]
        self._validation = np.sort(chosen)
        # On a card all frames lie in its memory; beside a CPU they stay in their file.
        self._pictures = torch.from_numpy(np.array(frames.pictures)).to(self.device) if self._on_card else None

    @property
    def _on_card(self) -> bool:
        return self.device.type != "cpu"

    @property
    def rate(self) -> float:
        """Learning rate of the next step: rising for a while, then a cosine."""
        turned = math.pi * self.step / self.options.steps
        return self.options.rate * min(1.0, (self.step + 1) / WARM) * 0.5 * (1.0 + math.cos(turned))

    def train(self) -> Any:
        """Take a step; return the loss, on the device."""
        chance = rng(self.options.seed, "chunk policy", "batch", self.step)
        torch.manual_seed(int(chance.integers(2**31)))
        batch = self.frames.train[chance.integers(len(self.frames.train), size=self.options.batch)]
        shifts = chance.integers(-SHIFT, SHIFT + 1, size=(len(batch), 2))
        light = chance.uniform(1.0 - LIGHT, 1.0 + LIGHT, size=len(batch))
        for group in self.optimiser.param_groups:
            group["lr"] = self.rate
        self.network.train()
        loss = self._loss(batch, self._seen(batch, shifts, light))
        self.optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
        self.optimiser.step()
        self.step += 1
        return loss.detach()

    def validate(self) -> float:
        """Return the loss on frames of episodes that are not trained on."""
        self.network.eval()
        losses = []
        with torch.inference_mode():
            for first in range(0, len(self._validation), LOOKED_AT_ONCE):
                batch = self._validation[first : first + LOOKED_AT_ONCE]
                shifts, light = np.zeros((len(batch), 2), np.int64), np.ones(len(batch))
                losses.append(float(self._loss(batch, self._seen(batch, shifts, light))) * len(batch))
        return sum(losses) / len(self._validation)

    def _seen(self, batch: NDArray[np.int64], shifts: NDArray[np.int64], light: NDArray[np.float64]) -> Any:
        """Return pictures on the device, shifted, the edge repeated, and made lighter or darker; uint8."""
        side = self.shape.side
        places = np.clip(np.arange(side) + shifts[:, :, None], 0, side - 1)
        rows, columns = (self._put(places[:, axis]) for axis in (0, 1))
        if self._pictures is None:
            pictures, which = torch.from_numpy(self.frames.pictures[batch]), torch.arange(len(batch))
        else:
            pictures, which = self._pictures, self._put(batch)
        shifted = pictures[which[:, None, None], rows[:, :, None], columns[:, None, :]]
        lit = shifted.float() * self._put(light.astype(np.float32))[:, None, None, None]
        return lit.clamp(0.0, 255.0).to(torch.uint8)

    def _put(self, values: NDArray[Any]) -> Any:
        return torch.from_numpy(np.ascontiguousarray(values)).to(self.device)

    def _loss(self, batch: NDArray[np.int64], pictures: Any) -> Any:
        scales = self.policy.scales
        targets, there = self.frames.chunks(batch, self.shape.chunk)
        wanted = self._put((targets - scales["action_mean"]) / scales["action_std"])
        states = (self.frames.states[batch] - scales["state_mean"]) / scales["state_std"]
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self._on_card):
            found = self.network(pictures, self._put(states.astype(np.float32)), self._put(self.frames.words[batch]))
        mask = self._put(there)[..., None]
        return ((found.float() - wanted).abs() * mask).sum() / (mask.sum() * wanted.shape[-1])

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return weights and the optimiser's memory."""
        kept = self.policy.arrays()
        for number, state in self.optimiser.state_dict()["state"].items():
            kept |= {f"adam/{number}/{name}": value.cpu().numpy() for name, value in state.items()}
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
    if arguments.width < 8 or arguments.width % 8:
        raise InputError(f"--width {arguments.width}: give a multiple of 8")
    dataset, shape = Dataset(arguments.dataset), ChunkShape(side=arguments.side, width=arguments.width)
    decides = {"dataset": sha256_of(dataset.path / "dataset.json"), "shape": asdict(shape), "device": arguments.device}
    decides |= {name: getattr(arguments, name) for name in ("seed", "steps", "every", "batch", "rate", "half")}
    frames = read_frames(dataset, shape, out, workers=arguments.workers)
    trainer = Trainer(frames, shape, arguments)
    curve: list[dict[str, float]] = []
    best, stale, spent, lasted = math.inf, 0, 0.0, 0.0
    saved = out / "training.json"
    if saved.exists():
        record = read_json(saved)
        if record["decides"] != decides:
            raise InputError(
                f"{out}: was trained otherwise ({differing(record['decides'], decides)}); give another --out"
            )
        best, stale, curve = record["best"], record["stale"], record["curve"]
        spent, lasted = record["cpu_seconds"], record["seconds"]
        trainer.restore(read_npz((out / record["checkpoint"]).read_bytes()), record["step"])
        say(f"goes on from step {trainer.step}")
    say(f"{len(frames.train)} frames to train on, {len(frames.validation)} others; {parameters(trainer):.2f} M weights")
    losses: list[Any] = []
    watch = time.process_time(), time.monotonic()
    while trainer.step < arguments.steps and stale < arguments.patience:
        losses.append(trainer.train())
        if trainer.step % arguments.every and trainer.step < arguments.steps:
            continue
        loss, learned = trainer.validate(), float(torch.stack(losses).double().mean())
        spent, lasted = spent + time.process_time() - watch[0], lasted + time.monotonic() - watch[1]
        row = {"step": trainer.step, "train_loss": round(learned, 5), "validation_loss": round(loss, 5)}
        row |= {"rate": round(trainer.rate, 8), "cpu_seconds": round(spent, 1), "seconds": round(lasted, 1)}
        curve.append(row)
        paces = f"{spent / trainer.step:.3f} processor s and {lasted / trainer.step:.3f} s a step"
        say(f"step {trainer.step}: loss {learned:.4f}, validation {loss:.4f}, {paces}")
        losses, stale = [], 0 if loss < best else stale + 1
        if loss < best:
            best = loss
            keep(out, trainer, {**decides, "step": trainer.step, "validation_loss": round(loss, 5)})
        checkpoint = f"checkpoint_{trainer.step}.npz"
        write_arrays(out / checkpoint, trainer.arrays())
        write_curve(out / "curve.csv", curve)
        record = {"decides": decides, "step": trainer.step, "best": best, "stale": stale, "cpu_seconds": spent}
        write_json(saved, {**record, "seconds": lasted, "curve": curve, "checkpoint": checkpoint})
        for old in out.glob("checkpoint_*.npz"):
            if old.name != checkpoint:
                old.unlink()
        if time.monotonic() - began > 60.0 * arguments.minutes:
            break
        watch = time.process_time(), time.monotonic()


def differing(before: dict[str, Any], now: dict[str, Any]) -> str:
    """Return what two trainings differ in, by name."""
    return ", ".join(name for name in now if before.get(name) != now[name])


def keep(out: Path, trainer: Trainer, about: dict[str, Any]) -> None:
    """Write the policy as it is now."""
    path = out / "policy.npz"
    arrays = trainer.policy.arrays()
    if trainer.options.half:
        arrays |= {name: value.astype(np.float16) for name, value in arrays.items() if name.startswith("weight/")}
    write_arrays(path, arrays)
    digest = sha256_of(path)
    write_bytes(out / "policy.npz.sha256", f"{digest}  policy.npz\n".encode())
    made = {"producer": f"vico {__version__}", "torch": str(torch.__version__)}
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
    parser.add_argument("--width", type=int, default=256, help="of its transformer, a multiple of 8: its size")
    parser.add_argument("--half", action="store_true", help="keep weights of 16 bits, in half the room")
    parser.add_argument("--steps", type=int, default=50_000)
    parser.add_argument("--minutes", type=float, default=math.inf, help="after which it stops, at the next look")
    parser.add_argument("--every", type=int, default=500, help="steps between two looks at the validation loss")
    parser.add_argument("--patience", type=int, default=20, help="looks without a better loss after which it stops")
    parser.add_argument("--batch", type=int, default=BATCH)
    parser.add_argument("--rate", type=float, default=RATE, help="the highest learning rate")
    parser.add_argument("--device", default="cpu", help="cpu, or torch's name of a graphics card: cuda")
    parser.add_argument("--workers", type=int, default=1, help="processes that read the dataset")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--seed", type=int, default=0)
    try:
        train(parser.parse_args())
    except VicoError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
