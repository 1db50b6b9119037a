"""When places are usually open that don't say: data of ``vico/data/community/hours.toml`` and of a user's own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from vico.community.hours import Span, open_spans
from vico.errors import SchemaError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record

_GUIDE = "docs/adding_people.md"


class _Usual(DataRecord):
    hours: str
    kinds: tuple[str, ...]


class _HoursFile(DataRecord):
    otherwise: str | None = None
    usual: tuple[_Usual, ...] = ()


@dataclass(frozen=True)
class UsualHours:
    """Spans of a working day by kind or category of place, and of all others."""

    by_kind: Mapping[str, list[Span]]
    otherwise: list[Span]


@cached_data
def usual_hours() -> UsualHours:
    """Return when places are usually open; a kind has the hours that named it last.

    Raises
    ------
    SchemaError
        If a file can't be used, or hours can't be read.
    """
    by_kind: dict[str, list[Span]] = {}
    otherwise: list[Span] = []
    for path in data_files("community", "hours"):
        file = read_record(path, _HoursFile, guide=_GUIDE)
        for k, entry in enumerate(file.usual):
            by_kind |= dict.fromkeys(entry.kinds, _spans(path, f"usual.{k}.hours", entry.hours))
        if file.otherwise is not None:
            otherwise = _spans(path, "otherwise", file.otherwise)
    return UsualHours(by_kind, otherwise)


def usual_spans(kind: str, category: str) -> list[Span]:
    """When a place of this kind is usually open on a working day."""
    usual = usual_hours()
    return list(usual.by_kind.get(kind) or usual.by_kind.get(category, usual.otherwise))


def _spans(path: Path, where: str, text: str) -> list[Span]:
    spans = open_spans(text, 1)
    if not spans:
        raise SchemaError(f"{path}: {where}: {text!r} says no hours of a working day; write them like 09:00-17:00")
    return spans
