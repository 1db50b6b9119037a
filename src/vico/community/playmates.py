"""Groups of small children: where they play after school, with those who look after them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vico.community.catalogue import Circle, circles, playmates_circle
from vico.community.childhood import childhood
from vico.community.groups import Meeting
from vico.community.people import Duty, ResidentDraft
from vico.community.place_index import PlaceIndex, kind_of
from vico.community.schooling import Care
from vico.world.model import Category, Place

# Most children with their carers in a group; how far from home they play, metres; when they are back, minutes.
_MOST, _NEAR, _BACK = 9, 600.0, 19 * 60 + 20
# Where no school day ends, nobody comes before; and how long it takes to get small children ready, minutes.
_AFTERNOON, _READY = 14 * 60 + 45, 10


def form_playmates(rng: np.random.Generator, index: PlaceIndex, cares: Sequence[Care]) -> list[Meeting]:
    """Bring every small child and its carer together with others near by; at worst they play at home, by themselves."""
    kinds = [circle for circle in circles() if circle.small_children]
    public = index.places([c for c in Category if c not in (Category.ACCOMMODATION, Category.TRANSIT)])
    places = [[p for p in public if kind_of(p) in circle.kinds] for circle in kinds]
    found: list[Meeting] = []
    for care in cares:
        people = [care.carer, *care.small]
        meeting = _joined(index, found, care, people)
        if meeting is not None:
            _set_out_together(index, care, meeting)
            continue
        meeting = next(
            (m for k in rng.permutation(len(kinds)) for m in _options(rng, index, care, kinds[int(k)], places[int(k)])),
            None,
        )
        meeting = meeting or _at_home(index, care)
        other = _same(found, meeting)
        if other is None:
            found.append(meeting)
        meeting = other or meeting
        meeting.members += people
        _set_out_together(index, care, meeting)
    for meeting in found:
        meeting.members.sort(key=lambda member: int(member.id.removeprefix("resident_")))
    return found


def _same(found: Sequence[Meeting], wanted: Meeting) -> Meeting | None:
    """Return the meeting of the same kind at the same place and time, if there is one."""
    what = wanted.circle.name, wanted.place.id, wanted.start
    return next((m for m in found if (m.circle.name, m.place.id, m.start) == what), None)


def _set_out_together(index: PlaceIndex, care: Care, meeting: Meeting) -> None:
    """Let a carer whose children were at home all day be there in time, and come back with them."""
    if care.carer.duties:
        return
    leave = meeting.start - (index.minutes(care.carer.home, meeting.place.id) or 0)
    words = childhood().escort.ready.format(names=" and ".join(child.first for child in care.small))
    care.carer.duties = [Duty(leave - _READY, leave, words, care.carer.home)]
    care.carer.out_until = 0
    for child in care.small:
        child.duties = [Duty(leave - _READY, leave, childhood().escort.dress, care.carer.home)]


def _joined(index: PlaceIndex, found: Sequence[Meeting], care: Care, people: Sequence[ResidentDraft]) -> Meeting | None:
    """Let a family come to a meeting that there is, if one is near enough and suits."""
    for meeting in found:
        if (
            len(meeting.members) + len(people) <= _MOST
            and index.metres(care.carer.home, meeting.place.id) <= _NEAR
            and _suits(index, care, meeting.place, meeting.start, meeting.end)
        ):
            meeting.members += people
            return meeting
    return None


def come_to_play(index: PlaceIndex, cares: Sequence[Care], usual: Meeting, meeting: Meeting) -> None:
    """Let the families of a group come to its meeting on another day, if that suits them.

    Parameters
    ----------
    cares
        Of that day.
    usual
        The meeting with all its members.
    meeting
        That of the day, as yet without members; updated.
    """
    members = {member.id for member in usual.members}
    for care in cares:
        people = [care.carer, *care.small]
        at_home = meeting.place.id == care.carer.home
        if members.issuperset(draft.id for draft in people) and (
            _suits(index, care, meeting.place, meeting.start, meeting.end)
            or (at_home and _ready(care) <= meeting.start)
        ):
            meeting.members += people
            _set_out_together(index, care, meeting)


def _options(
    rng: np.random.Generator, index: PlaceIndex, care: Care, circle: Circle, places: Sequence[Place]
) -> list[Meeting]:
    """Return when a family could come to a circle at the nearest place for it, any time first."""
    home = care.carer.home
    near = [p for p in places if index.metres(home, p.id) <= _NEAR]
    for place in sorted(near, key=lambda p: (circle.kinds.index(kind_of(p)), index.metres(home, p.id), p.id))[:3]:
        spans = index.hours(place)
        starts = [s for s in circle.starts if any(a <= s and s + circle.minutes <= b for a, b in spans)]
        starts = [s for s in starts if _suits(index, care, place, s, s + circle.minutes)]
        if starts:
            start = starts[int(rng.integers(len(starts)))]
            return [Meeting(circle, place, start, start + circle.minutes)]
    return []


def _at_home(index: PlaceIndex, care: Care) -> Meeting:
    """Let playmates come to somebody's home, as soon as they are fetched."""
    circle = playmates_circle()
    home, ready = index.place_by_id[care.carer.home], _ready(care)
    start = next((s for s in sorted(circle.starts) if s >= ready), -(-ready // 5) * 5)
    return Meeting(circle, home, start, start + circle.minutes)


def _ready(care: Care) -> int:
    """Return when children and carer are at home, minutes."""
    return max((duty.end for duty in care.carer.duties), default=_AFTERNOON)


def _suits(index: PlaceIndex, care: Care, place: Place, start: int, end: int) -> bool:
    home = care.carer.home
    there, back = index.minutes(home, place.id), index.minutes(place.id, home)
    return there is not None and back is not None and _ready(care) + there <= start and end + back <= _BACK
