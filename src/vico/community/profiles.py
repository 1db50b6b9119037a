"""Profiles of residents: their lives in a few sentences, and how they look.

Sentences are made from facts that the rest of the community agrees with. Bodies follow age and family, clothes age,
taste and trade; no two residents look alike. Clothes of trades are read from ``vico/data/community/clothes.toml`` and
files ``clothes*.toml`` of a user's own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from vico.clock import seconds_of_day
from vico.community.catalogue import Way, basic_values, biography_sentences, trait_words, ways, ways_of_life
from vico.community.day import DayMeasures, agrees
from vico.community.groups import Meeting
from vico.community.model import (
    Bag,
    Bottom,
    Colour,
    Hat,
    ItemType,
    Over,
    Personality,
    ResidentAppearance,
    ScheduleItem,
    Shoes,
    Top,
)
from vico.community.people import Household, ResidentDraft, childhood, schools
from vico.community.place_index import GUEST_KINDS, PlaceIndex, kind_of
from vico.community.relations import describe_household
from vico.english import enumerate_words, with_article
from vico.errors import SchemaError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record
from vico.world.model import Place

# Seconds of the day.
_EARLY_RISE = 6 * 3600 + 1800
_LATE_RISE = 8 * 3600
_LATE_TO_BED = 23 * 3600


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
        traits = enumerate_words(draft.character.traits)
        hobbies = enumerate_words([h.name for h in draft.hobbies])
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
    """Return an address as one says it: "at Mikonkatu 3", "in the apartments on Unioninkatu", "at Hotel Torni"."""
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
        return f"{rhythm}; {enumerate_words([told[int(k)] for k in rng.choice(len(told), 2, replace=False)])}."
    options = [way for way in ways() if draft.status in way.statuses and agrees(way.text, measures)]
    first = [way.text for way in options if _is_told_of(way, draft)]
    anybody = [way.text for way in options if not (way.values or way.hobbies or way.trait)]
    spare = [anybody[int(k)] for k in rng.permutation(len(anybody))]
    picked = [first[int(k)] for k in rng.permutation(len(first))][:3]
    return f"{rhythm}; {enumerate_words([*picked, *spare[: max(0, 2 - len(picked))]])}."


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


Rgb = tuple[int, int, int]
Colours = tuple[Rgb, ...]
_GUIDE = "docs/adding_people.md"


class TradeClothes(DataRecord):
    """Clothes of some trades, as the fields of an appearance; of several values one is drawn.

    Attributes
    ----------
    trades
        Occupations, or their beginnings or ends: ``student`` is also a student of law.
    """

    trades: tuple[str, ...]
    top: tuple[Top, ...] = ()
    top_colour: Colours | str = ()
    under_colour: Colours | str = ()
    bottom: tuple[Bottom, ...] = ()
    bottom_colour: Colours | str = ()
    shoes: tuple[Shoes, ...] = ()
    shoes_colour: Colours | str = ()
    hat: Hat = "none"
    hat_colour: Colours | str = ()
    over: Over = "none"
    over_colour: Colours | str = ()
    bag: Bag = "none"
    bag_colour: Colours | str = ()

    def colours(self, field: str) -> Colours:
        """Return the colours of a field; none where it is as they like."""
        found = getattr(self, field)
        assert not isinstance(found, str)
        return tuple(found)


class _File(DataRecord):
    colours: Mapping[str, Colours] = {}
    clothes: tuple[TradeClothes, ...] = ()


@cached_data
def trade_clothes() -> tuple[TradeClothes, ...]:
    """Return the clothes of trades, in the order of the files.

    Raises
    ------
    SchemaError
        If a colour is no sRGB, or names a set that is not there.
    """
    named: dict[str, Colours] = {}
    found = []
    for path in data_files("community", "clothes"):
        file = read_record(path, _File, guide=_GUIDE)
        named |= file.colours
        found += [_with_colours(path, entry, named) for entry in file.clothes]
    return tuple(found)


def clothes_of(occupation: str) -> TradeClothes | None:
    """Return what is worn at an occupation; None where everybody dresses as they like. The last entry counts."""
    words = occupation.lower()
    if words.startswith(("retired ", "former ")):
        return None
    fitting = [
        entry
        for entry in trade_clothes()
        if any(words == t or words.endswith(f" {t}") or words.startswith(f"{t} of ") for t in entry.trades)
    ]
    return fitting[-1] if fitting else None


def _with_colours(path: Path, entry: TradeClothes, named: Mapping[str, Colours]) -> TradeClothes:
    """Put colours in the place of the names of sets ("@navy")."""
    found: dict[str, Any] = {}
    for field in TradeClothes.model_fields:
        if not field.endswith("_colour"):
            continue
        value = getattr(entry, field)
        if isinstance(value, str):
            if not value.startswith("@") or value[1:] not in named:
                known = ", ".join(f"@{name}" for name in named) or "none"
                raise SchemaError(f"{path}: {field}: no set of colours is called {value!r}; there are {known}")
            value = named[value[1:]]
        if any(not 0 <= channel <= 255 for colour in value for channel in colour):
            raise SchemaError(f"{path}: {field} of {entry.trades[0]}: channels are 0..255")
        found[field] = value
    return entry.model_copy(update=found)


# Skin, and the weights of African, Asian and European features that go with it.
_ANCESTRY: tuple[tuple[float, tuple[float, float, float], tuple[Colour, ...]], ...] = (
    (0.50, (0.0, 0.05, 0.95), ((240, 205, 182), (231, 190, 164), (224, 172, 141), (214, 164, 134))),
    (0.16, (0.05, 0.9, 0.05), ((232, 190, 154), (222, 178, 138), (206, 158, 118))),
    (0.18, (0.9, 0.05, 0.05), ((122, 82, 58), (98, 64, 44), (80, 52, 38), (146, 102, 74))),
    (0.16, (0.3, 0.35, 0.35), ((188, 138, 102), (168, 118, 86), (198, 150, 116))),
)
_HAIR = {
    "light": ((200, 168, 112), (168, 128, 80), (120, 84, 54), (86, 60, 42), (60, 42, 32), (150, 82, 48), (38, 30, 26)),
    "dark": ((28, 22, 20), (38, 28, 24), (50, 36, 28)),
    "grey": ((176, 174, 170), (200, 198, 194), (142, 140, 138)),
}
_TOP_COLOURS: tuple[Colour, ...] = (
    (178, 58, 52), (44, 92, 148), (218, 170, 58), (70, 124, 90), (128, 82, 140), (222, 126, 70), (62, 140, 150),
    (236, 232, 222), (58, 62, 74), (196, 112, 132), (108, 132, 66), (142, 172, 204), (120, 74, 52), (196, 180, 146),
    (30, 58, 82), (152, 40, 72), (90, 156, 120), (236, 200, 150), (84, 90, 160), (110, 110, 106),
)  # fmt: skip
_BOTTOM_COLOURS: tuple[Colour, ...] = (
    (52, 64, 92),
    (44, 46, 52),
    (98, 84, 66),
    (70, 78, 88),
    (36, 40, 58),
    (126, 112, 90),
)
_SHOE_COLOURS: tuple[Colour, ...] = (
    (60, 60, 64),
    (238, 236, 232),
    (92, 60, 40),
    (36, 34, 34),
    (150, 54, 48),
    (70, 84, 110),
)
# Statures by age, metres: medians of boys and girls (WHO growth reference 2007, rounded) and their spread.
_YEARS = (5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18)
_BOYS = (1.10, 1.16, 1.22, 1.275, 1.33, 1.38, 1.43, 1.49, 1.56, 1.635, 1.69, 1.735, 1.76, 1.79)
_GIRLS = (1.09, 1.15, 1.21, 1.27, 1.33, 1.385, 1.445, 1.51, 1.57, 1.605, 1.625, 1.64, 1.65, 1.655)
_SHRINK_FROM = 60  # age in years after which people grow smaller
_SHRINK = 0.0013  # metres a year


def stature(age: float, *, female: bool) -> tuple[float, float]:
    """Return the mean height of people of an age and its standard deviation, metres."""
    mean = float(np.interp(age, _YEARS, _GIRLS if female else _BOYS))
    return mean - _SHRINK * max(0.0, age - _SHRINK_FROM), float(np.interp(age, (5, 13, 18), (0.047, 0.07, 0.065)))


_LOOKS = TypeAdapter(ResidentAppearance)
# Clothes of children are brighter, and some old people wear a hat.
_BRIGHT = 1.18
_HATTED = 0.22


class Wardrobe:
    """Gives people their looks; clothes' colours repeat as late as they can, so that people are told apart.

    Parameters
    ----------
    rng
        Decides what is left open.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._tops: list[Colour] = []

    def look_of(self, draft: ResidentDraft, family: Sequence[ResidentAppearance] = ()) -> ResidentAppearance:
        """Draw the looks of somebody.

        Parameters
        ----------
        family
            Parents, or a blood relative, whose features they share.
        """
        return _LOOKS.validate_python(self._body(draft, family) | self._clothes(draft))

    def _pick(self, options: Sequence[str], weights: Sequence[float]) -> str:
        w = np.asarray(weights, float)
        return options[int(self._rng.choice(len(options), p=w / w.sum()))]

    def _one(self, options: Sequence[Any]) -> Any:
        return options[int(self._rng.integers(len(options)))]

    def _colour(self, options: Sequence[Colour], spread: float = 7.0) -> Colour:
        """Return a colour near one of some: nobody's is quite another's."""
        colour = np.asarray(self._one(options), float)
        shade = colour + self._rng.normal(0.0, spread) + self._rng.normal(0.0, 0.4 * spread, 3)
        red, green, blue = np.clip(np.rint(shade), 0, 255).astype(int).tolist()
        return red, green, blue

    def _body(self, draft: ResidentDraft, family: Sequence[ResidentAppearance]) -> dict[str, Any]:
        rng, female, age = self._rng, draft.gender == "female", draft.age
        kind = int(rng.choice(len(_ANCESTRY), p=[a[0] for a in _ANCESTRY]))
        _, ancestry, skins = _ANCESTRY[kind]
        skin, hair_colour = self._colour(skins, 4.0), self._colour(_HAIR["light" if kind == 0 else "dark"], 5.0)
        if family:
            # A child of two takes after both.
            ancestry = tuple(np.mean([one["ancestry"] for one in family], axis=0).round(3).tolist())
            red, green, blue = np.mean([one["skin"] for one in family], axis=0).astype(int).tolist()
            skin = self._colour([(red, green, blue)], 3.0)
            hair_colour = self._colour([self._one(family)["hair_colour"]], 4.0)
            if min(hair_colour) > 130 and age < 55:  # a parent's is grey already
                hair_colour = self._colour(_HAIR["light" if ancestry[2] > 0.8 else "dark"], 5.0)
        light = ancestry[2] > 0.8
        if rng.random() < np.clip((age - 44) / 22, 0, 0.97):
            hair_colour = self._colour(_HAIR["grey"], 7.0)
        mean, spread = stature(age, female=female)
        fitness = 0.15 if any(h.active for h in draft.hobbies) else 0.0
        return {
            "gender": 0.0 if female else 1.0,
            "age": float(age),
            "height": round(float(np.clip(rng.normal(mean, spread), mean - 2.5 * spread, mean + 2.5 * spread)), 3),
            "build": round(float(np.clip(rng.normal(0.42 + max(age, 18) / 400 - fitness, 0.16), 0.05, 0.95)), 2),
            "muscle": round(float(np.clip(rng.normal(0.45 + fitness - max(0, age - 60) / 120, 0.14), 0.1, 0.9)), 2),
            "ancestry": ancestry,
            "skin": skin,
            "hair": self._hair(age, female=female),
            "hair_colour": hair_colour,
            "eyes": self._colour(
                ((84, 62, 44), (96, 122, 140), (92, 110, 80)) if light else ((84, 62, 44), (62, 44, 32)), 4.0
            ),
            "beard": bool(not female and age >= 20 and rng.random() < 0.35),
            "glasses": bool(rng.random() < (0.10 if draft.child else 0.15 + age / 250)),
        }

    def _hair(self, age: int, *, female: bool) -> str:
        if female:
            styles, weights = ["short", "curly", "bob", "long", "ponytail", "bun"], [1, 1.2, 1.6, 2, 1.6, 1.2]
            if age > 58:
                weights = [2.2, 1.5, 2, 0.5, 0.4, 1.4]
            elif age < 12:
                weights = [0.5, 0.8, 1.4, 2.2, 2.4, 0.3]
        else:
            styles, weights = ["bald", "crop", "short", "curly", "bun", "bob"], [0.3, 1.5, 3, 1, 0.2, 0]
            if age > 50:
                weights = [1.6, 1.5, 3, 1, 0, 0]
            elif age < 18:
                weights = [0, 1.2, 3, 1.2, 0, 0.3]
        return self._pick(styles, weights)

    def _top_colour(self) -> Colour:
        if not self._tops:
            self._tops = [_TOP_COLOURS[int(k)] for k in self._rng.permutation(len(_TOP_COLOURS))]
        return self._tops.pop()

    def _clothes(self, draft: ResidentDraft) -> dict[str, Any]:
        """Draw what somebody likes to wear, then what their trade asks for."""
        rng, female, age = self._rng, draft.gender == "female", draft.age
        young = age < 32
        top = self._pick(
            ["t-shirt", "shirt", "jumper", "hoodie", "jacket", "coat", "dress"],
            [1.6 if young else 0.7, 0.5 if draft.child else 1.4, 1.5, 1.6 if young else 0.2, 1.4,
             0.2 if draft.child else 0.6 if young else 1.2, 1.2 * female],
        )  # fmt: skip
        bottom = self._pick(
            ["trousers", "jeans", "shorts", "skirt", "leggings"],
            [1.5 if age > 40 else 0.8, 1.8, 0.9 if age < 13 else 0.15 * young, 0.7 * female, 0.5 * female * young],
        )
        shoes = self._pick(["trainers", "shoes", "boots", "sandals"], [2 if age < 45 else 0.9, 1.4, 1, 0.15])
        colour = self._colour([self._top_colour()])
        if draft.child:
            red, green, blue = (min(255, int(channel * _BRIGHT)) for channel in colour)
            colour = red, green, blue
        found: dict[str, Any] = {
            "top": top,
            "top_colour": colour,
            "under_colour": self._colour(((236, 232, 222), (208, 206, 200), (60, 62, 68))),
            "bottom": "leggings" if top == "dress" else bottom,
            "bottom_colour": self._colour(_BOTTOM_COLOURS),
            "shoes": shoes,
            "shoes_colour": self._colour(_SHOE_COLOURS, 5.0),
        }
        if age >= 60 and rng.random() < _HATTED:
            found |= {"hat": "sun hat" if female else "cap", "hat_colour": self._colour(_BOTTOM_COLOURS)}
        trade = clothes_of(draft.occupation)
        if trade is not None:
            found |= self._for_trade(trade)
            # Skirts are what women choose, and go with a suit or a jacket.
            if found["bottom"] == "skirt" and not female:
                found["bottom"] = "trousers"
            if found["top"] == "suit":
                found["bottom_colour"] = found["top_colour"]
        return found

    def _for_trade(self, trade: TradeClothes) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for field in ("top", "bottom", "shoes"):
            if options := getattr(trade, field):
                found[field] = self._one(options)
        for field in ("hat", "over", "bag"):
            if getattr(trade, field) != "none":
                found[field] = getattr(trade, field)
        for field in ("top", "under", "bottom", "shoes", "hat", "over", "bag"):
            if options := trade.colours(f"{field}_colour"):
                found[f"{field}_colour"] = self._colour(options, 4.0)
        return found
