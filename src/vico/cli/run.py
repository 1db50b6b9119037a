"""`vico run`: a community's morning, recorded; cut short, it goes on where it was."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import TypeAdapter, ValidationError

from vico.agents.base import Agent
from vico.agents.human import PERIOD
from vico.agents.schedule import followers_of
from vico.agents.talk.language_model import LlmTalk
from vico.assets.robots import robot_kind
from vico.cli.compiling import compiling_ahead
from vico.cli.console import (
    CommandInterrupted,
    Report,
    StopRequest,
    check_output,
    print_json,
    print_table,
    progress_bars,
    stopped_between_steps,
)
from vico.cli.live import LIVE, live_viewer, wait_for_interrupt
from vico.cli.options import RunOptions, split_names
from vico.clock import seconds_of_day
from vico.community import Community, read_community, read_names
from vico.errors import InputError, OutputExistsError, SchemaError
from vico.io.files import check_replaceable, read_json, remove_path
from vico.llm import LanguageModel, Sampling
from vico.runner.control import Control
from vico.runner.foreign import Terms, foreign_agents
from vico.runner.gather import FaultLog, Gatherer
from vico.runner.loading import AgentSeat
from vico.runner.loop import Hook, Runner, Step
from vico.runner.recording import RecordedRun, branched_run, go_on_from
from vico.sim.config import SimConfig, find_by_name
from vico.sim.environment.environment import first_date
from vico.sim.loop.simulation import Simulation
from vico.sim.recording.interventions import InterventionLine, read_interventions
from vico.sim.recording.manifest import read_manifest
from vico.sim.recording.recorder import Recorder
from vico.sim.recording.schema import RUN_FOLDER, checkpoint_steps
from vico.sim.traffic.placement import NoRoomError
from vico.threads import use_workers, workers
from vico.world.folder import read_world
from vico.world.public import PublicMap
from vico.world.world import World

if TYPE_CHECKING:
    from vico.viewer.live import LiveViewer
    from vico.viewer.play import PlayedAgent
#: Steps between checkpoints unless a run says otherwise.
STATES_EVERY = 300

# Metres that are free around who is played, at least, where they start.
_PLAYED_ROOM = {"robot": 1.2, "assistant": 0.6}

# Options that decide nothing of what is in the run folder; the others are kept in its run.json.
_DEFAULTS = {field.name: field.default for field in fields(RunOptions)}
#: What the numbers of a run count, and which way is good.
_MEANINGS = {
    "steps": "steps that were simulated",
    "wall_seconds": "seconds that took",
    "real_time_factor": "simulated seconds in one of these; more is better",
    "peak_rss_mb": "megabytes of memory at most",
    "state_hash": "the same for the same version, settings and seed",
    "collisions": "motions that ended at a person, a wall or a thing; a few an hour and person are usual",
    "refused": "actions that could not be done; 0 is best",
    "arrivals": "places of schedules that were reached",
    "late": "of these, after the time to be there; 0 is best",
    "observations": "observations that agents were given",
    "rescued": "vehicles that were taken out of jams; 0 is best",
    "stuck": "vehicles in a jam at the end; metrics.json says where and why",
    "reentered": "cars that left the map and came in elsewhere; neither good nor bad",
    "junctions": "rule of the junctions",
}
# Cars and pedestrians of a run that is asked for none in particular.
_TRAFFIC = 30
_NOT_KEPT = ("out", "resume", "workers", "force", "json", *LIVE)


def run(options: RunOptions) -> int:
    """Simulate residents who follow their schedules; record the run into ``options.out``.

    Raises
    ------
    InputError
        If a number or a name is not usable, or the community belongs to another world.
    OutputExistsError
        If the output folder holds something and ``options.force`` is not given.
    """
    if options.resume is not None:
        options = _resumed_options(options, options.resume)
    if options.world is None or options.community is None or options.out is None:
        raise InputError(
            "run: give WORLD, COMMUNITY and --out OUT, or --resume OUT for a run that was cut short; "
            "see vico run --help"
        )
    if options.steps < 1:
        raise InputError(f"run: --steps {options.steps}; it has to be 1 or more")
    if options.agent and not options.assistants:
        raise InputError("run: --agent plays assistants; say how many, for example --assistants 1")
    talk = _talk_of(options)
    use_workers(options.workers)
    parts = ("pictures", "people") if options.observe != "none" else ("people",)
    with compiling_ahead(parts):
        metrics = Job.of(options, options.world, options.community, options.out, talk=talk).simulate()
    if options.json:
        print_json(metrics)
    else:
        counted = {name: value.get("count", value) for name, value in metrics.items() if isinstance(value, dict)}
        shown = {name: value for name, value in (metrics | counted).items() if not isinstance(value, dict)}
        print_table(str(options.out), shown, _MEANINGS)
    if talk is not None:
        why = f" ({talk.reason})" if talk.reason else ""
        tokens = talk.usage.read + talk.usage.written
        print(
            f"{talk.answered} answers of residents by the language model, {tokens} tokens; "
            f"{talk.fallbacks} left to templates{why}",
            file=sys.stderr,
        )
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


def named_or_read(text: str) -> str | dict[str, Any]:
    """Return what an option names, of weather or events: itself, or the content of a file."""
    return read_json(Path(text)) if text.endswith(".json") else text


def _talk_of(options: RunOptions) -> LlmTalk | None:
    """Return what words the residents' answers; None for templates.

    Raises
    ------
    InputError
        If a language model is to, and the environment names none that can be used.
    """
    if options.talk == "templates":
        return None
    try:
        return LlmTalk(LanguageModel.from_environment(sampling=Sampling(seed=options.seed, temperature=0.0)))
    except InputError as error:
        raise InputError(f"run: --talk llm: {error}; or leave --talk out") from None


@dataclass(frozen=True)
class Job:
    """A run that is about to begin or to go on.

    Attributes
    ----------
    found
        Manifest of the unfinished run that is in `out`; empty if it had none yet, None if nothing is there.
    talk
        What words the residents' answers; None for templates.
    played
        Who is played by a person at the page; None for nobody.
    """

    options: RunOptions
    out: Path
    world: World
    community: Community
    config: SimConfig
    sources: dict[str, str]
    found: dict[str, Any] | None
    talk: LlmTalk | None = None
    played: PlayedAgent | None = None

    @classmethod
    def of(
        cls,
        options: RunOptions,
        world: Path,
        community: Path,
        out: Path,
        *,
        talk: LlmTalk | None = None,
        played: PlayedAgent | None = None,
    ) -> Job:
        """Read what is needed, and look at what is in the output folder."""
        unused = [name for name in LIVE if getattr(options, name) != _DEFAULTS[name]]
        if unused and not options.live:
            option = unused[0].replace("_", "-")
            raise InputError(f"run: --{option} is for the page of a run that is shown; add --live, or leave it out")
        for name in _names(options.robots):
            robot_kind(name)
        # A name that is not right is said before a large world is read.
        names = names_of(community, _names(options.robots), options.assistants)
        asked = () if options.observe == "all" else _names(options.observe)
        observe = tuple(find_by_name(name, names, option="run: --observe") for name in asked)
        worn = _worn_files(options.wear, names)
        found = None if options.force else _unfinished_manifest(out)
        kind = RUN_FOLDER if options.force else None
        check_output(out, world, community, force=options.force or found is not None, kind=kind)
        place = read_world(world)
        config = SimConfig(
            seed=options.seed,
            assistants=options.assistants,
            start=seconds_of_day(options.start),
            date=options.date,
            utc_offset=options.utc_offset,
            weather=named_or_read(options.weather),
            events=named_or_read(options.events),
            opening_hours=options.opening_hours,
            robots=_names(options.robots),
            robot_places=_places("robot", options.robot_places, place, played),
            assistant_places=_places("assistant", options.assistant_places, place, played),
            physics=options.physics,
            errands=True,
            cars=_TRAFFIC if options.cars is None else options.cars,
            cyclists=options.cyclists,
            pedestrians=_TRAFFIC if options.pedestrians is None else options.pedestrians,
            junctions=options.junctions,
            traffic=named_or_read(options.traffic),
            observe=None if options.observe == "all" else observe,
            outputs=_names(options.outputs),
            quality=options.quality,
            renderer=options.renderer,
            memory=options.memory,
            cameras=read_json(options.cameras) if options.cameras is not None else {},
            worn=worn,
            periods={} if played is None else {played.agent: PERIOD},
        )
        people = read_community(community, place)
        if options.date is not None and first_date(options.date) != people.date:
            print(
                f"{community}: its schedules are of {people.weekday} {people.date}; the run is on {options.date}, as "
                "--date says",
                file=sys.stderr,
            )
        sources = {"world": str(world.resolve()), "community": str(community.resolve())}
        return cls(options, out, place, people, config, sources, found, talk, played)

    def simulate(self) -> dict[str, Any]:
        """Do it; return its metrics.

        Raises
        ------
        Stopped
            If a signal asked the run to end before all its steps were made; what was made is kept.
        """
        options = self.options
        goes_on = self._goes_on()
        script = read_interventions(options.interventions) if options.interventions is not None else []
        with ExitStack() as stack:
            report = stack.enter_context(progress_bars())
            report("setting the scene", 0, 1)
            agents = stack.enter_context(closing(self._agents()))
            every = _states_every(options, agents)
            control = self._control(script, manageable=bool(every))
            viewer = self._viewer(stack, control) if options.live else None
            leg = self._begin(agents, every, goes_on=goes_on, control=control)
            report("setting the scene", 1, 1)
            while True:
                with stopped_between_steps(control.stop_soon if control is not None else lambda: None) as asked:
                    metrics = self._go(leg, control, viewer, report, asked)
                if asked or control is None or control.switch is None:
                    break
                leg = self._switch_branch(leg, control)
            if metrics["steps"] < options.steps:
                kept = self._told_of_rest(leg, metrics["steps"])
                if asked:
                    raise CommandInterrupted(asked.number, kept)
                print(kept, file=sys.stderr)
            if viewer is not None and control is not None:
                control.end()
                wait_for_interrupt(f"the run is over; {viewer.url} still shows it (Ctrl+C ends)")
            return metrics

    def _viewer(self, stack: ExitStack, control: Control | None) -> LiveViewer:
        if self.played is not None:
            stack.callback(self.played.human.close, "the run has ended")
        return stack.enter_context(live_viewer(self.options, self.world, control, self.played))

    def _control(self, script: list[InterventionLine], *, manageable: bool) -> Control | None:
        """Return what lets hands reach into the run; None where none are to."""
        options = self.options
        if not options.live and not script:
            return None
        speed, paused = (options.speed, options.paused) if options.live else (0.0, False)
        return Control(self.out, script=script, manageable=manageable, speed=speed, paused=paused)

    def _begin(self, agents: Gatherer, every: int, *, goes_on: bool, control: Control | None) -> Leg:
        """Set the scene, and open the recording or go on with it."""
        sim, faults = self._simulation(), FaultLog()
        if goes_on:
            return self._resume(sim, agents, every, self.out, control)
        # Only now: whatever is wrong with the input has been said, nothing was replaced for nothing.
        check_replaceable(self.out, force=True, kind=RUN_FOLDER)
        remove_path(self.out)
        how = self._how(every)
        how["notes"]["faults"] = faults.record()
        return Leg(sim, agents, Recorder(self.out, sim, **how), faults, every)

    def _resume(
        self, sim: Simulation, agents: Gatherer, every: int, out: Path, control: Control | None, **notes: Any
    ) -> Leg:
        """Go on with a recording from its last checkpoint."""
        how = self._how(every)
        how["notes"] |= notes
        recorder, checkpoint = Recorder.resume(out, sim, **how)
        faults = go_on_from(checkpoint, agents, sim)
        recorder.notes["faults"] = faults.record()
        if control is not None:
            control.restore(checkpoint.notes, out=out, step=checkpoint.step)
        return Leg(sim, agents, recorder, faults, every)

    def _switch_branch(self, leg: Leg, control: Control) -> Leg:
        """Go on from a checkpoint in a sibling of the run's folder; the run so far stays whole."""
        assert control.switch is not None
        step, name, _ = control.switch
        out = branched_run(leg.recorder.out, step, name)
        return self._resume(
            self._simulation(),
            leg.agents,
            leg.every,
            out,
            control,
            branch_of={"run": leg.recorder.out.name, "step": step},
        )

    def _simulation(self) -> Simulation:
        # Residents act on what they have in view and hear; mostly, the recorder alone looks at pictures.
        config = self.config
        while True:
            try:
                sim = Simulation(self.world, self.community, config, defer_pictures=True)
                break
            except NoRoomError as error:
                if getattr(self.options, error.kind) is not None:
                    raise InputError(f"{error}: --{error.kind} {error.room}") from None
                # Nobody asked for so many: a small window has as many as it has room for.
                print(f"{self.options.world}: there is room for {error.room} {error.kind}", file=sys.stderr)
                room: dict[str, Any] = {error.kind: error.room}
                config = replace(config, **room)
        if self.options.check == "overlaps":
            sim.check_overlaps()
        return sim

    def _how(self, every: int) -> dict[str, Any]:
        """Return what recorders are asked for."""
        how: dict[str, Any] = {
            "sources": self.sources,
            "wanted": self.options.steps,
            "states_every": every or None,
            "keep": _names(self.options.keep),
        }
        played = {} if self.played is None else {"played": self.played.agent}
        return how | {"notes": {"command": self._command()} | played}

    def _told_of_rest(self, leg: Leg, steps: int) -> str:
        """Say of a run that was stopped how it is gone on with."""
        out, options = leg.recorder.out, self.options
        kept = checkpoint_steps(out)
        told = f"{out}: stopped after step {steps} of {options.steps}"
        if not kept:
            return f"{told}; it has no checkpoint to go on from, and can be looked at: vico view {_quote(out)}"
        since = "" if kept[-1] == steps else f" from its last checkpoint, step {kept[-1]},"
        if self.played is not None:
            return f"{told}; go on{since} with: the same command, with --as {self.played.agent} --out {_quote(out)}"
        command = f"vico run --resume {_quote(out)}"
        command += f" --agent {shlex.quote(options.agent)}" if options.agent else ""
        command += " --live" if options.live else ""
        return f"{told}; go on{since} with: {command}"

    def _go(
        self, leg: Leg, control: Control | None, viewer: LiveViewer | None, report: Report, asked: StopRequest
    ) -> dict[str, Any]:
        """Run until the end, until it is to stop or to go on elsewhere; return the metrics."""
        steps, notes = self.options.steps, None if control is None else control.notes
        with leg.recorder as recorder:
            hooks: list[Hook] = [_Progress(report, steps), RecordedRun(recorder, leg.faults, notes=notes)]
            if viewer is not None:
                viewer.show(recorder, leg.agents)
                hooks.append(viewer)
            director = None if control is None else control.before_step
            runner = Runner(
                leg.sim, leg.agents, hooks=hooks, states_every=leg.every, faults=leg.faults, director=director
            )
            runner.run(steps, until=lambda: bool(asked) or (control is not None and control.over))
            elsewhere = control is not None and control.switch is not None and not asked
            if leg.sim.metrics.steps < steps and not elsewhere and (leg.every or self.options.states_every == 0):
                # Nothing that was simulated is simulated again when the run goes on.
                leg.agents.wait_for_busy()
                runner.save()
            return recorder.close("complete" if leg.sim.metrics.steps >= steps else "stopped")

    def _agents(self) -> Gatherer:
        """Return who acts: residents who follow their schedules, and whoever plays the assistants."""
        options = self.options
        followers = followers_of(self.community, PublicMap.from_world(self.world), seed=options.seed, talk=self.talk)
        terms = Terms(deadline=options.deadline or None, isolate=options.isolate, workers=workers())
        seats = [
            AgentSeat(f"assistant_{i}", options.seed, [], i, options.assistants) for i in range(options.assistants)
        ]
        players = foreign_agents(options.agent, seats, self.world, terms) if options.agent else {}
        everybody: dict[str, Agent] = followers | players
        trusted = set(followers)
        if self.played is not None:
            everybody[self.played.agent] = self.played.human
            trusted.add(self.played.agent)
        return Gatherer(everybody, trusted=trusted, deadline=terms.deadline, workers=terms.workers)

    def _command(self) -> dict[str, Any]:
        """Return the options that decide the run, as JSON has them."""
        kept = asdict(self.options) | self.sources
        for name in ("cameras", "interventions"):
            kept[name] = None if kept[name] is None else str(kept[name])
        return {name: value for name, value in kept.items() if name not in _NOT_KEPT}

    def _goes_on(self) -> bool:
        """Whether an unfinished run is gone on with; say what becomes of it.

        Raises
        ------
        OutputExistsError
            If it is one with other settings.
        """
        if self.found is None:
            return False
        if not self.found:
            print(f"{self.out}: an unfinished run (nothing recorded) is started anew", file=sys.stderr)
            return False
        wanted = self._command()
        same = self.found.get("world", {}).get("digest") == self.world.digest
        # World and community may have been moved since.
        same &= self.found.get("played") == (None if self.played is None else self.played.agent)
        if not same or _without_sources(self.found.get("command")) != _without_sources(wanted):
            raise OutputExistsError(
                f"{self.out}: holds an unfinished run with other settings; pass --force to replace it, or --out "
                "another folder"
            )
        checkpoints = checkpoint_steps(self.out)
        what = f"goes on after step {checkpoints[-1]}" if checkpoints else "has no checkpoint yet and is started anew"
        steps = f"{self.found['steps']} of {self.found['wanted_steps']} steps"
        print(f"{self.out}: an unfinished run ({steps}) {what}", file=sys.stderr)
        return bool(checkpoints)


@dataclass(frozen=True)
class Leg:
    """A run as far as it goes on in one folder."""

    sim: Simulation
    agents: Gatherer
    recorder: Recorder
    faults: FaultLog
    every: int


class _Progress(Hook):
    """Shows how far a run is."""

    def __init__(self, report: Report, steps: int) -> None:
        self._report, self._steps = report, steps

    def on_step(self, step: Step) -> None:
        """Show it."""
        self._report("simulating", step.number, self._steps)


def _quote(path: Path) -> str:
    return shlex.quote(str(path))


def _states_every(options: RunOptions, agents: Gatherer) -> int:
    """Return after how many steps there is a checkpoint; 0 for never.

    Raises
    ------
    InputError
        If checkpoints are asked for, and an agent has no state.
    """
    asked = options.states_every
    if asked is not None and asked < 0:
        raise InputError(f"run: --states-every {asked}; it has to be 0 or more")
    failures = agents.states()[1] if asked != 0 else {}
    for name, failure in failures.items():
        if asked:
            raise InputError(f"{name}: {failure.reason}")
        print(f"vico: this run cannot go on if it is cut short: {name}: {failure.reason}", file=sys.stderr)
        return 0
    return STATES_EVERY if asked is None else asked


def _resumed_options(options: RunOptions, out: Path) -> RunOptions:
    """Return the options a run was begun with.

    Raises
    ------
    InputError
        If it is complete, was played by a person, or options are given that it has of its own.
    SchemaError
        If it does not say how it was begun.
    """
    usual = RunOptions()
    taken = {name: getattr(usual, name) for name in ("resume", "agent", "workers", "json", *LIVE)}
    if replace(options, **taken) != usual:
        raise InputError("run: --resume takes everything but --agent, --workers, --json and --live from the run itself")
    manifest = read_manifest(out)
    if manifest["status"] == "complete":
        raise InputError(f"{out}: the run is complete; there is nothing to go on with")
    if played := manifest.get("played"):
        raise InputError(
            f"{out}: {played} was played by a person; go on with the command that began it: "
            f"vico play ... --as {played} --out {out}"
        )
    try:
        begun = TypeAdapter(RunOptions).validate_python(manifest.get("command"))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "command"
        raise SchemaError(f"{out}/run.json: {where}: {first['msg']}; give the command that began the run") from None
    if begun.agent != options.agent:
        # Code is named by who gives the command, never by a file that may come from anywhere.
        named = f"--agent {begun.agent}" if begun.agent else "no --agent"
        raise InputError(f"{out}: was begun with {named}; give the same with --resume")
    live = {name: getattr(options, name) for name in LIVE}
    return replace(begun, out=out, workers=options.workers, json=options.json, **live)


def _unfinished_manifest(out: Path) -> dict[str, Any] | None:
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


def _without_sources(command: Any) -> Any:
    return {n: v for n, v in command.items() if n not in ("world", "community")} if isinstance(command, dict) else None


def names_of(community: Path, robots: Sequence[str], assistants: int) -> dict[str, str]:
    """Return what all who are to act are called, by agent's name: people, assistants, and robots by their models."""
    beside = {f"assistant_{i}": f"assistant {i}" for i in range(assistants)}
    return (
        read_names(community)
        | beside
        | {f"robot_{k}": f"{model.partition(':')[0]} {k}" for k, model in enumerate(robots)}
    )


def _worn_files(text: str, names: Mapping[str, str]) -> dict[str, str]:
    """Return files by agent's name, of ``NAME=FILE,...``."""
    found = {}
    for entry in _names(text):
        name, is_pair, path = entry.partition("=")
        if not is_pair or not Path(path).is_file():
            raise InputError(f"run: --wear {entry!r}: give NAME=FILE.glb, a file that is there")
        found[find_by_name(name, names, option="run: --wear")] = str(Path(path).resolve())
    return found


def _places(kind: str, given: Path | None, world: World, played: PlayedAgent | None) -> Mapping[str, Sequence[float]]:
    """Return where robots or assistants start: as a file says, and who is played where there is something to see."""
    if given is not None or played is None or not played.agent.startswith(f"{kind}_"):
        return read_json(given) if given is not None else {}
    from vico.viewer.play import busy_sidewalk_spot

    return {played.agent: busy_sidewalk_spot(world, clearance=_PLAYED_ROOM[kind])}


def _names(text: str) -> tuple[str, ...]:
    names = tuple(split_names(text))
    return () if names == ("none",) else names
