"""Speed and memory in the settings of the Virtual Community paper, by number of agents and size of the world.

    python benchmarks/paper.py WORLD [WORLD ...] [--agents 1,5,10,20,30,40,50] [--seconds 20]
        [--table benchmarks/results/paper.md] [--chart docs/images/paper_settings.png]

Settings (appendix of the paper, simulation benchmarking), each measured in a process of its own:

- RGB: avatars walk and get a 256 x 256 RGB picture once a second, which holds 100 physics frames;
- depth: they get a 256 x 256 depth picture after every physics frame, 100 times a second;
- memory: resident set while all of them get all pictures once a second: its peak, and its mean after loading.

A Go2 whose motors are commanded is in the scene, so that all of the 100 frames are computed by the physics engine; what
is given is physics frames per wall-clock second, as in the paper. The first world is the largest; speed is measured in
all, memory in the first. `--chart` needs matplotlib (`pip install "virtual-community[bench]"`).
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
from reporting import machine, publish

_WARM = 3
_FRAMES = 100
#: Figure "Memory benchmarking" of the paper: agents, peak and mean RAM and peak GPU memory, GB, on an L40S.
PAPER_MEMORY = {
    1: (17.4, 15.1, 4.4),
    5: (18.8, 16.9, 4.9),
    10: (21.1, 19.3, 6.0),
    20: (25.9, 24.0, 8.0),
    30: (30.5, 28.4, 10.2),
    40: (33.9, 31.7, 12.3),
    50: (38.5, 36.0, 14.3),
}


def simulation(world_folder: Path, agents: int, outputs: tuple[str, ...]) -> Any:
    """Return a simulation with so many avatars and a Go2, everybody near the middle of the world."""
    from vico.sim.config import SimConfig
    from vico.sim.loop.simulation import Simulation
    from vico.world.folder import read_world

    world = read_world(world_folder)
    watching = tuple(f"assistant_{k}" for k in range(agents))
    config = SimConfig(assistants=agents, robots=("go2",), outputs=outputs, observe=watching, seed=1)
    return Simulation(world, None, config)


def actions(sim: Any, second: int) -> dict[str, Any]:
    """Return what everybody does: avatars walk and turn now and then, the robot's motors hold its stance."""
    walk = {"type": "move_forward", "distance": 1.0}
    turn = {"type": "turn_left", "degrees": 70.0}
    found = {f"assistant_{k}": turn if (second + k) % 7 == 0 else walk for k in range(len(sim.state.people))}
    stance = np.asarray(sim.state.robots.models[0].stance, np.float32)
    return found | {"robot_0": {"type": "control", "vector": stance}}


def rgb(world: Path, agents: int, seconds: int) -> dict[str, Any]:
    """Measure the RGB setting."""
    sim = simulation(world, agents, ("rgb",))
    walls = []
    for second in range(seconds + _WARM):
        began = time.perf_counter()
        result = sim.step(actions(sim, second))
        for name in result.observations:
            _ = result.observations[name].get("rgb")
        if second >= _WARM:
            walls.append(time.perf_counter() - began)
    return {"fps": [_FRAMES / wall for wall in walls]}


def depth(world: Path, agents: int, seconds: int) -> dict[str, Any]:
    """Measure the depth setting; an eighth of the seconds, for it takes a hundred times as many pictures."""
    sim = simulation(world, agents, ("depth",))
    rates = []
    for second in range(max(seconds // 8, 2) + 1):
        began = time.perf_counter()
        sim.act(actions(sim, second))
        for _ in range(_FRAMES):
            sim.advance(1.0 / _FRAMES)
            observations, _infos = sim.observe()
            for k in range(agents):
                _ = observations[f"assistant_{k}"]["depth"]
        sim.metrics.steps += 1
        if second:
            rates.append(_FRAMES / (time.perf_counter() - began))
    return {"fps": rates}


def memory(world: Path, agents: int, seconds: int) -> dict[str, Any]:
    """Measure the resident set while everybody observes."""
    sim = simulation(world, agents, ("rgb", "depth", "segmentation"))
    page, readings, over = os.sysconf("SC_PAGE_SIZE"), [], threading.Event()

    def read() -> None:
        while not over.wait(0.05):
            readings.append(int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * page / 1e9)

    reader = threading.Thread(target=read)
    for second in range(seconds):
        if second == 1:
            reader.start()
        result = sim.step(actions(sim, second))
        for name in result.observations:
            _ = result.observations[name].get("rgb")
    over.set()
    reader.join()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9
    return {"peak_gb": peak, "mean_gb": float(np.mean(readings))}


_CASES = {"rgb": rgb, "depth": depth, "memory": memory}


def measured(case: str, world: Path, agents: int, seconds: int) -> dict[str, Any]:
    """Measure one point in a process of its own."""
    command = [sys.executable, __file__, str(world), "--case", case, "--agents", str(agents), "--seconds", str(seconds)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{case}, {agents} agents: exit status {done.returncode}\n{done.stderr}")
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def buildings(world: Path) -> int:
    """Return how many buildings a world has."""
    content = json.loads((world / "buildings.json").read_text(encoding="utf-8"))
    return len(content["buildings"] if isinstance(content, dict) else content)


def chart(path: Path, speed: dict[tuple[str, str], dict[int, list[float]]], used: dict[int, dict[str, float]]) -> None:
    """Draw the curves: speed in both settings, memory beside the paper's."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        sys.exit('paper.py: the chart needs matplotlib: pip install "virtual-community[bench]"')
    figure = Figure(figsize=(13, 4), layout="constrained")
    axes = figure.subplots(1, 3)
    for axis, setting in zip(axes, ("rgb", "depth"), strict=False):
        for (case, label), points in speed.items():
            if case == setting:
                axis.plot(list(points), [np.median(values) for values in points.values()], marker="o", label=label)
        axis.axhline(_FRAMES, color="black", linewidth=0.8, linestyle=":", label="real time")
        axis.set(title=f"{setting.upper() if setting == 'rgb' else 'Depth'} setting", xlabel="agents", yscale="log")
        axis.set_ylabel("physics frames a second")
        axis.legend()
    axes[2].plot(list(used), [one["peak_gb"] for one in used.values()], marker="o", label="this, peak")
    axes[2].plot(list(used), [one["mean_gb"] for one in used.values()], marker="s", label="this, mean")
    axes[2].plot(list(PAPER_MEMORY), [row[0] for row in PAPER_MEMORY.values()], marker="^", label="paper, peak")
    axes[2].set(title="Memory", xlabel="agents", ylabel="GB of RAM", yscale="log")
    axes[2].legend()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=90)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("worlds", type=Path, nargs="+")
    parser.add_argument("--agents", default="1,5,10,20,30,40,50")
    parser.add_argument("--seconds", type=int, default=20)
    parser.add_argument("--table", type=Path)
    parser.add_argument("--chart", type=Path)
    parser.add_argument("--case", choices=list(_CASES), help="measure this one here, and print it as JSON")
    given = parser.parse_args()
    counts = [int(count) for count in given.agents.split(",")]
    if given.case:
        print(json.dumps(_CASES[given.case](given.worlds[0], counts[0], given.seconds)))
        return
    about = machine()
    labels = {world: f"{buildings(world)} buildings" for world in given.worlds}
    speed: dict[tuple[str, str], dict[int, list[float]]] = {}
    for case in ("rgb", "depth"):
        for world, label in labels.items():
            points = {count: measured(case, world, count, given.seconds)["fps"] for count in counts}
            speed[case, label] = points
    used = {count: measured("memory", given.worlds[0], count, given.seconds) for count in counts}
    lines = [
        "# The paper's settings: physics frames a second, and memory",
        "",
        about,
        "Made by `python benchmarks/paper.py WORLD ... --table benchmarks/results/paper.md --chart "
        "docs/images/paper_settings.png`.",
        "",
        "Physics frames of 0.01 s a wall-clock second, median (10th..90th percentile) over seconds; 100 is real time. "
        "The paper's own figures of speed are curves without numbers, on an A100.",
        "",
        "| setting | world | " + " | ".join(f"{count} agents" for count in counts) + " |",
        "|---|---|" + "---|" * len(counts),
    ]
    for (case, label), points in speed.items():
        cells = []
        for values in points.values():
            low, middle, high = np.percentile(values, [10, 50, 90])
            cells.append(f"{middle:.0f} ({low:.0f}..{high:.0f})")
        lines.append(f"| {case} | {label} | " + " | ".join(cells) + " |")
    lines += [
        "",
        f"Memory, GB, in the world of {labels[given.worlds[0]]}, beside the paper's (its figure of memory, on an L40S, "
        "whose graphics memory comes on top):",
        "",
        "| agents | peak | mean | paper: peak RAM | mean RAM | peak GPU |",
        "|---|---|---|---|---|---|",
    ]
    for count, one in used.items():
        row = PAPER_MEMORY.get(count)
        beside = " | ".join(f"{value:.1f}" for value in row) if row else " | | "
        lines.append(f"| {count} | {one['peak_gb']:.2f} | {one['mean_gb']:.2f} | {beside} |")
    publish(lines, given.table)
    if given.chart:
        chart(given.chart, speed, used)


if __name__ == "__main__":
    main()
