"""Options of `vico eval`, as records: those of every evaluation, and those of each challenge."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from vico.cli.options import Hosts, RayAddress, Words


@dataclass(frozen=True)
class EvaluationOptions:
    """What every `vico eval` is asked for.

    Attributes
    ----------
    worlds
        World folders, or their URLs (s3://BUCKET/worlds/helsinki); one episode for each world, seed, category and
        method.
    out
        Folder for tasks, episodes and results, or a URL like s3://BUCKET/results (the extra "s3"); refused if it
        exists, unless --resume or --force.
    method
        One of the challenge's (of assistant tasks also human: you, at a page), my_module:MyAgent
        (path/to/file.py:MyAgent), or two joined by +. Give it several times
        to judge several in the same tasks.
    against
        The method that the others are compared with; the first one without.
    seeds
        Episodes a world, seeded 0, 1, ...
    first_seed
        Or this and on.
    workers
        Processes side by side; 0 is one a processor. Decides nothing but how long it takes.
    ray
        Play on a Ray cluster instead (the extra "ray"): its address; without one on that which runs here, or on one
        that is started for the occasion. OUT and the worlds must be on a folder that all machines share, or URLs.
    resume
        Go on in OUT: episodes that are there and would come to the same are kept, what is missing is played.
    record
        Keep each episode's run (OUT/runs), for vico replay and the viewer.
    compare
        Put the published rows beside ours.
    leaderboard
        Add what it comes to to this leaderboard file; it is made if it is not there.
    date
        Of the leaderboard's entries, YYYY-MM-DD; left out without.
    deadline
        Seconds an agent of yours has for an action; who is late waits a step. 0 waits for it as long as it takes.
    in_process
        Ask agents of yours in the process that simulates, where nothing keeps them from the truth: for a debugger.
    force
        Replace what this verb made there before; refused if the folder holds anything else.
    json
        Print the results as JSON.
    """

    worlds: Words
    out: str
    method: Annotated[tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="METHOD")] = ()
    against: str = ""
    seeds: int = 3
    first_seed: int = 0
    workers: int = 0
    ray: RayAddress = None
    resume: bool = False
    record: bool = False
    compare: bool = False
    leaderboard: Path | None = None
    date: str | None = None
    deadline: float = 60.0
    in_process: bool = False
    force: bool = False
    json: bool = False


Common = Annotated[EvaluationOptions, tyro.conf.arg(name="")]


@dataclass(frozen=True)
class AssistantOptions:
    """What `vico eval assistant` is asked for.

    Attributes
    ----------
    common
        What every evaluation is asked for.
    category
        What is asked of the assistants.
    assistants
        How many of them work together.
    advanced
        The harder tasks: more places to look in, half the distances.
    no_distance
        Planners do not reckon with distances.
    steps
        Seconds an episode may last.
    subtasks
        How many of the six subtasks of a task are asked for: the first ones.
    port
        With --method human: where the page is that one plays at; 0 takes a free one.
    allow_host
        With --method human: a name, beside this machine's own, under which a proxy or a forwarded port shows the page.
    waits
        With --method human: seconds that an episode waits for a person who has not come, or has left; it counts as not
        played then.
    """

    common: Common
    category: Literal["carry", "delivery", "search", "all"] = "delivery"
    assistants: int = 1
    advanced: bool = False
    no_distance: bool = False
    steps: int = 1500
    subtasks: int = 6
    port: int = 0
    allow_host: Hosts = ()
    waits: float = 600.0


@dataclass(frozen=True)
class InfluenceOptions:
    """What `vico eval influence` is asked for.

    Attributes
    ----------
    common
        What every evaluation is asked for.
    start
        When the day of talk begins, HH:MM; the challenge's own time without.
    hours
        How long it is; 0 for the challenge's own length.
    simulation
        With bodies, or by schedule: members are where their day says, and walks take what the router says.
    members
        Who answers and ranks: the opinion model, or a language model.
    target_model
        Language model that chooses whom to talk to, for methods that have one.
    dialogue_model
        Language model that talks.
    member_model
        Language model of the members, with ``--members llm``.
    """

    common: Common
    start: str = ""
    hours: float = 0.0
    simulation: Literal["full", "schedule"] = "full"
    members: Literal["model", "llm"] = "model"
    target_model: str = ""
    dialogue_model: str = ""
    member_model: str = ""


@dataclass(frozen=True)
class CommuteOptions:
    """What `vico eval commute` is asked for.

    Attributes
    ----------
    common
        What every evaluation is asked for.
    hours
        From the first leaving to the end of the day; 0 for the challenge's own.
    """

    common: Common
    hours: float = 0.0


@dataclass(frozen=True)
class TeamingOptions:
    """What `vico eval teaming` is asked for.

    Attributes
    ----------
    common
        What every evaluation is asked for.
    category
        Of the tasks.
    steps
        Seconds of an episode at most.
    period
        Seconds between two actions of a robot: 0.5 is 2 Hz.
    """

    common: Common
    category: Literal["accompany", "guide", "spot", "all"] = "all"
    steps: int = 600
    period: float = 0.5


@dataclass(frozen=True)
class RobotOptions:
    """What `vico eval robot` is asked for.

    Attributes
    ----------
    common
        What every evaluation is asked for.
    category
        Of the tasks.
    steps
        Seconds of an episode at most.
    period
        Seconds between two actions of a robot: 0.05 is 20 Hz.
    oracle_grasp
        Hands never lose what they closed on; without it friction alone holds.
    policy
        What training has written: for rl a file, for rl-decomposed the folder with both or LIFT.npz,PLACE.npz, for vla
        a file or a LeRobot policy's folder. With several such methods METHOD=FILE, once for each.
    """

    common: Common
    category: Literal["carry", "deliver", "all"] = "all"
    steps: int = 1500
    period: float = 0.05
    oracle_grasp: bool = False
    policy: Annotated[tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="FILE")] = ()
