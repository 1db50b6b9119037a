"""Characters and days of people, as a model writes them.

Characters are asked for by household, as what one is called and does stands in the others' lives, too. A day is asked
for by resident, after the paper's prompt for daily plans; our router says how long ways take.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from vico.clock import seconds_of_day
from vico.community.llm.lives import MIDNIGHT, FittedDay, Lives, Stay, minute_of
from vico.community.llm.prompting import (
    ActivityReply,
    Cast,
    CharacterReply,
    Characters,
    DayPlan,
    ModelDesk,
    ModelDraft,
    characters_of,
    day_plan_of,
    faults_of,
    name_fault,
)
from vico.community.model import LAST, AuthoredItem, Group, ItemType, Origin, Personality, Resident
from vico.community.people import GROWN_UP, adults_only
from vico.community.place_index import kind_of
from vico.community.work import job_of
from vico.errors import InputError
from vico.llm.prompts import Prompt
from vico.world.model import Category


def write_characters(
    desk: ModelDesk, prompt: Prompt, lives: Lives, *, unasked: frozenset[str] = frozenset()
) -> tuple[list[AuthoredItem], list[ModelDraft[Any]]]:
    """Have the model write who everybody is; who it can't write stays who they were.

    Parameters
    ----------
    lives
        Takes up who is accepted.
    unasked
        Ids of people whom the model is not asked for, with their households.

    Returns
    -------
    list of AuthoredItem, list of Draft
        An item a resident, in their order; and the questions.
    """
    cast = lives.cast
    asked = [k for k, people in enumerate(cast.households) if not {r.id for r in people} & unasked]
    drafts = [_household_question(prompt, cast, k) for k in asked]
    writer = _CharacterJudge(lives)
    desk.settle("characters", drafts, writer)
    by_household = dict(zip(asked, drafts, strict=True))
    items = {}
    for k, household in enumerate(cast.households):
        for resident in household:
            name = f"{resident.id}.character"
            draft = by_household.get(k)
            items[resident.id] = (
                AuthoredItem(item=name, origin=Origin.NOT_ASKED, detail="named by the validator in a draft before")
                if draft is None
                else AuthoredItem(item=name, origin=draft.origin, detail=draft.detail)
            )
    return [items[r.id] for r in cast.base.residents], list(drafts)


def _household_question(prompt: Prompt, cast: Cast, number: int) -> ModelDraft[Characters]:
    household = cast.households[number]
    offers = cast.offers[number]
    places = dict.fromkeys([*offers, *(r.workplace for r in household if r.workplace is not None)])
    messages = prompt.messages(
        scene=cast.scene(),
        workplaces=[cast.place_facts(place, jobs=True) for place in offers],
        count=f"{len(household)} {'person' if len(household) == 1 else 'people'}",
        people=[cast.body(resident) for resident in household],
    )
    reply = characters_of([r.id for r in household], [cast.labels[place] for place in places])
    return ModelDraft(f"household_{number}", prompt, messages, reply)


class _CharacterJudge:
    """Holds characters to the world and to each other, and takes up those that hold."""

    def __init__(self, lives: Lives) -> None:
        self._lives = lives

    def __call__(self, draft: ModelDraft[Characters]) -> list[str]:
        assert draft.value is not None
        replies = draft.value.characters
        household = self._lives.cast.households[int(draft.item.rpartition("_")[2])]
        by_id = {reply.id: reply for reply in replies}
        if by_id.keys() != {r.id for r in household} or len(by_id) != len(replies):
            return [f"characters: write each of {', '.join(r.id for r in household)} once"]
        findings: list[str] = []
        people = []
        for resident in household:
            person = self._person(resident, by_id[resident.id])
            people.append(person)
            findings += _character_faults(by_id[resident.id], person)
        findings += self._names(people)
        for person in people if not findings else ():
            findings += self._grounding(person)
        if not findings:
            before = [self._lives.people[r.id] for r in household]
            self._lives.accept(people)
            findings = [f for person in people for f in self._day(person)]
            if findings:
                self._lives.accept(before)
        return findings

    def _person(self, resident: Resident, reply: CharacterReply) -> Resident:
        cast = self._lives.cast
        occupation, workplace = reply.occupation.strip(), resident.workplace
        if cast.keeps_work(resident):
            occupation = resident.occupation
        else:
            workplace = None if reply.workplace is None else cast.labels.place(reply.workplace)
        scores = reply.personality.model_dump()
        shares = {name: value if name == "traits" else value / 100 for name, value in scores.items()}
        known = [place for place in (resident.home, workplace, *resident.known_places) if place is not None]
        return resident.model_copy(
            update={
                "name": " ".join(reply.name.split()),
                "occupation": occupation,
                "workplace": workplace,
                "values": list(dict.fromkeys(reply.values)),
                "personality": Personality(**shares),
                "hobbies": [" ".join(one.split()) for one in dict.fromkeys(reply.hobbies)],
                "lifestyle": reply.lifestyle.strip(),
                "biography": reply.biography.strip(),
                "known_places": list(dict.fromkeys(known)),
            }
        )

    def _names(self, people: Sequence[Resident]) -> list[str]:
        mine = {person.id for person in people}
        taken = {r.name.casefold() for r in self._lives.people.values() if r.id not in mine}
        taken |= {r.name.casefold() for r in self._lives.cast.base.residents if r.id not in mine}
        findings = []
        for person in people:
            if person.name.casefold() in taken:
                findings.append(f"{person.id}.name: somebody else is called {person.name}: choose another name")
            taken.add(person.name.casefold())
        return findings

    def _grounding(self, person: Resident) -> list[str]:
        """Return what the validator finds in somebody's work and life."""
        cast = self._lives.cast
        found = self._lives.findings(person, "workplace", "biography")
        settled = [one for one in found if not (cast.keeps_work(person) and one.where.endswith(".workplace"))]
        return [*self._trade(person), *(f"{one.where}: {one.what}; {one.mend}" for one in settled)]

    def _trade(self, person: Resident) -> list[str]:
        """Return whether somebody's place of work employs no such trade; the validator lets unknown ones pass."""
        cast = self._lives.cast
        if person.workplace is None or cast.keeps_work(person) or job_of(person.occupation) is not None:
            return []
        trades = cast.trades(person.workplace)
        if person.occupation.startswith("student") and any(trade.startswith("student") for trade in trades):
            return []
        where, place = f"{person.id}.occupation", cast.labels[person.workplace]
        return [f"{where}: {place} employs no {person.occupation!r}: choose of {', '.join(trades)}"]

    def _day(self, person: Resident) -> list[str]:
        """Return whether somebody could not live the plain day of such a life."""
        if person.id in self._lives.cast.tied_to_small_children:
            return []
        fitted = self._lives.plain_day(person.id, self._lives.cast.base.groups_of(person.id))
        return [f"{person.id}.workplace: its hours don't go with the rest of a day: {one}" for one in fitted.findings]


def _character_faults(reply: CharacterReply, person: Resident) -> list[str]:
    where = reply.id
    fault = name_fault(person.name)
    return [
        *([f"{where}.name: {reply.name!r} {fault}"] if fault else []),
        *faults_of(where, "occupation", [reply.occupation]),
        *faults_of(where, "hobby", reply.hobbies),
        *faults_of(where, "trait", reply.personality.traits),
        *faults_of(where, "lifestyle", [reply.lifestyle]),
        *faults_of(where, "biography", [reply.biography]),
    ]


# Places that a resident's day is planned with, at most; the nearest of what they know.
_MOST_PLACES = 24
_SLEEP = 4 * 60  # least minutes, of grown-ups
_SLEEP_OF_CHILDREN = 7.5 * 60  # least minutes
_AT_WORK = 60  # least minutes of who has a workplace


def write_days(
    desk: ModelDesk,
    prompt: Prompt,
    lives: Lives,
    groups: Mapping[str, Sequence[Group]],
    *,
    unasked: frozenset[str] = frozenset(),
) -> tuple[dict[str, FittedDay], list[AuthoredItem], list[ModelDraft[Any]]]:
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
    asked = [r.id for r in cast.base.residents if r.id not in cast.tied_to_small_children and r.id not in unasked]
    judge = _DayJudge(lives, groups)
    drafts = [_day_question(prompt, lives, name, groups.get(name, ())) for name in asked]
    desk.settle("days", drafts, judge)
    by_id = dict(zip(asked, drafts, strict=True))
    items = []
    for resident in cast.base.residents:
        name, draft = f"{resident.id}.schedule", by_id.get(resident.id)
        if draft is None:
            why = (
                "goes together with a small child's day"
                if resident.id in cast.tied_to_small_children
                else "named by the validator"
            )
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


def _day_question(prompt: Prompt, lives: Lives, name: str, groups: Sequence[Group]) -> ModelDraft[DayPlan]:
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
    return ModelDraft(name, prompt, messages, day_plan_of([cast.labels[place] for place in places]))


def _clock(minute: int) -> str:
    return LAST if minute >= MIDNIGHT else f"{minute // 60:02d}:{minute % 60:02d}:00"


class _DayJudge:
    """Fits days that the model plans, and takes up those that can be lived."""

    def __init__(self, lives: Lives, groups: Mapping[str, Sequence[Group]]) -> None:
        self.days: dict[str, FittedDay] = {}
        self._lives, self._groups = lives, groups

    def __call__(self, draft: ModelDraft[DayPlan]) -> list[str]:
        assert draft.value is not None
        plan = draft.value.schedule
        findings = _plan_faults(plan)
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
        # Too little sleep, or too few hours at the place of work.
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
        if findings:
            return findings
        day = self._lives.day(person, stays, self._groups.get(draft.item, ()), others=self._lives.lessons(draft.item))
        if not day.findings:
            self.days[draft.item] = day
        return day.findings


def _plan_faults(plan: Sequence[ActivityReply]) -> list[str]:
    """Return what is wrong with a plan whatever the town."""
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
