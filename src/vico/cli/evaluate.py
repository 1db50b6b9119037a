"""`vico eval`: judge methods on a challenge, and write what they came to."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields, replace
from functools import partial
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

from vico.challenges.assistant.tasks import SUBTASKS
from vico.challenges.episodes import Outcome, label_of
from vico.challenges.evaluation import Finished, evaluate, jobs_for
from vico.challenges.records import Challenge, Setting, foreign_parts, load_challenge
from vico.challenges.records import Progress as Told
from vico.challenges.tables.results import (
    EVALUATION_FOLDER,
    fault_lines,
    not_played_lines,
    published_rows,
    results_content,
    results_page,
    time_lines,
    write_results,
)
from vico.challenges.tables.summary import summarise
from vico.cli.evaluation_options import (
    AssistantOptions,
    CommuteOptions,
    EvaluationOptions,
    InfluenceOptions,
    RobotOptions,
    TeamingOptions,
)
from vico.cli.leaderboard import add_to_leaderboard
from vico.cli.live import city_of, told
from vico.cli.output import check_output, print_json
from vico.errors import InputError, OutputError, OutputExistsError
from vico.io.files import is_being_written, new_folder, write_errors
from vico.io.stores import Store, is_url, store_at
from vico.runner.foreign import Terms, check_loads
from vico.runner.loading import load_agent
from vico.threads import workers as processors
from vico.viewer.server import require_server
from vico.world.folder import fetch_manifest, read_world

#: `evaluate` with all but where to, and who is told.
Play = Callable[..., list[Outcome]]


def assistant(options: AssistantOptions) -> int:
    """Judge planners on the community assistant tasks."""
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
        return _by_hand(categories, setting, options)
    return judge("assistant", categories, setting, options.common, methods=("heuristic",))


def _by_hand(categories: Sequence[str] | None, setting: Setting, options: AssistantOptions) -> int:
    """Judge a person, who plays at a page of this machine, one episode after the other, each recorded."""
    from vico.viewer import theatre

    if options.common.ray is not None:
        raise InputError("eval: --method human is played at this machine; leave out --ray")
    require_server()
    theatre.AT_THE_PAGE.open(
        city=city_of, announce=told, port=options.port, waits=options.waits, hosts=options.allow_host
    )
    common = replace(options.common, workers=1, record=True)
    return judge(theatre.CHALLENGE, categories, setting, common)


def influence(options: InfluenceOptions) -> int:
    """Judge strategies that compete for a community's friendship."""
    if not options.hours >= 0:
        raise InputError(f"eval: --hours {options.hours:g}; give hours above 0")
    usual = InfluenceOptions(options.common)
    names = [field.name for field in fields(options) if field.name != "common"]
    asked = {name: getattr(options, name) for name in names if getattr(options, name) != getattr(usual, name)}
    return judge("influence", None, asked, options.common)


def commute(options: CommuteOptions) -> int:
    """Judge how agents get around on a day of commutes."""
    if not options.hours >= 0:
        raise InputError(f"eval: --hours {options.hours:g}; give hours above 0")
    return judge("commute", None, {"hours": options.hours} if options.hours else {}, options.common)


def teaming(options: TeamingOptions) -> int:
    """Judge robots at work with a person or with each other."""
    if options.steps < 1:
        raise InputError(f"eval: --steps {options.steps}; give seconds, 1 or more")
    categories = None if options.category == "all" else (options.category,)
    setting: Setting = {"steps": options.steps, "period": options.period}
    return judge("teaming", categories, setting, options.common, methods=("heuristic",))


def robot(options: RobotOptions) -> int:
    """Judge robots that bring things, and go along with people."""
    if options.steps < 1:
        raise InputError(f"eval: --steps {options.steps}; give seconds, 1 or more")
    categories = None if options.category == "all" else (options.category,)
    from vico.challenges.robot.arm_policies import policy_settings  # physics is slow to import

    by_oracle: Setting = {"oracle_grasp": True} if options.oracle_grasp else {}
    setting: Setting = {"steps": options.steps, "period": options.period, **by_oracle}
    policies = policy_settings(options.common.method, options.policy)
    return judge("robot", categories, setting, options.common, methods=("heuristic",), of_method=policies)


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
        _tell(challenge, outcomes, options)
        if options.leaderboard is not None:
            add_to_leaderboard(folder, file=options.leaderboard, date=options.date, replace=False, quiet=options.json)
    return 1 if any(outcome.record is None for outcome in outcomes) else 0


@contextmanager
def _in_folder(challenge: Challenge, play: Play, options: EvaluationOptions) -> Iterator[tuple[Path, list[Outcome]]]:
    """Play the jobs, and write the results beside the episodes; give their folder and the outcomes."""
    out = Path(options.out)
    check_output(
        out,
        *(Path(one) for one in chain(*options.worlds) if not is_url(one)),
        force=options.force or options.resume,
        kind=None if options.resume else EVALUATION_FOLDER,
    )
    partial_folder = out.with_name(f"{out.name}.partial")
    if options.resume:
        _take_up(out, partial_folder)
    with new_folder(out, force=options.force, work=partial_folder, kind=EVALUATION_FOLDER) as folder:
        outcomes = _played(play, folder)
        _write(folder, challenge, outcomes, options)
    yield out, outcomes


@contextmanager
def _in_store(challenge: Challenge, play: Play, options: EvaluationOptions) -> Iterator[tuple[Path, list[Outcome]]]:
    """Play the jobs, and copy the results to the store, ``results.json`` last: where that is, an evaluation is over."""
    store = store_at(options.out)
    if store.has("results.json") and not options.resume:
        if not options.force:
            raise OutputExistsError(
                f"{store}: exists already; go on with --resume, choose another --out, or replace it with --force"
            )
        store.remove("")
    outcomes = _played(play, store)
    with TemporaryDirectory(prefix="vico-") as temporary:
        folder = Path(temporary)
        _write(folder, challenge, outcomes, options)
        for path in sorted(folder.iterdir(), key=lambda path: path.name == "results.json"):
            store.write(path.name, path.read_bytes())
        yield folder, outcomes


def _played(play: Play, where: Path | Store) -> list[Outcome]:
    with _reporting() as (progress, finished):
        return play(where, progress=progress, finished=finished)


def _write(folder: Path, challenge: Challenge, outcomes: Sequence[Outcome], options: EvaluationOptions) -> None:
    published = published_rows(challenge.name, outcomes[0].job.setting) if options.compare else ()
    write_results(folder, challenge, outcomes, reference=options.against, published=published)


def _tell(challenge: Challenge, outcomes: Sequence[Outcome], options: EvaluationOptions) -> None:
    """Print the results, and to stderr what went wrong."""
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
    foreign = [part for method in methods for part in foreign_parts(challenge, method) if ":" in part]
    if not foreign:
        return Terms()
    for part in dict.fromkeys(foreign):
        if options.in_process:
            load_agent(part)
        else:
            check_loads(part, world)
    return Terms(deadline=options.deadline or None, isolate=not options.in_process, workers=processors())


def _take_up(out: Path, partial: Path) -> None:
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
def _reporting() -> Iterator[tuple[Told | None, Finished]]:
    """Give what tells of episodes on stderr: bars on a terminal, a line for each that is over elsewhere."""
    console = Console(file=sys.stderr)
    if not console.is_terminal:
        yield None, _line
        return
    columns = (TextColumn("{task.description}"), BarColumn(bar_width=30), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, refresh_per_second=4, transient=True) as bars:
        whole = bars.add_task("episodes", total=None)
        tasks: dict[str, TaskID] = {}

        def progress(label: str, step: int, limit: int) -> None:
            if label not in tasks:
                tasks[label] = bars.add_task(label, total=limit)
            bars.update(tasks[label], completed=step, total=limit)

        def finished(outcome: Outcome, done: int, total: int) -> None:
            bars.update(whole, completed=done, total=total)
            label = label_of(outcome.job)
            if label in tasks:
                bars.remove_task(tasks.pop(label))

        yield progress, finished


def _line(outcome: Outcome, done: int, total: int) -> None:
    """Say on stderr what an episode came to."""
    record = outcome.record
    if record is None:
        what = f"not played: {outcome.reason}"
    else:
        metrics = ", ".join(f"{key} {value:.4g}" for key, value in record.metrics.items())
        what = f"{metrics}; {'kept' if outcome.kept else f'{record.wall_seconds:.1f} s'}"
    print(f"{done} of {total}: {label_of(outcome.job)}: {what}", file=sys.stderr, flush=True)
