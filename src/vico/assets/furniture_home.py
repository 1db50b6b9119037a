"""Furniture of homes and hotels: bathrooms, bunks, chests, rugs, pictures."""

from __future__ import annotations

from vico.assets.furniture_parts import (
    BIRCH,
    BLACK,
    BLUE,
    CERAMIC,
    CREAM,
    DARK,
    GLASS,
    GREEN,
    GREY,
    LINEN,
    OAK,
    RED,
    STEEL,
    TEAL,
    WALNUT,
    WHITE,
    YELLOW,
    Part,
    facing_front,
    legs,
    piece,
)
from vico.assets.model import Model, Top
from vico.assets.shapes import Colour, ball, cylinder, lathe

BRICK: Colour = (190, 182, 170)


def _toilet() -> Model:
    bowl = lathe(
        [(0.1, 0.0), (0.12, 0.1), (0.18, 0.36), (0.19, 0.4), (0.19, 0.4), (0.0, 0.4)],
        sides=10,
        colour=CERAMIC,
        centre=(0.06, 0, 0),
    )
    lid = cylinder(0.185, 0.03, sides=10, colour=WHITE, centre=(0.06, 0, 0.4))
    return piece(
        "toilet",
        [
            (0.2, 0.38, 0.36, -0.23, 0, 0.6, CERAMIC),
            (0.3, 0.2, 0.4, -0.15, 0, 0.2, CERAMIC),
            (0.05, 0.08, 0.015, -0.23, 0, 0.787, STEEL),
        ],
        bowl,
        lid,
    )


def _sink() -> Model:
    basin = lathe(
        [(0.08, 0.74), (0.22, 0.86), (0.22, 0.86), (0.19, 0.855), (0.06, 0.79), (0, 0.79)], sides=12, colour=CERAMIC
    )
    parts: list[Part] = [
        (0.16, 0.2, 0.74, -0.1, 0, 0.37, CERAMIC),
        (0.03, 0.03, 0.16, -0.18, 0, 0.93, STEEL),
        (0.12, 0.03, 0.03, -0.13, 0, 1.0, STEEL),
        (0.02, 0.6, 0.75, -0.23, 0, 1.5, GLASS),
        (0.1, 0.5, 0.02, -0.19, 0, 1.1, WHITE),
        (0.02, 0.64, 0.03, -0.23, 0, 1.89, OAK),
    ]
    return piece("sink", parts, basin)


def _shower() -> Model:
    return piece(
        "shower",
        [
            (0.9, 0.9, 0.06, 0, 0, 0.03, CERAMIC),
            (0.02, 0.9, 1.94, 0.44, 0, 1.03, GLASS),
            (0.03, 0.03, 2.0, 0.435, 0.435, 1.0, STEEL),
            (0.03, 0.03, 2.0, 0.435, -0.435, 1.0, STEEL),
            (0.04, 0.04, 1.1, -0.42, 0, 1.5, STEEL),
            (0.2, 0.06, 0.03, -0.33, 0, 2.05, STEEL),
            (0.2, 0.2, 0.02, -0.22, 0, 2.02, STEEL),
            (0.05, 0.16, 0.05, -0.41, 0, 1.1, STEEL),
            (0.1, 0.1, 0.01, 0, 0, 0.065, GREY),
        ],
    )


def _bathtub() -> Model:
    """Against a wall with its long side; got into from +x."""
    return piece(
        "bathtub",
        [
            (0.75, 1.7, 0.12, 0, 0, 0.06, CERAMIC),
            (0.08, 1.7, 0.45, 0.335, 0, 0.335, CERAMIC),
            (0.08, 1.7, 0.45, -0.335, 0, 0.335, CERAMIC),
            (0.6, 0.1, 0.45, 0, 0.8, 0.335, CERAMIC),
            (0.6, 0.1, 0.45, 0, -0.8, 0.335, CERAMIC),
            (0.6, 1.5, 0.01, 0, 0, 0.42, (176, 212, 222)),
            (0.04, 0.16, 0.1, -0.33, -0.6, 0.62, STEEL),
            (0.14, 0.04, 0.03, -0.26, -0.6, 0.67, STEEL),
        ],
    )


def _washing_machine() -> Model:
    drum = cylinder(0.17, 0.02, sides=14, colour=DARK)
    turned = drum.moved(facing_front(0.305, 0.0, 0.42))
    return piece(
        "washing_machine",
        [
            (0.6, 0.6, 0.85, 0, 0, 0.425, WHITE),
            (0.01, 0.56, 0.1, 0.303, 0, 0.76, GREY),
            (0.012, 0.2, 0.06, 0.305, 0.12, 0.76, (70, 110, 90)),
        ],
        turned,
    )


def _bunk() -> Model:
    """Two beds, one above the other; head at -x, ladder at +x."""
    parts: list[Part] = []
    for z, cover in ((0.4, TEAL), (1.4, RED)):
        parts += [
            (2.0, 0.94, 0.1, 0, 0, z - 0.08, BIRCH),
            (1.94, 0.88, 0.12, 0, 0, z + 0.02, WHITE),
            (1.3, 0.9, 0.06, 0.3, 0, z + 0.07, cover),
            (0.4, 0.6, 0.08, -0.72, 0, z + 0.12, LINEN),
        ]
    parts += [(0.08, 0.08, 1.8, i, j, 0.9, BIRCH) for i in (-0.98, 0.98) for j in (-0.45, 0.45)]
    parts += [(1.5, 0.04, 0.12, -0.2, j, 1.66, BIRCH) for j in (-0.45, 0.45)]
    parts += [(0.05, 0.3, 0.04, 1.0, 0.28, 0.35 + 0.3 * k, BIRCH) for k in range(5)]
    parts += [(0.05, 0.04, 1.7, 1.0, 0.12, 0.85, BIRCH)]
    return piece("bed_bunk", parts, kind="bed", top=Top("bed", 0.5, (1.3, 0.8), (0.3, 0.0)))


def _chest() -> Model:
    parts: list[Part] = [(0.45, 1.1, 0.85, 0, 0, 0.435, OAK), (0.47, 1.14, 0.03, 0, 0, 0.875, WALNUT)]
    parts += [(0.012, 1.02, 0.24, 0.228, 0, 0.2 + 0.27 * k, BIRCH) for k in range(3)]
    parts += [(0.02, 0.14, 0.02, 0.24, y, 0.2 + 0.27 * k, STEEL) for k in range(3) for y in (-0.3, 0.3)]
    return piece("chest_of_drawers", parts, kind="chest", top=Top("table", 0.89, (0.42, 1.06)))


def _shoe_bench() -> Model:
    return piece(
        "shoe_bench",
        [
            (0.35, 1.0, 0.04, 0, 0, 0.46, OAK),
            (0.33, 0.04, 0.44, 0, 0.47, 0.22, OAK),
            (0.33, 0.04, 0.44, 0, -0.47, 0.22, OAK),
            (0.31, 0.94, 0.03, 0, 0, 0.2, OAK),
            (0.26, 0.1, 0.09, 0, -0.3, 0.26, BLACK),
            (0.26, 0.1, 0.09, 0, -0.16, 0.26, BLACK),
            (0.27, 0.1, 0.1, 0, 0.1, 0.265, RED),
            (0.27, 0.1, 0.1, 0, 0.24, 0.265, RED),
        ],
        kind="bench",
        top=Top("chair", 0.48, (0.33, 0.96)),
    )


def _coat_rack() -> Model:
    parts: list[Part] = [(0.04, 1.1, 0.1, -0.1, 0, 1.7, OAK)]
    tones: tuple[Colour, ...] = (BLUE, (92, 82, 70), RED, DARK)
    for k, tone in enumerate(tones):
        y = -0.42 + 0.28 * k
        parts += [(0.08, 0.03, 0.03, -0.05, y, 1.7, STEEL), (0.12, 0.22, 0.8, 0.0, y, 1.27, tone)]
    return piece("coat_rack", parts, solid=False)


def _rug(name: str, x: float, y: float, colour: Colour, border: Colour) -> Model:
    return piece(
        name,
        [
            (x, y, 0.012, 0, 0, 0.006, border),
            (x - 0.2, y - 0.2, 0.012, 0, 0, 0.009, colour),
            (x - 0.7, y - 0.7, 0.012, 0, 0, 0.012, border),
        ],
        kind="rug",
        solid=False,
    )


def _picture(name: str, width: float, high: float, tones: tuple[Colour, ...], frame: Colour) -> Model:
    """Hangs on a wall, its back at -x."""
    z = 1.6
    parts: list[Part] = [(0.03, width, high, 0.0, 0, z, frame), (0.01, width - 0.1, high - 0.1, 0.016, 0, z, tones[0])]
    parts += [
        (0.006, (width - 0.1) * 0.94, (high - 0.1) * 0.4, 0.022, 0, z - (high - 0.1) * 0.27, tones[1]),
        (0.005, (width - 0.1) * 0.3, (high - 0.1) * 0.34, 0.026, width * 0.14, z + 0.02, tones[2]),
    ]
    return piece(name, parts, kind="painting", solid=False)


def _mirror() -> Model:
    return piece("mirror", [(0.03, 0.5, 1.5, 0, 0, 1.15, OAK), (0.01, 0.44, 1.44, 0.016, 0, 1.15, GLASS)], solid=False)


def _curtains() -> Model:
    """On both sides of a window."""
    parts: list[Part] = [(0.04, 2.3, 0.04, 0, 0, 2.42, DARK)]
    for side in (-1, 1):
        parts += [
            (0.07, 0.09, 2.35, 0.0, side * (0.92 + 0.1 * k), 1.22, (198 - 8 * k, 184 - 8 * k, 160)) for k in range(3)
        ]
    return piece("curtains", parts, solid=False)


def _table(name: str, x: float, y: float, high: float, colour: Colour) -> Model:
    return piece(
        name,
        [(x, y, 0.04, 0, 0, high - 0.02, colour)],
        *legs(x, y, high - 0.04, colour, 0.07),
        kind="table",
        top=Top("table", high, (x, y)),
    )


def _side_table() -> Model:
    top = cylinder(0.26, 0.03, sides=12, colour=BIRCH, centre=(0, 0, 0.52))
    foot = [cylinder(0.03, 0.5, sides=6, colour=BLACK, centre=(0, 0, 0.02)), cylinder(0.18, 0.02, colour=BLACK)]
    return piece("side_table", [], top, *foot, kind="table", top=Top("table", 0.55, (0.36, 0.36)))


def _toy_box() -> Model:
    return piece(
        "toy_box",
        [
            (0.4, 0.7, 0.4, 0, 0, 0.2, YELLOW),
            (0.36, 0.66, 0.02, 0, 0, 0.4, WALNUT),
            (0.16, 0.16, 0.14, 0.02, -0.18, 0.46, RED),
            (0.14, 0.2, 0.12, -0.04, 0.16, 0.45, BLUE),
            (0.1, 0.1, 0.1, 0.1, 0.02, 0.44, GREEN),
        ],
        ball((0.1, 0.1, 0.1), (-0.06, 0.0, 0.5), colour=TEAL, sides=8, rings=5),
    )


def _luggage_rack() -> Model:
    return piece(
        "luggage_rack",
        [
            (0.5, 0.75, 0.03, 0, 0, 0.45, WALNUT),
            (0.42, 0.6, 0.24, 0, 0, 0.585, (58, 74, 96)),
            (0.02, 0.14, 0.03, 0.22, 0, 0.62, STEEL),
        ],
        *legs(0.5, 0.75, 0.44, STEEL, 0.03),
    )


def _fireplace() -> Model:
    return piece(
        "fireplace",
        [
            (0.35, 0.3, 1.1, 0, -0.55, 0.55, BRICK),
            (0.35, 0.3, 1.1, 0, 0.55, 0.55, BRICK),
            (0.42, 1.6, 0.1, 0.02, 0, 1.15, CREAM),
            (0.1, 0.8, 1.0, -0.12, 0, 0.5, BLACK),
            (0.25, 0.9, 0.25, 0.0, 0, 0.98, BRICK),
            (0.12, 0.5, 0.12, 0.02, 0, 0.08, WALNUT),
            (0.1, 0.3, 0.2, 0.0, 0, 0.22, (226, 122, 40)),
            (0.4, 1.4, 0.03, 0.0, 0, 0.015, DARK),
        ],
    )


def home_models() -> list[Model]:
    """Models for homes and guest rooms."""
    sea = ((150, 186, 204), (70, 112, 138), (236, 226, 200))
    field = ((214, 204, 170), (126, 146, 92), (178, 92, 62))
    shapes = ((232, 228, 218), (202, 96, 72), (52, 66, 84))
    return [
        _toilet(),
        _sink(),
        _shower(),
        _bathtub(),
        _washing_machine(),
        _bunk(),
        _chest(),
        _shoe_bench(),
        _coat_rack(),
        _rug("rug", 1.6, 2.3, (164, 84, 72), (214, 196, 168)),
        _rug("rug_blue", 1.4, 2.0, BLUE, (206, 208, 204)),
        _rug("mat", 0.6, 0.9, (146, 160, 158), (196, 204, 200)),
        _rug("runner", 1.0, 3.0, (132, 44, 48), (92, 28, 34)),
        _picture("painting", 0.8, 0.6, sea, OAK),
        _picture("painting_tall", 0.6, 0.9, shapes, BLACK),
        _picture("painting_field", 1.0, 0.7, field, WALNUT),
        _mirror(),
        _curtains(),
        _table("large_table", 1.0, 2.2, 0.75, WALNUT),
        _table("kitchen_table", 0.8, 1.2, 0.75, BIRCH),
        _side_table(),
        _toy_box(),
        _luggage_rack(),
        _fireplace(),
    ]
