"""`vico demo`: the main job, once, from the packaged map to a page one can look at."""

from __future__ import annotations

import shutil
import time
from pathlib import Path

from rich.console import Console

from vico.cli import community as community_verb
from vico.cli import replay as replay_verb
from vico.cli import run as run_verb
from vico.cli import world as world_verb
from vico.cli.options import RunOptions
from vico.cli.output import check_output
from vico.worldgen.packaged import packaged_extract
from vico.worldgen.sources import Sources


def demo(out: Path, *, seed: int = 0, force: bool = False) -> int:
    """Build central Helsinki, people it, simulate half an hour from 08:00, and make the page and the film."""
    unfinished = out / ".unfinished"
    check_output(out, force=force or unfinished.is_file())
    if out.exists() and not out.is_dir():
        out.unlink()
    world, people, run = out / "world", out / "community", out / "run"
    console = Console(stderr=True)
    began = time.perf_counter()
    extract = packaged_extract()
    out.mkdir(parents=True, exist_ok=True)
    unfinished.touch()  # a demo that was killed begins again without --force
    for folder in (world, people, run):
        shutil.rmtree(folder, ignore_errors=True)
    console.rule("1 of 4: the world")
    world_verb.build(Sources(extract.path), out=world, centre=(extract.lat, extract.lon), half=extract.half, seed=seed)
    console.rule("2 of 4: its people")
    community_verb.build(world, out=people, residents=15, seed=seed, force=False, json=False)
    console.rule("3 of 4: half an hour of their morning")
    run_verb.run(RunOptions(world, people, out=run, seed=seed))
    console.rule("4 of 4: something to look at")
    replay_verb.replay(run, film=True)
    unfinished.unlink()
    console.rule(f"done in {time.perf_counter() - began:.0f} s")
    print(f"world       {world}    map.png, previews/, meshes/*.glb, roads.xodr, roads.net.xml")
    print(f"community   {people}")
    print(f"run         {run}    replay.html, demo.mp4, metrics.json")
    print(f"to look at it:  python3 -m webbrowser {run / 'replay.html'}")
    return 0
