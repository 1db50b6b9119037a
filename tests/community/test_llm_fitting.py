"""Days that are proposed, and the ways between their stays as the router measures them."""

from __future__ import annotations

import pytest

from vico.community import Community, Resident
from vico.community.day import CHAT
from vico.community.llm.lives import MIDNIGHT, DayFitter, Stay, minute_of, overlaid, stays_of
from vico.community.model import ItemType
from vico.community.place_index import PlaceIndex
from vico.world.world import World


@pytest.fixture(scope="module")
def index(town: World, community: Community) -> PlaceIndex:
    return PlaceIndex(town, community.date)


@pytest.fixture
def adult(community: Community) -> Resident:
    return next(r for r in community.residents if 20 < r.age < 60 and r.workplace is not None)


def stay(start: int, end: int, place: str, what: str = "Be there", *, fixed: bool = False) -> Stay:
    kind = ItemType.SLEEP if what == "Sleep" else ItemType.MAIN
    return Stay(start, end, kind, what, place, fixed=fixed)


def place_of(town: World, name: str) -> str:
    return next(place.id for place in town.places if place.name == name)


def test_minutes_of_clocks() -> None:
    assert [minute_of(text) for text in ("00:00:00", "07:30:59", "23:59:59")] == [0, 450, MIDNIGHT]


def test_who_starts_later_interrupts_and_what_is_fixed_interrupts_all() -> None:
    found = overlaid([stay(0, 600, "a"), stay(120, 240, "b")], [stay(200, 300, "c", fixed=True)])
    assert [(s.start, s.end, s.place) for s in found] == [
        (0, 120, "a"), (120, 200, "b"), (200, 300, "c"), (300, 600, "a"),
    ]  # fmt: skip


def test_scraps_of_interrupted_stays_are_dropped() -> None:
    found = overlaid([stay(0, 103, "a")], [stay(50, 100, "c", fixed=True)])
    assert [(s.start, s.end) for s in found] == [(0, 50), (50, 100)]


def test_a_day_that_is_valid_stays_as_it_is(index: PlaceIndex, community: Community) -> None:
    for resident in community.residents:
        if any(item.mode is not None for item in resident.schedule):
            continue
        fitted = DayFitter(index, resident).fit(stays_of(resident.schedule))
        assert fitted.findings == []
        assert fitted.moved == 0
        assert [(i.type, i.start, i.end, i.place) for i in fitted.items] == [
            (i.type, i.start, i.end, i.place) for i in resident.schedule
        ]


def test_a_way_takes_as_long_as_it_does(index: PlaceIndex, adult: Resident, town: World) -> None:
    park = place_of(town, "Linden Park")
    way = index.minutes(adult.home, park)
    assert way is not None
    plan = [stay(0, 600, adult.home, "Sleep"), stay(600, 720, park), stay(720, MIDNIGHT, adult.home)]
    fitted = DayFitter(index, adult).fit(plan)
    commute = fitted.items[1]
    assert commute.type is ItemType.COMMUTE
    assert minute_of(commute.end) - minute_of(commute.start) == way
    assert fitted.moved == way
    assert (fitted.items[0].start, fitted.items[-1].end) == ("00:00:00", "23:59:59")


@pytest.mark.parametrize(("spare", "stays_on"), [(CHAT - 1, False), (CHAT, True)])
def test_few_minutes_after_a_meeting_are_spent_on_the_way(
    index: PlaceIndex, adult: Resident, town: World, spare: int, stays_on: bool
) -> None:
    park, square = place_of(town, "Linden Park"), place_of(town, "Market Square")
    way = index.minutes(park, square)
    assert way is not None
    after = 660 + way + spare
    plan = [
        stay(0, 480, adult.home, "Sleep"), stay(after, after + 60, square), stay(1320, MIDNIGHT, adult.home, "Sleep"),
    ]  # fmt: skip
    fitted = DayFitter(index, adult).fit(plan, [stay(600, 660, park, "Meet", fixed=True)])
    at = next(k for k, item in enumerate(fitted.items) if item.activity == "Meet")
    assert (fitted.items[at].end, minute_of(fitted.items[at + (3 if stays_on else 2)].start)) == ("11:00:00", after)
    assert (fitted.items[at + 1].activity == "Stay on for a while") == stays_on


def test_what_is_fixed_keeps_its_times(index: PlaceIndex, adult: Resident, town: World) -> None:
    park = place_of(town, "Linden Park")
    plan = [stay(0, MIDNIGHT, adult.home, "Sleep")]
    fitted = DayFitter(index, adult).fit(plan, [stay(600, 660, park, "Meet", fixed=True)])
    meeting = next(item for item in fitted.items if item.activity == "Meet")
    assert (meeting.start, meeting.end) == ("10:00:00", "11:00:00")


def test_long_waits_are_spent_at_home(index: PlaceIndex, adult: Resident, town: World) -> None:
    park, square = place_of(town, "Linden Park"), place_of(town, "Market Square")
    plan = [
        stay(0, 480, adult.home, "Sleep"), stay(500, 540, park), stay(900, 960, square),
        stay(1000, MIDNIGHT, adult.home, "Sleep"),
    ]  # fmt: skip
    fitted = DayFitter(index, adult).fit(plan)
    between = [item for item in fitted.items if "09:00:00" < item.start < "15:00:00" and item.place == adult.home]
    assert [item.activity for item in between] == ["Spend time at home"]


def test_two_meetings_at_a_time_are_a_finding(index: PlaceIndex, adult: Resident, town: World) -> None:
    meetings = [stay(600, 660, adult.home, "One", fixed=True), stay(650, 700, adult.home, "Two", fixed=True)]
    fitted = DayFitter(index, adult).fit([stay(0, MIDNIGHT, adult.home, "Sleep")], meetings)
    assert fitted.items == []
    assert fitted.findings == ["'One' and 'Two' are at the same time"]


def test_no_time_for_a_way_is_a_finding_unless_things_may_be_left_out(
    index: PlaceIndex, adult: Resident, town: World
) -> None:
    park = place_of(town, "Linden Park")
    plan = [stay(0, 595, adult.home, "Sleep"), stay(595, 603, park, "Rush"), stay(660, MIDNIGHT, adult.home, "Sleep")]
    meeting = [stay(603, 660, adult.home, "Meet", fixed=True)]
    fitted = DayFitter(index, adult).fit(plan, meeting)
    assert fitted.items == []
    assert "takes" in fitted.findings[0]
    assert "'Rush'" in fitted.findings[0]
    dropped = DayFitter(index, adult).fit(plan, meeting, drop=True)
    assert dropped.findings == []
    assert all(item.activity != "Rush" for item in dropped.items)


def test_a_day_of_ways_alone_is_none(index: PlaceIndex, adult: Resident) -> None:
    assert DayFitter(index, adult).fit([]).findings == ["there is nothing in the day but ways"]
