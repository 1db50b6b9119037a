"""Rows of GeoParquet files that may touch a window; row groups elsewhere are not read."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from vico.errors import MissingFileError, SchemaError

_BATCH = 4096

Box = tuple[float, float, float, float]
"""West, south, east, north, degrees."""


def parquet_files(paths: Sequence[Path], *, what: str) -> list[Path]:
    """Return the files among paths and within folders, by name.

    Parameters
    ----------
    paths
        Files, or folders of files.
    what
        What to give, for the error.

    Raises
    ------
    MissingFileError
        If there is no such file, or no ``.parquet`` in a folder.
    """
    files: list[Path] = []
    for path in paths:
        inside = sorted(Path(path).rglob("*.parquet")) if Path(path).is_dir() else [Path(path)]
        if not inside or not inside[0].is_file():
            raise MissingFileError(f"{path}: no such file, or no .parquet in it; give {what}")
        files += inside
    return files


def rows_near(
    path: Path, boxes: Sequence[Box], *, columns: Sequence[str], needed: Sequence[str], give: str
) -> Iterator[dict[str, Any]]:
    """Rows of a file whose box touches one of these; all rows where they have no box.

    Parameters
    ----------
    path
        The file.
    boxes
        Where to look.
    columns
        Which columns are wanted; those that are not there are left out.
    needed
        Columns that must be there.
    give
        What to give instead of a file without them, for the error.

    Raises
    ------
    SchemaError
        If it is not readable, or has not the columns.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(path) as file:
            there = [name for name in columns if name in file.schema_arrow.names]
            missing = [name for name in needed if name not in there]
            if missing:
                raise SchemaError(f"{path}: has no column {missing[0]}; give {give}")
            groups = [k for k in range(file.num_row_groups) if _touches(file.metadata.row_group(k), boxes)]
            for batch in file.iter_batches(batch_size=_BATCH, row_groups=groups, columns=there):
                for row in batch.to_pylist():
                    if _near(row.get("bbox"), boxes):
                        yield row
    except (pa.ArrowException, OSError, UnicodeDecodeError, OverflowError) as error:
        reason = str(error).splitlines()[0][:160] if str(error) else type(error).__name__
        raise SchemaError(f"{path}: not readable GeoParquet ({reason}); download it again") from None


def _touches(group: Any, boxes: Sequence[Box]) -> bool:
    """Whether a row group's statistics allow rows in the boxes; true where there are none."""
    bounds: dict[str, tuple[float, float]] = {}
    for k in range(group.num_columns):
        column = group.column(k)
        if column.path_in_schema.startswith("bbox.") and column.is_stats_set and column.statistics.has_min_max:
            bounds[column.path_in_schema[5:]] = (column.statistics.min, column.statistics.max)
    if not {"xmin", "xmax", "ymin", "ymax"} <= bounds.keys():
        return True
    return any(
        bounds["xmin"][0] <= east + 1e-5 and bounds["xmax"][1] >= west - 1e-5
        and bounds["ymin"][0] <= north + 1e-5 and bounds["ymax"][1] >= south - 1e-5
        for west, south, east, north in boxes
    )  # fmt: skip


def _near(box: Any, boxes: Sequence[Box]) -> bool:
    """Whether a row's box touches one of the boxes; true where it has none. Stored as 32 bits, so with some slack."""
    if not isinstance(box, dict):
        return True
    try:
        x0, x1, y0, y1 = (float(box[k]) for k in ("xmin", "xmax", "ymin", "ymax"))
    except (KeyError, TypeError, ValueError):
        return True
    return any(
        x0 <= east + 1e-4 and x1 >= west - 1e-4 and y0 <= north + 1e-4 and y1 >= south - 1e-4
        for west, south, east, north in boxes
    )
