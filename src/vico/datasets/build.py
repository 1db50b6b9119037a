"""Making a dataset: episodes are played or runs read, part by part; then all is put together, in a fixed order.

A request says what the dataset is made of. Splits say which episodes are for training and which are kept apart, by
world, by person, or one by one.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from vico.challenges.assistant.tasks import CATEGORIES
from vico.challenges.episodes import code_digest
from vico.challenges.pick_place.episode import METHOD
from vico.challenges.pick_place.tasks import SECONDS
from vico.challenges.records import Job, Setting, foreign_parts, load_challenge
from vico.datasets.folder import DATASET_FOLDER, RECORD, Dataset, card_of, write_tables
from vico.datasets.formats.registry import FORMATS
from vico.datasets.layout import Contents, Layout, PartEpisode, key_of, read_part
from vico.datasets.pictures import PICTURES
from vico.datasets.worker import CHALLENGE, PickPlaceJob, chosen_agents, plain_job
from vico.errors import EmptyInputError, InputError
from vico.io.files import (
    FolderLock,
    check_replaceable,
    put_in_place,
    read_json,
    remove_path,
    sha256_of,
    write_bytes,
    write_errors,
    write_json,
)
from vico.io.stores import FolderStore
from vico.jobs import Answer, Service, Task, open_executor
from vico.jobs.contract import shared_store_marker
from vico.runner.foreign import Terms
from vico.runner.loading import source_digest
from vico.sim.recording import read_run
from vico.world.folder import read_world

__all__ = [
    "SPLITS",
    "TEST",
    "TRAIN",
    "VALIDATION",
    "BuildRequest",
    "Built",
    "By",
    "Contents",
    "Member",
    "SplitRule",
    "assign",
    "build_dataset",
    "layout_of",
    "made_from",
    "tasks_of",
]
By = Literal["world", "person", "episode"]
TRAIN, VALIDATION, TEST = "train", "validation", "test"
#: In the order in which a dataset holds them.
SPLITS = (TRAIN, VALIDATION, TEST)


@dataclass(frozen=True)
class SplitRule:
    """Rule by which episodes are split.

    Attributes
    ----------
    by
        What is never in two splits: a world, a person, or only an episode itself. A person is whoever acts (residents)
        or asks (tasks); episodes that share a person stay together.
    test, validation
        Share of the episodes, at least, 0..1; 0 for none.
    seed
        Decides which.
    """

    by: By = "episode"
    test: float = 0.1
    validation: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        if not (self.test >= 0.0 and self.validation >= 0.0 and self.test + self.validation < 1.0):
            raise InputError(
                f"splits: test {self.test:g} and validation {self.validation:g}; give shares from 0, together below 1"
            )


@dataclass(frozen=True)
class Member:
    """Facts that decide in which split an episode is.

    Attributes
    ----------
    name
        Of the episode, unique.
    world
        Digest of its world.
    persons
        Who acts or asks in it.
    """

    name: str
    world: str
    persons: Sequence[str]


def assign(members: Sequence[Member], rule: SplitRule) -> list[str]:
    """Return the split of each episode.

    Raises
    ------
    InputError
        If there are too few groups that have nothing in common.
    """
    wanted = [(TEST, rule.test), (VALIDATION, rule.validation)]
    parts = [(split, share) for split, share in wanted if share > 0.0]
    groups = _groups(members, rule.by)
    if len(groups) < len(parts) + 1:
        raise InputError(
            f"splits: by {rule.by} there {'is one group' if len(groups) == 1 else f'are {len(groups)} groups'} of "
            f"episodes that share no {rule.by}, and {len(parts) + 1} are needed; take more worlds or persons, "
            "--split-by episode, or --test 0"
        )
    order = sorted(groups, key=lambda name: hashlib.sha256(f"{rule.seed}\0{name}".encode()).digest())
    found = dict.fromkeys(range(len(members)), TRAIN)
    for split, share in parts:
        _fill(found, split, share, order, groups, len(parts))
    return [found[k] for k in range(len(members))]


def _fill(
    found: dict[int, str],
    split: str,
    share: float,
    order: list[str],
    groups: Mapping[str, Sequence[int]],
    parts: int,
) -> None:
    """Move groups into a split until it has its share; one group at least, and one is left for every other split."""
    taken = 0
    while order and (not taken or taken < share * len(found)):
        if taken and len(order) <= parts:
            return
        for member in groups[order.pop(0)]:
            found[member] = split
            taken += 1


def _groups(members: Sequence[Member], by: By) -> dict[str, list[int]]:
    """Return the episodes that have to stay together, by the name of the group."""
    keys = [_keys(member, by) for member in members]
    root: dict[str, str] = {key: key for mine in keys for key in mine}

    def find(key: str) -> str:
        while root[key] != key:
            root[key] = root[root[key]]
            key = root[key]
        return key

    for mine in keys:
        for key in mine[1:]:
            first, second = sorted((find(mine[0]), find(key)))
            root[second] = first
    groups: dict[str, list[int]] = {}
    for k, mine in enumerate(keys):
        groups.setdefault(find(mine[0]), []).append(k)
    return groups


def _keys(member: Member, by: By) -> list[str]:
    if by == "world":
        return [member.world]
    if by == "person" and member.persons:
        return [f"{member.world} {person}" for person in member.persons]
    return [member.name]


@dataclass(frozen=True)
class BuildRequest:
    """Request for a dataset: what it is made of, and how.

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
    _check_request(request)
    contents = request.contents.record()
    tasks: list[dict[str, Any]] = []
    if request.runs:
        given = request.worlds[0] if request.worlds else None
        for index, path in enumerate(request.runs):
            run = read_run(path)
            chosen_agents(run, request.contents)  # what is wrong with a run is said before anything is made
            decides = {"run": run.manifest["identity"], "hashes": run.hashes[-1], "last": run.last}
            here = run.path.resolve()
            about = [here / "episode.json", here / "task.json", here.parent.parent / "episodes" / f"{here.name}.json"]
            decides |= {"files": [sha256_of(one) for one in about if one.exists()], "contents": contents}
            where = {"run": str(path.resolve()), "world": None if given is None else str(given.resolve())}
            tasks.append({**where, "label": str(path), "near": "", **_part_name(index, key_of(decides))})
        return tasks
    if request.category == CHALLENGE:
        return _pick_place_tasks(request)
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
        tasks.append({"job": plain, "label": label, "near": str(world), **_part_name(index, key_of(decides))})
    return tasks


def _pick_place_tasks(request: BuildRequest) -> list[dict[str, Any]]:
    """Return the tasks of pick-and-place episodes, over the worlds in turn, or in a field without any."""
    contents, code = request.contents.record(), code_digest()
    worlds = [(str(world), read_world(world).digest) for world in request.worlds] or [("", "")]
    tasks: list[dict[str, Any]] = []
    for index in range(request.episodes):
        world, digest = worlds[index % len(worlds)]
        seed = request.first_seed + index // len(worlds)
        job = PickPlaceJob(world, seed, request.seconds)
        decides = {**job.record(), "world": digest, "code": code, "contents": contents}
        named = _part_name(index, key_of(decides))
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


def _part_name(index: int, key: str) -> dict[str, str]:
    return {"key": key, "folder": f"{index:06d}.{key[:16]}"}


def _check_request(request: BuildRequest) -> None:
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
    drop, clip = request.contents.drop_below, request.clip
    if not (drop >= 0.0 and 0.0 <= clip < 0.5):
        raise InputError(
            f"dataset: increments below {drop} dropped, a share of {clip} cut at each end; give 0 or more, and 0 up to "
            "less than 0.5"
        )
    if (drop or clip) and request.category != CHALLENGE:
        raise InputError(f"dataset: only actions of {CHALLENGE} are increments, of which small ones are dropped or cut")
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


#: Told how many of how many episodes are there, and how many of their frames.
Report = Callable[[int, int], None]

#: What makes the parts.
MAKER = "vico.datasets.worker:player"
_MARK = "build.json"
_MARKED = {"schema_name": "vico.dataset.build", "version": 1}


@dataclass(frozen=True)
class Built:
    """Result of a build.

    Attributes
    ----------
    out
        The dataset's folder.
    record
        Its ``dataset.json``.
    missing
        Why episodes are not in it, in words.
    """

    out: Path
    record: Mapping[str, Any]
    missing: Sequence[str]


def build_dataset(request: BuildRequest, out: Path, *, force: bool = False, report: Report | None = None) -> Built:
    """Make a dataset.

    Parameters
    ----------
    out
        Folder to make.
    force
        Replace what is there.

    Raises
    ------
    InputError, EmptyInputError, MissingFileError, SchemaError
        If the request cannot be met, or no episode comes of it. What was made by then is kept for the next try.
    OutputExistsError, OutputError
        If `out` holds something, or cannot be written.
    """
    tasks = tasks_of(request)
    check_replaceable(out, force=force, kind=DATASET_FOLDER)
    partial = out.with_name(f"{out.name}.partial")
    # The folder of the parts is taken up where it is one; what a kill left while the mark was written is ours, too.
    if partial.is_dir() and any(not path.name.startswith(f".{_MARK}") for path in partial.iterdir()):
        if not (partial / _MARK).exists() or read_json(partial / _MARK) != _MARKED:
            raise InputError(f"{partial}: holds something else than parts of a dataset; choose another --out")
    else:
        with write_errors(partial):
            partial.mkdir(parents=True, exist_ok=True)
        write_json(partial / _MARK, _MARKED)
    with FolderLock(partial, name=out):
        parts = partial / "parts"
        remove_path(parts / ".scratch")
        shared = FolderStore(parts)
        options = {"parts": str(shared), "contents": request.contents.record()}
        reasons: dict[int, str] = {}

        def note_answer(index: int, answer: Answer) -> None:
            reasons[index] = answer.reason
            if report is not None:
                report(len(reasons), len(tasks))

        with (
            open_executor(workers=max(1, min(request.workers, len(tasks))), ray=request.ray) as executor,
            shared_store_marker(shared, executor) as seen,
        ):
            service = Service(MAKER, {**options, "seen": seen, "code": code_digest()})
            executor.run(service, [Task(task, near=task["near"]) for task in tasks], done=note_answer)
        missing = [f"{tasks[k]['label']}: {' '.join(reasons[k].split())}" for k in sorted(reasons) if reasons[k]]
        episodes = [episode for task in tasks for episode in read_part(parts / task["folder"], task["key"]) or []]
        if request.successes:
            episodes = [episode for episode in episodes if episode.about["success"]]
        if not episodes:
            why = missing[0] if missing else "none of them was a success"
            raise EmptyInputError(f"dataset: none of {len(tasks)} episodes is of use; {why}")
        layout = layout_of(request, episodes)
        record = _write_dataset(partial / "dataset", layout, request, missing)
        with write_errors(out):
            put_in_place(partial / "dataset", out)
            remove_path(partial)
    return Built(out, record, missing)


def layout_of(request: BuildRequest, episodes: Sequence[PartEpisode]) -> Layout:
    """Return episodes in the order in which the dataset holds them: those of a split follow each other."""
    members = [
        Member(str(k), str(one.about["world"]["digest"]), one.about["persons"]) for k, one in enumerate(episodes)
    ]
    splits = assign(members, request.rule)
    order = [k for split in SPLITS for k in range(len(episodes)) if splits[k] == split]
    bounds: dict[str, tuple[int, int]] = {}
    before = 0
    for split in SPLITS:
        if count := splits.count(split):
            bounds[split] = (before, before + count)
            before += count
    return Layout(request.contents, [episodes[k] for k in order], bounds, request.clip)


def _write_dataset(folder: Path, layout: Layout, request: BuildRequest, missing: Sequence[str]) -> Mapping[str, Any]:
    """Write the dataset into a folder that is made anew; return what ``dataset.json`` says."""
    remove_path(folder)
    folder.mkdir()
    FORMATS[layout.contents.to].assemble(folder, layout)
    write_tables(folder, layout)
    made = made_from(request)
    record = Dataset.record_of(layout, made, missing)
    size = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
    write_bytes(folder / "README.md", card_of(layout, record, size).encode())
    files = {
        path.relative_to(folder).as_posix(): sha256_of(path) for path in sorted(folder.rglob("*")) if path.is_file()
    }
    record = {**record, "files": files}
    write_json(folder / RECORD, record)  # the last file of a dataset
    return record
