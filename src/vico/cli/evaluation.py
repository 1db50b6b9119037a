"""`vico eval`: judge methods on a challenge, and write what they came to.

The options are records: those of every evaluation, and those of each challenge. What an evaluation needs is imported
when it runs, so that `vico --help` is quick.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from functools import partial
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Literal

import tyro
from tyro.extras import SubcommandApp

from vico.cli.console import check_output, print_json
from vico.cli.leaderboard import add_to_leaderboard
from vico.cli.options import FLAT, Hosts, RayAddress, Words
from vico.errors import InputError, OutputError, OutputExistsError
from vico.io.files import is_being_written, new_folder, write_errors
from vico.threads import workers as processors
from vico.viewer.server import require_server

if TYPE_CHECKING:
    from rich.progress import TaskID

    from vico.challenges.episodes import Outcome
    from vico.challenges.evaluation import Finished
    from vico.challenges.records import Challenge, Setting
    from vico.challenges.records import Progress as ChallengeProgress
    from vico.io.stores import Store
    from vico.runner.foreign import Terms


@dataclass(frozen=True)
class EvaluationOptions:
    """What every `vico eval` is asked for."""

    #: World folders, or their URLs (s3://BUCKET/worlds/helsinki); one episode for each world, seed, category and
    #: method.
    worlds: Words
    #: Folder for tasks, episodes and results, or a URL like s3://BUCKET/results (the extra "s3"); refused if it exists,
    #: unless --resume or --force.
    out: str
    #: One of the challenge's (of assistant tasks also human: you, at a page),
    #: my_module:MyAgent (path/to/file.py:MyAgent), or two joined by +. Give it several times to judge several in the
    #: same tasks.
    method: Annotated[tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="METHOD")] = ()
    against: str = ""  # The method that the others are compared with; the first one without.
    seeds: int = 3  # Episodes a world, seeded 0, 1, ...
    first_seed: int = 0  # Or this and on.
    workers: int = 0  # Processes side by side; 0 is one a processor. Decides nothing but how long it takes.
    #: Play on a Ray cluster instead (the extra "ray"): its address; without one on that which runs here, or on one that
    #: is started for the occasion. OUT and the worlds must be on a folder that all machines share, or URLs.
    ray: RayAddress = None
    #: Go on in OUT: episodes that are there and would come to the same are kept, what is missing is played.
    resume: bool = False
    record: bool = False  # Keep each episode's run (OUT/runs), for vico replay and the viewer.
    compare: bool = False  # Put the published rows beside ours.
    leaderboard: Path | None = None  # Add what it comes to to this leaderboard file; it is made if it is not there.
    date: str | None = None  # Of the leaderboard's entries, YYYY-MM-DD; left out without.
    #: Seconds an agent of yours has for an action; who is late waits a step. 0 waits for it as long as it takes.
    deadline: float = 60.0
    #: Ask agents of yours in the process that simulates, where nothing keeps them from the truth: for a debugger.
    in_process: bool = False
    force: bool = False  # Replace what this verb made there before; refused if the folder holds anything else.
    json: bool = False  # Print the results as JSON.


Common = Annotated[EvaluationOptions, FLAT]


@dataclass(frozen=True)
class AssistantOptions:
    """What `vico eval assistant` is asked for."""

    common: Common  # What every evaluation is asked for.
    category: Literal["carry", "delivery", "search", "all"] = "delivery"  # What is asked of the assistants.
    assistants: int = 1  # How many of them work together.
    advanced: bool = False  # The harder tasks: more places to look in, half the distances.
    no_distance: bool = False  # Planners do not reckon with distances.
    steps: int = 1500  # Seconds an episode may last.
    subtasks: int = 6  # How many of the six subtasks of a task are asked for: the first ones.
    port: int = 0  # With --method human: where the page is that one plays at; 0 takes a free one.
    #: With --method human: a name, beside this machine's own, under which a proxy or a forwarded port shows the page.
    allow_host: Hosts = ()
    #: With --method human: seconds that an episode waits for a person who has not come, or has left; it counts as not
    #: played then.
    waits: float = 600.0


@dataclass(frozen=True)
class InfluenceOptions:
    """What `vico eval influence` is asked for."""

    common: Common  # What every evaluation is asked for.
    start: str = ""  # When the day of talk begins, HH:MM; the challenge's own time without.
    hours: float = 0.0  # How long it is; 0 for the challenge's own length.
    #: With bodies, or by schedule: members are where their day says, and walks take what the router says.
    simulation: Literal["full", "schedule"] = "full"
    members: Literal["model", "llm"] = "model"  # Who answers and ranks: the opinion model, or a language model.
    target_model: str = ""  # Language model that chooses whom to talk to, for methods that have one.
    dialogue_model: str = ""  # Language model that talks.
    member_model: str = ""  # Language model of the members, with ``--members llm``.


@dataclass(frozen=True)
class CommuteOptions:
    """What `vico eval commute` is asked for."""

    common: Common  # What every evaluation is asked for.
    hours: float = 0.0  # From the first leaving to the end of the day; 0 for the challenge's own.


@dataclass(frozen=True)
class TeamingOptions:
    """What `vico eval teaming` is asked for."""

    common: Common  # What every evaluation is asked for.
    category: Literal["accompany", "guide", "spot", "all"] = "all"  # Of the tasks.
    steps: int = 600  # Seconds of an episode at most.
    period: float = 0.5  # Seconds between two actions of a robot: 0.5 is 2 Hz.


@dataclass(frozen=True)
class RobotOptions:
    """What `vico eval robot` is asked for."""

    common: Common  # What every evaluation is asked for.
    category: Literal["carry", "deliver", "all"] = "all"  # Of the tasks.
    steps: int = 1500  # Seconds of an episode at most.
    period: float = 0.05  # Seconds between two actions of a robot: 0.05 is 20 Hz.
    oracle_grasp: bool = False  # Hands never lose what they closed on; without it friction alone holds.
    #: What training has written: for rl a file, for rl-decomposed the folder with both or LIFT.npz,PLACE.npz, for vla a
    #: file or a LeRobot policy's folder. With several such methods METHOD=FILE, once for each.
    policy: Annotated[tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="FILE")] = ()


evaluation = SubcommandApp()


@evaluation.command(name="assistant")
def evaluate_assistant(options: Annotated[AssistantOptions, FLAT]) -> int:
    """Judge planners on the community assistant tasks.

    Exit 0 if every episode was played, 1 if some were not (the table says why), 2 for bad input. The same command goes
    on after an interruption.

    Example: vico eval assistant --category delivery --method heuristic --worlds helsinki monaco --seeds 3 --out results

    Example: vico eval assistant --category all --method heuristic --method ours --against heuristic --assistants 2
    --worlds helsinki monaco --workers 4 --compare --out results

    Example: vico eval assistant --category search --method my_module:MyAgent --worlds helsinki --record --out mine
    """
    from vico.challenges.assistant.tasks import SUBTASKS

    if not 1 <= options.assistants <= 2:
        raise InputError(f"eval: {options.assistants} assistants; the tasks are for 1 or 2")
    if options.steps < 1:
        raise InputError("eval: needs at least one world, one seed and one step")
    setting: Setting = {
        "assistants": options.assistants,
        "advanced": options.advanced,
        "distance": not options.no_distance,
        "steps": options.steps,
    }
    if options.subtasks != SUBTASKS:
        setting = {**setting, "subtasks": options.subtasks}
    categories = None if options.category == "all" else (options.category,)
    if any("human" in method.split("+") for method in options.common.method):
        # A person plays at a page of this machine, one episode after the other, each recorded.
        from vico.cli.live import city_of, print_address
        from vico.viewer import human_evaluation

        if options.common.ray is not None:
            raise InputError("eval: --method human is played at this machine; leave out --ray")
        require_server()
        human_evaluation.AT_THE_PAGE.open(
            city=city_of, announce=print_address, port=options.port, waits=options.waits, hosts=options.allow_host
        )
        common = replace(options.common, workers=1, record=True)
        return judge(human_evaluation.CHALLENGE, categories, setting, common)
    return judge("assistant", categories, setting, options.common, methods=("heuristic",))


@evaluation.command(name="influence")
def evaluate_influence(options: Annotated[InfluenceOptions, FLAT]) -> int:
    """Judge strategies that compete for a community's friendship; a method is a pair, ours+nearest.

    Example: vico eval influence --method ours+random --method ours+nearest --worlds helsinki monaco --out results

    Example: vico eval influence --method llm+llm --target-model o1 --dialogue-model gpt-4o --worlds helsinki --out llm
    """
    if not options.hours >= 0:
        raise InputError(f"eval: --hours {options.hours:g}; give hours above 0")
    usual = InfluenceOptions(options.common)
    names = [field.name for field in fields(options) if field.name != "common"]
    asked = {name: getattr(options, name) for name in names if getattr(options, name) != getattr(usual, name)}
    return judge("influence", None, asked, options.common)


@evaluation.command(name="commute")
def evaluate_commute(options: Annotated[CommuteOptions, FLAT]) -> int:
    """Judge how agents get around on a day of commutes.

    Example: vico eval commute --method rule --method ours --worlds helsinki monaco --seeds 10 --compare --out results
    """
    if not options.hours >= 0:
        raise InputError(f"eval: --hours {options.hours:g}; give hours above 0")
    return judge("commute", None, {"hours": options.hours} if options.hours else {}, options.common)


@evaluation.command(name="robot")
def evaluate_robot(options: Annotated[RobotOptions, FLAT]) -> int:
    """Judge robots with an arm and a deck that bring things, and go along with people, by real contact.

    Example: vico eval robot --category deliver --method heuristic --method alone --worlds helsinki --out results
    Example: vico eval robot --method rl --policy runs/whole/policy.npz --worlds helsinki --out results
    """
    if options.steps < 1:
        raise InputError(f"eval: --steps {options.steps}; give seconds, 1 or more")
    categories = None if options.category == "all" else (options.category,)
    from vico.challenges.robot.arm_policies import policy_settings  # physics is slow to import

    by_oracle: Setting = {"oracle_grasp": True} if options.oracle_grasp else {}
    setting: Setting = {"steps": options.steps, "period": options.period, **by_oracle}
    policies = policy_settings(options.common.method, options.policy)
    return judge("robot", categories, setting, options.common, methods=("heuristic",), of_method=policies)


@evaluation.command(name="teaming")
def evaluate_teaming(options: Annotated[TeamingOptions, FLAT]) -> int:
    """Judge a humanoid, a quadruped and a drone at work with a person or another robot.

    Example: vico eval teaming --category guide --method heuristic --method alone --worlds helsinki --out results
    """
    if options.steps < 1:
        raise InputError(f"eval: --steps {options.steps}; give seconds, 1 or more")
    categories = None if options.category == "all" else (options.category,)
    setting: Setting = {"steps": options.steps, "period": options.period}
    return judge("teaming", categories, setting, options.common, methods=("heuristic",))


#: `evaluate` with all but where to, and who is told.
Play = Callable[..., "list[Outcome]"]


def judge(
    name: str,
    categories: Sequence[str] | None,
    setting: Setting,
    options: EvaluationOptions,
    *,
    methods: Sequence[str] = (),
    of_method: Mapping[str, Setting] | None = None,
) -> int:
    """Play the episodes; leave tasks, episodes, ``results.json`` and ``results.md`` in ``options.out``.

    Until all are over they are in a neighbour, ``OUT.partial``; the same command goes on there after an interruption.
    In an object store they are where they stay.

    Parameters
    ----------
    categories
        All of the challenge's if None.
    methods
        If none are asked for.
    of_method
        What the setting says of single methods beside.

    Returns
    -------
    int
        1 if some could not be played, else 0.
    """
    from vico.challenges.evaluation import evaluate, jobs_for
    from vico.challenges.records import load_challenge
    from vico.io.stores import is_url
    from vico.world.folder import fetch_manifest, read_world

    challenge = load_challenge(name)
    methods = options.method or methods
    if not methods:
        raise InputError(f"eval: needs a --method; there are {', '.join(sorted(challenge.methods))}")
    if options.against and options.against not in methods:
        raise InputError(f"eval: --against {options.against}, which is none of the methods; add --method")
    given = list(chain(*options.worlds))
    worlds = {fetch_manifest(one) if is_url(one) else Path(one): one for one in given}
    if len(worlds) < len(given):
        raise InputError(f"{name}: a world is given twice; its episodes would count twice")
    jobs = jobs_for(
        name,
        categories=categories or challenge.categories,
        methods=methods,
        setting=setting,
        worlds=list(worlds),
        seeds=options.seeds,
        first_seed=options.first_seed,
        terms=_terms(challenge, methods, next(iter(worlds), Path()), options),
    )
    jobs = [replace(job, setting={**job.setting, **(of_method or {}).get(job.method, {})}) for job in jobs]
    if not 0 <= options.workers <= 256:
        raise InputError(f"--workers {options.workers}; give a number of processes in 1..256, or 0 for one a processor")
    for path in worlds:
        read_world(path)  # a world that is none is said before anything is played
    play = partial(
        evaluate,
        name,
        [replace(job, world_url=worlds[job.world]) if is_url(worlds[job.world]) else job for job in jobs],
        workers=options.workers or processors(),
        ray=options.ray,
        record=options.record,
    )
    written = _in_store if is_url(options.out) else _in_folder
    with written(challenge, play, options) as (folder, outcomes):
        _print_results(challenge, outcomes, options)
        if options.leaderboard is not None:
            add_to_leaderboard(folder, file=options.leaderboard, date=options.date, replace=False, quiet=options.json)
    return 1 if any(outcome.record is None for outcome in outcomes) else 0


@contextmanager
def _in_folder(challenge: Challenge, play: Play, options: EvaluationOptions) -> Iterator[tuple[Path, list[Outcome]]]:
    """Play the jobs, and write the results beside the episodes; give their folder and the outcomes."""
    from vico.challenges.tables.results import EVALUATION_FOLDER
    from vico.io.stores import is_url

    out = Path(options.out)
    check_output(
        out,
        *(Path(one) for one in chain(*options.worlds) if not is_url(one)),
        force=options.force or options.resume,
        kind=None if options.resume else EVALUATION_FOLDER,
    )
    partial_folder = out.with_name(f"{out.name}.partial")
    if options.resume:
        _allow_resume(out, partial_folder)
    with new_folder(out, force=options.force, work=partial_folder, kind=EVALUATION_FOLDER) as folder:
        outcomes = _play_jobs(play, folder)
        _write(folder, challenge, outcomes, options)
    yield out, outcomes


@contextmanager
def _in_store(challenge: Challenge, play: Play, options: EvaluationOptions) -> Iterator[tuple[Path, list[Outcome]]]:
    """Play the jobs, and copy the results to the store, ``results.json`` last: where that is, an evaluation is over."""
    from vico.io.stores import store_at

    store = store_at(options.out)
    if store.has("results.json") and not options.resume:
        if not options.force:
            raise OutputExistsError(
                f"{store}: exists already; go on with --resume, choose another --out, or replace it with --force"
            )
        store.remove("")
    outcomes = _play_jobs(play, store)
    with TemporaryDirectory(prefix="vico-") as temporary:
        folder = Path(temporary)
        _write(folder, challenge, outcomes, options)
        for path in sorted(folder.iterdir(), key=lambda path: path.name == "results.json"):
            store.write(path.name, path.read_bytes())
        yield folder, outcomes


def _play_jobs(play: Play, where: Path | Store) -> list[Outcome]:
    with _reporting() as (progress, finished):
        return play(where, progress=progress, finished=finished)


def _write(folder: Path, challenge: Challenge, outcomes: Sequence[Outcome], options: EvaluationOptions) -> None:
    from vico.challenges.tables.results import published_rows, write_results

    published = published_rows(challenge.name, outcomes[0].job.setting) if options.compare else ()
    write_results(folder, challenge, outcomes, reference=options.against, published=published)


def _print_results(challenge: Challenge, outcomes: Sequence[Outcome], options: EvaluationOptions) -> None:
    """Print the results, and to stderr what went wrong."""
    from vico.challenges.tables.results import (
        fault_lines,
        not_played_lines,
        published_rows,
        results_content,
        results_page,
        time_lines,
    )
    from vico.challenges.tables.summary import summarise

    summary = summarise(challenge, outcomes, reference=options.against)
    if options.json:
        print_json(results_content(challenge, summary, outcomes))
    else:
        published = published_rows(challenge.name, summary.setting) if options.compare else ()
        print(results_page(challenge, summary, outcomes, published=published))
        print(f"{options.out.rstrip('/')}/results.json")
    for line in time_lines(summary):
        print(line, file=sys.stderr)
    for line in [*fault_lines(outcomes), *(f"not played: {line}" for line in not_played_lines(outcomes))]:
        print(line, file=sys.stderr)


def _terms(challenge: Challenge, methods: Sequence[str], world: Path, options: EvaluationOptions) -> Terms:
    """Return on which terms agents from elsewhere take part; what is wrong with their names is said here."""
    from vico.challenges.records import foreign_parts
    from vico.runner.foreign import Terms, check_loads
    from vico.runner.loading import load_agent

    foreign = [part for method in methods for part in foreign_parts(challenge, method) if ":" in part]
    if not foreign:
        return Terms()
    for part in dict.fromkeys(foreign):
        if options.in_process:
            load_agent(part)
        else:
            check_loads(part, world)
    return Terms(deadline=options.deadline or None, isolate=not options.in_process, workers=processors())


def _allow_resume(out: Path, partial: Path) -> None:
    """Let an evaluation that was finished go on."""
    if not out.is_dir() or partial.exists():
        return
    if not (out / "episodes").is_dir() and any(out.iterdir()):
        raise InputError(f"--resume: {out} holds no evaluation; choose another --out")
    if is_being_written(out):
        raise OutputError(f"{out}: another process is writing it right now; stop that one, or choose another folder")
    with write_errors(partial):
        os.replace(out, partial)


@contextmanager
def _reporting() -> Iterator[tuple[ChallengeProgress | None, Finished]]:
    """Give what tells of episodes on stderr: bars on a terminal, a line for each that is over elsewhere."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    from vico.challenges.episodes import label_of

    console = Console(file=sys.stderr)
    if not console.is_terminal:
        yield None, _print_outcome
        return
    columns = (TextColumn("{task.description}"), BarColumn(bar_width=30), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, refresh_per_second=4, transient=True) as bars:
        whole = bars.add_task("episodes", total=None)
        tasks: dict[str, TaskID] = {}

        def progress(label: str, step: int, limit: int) -> None:
            if label not in tasks:
                tasks[label] = bars.add_task(label, total=limit)
            bars.update(tasks[label], completed=step, total=limit)

        def close_bar(outcome: Outcome, done: int, total: int) -> None:
            bars.update(whole, completed=done, total=total)
            label = label_of(outcome.job)
            if label in tasks:
                bars.remove_task(tasks.pop(label))

        yield progress, close_bar


def _print_outcome(outcome: Outcome, done: int, total: int) -> None:
    """Say on stderr what an episode came to."""
    from vico.challenges.episodes import label_of

    record = outcome.record
    if record is None:
        what = f"not played: {outcome.reason}"
    else:
        metrics = ", ".join(f"{key} {value:.4g}" for key, value in record.metrics.items())
        what = f"{metrics}; {'kept' if outcome.kept else f'{record.wall_seconds:.1f} s'}"
    print(f"{done} of {total}: {label_of(outcome.job)}: {what}", file=sys.stderr, flush=True)
