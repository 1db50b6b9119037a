"""Making a dataset: episodes are played or runs read, each part by itself; then all is put together, in a fixed order.

Parts lie in a neighbour of the dataset, ``OUT.partial``, and appear whole or not at all: a build that was stopped,
however that happened, goes on with those that are missing, and comes to the same bytes. The dataset's own folder
appears whole.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from vico.challenges.assistant.model import CATEGORIES
from vico.challenges.episodes import code_digest
from vico.challenges.records import Job, Setting
from vico.challenges.registry import foreign_parts, load_challenge
from vico.datasets.card import card_of
from vico.datasets.folder import Dataset, write_dataset_record, write_tables
from vico.datasets.formats.registry import FORMATS
from vico.datasets.layout import Layout
from vico.datasets.parts import Contents, PartEpisode, key_of, read_part
from vico.datasets.pictures import PICTURES
from vico.datasets.splits import SPLITS, Member, SplitRule, assign
from vico.datasets.worker import chosen_agents, plain_job
from vico.errors import EmptyInputError, InputError
from vico.io.files import read_json, sha256_of, write_bytes, write_errors, write_json
from vico.io.folders import FolderLock, check_replaceable, put_in_place, remove
from vico.io.stores import FolderStore
from vico.jobs import Answer, Service, Task, open_executor
from vico.jobs.shared import seen_by_all
from vico.runner.foreign import Terms
from vico.runner.loading import source_digest
from vico.sim.recording import read_run
from vico.world.folder import read_world

#: Told how many of how many episodes are there, and how many of their frames.
Report = Callable[[int, int], None]

#: What makes the parts.
MAKER = "vico.datasets.worker:player"
_MARK = "build.json"
_MARKED = {"schema_name": "vico.dataset.build", "version": 1}


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
    episodes: int = 0
    first_seed: int = 0
    terms: Terms = field(default_factory=Terms)
    rule: SplitRule = field(default_factory=SplitRule)
    successes: bool = False
    workers: int = 1
    ray: str | None = None


@dataclass(frozen=True)
class Built:
    """What came of a build.

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
    check_replaceable(out, force=force)
    partial = out.with_name(f"{out.name}.partial")
    _take(partial)
    with FolderLock(partial, name=out):
        parts = partial / "parts"
        remove(parts / ".scratch")
        shared = FolderStore(parts)
        options = {"parts": str(shared), "contents": request.contents.record()}
        reasons: dict[int, str] = {}

        def done(index: int, answer: Answer) -> None:
            reasons[index] = answer.reason
            if report is not None:
                report(len(reasons), len(tasks))

        with (
            open_executor(workers=max(1, min(request.workers, len(tasks))), ray=request.ray) as executor,
            seen_by_all(shared, executor) as seen,
        ):
            service = Service(MAKER, {**options, "seen": seen, "code": code_digest()})
            executor.run(service, [Task(task, near=task["near"]) for task in tasks], done=done)
        missing = [f"{tasks[k]['label']}: {' '.join(reasons[k].split())}" for k in sorted(reasons) if reasons[k]]
        episodes = [episode for task in tasks for episode in read_part(parts / task["folder"], task["key"]) or []]
        if request.successes:
            episodes = [episode for episode in episodes if episode.about["success"]]
        if not episodes:
            why = missing[0] if missing else "none of them was a success"
            raise EmptyInputError(f"dataset: none of {len(tasks)} episodes is of use; {why}")
        layout = layout_of(request, episodes)
        record = _assembled(partial / "dataset", layout, request, missing)
        with write_errors(out):
            put_in_place(partial / "dataset", out)
            remove(partial)
    return Built(out, record, missing)


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
    return Layout(request.contents, [episodes[k] for k in order], bounds)


def _assembled(folder: Path, layout: Layout, request: BuildRequest, missing: Sequence[str]) -> Mapping[str, Any]:
    """Write the dataset into a folder that is made anew; return what ``dataset.json`` says."""
    remove(folder)
    folder.mkdir()
    FORMATS[layout.contents.to].assemble(folder, layout)
    write_tables(folder, layout)
    made = _made_from(request)
    record = Dataset.record_of(layout, made, missing)
    write_bytes(folder / "README.md", card_of(layout, record, _size(folder)).encode())
    files = {
        path.relative_to(folder).as_posix(): sha256_of(path) for path in sorted(folder.rglob("*")) if path.is_file()
    }
    record = {**record, "files": files}
    write_dataset_record(folder, record)
    return record


def _made_from(request: BuildRequest) -> dict[str, Any]:
    """Return what of a request belongs into the dataset; no paths, for they are of one machine."""
    made: dict[str, Any] = {"successes_only": request.successes, "split_by": request.rule.by}
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


def _size(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def _take(partial: Path) -> None:
    """Make the folder of the parts, or take up the one that is there.

    Raises
    ------
    InputError
        If it is somebody else's.
    """
    # What a kill left while the mark was written is not somebody else's.
    if partial.is_dir() and any(not path.name.startswith(f".{_MARK}") for path in partial.iterdir()):
        if not (partial / _MARK).exists() or read_json(partial / _MARK) != _MARKED:
            raise InputError(f"{partial}: holds something else than parts of a dataset; choose another --out")
        return
    with write_errors(partial):
        partial.mkdir(parents=True, exist_ok=True)
    write_json(partial / _MARK, _MARKED)


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
    if not request.worlds or request.episodes < 1:
        raise InputError("dataset: give --runs, or --world and --episodes")
    if request.category not in CATEGORIES:
        raise InputError(
            f"dataset: no challenge {request.category!r}; episodes are played of {', '.join(CATEGORIES)}; of others "
            "give the runs that vico eval --record leaves, with --runs"
        )
    known = load_challenge("assistant")
    for part in foreign_parts(known, request.method):
        if ":" not in part:
            raise InputError(
                f"dataset: no method {part!r}; there are {', '.join(sorted(known.methods))}, or my_module:MyAgent"
            )


__all__ = ["BuildRequest", "Built", "Contents", "build_dataset", "layout_of", "tasks_of"]
