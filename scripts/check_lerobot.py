"""Load a dataset with LeRobot itself, compare what it reads with what was written, and train on it for some steps.

Needs `lerobot` and `torch`, which vico does not install:

    python -m venv venv-lerobot && venv-lerobot/bin/pip install lerobot
    HF_HUB_OFFLINE=1 venv-lerobot/bin/python scripts/check_lerobot.py demos --train 200

Nothing of vico is imported, so that it may run in an environment of its own. Where torchvision is missing or does not
fit torch (as beside builds for the CPU), the two things that LeRobot's reader takes from it are stood in for: turning a
picture into a tensor, and reading a film with PyAV.
"""

import argparse
import importlib.machinery
import json
import os
import sys
import time
import types
from pathlib import Path

os.environ.setdefault("HF_HUB_OFFLINE", "1")  # a missing file is an error, not a download

import numpy as np
import pyarrow.parquet as pq


def say(text: str) -> None:
    """Print a line."""
    sys.stdout.write(f"{text}\n")


def stand_in_for_torchvision() -> bool:
    """Put a module called torchvision in place if there is none that works; return whether that was needed."""
    try:
        import torchvision

        return not hasattr(torchvision.io, "VideoReader") and _stand_in()
    except (ImportError, RuntimeError):
        return _stand_in()


def _stand_in() -> bool:
    import av
    import torch

    class ToTensor:
        """A PIL image as float32 in 0..1, channels first."""

        def __call__(self, image):
            return torch.from_numpy(np.array(image)).permute(2, 0, 1).float() / 255

    class VideoReader:
        """Frames of a film with their times, from the whole frame before a time on."""

        def __init__(self, path, stream="video"):
            self.container = av.open(path)
            self._stream = self.container.streams.video[0]

        def seek(self, time_s, keyframes_only=False):
            self.container.seek(int(time_s / self._stream.time_base), stream=self._stream, backward=True)
            return self

        def __iter__(self):
            for frame in self.container.decode(self._stream):
                pixels = torch.from_numpy(frame.to_ndarray(format="rgb24")).permute(2, 0, 1)
                yield {"data": pixels, "pts": float(frame.time)}

    for name in [name for name in sys.modules if name.partition(".")[0] == "torchvision"]:
        del sys.modules[name]
    torchvision = types.ModuleType("torchvision")
    torchvision.transforms = types.ModuleType("torchvision.transforms")
    torchvision.transforms.ToTensor = ToTensor
    torchvision.io = types.ModuleType("torchvision.io")
    torchvision.io.VideoReader = VideoReader
    torchvision.set_video_backend = lambda name: None
    for part in (torchvision, torchvision.transforms, torchvision.io):
        part.__spec__ = importlib.machinery.ModuleSpec(part.__name__, None)
        sys.modules[part.__name__] = part
    return True


def check(folder: Path, every: int) -> int:
    """Read frames through LeRobot and compare them with the files; return how many were read."""
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    about = json.loads((folder / "dataset.json").read_text())
    began = time.perf_counter()
    dataset = LeRobotDataset("local/vico", root=folder, video_backend="pyav")
    say(f"opened in {time.perf_counter() - began:.1f} s: {dataset.meta.total_episodes} episodes, {len(dataset)} frames")
    say(f"fps {dataset.fps}, cameras {dataset.meta.camera_keys}, features {sorted(dataset.features)}")
    assert (dataset.meta.total_episodes, len(dataset)) == (about["episodes"], about["frames"])
    rows = pq.read_table(folder / "data" / "chunk-000" / "file-000.parquet").slice(0, len(dataset))
    number = rows["index"].to_pylist()
    state = rows["observation.state"].to_pylist()
    action = rows["action"].to_pylist()
    camera = "observation.images.ego"
    read = 0
    began = time.perf_counter()
    for k in range(0, len(number), every):
        item = dataset[number[k]]
        assert np.array_equal(item["observation.state"].numpy(), np.float32(state[k])), f"frame {k}: another state"
        assert np.array_equal(item["action"].numpy(), np.float32(action[k])), f"frame {k}: another action"
        assert isinstance(item["task"], str)
        assert item["task"]
        if camera in dataset.features:
            assert tuple(item[camera].shape) == (3, about["size"], about["size"])
            assert 0.0 <= float(item[camera].min()) <= float(item[camera].max()) <= 1.0
        if "observation.depth" in dataset.features:
            depth = item["observation.depth"].numpy()
            assert depth.shape == (about["size"],) * 2
            assert np.array_equal(depth, np.float32(rows["observation.depth"][k].as_py())), f"frame {k}: another depth"
        read += 1
    say(f"{read} frames read and equal, {1000 * (time.perf_counter() - began) / read:.1f} ms a frame")
    for name in ("observation.state", "action", *([camera] if camera in dataset.features else [])):
        stats = dataset.meta.stats[name]
        assert {"min", "max", "mean", "std", "count", "q01", "q10", "q50", "q90", "q99"} <= set(stats), name
        assert np.isfinite(stats["mean"]).all()
        assert np.isfinite(stats["std"]).all()
    last = dataset.meta.episodes[dataset.meta.total_episodes - 1]
    assert last["dataset_to_index"] == len(dataset)
    windows = LeRobotDataset(
        "local/vico",
        root=folder,
        video_backend="pyav",
        episodes=[0],
        delta_timestamps={"action": [0.0, 1.0 / dataset.fps]},
    )
    assert tuple(windows[0]["action"].shape) == (2, len(action[0]))
    say("chunks of actions (delta_timestamps) and one episode alone can be read, too")
    return read


def train(folder: Path, steps: int) -> None:
    """Train a small network from pictures and state to actions, batches made by LeRobot's own loader."""
    import torch
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    torch.manual_seed(0)
    dataset = LeRobotDataset("local/vico", root=folder, video_backend="pyav")
    camera = "observation.images.ego"
    stats = {
        k: {n: torch.as_tensor(v, dtype=torch.float32) for n, v in s.items()} for k, s in dataset.meta.stats.items()
    }
    eyes = torch.nn.Sequential(
        torch.nn.Conv2d(3, 16, 5, 4),
        torch.nn.ReLU(),
        torch.nn.Conv2d(16, 32, 3, 2),
        torch.nn.ReLU(),
        torch.nn.Flatten(),
    )
    size = eyes(torch.zeros(1, *dataset[0][camera].shape)).shape[1] + len(dataset[0]["observation.state"])
    head = torch.nn.Sequential(
        torch.nn.Linear(size, 128), torch.nn.ReLU(), torch.nn.Linear(128, len(dataset[0]["action"]))
    )
    optimiser = torch.optim.Adam([*eyes.parameters(), *head.parameters()], 1e-3)
    order = torch.Generator().manual_seed(0)
    loader = torch.utils.data.DataLoader(dataset, batch_size=32, shuffle=True, generator=order)
    losses: list[float] = []
    began = time.perf_counter()
    while len(losses) < steps:
        for batch in loader:
            scaled = {
                name: (batch[name] - stats[name]["mean"]) / (stats[name]["std"] + 1e-6)
                for name in ("observation.state", "action", camera)
            }
            found = head(torch.cat([eyes(scaled[camera]), scaled["observation.state"]], dim=1))
            loss = torch.nn.functional.mse_loss(found, scaled["action"].clamp(-5, 5))
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            losses.append(float(loss.detach()))
            if len(losses) == steps:
                break
    tenth = max(1, steps // 10)
    first, last = np.mean(losses[:tenth]), np.mean(losses[-tenth:])
    say(f"trained {steps} steps of 32 in {time.perf_counter() - began:.0f} s: loss {first:.3f} -> {last:.3f}")
    assert last < first


def main() -> None:
    """Check, and train if asked to."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--every", type=int, default=7, help="compare every so many frames")
    parser.add_argument("--train", type=int, default=0, help="steps to train")
    arguments = parser.parse_args()
    stood_in = stand_in_for_torchvision()
    import lerobot
    import torch

    say(
        f"lerobot {lerobot.__version__}, torch {torch.__version__}, "
        f"torchvision {'stood in for' if stood_in else 'its own'}"
    )
    check(arguments.dataset, arguments.every)
    if arguments.train:
        train(arguments.dataset, arguments.train)


if __name__ == "__main__":
    main()
