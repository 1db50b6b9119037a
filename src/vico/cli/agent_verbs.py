"""The verbs for whoever writes agents: `vico check-agent`, `vico eval` and `vico leaderboard`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro
from tyro.conf import Positional
from tyro.extras import SubcommandApp

from vico.cli.evaluation_options import (
    AssistantOptions,
    CommuteOptions,
    InfluenceOptions,
    RobotOptions,
    TeamingOptions,
)

# The fields of a record are options of the verb itself, not of a part of it.
_FLAT = tyro.conf.arg(name="")

evaluation = SubcommandApp()
leaderboard = SubcommandApp()


def check_agent(
    agent: Positional[Annotated[str, tyro.conf.arg(metavar="MODULE:NAME")]],
    world: Path | None = None,
    steps: int = 40,
    seed: int = 0,
    deadline: float = 1.0,
    in_process: bool = False,
    json: bool = False,
) -> int:
    """Check that an agent of yours keeps the contract, a line a finding. Exit 1 if anything is wrong.

    It is made in a process of its own, it answers with actions and in time, it repeats itself, one restored from its
    state goes on as it does, it leaves what it is given as it is, and it does not reach for what it is not given.

    Example: vico check-agent my_agents:Walker

    Args:
        agent: my_module:MyAgent, or path/to/file.py:MyAgent.
        world: World folder it plays an assistant in; a small one of the packaged place without.
        steps: How long, seconds.
        seed: Of the simulation and the agent.
        deadline: Seconds an action may take.
        in_process: Ask it in this process instead, for a debugger; nothing is watched then.
        json: Print JSON.
    """
    from vico.cli import check_agent as verb

    return verb.check(agent, world=world, steps=steps, seed=seed, deadline=deadline, isolate=not in_process, json=json)


@evaluation.command(name="assistant")
def evaluate_assistant(options: Annotated[AssistantOptions, _FLAT]) -> int:
    """Judge planners on the community assistant tasks.

    Exit 0 if every episode was played, 1 if some were not (the table says why), 2 for bad input. The same command goes
    on after an interruption.

    Example: vico eval assistant --category delivery --method heuristic --worlds helsinki monaco --seeds 3 --out results

    Example: vico eval assistant --category all --method heuristic --method ours --against heuristic --assistants 2
    --worlds helsinki monaco --workers 4 --compare --out results

    Example: vico eval assistant --category search --method my_module:MyAgent --worlds helsinki --record --out mine
    """
    from vico.cli import evaluate as verb

    return verb.assistant(options)


@evaluation.command(name="influence")
def evaluate_influence(options: Annotated[InfluenceOptions, _FLAT]) -> int:
    """Judge strategies that compete for a community's friendship; a method is a pair, ours+nearest.

    Example: vico eval influence --method ours+random --method ours+nearest --worlds helsinki monaco --out results

    Example: vico eval influence --method llm+llm --target-model o1 --dialogue-model gpt-4o --worlds helsinki --out llm
    """
    from vico.cli import evaluate as verb

    return verb.influence(options)


@evaluation.command(name="commute")
def evaluate_commute(options: Annotated[CommuteOptions, _FLAT]) -> int:
    """Judge how agents get around on a day of commutes.

    Example: vico eval commute --method rule --method ours --worlds helsinki monaco --seeds 10 --compare --out results
    """
    from vico.cli import evaluate as verb

    return verb.commute(options)


@evaluation.command(name="robot")
def evaluate_robot(options: Annotated[RobotOptions, _FLAT]) -> int:
    """Judge robots with an arm and a deck that bring things, and go along with people, by real contact.

    Example: vico eval robot --category deliver --method heuristic --method alone --worlds helsinki --out results
    Example: vico eval robot --method rl --policy runs/whole/policy.npz --worlds helsinki --out results
    """
    from vico.cli import evaluate as verb

    return verb.robot(options)


@evaluation.command(name="teaming")
def evaluate_teaming(options: Annotated[TeamingOptions, _FLAT]) -> int:
    """Judge a humanoid, a quadruped and a drone at work with a person or another robot.

    Example: vico eval teaming --category guide --method heuristic --method alone --worlds helsinki --out results
    """
    from vico.cli import evaluate as verb

    return verb.teaming(options)


@leaderboard.command(name="add")
def leaderboard_add(
    results: Positional[Path], file: Path, date: str | None = None, replace: bool = False, json: bool = False
) -> int:
    """Add what an evaluation came to to a leaderboard file; it is made if it is not there.

    Example: vico leaderboard add results --file leaderboard.json --date 2026-11-30

    Args:
        results: Folder that vico eval has written, or its results.json.
        file: The leaderboard.
        date: Of the entries, YYYY-MM-DD; left out without.
        replace: Replace entries of the same method, version and tasks that came to something else.
        json: Print the entries as JSON.
    """
    from vico.cli import leaderboard as verb

    return verb.add(results, file=file, date=date, replace=replace, json=json)


@leaderboard.command(name="show")
def leaderboard_show(file: Positional[Path], json: bool = False) -> int:
    """Show a leaderboard, a table for each challenge, category, setting and set of tasks.

    Example: vico leaderboard show leaderboard.json

    Args:
        file: The leaderboard.
        json: Print it as JSON.
    """
    from vico.cli import leaderboard as verb

    return verb.show(file, json=json)
