"""`vico demo`: the main job, once, from the packaged map to a page one can look at."""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from vico.cli import community as community_verb
from vico.cli import replay as replay_verb
from vico.cli import run as run_verb
from vico.cli import world as world_verb
from vico.cli.options import CommunityBuildOptions, RunOptions
from vico.cli.output import check_output
from vico.community.folder import COMMUNITY_FOLDER
from vico.errors import OutputExistsError, StageError
from vico.io.files import check_replaceable
from vico.sim.recording.schema import RUN_FOLDER
from vico.world.world import WORLD_FOLDER
from vico.worldgen.packaged import packaged_extract
from vico.worldgen.sources import Sources

#: A run with the film of it.
EVENING = replace(RUN_FOLDER, patterns=lambda folder: (*RUN_FOLDER.patterns(folder), _FILM))
_FILM = "film.mp4"
#: Folders that the demo makes, in the order in which it makes them.
PARTS = ("world", "community", "run", "evening")


def demo(out: Path, *, seed: int = 0, force: bool = False) -> int:
    """Build central Helsinki, people it, simulate half an hour from 08:00 and a rainy evening, show both."""
    unfinished = out / ".unfinished"
    again = force or unfinished.is_file()
    check_output(out, force=again)
    if out.exists() and not out.is_dir():
        raise OutputExistsError(f"{out}: is a file; choose another --out")
    world, people, run, evening = (out / name for name in PARTS)
    # What else lies there stays.
    for folder, kind in ((world, WORLD_FOLDER), (people, COMMUNITY_FOLDER), (run, RUN_FOLDER), (evening, EVENING)):
        check_replaceable(folder, force=again, kind=kind)
    console = Console(stderr=True)
    began = time.perf_counter()
    extract = packaged_extract()
    out.mkdir(parents=True, exist_ok=True)
    unfinished.touch()  # a demo that was killed begins again without --force
    for folder in (world, people, run, evening):
        shutil.rmtree(folder, ignore_errors=True)
    console.rule("1 of 5: the world")
    world_verb.build(Sources(extract.path), out=world, centre=(extract.lat, extract.lon), half=extract.half, seed=seed)
    console.rule("2 of 5: its people")
    community_verb.build(CommunityBuildOptions(world, people, seed=seed))
    with ThreadPoolExecutor(1) as beside:
        console.rule("3 of 5: half an hour of their morning; beside it, an evening in the rain with robots")
        filmed = beside.submit(_evening, world, people, evening, seed)
        run_verb.run(RunOptions(world, people, out=run, seed=seed))
        console.rule("4 of 5: something to look at")
        replay_verb.replay(run, film=True)
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
    run = [
        *vico,
        "run",
        str(world),
        str(people),
        "--out",
        str(out),
        *moment,
        *cast,
        "--observe",
        "none",
        "--seed",
        str(seed),
    ]
    around_the_h1 = ["--follow", "robot_2", "--view", "orbit", "--start", "24"]
    made = ["--out", str(out / _FILM), "--size", "640x360", "--fps", "15", "--samples", "1"]
    told = ""
    for command in (run, [*vico, "film", str(out), *around_the_h1, *made]):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        told += done.stdout
        if done.returncode != 0:
            raise StageError(f"demo: the evening ended with exit status {done.returncode}: {done.stderr[-2000:]}")
    return told
