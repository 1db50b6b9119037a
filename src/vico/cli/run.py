"""`vico run`: a community's morning, recorded."""

from __future__ import annotations

import json as jsonlib
import sys
from contextlib import closing
from pathlib import Path
from typing import Any

from vico.agents.schedule import followers_of
from vico.cli.options import RunOptions
from vico.cli.output import Report, check_output, print_json, print_table, progress_bars
from vico.clock import seconds_of_day
from vico.community import Community, read_community
from vico.errors import InputError, OutputExistsError
from vico.io.files import read_json
from vico.io.folders import remove
from vico.runner.foreign import Terms, foreign_agents
from vico.runner.gather import Gatherer
from vico.runner.loading import Seat
from vico.runner.loop import Hook, Runner, Step
from vico.runner.recording import Recording
from vico.sim.config import SimConfig
from vico.sim.recorder import Recorder
from vico.sim.simulation import Simulation
from vico.threads import use_workers, workers
from vico.world.folder import World, read_world
from vico.world.public import PublicMap


def run(options: RunOptions) -> int:
    """Simulate residents who follow their schedules; record the run into ``options.out``.

    Raises
    ------
    InputError
        If a number or a name is not usable, or the community belongs to another world.
    OutputExistsError
        If the output folder holds something and ``options.force`` is not given.
    """
    steps, out = options.steps, options.out
    if steps < 1:
        raise InputError(f"run: --steps {steps}; it has to be 1 or more")
    if options.agent and not options.assistants:
        raise InputError("run: --agent plays assistants; say how many, for example --assistants 1")
    use_workers(options.workers)
    cut_short = None if options.force else _cut_short(out)
    check_output(out, options.world, options.community, force=options.force or cut_short is not None)
    config = SimConfig(
        seed=options.seed,
        assistants=options.assistants,
        start=seconds_of_day(options.start),
        robots=_names(options.robots),
        errands=True,
        cars=options.cars,
        pedestrians=options.pedestrians,
        observe=None if options.observe == "all" else _names(options.observe),
    )
    place = read_world(options.world)
    people = read_community(options.community, place)
    if cut_short is not None:
        _restart(out, cut_short, config, place)
    with progress_bars() as report:
        report("setting the scene", 0, 1)
        # Residents act on what they have in view and hear; mostly, the recorder alone looks at colours.
        sim = Simulation(place, people, config, defer_rgb=True)
        if options.check == "overlaps":
            sim.check_overlaps()
        with closing(_agents(options, place, people)) as agents:
            report("setting the scene", 1, 1)
            # Only now: whatever is wrong with the input has been said, and nothing was replaced for nothing.
            remove(out)
            sources = {"world": str(options.world.resolve()), "community": str(options.community.resolve())}
            with Recorder(out, sim, sources=sources, wanted=steps) as recorder:
                runner = Runner(sim, agents, hooks=[_Progress(report, steps), Recording(recorder)])
                runner.run(steps)
                metrics = recorder.close()
    if options.json:
        print_json(metrics)
    else:
        counted = {name: value.get("count", value) for name, value in metrics.items() if isinstance(value, dict)}
        shown = {name: value for name, value in (metrics | counted).items() if not isinstance(value, dict)}
        print_table(str(out), shown)
    return _judged(metrics)


def _judged(metrics: dict[str, Any]) -> int:
    """Return the exit code: 1 with overlaps, which are told in a sentence."""
    overlaps = metrics.get("overlaps", {"count": 0})
    if not overlaps["count"]:
        return 0
    first = overlaps["first"][0]
    print(
        f"{overlaps['pairs']} pairs overlapped in {overlaps['count']} of {overlaps['sub_steps']} sub-steps, the first: "
        f"{first['who']} with {first['with']} at {first['where']}, {1000 * first['depth']:.0f} mm; see metrics.json",
        file=sys.stderr,
    )
    return 1


class _Progress(Hook):
    """Shows how far a run is."""

    def __init__(self, report: Report, steps: int) -> None:
        self._report, self._steps = report, steps

    def stepped(self, step: Step) -> None:
        """Show it."""
        self._report("simulating", step.number, self._steps)


def _agents(options: RunOptions, place: World, people: Community) -> Gatherer:
    """Return who acts: residents who follow their schedules, and whoever plays the assistants."""
    followers = followers_of(people, PublicMap.from_world(place), seed=options.seed)
    terms = Terms(deadline=options.deadline or None, isolate=options.isolate, workers=workers())
    seats = [Seat(f"assistant_{i}", options.seed, [], i, options.assistants) for i in range(options.assistants)]
    players = foreign_agents(options.agent, seats, place, terms) if options.agent else {}
    return Gatherer(followers | players, trusted=followers, deadline=terms.deadline, workers=terms.workers)


def _cut_short(out: Path) -> dict[str, Any] | None:
    """Return the manifest of an unfinished run in `out`; empty if it had none yet, None if there is no such run."""
    if not out.is_dir():
        return None
    names = [path.name for path in out.iterdir()]
    if "run.json" in names:
        content = read_json(out / "run.json")
        unfinished = isinstance(content, dict) and content.get("status") in ("running", "stopped")
        return content if unfinished else None
    begun = bool(names) and all(name.startswith(".run.json.") for name in names)
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
