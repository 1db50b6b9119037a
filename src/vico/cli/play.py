"""`vico play`: a person in the street, as a resident, an assistant or a robot; or at a task that is judged."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

from vico.cli.evaluation_options import AssistantOptions, EvaluationOptions
from vico.cli.viewer_options import PlayOptions
from vico.errors import InputError
from vico.sim.config import find_by_name
from vico.viewer.server import require_server

# There are as many assistants as it takes for the one who is played.
_ASSISTANT = re.compile(r"assistant_\d{1,4}")


def play(options: PlayOptions) -> int:
    """Open the page, and run until the time is up, somebody stops it, or the task is done.

    Raises
    ------
    InputError
        If nobody is called as asked, or a number is not usable.
    """
    require_server()
    if options.task != "none":
        return _task(options, options.task)
    if options.community is None:
        raise InputError("play: give WORLD and COMMUNITY, or WORLD and --task; see vico play --help")
    if not 1 <= options.seconds <= 1_000_000:
        raise InputError(f"play: --seconds {options.seconds}; it has to be 1 to 1000000")
    return _freely(options, options.community)


def _freely(options: PlayOptions, community: Path) -> int:
    from vico.agents.human import PERIOD, HumanAgent, Mailbox
    from vico.cli.run import Job, names_of
    from vico.viewer.play import PlayedAgent

    robots = [name.strip() for name in options.robots.split(",") if name.strip() not in ("", "none")]
    played = options.played or ("robot_0" if robots else "assistant_0")
    if not _ASSISTANT.fullmatch(played):
        played = find_by_name(played, names_of(community, robots, assistants=1), option="play: --as")
    human = HumanAgent(Mailbox(), steer=_steering(robots, played))
    given = options.run_options(played, round(options.seconds / PERIOD))
    assert given.out is not None
    Job.of(given, options.world, community, given.out, played=PlayedAgent(played, human)).done()
    print(given.out)
    return 0


def _steering(robots: list[str], played: str):  # type: ignore[no-untyped-def]
    """Return what keys and sticks mean to who is played."""
    from vico.agents.human import walk
    from vico.viewer.teleoperation import steering_of

    if not played.startswith("robot_"):
        return walk
    return steering_of(robots[int(played.removeprefix("robot_"))])


def _task(options: PlayOptions, category: Literal["carry", "delivery", "search"]) -> int:
    """Play one task as `vico eval assistant --method human` does, and tell the verdict."""
    from vico.cli.evaluate import assistant

    if options.played not in ("", "assistant_0"):
        raise InputError(f"play: --as {options.played}; tasks are for assistant_0")
    if not 0 <= options.seed <= 10_000:
        raise InputError(f"play: --seed {options.seed}; tasks have seeds of 0 to 10000")
    common = EvaluationOptions(
        worlds=((str(options.world),),),
        out=str(options.out or Path("out/play-task")),
        method=("human",),
        seeds=1,
        first_seed=options.seed,
        record=True,
        force=options.out is None,
    )
    asked = AssistantOptions(
        common,
        category=category,
        advanced=options.advanced,
        port=options.port,
        waits=options.waits,
        allow_host=options.allow_host,
    )
    return assistant(asked)
