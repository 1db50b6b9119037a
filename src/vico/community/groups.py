"""Groups: which ones a community has, who belongs, where and when they meet."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from vico.community.ground import Ground, kind_of
from vico.community.people import Sketch
from vico.community.tastes import CIRCLES, Circle
from vico.errors import EmptyInputError
from vico.world.model import Category, Place

#: Where people meet when no place of a better kind is near: anywhere with room, in the end at somebody's home.
NEIGHBOURS = Circle(
    "Neighbours' circle",
    "Share coffee and news",
    "Keeps an eye on each other's plants, parcels and spare keys, and shares coffee and the news.",
    (),
    tuple((60 * h + m, 50) for h, m in ((18, 0), (10, 0), (19, 30), (15, 0), (8, 30), (12, 30), (20, 15), (21, 0))),
    "evening",
    values=("benevolence", "security", "tradition", "conformity"),
)

_MAX_MEMBERSHIPS = 2
_MAX_LUNCH_WALK = 7


@dataclass
class Meeting:
    """A group in the making; times in minutes."""

    circle: Circle
    place: Place
    start: int
    end: int
    members: list[Sketch] = field(default_factory=list)

    @property
    def slot(self) -> str:
        """Part of the day it meets in."""
        return self.circle.slot


def is_free(ground: Ground, sketch: Sketch, meeting: Meeting, others: Sequence[Meeting]) -> bool:
    """Whether somebody can come to a meeting, beside work, sleep and the other groups they are in."""
    start, end, place = meeting.start, meeting.end, meeting.place.id
    early, late = 7 * 60 + 30, 22 * 60
    if sketch.shift is not None:
        if sketch.shift[1] >= 21 * 60 + 30:
            early = 9 * 60 + 30
        if sketch.shift[0] <= 7 * 60:
            late = 20 * 60 + 30
        assert sketch.workplace is not None
        walk = ground.estimate(sketch.workplace, place)
        inside = sketch.shift[0] + 120 <= start and end <= sketch.shift[1] - 90
        if inside and meeting.slot == "lunch":
            if walk > _MAX_LUNCH_WALK or sketch.shift[1] - sketch.shift[0] < 360:
                return False
        elif not (sketch.shift[1] + walk <= start or end + walk <= sketch.shift[0]):
            return False
    home = ground.estimate(sketch.home, place)
    if start - home < early or end + home > late:
        return False
    for other in others:
        walk = ground.estimate(other.place.id, place)
        if start < other.end + walk and other.start < end + walk:
            return False
        if meeting.slot == other.slot == "lunch" or meeting.circle.name == other.circle.name:
            return False
    return True


def _exactly(ground: Ground, sketch: Sketch, meeting: Meeting, others: Sequence[Meeting]) -> bool:
    """Whether the walks really can be made in the time that `is_free` estimated."""
    place = meeting.place.id
    stays = [(o.start, o.end, o.place.id) for o in others]
    if sketch.shift is not None and sketch.workplace is not None:
        stays.append((*sketch.shift, sketch.workplace))
    for start, end, other in stays:
        there, back = ground.minutes(other, place), ground.minutes(place, other)
        if there is None or back is None:
            return False
        if start < meeting.start and meeting.end < end:
            if max(there, back) > _MAX_LUNCH_WALK + 2:
                return False
        elif not (end + there <= meeting.start or meeting.end + back <= start):
            return False
    return ground.minutes(place, sketch.home) is not None


def _liking(sketch: Sketch, circle: Circle) -> float:
    """How much a circle appeals to somebody; 0 if it is not for them."""
    if sketch.status not in circle.statuses and not (sketch.shift and sketch.shift[0] >= 12 * 60):
        return 0.0
    if not circle.ages[0] <= sketch.age <= circle.ages[1]:
        return 0.0
    shared = len({h.name for h in sketch.hobbies} & set(circle.hobbies))
    return 0.35 + 1.6 * shared + 0.5 * len(set(sketch.values) & set(circle.values))


def _number(sketch: Sketch) -> int:
    return int(sketch.id.removeprefix("resident_"))


def _options(rng: np.random.Generator, ground: Ground, circles: Sequence[Circle]) -> list[Meeting]:
    meetings: list[Meeting] = []
    public = ground.places([c for c in Category if c not in (Category.TRANSIT, Category.ACCOMMODATION)])
    for circle in circles:
        if circle is NEIGHBOURS:
            sociable = [p for p in public if p.category in (Category.FOOD, Category.OPEN, Category.ENTERTAINMENT)]
            places = sociable or ground.places([Category.ACCOMMODATION])
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
            spans = ground.hours(place)
            for start, minutes in circle.times:
                if any(a <= start and start + minutes <= b for a, b in spans):
                    meetings.append(Meeting(circle, place, start, start + minutes))
    return meetings


def form_groups(rng: np.random.Generator, ground: Ground, sketches: Sequence[Sketch]) -> list[Meeting]:
    """Form 3 to 6 groups for every fifteen people so that everybody is in one that they like and can come to.

    Raises
    ------
    EmptyInputError
        If somebody can't be brought together with anybody: the world has too few places.
    """
    wanted = max(1, round(len(sketches) * 4.4 / 15))
    size = math.ceil(len(sketches) / wanted) + 1
    options = _options(rng, ground, CIRCLES)
    noise = 1 + 0.25 * rng.random(len(options))
    groups: list[Meeting] = []
    joined: dict[str, list[Meeting]] = {s.id: [] for s in sketches}
    names: Counter[str] = Counter()
    spots: Counter[str] = Counter()
    slots: Counter[str] = Counter()

    def fans(meeting: Meeting, pool: Sequence[Sketch]) -> list[tuple[float, Sketch]]:
        found = []
        for s in pool:
            like = _liking(s, meeting.circle)
            if like > 0 and len(joined[s.id]) < _MAX_MEMBERSHIPS and is_free(ground, s, meeting, joined[s.id]):
                found.append((like, s))
        return sorted(found, key=lambda f: (-f[0], _number(f[1])))

    closed: set[tuple[str, str]] = set()

    def best(candidates: Sequence[Meeting], weights: Sequence[float]) -> Meeting | None:
        top, chosen = 0.0, None
        for meeting, weight in zip(candidates, weights, strict=True):
            if (meeting.circle.name, meeting.place.id) in closed:
                continue
            liked = [(like * (0.2 if joined[s.id] else 1.0), s) for like, s in fans(meeting, sketches)]
            fresh = sum(1 for _, s in liked if not joined[s.id])
            if fresh == 0 or len(liked) < min(2, len(sketches)):
                continue
            gain = sum(sorted((like for like, _ in liked), reverse=True)[:size]) * weight
            gain *= 0.25 ** names[meeting.circle.name] * 0.3 ** spots[meeting.place.id]
            gain *= 0.7 ** slots[meeting.slot]
            if gain > top:
                top, chosen = gain, meeting
        return chosen

    def found(meeting: Meeting, limit: int) -> bool:
        """Bring people together; False if in truth too few can come. Either way the place has had this circle."""
        closed.add((meeting.circle.name, meeting.place.id))
        liked = fans(meeting, sketches)
        members: list[Sketch] = []
        for _, s in liked:
            if not joined[s.id] and len(members) < limit and _exactly(ground, s, meeting, []):
                members.append(s)
        if not members:
            return False
        # Those who are in a group already come along if this is just their thing, or to make it three.
        for like, s in liked:
            if joined[s.id] and len(members) < limit and (like > 1.5 or len(members) < 3):
                members += [s] * _exactly(ground, s, meeting, joined[s.id])
        if len(members) < min(2, len(sketches)):
            return False
        meeting.members = sorted(members, key=_number)
        for s in meeting.members:
            joined[s.id].append(meeting)
        names[meeting.circle.name] += 1
        spots[meeting.place.id] += 1
        slots[meeting.slot] += 1
        groups.append(meeting)
        return True

    while len(groups) < wanted and (meeting := best(options, noise.tolist())) is not None:
        found(meeting, size)
    for s in sketches:
        if joined[s.id]:
            continue
        reachable = [
            g for g in groups if _liking(s, g.circle) > 0 and is_free(ground, s, g, []) and _exactly(ground, s, g, [])
        ]
        if reachable:
            group = max(reachable, key=lambda g: (_liking(s, g.circle), -len(g.members), -groups.index(g)))
            group.members = sorted([*group.members, s], key=_number)
            joined[s.id].append(group)
    spare = _options(rng, ground, [NEIGHBOURS])
    while lonely := [s for s in sketches if not joined[s.id]]:
        meeting = best([*options, *spare], [1.0] * len(options) + [0.05] * len(spare))
        if meeting is None:
            who = ", ".join(f"{s.first} {s.last} ({s.occupation})" for s in lonely)
            raise EmptyInputError(
                f"community: world {ground.world.manifest.name!r} has no place where {who} could meet others outside "
                "working hours; build a world with a larger --radius, or ask for other --residents"
            )
        found(meeting, max(size, 3))
    return sorted(groups, key=lambda g: (g.start, g.end, g.place.id, g.circle.name))
