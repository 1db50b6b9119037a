"""Verbs that work on the packaged place: `vico demo`, `vico warm-up` and `vico bench`.

`vico demo` does the main job once, from the packaged map to a page one can look at. `vico warm-up` compiles the hot
loops, which are kept in the cache folder for every later start. `vico bench` runs one of the checkout's benchmarks
in a process of its own and prints its tables, with the speed of this machine beside that of the README's figures.
"""

from __future__ import annotations

import io
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import redirect_stdout
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from tyro.conf import Positional

from vico.cli.community import community_build
from vico.cli.compiling import compiling_ahead
from vico.cli.console import check_output, print_json
from vico.cli.film import replay
from vico.cli.options import CommunityBuildOptions, RunOptions, WorldBuildOptions
from vico.cli.world import world_build
from vico.errors import MissingFileError, OutputExistsError, StageError, VicoError

if TYPE_CHECKING:
    from vico.io.files import FolderKind

_FILM = "film.mp4"
#: Folders that the demo makes, in the order in which it makes them.
PARTS = ("world", "community", "run", "evening")


def evening_folder() -> FolderKind:
    """Return the kind of a run's folder with the film of it."""
    from vico.sim.recording.schema import RUN_FOLDER

    return replace(RUN_FOLDER, patterns=lambda folder: (*RUN_FOLDER.patterns(folder), _FILM))


def demo(out: Path = Path("out/demo"), seed: int = 0, force: bool = False) -> int:
    """Do the main job once: build central Helsinki, people it, simulate half an hour, show it.

    Args:
        out: Folder to make; refused if it exists, unless --force.
        seed: Decides everything that is left to chance.
        force: Replace the folders world, community, run and evening there; what else lies beside them stays.
    """
    from rich.console import Console

    from vico.cli.run import run as simulate
    from vico.community.folder import COMMUNITY_FOLDER
    from vico.io.files import check_replaceable
    from vico.sim.recording.schema import RUN_FOLDER
    from vico.world.world import WORLD_FOLDER
    from vico.worldgen.request import packaged_extract

    unfinished = out / ".unfinished"
    again = force or unfinished.is_file()
    check_output(out, force=again)
    if out.exists() and not out.is_dir():
        raise OutputExistsError(f"{out}: is a file; choose another --out")
    world, people, run, evening = (out / name for name in PARTS)
    # What else lies there stays.
    kinds = (WORLD_FOLDER, COMMUNITY_FOLDER, RUN_FOLDER, evening_folder())
    for folder, kind in zip((world, people, run, evening), kinds, strict=True):
        check_replaceable(folder, force=again, kind=kind)
    console = Console(stderr=True)
    began = time.perf_counter()
    extract = packaged_extract()
    out.mkdir(parents=True, exist_ok=True)
    unfinished.touch()  # a demo that was killed begins again without --force
    for folder in (world, people, run, evening):
        shutil.rmtree(folder, ignore_errors=True)
    console.rule("1 of 5: the world")
    world_build(WorldBuildOptions(world, extract.path, extract.lat, extract.lon, radius=extract.half, seed=seed))
    console.rule("2 of 5: its people")
    community_build(CommunityBuildOptions(world, people, seed=seed))
    with ThreadPoolExecutor(1) as beside:
        console.rule("3 of 5: half an hour of their morning; beside it, an evening in the rain with robots")
        filmed = beside.submit(_evening, world, people, evening, seed)
        simulate(RunOptions(world, people, out=run, seed=seed))
        console.rule("4 of 5: something to look at")
        replay(run)
        console.rule("5 of 5: the evening")
        print(filmed.result(), end="")
    unfinished.unlink()
    console.rule(f"done in {time.perf_counter() - began:.0f} s")
    print(f"world       {world}    map.png, previews/, meshes/*.glb, roads.xodr, roads.net.xml")
    print(f"community   {people}")
    print(f"run         {run}    replay.html, demo.mp4, metrics.json")
    print(f"evening     {evening}    film.mp4")
    print(f"to look at it:  {shlex.join(['python3', '-m', 'webbrowser', str(run / 'replay.html')])}")
    print(f"to walk through it:  {shlex.join([*_this_program(), 'play', str(world), str(people)])}")
    return 0


def _this_program() -> list[str]:
    """Return the words that start this program again: as it was started where that was as ``vico``, or as a module."""
    called = sys.argv[0]
    return [called] if Path(called).stem == "vico" else [sys.executable, "-m", "vico.cli.main"]


def _evening(world: Path, people: Path, out: Path, seed: int) -> str:
    """Simulate and film a moment of an evening in October, when lamps and windows are lit; return what was printed."""
    vico = [sys.executable, "-m", "vico.cli.main"]
    moment = ["--start", "17:45", "--date", "2026-10-20", "--utc-offset", "3", "--weather", "rain", "--steps", "36"]
    cast = ["--robots", "husky,go2,h1,drone", "--cars", "40", "--pedestrians", "80", "--junctions", "signals"]
    given = [str(world), str(people), "--out", str(out), "--observe", "none", "--seed", str(seed)]
    run = [*vico, "run", *given, *moment, *cast]
    around_the_h1 = ["--follow", "robot_2", "--view", "orbit", "--start", "24"]
    made = ["--out", str(out / _FILM), "--size", "640x360", "--fps", "15", "--samples", "1"]
    told = ""
    for command in (run, [*vico, "film", str(out), *around_the_h1, *made]):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        told += done.stdout
        if done.returncode != 0:
            raise StageError(f"demo: the evening ended with exit status {done.returncode}: {done.stderr[-2000:]}")
    return told


_WARM_UP_RADIUS = 150.0  # half the world's side, metres


def warm_up() -> int:
    """Compile the hot loops once, so that the first run starts quickly."""
    import numpy as np

    from vico.assets.people import PASSERS_BY, body_of, passer_by
    from vico.cli.run import run as simulate
    from vico.sim.robots.path_following import NEIGHBOUR, room_to_turn
    from vico.world.walkable import fill_polygon
    from vico.worldgen.request import packaged_extract

    began = time.perf_counter()
    place = packaged_extract()
    with (
        compiling_ahead(to_the_end=True),
        tempfile.TemporaryDirectory(prefix="vico-") as folder,
        redirect_stdout(io.StringIO()),
    ):
        here = Path(folder)
        world, people = here / "world", here / "people"
        # A small world, a few seconds in it and a look at it: whatever a real run compiles is compiled.
        world_build(WorldBuildOptions(world, place.path, place.lat, place.lon, radius=_WARM_UP_RADIUS))
        community_build(CommunityBuildOptions(world, people, residents=6))
        simulate(RunOptions(world, people, out=here / "run", steps=60, cars=5, pedestrians=5))
        replay(here / "run")
    # What so small a place and so short a time may not need: ramps of bridges, a robot that turns on the spot.
    ring = np.array([0.5, 2.5, 1.5])
    fill_polygon(np.zeros((4, 4), np.float32), ring, ring[::-1].copy(), np.array([0, 3]), 2.0, 1.0, 0.5)
    room_to_turn(0.0, 0.0, 1.0, np.zeros(0, NEIGHBOUR))
    for look in range(PASSERS_BY):
        body_of(passer_by(look))  # kept in the cache
    print(f"compiled and tried in {time.perf_counter() - began:.0f} s", file=sys.stderr)
    return 0


SCRIPTS = Path(__file__).parents[3] / "benchmarks"
RESIDENTS = 15
# What each script is given of the place made for it: its world, and the people in it.
_BENCHMARK_INPUTS = {"render": ("world",), "sim": ("world", "people"), "world": (), "memory": ("world", "people")}


class BenchmarkError(VicoError, RuntimeError):
    """A benchmark did not come to its end."""


def bench(
    what: Positional[Literal["render", "sim", "world", "memory"]], table: Path | None = None, json: bool = False
) -> int:
    """Measure speed and memory on this machine, on the packaged place with 15 residents.

    Example: vico bench render

    Example: vico bench world --table benchmarks/results/world.md

    Args:
        what: What to measure.
        table: Write the table to this file, too.
        json: Print the tables as JSON.
    """
    from vico.cli.machine_speed import speed_table
    from vico.worldgen.request import packaged_extract

    script = SCRIPTS / f"{what}.py"
    if not script.exists():
        raise MissingFileError(
            f"bench {what}: benchmarks come with the repository, not with the package; run it in a checkout"
        )
    with tempfile.TemporaryDirectory(prefix="vico-") as folder:
        here = Path(folder)
        parts = _BENCHMARK_INPUTS[what]
        place = packaged_extract()
        world, people = here / "world", here / "people"
        with redirect_stdout(io.StringIO()):
            if "world" in parts:
                world_build(WorldBuildOptions(world, place.path, place.lat, place.lon, radius=place.half))
            if "people" in parts:
                community_build(CommunityBuildOptions(world, people, residents=RESIDENTS))
        report = here / "report.md"
        given = [str(here / name) for name in parts]
        command = [sys.executable, str(script), *given, "--table", str(report)]
        # Stdout is ours: the report is printed once, from the file.
        done = subprocess.run(command, stdout=subprocess.DEVNULL, check=False)
        if done.returncode or not report.exists():
            raise BenchmarkError(f"bench {what}: stopped with exit status {done.returncode}; what it said is above")
        text = report.read_text(encoding="utf-8")
    speeds = speed_table()
    if table is not None:
        table.parent.mkdir(parents=True, exist_ok=True)
        table.write_text(text, encoding="utf-8")
    if json:
        (measured,) = tables_of(speeds)
        print_json({"benchmark": what, "tables": tables_of(text), "machine": measured["rows"]})
    else:
        print(f"{text}\nSeconds and megabytes: less is better. Times real time: more is better.\n\n{speeds}")
    return 0


def tables_of(text: str) -> list[dict[str, object]]:
    """Read the tables of a markdown report: the heading above each, and its rows by column."""
    found: list[dict[str, object]] = []
    heading, columns = "", None
    rows: list[dict[str, str]] = []
    for line in text.splitlines():
        if line.startswith("#"):
            heading = line.lstrip("# ")
        if not line.startswith("|"):
            columns = None
            continue
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if columns is None:
            columns, rows = cells, []
            found.append({"title": heading, "rows": rows})
        elif not all(set(cell) <= set("-: ") for cell in cells):
            rows.append(dict(zip(columns, cells, strict=True)))
    return found
