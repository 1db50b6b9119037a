"""`vico eval`: judge a planner, and write what it came to."""

from __future__ import annotations

import sys

from rich.console import Console
from rich.markdown import Markdown

from vico.agents.assistant import METHODS
from vico.challenges.assistant.runner import evaluate
from vico.challenges.results import fault_lines, markdown_table, write_results
from vico.cli.options import AssistantOptions
from vico.cli.output import check_output, print_json, progress_bars
from vico.errors import InputError
from vico.io.folders import new_folder
from vico.runner.foreign import Terms
from vico.runner.loading import load
from vico.threads import use_workers, workers
from vico.world.folder import read_world


def assistant(options: AssistantOptions) -> int:
    """Run the episodes; leave the tasks, ``results.json`` and ``results.md`` in ``options.out``.

    Until all are over they are in a neighbour, ``OUT.partial``; the same command goes on there after an interruption.
    """
    worlds, out, method, assistants = options.worlds, options.out, options.method, options.assistants
    seeds, steps = options.seeds, options.steps
    if method not in METHODS and ":" not in method:
        raise InputError(
            f"eval: no method called {method!r}; there are {', '.join(sorted(METHODS))}, or my_module:MyPlanner"
        )
    use_workers(options.workers)
    terms = Terms()
    if method not in METHODS:
        terms = Terms(deadline=options.deadline or None, isolate=options.isolate, workers=workers())
        if not options.isolate:
            load(method)  # whatever is wrong with its name or its module is said before anything is written
    if not 1 <= assistants <= 2:
        raise InputError(f"eval: {assistants} assistants; the tasks are for 1 or 2")
    if seeds < 1 or steps < 1 or not worlds:
        raise InputError("eval: needs at least one world, one seed and one step")
    check_output(out, *worlds, force=options.force)
    places = [read_world(path) for path in worlds]
    with new_folder(out, force=options.force, work=out.with_name(f"{out.name}.partial")) as folder:
        with progress_bars() as report:
            episodes = evaluate(
                places,
                method=method,
                assistants=assistants,
                seeds=seeds,
                steps=steps,
                folder=folder,
                terms=terms,
                progress=report,
            )
        condensed = write_results(folder, episodes)
        for line in fault_lines(episodes):
            print(line, file=sys.stderr)
    if options.json:
        print_json(condensed)
    else:
        Console().print(Markdown(markdown_table([condensed])))
        print(out / "results.json")
    return 0
