"""The verbs that open a page (`vico view`, `vico live`, `vico play`), with the options of all verbs that show a run.

`vico view` shows a recorded run, also one that is still being written. `vico live` starts a simulation with a page
beside it. `vico play` puts a person into the street, as a resident, an assistant or a robot, or at a task that is
judged.
"""

from __future__ import annotations

import re
import webbrowser
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro
from tyro.conf import Positional

from vico.cli.console import print_json
from vico.cli.evaluation import AssistantOptions, EvaluationOptions, evaluate_assistant
from vico.cli.options import (
    FLAT,
    Cars,
    CommaSeparated,
    Cyclists,
    EventChoice,
    FirstDate,
    Hosts,
    Pedestrians,
    Robots,
    RunOptions,
    StartTime,
    WeatherChoice,
)
from vico.errors import InputError
from vico.viewer.server import require_server

if TYPE_CHECKING:
    from vico.agents.human import Steering


@dataclass(frozen=True)
class LiveOptions:
    """What `vico live` is asked for; what else a run can be asked for, `vico run --live` is."""

    world: Positional[Annotated[Path, tyro.conf.arg(metavar="WORLD")]]  # World folder.
    community: Positional[Annotated[Path, tyro.conf.arg(metavar="COMMUNITY")]]  # Community folder, made for that world.
    out: Path | None = None  # Folder to record into; without it, out/live, which is replaced.
    robots: Robots = "husky,go2"
    #: Who plays an assistant beside the residents: my_module:MyAgent, or path/to/file.py:MyAgent.
    agent: Annotated[str, tyro.conf.arg(metavar="MODULE:NAME")] = ""
    assistants: int = 0  # How many of them.
    start: StartTime = "08:00"
    date: FirstDate = None
    weather: WeatherChoice = "fair"
    events: EventChoice = "none"
    steps: int = 86_400  # Seconds to simulate at most.
    cars: Cars = None
    cyclists: Cyclists = 0
    pedestrians: Pedestrians = None
    #: Whose views are rendered and recorded all the time; those of anybody are when somebody looks.
    observe: CommaSeparated = "none"
    speed: float = 1.0  # Simulated seconds a second at most; 0 is as fast as it goes.
    paused: bool = False  # Wait before the first step until somebody lets it go on.
    interventions: Path | None = None  # What was done to an earlier run (its interventions.jsonl), to be done again.
    port: int = 0  # Where the page is, on this machine alone; 0 takes a free one.
    #: A name, beside this machine's own, under which a proxy or a forwarded port shows the page; may be given several
    #: times.
    allow_host: Hosts = ()
    idle: float = 300.0  # Seconds without a page open after which the run waits for one; 0: it never waits.
    seed: int = 0  # Decides everything that is left to chance.

    def run_options(self) -> RunOptions:
        """Return the same as options of a run."""
        given = {field.name: getattr(self, field.name) for field in fields(self)}
        given["assistants"] = self.assistants or (1 if self.agent else 0)
        given |= {"out": self.out or Path("out/live"), "force": self.out is None, "live": True}
        return RunOptions(**given)


@dataclass(frozen=True)
class PlayOptions:
    """What `vico play` is asked for."""

    world: Positional[Annotated[Path, tyro.conf.arg(metavar="WORLD")]]  # World folder.
    #: Community folder, made for that world; tasks have people of their own and take none.
    community: Positional[Annotated[Path | None, tyro.conf.arg(metavar="COMMUNITY")]] = None
    #: Who you are: a resident by name ("Ann Lee", or Ann), resident_3, assistant_0 or robot_0. Without it assistant_0,
    #: or robot_0 where robots are given.
    played: Annotated[str, tyro.conf.arg(name="as", metavar="AGENT")] = ""
    #: A task for the assistant, which is judged at the end.
    task: Literal["none", "carry", "delivery", "search"] = "none"
    advanced: bool = False  # The harder form of it.
    out: Path | None = None  # Folder to record into; without it, out/play, which is replaced.
    robots: Robots = "none"
    start: StartTime = "08:00"
    date: FirstDate = None
    weather: WeatherChoice = "fair"
    seconds: int = 36_000  # To simulate at most.
    cars: Cars = None
    cyclists: Cyclists = 0
    pedestrians: Pedestrians = None
    #: What whom you play sees is rendered and recorded, which a demonstration needs.
    view: Literal["recorded", "none"] = "recorded"
    port: int = 0  # Where the page is, on this machine alone; 0 takes a free one.
    #: A name, beside this machine's own, under which a proxy or a forwarded port shows the page; may be given several
    #: times.
    allow_host: Hosts = ()
    idle: float = 60.0  # Seconds without a page open after which the run waits for one; 0: it never waits.
    waits: float = 600.0  # With a task: seconds that it waits for you at its page.
    seed: int = 0  # Decides everything that is left to chance, and the task.

    def run_options(self, played: str, steps: int) -> RunOptions:
        """Return the same as options of a run."""
        names = (
            "world",
            "community",
            "robots",
            "start",
            "date",
            "weather",
            "cars",
            "cyclists",
            "pedestrians",
            "port",
            "allow_host",
            "idle",
        )
        given: dict[str, Any] = {name: getattr(self, name) for name in (*names, "seed")}
        given["assistants"] = int(played.removeprefix("assistant_")) + 1 if played.startswith("assistant_") else 0
        given |= {"observe": played if self.view == "recorded" else "none", "states_every": steps // self.seconds * 300}
        given |= {"out": self.out or Path("out/play"), "force": self.out is None, "steps": steps}
        return RunOptions(**given, live=True, speed=1.0)


def view(
    path: Positional[Path],
    world: Path | None = None,
    port: int = 0,
    allow_host: Hosts = (),
    browser: bool = False,
    json: bool = False,
) -> int:
    """Show a recorded run in a browser on this machine; also one that is still being written.

    Example: vico view morning

    Example: vico view morning --port 8123 --browser

    Args:
        path: Run folder.
        world: The world it ran in, if it is no longer where it was.
        port: Where the page is; 0 takes the one it was shown on before, or a free one.
        allow_host: A name, beside this machine's own, under which a proxy or a forwarded port shows the page; may be
            given several times.
        browser: Open it in the browser.
        json: Print the address as JSON.
    """
    from vico.cli.live import city_of, print_address, wait_for_interrupt

    require_server()
    from vico.viewer.server.serve import ViewerServer
    from vico.viewer.server.state import ViewerState
    from vico.viewer.sources.source import Source
    from vico.viewer.sources.views import RecordedViews

    source = Source.of_run(path, world=world)
    run = source.tables.run
    assert run is not None
    city = None if source.world is None else city_of(source.world)
    with ViewerServer(
        ViewerState(source, RecordedViews(run).view, city=city), port=port, keep=path, hosts=allow_host
    ) as server:
        if json:
            print_json({"url": server.url})
        else:
            print_address(server.url)
        if browser:
            webbrowser.open(server.url)
        wait_for_interrupt(f"{path}: steps 0 to {source.last}; Ctrl+C ends")
    return 0


def live(options: Annotated[LiveOptions, FLAT]) -> int:
    """Start a simulation with a page beside it, from which it can be paused, looked into and changed.

    Example: vico live helsinki people

    Example: vico live helsinki people --robots husky,drone --agent my_module:MyAgent --speed 10
    """
    from vico.cli import run as verb

    return verb.run(options.run_options())


def play(options: Annotated[PlayOptions, FLAT]) -> int:
    """Walk through a world among its people, from a page in the browser; or do a task there, and be judged.

    Example: vico play helsinki people

    Example: vico play helsinki people --as resident_3

    Example: vico play helsinki people --robots drone --as robot_0

    Example: vico play helsinki --task delivery --seed 0
    """
    require_server()
    if options.task != "none":
        return _play_task(options, options.task)
    if options.community is None:
        raise InputError("play: give WORLD and COMMUNITY, or WORLD and --task; see vico play --help")
    if not 1 <= options.seconds <= 1_000_000:
        raise InputError(f"play: --seconds {options.seconds}; it has to be 1 to 1000000")
    from vico.agents.human import PERIOD, HumanAgent, Mailbox
    from vico.cli.run import Job, names_of
    from vico.sim.config import find_by_name
    from vico.viewer.play import PlayedAgent

    robots = [name.strip() for name in options.robots.split(",") if name.strip() not in ("", "none")]
    played = options.played or ("robot_0" if robots else "assistant_0")
    if not _ASSISTANT.fullmatch(played):
        played = find_by_name(played, names_of(options.community, robots, assistants=1), option="play: --as")
    human = HumanAgent(Mailbox(), steer=_steering(robots, played))
    given = options.run_options(played, round(options.seconds / PERIOD))
    assert given.out is not None
    Job.of(given, options.world, options.community, given.out, played=PlayedAgent(played, human)).simulate()
    print(given.out)
    return 0


# There are as many assistants as it takes for the one who is played.
_ASSISTANT = re.compile(r"assistant_\d{1,4}")


def _steering(robots: list[str], played: str) -> Steering:
    """Return what keys and sticks mean to who is played."""
    from vico.agents.human import walk
    from vico.viewer.teleoperation import steering_of

    if not played.startswith("robot_"):
        return walk
    return steering_of(robots[int(played.removeprefix("robot_"))])


def _play_task(options: PlayOptions, category: Literal["carry", "delivery", "search"]) -> int:
    """Play one task as `vico eval assistant --method human` does, and tell the verdict."""
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
    return evaluate_assistant(asked)
