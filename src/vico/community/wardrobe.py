"""How residents look: bodies by age and family, clothes by age, taste and trade. No two look alike."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from vico.community.clothes import TradeClothes, clothes_of
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
# After this age people grow smaller by so many metres a year.
_SHRINK_FROM, _SHRINK = 60, 0.0013


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
            skin = self._colour([_mean([one["skin"] for one in family])], 3.0)
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
                weights[0], weights[4] = 1.6, 0
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


def _mean(colours: Sequence[Colour]) -> Colour:
    red, green, blue = np.mean(colours, axis=0).astype(int).tolist()
    return red, green, blue
