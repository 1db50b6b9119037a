"""Segments of a run: folders named by their first and last step, each of which appears whole or not at all."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq

from vico.errors import SchemaError
from vico.io.files import write_bytes
from vico.sim.recording.schema import SEGMENTS, TABLES, empty_table

_NAME = re.compile(r"(\d{8,})-(\d{8,})")


class Segment(NamedTuple):
    """Some steps in a row, recorded.

    Attributes
    ----------
    first, last
        The first and the last of its steps.
    path
        Its folder.
    """

    first: int
    last: int
    path: Path


def segments_of(run: Path) -> list[Segment]:
    """Return the segments of a run in the order of their steps, as far as they follow each other without a gap."""
    folder = run / SEGMENTS
    matches = ((_NAME.fullmatch(path.name), path) for path in (folder.iterdir() if folder.is_dir() else ()))
    found = sorted(Segment(int(match[1]), int(match[2]), path) for match, path in matches if match is not None)
    whole: list[Segment] = []
    for segment in found:
        if segment.first != (whole[-1].last + 1 if whole else 0):
            break
        whole.append(segment)
    return whole


def write_segment(run: Path, first: int, last: int, tables: Mapping[str, pa.Table]) -> None:
    """Write a segment; tables without rows are left out."""
    folder = run / SEGMENTS / f"{first:08d}-{last:08d}"
    with written_folder(folder) as work:
        for name, table in tables.items():
            if table.num_rows:
                write_bytes(work / f"{name}.parquet", _parquet(name, table))


def read_table(segment: Segment, name: str) -> pa.Table:
    """Return a table of a segment.

    Raises
    ------
    SchemaError
        If its file is damaged.
    """
    path = segment.path / f"{name}.parquet"
    if not path.exists():
        return empty_table(name)
    try:
        return pq.read_table(path, memory_map=False)
    except (pa.ArrowException, OSError) as error:
        raise SchemaError(f"{path}: not readable ({' '.join(str(error).split())}); run it anew") from None


def drop_after(run: Path, step: int) -> None:
    """Delete what was recorded after a step, and what an interrupted writer left unfinished."""
    kept = {segment.path for segment in segments_of(run) if segment.last <= step}
    folder = run / SEGMENTS
    for path in list(folder.iterdir()) if folder.is_dir() else ():
        if path not in kept:
            shutil.rmtree(path)


class written_folder:
    """A folder that takes its name when the block ends well: what it holds is then on the disk."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._work = folder.with_name(f".{folder.name}.partial")

    def __enter__(self) -> Path:
        shutil.rmtree(self._work, ignore_errors=True)
        self._work.mkdir(parents=True)
        return self._work

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None:
            shutil.rmtree(self._work, ignore_errors=True)
            return
        # A checkpoint may be taken twice after one step, when somebody has done something in between.
        shutil.rmtree(self._folder, ignore_errors=True)
        os.replace(self._work, self._folder)
        handle = os.open(self._folder.parent, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _parquet(name: str, table: pa.Table) -> bytes:
    """Return a table as Parquet: whole numbers by their differences, text and flags by dictionary, zstd over all."""
    differences = dict.fromkeys(_whole_numbers(name), "DELTA_BINARY_PACKED")
    others = [key for key in table.column_names if key not in differences]
    sink = pa.BufferOutputStream()
    pq.write_table(
        table,
        sink,
        compression="zstd",
        compression_level=9,
        use_dictionary=others,
        column_encoding=differences,
        write_statistics=["step"],
        store_schema=False,
    )
    return bytes(sink.getvalue().to_pybytes())


def _whole_numbers(name: str) -> Iterable[str]:
    return [key for key, column in TABLES[name].items() if column.kind == pa.int32()]
