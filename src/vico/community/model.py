"""Records of a community: residents, groups, relations, and the schedules of one or several days.

`Authorship` says who wrote what where a language model had a part: item by item, and why where the model did not.
`CommunityFinding` is what the validator finds: where, what, and how to mend it. `with_tags` says what schedule items
are about where their author did not: by type, place and group, never from words.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date as Date  # the field of that name would hide it
from enum import StrEnum
from typing import Annotated, Literal, NotRequired

from pydantic import AfterValidator, ConfigDict, Field, with_config
from typing_extensions import TypedDict

from vico.clock import DAY, clock_of
from vico.english import split_name
from vico.errors import InputError
from vico.world.model import Category, Place, Point2, Record


class Origin(StrEnum):
    """Why an item is whose it is; all but the first are the procedural author's."""

    WRITTEN = "written by the model"
    NOT_ASKED = "not asked of the model"
    NO_ANSWER = "no answer"
    UNUSABLE = "no usable reply"
    NOT_GROUNDED = "not grounded"


class AuthoredItem(Record):
    """An item of a community, and whose it is.

    Attributes
    ----------
    item
        ``resident_3.character``, ``resident_3.groups``, ``resident_3.schedule`` or ``relations``.
    origin
        Whose it is and why.
    detail
        More of why, such as what the validator found in the last draft; a sentence at most.
    moved
        Of a schedule that the model wrote: by how many minutes the start or end of a stay was moved at most, so that
        the ways between them take as long as they do.
    """

    item: str
    origin: Origin
    detail: str = ""
    moved: int = 0


class Authorship(Record):
    """Authors of the items of a community.

    Attributes
    ----------
    model
        Name of the language model.
    prompts
        SHA-256 of each prompt it was asked with, by name.
    """

    model: str
    prompts: dict[str, str]
    items: list[AuthoredItem]

    @property
    def counts(self) -> Mapping[str, Mapping[Origin, int]]:
        """Return how many items of each kind (character, groups, schedule, relations) have which origin."""
        found: dict[str, Counter[Origin]] = {}
        for one in self.items:
            found.setdefault(one.item.rpartition(".")[2], Counter())[one.origin] += 1
        return found

    @property
    def written(self) -> int:
        """Return how many items are the model's."""
        return sum(one.origin is Origin.WRITTEN for one in self.items)

    @property
    def fallen_back(self) -> list[AuthoredItem]:
        """Return the items that the model was to write and did not."""
        return [one for one in self.items if one.origin not in (Origin.WRITTEN, Origin.NOT_ASKED)]


SCHEMA = "vico.community"
VERSION = 2

LAST = "23:59:59"
WEEKDAYS = ("Monday", "Tuesday", "Wednesday", "Thursday", "Friday", "Saturday", "Sunday")

_CLOCK = re.compile(r"([01]\d|2[0-3]):([0-5]\d):([0-5]\d)")


def _is_clock(text: str) -> str:
    if not _CLOCK.fullmatch(text):
        raise ValueError(f"{text!r} is no time of day; write HH:MM:SS")
    return text


Clock = Annotated[str, AfterValidator(_is_clock)]
Share = Annotated[float, Field(ge=0, le=1)]
Channel = Annotated[int, Field(ge=0, le=255)]
Colour = tuple[Channel, Channel, Channel]


class ItemType(StrEnum):
    """Kind of a schedule item."""

    SLEEP = "sleep"
    MEAL = "meal"
    MAIN = "main"
    COMMUTE = "commute"


class ActivityTag(StrEnum):
    """Purpose of a schedule item, for programs; its activity says it in words for people."""

    SLEEP = "sleep"
    MEAL_HOME = "meal_home"
    MEAL_OUT = "meal_out"
    WORK = "work"
    STUDY = "study"
    EXERCISE = "exercise"
    SHOP = "shop"
    VISIT = "visit"
    LEISURE = "leisure"
    GROUP = "group"
    COMMUTE = "commute"


class Mode(StrEnum):
    """Means of transport of a resident between two places."""

    WALK = "walk"
    BUS = "bus"
    TRAM = "tram"
    BIKE = "bike"


class ScheduleItem(Record):
    """A stretch of a resident's day.

    Attributes
    ----------
    tag
        What it is about. None where the author did not say; `vico.community.model.with_tags` fills it in.
    start, end
        ``HH:MM:SS``; the next item starts when this one ends; the last one ends 23:59:59.
    mode
        On the way: by what. None, and everywhere else: on foot.
    place, building
        Ids of where it happens; `building` is None at open places; both None on the way (``commute``).
    """

    type: ItemType
    tag: ActivityTag | None = None
    start: Clock
    end: Clock
    activity: Annotated[str, Field(min_length=1)]
    place: str | None
    building: str | None
    mode: Mode | None = None


Hair = Literal["bald", "crop", "short", "curly", "bob", "long", "ponytail", "bun"]
Top = Literal["t-shirt", "shirt", "jumper", "hoodie", "jacket", "suit", "coat", "dress"]
Bottom = Literal["trousers", "jeans", "shorts", "skirt", "leggings"]
Shoes = Literal["trainers", "shoes", "boots", "sandals"]
Hat = Literal["none", "cap", "beanie", "sun hat", "hard hat", "uniform cap", "toque"]
Over = Literal["none", "vest", "apron"]
Bag = Literal["none", "backpack", "shoulder bag"]


@with_config(ConfigDict(extra="forbid"))
class ResidentAppearance(TypedDict):
    """Appearance of a resident: the fields of `vico.assets.people.Appearance`, which makes a body of them.

    A plain dictionary with checked keys, so that it can be handed to `Appearance.from_dict` as it is. Who wears no hat,
    nothing over their clothes and no bag may leave those out.
    """

    gender: Share
    age: Annotated[float, Field(ge=4, le=100)]
    height: Annotated[float, Field(ge=0.9, le=2.2)]
    build: Share
    muscle: Share
    ancestry: tuple[Share, Share, Share]
    skin: Colour
    hair: Hair
    hair_colour: Colour
    eyes: Colour
    beard: bool
    glasses: bool
    top: Top
    top_colour: Colour
    under_colour: Colour
    bottom: Bottom
    bottom_colour: Colour
    shoes: Shoes
    shoes_colour: Colour
    hat: NotRequired[Hat]
    hat_colour: NotRequired[Colour]
    over: NotRequired[Over]
    over_colour: NotRequired[Colour]
    bag: NotRequired[Bag]
    bag_colour: NotRequired[Colour]


class Personality(Record):
    """The big five, 0..1, and the words people who know them would use."""

    openness: Share
    conscientiousness: Share
    extraversion: Share
    agreeableness: Share
    neuroticism: Share
    traits: list[str]


class Resident(Record):
    """Somebody who lives here.

    Attributes
    ----------
    values
        What matters most to them, the first most (Schwartz's ten basic values).
    cash
        Money they carry: 100..1000, children's pocket money 2..60.
    household
        Who has the same one shares a home; None where the author did not say.
    home, workplace, known_places
        Ids of places; `workplace` is None for those who have none, and the school of pupils and students.
    spawn
        Where they stand when a simulation starts with them outdoors, ENU metres.
    """

    id: Annotated[str, Field(pattern=r"^resident_\d+$")]
    name: Annotated[str, Field(min_length=3)]
    age: Annotated[int, Field(ge=0, le=110)]
    gender: Literal["female", "male"]
    appearance: ResidentAppearance
    occupation: str
    values: list[str]
    personality: Personality
    hobbies: list[str]
    lifestyle: str
    biography: str
    cash: int
    household: Annotated[str, Field(pattern=r"^household_\d+$")] | None = None
    home: str
    workplace: str | None
    known_places: list[str]
    spawn: Point2
    schedule: list[ScheduleItem]

    @property
    def first_name(self) -> str:
        """The first of their names."""
        return split_name(self.name)[1]

    def item_at(self, seconds: int) -> ScheduleItem:
        """Return the schedule item of a second of the day; at a boundary, the one that starts."""
        clock = clock_of(seconds % DAY)
        return next((item for item in reversed(self.schedule) if item.start <= clock), self.schedule[0])


class Group(Record):
    """People who meet.

    Attributes
    ----------
    place
        Id of the meeting place.
    members
        Ids of residents.
    start, end
        When they meet on the community's day; the schedule of every member has it who is not `absent`.
    absent
        Ids of members who don't come on that day: they are at work, the place is closed, or the group meets on another
        day of the week.
    """

    id: Annotated[str, Field(pattern=r"^group_\d+$")]
    name: str
    description: str
    activity: str
    place: str
    members: list[str]
    start: Clock
    end: Clock
    absent: list[str] = Field(default_factory=list)


class RelationKind(StrEnum):
    """Kind of a tie between two residents; of several ties the first in this order counts."""

    FAMILY = "family"
    FRIEND = "friend"
    COLLEAGUE = "colleague"
    NEIGHBOUR = "neighbour"


class Relation(Record):
    """An edge of the social network; it holds both ways.

    Attributes
    ----------
    between
        Ids of the two residents, in their order in the community.
    note
        What it is in words: partners, flatmates, same book circle.
    strength
        0 hardly known .. 1 inseparable.
    since
        Year.
    """

    between: tuple[str, str]
    kind: RelationKind
    note: str
    strength: Share
    since: int


class WorldIdentity(Record):
    """Which world a community lives in."""

    name: str
    digest: str


class CommunityDay(Record):
    """A further day of a community.

    Attributes
    ----------
    absent
        Who does not come to a group that day, by its id; groups that all come to are missing.
    schedules
        By resident id.
    """

    date: Date
    absent: dict[str, list[str]]
    schedules: dict[str, list[ScheduleItem]]


class Community(Record):
    """Residents of a world, what ties them, and one day or several days of each.

    Attributes
    ----------
    author
        Who wrote it: ``procedural``, or the name of a language model.
    date
        The day that the residents' schedules are for, ISO.
    further_days
        Days besides, in order.
    authorship
        Who wrote what, where a language model was asked; else None.
    """

    producer: str
    author: str
    seed: int
    date: Date
    world: WorldIdentity
    residents: list[Resident]
    groups: list[Group]
    relations: list[Relation]
    authorship: Authorship | None = None
    further_days: list[CommunityDay] = Field(default_factory=list)

    def __repr__(self) -> str:
        days = f" and {len(self.further_days)} more days" if self.further_days else ""
        return (
            f"Community({len(self.residents)} residents, {len(self.groups)} groups, {self.weekday} {self.date}{days}; "
            f"for world {self.world.name!r})"
        )

    def __str__(self) -> str:
        return repr(self)

    @property
    def dates(self) -> list[Date]:
        """The days there are schedules for, the residents' own first."""
        return [self.date, *(day.date for day in self.further_days)]

    def on(self, date: Date) -> Community:
        """Return the same community on one of its days, as one of a single day.

        Raises
        ------
        InputError
            If there are no schedules for that day.
        """
        if date == self.date:
            return self.model_copy(update={"further_days": []})
        day = next((one for one in self.further_days if one.date == date), None)
        if day is None:
            there = ", ".join(f"{one} ({WEEKDAYS[one.weekday()]})" for one in self.dates)
            raise InputError(f"community: no schedules for {date}; there are {there}; build it with more --days")
        return self.model_copy(
            update={
                "date": date,
                "residents": [r.model_copy(update={"schedule": day.schedules[r.id]}) for r in self.residents],
                "groups": [g.model_copy(update={"absent": day.absent.get(g.id, [])}) for g in self.groups],
                "further_days": [],
            }
        )

    @property
    def weekday(self) -> str:
        """Name of the day of the week the schedules are for."""
        return WEEKDAYS[self.date.weekday()]

    @property
    def resident_by_id(self) -> dict[str, Resident]:
        """Residents by id."""
        return {r.id: r for r in self.residents}

    def groups_of(self, resident: str) -> list[Group]:
        """Return the groups a resident belongs to."""
        return [g for g in self.groups if resident in g.members]

    def relations_of(self, resident: str) -> list[Relation]:
        """Ties of a resident."""
        return [r for r in self.relations if resident in r.between]


class CommunityManifest(Record):
    """`community.json`: written last, so a folder that has it is whole.

    Attributes
    ----------
    files
        SHA-256 of the other files, by name.
    """

    schema_name: str = SCHEMA
    version: int = VERSION
    producer: str
    author: str
    seed: int
    date: Date
    weekday: str
    world: WorldIdentity
    counts: dict[str, int]
    files: dict[str, str]


@dataclass(frozen=True)
class CommunityFinding:
    """Something wrong.

    Attributes
    ----------
    where
        Path into the community: ``resident_3.schedule[5]``.
    what
        What is wrong, with the values.
    mend
        What to do about it.
    """

    where: str
    what: str
    mend: str


_MAIN = frozenset(
    {
        ActivityTag.WORK,
        ActivityTag.STUDY,
        ActivityTag.EXERCISE,
        ActivityTag.SHOP,
        ActivityTag.VISIT,
        ActivityTag.LEISURE,
        ActivityTag.GROUP,
    }
)
#: Tags that go with each of the four types.
TAGS_OF_TYPE: Mapping[ItemType, frozenset[ActivityTag]] = {
    ItemType.SLEEP: frozenset({ActivityTag.SLEEP}),
    ItemType.MEAL: frozenset({ActivityTag.MEAL_HOME, ActivityTag.MEAL_OUT, ActivityTag.GROUP}),
    ItemType.MAIN: _MAIN,
    ItemType.COMMUTE: frozenset({ActivityTag.COMMUTE}),
}

_EXERCISE = frozenset(
    {"fitness_centre", "sports_centre", "sports_hall", "swimming_pool", "yoga", "pitch", "track", "dance"}
)
_STUDY = frozenset({"university", "college", "library"})
_VISIT = frozenset({"museum", "gallery", "arts_centre", "attraction", "castle", "zoo", "place_of_worship", "monument"})


def with_tags(community: Community, places: Sequence[Place] = ()) -> Community:
    """Return a community all of whose schedule items have a tag; tags that are there stay.

    Parameters
    ----------
    places
        Of its world; without them only home, workplace and groups are known apart.
    """
    further = [items for day in community.further_days for items in day.schedules.values()]
    if all(item.tag is not None for items in [*(r.schedule for r in community.residents), *further] for item in items):
        return community
    by_id = {place.id: place for place in places}
    groups: dict[str, list[Group]] = {}
    for group in community.groups:
        for member in group.members:
            groups.setdefault(member, []).append(group)

    def items_with_tags(resident: Resident, items: Sequence[ScheduleItem]) -> list[ScheduleItem]:
        mine = groups.get(resident.id, [])
        return [
            item if item.tag is not None else item.model_copy(update={"tag": tag_of(item, resident, mine, by_id)})
            for item in items
        ]

    people = community.resident_by_id
    return community.model_copy(
        update={
            "residents": [
                r.model_copy(update={"schedule": items_with_tags(r, r.schedule)}) for r in community.residents
            ],
            "further_days": [
                day.model_copy(
                    update={"schedules": {i: items_with_tags(people[i], s) for i, s in day.schedules.items()}}
                )
                for day in community.further_days
            ],
        }
    )


def tag_of(item: ScheduleItem, resident: Resident, groups: Sequence[Group], places: Mapping[str, Place]) -> ActivityTag:
    """Return what an item is about, by its type, its place and the groups that meet there then.

    Parameters
    ----------
    groups
        Those the resident belongs to.
    places
        By id.
    """
    if item.type is ItemType.SLEEP:
        return ActivityTag.SLEEP
    if item.type is ItemType.COMMUTE:
        return ActivityTag.COMMUTE
    if any(group.place == item.place and group.start < item.end and item.start < group.end for group in groups):
        return ActivityTag.GROUP
    if item.type is ItemType.MEAL:
        return ActivityTag.MEAL_HOME if item.place == resident.home else ActivityTag.MEAL_OUT
    if item.place == resident.workplace:
        return ActivityTag.WORK
    if item.place == resident.home or item.place is None or item.place not in places:
        return ActivityTag.LEISURE
    place = places[item.place]
    if place.kind in _EXERCISE:
        return ActivityTag.EXERCISE
    if place.kind in _STUDY:
        return ActivityTag.STUDY
    if place.kind in _VISIT or place.category is Category.ACCOMMODATION:
        return ActivityTag.VISIT
    return ActivityTag.SHOP if place.category is Category.STORE else ActivityTag.LEISURE
