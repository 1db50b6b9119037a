"""`vico run`: a community's morning, recorded."""

from __future__ import annotations

import json as jsonlib
import shutil
import sys
from pathlib import Path
from typing import Any

from vico.agents.schedule import followers_of
from vico.cli.output import check_output, print_json, print_table, progress_bars
from vico.community import read_community
from vico.errors import InputError, OutputExistsError
from vico.sim.config import SimConfig, seconds_of_day
from vico.sim.gather import Gatherer
from vico.sim.recorder import Recorder, is_being_recorded
from vico.sim.simulation import Simulation
from vico.world.files import read_json
from vico.world.folder import World, read_world
from vico.world.public import PublicMap


def run(
    world: Path,
    community: Path,
    *,
    out: Path,
    start: str = "08:00",
    steps: int = 1800,
    robots: str = "husky,go2",
    cars: int = 30,
    pedestrians: int = 30,
    observe: str = "all",
    seed: int = 0,
    force: bool = False,
    json: bool = False,
) -> int:
    """Simulate residents who follow their schedules; record the run into `out`.

    Raises
    ------
    InputError
        If a number or a name is not usable, or the community belongs to another world.
    OutputExistsError
        If `out` holds something and `force` is not given.
    """
    if steps < 1:
        raise InputError(f"run: --steps {steps}; it has to be 1 or more")
    if is_being_recorded(out):
        raise OutputExistsError(f"{out}: a run is being recorded there right now; stop it, or --out another folder")
    cut_short = None if force else _cut_short(out)
    check_output(out, world, community, force=force or cut_short is not None)
    config = SimConfig(
        seed=seed,
        start=seconds_of_day(start),
        robots=_names(robots),
        errands=True,
        cars=cars,
        pedestrians=pedestrians,
        observe=None if observe == "all" else _names(observe),
    )
    place = read_world(world)
    people = read_community(community, place)
    if cut_short is not None:
        _restart(out, cut_short, config, place)
    with progress_bars() as report:
        report("setting the scene", 0, 1)
        # Residents act on depth, segmentation and what they hear; only the recorder looks at colours.
        sim = Simulation(place, people, config, colours_later=True)
        agents = Gatherer(followers_of(people, PublicMap.from_world(place), seed=seed))
        observations, infos = sim.observe()
        report("setting the scene", 1, 1)
        # Only now: whatever is wrong with the input has been said, and nothing was replaced for nothing.
        if out.exists():
            shutil.rmtree(out) if out.is_dir() else out.unlink()
        sources = {"world": str(world.resolve()), "community": str(community.resolve())}
        with Recorder(out, sim, sources=sources, wanted=steps) as recorder:
            recorder.begin(observations)
            for step in range(steps):
                gathered = agents.gather(observations, infos)
                result = sim.step(gathered.actions, gathered.troubles)
                observations, infos = result.observations, result.infos
                recorder.write(result)
                report("simulating", step + 1, steps)
            metrics = recorder.close()
    if json:
        print_json(metrics)
    else:
        shown = {name: value for name, value in metrics.items() if not isinstance(value, dict)}
        print_table(str(out), shown)
    return 0


def _cut_short(out: Path) -> dict[str, Any] | None:
    """What the manifest of an unfinished run in `out` says; empty if it had none yet, None if there is no such run."""
    if not out.is_dir():
        return None
    names = [path.name for path in out.iterdir()]
    if "run.json" in names:
        content = read_json(out / "run.json")
        unfinished = isinstance(content, dict) and content.get("status") in ("running", "stopped")
        return content if unfinished else None
    begun = "events.jsonl" in names and all(name == "events.jsonl" or name.startswith(".run.json.") for name in names)
    return {} if begun else None


def _restart(out: Path, found: dict[str, Any], config: SimConfig, world: World) -> None:
    """Allow an unfinished run to be replaced by the same one."""
    wanted = jsonlib.loads(jsonlib.dumps(config.record()))
    if found and (found.get("config") != wanted or found.get("world", {}).get("digest") != world.digest):
        raise OutputExistsError(
            f"{out}: holds an unfinished run with other settings; pass --force to replace it, or --out another folder"
        )
    steps = f"{found['steps']} of {found['wanted_steps']} steps" if found else "nothing recorded"
    print(f"{out}: an unfinished run ({steps}) is started anew", file=sys.stderr)


def _names(text: str) -> tuple[str, ...]:
    names = tuple(part.strip() for part in text.split(",") if part.strip())
    return () if names == ("none",) else names
