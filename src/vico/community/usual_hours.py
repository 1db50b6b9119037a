"""When places are usually open that don't say: data of ``vico/data/community/hours.toml`` and of a user's own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from vico.community.hours import DAYS, Span, open_spans
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
    """Spans of the seven days, Monday first, by kind or category of place, and of all others."""

    by_kind: Mapping[str, list[list[Span]]]
    otherwise: list[list[Span]]


@cached_data
def usual_hours() -> UsualHours:
    """Return when places are usually open; a kind has the hours that named it last.

    Raises
    ------
    SchemaError
        If a file can't be used, or hours can't be read.
    """
    by_kind: dict[str, list[list[Span]]] = {}
    otherwise: list[list[Span]] = [[] for _ in DAYS]
    for path in data_files("community", "hours"):
        file = read_record(path, _HoursFile, guide=_GUIDE)
        for k, entry in enumerate(file.usual):
            by_kind |= dict.fromkeys(entry.kinds, _week(path, f"usual.{k}.hours", entry.hours))
        if file.otherwise is not None:
            otherwise = _week(path, "otherwise", file.otherwise)
    return UsualHours(by_kind, otherwise)


def usual_spans(kind: str, category: str, weekday: int = 1) -> list[Span]:
    """When a place of this kind is usually open on a day, minutes; empty where it is closed.

    Parameters
    ----------
    weekday
        0 Monday .. 6 Sunday; a working day unless given.
    """
    usual = usual_hours()
    week = usual.by_kind.get(kind) or usual.by_kind.get(category, usual.otherwise)
    return list(week[weekday])


def _week(path: Path, where: str, text: str) -> list[list[Span]]:
    week = [open_spans(text, day) or [] for day in range(len(DAYS))]
    if not any(week[:5]):
        raise SchemaError(f"{path}: {where}: {text!r} says no hours of a working day; write them like 09:00-17:00")
    return week
