"""Groups: which ones a community has, who belongs, where and when they meet."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from vico.community.catalogue import Circle, circles, neighbours_circle
from vico.community.people import ResidentDraft
from vico.community.place_index import PlaceIndex, kind_of
from vico.errors import EmptyInputError
from vico.world.model import Category, Place

_MAX_MEMBERSHIPS = 2
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


def is_free(index: PlaceIndex, draft: ResidentDraft, meeting: Meeting, others: Sequence[Meeting]) -> bool:
    """Whether somebody can come to a meeting, beside work, sleep and the other groups they are in."""
    start, end, place = meeting.start, meeting.end, meeting.place.id
    early, late = 7 * 60 + 30, 22 * 60
    if draft.shift is not None:
        if draft.shift[1] >= 21 * 60 + 30:
            early = 9 * 60 + 30
        if draft.shift[0] <= 7 * 60:
            late = 20 * 60 + 30
        assert draft.workplace is not None
        walk = index.estimate(draft.workplace, place)
        inside = draft.shift[0] + 120 <= start and end <= draft.shift[1] - 90
        if inside and meeting.slot == "lunch":
            if walk > _MAX_LUNCH_WALK or draft.shift[1] - draft.shift[0] < 360:
                return False
        elif not (draft.shift[1] + walk <= start or end + walk <= draft.shift[0]):
            return False
    home = index.estimate(draft.home, place)
    if start - home < early or end + home > late:
        return False
    for other in others:
        walk = index.estimate(other.place.id, place)
        if start < other.end + walk and other.start < end + walk:
            return False
        if meeting.slot == other.slot == "lunch" or meeting.circle.name == other.circle.name:
            return False
    return True


def _exactly(index: PlaceIndex, draft: ResidentDraft, meeting: Meeting, others: Sequence[Meeting]) -> bool:
    """Whether the walks really can be made in the time that `is_free` estimated."""
    place = meeting.place.id
    stays = [(o.start, o.end, o.place.id) for o in others]
    if draft.shift is not None and draft.workplace is not None:
        stays.append((*draft.shift, draft.workplace))
    for start, end, other in stays:
        there, back = index.minutes(other, place), index.minutes(place, other)
        if there is None or back is None:
            return False
        if start < meeting.start and meeting.end < end:
            if max(there, back) > _MAX_LUNCH_WALK + 2:
                return False
        elif not (end + there <= meeting.start or meeting.end + back <= start):
            return False
    return index.minutes(place, draft.home) is not None


def _liking(draft: ResidentDraft, circle: Circle) -> float:
    """How much a circle appeals to somebody; 0 if it is not for them."""
    if draft.status not in circle.statuses and not (draft.shift and draft.shift[0] >= 12 * 60):
        return 0.0
    if not circle.ages[0] <= draft.age <= circle.ages[1]:
        return 0.0
    shared = len({h.name for h in draft.hobbies} & set(circle.hobbies))
    return 0.35 + 1.6 * shared + 0.5 * len(set(draft.values) & set(circle.values))


def _number(draft: ResidentDraft) -> int:
    return int(draft.id.removeprefix("resident_"))


def _options(rng: np.random.Generator, index: PlaceIndex, circles: Sequence[Circle]) -> list[Meeting]:
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
            if by_kind[kind_of(place)] >= 3:
                continue
            by_kind[kind_of(place)] += 1
            spans = index.hours(place)
            for start in circle.starts:
                end = start + circle.minutes
                if any(a <= start and end <= b for a, b in spans):
                    meetings.append(Meeting(circle, place, start, end))
    return meetings


def form_groups(rng: np.random.Generator, index: PlaceIndex, drafts: Sequence[ResidentDraft]) -> list[Meeting]:
    """Form 3 to 6 groups for every fifteen people so that everybody is in one that they like and can come to.

    Raises
    ------
    EmptyInputError
        If somebody can't be brought together with anybody: the world has too few places.
    """
    wanted = max(1, round(len(drafts) * 4.4 / 15))
    options = _options(rng, index, circles())
    noise = 1 + 0.25 * rng.random(len(options))
    forming = _Forming(index, drafts, size=math.ceil(len(drafts) / wanted) + 1)
    forming.form_most_liked(options, noise.tolist(), wanted)
    forming.admit_lonely()
    spare = _options(rng, index, [neighbours_circle()])
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
        self._index, self._sketches, self._size = index, drafts, size
        self._joined: dict[str, list[Meeting]] = {s.id: [] for s in drafts}
        self._names: Counter[str] = Counter()
        self._spots: Counter[str] = Counter()
        self._slots: Counter[str] = Counter()
        # Circles that were tried at a place, whether they came about or not.
        self._tried: set[tuple[str, str]] = set()

    def form_most_liked(self, options: Sequence[Meeting], weights: Sequence[float], wanted: int) -> None:
        """Form the groups that most people like most, until there are `wanted` or none is left."""
        while len(self.groups) < wanted and (meeting := self._best(options, weights)) is not None:
            self._found(meeting, self._size)

    def admit_lonely(self) -> None:
        """Let those who are in no group join the one they like best among those they can come to."""
        for s in self._sketches:
            if self._joined[s.id]:
                continue
            reachable = [g for g in self.groups if self._may_join(s, g)]
            if reachable:
                group = max(reachable, key=lambda g: (_liking(s, g.circle), -len(g.members), -self.groups.index(g)))
                group.members = sorted([*group.members, s], key=_number)
                self._joined[s.id].append(group)

    def form_for_lonely(self, options: Sequence[Meeting], weights: Sequence[float]) -> None:
        """Form further groups until nobody is alone.

        Raises
        ------
        EmptyInputError
            If nobody can be brought together with those who are.
        """
        while lonely := [s for s in self._sketches if not self._joined[s.id]]:
            meeting = self._best(options, weights)
            if meeting is None:
                who = ", ".join(f"{s.first} {s.last} ({s.occupation})" for s in lonely)
                raise EmptyInputError(
                    f"community: world {self._index.world.manifest.name!r} has no place where {who} could meet "
                    "others outside working hours; build a world with a larger --radius, or ask for other --residents"
                )
            self._found(meeting, max(self._size, 3))

    def _may_join(self, draft: ResidentDraft, group: Meeting) -> bool:
        return (
            _liking(draft, group.circle) > 0
            and is_free(self._index, draft, group, [])
            and _exactly(self._index, draft, group, [])
        )

    def _fans(self, meeting: Meeting) -> list[tuple[float, ResidentDraft]]:
        """Return who likes a meeting and is free for it, with how much they like it; the keenest first."""
        found = []
        for s in self._sketches:
            like = _liking(s, meeting.circle)
            mine = self._joined[s.id]
            if like > 0 and len(mine) < _MAX_MEMBERSHIPS and is_free(self._index, s, meeting, mine):
                found.append((like, s))
        return sorted(found, key=lambda f: (-f[0], _number(f[1])))

    def _best(self, candidates: Sequence[Meeting], weights: Sequence[float]) -> Meeting | None:
        """Return the meeting with the largest gain; None if none brings anybody new together."""
        top, chosen = 0.0, None
        for meeting, weight in zip(candidates, weights, strict=True):
            if (meeting.circle.name, meeting.place.id) in self._tried:
                continue
            gain = self._gain(meeting, weight)
            if gain > top:
                top, chosen = gain, meeting
        return chosen

    def _gain(self, meeting: Meeting, weight: float) -> float:
        """Return how much people like a meeting; what there is already (circle, place, part of the day) counts less."""
        liked = [(like * (0.2 if self._joined[s.id] else 1.0), s) for like, s in self._fans(meeting)]
        fresh = sum(1 for _, s in liked if not self._joined[s.id])
        if fresh == 0 or len(liked) < min(2, len(self._sketches)):
            return 0.0
        gain = sum(sorted((like for like, _ in liked), reverse=True)[: self._size]) * weight
        gain *= 0.25 ** self._names[meeting.circle.name] * 0.3 ** self._spots[meeting.place.id]
        gain *= 0.7 ** self._slots[meeting.slot]
        return gain

    def _found(self, meeting: Meeting, limit: int) -> None:
        """Bring people together, unless in truth too few can come. Either way the place has had this circle."""
        self._tried.add((meeting.circle.name, meeting.place.id))
        members = self._members(meeting, limit)
        if len(members) < min(2, len(self._sketches)):
            return
        meeting.members = sorted(members, key=_number)
        for s in meeting.members:
            self._joined[s.id].append(meeting)
        self._names[meeting.circle.name] += 1
        self._spots[meeting.place.id] += 1
        self._slots[meeting.slot] += 1
        self.groups.append(meeting)

    def _members(self, meeting: Meeting, limit: int) -> list[ResidentDraft]:
        """Return who comes: those who are in no group first; nobody if none of them can."""
        liked = self._fans(meeting)
        members: list[ResidentDraft] = []
        for _, s in liked:
            if not self._joined[s.id] and len(members) < limit and _exactly(self._index, s, meeting, []):
                members.append(s)
        if not members:
            return []
        # Those who are in a group already come along if this is just their thing, or to make it three.
        for like, s in liked:
            if self._joined[s.id] and len(members) < limit and (like > 1.5 or len(members) < 3):
                members += [s] * _exactly(self._index, s, meeting, self._joined[s.id])
        return members
