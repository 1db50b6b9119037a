"""A day of each resident, after the paper's prompt for daily plans; our router says how long ways take."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from vico.clock import seconds_of_day
from vico.community.authorship import AuthoredItem, Origin
from vico.community.childhood import GROWN_UP, adults_only
from vico.community.llm.asking import Draft, ModelDesk
from vico.community.llm.cast import Cast
from vico.community.llm.fitting import MIDNIGHT, FittedDay, Stay, minute_of
from vico.community.llm.lives import Lives
from vico.community.llm.prose import faults_of
from vico.community.llm.replies import ActivityReply, DayPlan, day_plan_of
from vico.community.model import LAST, Group, ItemType, Resident
from vico.community.place_index import kind_of
from vico.errors import InputError
from vico.llm.prompts import Prompt
from vico.world.model import Category

# Places that a resident's day is planned with, at most; the nearest of what they know.
_MOST_PLACES = 24
# Least sleep of grown-ups, and of children, minutes; least time at work of who has a workplace.
_SLEEP, _SLEEP_OF_CHILDREN, _AT_WORK = 4 * 60, 7.5 * 60, 60


def write_days(
    desk: ModelDesk,
    prompt: Prompt,
    lives: Lives,
    groups: Mapping[str, Sequence[Group]],
    *,
    unasked: frozenset[str] = frozenset(),
) -> tuple[dict[str, FittedDay], list[AuthoredItem], list[Draft[Any]]]:
    """Have the model plan everybody's day but those that go together with a small child's.

    Parameters
    ----------
    groups
        Of each resident, by id: meetings stand.
    unasked
        Ids of others whom the model is not asked for.

    Returns
    -------
    days, items, drafts
        By id, the days that the model planned; an item a resident, in their order; the questions.
    """
    cast = lives.cast
    asked = [r.id for r in cast.base.residents if r.id not in cast.coupled and r.id not in unasked]
    judge = _DayJudge(lives, groups)
    drafts = [_question(prompt, lives, name, groups.get(name, ())) for name in asked]
    desk.settle("days", drafts, judge)
    by_id = dict(zip(asked, drafts, strict=True))
    items = []
    for resident in cast.base.residents:
        name, draft = f"{resident.id}.schedule", by_id.get(resident.id)
        if draft is None:
            why = "goes together with a small child's day" if resident.id in cast.coupled else "named by the validator"
            items.append(AuthoredItem(item=name, origin=Origin.NOT_ASKED, detail=why))
        else:
            day = judge.days.get(resident.id)
            items.append(
                AuthoredItem(item=name, origin=draft.origin, detail=draft.detail, moved=0 if day is None else day.moved)
            )
    return judge.days, items, list(drafts)


def known_places(cast: Cast, person: Resident, groups: Sequence[Group]) -> list[str]:
    """Return the places a day is planned with: home, work, meetings, then what they know and may enter."""
    barred = adults_only() if person.age < GROWN_UP else frozenset()
    first = [person.home, person.workplace, *(group.place for group in groups)]
    places = dict.fromkeys(place for place in [*first, *person.known_places] if place is not None)
    fitting = [
        place
        for place in places
        if cast.index.place_by_id[place].category is not Category.TRANSIT
        and kind_of(cast.index.place_by_id[place]) not in barred
    ]
    return fitting[:_MOST_PLACES]


def _question(prompt: Prompt, lives: Lives, name: str, groups: Sequence[Group]) -> Draft[DayPlan]:
    cast, person = lives.cast, lives.people[name]
    places = known_places(cast, person, groups)
    standing = sorted([*lives.meetings(name, groups), *lives.lessons(name)], key=lambda stay: stay.start)
    messages = prompt.messages(
        character={
            "name": person.name,
            "age": person.age,
            "occupation": person.occupation,
            "home": cast.labels[person.home],
            "workplace": cast.labels[person.workplace] if person.workplace else None,
            "values": person.values,
            "personality": person.personality.traits,
            "hobbies": person.hobbies,
            "lifestyle": person.lifestyle,
            "biography": person.biography,
            "lives_with": [
                f"{lives.people[other].name} ({lives.people[other].age}), {what}"
                for other, _, what in (one.partition(": ") for one in cast.family(person))
            ],
        },
        places=[cast.place_facts(place, walk_from=person.home) for place in places],
        appointments=[
            {
                "activity": stay.activity,
                "place": cast.labels[stay.place],
                "start_time": _clock(stay.start),
                "end_time": _clock(stay.end),
            }
            for stay in standing
        ],
        day=f"{cast.base.weekday}, {cast.base.date.isoformat()}",
    )
    return Draft(name, prompt, messages, day_plan_of([cast.labels[place] for place in places]))


def _clock(minute: int) -> str:
    return LAST if minute >= MIDNIGHT else f"{minute // 60:02d}:{minute % 60:02d}:00"


class _DayJudge:
    """Fits days that the model plans, and takes up those that can be lived."""

    def __init__(self, lives: Lives, groups: Mapping[str, Sequence[Group]]) -> None:
        self.days: dict[str, FittedDay] = {}
        self._lives, self._groups = lives, groups

    def __call__(self, draft: Draft[DayPlan]) -> list[str]:
        assert draft.value is not None
        plan = draft.value.schedule
        findings = _faults(plan)
        if findings:
            return findings
        person = self._lives.people[draft.item]
        place = self._lives.cast.labels.place
        stays = [
            Stay(minute_of(one.start_time), minute_of(one.end_time), ItemType(one.type), " ".join(one.activity.split()),
                 place(one.place))
            for one in plan
            if one.place is not None
        ]  # fmt: skip
        findings = _lacks(stays, person)
        if findings:
            return findings
        day = self._lives.day(person, stays, self._groups.get(draft.item, ()), others=self._lives.lessons(draft.item))
        if not day.findings:
            self.days[draft.item] = day
        return day.findings


def _faults(plan: Sequence[ActivityReply]) -> list[str]:
    """Say what is wrong with a plan whatever the town."""
    findings: list[str] = []
    for k, one in enumerate(plan):
        where = f"schedule[{k}]"
        try:
            start, end = seconds_of_day(one.start_time), seconds_of_day(one.end_time)
        except InputError as error:
            findings.append(f"{where}: {error}")
            continue
        if end <= start:
            findings.append(f"{where}: it ends at {one.end_time}, not after its start {one.start_time}")
        if k and one.start_time != plan[k - 1].end_time:
            findings.append(
                f"{where}: it starts at {one.start_time}, but the one before ends at {plan[k - 1].end_time}"
            )
        if (one.type == "commute") != (one.place is None):
            findings.append(f"{where}: place is null for a commute, and only then")
        findings += faults_of(where, "activity", [one.activity])
    if plan[0].start_time != "00:00:00":
        findings.append(f"schedule[0]: the day starts at {plan[0].start_time}, not at 00:00:00")
    if plan[-1].end_time != LAST:
        findings.append(f"schedule[{len(plan) - 1}]: the day ends at {plan[-1].end_time}, not at {LAST}")
    if "commute" in (plan[0].type, plan[-1].type):
        findings.append("schedule: the day begins and ends at a place, not on the way")
    return findings


def _lacks(stays: Sequence[Stay], person: Resident) -> list[str]:
    """Say what a day of such a person lacks."""
    findings = []
    asleep = sum(stay.minutes for stay in stays if stay.type is ItemType.SLEEP)
    least = _SLEEP_OF_CHILDREN if person.age < GROWN_UP else _SLEEP
    if asleep < least:
        findings.append(f"schedule: {asleep / 60:.1f} h of sleep: plan {least / 60:g} h or more")
    working = sum(stay.minutes for stay in stays if stay.place == person.workplace)
    if person.workplace is not None and person.age >= GROWN_UP and working < _AT_WORK:
        findings.append(
            f"schedule: {working} min at {person.occupation}'s place of work: plan the hours such work takes there"
        )
    return findings
