"""What a dataset is asked to be made of, and the parts that this comes to."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from vico.challenges.assistant.model import CATEGORIES
from vico.challenges.episodes import code_digest
from vico.challenges.pick_place.demonstrator import METHOD
from vico.challenges.pick_place.task import SECONDS
from vico.challenges.records import Job, Setting
from vico.challenges.registry import foreign_parts, load_challenge
from vico.datasets.formats.registry import FORMATS
from vico.datasets.parts import Contents, key_of
from vico.datasets.pick_place import CHALLENGE, PickPlaceJob
from vico.datasets.pictures import PICTURES
from vico.datasets.splits import SplitRule
from vico.datasets.worker import chosen_agents, plain_job
from vico.errors import InputError
from vico.io.files import sha256_of
from vico.runner.foreign import Terms
from vico.runner.loading import source_digest
from vico.sim.recording import read_run
from vico.world.folder import read_world


@dataclass(frozen=True)
class BuildRequest:
    """What a dataset is to be made of, and how.

    Attributes
    ----------
    contents
        What every frame holds, and the format.
    runs
        Folders of recorded runs; either these, or worlds to play in.
    worlds
        World folders.
    category, method, setting
        What is played, by whom (`vico eval assistant`), in which setting.
    seconds
        That an episode of pick and place may last; there are neither methods nor settings of it.
    episodes
        How many, over the worlds in turn.
    first_seed
        Of the first episode of each world.
    terms
        On which terms planners from elsewhere take part.
    rule
        How episodes are split.
    successes
        Keep only episodes in which all was done.
    clip
        Of increments: share of the smallest and of the largest of all that are cut to the next one.
    workers
        Processes side by side; decides nothing but how long it takes.
    ray
        A Ray cluster that makes the parts instead, see `vico.jobs.open_executor`; its machines share the folder.
    """

    contents: Contents
    runs: tuple[Path, ...] = ()
    worlds: tuple[Path, ...] = ()
    category: str = "delivery"
    method: str = "heuristic"
    setting: Setting = field(default_factory=dict)
    seconds: int = SECONDS
    episodes: int = 0
    first_seed: int = 0
    terms: Terms = field(default_factory=Terms)
    rule: SplitRule = field(default_factory=SplitRule)
    successes: bool = False
    clip: float = 0.0
    workers: int = 1
    ray: str | None = None


def tasks_of(request: BuildRequest) -> list[dict[str, Any]]:
    """Return what `vico.datasets.worker.player` is asked for, one a part, in their order.

    Raises
    ------
    InputError, MissingFileError, SchemaError
        If the request cannot be met.
    """
    _check(request)
    contents = request.contents.record()
    tasks: list[dict[str, Any]] = []
    if request.runs:
        given = request.worlds[0] if request.worlds else None
        for index, path in enumerate(request.runs):
            run = read_run(path)
            chosen_agents(run, request.contents)  # what is wrong with a run is said before anything is made
            decides = {"run": run.manifest["identity"], "hashes": run.hashes[-1], "last": run.last}
            decides |= {"files": _beside(run.path), "contents": contents}
            where = {"run": str(path.resolve()), "world": None if given is None else str(given.resolve())}
            tasks.append({**where, "label": str(path), "near": "", **_named(index, key_of(decides))})
        return tasks
    if request.category == CHALLENGE:
        return _shown_tasks(request)
    digests = [read_world(world).digest for world in request.worlds]
    code = code_digest()
    foreign = [part for part in foreign_parts(load_challenge("assistant"), request.method) if ":" in part]
    sources = [source_digest(part) for part in foreign]
    for index in range(request.episodes):
        which, seed = index % len(request.worlds), request.first_seed + index // len(request.worlds)
        world = request.worlds[which]
        job = Job("assistant", request.category, request.method, request.setting, world, seed, request.terms)
        plain = plain_job(job)
        decides = {**plain, "world": digests[which], "code": code, "sources": sources, "contents": contents}
        label = f"{request.category}, {world.name}, seed {seed}"
        tasks.append({"job": plain, "label": label, "near": str(world), **_named(index, key_of(decides))})
    return tasks


def _shown_tasks(request: BuildRequest) -> list[dict[str, Any]]:
    """Return the tasks of pick-and-place episodes, over the worlds in turn, or in a field without any."""
    contents, code = request.contents.record(), code_digest()
    worlds = [(str(world), read_world(world).digest) for world in request.worlds] or [("", "")]
    tasks: list[dict[str, Any]] = []
    for index in range(request.episodes):
        world, digest = worlds[index % len(worlds)]
        seed = request.first_seed + index // len(worlds)
        job = PickPlaceJob(world, seed, request.seconds)
        decides = {**job.record(), "world": digest, "code": code, "contents": contents}
        named = _named(index, key_of(decides))
        tasks.append({"job": job.record(), "label": job.label, "near": world, **named})
    return tasks


def made_from(request: BuildRequest) -> dict[str, Any]:
    """Return what of a request belongs into the dataset; no paths, for they are of one machine."""
    made: dict[str, Any] = {"successes_only": request.successes, "split_by": request.rule.by}
    if request.category == CHALLENGE:
        return made | {
            "challenge": CHALLENGE,
            "category": CHALLENGE,
            "method": METHOD,
            "setting": {"seconds": request.seconds, "drop_below": request.contents.drop_below, "clip": request.clip},
            "episodes": request.episodes,
            "first_seed": request.first_seed,
        }
    if request.runs:
        return made | {"runs": len(request.runs)}
    return made | {
        "challenge": "assistant",
        "category": request.category,
        "method": request.method.rpartition("/")[2],
        "setting": dict(request.setting),
        "episodes": request.episodes,
        "first_seed": request.first_seed,
    }


def _named(index: int, key: str) -> dict[str, str]:
    return {"key": key, "folder": f"{index:06d}.{key[:16]}"}


def _beside(run: Path) -> list[str]:
    """Return hashes of what is said of a run's episode."""
    path = run.resolve()
    beside = [path / "episode.json", path / "task.json", path.parent.parent / "episodes" / f"{path.name}.json"]
    return [sha256_of(one) for one in beside if one.exists()]


def _check(request: BuildRequest) -> None:
    contents = request.contents
    if contents.to not in FORMATS:
        raise InputError(f"dataset: no format {contents.to!r}; there are {', '.join(FORMATS)}")
    if unknown := [name for name in contents.outputs if name not in PICTURES]:
        raise InputError(f"dataset: no output {unknown[0]!r}; there are {', '.join(PICTURES)}, or none")
    if not 16 <= contents.size <= 1024 or (FORMATS[contents.to].even and contents.size % 2):
        raise InputError(f"dataset: pictures of {contents.size} pixels; give an even number in 16..1024")
    if not 1 <= request.workers <= 256:
        raise InputError(f"dataset: {request.workers} workers; give 1 to 256")
    if request.runs:
        if request.episodes or len(request.worlds) > 1:
            raise InputError("dataset: give recorded runs, or worlds and a number of episodes to play, not both")
        if len({path.resolve() for path in request.runs}) < len(request.runs):
            raise InputError("dataset: a run is given twice; its frames would count twice")
        return
    _check_increments(request)
    if request.category == CHALLENGE and request.episodes >= 1:
        return
    if not request.worlds or request.episodes < 1:
        raise InputError("dataset: give --runs, or --world and --episodes")
    if request.category not in CATEGORIES:
        raise InputError(
            f"dataset: no challenge {request.category!r}; episodes are played of {', '.join(CATEGORIES)}, "
            f"{CHALLENGE}; of others give the runs that vico eval --record leaves, with --runs"
        )
    known = load_challenge("assistant")
    for part in foreign_parts(known, request.method):
        if ":" not in part:
            raise InputError(
                f"dataset: no method {part!r}; there are {', '.join(sorted(known.methods))}, or my_module:MyAgent"
            )


def _check_increments(request: BuildRequest) -> None:
    drop, clip = request.contents.drop_below, request.clip
    if not (drop >= 0.0 and 0.0 <= clip < 0.5):
        raise InputError(
            f"dataset: increments below {drop} dropped, a share of {clip} cut at each end; give 0 or more, and 0 up to "
            "less than 0.5"
        )
    if (drop or clip) and request.category != CHALLENGE:
        raise InputError(f"dataset: only actions of {CHALLENGE} are increments, of which small ones are dropped or cut")
