"""Furniture for homes, shops, restaurants and offices, modelled from boxes and turned solids, at life size."""

from __future__ import annotations

from functools import cache

from vico.assets.furniture_home import home_models
from vico.assets.furniture_public import public_models
from vico.assets.furniture_shops import shop_models
from vico.assets.furniture_small import small_models
from vico.assets.model import Model, Top, model
from vico.assets.shapes import Colour, ball, box, cylinder, lathe
from vico.world.mesh import Surface

_OAK: Colour = (176, 136, 92)
_WALNUT: Colour = (112, 78, 54)
_WHITE: Colour = (234, 232, 226)
_STEEL: Colour = (156, 160, 164)
_BLACK: Colour = (40, 42, 44)
_LINEN: Colour = (226, 220, 206)
_GREY: Colour = (120, 124, 128)
_BLUE: Colour = (74, 102, 142)
_TEAL: Colour = (66, 118, 116)
_RED: Colour = (168, 68, 58)
_LEAF: Colour = (84, 130, 66)


def _legs(x: float, y: float, height: float, colour: Colour, thick: float = 0.06) -> list[Surface]:
    spots = [(i, j) for i in (-x / 2 + thick / 2, x / 2 - thick / 2) for j in (-y / 2 + thick / 2, y / 2 - thick / 2)]
    return [box((thick, thick, height), (i, j, height / 2), colour=colour) for i, j in spots]


def _table(name: str, x: float, y: float, height: float, colour: Colour, kind: str = "table") -> Model:
    parts = [box((x, y, 0.04), (0, 0, height - 0.02), colour=colour), *_legs(x, y, height - 0.04, colour)]
    return model(name, parts, kind=kind, group="indoor", top=Top("table", height, (x, y)))


def _round_table() -> Model:
    parts = [
        cylinder(0.38, 0.03, sides=14, colour=_WALNUT, centre=(0, 0, 0.71)),
        cylinder(0.04, 0.7, sides=6, colour=_BLACK, centre=(0, 0, 0.02)),
        cylinder(0.24, 0.03, sides=12, colour=_BLACK),
    ]
    return model("cafe_table", parts, kind="table", group="indoor", top=Top("table", 0.74, (0.5, 0.5)))


def _bed(name: str, width: float, cover: Colour) -> Model:
    """Head at -x; people get in from the sides."""
    parts = [
        box((2.04, width + 0.04, 0.26), (0, 0, 0.2), colour=_OAK),
        box((1.96, width - 0.04, 0.16), (0, 0, 0.41), colour=_WHITE),
        box((1.34, width + 0.02, 0.09), (0.33, 0, 0.455), colour=cover),
        box((0.06, width + 0.04, 0.95), (-1.02, 0, 0.475), colour=_OAK),
    ]
    pillows = (0.0,) if width < 1.2 else (-width / 4, width / 4)
    parts += [ball((0.22, 0.3, 0.09), (-0.72, y, 0.53), colour=_LINEN, sides=8, rings=4) for y in pillows]
    top = Top("bed", 0.5, (1.3, width - 0.1), (0.3, 0.0))
    return model(name, parts, kind="bed", group="indoor", top=top)


def _sofa(name: str, width: float, colour: Colour) -> Model:
    seats = 1 if width < 1.2 else 2
    dark = (int(colour[0] * 0.85), int(colour[1] * 0.85), int(colour[2] * 0.85))
    parts = [
        box((0.8, width, 0.26), (0, 0, 0.21), colour=dark),
        box((0.2, width, 0.56), (-0.33, 0, 0.56), colour=dark),
        box((0.82, 0.16, 0.5), (0, width / 2 - 0.08, 0.35), colour=dark),
        box((0.82, 0.16, 0.5), (0, 0.08 - width / 2, 0.35), colour=dark),
    ]
    each = (width - 0.34) / seats
    for k in range(seats):
        y = -(width - 0.34) / 2 + each * (k + 0.5)
        parts.append(box((0.58, each - 0.02, 0.12), (0.1, y, 0.39), colour=colour))
        parts.append(box((0.14, each - 0.04, 0.36), (-0.2, y, 0.62), colour=colour))
    return model(name, parts, kind="sofa", group="indoor", top=Top("sofa", 0.45, (0.5, width - 0.36), (0.1, 0.0)))


def _chair(name: str, colour: Colour, seat: Colour) -> Model:
    parts = [
        box((0.42, 0.42, 0.04), (0, 0, 0.45), colour=seat),
        box((0.035, 0.42, 0.42), (-0.2, 0, 0.7), colour=colour),
        *_legs(0.42, 0.42, 0.43, colour, 0.04),
    ]
    return model(name, parts, kind="chair", group="indoor", top=Top("chair", 0.47, (0.38, 0.38)))


def _stool() -> Model:
    parts = [
        cylinder(0.18, 0.05, sides=9, colour=_RED, centre=(0, 0, 0.68)),
        cylinder(0.03, 0.66, sides=6, colour=_STEEL, centre=(0, 0, 0.02)),
        cylinder(0.2, 0.03, sides=9, colour=_STEEL),
    ]
    return model("stool", parts, kind="stool", group="indoor")


def _office_chair() -> Model:
    parts = [
        box((0.48, 0.48, 0.08), (0, 0, 0.46), colour=_BLACK),
        box((0.07, 0.44, 0.55), (-0.23, 0, 0.84), colour=_BLACK),
        cylinder(0.03, 0.36, sides=6, colour=_STEEL, centre=(0, 0, 0.08)),
        box((0.6, 0.07, 0.06), (0, 0, 0.05), colour=_GREY),
        box((0.07, 0.6, 0.06), (0, 0, 0.05), colour=_GREY),
    ]
    return model("office_chair", parts, kind="chair", group="indoor", top=Top("chair", 0.5, (0.44, 0.44)))


def _desk() -> Model:
    """Sat at from +x; the screen stands at the back."""
    parts = [
        box((0.75, 1.5, 0.04), (0, 0, 0.72), colour=_OAK),
        *_legs(0.75, 1.5, 0.7, _STEEL, 0.05),
        box((0.5, 0.4, 0.5), (-0.08, 0.5, 0.43), colour=_WHITE),
        box((0.04, 0.6, 0.36), (-0.2, 0, 1.02), colour=_BLACK),
        box((0.01, 0.55, 0.31), (-0.178, 0, 1.02), colour=(96, 132, 160)),
        box((0.06, 0.08, 0.14), (-0.22, 0, 0.8), colour=_BLACK),
        box((0.16, 0.44, 0.02), (0.1, 0, 0.75), colour=_GREY),
    ]
    return model("desk", parts, group="indoor", top=Top("desk", 0.74, (0.3, 1.4), (0.2, 0.0)))


def _shelf() -> Model:
    """A shop shelf with goods, used from +x."""
    parts = [
        box((0.45, 0.04, 1.7), (0, -0.68, 0.85), colour=_WHITE),
        box((0.45, 0.04, 1.7), (0, 0.68, 0.85), colour=_WHITE),
        box((0.03, 1.36, 1.7), (-0.21, 0, 0.85), colour=_WHITE),
    ]
    tones: tuple[Colour, ...] = ((196, 72, 60), (222, 180, 70), (80, 140, 98), (76, 112, 168), (200, 130, 70))
    for k in range(4):
        z = 0.12 + 0.42 * k
        parts.append(box((0.42, 1.32, 0.03), (0.01, 0, z), colour=_WHITE))
        for j in range(4):
            tone = tones[(2 * k + j) % 5]
            parts.append(box((0.3, 0.26, 0.2 + 0.03 * ((k + j) % 3)), (0.02, -0.48 + 0.32 * j, z + 0.13), colour=tone))
    return model("shelf", parts, group="indoor")


def _bookcase() -> Model:
    parts = [
        box((0.32, 0.03, 1.9), (0, -0.5, 0.95), colour=_OAK),
        box((0.32, 0.03, 1.9), (0, 0.5, 0.95), colour=_OAK),
        box((0.02, 1.0, 1.9), (-0.15, 0, 0.95), colour=_OAK),
    ]
    tones: tuple[Colour, ...] = ((140, 54, 48), (52, 82, 112), (196, 168, 110), (70, 104, 74))
    for k in range(5):
        z = 0.06 + 0.45 * k
        parts.append(box((0.3, 0.98, 0.03), (0, 0, z), colour=_OAK))
        if k < 4:
            for j in range(3):
                tone = tones[(k + j) % 4]
                parts.append(box((0.2, 0.26, 0.28 + 0.03 * j), (0, -0.3 + 0.3 * j, z + 0.17), colour=tone))
    return model("bookcase", parts, group="indoor")


def _counter() -> Model:
    """A shop or bar counter; customers stand at +x."""
    parts = [
        box((0.55, 2.0, 1.0), (-0.05, 0, 0.5), colour=_WALNUT),
        box((0.7, 2.08, 0.06), (0, 0, 1.03), colour=_OAK),
        box((0.3, 0.36, 0.16), (-0.05, 0.6, 1.14), colour=_BLACK),
        box((0.04, 0.3, 0.22), (-0.1, 0.6, 1.32), colour=_GREY),
    ]
    return model("counter", parts, group="indoor", top=Top("table", 1.06, (0.6, 1.2), (0.0, -0.3)))


def _kitchen() -> Model:
    """Kitchen units with sink, stove and wall cupboards, used from +x."""
    parts = [
        box((0.58, 2.4, 0.86), (0, 0, 0.45), colour=_WHITE),
        box((0.62, 2.44, 0.04), (0.01, 0, 0.9), colour=(108, 104, 100)),
        box((0.35, 2.4, 0.65), (-0.13, 0, 1.75), colour=_WHITE),
        box((0.44, 0.5, 0.02), (0.02, -0.75, 0.915), colour=_STEEL),
        box((0.04, 0.04, 0.25), (-0.18, -0.75, 1.03), colour=_STEEL),
        box((0.5, 0.56, 0.02), (0.0, 0.75, 0.925), colour=_BLACK),
        box((0.02, 0.5, 0.4), (0.295, 0.75, 0.5), colour=_BLACK),
    ]
    parts += [box((0.01, 0.012, 0.8), (0.292, y, 0.45), colour=_GREY) for y in (-0.6, 0.0, 0.45)]
    return model("kitchen", parts, group="indoor", top=Top("table", 0.92, (0.55, 0.7), (0.0, 0.0)))


def _fridge() -> Model:
    parts = [
        box((0.62, 0.62, 1.8), (0, 0, 0.92), colour=_WHITE),
        box((0.01, 0.6, 0.012), (0.312, 0, 1.2), colour=_GREY),
        box((0.03, 0.03, 0.4), (0.32, -0.25, 1.45), colour=_STEEL),
        box((0.03, 0.03, 0.4), (0.32, -0.25, 0.9), colour=_STEEL),
    ]
    return model("fridge", parts, group="indoor")


def _stove() -> Model:
    """A restaurant range."""
    parts = [
        box((0.75, 1.4, 0.88), (0, 0, 0.44), colour=_STEEL),
        box((0.03, 1.4, 0.5), (-0.36, 0, 1.1), colour=_STEEL),
        box((0.7, 1.2, 0.4), (-0.02, 0, 2.0), colour=_GREY),
        box((0.02, 0.6, 0.4), (0.38, 0.3, 0.45), colour=_BLACK),
        box((0.02, 0.6, 0.4), (0.38, -0.35, 0.45), colour=_BLACK),
    ]
    parts += [
        cylinder(0.13, 0.02, sides=8, colour=_BLACK, centre=(x, y, 0.88)) for x in (-0.15, 0.17) for y in (-0.4, 0.4)
    ]
    return model("stove", parts, group="indoor")


def _floor_lamp() -> Model:
    parts = [
        cylinder(0.15, 0.03, sides=9, colour=_BLACK),
        cylinder(0.015, 1.4, sides=5, colour=_BLACK, centre=(0, 0, 0.03)),
        lathe([(0.22, 1.35), (0.22, 1.35), (0.13, 1.65), (0, 1.65)], sides=9, colour=(240, 226, 188)),
    ]
    return model("floor_lamp", parts, kind="lamp", group="indoor")


def _wardrobe() -> Model:
    parts = [box((0.58, 1.4, 2.0), (0, 0, 1.02), colour=_OAK), box((0.56, 1.36, 0.04), (0, 0, 0.02), colour=_WALNUT)]
    parts += [box((0.01, 0.015, 1.9), (0.292, y, 1.02), colour=_WALNUT) for y in (-0.23, 0.23)]
    parts += [box((0.03, 0.02, 0.3), (0.3, y, 1.0), colour=_STEEL) for y in (-0.18, 0.28)]
    return model("wardrobe", parts, group="indoor")


def _television() -> Model:
    parts = [
        box((0.42, 1.5, 0.45), (0, 0, 0.225), colour=_WALNUT),
        box((0.05, 1.2, 0.7), (-0.05, 0, 0.87), colour=_BLACK),
        box((0.01, 1.14, 0.64), (-0.02, 0, 0.87), colour=(58, 74, 92)),
        box((0.2, 0.4, 0.06), (-0.05, 0, 0.48), colour=_BLACK),
    ]
    return model("television", parts, group="indoor")


def _pot_plant() -> Model:
    parts = [
        lathe([(0.14, 0), (0.19, 0.34), (0.19, 0.34), (0.16, 0.32), (0, 0.3)], sides=8, colour=(172, 102, 72)),
        ball((0.26, 0.26, 0.3), (0, 0, 0.72), colour=_LEAF, sides=7, rings=5),
        ball((0.18, 0.18, 0.24), (0.1, 0.08, 1.02), colour=(102, 150, 80), sides=6, rings=4),
        cylinder(0.025, 0.4, sides=5, colour=_WALNUT, centre=(0, 0, 0.3)),
    ]
    return model("pot_plant", parts, kind="plant", group="indoor")


def _filing_cabinet() -> Model:
    parts = [box((0.6, 0.48, 1.3), (0, 0, 0.65), colour=_GREY)]
    parts += [box((0.012, 0.42, 0.38), (0.302, 0, 0.24 + 0.42 * k), colour=_STEEL) for k in range(3)]
    return model("filing_cabinet", parts, kind="cabinet", group="indoor")


def _clothes_rack() -> Model:
    parts = [
        box((0.04, 1.5, 0.04), (0, 0, 1.55), colour=_STEEL),
        box((0.5, 0.04, 0.04), (0, -0.72, 0.04), colour=_STEEL),
        box((0.5, 0.04, 0.04), (0, 0.72, 0.04), colour=_STEEL),
        box((0.04, 0.04, 1.5), (0, -0.72, 0.79), colour=_STEEL),
        box((0.04, 0.04, 1.5), (0, 0.72, 0.79), colour=_STEEL),
    ]
    tones: tuple[Colour, ...] = (
        (60, 70, 96),
        (176, 88, 80),
        (210, 200, 180),
        (86, 116, 92),
        (60, 60, 62),
        (196, 160, 90),
    )
    for k in range(9):
        parts.append(box((0.42, 0.06, 0.85), (0, -0.56 + 0.14 * k, 1.1), colour=tones[k % 6]))
    return model("clothes_rack", parts, group="indoor")


def _display_table() -> Model:
    parts = [
        box((0.9, 1.4, 0.05), (0, 0, 0.78), colour=_OAK),
        box((0.7, 1.2, 0.75), (0, 0, 0.375), colour=_WHITE),
        box((0.24, 0.3, 0.1), (-0.25, 0.45, 0.855), colour=_BLUE),
        box((0.24, 0.3, 0.16), (-0.25, 0.05, 0.885), colour=_RED),
        box((0.24, 0.3, 0.07), (-0.25, -0.4, 0.84), colour=(210, 180, 90)),
    ]
    return model("display_table", parts, kind="table", group="indoor", top=Top("table", 0.805, (0.45, 1.3), (0.2, 0.0)))


def _plinth() -> Model:
    """An exhibit in a glass case."""
    parts = [
        box((0.6, 0.6, 0.95), (0, 0, 0.475), colour=_WHITE),
        ball((0.16, 0.16, 0.24), (0, 0, 1.2), colour=(190, 140, 80), sides=8, rings=5),
        box((0.6, 0.6, 0.04), (0, 0, 0.97), colour=_GREY),
    ]
    return model("plinth", parts, group="indoor")


def _pew() -> Model:
    parts = [
        box((0.42, 1.9, 0.05), (0, 0, 0.45), colour=_WALNUT),
        box((0.05, 1.9, 0.5), (-0.2, 0, 0.7), colour=_WALNUT),
        box((0.46, 0.06, 0.92), (0, -0.95, 0.46), colour=_WALNUT),
        box((0.46, 0.06, 0.92), (0, 0.95, 0.46), colour=_WALNUT),
    ]
    return model("pew", parts, kind="bench", group="indoor", top=Top("chair", 0.48, (0.4, 1.8)))


def _stage() -> Model:
    parts = [
        box((1.2, 2.6, 0.3), (0, 0, 0.15), colour=_WALNUT),
        box((0.08, 2.5, 1.9), (-0.52, 0, 1.25), colour=(120, 36, 44)),
        box((0.4, 0.4, 0.9), (-0.2, 1.0, 0.75), colour=_BLACK),
        box((0.4, 0.4, 0.9), (-0.2, -1.0, 0.75), colour=_BLACK),
    ]
    return model("stage", parts, group="indoor")


def _washstand() -> Model:
    parts = [
        box((0.45, 0.7, 0.8), (0, 0, 0.4), colour=_WHITE),
        box((0.4, 0.5, 0.02), (0.02, 0, 0.81), colour=(196, 206, 210)),
        box((0.03, 0.6, 0.7), (-0.2, 0, 1.5), colour=(176, 200, 210)),
    ]
    return model("washstand", parts, group="indoor")


def _treadmill() -> Model:
    parts = [
        box((1.7, 0.75, 0.2), (0, 0, 0.1), colour=_BLACK),
        box((1.4, 0.5, 0.02), (-0.1, 0, 0.21), colour=_GREY),
        box((0.06, 0.06, 1.2), (0.7, 0.32, 0.7), colour=_STEEL),
        box((0.06, 0.06, 1.2), (0.7, -0.32, 0.7), colour=_STEEL),
        box((0.12, 0.7, 0.35), (0.7, 0, 1.3), colour=_BLACK),
    ]
    return model("treadmill", parts, group="indoor")


@cache
def furniture_models() -> dict[str, Model]:
    """Models of furniture, by prototype name."""
    models = [
        _bed("bed_double", 1.6, _BLUE), _bed("bed_single", 0.9, _TEAL), _sofa("sofa", 1.9, _GREY),
        _sofa("sofa_teal", 1.9, _TEAL), _sofa("armchair", 0.95, _RED),
        _table("dining_table", 0.85, 1.4, 0.75, _OAK), _table("restaurant_table", 0.75, 0.75, 0.75, _WALNUT),
        _table("coffee_table", 0.55, 1.0, 0.42, _WALNUT), _table("work_table", 0.9, 2.0, 0.75, _WHITE),
        _table("steel_table", 0.7, 1.6, 0.9, _STEEL), _table("bedside_table", 0.4, 0.45, 0.5, _OAK),
        _round_table(), _chair("chair", _OAK, _OAK), _chair("restaurant_chair", _WALNUT, _RED), _stool(),
        _office_chair(), _desk(), _shelf(), _bookcase(), _counter(), _kitchen(), _fridge(), _stove(), _floor_lamp(),
        _wardrobe(), _television(), _pot_plant(), _filing_cabinet(), _clothes_rack(), _display_table(), _plinth(),
        _pew(), _stage(), _washstand(), _treadmill(), *home_models(), *shop_models(), *public_models(), *small_models(),
    ]  # fmt: skip
    return {m.name: m for m in models}
