"""Pick-and-place episodes as a source of datasets: shown by the arm's own skills in the real simulation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from vico.challenges.pick_place.demonstrations import FPS, STATE, Demonstrated, demonstrate
from vico.challenges.pick_place.demonstrator import METHOD
from vico.challenges.pick_place.field import ENTITY_TABLE, level_field
from vico.challenges.pick_place.task import SECONDS
from vico.datasets.demonstrations import Demonstration
from vico.datasets.episode_records import Origin
from vico.datasets.increments import IncrementForm
from vico.datasets.parts import Contents
from vico.datasets.pictures import KeptPictures, PictureKeeper
from vico.datasets.tasks import EpisodeFacts
from vico.errors import EmptyInputError
from vico.rules import ActionStatus
from vico.version import __version__
from vico.world.folder import read_world
from vico.world.world import World

#: Name of the challenge; what `--world` says of the level field.
CHALLENGE, FIELD = "pick_place", "field"
_ROBOT = "robot_0"


@dataclass(frozen=True)
class PickPlaceJob:
    """An episode to show.

    Attributes
    ----------
    world
        World folder whose streets it is set in; "" for a level field.
    seed
        Of the task.
    seconds
        That it may last.
    """

    world: str
    seed: int
    seconds: int = SECONDS

    def record(self) -> dict[str, Any]:
        """Return it as JSON."""
        return {"challenge": CHALLENGE, "world": self.world, "seed": self.seed, "seconds": self.seconds}

    @property
    def label(self) -> str:
        """What it is called in messages."""
        return f"{CHALLENGE}, {Path(self.world).name or FIELD}, seed {self.seed}"


def shown(job: Mapping[str, Any], contents: Contents, work: Path) -> tuple[Demonstration, KeptPictures, Origin]:
    """Show an episode; return what it was as a demonstration, its pictures, and where it comes from.

    Parameters
    ----------
    job
        Of `PickPlaceJob.record`.
    work
        Folder for pictures.

    Raises
    ------
    EmptyInputError
        If nothing was done in it.
    """
    world = _world(job["world"])
    keeper = PictureKeeper(work / "pictures", [_ROBOT], size=contents.size, outputs=contents.outputs)
    made = demonstrate(
        job["seed"],
        world,
        seconds=job["seconds"],
        side=contents.size,
        drop_below=contents.drop_below,
        seen=lambda step, observation: keeper.keep(step, {_ROBOT: observation}),
    )
    if not len(made.kept):
        raise EmptyInputError(f"{CHALLENGE}: seed {job['seed']}: nothing was done in it ({made.played.why})")
    return _demonstration(made), keeper.close(), _origin(made, world or level_field(0))


def _demonstration(made: Demonstrated) -> Demonstration:
    kept, played, task = made.kept, made.played, made.task
    return Demonstration(
        agent=_ROBOT,
        kind="robot",
        body="manipulator",
        person="",
        steps=kept,
        fps=FPS,
        state_names=STATE,
        form=IncrementForm(),
        state=played.states[kept],
        action=played.actions[kept],
        goal=None,
        text=[""] * len(kept),
        status=np.full(len(kept), ActionStatus.OK.value, np.int64),
        instructions=[task.instruction] * len(kept),
        success=played.success,
        facts=EpisodeFacts(CHALLENGE, task.source + " to " + task.destination, METHOD, task.seed, played.success),
    )


def _origin(made: Demonstrated, world: World) -> Origin:
    return Origin(
        {"name": world.manifest.name if world.path is None else world.path.name, "digest": world.digest},
        [source.model_dump(mode="json") for source in world.manifest.sources],
        "",
        f"vico {__version__}",
        int((np.diff(made.kept) > 1).sum()),
        [{ENTITY_TABLE: {"kind": "table", "name": "table"}}, world.entities],
    )


def _world(path: str) -> World | None:
    return _read(Path(path)) if path else None


@lru_cache(maxsize=2)
def _read(path: Path) -> World:
    return read_world(path)
