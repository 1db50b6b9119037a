"""Groups: which ones a community has, who belongs, where and when they meet.

Small children have groups of their own: they play after school, with those who look after them.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from heapq import heapify, heappop, heapreplace

import numpy as np
from numpy.typing import NDArray

from vico.community.catalogue import Circle, circles, neighbours_circle, playmates_circle
from vico.community.people import Duty, ResidentDraft, adults_only, childhood
from vico.community.place_index import PlaceIndex, kind_of
from vico.community.schooling import Care
from vico.errors import EmptyInputError
from vico.world.model import Category, Place

_RESERVED = 0.4  # extraversion up to which somebody is reserved
_OUTGOING = 0.68  # extraversion from which on somebody is outgoing
_MEMBERSHIPS = (1, 2, 3)  # most groups of the reserved, of others, and of the outgoing
_MAX_LUNCH_WALK = 7


@dataclass
class Meeting:
    """A group in the making; times in minutes."""

    circle: Circle
    place: Place
    start: int
    end: int
    members: list[ResidentDraft] = field(default_factory=list)

    @property
    def slot(self) -> str:
        """Part of the day it meets in."""
        return self.circle.slot


class _Attendance:
    """Liking and free time of all people for some meetings, as arrays.

    Parameters
    ----------
    meetings
        What may come about.
    drafts
        Everybody, in the order of their numbers.
    """

    def __init__(self, index: PlaceIndex, meetings: Sequence[Meeting], drafts: Sequence[ResidentDraft]) -> None:
        self._index, self._meetings = index, list(meetings)
        everybody = _Timetable.of(index, drafts)
        likes: dict[str, NDArray[np.float64]] = {}
        for meeting in self._meetings:
            name = meeting.circle.name
            if name not in likes:
                likes[name] = np.array([_liking(s, meeting.circle) for s in drafts])
        self._likes = likes
        self._free = [everybody.free_for(index, meeting) for meeting in self._meetings]
        self._walks: dict[str, NDArray[np.int64]] = {}
        self._starts = np.array([m.start for m in self._meetings], np.int64)
        self._ends = np.array([m.end for m in self._meetings], np.int64)
        self._lunch = np.array([m.slot == "lunch" for m in self._meetings], bool)
        self._names = np.array([m.circle.name for m in self._meetings])
        self._places = np.array([index.spot[m.place.id] for m in self._meetings], np.int64)
        children = np.array([draft.child for draft in drafts], bool)
        for k, meeting in enumerate(self._meetings):
            if kind_of(meeting.place) in adults_only():
                self._free[k] &= ~children

    def likes(self, k: int) -> NDArray[np.float64]:
        """Return how much all like a meeting, 0 for those who do not or are not free; shape ``(people,)``."""
        return np.where(self._free[k], self._likes[self._names[k]], 0.0)

    def join(self, person: int, group: Meeting) -> None:
        """Note that somebody has joined a group: other meetings then may not be for them."""
        place = group.place.id
        if place not in self._walks:
            self._walks[place] = self._index.estimates(place, self._places)
        walk = self._walks[place]
        off = (self._starts < group.end + walk) & (group.start < self._ends + walk)
        off |= self._names == group.circle.name
        if group.slot == "lunch":
            off |= self._lunch
        for k in np.flatnonzero(off).tolist():
            self._free[k][person] = False


@dataclass(frozen=True)
class _Timetable:
    """Free time and places of all people, as arrays.

    Attributes
    ----------
    home, work
        Spots (`PlaceIndex.spot`); -1 for no work.
    start, end
        Working hours, minutes of the day.
    duties
        Start and end, minutes of the day, and spot of what else they have to do; -1 past the last of each; shape
        ``(people, most duties, 3)``.
    early, late
        From when and until when they go out, minutes of the day.
    """

    home: NDArray[np.int64]
    work: NDArray[np.int64]
    start: NDArray[np.int64]
    end: NDArray[np.int64]
    duties: NDArray[np.int64]
    early: NDArray[np.int64]
    late: NDArray[np.int64]

    @classmethod
    def of(cls, index: PlaceIndex, drafts: Sequence[ResidentDraft]) -> _Timetable:
        shifts = [draft.shift or (-1, -1) for draft in drafts]
        start, end = (np.array([shift[k] for shift in shifts], np.int64) for k in (0, 1))
        works = [draft.workplace if draft.shift is not None else None for draft in drafts]
        duties = np.full((len(drafts), max(len(draft.duties) for draft in drafts), 3), -1, np.int64)
        for k, draft in enumerate(drafts):
            for i, duty in enumerate(draft.duties):
                duties[k, i] = duty.start, duty.end, index.spot[duty.place]
        late = np.where((start >= 0) & (start <= 7 * 60), 20 * 60 + 30, 22 * 60)
        return cls(
            home=np.array([index.spot[draft.home] for draft in drafts], np.int64),
            work=np.array([-1 if work is None else index.spot[work] for work in works], np.int64),
            start=start,
            end=end,
            duties=duties,
            early=np.where(end >= 21 * 60 + 30, 9 * 60 + 30, 7 * 60 + 30),
            late=np.minimum(late, [draft.home_by for draft in drafts]),
        )

    def free_for(self, index: PlaceIndex, meeting: Meeting) -> NDArray[np.bool_]:
        """Whether each can come to a meeting, beside work and sleep, by estimated walks; shape ``(people,)``."""
        start, end, place = meeting.start, meeting.end, meeting.place.id
        home = index.estimates(place, self.home)
        free = (start - home >= self.early) & (end + home <= self.late)
        walk = index.estimates(place, np.maximum(self.work, 0))
        beside = (self.end + walk <= start) | (end + walk <= self.start)
        if meeting.slot == "lunch":
            inside = (self.start + 120 <= start) & (end <= self.end - 90)
            short = (walk <= _MAX_LUNCH_WALK) & (self.end - self.start >= 360)
            beside = np.where(inside, short, beside)
        free &= beside | (self.work < 0)
        for duty in range(self.duties.shape[1]):
            begins, ends, spot = self.duties[:, duty].T
            walk = index.estimates(place, np.maximum(spot, 0))
            free &= (ends + walk <= start) | (end + walk <= begins) | (spot < 0)
        return free


def _exactly(index: PlaceIndex, draft: ResidentDraft, meeting: Meeting, others: Sequence[Meeting]) -> bool:
    """Whether the walks really can be made in the time that was estimated."""
    place = meeting.place.id
    stays = [(o.start, o.end, o.place.id) for o in others] + [(d.start, d.end, d.place) for d in draft.duties]
    if draft.shift is not None and draft.workplace is not None:
        stays.append((*draft.shift, draft.workplace))
    for start, end, other in stays:
        there, back = index.minutes(other, place, draft.pace), index.minutes(place, other, draft.pace)
        if there is None or back is None:
            return False
        if start < meeting.start and meeting.end < end:
            if max(there, back) > _MAX_LUNCH_WALK + 2:
                return False
        elif not (end + there <= meeting.start or meeting.end + back <= start):
            return False
    return index.minutes(place, draft.home) is not None


def can_come(index: PlaceIndex, draft: ResidentDraft, meeting: Meeting, others: Sequence[Meeting]) -> bool:
    """Whether somebody is free for a meeting on the index's day, beside work, duties, sleep and other meetings."""
    return bool(_Timetable.of(index, [draft]).free_for(index, meeting)[0]) and _exactly(index, draft, meeting, others)


def _liking(draft: ResidentDraft, circle: Circle) -> float:
    """Return how much a circle appeals to somebody; 0 if it is not for them."""
    late = draft.shift is not None and draft.shift[0] >= 12 * 60
    off = draft.shift is None and draft.status in ("worker", "student")
    if draft.status not in circle.statuses and not (late or off):
        return 0.0
    if circle.small_children or not circle.ages[0] <= draft.age <= circle.ages[1]:
        return 0.0
    shared = len({h.name for h in draft.hobbies} & set(circle.hobbies))
    return 0.35 + 1.6 * shared + 0.5 * len(set(draft.values) & set(circle.values))


def _number(draft: ResidentDraft) -> int:
    return int(draft.id.removeprefix("resident_"))


def _meeting_options(
    rng: np.random.Generator, index: PlaceIndex, circles: Sequence[Circle], choice: int
) -> list[Meeting]:
    """Return what may come about: each circle at `choice` places of a kind at most, when they are open."""
    meetings: list[Meeting] = []
    public = index.places([c for c in Category if c not in (Category.TRANSIT, Category.ACCOMMODATION)])
    for circle in circles:
        if circle is neighbours_circle():
            sociable = [p for p in public if p.category in (Category.FOOD, Category.OPEN, Category.ENTERTAINMENT)]
            places = sociable or index.places([Category.ACCOMMODATION])
        else:
            places = [p for p in public if kind_of(p) in circle.kinds]
        # The first kind that is named suits best; a few of each keep the choice varied and small.
        order = rng.permutation(len(places))
        by_kind: Counter[str] = Counter()
        for k in order:
            place = places[int(k)]
            if by_kind[kind_of(place)] >= choice:
                continue
            by_kind[kind_of(place)] += 1
            spans = index.hours(place)
            for start in circle.starts:
                end = start + circle.minutes
                if any(a <= start and end <= b for a, b in spans):
                    meetings.append(Meeting(circle, place, start, end))
    return meetings


def meetings_by_member(meetings: Iterable[Meeting]) -> dict[str, list[Meeting]]:
    """Return the meetings of each, by the ids of those who are in any."""
    found: dict[str, list[Meeting]] = {}
    for meeting in meetings:
        for member in meeting.members:
            found.setdefault(member.id, []).append(meeting)
    return found


def form_groups(
    rng: np.random.Generator, index: PlaceIndex, drafts: Sequence[ResidentDraft], playmates: Sequence[Meeting] = ()
) -> list[Meeting]:
    """Form 3 to 6 groups for every fifteen people so that everybody is in one that they like and can come to.

    Parameters
    ----------
    playmates
        Groups of small children and of who looks after them; these are in no others.

    Raises
    ------
    EmptyInputError
        If somebody can't be brought together with anybody: the world has too few places.
    """
    others = len(drafts) - sum(len(meeting.members) for meeting in playmates)
    wanted = max(1, round(others * 4.4 / 15))
    choice = max(3, math.ceil(len(drafts) / 40))
    options = _meeting_options(rng, index, [circle for circle in circles() if not circle.small_children], choice)
    noise = 1 + 0.25 * rng.random(len(options))
    forming = _Forming(index, drafts, size=math.ceil(others / wanted) + 1)
    forming.keep(playmates)
    forming.form_most_liked(options, noise.tolist(), wanted)
    forming.admit_lonely()
    spare = _meeting_options(rng, index, [neighbours_circle()], choice)
    forming.form_for_lonely([*options, *spare], [1.0] * len(options) + [0.05] * len(spare))
    return sorted(forming.groups, key=lambda g: (g.start, g.end, g.place.id, g.circle.name))


class _Forming:
    """Groups in the making: who is in which, and how often a circle, a place and a part of the day were taken.

    Parameters
    ----------
    size
        Most members of a group.
    """

    def __init__(self, index: PlaceIndex, drafts: Sequence[ResidentDraft], *, size: int) -> None:
        self.groups: list[Meeting] = []
        self._index, self._size = index, size
        self._drafts = sorted(drafts, key=_number)
        self._joined: list[list[Meeting]] = [[] for _ in drafts]
        self._counts = np.zeros(len(drafts), np.int64)
        outgoing = np.array([draft.character.extraversion for draft in self._drafts])
        # How much one has to like a group to join it besides another.
        self._enough = np.where(outgoing >= _OUTGOING, 0.8, 1.5)
        self._most = np.array(_MEMBERSHIPS)[np.digitize(outgoing, (_RESERVED, _OUTGOING))]
        self._names: Counter[str] = Counter()
        self._spots: Counter[str] = Counter()
        self._slots: Counter[str] = Counter()
        # Circles that were tried at a place, whether they came about or not.
        self._tried: set[tuple[str, str]] = set()

    def keep(self, meetings: Sequence[Meeting]) -> None:
        """Take over groups that there are; their members join no others."""
        row = {draft.id: k for k, draft in enumerate(self._drafts)}
        for meeting in meetings:
            self.groups.append(meeting)
            for member in meeting.members:
                self._joined[row[member.id]].append(meeting)
                self._counts[row[member.id]] = max(_MEMBERSHIPS)

    def form_most_liked(self, options: Sequence[Meeting], weights: Sequence[float], wanted: int) -> None:
        """Form the groups that most people like most, until there are `wanted` more or none is left."""
        ranking, wanted = _Ranking(self, options, weights), len(self.groups) + wanted
        while len(self.groups) < wanted and (k := ranking.best()) is not None:
            self._form_group(ranking, k, self._size)

    def admit_lonely(self) -> None:
        """Add those who are in no group to the one they like best among those they can come to."""
        attendance = _Attendance(self._index, self.groups, self._drafts)
        likes = np.array([attendance.likes(k) for k in range(len(self.groups))]).reshape(-1, len(self._drafts))
        sizes = np.array([len(group.members) for group in self.groups])
        for person in np.flatnonzero(self._counts == 0).tolist():
            # The liked first, of these the small, of these the early formed.
            for k in np.lexsort((sizes, -likes[:, person])).tolist():
                if likes[k, person] <= 0:
                    break
                if _exactly(self._index, self._drafts[person], self.groups[k], []):
                    self._join(person, self.groups[k])
                    sizes[k] += 1
                    break

    def form_for_lonely(self, options: Sequence[Meeting], weights: Sequence[float]) -> None:
        """Form further groups until nobody is alone.

        Raises
        ------
        EmptyInputError
            If nobody can be brought together with those who are.
        """
        if self._counts.all():
            return
        ranking = _Ranking(self, options, weights)
        while not self._counts.all():
            k = ranking.best()
            if k is None:
                lonely = [self._drafts[person] for person in np.flatnonzero(self._counts == 0)]
                who = ", ".join(f"{s.first} {s.last} ({s.occupation})" for s in lonely)
                raise EmptyInputError(
                    f"community: world {self._index.world.manifest.name!r} has no place where {who} could meet "
                    "others outside working hours; build a world with a larger --radius, or ask for other --residents"
                )
            self._form_group(ranking, k, max(self._size, 3))

    def attendance(self, options: Sequence[Meeting]) -> _Attendance:
        """Return who likes some meetings and is free for them beside the groups they are in."""
        made = _Attendance(self._index, options, self._drafts)
        for person, groups in enumerate(self._joined):
            for group in groups:
                made.join(person, group)
        return made

    def gain(self, meeting: Meeting, likes: NDArray[np.float64], weight: float) -> float:
        """Return how much people like a meeting; what there is already (circle, place, part of the day) counts less.

        It never rises while groups form. 0 if the meeting would bring nobody new together, or was tried.
        """
        if (meeting.circle.name, meeting.place.id) in self._tried:
            return 0.0
        liked = np.where(self._counts < self._most, likes, 0.0)
        fresh = self._counts == 0
        if not (liked[fresh] > 0).any() or np.count_nonzero(liked) < min(2, len(self._drafts)):
            return 0.0
        gain = float(np.sort(np.where(fresh, liked, 0.2 * liked))[::-1][: self._size].sum()) * weight
        gain *= 0.25 ** self._names[meeting.circle.name] * 0.3 ** self._spots[meeting.place.id]
        gain *= 0.7 ** self._slots[meeting.slot]
        return gain

    def _form_group(self, ranking: _Ranking, k: int, limit: int) -> None:
        """Bring people together, unless in truth too few can come. Either way the place has had this circle."""
        meeting = ranking.options[k]
        self._tried.add((meeting.circle.name, meeting.place.id))
        members = self._members(meeting, ranking.attendance.likes(k), limit)
        if len(members) < min(2, len(self._drafts)):
            return
        self.groups.append(meeting)
        for person in members:
            self._join(person, meeting)
            ranking.attendance.join(person, meeting)
        self._names[meeting.circle.name] += 1
        self._spots[meeting.place.id] += 1
        self._slots[meeting.slot] += 1

    def _join(self, person: int, group: Meeting) -> None:
        group.members = sorted([*group.members, self._drafts[person]], key=_number)
        self._joined[person].append(group)
        self._counts[person] += 1

    def _members(self, meeting: Meeting, likes: NDArray[np.float64], limit: int) -> list[int]:
        """Return who comes: those who are in no group first; nobody if none of them can."""
        order = np.argsort(-likes, kind="stable")
        order = order[(likes[order] > 0) & (self._counts[order] < self._most[order])]
        members: list[int] = []
        for person in order[self._counts[order] == 0].tolist():
            if len(members) == limit:
                break
            if _exactly(self._index, self._drafts[person], meeting, []):
                members.append(person)
        if not members:
            return []
        # Those who are in a group already come along if this is just their thing, or to make it three.
        for person in order[self._counts[order] > 0].tolist():
            if len(members) == limit or not (likes[person] > self._enough[person] or len(members) < 3):
                break
            if _exactly(self._index, self._drafts[person], meeting, self._joined[person]):
                members.append(person)
        return members


class _Ranking:
    """Meetings by their gain, the largest first, each reckoned again only when it comes up: gains never rise.

    Attributes
    ----------
    options
        The meetings.
    attendance
        Who likes them and is free.
    """

    def __init__(self, forming: _Forming, options: Sequence[Meeting], weights: Sequence[float]) -> None:
        self.options = options
        self.attendance = forming.attendance(options)
        self._forming, self._weights = forming, weights
        self._heap = [(-self._gain(k), k) for k in range(len(options))]
        heapify(self._heap)

    def best(self) -> int | None:
        """Return the meeting with the largest gain, of equal ones the first; None if none brings anybody together."""
        while self._heap:
            known, k = self._heap[0]
            gain = self._gain(k)
            if gain == -known and gain > 0:
                return k
            if gain > 0:
                heapreplace(self._heap, (-gain, k))
            else:
                heappop(self._heap)
        return None

    def _gain(self, k: int) -> float:
        return self._forming.gain(self.options[k], self.attendance.likes(k), self._weights[k])


_MOST = 9  # children with their carers in a group
_NEAR = 600.0  # metres from home that small children play
_BACK = 19 * 60 + 20  # minute of the day when they are back
_AFTERNOON = 14 * 60 + 45  # minute of the day before which nobody comes where no school day ends
_READY = 10  # minutes that it takes to get small children ready


def form_playmates(rng: np.random.Generator, index: PlaceIndex, cares: Sequence[Care]) -> list[Meeting]:
    """Bring every small child and its carer together with others near by; at worst they play at home, by themselves."""
    kinds = [circle for circle in circles() if circle.small_children]
    public = index.places([c for c in Category if c not in (Category.ACCOMMODATION, Category.TRANSIT)])
    places = [[p for p in public if kind_of(p) in circle.kinds] for circle in kinds]
    found: list[Meeting] = []
    for care in cares:
        people = [care.carer, *care.small]
        meeting = next(
            (
                m
                for m in found
                if len(m.members) + len(people) <= _MOST
                and index.metres(care.carer.home, m.place.id) <= _NEAR
                and _suits(index, care, m.place, m.start, m.end)
            ),
            None,
        )
        if meeting is None:
            meeting = next(
                (
                    m
                    for k in rng.permutation(len(kinds))
                    for m in _playtime_options(rng, index, care, kinds[int(k)], places[int(k)])
                ),
                None,
            )
            meeting = meeting or _at_home(index, care)
            # A full group of the same kind at the same place and time grows.
            what = meeting.circle.name, meeting.place.id, meeting.start
            same = next((m for m in found if (m.circle.name, m.place.id, m.start) == what), None)
            if same is None:
                found.append(meeting)
            meeting = same or meeting
        meeting.members += people
        _set_out_together(index, care, meeting)
    for meeting in found:
        meeting.members.sort(key=lambda member: int(member.id.removeprefix("resident_")))
    return found


def _set_out_together(index: PlaceIndex, care: Care, meeting: Meeting) -> None:
    """Plan that a carer whose children were at home all day is there in time and comes back with them."""
    if care.carer.duties:
        return
    leave = meeting.start - (index.minutes(care.carer.home, meeting.place.id) or 0)
    words = childhood().escort.ready.format(names=" and ".join(child.first for child in care.small))
    care.carer.duties = [Duty(leave - _READY, leave, words, care.carer.home)]
    care.carer.out_until = 0
    for child in care.small:
        child.duties = [Duty(leave - _READY, leave, childhood().escort.dress, care.carer.home)]


def come_to_play(index: PlaceIndex, cares: Sequence[Care], usual: Meeting, meeting: Meeting) -> None:
    """Add the families of a group to its meeting on another day, if that suits them.

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


def _playtime_options(
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
    """Return a meeting of playmates at somebody's home, as soon as they are fetched."""
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
