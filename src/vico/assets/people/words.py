"""How somebody looks, in words: what one would tell a stranger who is to find them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

# sRGB, 0..255.
_COLOURS = {
    "black": (25, 25, 28),
    "dark grey": (75, 77, 80),
    "grey": (135, 135, 138),
    "white": (235, 235, 230),
    "beige": (205, 190, 160),
    "brown": (110, 75, 50),
    "red": (190, 45, 45),
    "dark red": (115, 35, 45),
    "orange": (225, 130, 50),
    "yellow": (225, 200, 70),
    "green": (70, 140, 75),
    "dark green": (40, 75, 55),
    "olive": (105, 110, 65),
    "light blue": (140, 180, 220),
    "blue": (55, 95, 175),
    "dark blue": (35, 50, 90),
    "purple": (115, 70, 140),
    "pink": (225, 150, 170),
}
_HAIR_COLOURS = {
    "black": (28, 24, 22),
    "dark brown": (62, 44, 32),
    "brown": (105, 72, 46),
    "blond": (200, 165, 105),
    "red": (150, 75, 40),
    "grey": (150, 150, 150),
    "white": (222, 222, 220),
}
_HAIR = {
    "bald": "no hair",
    "crop": "cropped {} hair",
    "short": "short {} hair",
    "curly": "curly {} hair",
    "bob": "a {} bob",
    "long": "long {} hair",
    "ponytail": "a {} ponytail",
    "bun": "{} hair in a bun",
}
_PLURAL = ("trousers", "jeans", "shorts", "leggings")


def nearest_colour(colour: tuple[int, int, int], names: Mapping[str, tuple[int, int, int]] = _COLOURS) -> str:
    """Return the name of the nearest colour, by squared distance in sRGB weighted as the eye does."""
    away = (np.array(list(names.values()), np.float64) - np.asarray(colour, np.float64)) ** 2
    return list(names)[int((away @ np.array([0.3, 0.59, 0.11])).argmin())]


def looks_in_words(look: Mapping[str, Any]) -> str:
    """Describe somebody.

    Parameters
    ----------
    look
        The fields of `vico.assets.people.Appearance`.

    Returns
    -------
    str
        Such as "a tall woman of about 30 with long brown hair, in a red coat and blue jeans".
    """
    who = (
        ("woman" if look["gender"] < 0.5 else "man")
        if look["age"] >= 18
        else ("girl" if look["gender"] < 0.5 else "boy")
    )
    usual = 1.65 if look["gender"] < 0.5 else 1.78
    stature = (
        ""
        if look["age"] < 18
        else "tall "
        if look["height"] > usual + 0.08
        else "short "
        if look["height"] < usual - 0.08
        else ""
    )
    age = f"about {round(look['age'] / 10) * 10}" if look["age"] >= 20 else f"about {round(look['age'])}"
    hair = _HAIR[look["hair"]].format(nearest_colour(look["hair_colour"], _HAIR_COLOURS))
    features = [hair, *(["a beard"] if look["beard"] else []), *(["glasses"] if look["glasses"] else [])]
    top = f"a {nearest_colour(look['top_colour'])} {look['top']}"
    bottom = nearest_colour(look["bottom_colour"]) + " " + look["bottom"]
    clothes = [top] if look["top"] == "dress" else [top, bottom if look["bottom"] in _PLURAL else f"a {bottom}"]
    if look.get("hat", "none") != "none":
        clothes.append(f"a {look['hat']}")
    if look.get("bag", "none") != "none":
        clothes.append(f"with a {look['bag']}")
    return f"a {stature}{who} of {age} with {_listed(features)}, in {_listed(clothes)}".replace(
        "a orange", "an orange"
    ).replace("a olive", "an olive")


def _listed(words: list[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
