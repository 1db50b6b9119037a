"""Several days and weekends: who works, learns and meets on which day."""

from __future__ import annotations

import json
from datetime import date
from pathlib import Path

import pytest

from toytown import PLACES, make_world
from vico.clock import seconds_of_day
from vico.community import Community, build_community, check_community, date_of, read_community, write_community
from vico.community.model import ActivityTag, ItemType, Resident, ScheduleItem
from vico.errors import InputError
from vico.world.opening_hours import open_spans
from vico.world.world import World

_SATURDAY, _SUNDAY = date(2025, 6, 7), date(2025, 6, 8)
_WORK = (ActivityTag.WORK, ActivityTag.STUDY)


@pytest.fixture(scope="module")
def week(town: World) -> Community:
    return build_community(town, residents=36, seed=1, date=date(2025, 6, 5), days=8)


def _hours(items: list[ScheduleItem], *tags: ActivityTag) -> float:
    return sum(seconds_of_day(i.end) - seconds_of_day(i.start) for i in items if i.tag in tags) / 3600


def _mean(people: list[Resident], *tags: ActivityTag) -> float:
    return sum(_hours(r.schedule, *tags) for r in people) / len(people)


@pytest.mark.parametrize("seed", range(2))
def test_ten_days_are_grounded(town: World, seed: int) -> None:
    assert check_community(build_community(town, residents=25, seed=seed, days=10), town) == []


@pytest.mark.parametrize(("day", "seed"), [(_SATURDAY, 0), (_SATURDAY, 3), (_SUNDAY, 1), (_SUNDAY, 2)])
def test_weekends_are_grounded(town: World, day: date, seed: int) -> None:
    community = build_community(town, residents=40, seed=seed, date=day)
    assert community.date == day
    assert check_community(community, town) == []


def test_offices_and_schools_are_empty_at_the_weekend(week: Community, town: World) -> None:
    offices = {p.id for p in town.places if p.kind in ("company", "architect", "lawyer", "university", "bank")}
    for day in (_SATURDAY, _SUNDAY):
        people = week.on(day).residents
        assert [r.name for r in people for i in r.schedule if i.place in offices] == []
        assert _mean([r for r in people if r.age < 18], ActivityTag.STUDY) < 0.5


def test_less_is_worked_and_more_is_played_at_the_weekend(week: Community) -> None:
    friday, saturday, sunday = (week.on(date(2025, 6, day)).residents for day in (6, 7, 8))
    assert _mean(friday, *_WORK) > 1.5 * _mean(saturday, *_WORK)
    assert _mean(saturday, *_WORK) >= _mean(sunday, *_WORK)
    assert _mean(sunday, ActivityTag.LEISURE) > 1.15 * _mean(friday, ActivityTag.LEISURE)


def test_nobody_works_seven_days_a_week(week: Community) -> None:
    working = {
        r.id: sum(_hours(week.on(day).resident_by_id[r.id].schedule, *_WORK) > 1 for day in week.dates[:7])
        for r in week.residents
        if r.workplace is not None and r.age >= 18
    }
    assert max(working.values()) <= 5
    assert sum(working.values()) >= 4 * len(working)


def test_nobody_visits_a_closed_place(week: Community, town: World) -> None:
    """By the hours that places give, as the validator has it, and on the days that they are closed."""
    where = (town.manifest.origin.lat, town.manifest.origin.lon)
    for day in week.dates:
        for resident in week.on(day).residents:
            for item in resident.schedule:
                place = town.place_by_id.get(item.place or "")
                if place is not None and place.opening_hours and place.id not in (resident.home, resident.workplace):
                    spans = open_spans(place.opening_hours, day, where)
                    assert spans, (resident.name, place.name, day)


def test_weekly_groups_meet_on_their_day_of_the_week_again(week: Community) -> None:
    weekly = [g for g in week.groups if g.name.startswith(("Book circle", "Choir", "Chess table", "Film club"))]
    assert weekly
    for group in weekly:
        met = [day for day in week.dates if set(_group(week, day, group.id).absent) != set(group.members)]
        assert {day.weekday() for day in met} == {week.date.weekday()}


def _group(community: Community, day: date, group: str):
    return next(g for g in community.on(day).groups if g.id == group)


def test_who_goes_to_bed_after_midnight_is_awake_when_the_next_day_begins(week: Community) -> None:
    for before, after in zip(week.dates, week.dates[1:], strict=False):
        for resident in week.on(before).residents:
            up_late = resident.schedule[-1].type is not ItemType.SLEEP
            morning = week.on(after).resident_by_id[resident.id].schedule[0]
            assert (morning.type is not ItemType.SLEEP) == up_late, (resident.name, after)


def test_people_are_where_the_day_before_left_them(week: Community) -> None:
    for before, after in zip(week.dates, week.dates[1:], strict=False):
        for resident in week.on(before).residents:
            assert week.on(after).resident_by_id[resident.id].schedule[0].place == resident.schedule[-1].place


def test_a_day_of_several_is_a_community_of_its_own(week: Community, town: World) -> None:
    sunday = week.on(_SUNDAY)
    assert sunday.dates == [_SUNDAY]
    assert check_community(sunday, town) == []


def test_a_day_that_is_not_there_is_refused(week: Community) -> None:
    with pytest.raises(InputError, match=r"no schedules for 2025-07-01; there are 2025-06-05 \(Thursday\)"):
        week.on(date(2025, 7, 1))


def test_several_days_come_back_from_a_folder(week: Community, town: World, tmp_path: Path) -> None:
    write_community(week, tmp_path / "people")
    assert read_community(tmp_path / "people", town) == week


def test_a_folder_of_version_1_is_read(community: Community, town: World, tmp_path: Path) -> None:
    """As it was written before there were several days: no file of them, and nobody absent from a group."""
    import hashlib

    write_community(community, tmp_path / "people")
    (tmp_path / "people" / "days.json").unlink()
    groups = json.loads((tmp_path / "people" / "groups.json").read_text())
    text = json.dumps([{k: v for k, v in group.items() if k != "absent"} for group in groups])
    (tmp_path / "people" / "groups.json").write_text(text)
    manifest = json.loads((tmp_path / "people" / "community.json").read_text())
    manifest["version"] = 1
    del manifest["files"]["days.json"], manifest["counts"]["days"]
    manifest["files"]["groups.json"] = hashlib.sha256(text.encode()).hexdigest()
    (tmp_path / "people" / "community.json").write_text(json.dumps(manifest))
    assert read_community(tmp_path / "people", town) == community


def test_the_first_day_is_the_same_however_many_follow(town: World) -> None:
    one, three = (build_community(town, residents=20, seed=4, days=days) for days in (1, 3))
    assert [r.schedule for r in one.residents] == [r.schedule for r in three.residents]


def test_the_validator_looks_at_all_days(week: Community, town: World) -> None:
    second = week.further_days[1]
    resident = week.residents[3]
    broken = [item for item in second.schedules[resident.id] if item.type is not ItemType.COMMUTE][:3]
    days = list(week.further_days)
    days[1] = second.model_copy(update={"schedules": second.schedules | {resident.id: broken}})
    found = check_community(week.model_copy(update={"further_days": days}), town)
    assert any(f.where.startswith(f"further_days[1].{resident.id}.schedule") for f in found)


def test_midday_closing_sends_staff_home_or_to_rest() -> None:
    hours = "Mo-Fr 09:00-12:30, 15:00-19:00"
    always = ("accommodation", "open", "transit")
    world = make_world(tuple((*p[:3], hours) if p[1] not in always else p for p in PLACES))
    people = [r for seed in range(3) for r in build_community(world, residents=30, seed=seed).residents]
    shops = [r for r in people if r.age >= 18 and r.workplace and world.place_by_id[r.workplace].kind != "hotel"]
    at_work = [i for r in shops for i in r.schedule if i.place == r.workplace and i.tag == "work"]
    assert at_work
    assert [i for i in at_work if i.start < "12:30:00" and i.end > "15:00:00"] == []


def test_a_word_that_is_no_day_is_refused() -> None:
    with pytest.raises(InputError, match="write 2025-06-07 or saturday"):
        date_of("caturday")


@pytest.mark.parametrize("days", [0, 99])
def test_only_so_many_days_are_written(town: World, days: int) -> None:
    with pytest.raises(InputError, match="ask for 1 to 14"):
        build_community(town, days=days)
