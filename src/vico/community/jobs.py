"""What people do for a living, and in which kinds of places."""

from __future__ import annotations

from vico.community.catalogue import Job, fallback_trades, trades
from vico.community.place_index import kind_of
from vico.io.data_files import cached_data
from vico.world.model import Category, Place


def jobs_at(place: Place) -> list[Job]:
    """Return the trades that a place employs; empty for places where nobody works."""
    kind = kind_of(place)
    if kind in _kinds():
        return [job for job in trades() if kind in job.kinds]
    fallback = fallback_trades()
    return [fallback[place.category]] if place.category in fallback else []


def job_of(occupation: str) -> Job | None:
    """Return the trade that an occupation names, e.g. ``barista`` or ``senior barista``; None if it is none we know."""
    words = occupation.lower()
    found = [job for title, job in _by_title().items() if words == title or words.endswith(" " + title)]
    return max(found, key=lambda job: len(job.title), default=None)


def works_at(occupation: str, place: Place) -> bool:
    """Whether somebody of this occupation may work at a place; an unknown occupation may work where anybody does."""
    job = job_of(occupation)
    if job is None:
        return place.category not in (Category.TRANSIT,)
    return job in jobs_at(place)


@cached_data
def _by_title() -> dict[str, Job]:
    return {job.title.lower(): job for job in (*trades(), *fallback_trades().values())}


@cached_data
def _kinds() -> frozenset[str]:
    return frozenset(kind for job in trades() for kind in job.kinds)
