"""Who there is: households, ages, characters and looks, before anybody has a home or a job."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from pydantic import TypeAdapter

from vico.community.catalogue import Hobby, Job, basic_values, hobbies, trait_words
from vico.community.model import Colour, Personality, ResidentAppearance
from vico.community.names import NameBook


@dataclass
class ResidentDraft:
    """A resident in the making.

    Attributes
    ----------
    status
        worker, freelancer, student, retired or guest.
    household
        Index of their household.
    job
        Their trade, for those who work at a place.
    occupation
        Title, as it is written.
    subject
        What a student studies; what a retired person, a freelancer or a guest is known for.
    shift
        Working hours of the day, seconds; None for those who have none.
    """

    id: str
    gender: str
    age: int
    status: str
    household: int
    first: str = ""
    last: str = ""
    personality: Personality | None = None
    values: list[str] = field(default_factory=list)
    hobbies: list[Hobby] = field(default_factory=list)
    early: float = 0.5
    job: Job | None = None
    occupation: str = ""
    subject: str = ""
    home: str = ""
    workplace: str | None = None
    shift: tuple[int, int] | None = None

    @property
    def character(self) -> Personality:
        """Their personality, once drawn."""
        assert self.personality is not None
        return self.personality

    @property
    def she(self) -> str:
        """She or he."""
        return "she" if self.gender == "female" else "he"

    @property
    def her(self) -> str:
        """Possessive: her or his."""
        return "her" if self.gender == "female" else "his"


@dataclass
class Household:
    """People who share a home, and what they are to each other."""

    kind: str
    members: list[ResidentDraft]
    home: str = ""


# Kind, weight, and the status of each member; w worker, f freelancer, s student, r retired, g guest.
_HOUSEHOLDS: tuple[tuple[str, float, str], ...] = (
    ("single", 4.0, "w"),
    ("single", 1.3, "f"),
    ("single", 1.2, "r"),
    ("single", 0.6, "s"),
    ("couple", 1.9, "ww"),
    ("couple", 1.3, "wf"),
    ("couple", 1.1, "rr"),
    ("couple", 0.3, "wr"),
    ("flatmates", 1.0, "ss"),
    ("flatmates", 0.6, "ssw"),
    ("flatmates", 1.0, "ww"),
    ("parent", 0.9, "ws"),
    ("parent", 0.3, "ww"),
    ("siblings", 0.7, "ww"),
    ("guest", 1.0, "g"),
)
_STATUS = {"w": "worker", "f": "freelancer", "s": "student", "r": "retired", "g": "guest"}
_SHARES = {"w": 0.56, "f": 0.12, "s": 0.13, "r": 0.14, "g": 0.05}


def draw_households(
    rng: np.random.Generator, count: int, *, students: bool, guests: bool, workers: bool
) -> list[Household]:
    """Draw households for `count` people whose ways of life come in believable shares.

    Parameters
    ----------
    students, guests, workers
        Whether the world has somewhere to study, to stay for a while, and to work.
    """
    shares = dict(_SHARES)
    for letter, possible in (("s", students), ("g", guests), ("w", workers)):
        if not possible:
            shares[letter] = 0.0
    total = sum(shares.values())
    quota = {k: v / total * count for k, v in shares.items()}
    found: list[Household] = []
    people = 0
    while people < count:
        weights = np.zeros(len(_HOUSEHOLDS))
        for k, (_, weight, members) in enumerate(_HOUSEHOLDS):
            if people + len(members) > count or any(shares[m] == 0 for m in members):
                continue
            room = min(quota[m] - (members.count(m) - 1) for m in members)
            weights[k] = weight * (max(room, 0.02) if room < 1 else room**0.5)
        choice = int(rng.choice(len(_HOUSEHOLDS), p=weights / weights.sum()))
        kind, _, members = _HOUSEHOLDS[choice]
        drafts = _members(rng, kind, members, len(found), people)
        for m in members:
            quota[m] -= 1
        people += len(members)
        found.append(Household(kind, drafts))
    _name(rng, found)
    return found


def _age(rng: np.random.Generator, status: str, kind: str) -> int:
    spans = {
        "worker": (22, 34, 64),
        "freelancer": (25, 36, 62),
        "student": (18, 21, 27),
        "retired": (64, 70, 85),
        "guest": (26, 40, 60),
    }
    low, mode, high = (23, 27, 34) if kind == "flatmates" and status == "worker" else spans[status]
    return round(float(rng.triangular(low, mode, high)))


def _members(rng: np.random.Generator, kind: str, members: str, household: int, first: int) -> list[ResidentDraft]:
    statuses = [_STATUS[m] for m in members]
    ages = [_age(rng, status, kind) for status in statuses]
    genders = [("female", "male")[int(rng.integers(2))] for _ in members]
    if kind == "couple":
        low, high = (63, 85) if statuses[1] == "retired" else (22, 64)
        if statuses == ["worker", "retired"]:
            ages[0], low = int(rng.integers(57, 65)), 63
        ages[1] = int(np.clip(ages[0] + round(float(rng.normal(0, 3))), low, high))
        if rng.random() < 0.85:
            genders[1] = "male" if genders[0] == "female" else "female"
    elif kind == "parent":
        child = int(rng.integers(18, 25)) if statuses[1] == "student" else int(rng.integers(21, 27))
        ages = [child + int(rng.integers(24, 36)), child]
    elif kind == "siblings":
        ages[0] = int(rng.integers(23, 45))
        ages[1] = ages[0] + int(rng.integers(2, 6))
    elif kind == "flatmates" and "student" in statuses:
        ages = [int(rng.integers(19, 26)) if s == "student" else int(rng.integers(22, 28)) for s in statuses]
    return [
        ResidentDraft(f"resident_{first + k}", gender, age, status, household)
        for k, (gender, age, status) in enumerate(zip(genders, ages, statuses, strict=True))
    ]


def _name(rng: np.random.Generator, households: Sequence[Household]) -> None:
    book = NameBook(rng)
    for household in households:
        family = book.family()
        shared = household.kind in ("parent", "siblings") or (household.kind == "couple" and rng.random() < 0.5)
        for k, draft in enumerate(household.members):
            full = book.full(draft.gender, family if shared or k == 0 else book.family())
            draft.first, draft.last = full.split(" ", 1)


def draw_character(rng: np.random.Generator, draft: ResidentDraft, uses: dict[str, int]) -> None:
    """Give somebody a personality, values and hobbies that go together.

    Parameters
    ----------
    uses
        How often each hobby has been given so far; common ones become less likely. Updated.
    """
    five = np.clip(rng.normal(0.55, 0.19, 5), 0.05, 0.95)
    names = ("openness", "conscientiousness", "extraversion", "agreeableness", "neuroticism")
    diligent, nervous = names.index("conscientiousness"), names.index("neuroticism")
    five[diligent] = min(0.95, five[diligent] + (0.08 if draft.age > 45 else 0.0))
    five[nervous] = max(0.05, five[nervous] - 0.1)
    scores = {name: round(float(v), 2) for name, v in zip(names, five, strict=True)}
    # The words for the two or three traits that stand out most from the middle.
    order = sorted(names, key=lambda name: (-abs(scores[name] - 0.5), name))
    traits = []
    for name in order[: 2 + int(rng.integers(2))]:
        words = trait_words()[name].high if scores[name] >= 0.5 else trait_words()[name].low
        traits.append(words[int(rng.integers(len(words)))])
    draft.personality = Personality(**scores, traits=traits)
    values, pastimes = basic_values(), hobbies()
    weights = np.array(
        [max(0.15, 0.5 + sum(w * (scores[t] - 0.5) * 3 for t, w in value.leans.items())) for value in values]
    )
    picks = rng.choice(len(values), 3, replace=False, p=weights / weights.sum())
    draft.values = [values[int(k)].name for k in picks]
    low_age, high_age = np.array([h.ages for h in pastimes]).T
    fits = np.array([h.weight for h in pastimes]) * (low_age <= draft.age) * (draft.age <= high_age)
    for k, hobby in enumerate(pastimes):
        fits[k] *= 0.35 ** uses.get(hobby.name, 0)
        fits[k] *= max(0.1, 1 + sum((scores[t] - 0.5) * 2.5 for t in hobby.traits))
        fits[k] *= 1.8 if set(hobby.values) & set(draft.values) else 1.0
    picks = rng.choice(len(pastimes), 2 + int(rng.random() < 0.55), replace=False, p=fits / fits.sum())
    draft.hobbies = [pastimes[int(k)] for k in picks]
    for hobby in draft.hobbies:
        uses[hobby.name] = uses.get(hobby.name, 0) + 1
    lark = 0.35 + 0.4 * (scores["conscientiousness"] - 0.5) + (draft.age - 40) / 90
    draft.early = float(np.clip(rng.normal(lark + 0.15, 0.18), 0, 1))


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
_DARK: tuple[Colour, ...] = ((44, 48, 60), (60, 58, 56), (36, 44, 66), (74, 66, 56), (52, 56, 50))
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
_LOOKS = TypeAdapter(ResidentAppearance)
_FORMAL = {
    "lawyer",
    "consular officer",
    "bank adviser",
    "visiting consultant",
    "travelling sales representative",
    "croupier",
}


class Wardrobe:
    """Gives people their looks; clothes' colours repeat as late as they can, so that people are told apart."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._tops: list[Colour] = []

    def _pick(self, options: Sequence[str], weights: Sequence[float]) -> str:
        w = np.asarray(weights, float)
        return options[int(self._rng.choice(len(options), p=w / w.sum()))]

    def _colour(self, options: Sequence[Colour]) -> Colour:
        return options[int(self._rng.integers(len(options)))]

    def look_of(self, draft: ResidentDraft, like: ResidentAppearance | None = None) -> ResidentAppearance:
        """Draw the looks of somebody.

        Parameters
        ----------
        like
            A blood relative, whose features they share.
        """
        rng, female, age = self._rng, draft.gender == "female", draft.age
        kind = int(rng.choice(len(_ANCESTRY), p=[a[0] for a in _ANCESTRY]))
        _, ancestry, skins = _ANCESTRY[kind]
        skin = self._colour(skins)
        hair_colour = self._colour(_HAIR["light" if kind == 0 else "dark"])
        if like is not None:
            ancestry, skin, hair_colour = like["ancestry"], like["skin"], like["hair_colour"]
        if rng.random() < np.clip((age - 44) / 22, 0, 0.95):
            hair_colour = self._colour(_HAIR["grey"])
        elif like is not None and min(like["hair_colour"]) > 130:
            hair_colour = self._colour(_HAIR["light" if ancestry[2] > 0.9 else "dark"])
        if female:
            styles, weights = ["short", "curly", "bob", "long", "ponytail", "bun"], [1, 1.2, 1.6, 2, 1.6, 1.2]
            if age > 58:
                weights = [2.2, 1.5, 2, 0.5, 0.4, 1.4]
        else:
            styles, weights = ["bald", "crop", "short", "curly", "bun"], [0.3, 1.5, 3, 1, 0.2 if age < 45 else 0]
            if age > 50:
                weights[0] = 1.6
        mean = (1.655 if female else 1.79) - max(0, age - 60) * 0.001
        if not self._tops:
            self._tops = [_TOP_COLOURS[int(k)] for k in rng.permutation(len(_TOP_COLOURS))]
        colour = self._tops.pop()
        formal = draft.occupation in _FORMAL
        if formal:
            top, under = self._pick(["suit", "jacket"], [3, 1]), colour
            colour, bottom_colour = self._colour(_DARK), (44, 46, 52)
            bottom = "skirt" if female and rng.random() < 0.4 else "trousers"
            shoes, shoe = "shoes", (36, 34, 34)
        else:
            under = self._colour(((236, 232, 222), (208, 206, 200), (60, 62, 68)))
            young = age < 32
            top = self._pick(
                ["t-shirt", "shirt", "jumper", "hoodie", "jacket", "coat", "dress"],
                [1.6 if young else 0.7, 1.4, 1.5, 1.6 if young else 0.2, 1.4, 0.6 if young else 1.2, 1.2 * female],
            )
            bottom = self._pick(
                ["trousers", "jeans", "shorts", "skirt", "leggings"],
                [1.5 if age > 40 else 0.8, 1.8, 0.15 if young else 0.0, 0.7 * female, 0.5 * female * young],
            )
            bottom_colour = self._colour(_BOTTOM_COLOURS)
            if top == "dress":
                bottom = "leggings"
            shoes = self._pick(["trainers", "shoes", "boots", "sandals"], [2 if age < 45 else 0.9, 1.4, 1, 0.15])
            shoe = self._colour(_SHOE_COLOURS)
        fitness = 0.15 if any(h.active for h in draft.hobbies) else 0.0
        return _LOOKS.validate_python(
            dict(  # noqa: C408 (reads better than quoted keys)
                gender=0.0 if female else 1.0,
                age=float(age),
                height=round(float(np.clip(rng.normal(mean, 0.065), 1.48, 2.02)), 3),
                build=round(float(np.clip(rng.normal(0.42 + age / 400 - fitness, 0.16), 0.05, 0.95)), 2),
                muscle=round(float(np.clip(rng.normal(0.45 + fitness - max(0, age - 60) / 120, 0.14), 0.1, 0.9)), 2),
                ancestry=ancestry,
                skin=skin,
                hair=self._pick(styles, weights),
                hair_colour=hair_colour,
                eyes=self._colour(
                    ((84, 62, 44), (62, 44, 32)) if ancestry[2] < 0.9 else ((84, 62, 44), (96, 122, 140), (92, 110, 80))
                ),
                beard=bool(not female and rng.random() < 0.35),
                glasses=bool(rng.random() < 0.15 + age / 250),
                top=top,
                top_colour=colour,
                under_colour=under,
                bottom=bottom,
                bottom_colour=bottom_colour,
                shoes=shoes,
                shoes_colour=shoe,
            )
        )
