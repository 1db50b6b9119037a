"""Lives in a few sentences, from facts that the rest of the community agrees with."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vico.clock import seconds_of_day
from vico.community.catalogue import Way, basic_values, biography_sentences, trait_words, ways, ways_of_life
from vico.community.childhood import childhood, schools
from vico.community.day_measures import DayMeasures, agrees
from vico.community.groups import Meeting
from vico.community.model import ItemType, Personality, ScheduleItem
from vico.community.people import Household, ResidentDraft
from vico.community.place_index import GUEST_KINDS, PlaceIndex, kind_of
from vico.community.relations import describe_household
from vico.english import with_article
from vico.world.model import Place

# When one rises early, rises late, and goes to bed late, seconds of the day.
_EARLY_RISE, _LATE_RISE, _LATE_TO_BED = 6 * 3600 + 1800, 8 * 3600, 23 * 3600


class Biographer:
    """Writes biographies; turns of phrase repeat as late as they can.

    Parameters
    ----------
    rng
        Decides the turns of phrase.
    """

    def __init__(self, rng: np.random.Generator, index: PlaceIndex) -> None:
        self._rng = rng
        self._index = index
        self._decks: dict[tuple[str, ...], list[str]] = {}
        self._told: set[str] = set()
        self._sentences = biography_sentences()
        self._says = {value.name: value.says for value in basic_values()}
        # A value of a user's own may have no words for children.
        self._children_say = self._says | dict(childhood().says)

    def _turn(self, phrases: tuple[str, ...]) -> str:
        deck = self._decks.setdefault(phrases, [])
        if not deck:
            deck.extend(phrases[int(k)] for k in self._rng.permutation(len(phrases)))
        return deck.pop()

    def _name(self, place: str | None) -> str:
        assert place is not None
        return self._index.place_by_id[place].name

    def write(self, draft: ResidentDraft, household: Household, groups: Sequence[Meeting]) -> str:
        """Write three to five sentences about somebody."""
        him = "her" if draft.gender == "female" else "him"
        words = {
            "first": draft.first,
            "she": draft.she,
            "She": draft.she.capitalize(),
            "her": draft.her,
            "Her": draft.her.capitalize(),
            "him": him,
        }
        traits = join(draft.character.traits)
        hobbies = join([h.name for h in draft.hobbies])
        sentences = [self._work(draft), self._home(draft, household, words)]
        says = self._children_say if draft.child else self._says
        young = childhood().biography
        link = self._turn(self._sentences.character).replace("call {her}", "call {him}")
        sentences.append(
            link.format(**words, traits=traits, Traits=traits.capitalize(), says=self._turn(says[draft.values[0]]))
        )
        if groups:
            group = groups[0]
            when = {"morning": "In the morning", "lunch": "At noon", "afternoon": "In the afternoon"}.get(
                group.slot, "In the evening"
            )
            name = group.circle.name
            told = ""
            # The deck comes round again with many people: never the same words about the same group.
            phrases = young.group if draft.child else self._sentences.group
            for _ in range(2 * len(phrases)):
                told = self._turn(phrases).format(
                    **words, group=name[0].lower() + name[1:], place=group.place.name, When=when
                )
                if told not in self._told:
                    break
            self._told.add(told)
            sentences.append(told)
        liked = young.hobbies if draft.child else self._sentences.hobbies
        sentences.append(self._turn(liked).format(**words, hobbies=hobbies))
        return " ".join(sentences)

    def _work(self, draft: ResidentDraft) -> str:
        name, she = f"{draft.first} {draft.last}", draft.she
        if draft.child:
            school = next((one for one in schools() if one.title == draft.occupation), None)
            told = self._turn(childhood().home_school.told if school is None else school.told)
            where = "" if draft.workplace is None else self._name(draft.workplace)
            return f"{name}, {draft.age}, {told.format(place=where)}."
        if draft.status == "worker":
            assert draft.job is not None
            first = self._turn(
                (
                    "{name}, {age}, is {job} at {place}; {she} {root}.",
                    "{name} ({age}) works as {job} at {place} and {root}.",
                    "At {age}, {name} is {job} at {place}, and {root}.",
                )
            )
            return first.format(
                name=name, age=draft.age, job=with_article(draft.occupation), place=self._name(draft.workplace),
                she=she, root=draft.job.root,
            )  # fmt: skip
        if draft.status == "student":
            first = self._turn(
                (
                    "{name}, {age}, studies {subject} at {place}.",
                    "{name} is {age} and reads {subject} at {place}.",
                    "{name}, {a_student} of {subject}, spends most weekdays at {place}.",
                )
            )
            return first.format(
                name=name, age=draft.age, a_student=with_article(f"{draft.age}-year-old student"),
                subject=draft.subject, place=self._name(draft.workplace),
            )  # fmt: skip
        if draft.status == "retired":
            told = next(former.told for former in ways_of_life().retired if former.title == draft.subject)
            return f"{name}, {draft.age}, a {draft.occupation}, {told}."
        if draft.status == "freelancer":
            told = next(f.root for f in ways_of_life().freelancer if f.title == draft.occupation)
            return f"{name}, {draft.age}, works from home as {with_article(draft.occupation)} and {told}."
        told = next(g.purpose for g in ways_of_life().guest if g.title == draft.occupation)
        return f"{name}, {draft.age}, is {with_article(draft.occupation)} who {told}."

    def _home(self, draft: ResidentDraft, household: Household, words: dict[str, str]) -> str:
        place = self._index.place_by_id[draft.home]
        where = address(place)
        company = describe_household(household, draft, {"mates": "flatmates"})
        if kind_of(place) in GUEST_KINDS:
            return f"{words['She']} has a room {where}{' ' + company if company else ''}."
        if company:
            shared = (
                "{She} lives {home} {company}.",
                "{She} shares a flat {home} {company}.",
                "Home is a flat {home}, {company}.",
            )
            return self._turn(shared).format(**words, home=where, company=company)
        phrases = (
            "{She} lives alone {home} and likes it that way.",
            "{She} has a small flat {home}.",
            "{She} lives on {her} own {home}.",
            "{She} rents two rooms {home}.",
        )
        told = ""
        for _ in phrases:
            # In a house of many flats the same words come round: not for two neighbours, if that can be.
            told = self._turn(phrases).format(**words, home=where)
            if told not in self._told:
                break
        self._told.add(told)
        return told


def address(place: Place) -> str:
    """Where a home is, as one says it: "at Mikonkatu 3", "in the apartments on Unioninkatu", "at Hotel Torni"."""
    head, _, rest = place.name.partition(", ")
    if head.lower() == "apartments" and rest:
        return f"at {rest}"
    return (
        f"in the {place.name[0].lower()}{place.name[1:]}"
        if head.lower().startswith("apartments")
        else f"at {place.name}"
    )


def rhythm_of(day: Sequence[ScheduleItem], *, works_late: bool = False) -> str:
    """Return the word for when somebody rises and goes to bed, as their day has it."""
    sleep = [item for item in day if item.type is ItemType.SLEEP]
    rises = min(seconds_of_day(item.end) for item in sleep)
    # Who lies down after midnight has one stretch of sleep, in the morning: the evening before was a long one.
    up_late = max(seconds_of_day(item.start) for item in sleep) >= _LATE_TO_BED or seconds_of_day(sleep[0].start) > 0
    if rises <= _EARLY_RISE:
        return "Early riser"
    if rises >= _LATE_RISE and up_late:
        return "Works late and sleeps in" if works_late else "Night owl"
    return "Keeps regular hours"


def lifestyle_of(
    rng: np.random.Generator, draft: ResidentDraft, day: Sequence[ScheduleItem], measures: DayMeasures
) -> str:
    """Return how somebody lives, in a sentence that their days agree with."""
    rhythm = rhythm_of(day, works_late=draft.shift is not None and draft.shift[0] >= 12 * 60)
    if not agrees(rhythm, measures):  # on other days than the first
        rhythm = "Keeps regular hours"
    if draft.child:
        told = childhood().biography.ways
        return f"{rhythm}; {join([told[int(k)] for k in rng.choice(len(told), 2, replace=False)])}."
    options = [way for way in ways() if draft.status in way.statuses and agrees(way.text, measures)]
    first = [way.text for way in options if _is_told_of(way, draft)]
    anybody = [way.text for way in options if not (way.values or way.hobbies or way.trait)]
    spare = [anybody[int(k)] for k in rng.permutation(len(anybody))]
    picked = [first[int(k)] for k in rng.permutation(len(first))][:3]
    return f"{rhythm}; {join([*picked, *spare[: max(0, 2 - len(picked))]])}."


def _is_told_of(way: Way, draft: ResidentDraft) -> bool:
    """Whether something is said of somebody for their values, hobbies or character."""
    fits = bool(set(way.values) & set(draft.values) or set(way.hobbies) & {hobby.name for hobby in draft.hobbies})
    return fits or (way.trait is not None and way.least <= getattr(draft.character, way.trait) <= way.most)


def honest_character(draft: ResidentDraft, measures: DayMeasures) -> Personality:
    """Return somebody's character in words that their days agree with: others of the same kind, or of another trait."""
    character, words = draft.character, trait_words()
    scores = {name: float(getattr(character, name)) for name in words}
    order = sorted(scores, key=lambda name: (-abs(scores[name] - 0.5), name))
    ranked = [words[name].high if scores[name] >= 0.5 else words[name].low for name in order]
    told: list[str] = []
    for word in character.traits:
        kind = next((options for options in ranked if word in options), ())
        rest = [one for options in ranked for one in options if not any(set(options) & {t} for t in character.traits)]
        told += [one for one in (word, *kind, *rest) if one not in told and agrees(one, measures)][:1]
    return character.model_copy(update={"traits": told})


def join(parts: Sequence[str]) -> str:
    """Join words with commas and a final "and"."""
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"
