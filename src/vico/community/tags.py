"""What schedule items are about, where their author did not say: by type, place and group, never from words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from vico.community.model import ActivityTag, Community, Group, ItemType, Resident, ScheduleItem
from vico.world.model import Category, Place

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

    def tagged(resident: Resident, items: Sequence[ScheduleItem]) -> list[ScheduleItem]:
        mine = groups.get(resident.id, [])
        return [
            item if item.tag is not None else item.model_copy(update={"tag": tag_of(item, resident, mine, by_id)})
            for item in items
        ]

    people = community.resident_by_id
    return community.model_copy(
        update={
            "residents": [r.model_copy(update={"schedule": tagged(r, r.schedule)}) for r in community.residents],
            "further_days": [
                day.model_copy(update={"schedules": {i: tagged(people[i], s) for i, s in day.schedules.items()}})
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
    return _tag_of_place(places[item.place])


def _tag_of_place(place: Place) -> ActivityTag:
    """Return what people who neither live nor work at a place come there for."""
    if place.kind in _EXERCISE:
        return ActivityTag.EXERCISE
    if place.kind in _STUDY:
        return ActivityTag.STUDY
    if place.kind in _VISIT or place.category is Category.ACCOMMODATION:
        return ActivityTag.VISIT
    return ActivityTag.SHOP if place.category is Category.STORE else ActivityTag.LEISURE
