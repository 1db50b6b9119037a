"""`vico eval`: judge methods on a challenge, and write what they came to."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields, replace
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

from vico.challenges.episodes import Outcome, label_of
from vico.challenges.evaluation import Finished, evaluate, jobs_for
from vico.challenges.records import Challenge, Job, Setting
from vico.challenges.records import Progress as Told
from vico.challenges.registry import foreign_parts, load_challenge
from vico.challenges.tables.files import results_content, write_results
from vico.challenges.tables.markdown import fault_lines, not_played_lines, results_page
from vico.challenges.tables.published import published_rows
from vico.challenges.tables.summary import summarise
from vico.cli import leaderboard
from vico.cli.evaluation_options import AssistantOptions, CommuteOptions, EvaluationOptions, InfluenceOptions
from vico.cli.live import city_of, told
from vico.cli.output import check_output, print_json
from vico.errors import InputError, OutputError
from vico.io.files import write_errors
from vico.io.folders import is_being_written, new_folder
from vico.runner.foreign import Terms
from vico.runner.loading import load
from vico.threads import workers as processors
from vico.viewer.server import require_server
from vico.world.folder import read_world


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
    categories = None if options.category == "all" else (options.category,)
    if any("human" in method.split("+") for method in options.common.method):
        return _by_hand(categories, setting, options)
    return judge("assistant", categories, setting, options.common, methods=("heuristic",))


def _by_hand(categories: Sequence[str] | None, setting: Setting, options: AssistantOptions) -> int:
    """Judge a person, who plays at a page of this machine, one episode after the other, each recorded."""
    from vico.viewer import theatre

    require_server()
    theatre.AT_THE_PAGE.open(city=city_of, announce=told, port=options.port, waits=options.waits)
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


def judge(
    name: str,
    categories: Sequence[str] | None,
    setting: Setting,
    options: EvaluationOptions,
    *,
    methods: Sequence[str] = (),
) -> int:
    """Play the episodes; leave tasks, episodes, ``results.json`` and ``results.md`` in ``options.out``.

    Until all are over they are in a neighbour, ``OUT.partial``; the same command goes on there after an interruption.

    Parameters
    ----------
    categories
        All of the challenge's if None.
    methods
        If none are asked for.

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
    jobs = jobs_for(
        name,
        categories=categories or challenge.categories,
        methods=methods,
        setting=setting,
        worlds=options.worlds,
        seeds=options.seeds,
        first_seed=options.first_seed,
        terms=_terms(challenge, methods, options),
    )
    if not 0 <= options.workers <= 256:
        raise InputError(f"--workers {options.workers}; give a number of processes in 1..256, or 0 for one a processor")
    check_output(options.out, *options.worlds, force=options.force or options.resume)
    for path in options.worlds:
        read_world(path)  # a world that is none is said before anything is played
    outcomes = _played(name, challenge, jobs, options)
    _tell(challenge, outcomes, options)
    if options.leaderboard is not None:
        leaderboard.add(options.out, file=options.leaderboard, date=options.date, replace=False, told=not options.json)
    return 1 if any(outcome.record is None for outcome in outcomes) else 0


def _played(name: str, challenge: Challenge, jobs: Sequence[Job], options: EvaluationOptions) -> list[Outcome]:
    """Play the jobs, and write the results."""
    out = options.out
    partial = out.with_name(f"{out.name}.partial")
    if options.resume:
        _take_up(out, partial)
    with new_folder(out, force=options.force, work=partial) as folder:
        with _reporting() as (progress, finished):
            outcomes = evaluate(
                name,
                jobs,
                folder,
                workers=min(options.workers or processors(), len(jobs)),
                record=options.record,
                progress=progress,
                finished=finished,
            )
        published = published_rows(challenge.name, jobs[0].setting) if options.compare else ()
        write_results(folder, challenge, outcomes, reference=options.against, published=published)
    return outcomes


def _tell(challenge: Challenge, outcomes: Sequence[Outcome], options: EvaluationOptions) -> None:
    """Print the results, and to stderr what went wrong."""
    summary = summarise(challenge, outcomes, reference=options.against)
    if options.json:
        print_json(results_content(challenge, summary, outcomes))
    else:
        published = published_rows(challenge.name, summary.setting) if options.compare else ()
        print(results_page(challenge, summary, outcomes, published=published))
        print(options.out / "results.json")
    for line in [*fault_lines(outcomes), *(f"not played: {line}" for line in not_played_lines(outcomes))]:
        print(line, file=sys.stderr)


def _terms(challenge: Challenge, methods: Sequence[str], options: EvaluationOptions) -> Terms:
    """Return on which terms agents from elsewhere take part; what is wrong with their names is said here."""
    foreign = [part for method in methods for part in foreign_parts(challenge, method) if ":" in part]
    if not foreign:
        return Terms()
    if options.in_process:
        for part in foreign:
            load(part)
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
