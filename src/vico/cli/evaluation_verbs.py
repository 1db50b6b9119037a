"""`vico eval`: judge agents on a challenge."""

from __future__ import annotations

from typing import Annotated

import tyro
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
