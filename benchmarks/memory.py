"""How much memory a run takes, and how much disk an installation.

    python benchmarks/memory.py WORLD COMMUNITY [--steps 60] [-n 3] [--table benchmarks/results/memory.md]

Each run is a process of its own: one resident's views are rendered, then those of everybody, robots included. What is
installed is weighed package by package: what `virtual-community[worldgen]` asks for, and what these ask for in turn.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import re
import sysconfig
import tempfile
from pathlib import Path

from reporting import machine, publish, row, vico

GOAL_RUN_MB, GOAL_INSTALL_MB = 2560, 2048


def installed(root: str, extras: set[str]) -> dict[str, float]:
    """Megabytes of a distribution and of all it needs, by name; those of its development checkout not counted."""
    sizes: dict[str, float] = {}
    waiting = [(root, extras)]
    while waiting:
        name, wanted = waiting.pop()
        key = re.sub(r"[-_.]+", "-", name).lower()
        if key in sizes:
            continue
        try:
            distribution = importlib.metadata.distribution(name)
        except importlib.metadata.PackageNotFoundError:
            continue  # asked for on other platforms only
        files = [Path(str(distribution.locate_file(file))) for file in distribution.files or []]
        sizes[key] = sum(file.stat().st_size for file in files if file.is_file()) / 1e6
        for requirement in distribution.requires or []:
            marker = re.search(r"extra\s*==\s*[\"']([^\"']+)[\"']", requirement)
            match = re.match(r"[A-Za-z0-9._-]+", requirement)
            if match is not None and (marker is None or marker.group(1) in wanted):
                bracket = re.match(r"[A-Za-z0-9._-]+\s*\[([^\]]*)\]", requirement)
                inner = {part.strip() for part in bracket.group(1).split(",")} if bracket else set()
                waiting.append((match.group(0), inner))
    return sizes


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("world", type=Path)
    parser.add_argument("community", type=Path)
    parser.add_argument("--steps", type=int, default=60)
    parser.add_argument("-n", type=int, default=3, help="runs of each kind")
    parser.add_argument("--table", type=Path)
    given = parser.parse_args()
    about = machine()
    cases = {
        "1 resident observing, no robots": ("--observe", "resident_0", "--robots", "none"),
        "everybody observing, Husky and Go2": ("--observe", "all", "--robots", "husky,go2"),
    }
    lines = [
        "# Memory and disk",
        "",
        about,
        "Made by `vico bench memory --table benchmarks/results/memory.md`.",
        "",
        f"Peak resident set of `vico run` over {given.steps} steps with 30 cars and 30 pedestrians. "
        f"Goal: {GOAL_RUN_MB} MB.",
        "",
        "| run | median MB | least | greatest | n |",
        "|---|---|---|---|---|",
    ]
    with tempfile.TemporaryDirectory(prefix="vico-") as folder:
        base = ["run", str(given.world), str(given.community), "--steps", str(given.steps), "--out", f"{folder}/run"]
        for name, options in cases.items():
            lines.append(row(name, [vico(*base, "--force", *options).peak_mb for _ in range(given.n)], 0))
    sizes = installed("virtual-community", {"worldgen"})
    everything = Path(sysconfig.get_paths()["purelib"])
    whole = sum(file.stat().st_size for file in everything.rglob("*") if file.is_file() and not file.is_symlink()) / 1e6
    lines += [
        "",
        "## Installed",
        "",
        f"{len(sizes)} distributions. Goal: {GOAL_INSTALL_MB} MB.",
        "",
        "| what | MB |",
        "|---|---|",
        f"| virtual-community[worldgen] and what it needs | {sum(sizes.values()):.0f} |",
    ]
    largest = sorted(sizes.items(), key=lambda item: (-item[1], item[0]))[:8]
    lines += [f"| of which {name} | {size:.0f} |" for name, size in largest]
    lines.append(
        f"| this environment's site-packages, tools for development and compiled bytecode included | {whole:.0f} |"
    )
    publish(lines, given.table)


if __name__ == "__main__":
    main()
