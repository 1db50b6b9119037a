"""Bookmarks of a run: steps that somebody wants to find again, in its folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from vico.errors import InputError
from vico.io.files import read_json, write_json

#: Name of the file.
FILE = "bookmarks.json"

_MOST = 1000


def bookmarks_of(run: Path) -> list[dict[str, Any]]:
    """Return the bookmarks of a run: ``step``, ``time`` in seconds and ``text`` of each, by step."""
    path = run / FILE
    return list(read_json(path)["bookmarks"]) if path.exists() else []


def add_bookmark(run: Path, *, step: int, time: float, text: str) -> None:
    """Add a bookmark.

    Raises
    ------
    InputError
        If there are too many.
    """
    kept = bookmarks_of(run)
    if len(kept) >= _MOST:
        raise InputError(f"bookmark: there are {_MOST} already")
    kept.append({"step": step, "time": time, "text": text})
    write_json(run / FILE, {"bookmarks": sorted(kept, key=lambda one: one["step"])})
