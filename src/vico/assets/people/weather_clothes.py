"""What people put on, and leave at home, as the weather asks for it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from vico.assets.people.model import Appearance

# From these temperatures on, degrees Celsius, it is hot, mild, cool; below the last it is cold, and freezing at 0.
_HOT, _MILD, _COOL, _COLD = 23.0, 16.0, 9.0, 3.0
# From so much rain on, mm/h, people dress for it; snow counts by the water in it.
_WET = 0.2
_LIGHT = ("t-shirt", "dress")


def dressed(look: Appearance, temperature: float, rain: float = 0.0, snow: float = 0.0) -> Appearance:
    """Return how somebody looks who has dressed for the weather.

    Colours stay, and so does what a trade asks for over the top and on the head; suits are worn in any weather, with a
    coat over them when it is cold.

    Parameters
    ----------
    look
        How they like to be dressed.
    temperature
        Degrees Celsius.
    rain, snow
        Water that falls, mm/h.
    """
    change: dict[str, Any] = {"top": _top(look, temperature, rain + snow)}
    if look.bottom == "shorts" and temperature < _MILD:
        change["bottom"] = "jeans"
    if look.bottom in ("jeans", "trousers") and temperature >= _HOT + 3 and look.age < 35 and not _in_uniform(look):
        change["bottom"] = "shorts"
    if change["top"] == "coat" and look.top == "dress":
        change["bottom"] = "leggings"
    wet = rain >= _WET or snow > 0.0
    if look.shoes == "sandals" and (temperature < _MILD or wet):
        change["shoes"] = "boots" if temperature < _COLD else "trainers"
    if look.shoes in ("trainers", "shoes") and (snow > 0.0 or temperature < 0.0):
        change["shoes"] = "boots"
    if look.hat == "none" and temperature < _COLD:
        change["hat"], change["hat_colour"] = "beanie", look.bottom_colour
    if look.hat == "none" and temperature >= _HOT + 3 and (look.age < 11 or look.age > 65):
        change["hat"], change["hat_colour"] = "sun hat", (222, 208, 170)
    if look.hat == "sun hat" and temperature < _COOL:
        change["hat"] = "beanie"
    return replace(look, **change)


def _in_uniform(look: Appearance) -> bool:
    """Return whether a trade says what is worn."""
    return look.over != "none" or look.hat in ("uniform cap", "hard hat", "toque") or look.top == "suit"


def _top(look: Appearance, temperature: float, wet: float) -> str:
    top = look.top
    if top == "suit":
        return "coat" if temperature < _COLD else top
    if temperature >= _HOT:
        if top in ("t-shirt", "shirt", "dress") or (top == "coat" and _is_white(look)):
            return top
        return "shirt" if _in_uniform(look) else "t-shirt"
    if temperature >= _MILD:
        top = "jumper" if top == "coat" and look.over == "none" and not _is_white(look) else top
    elif temperature >= _COOL:
        top = "jumper" if top in _LIGHT else "jacket" if top == "shirt" and not _in_uniform(look) else top
    elif temperature >= _COLD:
        top = "coat" if top == "coat" else "jacket"
    else:
        top = "coat"
    if wet >= _WET and top not in ("jacket", "coat"):
        top = "jacket"
    return top


def _is_white(look: Appearance) -> bool:
    """Return whether a coat is a white one, as physicians and pharmacists wear."""
    return min(look.top_colour) > 200
