"""Who people are: a question a household, as what one is called and does stands in the others' lives, too."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from vico.community.authorship import AuthoredItem, Origin
from vico.community.jobs import job_of
from vico.community.llm.asking import Draft, ModelDesk
from vico.community.llm.cast import Cast
from vico.community.llm.lives import Lives
from vico.community.llm.prose import faults_of, name_fault
from vico.community.llm.replies import CharacterReply, Characters, characters_of
from vico.community.model import Personality, Resident
from vico.llm.prompts import Prompt


def write_characters(
    desk: ModelDesk, prompt: Prompt, lives: Lives, *, unasked: frozenset[str] = frozenset()
) -> tuple[list[AuthoredItem], list[Draft[Any]]]:
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
    drafts = [_question(prompt, cast, k) for k in asked]
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


def _question(prompt: Prompt, cast: Cast, number: int) -> Draft[Characters]:
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
    return Draft(f"household_{number}", prompt, messages, reply)


class _CharacterJudge:
    """Holds characters to the world and to each other, and takes up those that hold."""

    def __init__(self, lives: Lives) -> None:
        self._lives = lives

    def __call__(self, draft: Draft[Characters]) -> list[str]:
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
            findings += _faults(by_id[resident.id], person)
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
        """Say whether somebody's place of work employs no such trade; the validator lets unknown ones pass."""
        cast = self._lives.cast
        if person.workplace is None or cast.keeps_work(person) or job_of(person.occupation) is not None:
            return []
        trades = cast.trades(person.workplace)
        if person.occupation.startswith("student") and any(trade.startswith("student") for trade in trades):
            return []
        where, place = f"{person.id}.occupation", cast.labels[person.workplace]
        return [f"{where}: {place} employs no {person.occupation!r}: choose of {', '.join(trades)}"]

    def _day(self, person: Resident) -> list[str]:
        """Say whether somebody could not live the plain day of such a life."""
        if person.id in self._lives.cast.coupled:
            return []
        fitted = self._lives.plain_day(person.id, self._lives.cast.base.groups_of(person.id))
        return [f"{person.id}.workplace: its hours don't go with the rest of a day: {one}" for one in fitted.findings]


def _faults(reply: CharacterReply, person: Resident) -> list[str]:
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
