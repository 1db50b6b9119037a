"""How residents look: bodies by age and family, clothes by age and trade."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydantic import TypeAdapter

from vico.community.model import Colour, ResidentAppearance
from vico.community.people import ResidentDraft

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


# Statures by age, metres: medians of boys and girls (WHO growth reference 2007, rounded) and their spread.
_YEARS = (5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18)
_BOYS = (1.10, 1.16, 1.22, 1.275, 1.33, 1.38, 1.43, 1.49, 1.56, 1.635, 1.69, 1.735, 1.76, 1.79)
_GIRLS = (1.09, 1.15, 1.21, 1.27, 1.33, 1.385, 1.445, 1.51, 1.57, 1.605, 1.625, 1.64, 1.65, 1.655)
# After this age people grow smaller by so many metres a year.
_SHRINK_FROM, _SHRINK = 60, 0.0013


def stature(age: float, *, female: bool) -> tuple[float, float]:
    """Return the mean height of people of an age and its standard deviation, metres."""
    mean = float(np.interp(age, _YEARS, _GIRLS if female else _BOYS))
    return mean - _SHRINK * max(0.0, age - _SHRINK_FROM), float(np.interp(age, (5, 13, 18), (0.047, 0.07, 0.065)))


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

    def look_of(self, draft: ResidentDraft, family: Sequence[ResidentAppearance] = ()) -> ResidentAppearance:
        """Draw the looks of somebody.

        Parameters
        ----------
        family
            Parents, or a blood relative, whose features they share.
        """
        like = family[int(self._rng.integers(len(family)))] if family else None
        rng, female, age = self._rng, draft.gender == "female", draft.age
        kind = int(rng.choice(len(_ANCESTRY), p=[a[0] for a in _ANCESTRY]))
        _, ancestry, skins = _ANCESTRY[kind]
        skin = self._colour(skins)
        hair_colour = self._colour(_HAIR["light" if kind == 0 else "dark"])
        if like is not None:
            ancestry, skin, hair_colour = like["ancestry"], like["skin"], like["hair_colour"]
        if rng.random() < np.clip((age - 44) / 22, 0, 0.95):
            hair_colour = self._colour(_HAIR["grey"])
        elif like is not None and min(like["hair_colour"]) > 130 and draft.age < 60:
            hair_colour = self._colour(_HAIR["light" if ancestry[2] > 0.9 else "dark"])
        if female:
            styles, weights = ["short", "curly", "bob", "long", "ponytail", "bun"], [1, 1.2, 1.6, 2, 1.6, 1.2]
            if age > 58:
                weights = [2.2, 1.5, 2, 0.5, 0.4, 1.4]
        else:
            styles, weights = ["bald", "crop", "short", "curly", "bun"], [0.3, 1.5, 3, 1, 0.2 if age < 45 else 0]
            if age > 50:
                weights[0] = 1.6
        mean, spread = stature(age, female=female)
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
                height=round(float(np.clip(rng.normal(mean, spread), mean - 2.5 * spread, mean + 2.5 * spread)), 3),
                build=round(float(np.clip(rng.normal(0.42 + max(age, 18) / 400 - fitness, 0.16), 0.05, 0.95)), 2),
                muscle=round(float(np.clip(rng.normal(0.45 + fitness - max(0, age - 60) / 120, 0.14), 0.1, 0.9)), 2),
                ancestry=ancestry,
                skin=skin,
                hair=self._pick(styles, weights),
                hair_colour=hair_colour,
                eyes=self._colour(
                    ((84, 62, 44), (62, 44, 32)) if ancestry[2] < 0.9 else ((84, 62, 44), (96, 122, 140), (92, 110, 80))
                ),
                beard=bool(not female and age >= 20 and rng.random() < 0.35),
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
