"""Groups and ties: a question for some twenty people at a time, held to when and where all of a group can be."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from vico.clock import seconds_of_day
from vico.community.llm.lives import Lives, minute_of
from vico.community.llm.prompting import (
    GroupReply,
    ModelDesk,
    ModelDraft,
    SocialNetwork,
    TieReply,
    faults_of,
    social_network_of,
)
from vico.community.model import ActivityTag, AuthoredItem, Group, Origin, Relation, RelationKind, Resident
from vico.community.people import GROWN_UP
from vico.errors import InputError
from vico.llm.prompts import Prompt
from vico.world.model import Category

_BATCH = 20  # people of a question
_PLACES = 24  # meeting places in it
_A_GROUP = 4  # people a group
_MEETING_PLACES = (Category.OPEN, Category.FOOD, Category.ENTERTAINMENT, Category.OFFICE)
_EARLIEST = 6 * 60  # minute of the day when the first meeting may begin
_SHORTEST, _LONGEST = 20, 240  # minutes a meeting takes
_MOST_DETAIL = 240  # characters
_MOST_GROUPS = 2  # of one person


@dataclass
class Network:
    """Groups and ties that the model wrote and that hold.

    Attributes
    ----------
    groups
        Their ids are not final.
    ties
        Between residents, in the order of the community.
    """

    groups: list[Group] = field(default_factory=list)
    ties: list[Relation] = field(default_factory=list)

    def of(self, resident: str) -> list[Group]:
        """Return the groups of somebody."""
        return [group for group in self.groups if resident in group.members]


def write_network(
    desk: ModelDesk, prompt: Prompt, lives: Lives, *, unasked: frozenset[str] = frozenset()
) -> tuple[Network, dict[str, ModelDraft[SocialNetwork]]]:
    """Have the model bring people together: grown-ups whose day does not go with a small child's.

    Of drafts that stay faulty the groups and ties without fault are taken, without members who can't be there.

    Returns
    -------
    network, drafts
        What holds; and the question that somebody was part of, by id.
    """
    cast = lives.cast
    people = [
        r.id
        for r in cast.base.residents
        if r.age >= GROWN_UP and r.id not in cast.tied_to_small_children and r.id not in unasked
    ]
    # Batches of about the same size, none of one person alone.
    count = -(-len(people) // _BATCH)
    edges = [round(k * len(people) / count) for k in range(count + 1)] if len(people) > 1 else []
    batches = [people[a:b] for a, b in pairwise(edges)]
    drafts = [_question(prompt, lives, batch, number) for number, batch in enumerate(batches)]
    network = Network()
    judge = _NetworkJudge(lives, batches)
    desk.settle("groups", drafts, judge)
    for draft in drafts:
        if draft.value is not None:
            kept = judge.sound(draft)
            network.groups += kept.groups
            network.ties += kept.ties
    return network, {name: draft for batch, draft in zip(batches, drafts, strict=True) for name in batch}


def network_items(
    lives: Lives, network: Network, drafts: Mapping[str, ModelDraft[SocialNetwork]]
) -> list[AuthoredItem]:
    """Return whose everybody's groups are, in the order of the residents, and last whose the ties are."""
    items = []
    for resident in lives.cast.base.residents:
        name, draft = f"{resident.id}.groups", drafts.get(resident.id)
        if draft is None:
            why = "a child" if resident.age < GROWN_UP else "goes together with a small child's day, or is alone"
            items.append(AuthoredItem(item=name, origin=Origin.NOT_ASKED, detail=why))
        elif network.of(resident.id):
            items.append(AuthoredItem(item=name, origin=Origin.WRITTEN))
        elif draft.origin is Origin.WRITTEN:
            why = "their new group was given up for one that somebody else needs"
            items.append(AuthoredItem(item=name, origin=Origin.NOT_GROUNDED, detail=why))
        else:
            mine = re.compile(rf"\b{resident.id}\b")
            own = (one for one in draft.findings if mine.search(one) and not one.startswith("groups: "))
            detail = next(own, draft.detail)[:_MOST_DETAIL]
            items.append(AuthoredItem(item=name, origin=draft.origin, detail=detail))
    items.append(_relations_item(network, list({id(draft): draft for draft in drafts.values()}.values())))
    return items


def _relations_item(network: Network, drafts: Sequence[ModelDraft[SocialNetwork]]) -> AuthoredItem:
    name = "community.relations"
    if not drafts:
        return AuthoredItem(item=name, origin=Origin.NOT_ASKED, detail="there is nobody to be tied")
    answered = [draft.value for draft in drafts if draft.value is not None]
    proposed = sum(len(value.ties) for value in answered)
    if not answered or (proposed and not network.ties):
        failed = next((draft for draft in drafts if draft.origin is not Origin.WRITTEN), drafts[0])
        return AuthoredItem(item=name, origin=failed.origin, detail=failed.detail)
    lost = proposed - len(network.ties)
    detail = f"{lost} of {proposed} ties can't be, and were left out" if lost else ""
    return AuthoredItem(item=name, origin=Origin.WRITTEN, detail=detail)


def _question(prompt: Prompt, lives: Lives, batch: Sequence[str], number: int) -> ModelDraft[SocialNetwork]:
    cast = lives.cast
    people = [lives.people[name] for name in batch]
    places = cast.near([person.home for person in people], _MEETING_PLACES, _PLACES)
    messages = prompt.messages(
        scene=cast.scene(),
        people=[_person_facts(lives, person) for person in people],
        places=[cast.place_facts(place) for place in places],
        day=cast.base.weekday,
        groups=max(1, round(len(people) / _A_GROUP)),
        year=cast.base.date.year,
    )
    reply = social_network_of(list(batch), [cast.labels[place] for place in places])
    return ModelDraft(f"groups_{number}", prompt, messages, reply)


def _person_facts(lives: Lives, person: Resident) -> dict[str, Any]:
    working = [
        (stay.start, stay.end)
        for stay in lives.plain_stays(person.id)
        if stay.tag in (ActivityTag.WORK, ActivityTag.STUDY) and stay.place == person.workplace
    ]
    hours = None
    if working:
        first, last = min(start for start, _ in working), max(end for _, end in working)
        hours = f"{first // 60:02d}:{first % 60:02d}-{last // 60:02d}:{last % 60:02d}"
    return {
        "id": person.id,
        "name": person.name,
        "age": person.age,
        "occupation": person.occupation,
        "workplace": lives.cast.labels[person.workplace] if person.workplace else None,
        "at_work": hours,
        "hobbies": person.hobbies,
        "values": person.values,
        "traits": person.personality.traits,
        "household": person.household,
    }


class _NetworkJudge:
    """Holds groups and ties to the world, to people's days and to each other."""

    def __init__(self, lives: Lives, batches: Sequence[Sequence[str]]) -> None:
        self._lives = lives
        self._batches = {f"groups_{k}": list(batch) for k, batch in enumerate(batches)}
        self._names = {group.name.casefold(): "" for group in lives.cast.base.groups}

    def __call__(self, draft: ModelDraft[SocialNetwork]) -> list[str]:
        findings: list[str] = []
        self._keep_holding(draft, findings)
        return findings

    def sound(self, draft: ModelDraft[SocialNetwork]) -> Network:
        """Return what is without fault in a draft."""
        return self._keep_holding(draft, [])

    def _keep_holding(self, draft: ModelDraft[SocialNetwork], findings: list[str]) -> Network:
        assert draft.value is not None
        kept = Network()
        for k, reply in enumerate(draft.value.groups):
            group, faults = self._group(f"groups[{k}]", reply, kept, draft.item)
            findings += faults
            if group is not None:
                self._names[group.name.casefold()] = draft.item
                kept.groups.append(group)
        for k, tie in enumerate(draft.value.ties):
            relation, fault = self._tie(f"ties[{k}]", tie, kept)
            findings += [fault] if fault else []
            if relation is not None:
                kept.ties.append(relation)
        alone = [name for name in self._batches[draft.item] if not kept.of(name)]
        if alone:
            findings.append(
                f"groups: {', '.join(alone)} {'is' if len(alone) == 1 else 'are'} in no group that can meet"
            )
        return kept

    def _group(self, where: str, reply: GroupReply, kept: Network, batch: str) -> tuple[Group | None, list[str]]:
        """Return a group of those who can be there (None if it can't be mended so), and what is wrong."""
        faults = [
            *faults_of(where, "group name", [reply.name]),
            *faults_of(where, "description", [reply.description]),
            *faults_of(where, "activity", [reply.activity]),
        ]
        name = " ".join(reply.name.split())
        taken = name.casefold() in self._names and self._names[name.casefold()] != batch
        if taken or name.casefold() in {group.name.casefold() for group in kept.groups}:
            faults.append(f"{where}.name: there is another group called {name!r}: choose another name")
        try:
            start, end = (seconds_of_day(text) // 60 for text in (reply.start_time, reply.end_time))
            if not _SHORTEST <= end - start <= _LONGEST:
                faults.append(
                    f"{where}: it meets for {end - start} min: between {_SHORTEST} and {_LONGEST} min fit a day"
                )
            if start < _EARLIEST:
                faults.append(f"{where}: it meets at {reply.start_time}, when people sleep: meet from 06:00:00 on")
        except InputError as error:
            faults.append(f"{where}: {error}")
        if faults:
            return None, faults
        place = self._lives.cast.labels.place(reply.place)
        group = Group(
            id="group_0", name=name, description=reply.description.strip(), activity=reply.activity.strip(),
            place=place, members=[], start=_clock(start), end=_clock(end),
        )  # fmt: skip
        members = []
        for member in dict.fromkeys(reply.members):
            fault = self._can_come(member, group, kept)
            if fault:
                faults.append(f"{where}: {member} can't be there: {fault}")
            else:
                members.append(member)
        if len(members) < 2:
            return None, [*faults, f"{where}: {len(members)} of its members can be there: find two or more"]
        return group.model_copy(update={"members": members}), faults

    def _can_come(self, member: str, group: Group, kept: Network) -> str:
        groups = [*kept.of(member), group]
        if len(groups) > _MOST_GROUPS:
            return f"that is more than {_MOST_GROUPS} groups"
        day = self._lives.plain_day(member, groups)
        if day.findings:
            return day.findings[0]
        tags = (ActivityTag.WORK, ActivityTag.STUDY)
        at_work = any(
            stay.tag in tags and stay.start < minute_of(group.end) and minute_of(group.start) < stay.end
            for stay in self._lives.plain_stays(member)
            if stay.place == self._lives.people[member].workplace
        )
        return "it is in their working hours" if at_work and group.place != self._lives.people[member].workplace else ""

    def _tie(self, where: str, reply: TieReply, kept: Network) -> tuple[Relation | None, str]:
        people = self._lives.people
        order = {name: k for k, name in enumerate(people)}
        a, b = sorted(reply.between, key=lambda name: order[name])
        if a == b:
            return None, f"{where}: it joins {a} with themselves: join two people"
        if any(relation.between == (a, b) for relation in kept.ties):
            return None, f"{where}: {a} and {b} are joined twice: keep the closest tie"
        if people[a].household == people[b].household:
            return None, f"{where}: {a} and {b} live together, which is known: leave it out"
        year = self._lives.cast.base.date.year
        born = year - min(people[a].age, people[b].age)
        if not born <= reply.since <= year:
            return None, f"{where}: since {reply.since}: give a year between {born} and {year}"
        if reply.kind == "colleague" and (people[a].workplace is None or people[a].workplace != people[b].workplace):
            return None, f"{where}: {a} and {b} don't work at the same place: they are no colleagues"
        if faults := faults_of(where, "note", [reply.note]):
            return None, faults[0]
        return Relation(
            between=(a, b), kind=RelationKind(reply.kind), note=reply.note.strip(), strength=reply.strength / 100,
            since=reply.since,
        ), ""  # fmt: skip


def _clock(minute: int) -> str:
    return f"{minute // 60:02d}:{minute % 60:02d}:00"


def with_old_groups(lives: Lives, network: Network) -> list[Group]:
    """Return the groups of a community: the model's, and the procedural author's for those who are in none of these.

    Who is in an old group with somebody who needs it stays in it, if their new meetings leave them the time; where too
    few can stay, a new group that is in the way is given up.
    """
    base = lives.cast.base
    groups = list(network.groups)
    while True:
        new = Network(groups)
        needing = {r.id for r in base.residents if not new.of(r.id)}
        old: list[Group] = []
        blocked: Group | None = None
        for group in base.groups:
            if not needing & set(group.members):
                continue
            members = [m for m in group.members if m in needing or not lives.plain_day(m, [*new.of(m), group]).findings]
            if len(members) < min(2, len(base.residents)):
                blocked = next(g for m in group.members if m not in needing for g in new.of(m))
                break
            old.append(group.model_copy(update={"members": members}))
        if blocked is None:
            network.groups = groups
            return [group.model_copy(update={"id": f"group_{k}"}) for k, group in enumerate([*old, *groups])]
        groups.remove(blocked)


def groups_by_member(groups: Sequence[Group]) -> Mapping[str, list[Group]]:
    """Return the groups of each resident who is in any, by id."""
    found: dict[str, list[Group]] = {}
    for group in groups:
        for member in group.members:
            found.setdefault(member, []).append(group)
    return found
