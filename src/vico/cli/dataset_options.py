"""Options of `vico dataset build`, as a record."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from vico.cli.options import Files, RayAddress


@dataclass(frozen=True)
class DatasetOptions:
    """What `vico dataset build` is asked for.

    Attributes
    ----------
    out
        Folder to make; refused if it exists, unless --force. A build that was stopped goes on where it was.
    to
        The format: LeRobot v3.0, WebDataset shards, or plain Parquet.
    world
        World folders to play in. With --runs: where their world is now. Of pick_place: without any, a level field.
    challenge
        What is played; pick_place: a mobile manipulator picks things up and puts them down (docs/imitation.md).
    method
        By whom: a planner of `vico eval assistant`, or my_module:MyAgent. Of pick_place: always the arm's own skills.
    episodes
        How many, over the worlds in turn.
    steps
        Seconds an episode may last; of pick_place never more than 120.
    subtasks
        How many of the six subtasks of a task are asked for: the first ones.
    assistants
        How many work together; each is an episode of its own.
    first_seed
        Of the first episode in each world.
    runs
        Take these recorded runs instead of playing: of vico run, of vico eval --record, played by hand.
    agents
        Whose demonstrations: names, or residents, assistants, robots; without it the assistants, else all whose
        pictures were recorded.
    outputs
        Pictures, separated by commas: rgb (video), depth and segmentation (exact); or none.
    size
        Side of the pictures, pixels.
    instruction
        What to say was asked for, where neither a task nor a schedule says it.
    successes
        Keep only episodes in which all was done.
    drop_below
        Of pick_place: leave out steps whose largest increment is smaller, rad and metres; the paper has 0.01.
    clip
        Of pick_place: cut this share of the smallest and of the largest increments; the paper has 0.01.
    test
        Share of the episodes that are kept apart for testing.
    validation
        Share that is kept apart for validation.
    split_by
        What is never in two splits: a world, a person who acts or asks, or only an episode itself.
    workers
        Processes side by side; 0 is one a processor. Decides nothing but how long it takes.
    ray
        Make the parts on a Ray cluster instead (the extra "ray"): its address; without one on that which runs here. OUT
        and the worlds must be on a folder that all machines share.
    deadline
        Seconds an agent of yours has for an action; 0 waits for it as long as it takes.
    force
        Replace what this verb made there before; refused if the folder holds anything else.
    json
        Print what was made as JSON.
    """

    out: Path
    to: Literal["lerobot", "webdataset", "parquet"]
    world: Files = ()
    challenge: Literal["carry", "delivery", "search", "pick_place"] = "delivery"
    method: str = "heuristic"
    episodes: int = 0
    steps: int = 1500
    subtasks: int = 6
    assistants: int = 1
    first_seed: int = 0
    runs: Files = ()
    agents: tuple[str, ...] = ()
    outputs: str = "rgb"
    size: int = 128
    instruction: str = ""
    successes: bool = False
    drop_below: float = 0.0
    clip: float = 0.0
    test: float = 0.1
    validation: float = 0.0
    split_by: Literal["world", "person", "episode"] = "episode"
    workers: int = 0
    ray: RayAddress = None
    deadline: float = 60.0
    force: bool = False
    json: bool = False
