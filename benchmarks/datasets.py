"""How fast datasets are written, beside how fast their episodes run: `benchmarks/results/datasets.md`.

python benchmarks/datasets.py --world helsinki --table benchmarks/results/datasets.md

Each round plays an episode with nothing kept, then records it and encodes its pictures in each format, the
pictures being there already: processor seconds, so that whatever else the machine does counts little.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from reporting import machine

from vico.challenges.assistant.challenge import play_task, world_and_people
from vico.challenges.assistant.generate import first_subtasks, generate_task
from vico.datasets.build import BuildRequest, SplitRule, layout_of
from vico.datasets.demonstrations import EpisodeFacts, demonstrations_of
from vico.datasets.episodes import origin_of_run
from vico.datasets.formats.registry import FORMATS
from vico.datasets.layout import Contents, read_part, write_part
from vico.datasets.pictures import PictureFiles, PictureKeeper
from vico.datasets.worker import encode_demonstration
from vico.io.files import write_bytes
from vico.sim.recording import read_run

OUTPUTS = ("rgb", "depth", "segmentation")


def cpu(work: Callable[[], object]) -> float:
    """Return the processor seconds that something takes."""
    began = time.process_time()
    work()
    return time.process_time() - began


def one_round(world: Path, seed: int, steps: int, size: int) -> dict[str, float]:
    """Return processor seconds a frame of an episode, and of writing it down in each format."""
    place, people = world_and_people(world, "search")
    task = first_subtasks(generate_task(place, people, "search", seed=seed, steps=steps), subtasks=1)
    found: dict[str, float] = {}
    frames = 0

    def play() -> None:
        nonlocal frames
        frames = play_task(place, people, task, method="heuristic").steps

    play()  # compiled code and caches
    found["run"] = cpu(play)
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        keeper = PictureKeeper(work / "pictures", ["assistant_0"], size=size, outputs=OUTPUTS)
        play_task(place, people, task, method="heuristic", recording=work / "run", hooks=[keeper])
        run, pictures = read_run(work / "run"), keeper.close()
        for to in FORMATS:
            contents, staged = Contents(to, OUTPUTS, size), work / f"{to}.staged"
            staged.mkdir()

            def write(to: str = to, contents: Contents = contents, staged: Path = staged) -> None:
                made = demonstrations_of(run, EpisodeFacts(instructions=task.instructions()), ["assistant_0"])[0]
                about = encode_demonstration(
                    made, pictures, PictureFiles(staged, "0"), contents, origin_of_run(made, run, place)
                )
                write_part(work / f"{to}.part", "key", [(about, made)], staged)
                part = read_part(work / f"{to}.part", "key")
                assert part is not None
                request = BuildRequest(contents, rule=SplitRule("episode", 0.0))
                FORMATS[to].assemble(work / to, layout_of(request, part))

            (work / to).mkdir()
            found[to] = cpu(write)
    return {name: seconds / frames for name, seconds in found.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--world", type=Path, required=True)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--steps", type=int, default=60)
    parser.add_argument("--table", type=Path)
    arguments = parser.parse_args()
    lines = [
        "# Writing datasets",
        "",
        machine(),
        "",
        f"An assistant episode (Search, heuristic, 15 residents, one agent that sees), {arguments.rounds} episodes of "
        f"at most {arguments.steps} steps, each after one that is not counted. Processor milliseconds a frame, median "
        "(least to most), with colour, depth and segmentation. *Run* is the episode alone, pictures included; the "
        "others are what it takes to write its frames down: vectors, statistics, pictures encoded, files put together.",
        "",
        "| size, pixels | run | lerobot | webdataset | parquet |",
        "|---|---|---|---|---|",
    ]
    for size in (64, 128, 256):
        rounds = [one_round(arguments.world, seed, arguments.steps, size) for seed in range(arguments.rounds)]
        cells = [str(size)]
        for name in ("run", *FORMATS):
            values = [1000.0 * one[name] for one in rounds]
            cells.append(f"{statistics.median(values):.1f} ({min(values):.1f} to {max(values):.1f})")
        lines.append("| " + " | ".join(cells) + " |")
    page = "\n".join(lines) + "\n"
    print(page)
    if arguments.table is not None:
        write_bytes(arguments.table, page.encode())


if __name__ == "__main__":
    main()
