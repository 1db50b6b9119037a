"""Making a dataset: episodes are played or runs read, each part by itself; then all is put together, in a fixed order.

Parts lie in a neighbour of the dataset, ``OUT.partial``, and appear whole or not at all: a build that was stopped,
however that happened, goes on with those that are missing, and comes to the same bytes. The dataset's own folder
appears whole.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vico.challenges.episodes import code_digest
from vico.datasets.card import card_of
from vico.datasets.folder import DATASET_FOLDER, Dataset, write_dataset_record, write_tables
from vico.datasets.formats.registry import FORMATS
from vico.datasets.layout import Layout
from vico.datasets.parts import Contents, PartEpisode, read_part
from vico.datasets.request import BuildRequest, made_from, tasks_of
from vico.datasets.splits import SPLITS, Member, assign
from vico.errors import EmptyInputError, InputError
from vico.io.files import read_json, sha256_of, write_bytes, write_errors, write_json
from vico.io.folders import FolderLock, check_replaceable, put_in_place, remove
from vico.io.stores import FolderStore
from vico.jobs import Answer, Service, Task, open_executor
from vico.jobs.shared import seen_by_all

#: Told how many of how many episodes are there, and how many of their frames.
Report = Callable[[int, int], None]

#: What makes the parts.
MAKER = "vico.datasets.worker:player"
_MARK = "build.json"
_MARKED = {"schema_name": "vico.dataset.build", "version": 1}


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
    check_replaceable(out, force=force, kind=DATASET_FOLDER)
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


def _assembled(folder: Path, layout: Layout, request: BuildRequest, missing: Sequence[str]) -> Mapping[str, Any]:
    """Write the dataset into a folder that is made anew; return what ``dataset.json`` says."""
    remove(folder)
    folder.mkdir()
    FORMATS[layout.contents.to].assemble(folder, layout)
    write_tables(folder, layout)
    made = made_from(request)
    record = Dataset.record_of(layout, made, missing)
    write_bytes(folder / "README.md", card_of(layout, record, _size(folder)).encode())
    files = {
        path.relative_to(folder).as_posix(): sha256_of(path) for path in sorted(folder.rglob("*")) if path.is_file()
    }
    record = {**record, "files": files}
    write_dataset_record(folder, record)
    return record


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


__all__ = ["BuildRequest", "Built", "Contents", "build_dataset", "layout_of", "tasks_of"]
