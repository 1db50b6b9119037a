"""Making one part of a dataset: play an episode, or read a recorded run, and encode what came of it.

Pick-and-place episodes are a source, too: shown by the arm's own skills in the real simulation.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from vico.challenges.assistant.challenge import ASSISTANT, EpisodeProgress, play_task, world_and_people
from vico.challenges.assistant.tasks import Task
from vico.challenges.episodes import code_digest
from vico.challenges.pick_place.episode import FPS, METHOD, STATE, demonstrate
from vico.challenges.pick_place.tasks import ENTITY_TABLE, SECONDS, level_field
from vico.challenges.records import Job
from vico.datasets.demonstrations import Demonstration, EpisodeFacts, demonstrations_of, facts_of_episode, facts_of_run
from vico.datasets.episodes import Origin, Tally, episode_record, origin_of_run
from vico.datasets.formats.registry import FORMATS
from vico.datasets.layout import Contents, read_part, write_part
from vico.datasets.pictures import KeptPictures, PictureFiles, PictureKeeper, PictureSource, RecordedPictures
from vico.datasets.vectors import IncrementForm
from vico.errors import EmptyInputError, InputError
from vico.io.stores import FolderStore
from vico.jobs.contract import check_same_code, check_shared_store
from vico.rules import ActionStatus
from vico.runner.foreign import Terms
from vico.runner.loop import Hook
from vico.sim.config import find_by_name
from vico.sim.recording import Run, read_run
from vico.version import __version__
from vico.world.folder import is_world, read_world
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
        """Name in messages."""
        return f"{CHALLENGE}, {Path(self.world).name or FIELD}, seed {self.seed}"


def demonstrate_job(
    job: Mapping[str, Any], contents: Contents, work: Path
) -> tuple[Demonstration, KeptPictures, Origin]:
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
    path = job["world"]
    world = _read_world(Path(path)) if path else None
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
    kept, played, task = made.kept, made.played, made.task
    stage = world or level_field(0)
    origin = Origin(
        {"name": stage.manifest.name if stage.path is None else stage.path.name, "digest": stage.digest},
        [source.model_dump(mode="json") for source in stage.manifest.sources],
        "",
        f"vico {__version__}",
        int((np.diff(kept) > 1).sum()),
        [{ENTITY_TABLE: {"kind": "table", "name": "table"}}, stage.entities],
    )
    return (
        Demonstration(
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
        ),
        keeper.close(),
        origin,
    )


Tell = Callable[[Mapping[str, Any]], None]
_KINDS = {"residents": "resident", "assistants": "assistant", "robots": "robot"}
# Beside the parts, so that it lies on the same disk; no part's name begins with a dot.
_SCRATCH = ".scratch"


def player(options: Mapping[str, Any], tell: Tell) -> Callable[[Mapping[str, Any]], Mapping[str, Any]]:
    """Return what makes parts.

    Parameters
    ----------
    options
        ``parts``: folder of the parts; ``contents``: `vico.datasets.layout.Contents`, as JSON; ``seen`` and ``code``: a
        file that other machines must see there (empty on this one), and the digest of the code that they must have.
    tell
        Told ``label``, ``step`` and ``limit`` while an episode is played.

    Returns
    -------
    callable
        Makes the part of a task: ``key`` and ``folder`` (its name), and either ``run`` (path) and ``world`` (path or
        null), or ``job`` (`plain_job`, or `PickPlaceJob.record`). Returns ``frames``; raises where there is no part to
        be made, and says why.
    """
    parts, contents = Path(options["parts"]), Contents.of(options["contents"])
    check_shared_store(FolderStore(parts), options["seen"])
    if options["seen"]:
        check_same_code(options["code"], code_digest())

    def make(task: Mapping[str, Any]) -> Mapping[str, Any]:
        folder = parts / str(task["folder"])
        made = read_part(folder, task["key"])
        if made is None:
            shutil.rmtree(folder, ignore_errors=True)
            scratch = parts / _SCRATCH
            scratch.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(dir=scratch, prefix=f"{task['folder']}.") as work:
                _make(task, folder, contents, Path(work), tell)
            made = read_part(folder, task["key"])
        assert made is not None
        return {"frames": sum(episode.frames for episode in made)}

    return make


def plain_job(job: Job) -> dict[str, Any]:
    """Return a job as JSON."""
    terms = {"deadline": job.terms.deadline, "isolate": job.terms.isolate, "memory": job.terms.memory}
    return {
        "category": job.category,
        "method": job.method,
        "setting": dict(job.setting),
        "world": str(job.world),
        "seed": job.seed,
        "terms": terms,
    }


def _make(task: Mapping[str, Any], folder: Path, contents: Contents, work: Path, tell: Tell) -> None:
    staged = work / "staged"
    staged.mkdir()
    if "job" in task and task["job"].get("challenge") == CHALLENGE:
        made, kept, origin = demonstrate_job(task["job"], contents, work)
        about = encode_demonstration(made, kept, PictureFiles(staged, "0"), contents, origin)
        write_part(folder, task["key"], [(about, made)], staged)
        return
    if "run" in task:
        run = read_run(Path(task["run"]))
        world = world_of_run(run, task.get("world"))
        facts = facts_of_run(run.path, int(run.manifest["seed"]))
        agents = chosen_agents(run, contents)
        pictures: PictureSource = RecordedPictures(run)
    else:
        run, facts, pictures, world = _play_episode(task["job"], contents, work, tell)
        agents = chosen_agents(run, contents)
    episodes = []
    for k, one in enumerate(demonstrations_of(run, facts, agents, instruction=contents.instruction)):
        about = encode_demonstration(
            one, pictures, PictureFiles(staged, str(k)), contents, origin_of_run(one, run, world)
        )
        episodes.append((about, one))
    write_part(folder, task["key"], episodes, staged)


def _play_episode(
    job: Mapping[str, Any], contents: Contents, work: Path, tell: Tell
) -> tuple[Run, EpisodeFacts, PictureSource, World]:
    """Play an episode, its run recorded and its pictures kept."""
    asked = Job(
        "assistant",
        job["category"],
        job["method"],
        job["setting"],
        Path(job["world"]),
        job["seed"],
        Terms(**job["terms"]),
    )
    content = ASSISTANT.task(asked)
    task = Task.model_validate(content)
    world, people = world_and_people(asked.world, task.category)
    names = [f"assistant_{i}" for i in range(len(task.assistants))]
    keeper = PictureKeeper(work / "pictures", names, size=contents.size, outputs=contents.outputs)

    def tell_step(label: str, step: int, limit: int) -> None:
        tell({"label": label, "step": step, "limit": limit})

    hooks: list[Hook] = [keeper, EpisodeProgress(tell_step, task)]
    record = play_task(
        world,
        people,
        task,
        method=asked.method,
        setting=asked.setting,
        terms=asked.terms,
        recording=work / "run",
        hooks=hooks,
    )
    if record.fault_counts.get("crashed", 0) >= record.steps:
        first = record.faults[0].reason if record.faults else ""
        raise InputError(f"{asked.method}: failed at every step of the episode ({first}); nothing was demonstrated")
    return read_run(work / "run"), facts_of_episode(record, content), keeper.close(), world


def encode_demonstration(
    demonstration: Demonstration,
    pictures: PictureSource,
    files: PictureFiles,
    contents: Contents,
    origin: Origin,
) -> dict[str, Any]:
    """Encode a demonstration's pictures; return what is said of it."""
    tally = Tally()
    if contents.outputs:
        writer = FORMATS[contents.to].writer(
            files, contents.outputs, size=contents.size, fps=demonstration.fps, frames=len(demonstration)
        )
        steps = demonstration.steps.tolist()
        for seen in pictures.of(demonstration.agent, steps, size=contents.size, outputs=contents.outputs):
            tally.add(seen)
            writer.add(seen)
        writer.close()
    return episode_record(demonstration, tally, origin)


def chosen_agents(run: Run, contents: Contents) -> list[str]:
    """Return the names of the agents whose demonstrations are taken.

    Raises
    ------
    InputError
        If there is nobody of a name, or nobody at all.
    """
    known = {agent["name"]: agent["kind"] for agent in run.agents}
    names = {name: called for name, called in run.names.items() if name in known}
    if contents.agents:
        found: list[str] = []
        for asked in contents.agents:
            of_kind = [name for name, kind in known.items() if kind == _KINDS.get(asked)]
            found += of_kind or [find_by_name(asked, names, option=f"{run.path}: agents")]
        return list(dict.fromkeys(found))
    seen = [name for name in known if name in run.views] if contents.outputs else list(known)
    assistants = [name for name, kind in known.items() if kind == "assistant"]
    # Who plays assistant_3 by hand has three beside them who stand about, seen by nobody.
    assistants = [name for name in assistants if name in seen] or assistants
    if not (assistants or seen):
        raise InputError(
            f"{run.path}: holds nobody's pictures: record it with --observe NAME, or build with --outputs none"
        )
    return assistants or seen


def world_of_run(run: Run, given: str | None) -> World | None:
    """Return the world of a run, if it is still there."""
    folder = Path(given) if given else run.source("world")
    if not is_world(folder):
        return None
    world = _read_world(folder)
    return world if world.digest == run.manifest["world"]["digest"] else None


@lru_cache(maxsize=2)
def _read_world(folder: Path) -> World:
    return read_world(folder)
