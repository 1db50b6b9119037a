"""Lives in a few sentences, from facts that the rest of the community agrees with."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vico.community.ground import GUEST_KINDS, Ground, kind_of
from vico.community.groups import Meeting
from vico.community.jobs import FREELANCE, GUESTS, RETIRED
from vico.community.people import Household, Sketch
from vico.community.relations import describe_household
from vico.community.tastes import VALUES
from vico.world.model import Place

_SAYS = {v.name: v.says for v in VALUES}

_LINKS = (
    "Friends call {her} {traits}; {she} {says}.",
    "{Traits}, {she} {says}.",
    "Those who know {him} call {him} {traits}, and add that {she} {says}.",
    "By nature {traits}, {she} {says}.",
    "People tend to find {him} {traits}, and {first} {says}.",
    "Neighbours describe {him} as {traits}; {she} {says}.",
)
_GROUPS = (
    "{When} {she} meets the {group} at {place}.",
    "{She} rarely misses the {group} at {place}.",
    "{She} has been with the {group} at {place} from the start.",
    "The {group} at {place} is a fixed point of {her} week.",
    "{She} joined the {group} at {place} on a friend's dare and stayed.",
    "A poster at {place} brought {him} to the {group}.",
    "When the {group} gathers at {place}, {she} is there.",
    "{She} found {her} way into this quarter through the {group} at {place}.",
    "{Her} chair at the {group} in {place} is never empty for long.",
)
_HOBBIES = (
    "{She} likes {hobbies}.",
    "Free hours go to {hobbies}.",
    "What is left of the day belongs to {hobbies}.",
    "Ask {him} about {hobbies}, and bring time.",
    "On days off it is {hobbies}.",
    "{Her} evenings are for {hobbies}.",
)


class Biographer:
    """Writes biographies; turns of phrase repeat as late as they can.

    Parameters
    ----------
    rng
        Decides the turns of phrase.
    """

    def __init__(self, rng: np.random.Generator, ground: Ground) -> None:
        self._rng = rng
        self._ground = ground
        self._decks: dict[tuple[str, ...], list[str]] = {}
        self._told: set[str] = set()

    def _turn(self, phrases: tuple[str, ...]) -> str:
        deck = self._decks.setdefault(phrases, [])
        if not deck:
            deck.extend(phrases[int(k)] for k in self._rng.permutation(len(phrases)))
        return deck.pop()

    def _name(self, place: str | None) -> str:
        assert place is not None
        return self._ground.place_by_id[place].name

    def write(self, sketch: Sketch, household: Household, groups: Sequence[Meeting]) -> str:
        """Write three to five sentences about somebody."""
        him = "her" if sketch.gender == "female" else "him"
        words = {
            "first": sketch.first,
            "she": sketch.she,
            "She": sketch.she.capitalize(),
            "her": sketch.her,
            "Her": sketch.her.capitalize(),
            "him": him,
        }
        traits = join(sketch.character.traits)
        hobbies = join([h.name for h in sketch.hobbies])
        sentences = [self._work(sketch), self._home(sketch, household, words)]
        link = self._turn(_LINKS).replace("call {her}", "call {him}")
        sentences.append(
            link.format(**words, traits=traits, Traits=traits.capitalize(), says=self._turn(_SAYS[sketch.values[0]]))
        )
        if groups:
            group = groups[0]
            when = {"morning": "In the morning", "lunch": "At noon", "afternoon": "In the afternoon"}.get(
                group.slot, "In the evening"
            )
            name = group.circle.name
            told = ""
            # The deck comes round again with many people: never the same words about the same group.
            for _ in range(2 * len(_GROUPS)):
                told = self._turn(_GROUPS).format(
                    **words, group=name[0].lower() + name[1:], place=group.place.name, When=when
                )
                if told not in self._told:
                    break
            self._told.add(told)
            sentences.append(told)
        sentences.append(self._turn(_HOBBIES).format(**words, hobbies=hobbies))
        return " ".join(sentences)

    def _work(self, sketch: Sketch) -> str:
        name, she = f"{sketch.first} {sketch.last}", sketch.she
        if sketch.status == "worker":
            assert sketch.job is not None
            first = self._turn(
                (
                    "{name}, {age}, is {job} at {place}; {she} {root}.",
                    "{name} ({age}) works as {job} at {place} and {root}.",
                    "At {age}, {name} is {job} at {place}, and {root}.",
                )
            )
            return first.format(
                name=name, age=sketch.age, job=with_article(sketch.occupation), place=self._name(sketch.workplace),
                she=she, root=sketch.job.root,
            )  # fmt: skip
        if sketch.status == "student":
            first = self._turn(
                (
                    "{name}, {age}, studies {subject} at {place}.",
                    "{name} is {age} and reads {subject} at {place}.",
                    "{name}, a {age}-year-old student of {subject}, spends most weekdays at {place}.",
                )
            ).replace("a 18", "an 18")
            return first.format(name=name, age=sketch.age, subject=sketch.subject, place=self._name(sketch.workplace))
        if sketch.status == "retired":
            told = next(text for title, text in RETIRED if title == sketch.subject)
            return f"{name}, {sketch.age}, a {sketch.occupation}, {told}."
        if sketch.status == "freelancer":
            told = next(f[3] for f in FREELANCE if f[0] == sketch.occupation)
            return f"{name}, {sketch.age}, works from home as {with_article(sketch.occupation)} and {told}."
        told = next(g[1] for g in GUESTS if g[0] == sketch.occupation)
        return f"{name}, {sketch.age}, is {with_article(sketch.occupation)} who {told}."

    def _home(self, sketch: Sketch, household: Household, words: dict[str, str]) -> str:
        place = self._ground.place_by_id[sketch.home]
        where = address(place)
        company = describe_household(household, sketch, {"mates": "flatmates"})
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
        return self._turn(phrases).format(**words, home=where)


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


def lifestyle_of(rng: np.random.Generator, sketch: Sketch) -> str:
    """How somebody lives, in a sentence."""
    rhythm = "Early riser" if sketch.early > 0.68 else "Night owl" if sketch.early < 0.36 else "Keeps regular hours"
    if sketch.shift and sketch.shift[0] >= 12 * 60:
        rhythm = "Works late and sleeps in"
    ways = []
    if any(h.active for h in sketch.hobbies):
        ways.append("stays fit")
    if "hedonism" in sketch.values:
        ways.append("eats out with pleasure")
    elif any(h.name in ("cooking", "baking bread") for h in sketch.hobbies):
        ways.append("cooks from scratch")
    if "security" in sketch.values:
        ways.append("spends carefully")
    if "universalism" in sketch.values:
        ways.append(str(rng.choice(["buys second-hand", "eats little meat", "mends rather than replaces"])))
    if sketch.character.extraversion > 0.66:
        ways.append("is seldom alone")
    elif sketch.character.extraversion < 0.42:
        ways.append("needs an hour alone every day")
    spare = ["walks everywhere", "likes a tidy flat" if sketch.status != "guest" else "travels light", 
             "reads the news on paper",
             "goes by bus when it rains", "drinks a lot of coffee", "keeps the phone in another room"]  # fmt: skip
    for k in rng.permutation(len(spare)):
        if len(ways) >= 2:
            break
        ways.append(spare[int(k)])
    return f"{rhythm}; {join(ways[:3])}."


def join(parts: Sequence[str]) -> str:
    """Join words with commas and a final "and"."""
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def with_article(noun: str) -> str:
    """Put "a" or "an" before a noun."""
    an = noun[0].lower() in "aeio" or (noun[0] == "u" and not noun.startswith("uni"))
    return f"{'an' if an else 'a'} {noun}"
