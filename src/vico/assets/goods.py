"""Things people carry: small, recognisable, in plain colours; origin at the middle of the underside, z up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vico.assets.shapes import Colour, ball, box, cylinder, extrusion, lathe, pose_matrix
from vico.errors import InputError
from vico.world.mesh import Surface

COLOURS: dict[str, Colour] = {
    "red": (196, 40, 38),
    "orange": (226, 122, 30),
    "yellow": (232, 196, 44),
    "green": (46, 140, 70),
    "blue": (40, 88, 186),
    "purple": (122, 62, 158),
    "pink": (226, 130, 168),
    "white": (236, 236, 232),
    "brown": (122, 82, 50),
}
_DARK: Colour = (42, 42, 46)
_METAL: Colour = (160, 164, 168)
_WOOD: Colour = (150, 108, 66)


@dataclass(frozen=True)
class Good:
    """A kind of thing.

    Attributes
    ----------
    size
        Extent along x, y, z at rest, metres.
    sentence
        What it is, for instructions: "a {colour} backpack".
    """

    kind: str
    size: tuple[float, float, float]
    sentence: str
    model: Callable[[Colour], list[Surface]]

    def described(self, colour: str) -> str:
        """What it is, with its colour and the right article."""
        return self.sentence.format(colour=colour).replace("a orange", "an orange")


def _tilted(surface: Surface, *, pitch: float, z: float, x: float = 0.0) -> Surface:
    """Turn about the y axis by `pitch`, then lift."""
    c, s = np.cos(pitch), np.sin(pitch)
    matrix = np.array([[c, 0, s, x], [0, 1, 0, 0], [-s, 0, c, z], [0, 0, 0, 1]])
    return surface.moved(matrix)


def _backpack(colour: Colour) -> list[Surface]:
    side = [(-0.13, 0.0), (0.13, 0.0), (0.15, 0.12), (0.12, 0.38), (0.04, 0.46), (-0.1, 0.46), (-0.14, 0.3)]
    dark: Colour = (colour[0] * 2 // 3, colour[1] * 2 // 3, colour[2] * 2 // 3)
    return [
        extrusion(side, 0.32, colour=colour),
        box((0.08, 0.24, 0.2), (0.16, 0, 0.14), colour=dark),
        box((0.03, 0.05, 0.36), (-0.15, 0.1, 0.24), colour=_DARK),
        box((0.03, 0.05, 0.36), (-0.15, -0.1, 0.24), colour=_DARK),
        box((0.02, 0.12, 0.04), (0.0, 0, 0.48), colour=_DARK),
    ]


def _parcel(colour: Colour) -> list[Surface]:
    return [
        box((0.4, 0.3, 0.28), (0, 0, 0.14), colour=(186, 144, 96)),
        box((0.405, 0.06, 0.285), (0, 0, 0.1425), colour=colour),
        box((0.12, 0.09, 0.004), (0.08, 0.08, 0.282), colour=(244, 244, 240)),
    ]


def _ball(colour: Colour) -> list[Surface]:
    whole = ball((0.14, 0.14, 0.14), (0, 0, 0.14), colour=colour, sides=14, rings=8)
    band = lathe([(0.1415, 0.128), (0.1415, 0.152)], sides=14, colour=_DARK)
    return [whole, band]


def _bear(colour: Colour) -> list[Surface]:
    light: Colour = (min(colour[0] + 60, 255), min(colour[1] + 60, 255), min(colour[2] + 60, 255))
    parts = [
        ball((0.1, 0.11, 0.13), (0, 0, 0.13), colour=colour),
        ball((0.09, 0.1, 0.09), (0.01, 0, 0.32), colour=colour),
        ball((0.035, 0.045, 0.035), (0.09, 0, 0.3), colour=light),
        ball((0.012, 0.016, 0.012), (0.125, 0, 0.31), colour=_DARK),
    ]
    for side in (-1, 1):
        parts += [
            ball((0.02, 0.035, 0.035), (0, 0.08 * side, 0.4), colour=colour),
            ball((0.012, 0.012, 0.014), (0.085, 0.035 * side, 0.345), colour=_DARK),
            ball((0.05, 0.04, 0.08), (0.04, 0.12 * side, 0.17), colour=colour),
            ball((0.1, 0.045, 0.045), (0.1, 0.07 * side, 0.05), colour=colour),
        ]
    return parts


def _bag(colour: Colour) -> list[Surface]:
    loops = [box((0.01, 0.16, 0.012), (x, 0, 0.47), colour=_DARK) for x in (-0.06, 0.06)]
    loops += [box((0.01, 0.012, 0.1), (x, 0.08 * s, 0.42), colour=_DARK) for x in (-0.06, 0.06) for s in (-1, 1)]
    return [
        box((0.18, 0.34, 0.38), (0, 0, 0.19), colour=colour),
        box((0.182, 0.16, 0.12), (0, 0, 0.22), colour=(244, 244, 240)),
        *loops,
    ]


def _toolbox(colour: Colour) -> list[Surface]:
    return [
        box((0.44, 0.2, 0.16), (0, 0, 0.08), colour=colour),
        extrusion([(-0.22, 0.16), (0.22, 0.16), (0.18, 0.21), (-0.18, 0.21)], 0.2, colour=colour),
        box((0.16, 0.03, 0.02), (0, 0, 0.27), colour=_DARK),
        box((0.02, 0.03, 0.07), (0.08, 0, 0.24), colour=_DARK),
        box((0.02, 0.03, 0.07), (-0.08, 0, 0.24), colour=_DARK),
        box((0.05, 0.206, 0.04), (0.12, 0, 0.14), colour=_METAL),
        box((0.05, 0.206, 0.04), (-0.12, 0, 0.14), colour=_METAL),
    ]


def _guitar(colour: Colour) -> list[Surface]:
    outline = [(0.0, 0.0), (0.18, 0.06), (0.2, 0.2), (0.14, 0.32), (0.16, 0.44), (0.08, 0.54)]
    mirrored = [(-x, z) for x, z in reversed(outline[1:])]
    return [
        extrusion([*outline, *mirrored], 0.1, colour=colour),
        box((0.08, 0.07, 0.42), (0, 0, 0.74), colour=colour),
        box((0.12, 0.08, 0.12), (0, 0, 0.98), colour=colour),
        box((0.02, 0.03, 0.14), (0.19, 0, 0.25), colour=_DARK),
    ]


def _plant(colour: Colour) -> list[Surface]:
    leaves = []
    for k in range(7):
        turn = 2.4 * k
        leaf = ball((0.11, 0.035, 0.012), (0.1, 0, 0), colour=(58, 128 + 8 * (k % 3), 62), sides=6, rings=4)
        lifted = _tilted(leaf, pitch=-0.5 - 0.12 * (k % 3), z=0.26 + 0.02 * k)
        leaves.append(lifted.moved(pose_matrix(yaw=turn)))
    pot = lathe([(0.0, 0.0), (0.09, 0.0), (0.13, 0.2), (0.13, 0.22), (0.11, 0.22), (0.0, 0.2)], sides=10, colour=colour)
    return [pot, cylinder(0.015, 0.2, colour=(70, 110, 60), centre=(0, 0, 0.18)), *leaves]


def _umbrella(colour: Colour) -> list[Surface]:
    """Closed, lying on its side along x."""
    cloth = lathe([(0.0, 0.0), (0.055, 0.06), (0.045, 0.5), (0.012, 0.62), (0.0, 0.62)], sides=8, colour=colour)
    shaft = cylinder(0.01, 0.16, colour=_METAL, centre=(0, 0, 0.62))
    grip = cylinder(0.02, 0.14, colour=_WOOD, centre=(0, 0, 0.76))
    return [_tilted(part, pitch=np.pi / 2, z=0.056, x=-0.45) for part in (cloth, shaft, grip)]


def _helmet(colour: Colour) -> list[Surface]:
    shell = lathe([(0.13, 0.0), (0.14, 0.06), (0.12, 0.14), (0.06, 0.19), (0.0, 0.2)], sides=12, colour=colour)
    visor = box((0.03, 0.16, 0.06), (0.125, 0, 0.08), colour=_DARK)
    rim = lathe([(0.0, 0.0), (0.13, 0.0)], sides=12, colour=_DARK)
    stripe = box((0.22, 0.03, 0.02), (0, 0, 0.19), colour=(236, 236, 232))
    return [shell, visor, rim, stripe]


def _books(colour: Colour) -> list[Surface]:
    tints: list[Colour] = [colour, (220, 214, 196), (70, 84, 112)]
    return [box((0.24, 0.17, 0.05), (0, 0, 0.025 + 0.052 * k), colour=t, yaw=0.14 * k) for k, t in enumerate(tints)]


def _watering_can(colour: Colour) -> list[Surface]:
    body = cylinder(0.11, 0.22, colour=colour, sides=12)
    spout = _tilted(cylinder(0.02, 0.26, sides=6, colour=colour), pitch=0.9, z=0.06, x=0.1)
    handle = [
        box((0.14, 0.02, 0.02), (-0.14, 0, 0.22), colour=_DARK),
        box((0.02, 0.02, 0.16), (-0.2, 0, 0.14), colour=_DARK),
        box((0.1, 0.02, 0.02), (-0.15, 0, 0.07), colour=_DARK),
    ]
    return [body, spout, *handle]


GOODS: dict[str, Good] = {
    good.kind: good
    for good in (
        Good("backpack", (0.36, 0.32, 0.5), "a {colour} backpack", _backpack),
        Good("parcel", (0.41, 0.3, 0.29), "a parcel with {colour} tape", _parcel),
        Good("basketball", (0.28, 0.28, 0.28), "a {colour} basketball", _ball),
        Good("teddy bear", (0.3, 0.33, 0.44), "a {colour} teddy bear", _bear),
        Good("shopping bag", (0.19, 0.34, 0.48), "a {colour} shopping bag", _bag),
        Good("toolbox", (0.44, 0.21, 0.28), "a {colour} toolbox", _toolbox),
        Good("guitar case", (0.4, 0.1, 1.04), "a {colour} guitar case", _guitar),
        Good("potted plant", (0.36, 0.34, 0.5), "a plant in a {colour} pot", _plant),
        Good("umbrella", (0.92, 0.12, 0.12), "a closed {colour} umbrella", _umbrella),
        Good("helmet", (0.28, 0.28, 0.21), "a {colour} helmet", _helmet),
        Good("books", (0.28, 0.24, 0.16), "a pile of books, the lowest one {colour}", _books),
        Good("watering can", (0.54, 0.22, 0.24), "a {colour} watering can", _watering_can),
    )
}


def good_prototype(kind: str, colour: str) -> str:
    """Name of the prototype of a thing, e.g. ``good/backpack/red``."""
    return f"good/{kind}/{colour}"


def good_surfaces(kind: str, colour: str) -> list[Surface]:
    """Model of a thing.

    Raises
    ------
    InputError
        If the kind or the colour is not in the catalogue.
    """
    if kind not in GOODS:
        raise InputError(f"goods: no thing called {kind!r}; there are {', '.join(GOODS)}")
    if colour not in COLOURS:
        raise InputError(f"goods: no colour called {colour!r}; there are {', '.join(COLOURS)}")
    return GOODS[kind].model(COLOURS[colour])
