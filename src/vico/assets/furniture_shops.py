"""Furniture of shops, cafes, restaurants and bars."""

from __future__ import annotations

from vico.assets.furniture_parts import (
    BIRCH,
    BLACK,
    CREAM,
    DARK,
    GLASS,
    GOODS_COLOURS,
    GREEN,
    GREY,
    LEAF,
    LINEN,
    OAK,
    RED,
    SCREEN,
    STEEL,
    TEAL,
    WALNUT,
    WHITE,
    YELLOW,
    Part,
    goods_row,
    piece,
)
from vico.assets.model import Model, Top
from vico.assets.shapes import Colour, ball, cylinder, lathe

_BREAD: Colour = (198, 146, 84)


def _gondola() -> Model:
    """A supermarket shelf with goods on both sides, used from +x and -x."""
    parts: list[Part] = [(0.04, 2.4, 1.6, 0, 0, 0.8, WHITE), (0.9, 2.4, 0.12, 0, 0, 0.06, DARK)]
    parts += [(0.9, 0.04, 1.5, 0, y, 0.8, GREY) for y in (-1.2, 1.2)]
    for k in range(4):
        z = 0.14 + 0.38 * k
        for side in (-1, 1):
            parts.append((0.4, 2.36, 0.025, 0.22 * side, 0, z, WHITE))
            parts += goods_row(0.24 * side, 0, z + 0.012, 2.2, deep=0.3, high=0.26, shift=k * 2 + side, count=6)
    return piece("gondola", parts, kind="shelf")


def _wall_shelf(name: str, shift: int, count: int, high: float) -> Model:
    parts: list[Part] = [(0.03, 1.8, 2.1, -0.2, 0, 1.05, BIRCH), (0.42, 1.8, 0.12, 0, 0, 0.06, DARK)]
    parts += [(0.4, 0.03, 2.1, 0, y, 1.05, BIRCH) for y in (-0.89, 0.89)]
    for k in range(5):
        z = 0.14 + 0.4 * k
        parts.append((0.38, 1.76, 0.025, 0, 0, z, WHITE))
        parts += goods_row(0.02, 0, z + 0.012, 1.68, deep=0.28, high=high, shift=k + shift, count=count)
    return piece(name, parts, kind="shelf")


def _fridge_display() -> Model:
    """A chilled cabinet with glass doors, lit from within."""
    parts: list[Part] = [
        (0.06, 1.8, 2.0, -0.32, 0, 1.0, WHITE),
        (0.7, 1.8, 0.25, 0, 0, 0.125, DARK),
        (0.7, 1.8, 0.2, 0, 0, 1.95, (62, 96, 132)),
        (0.7, 0.05, 2.0, 0, 0.88, 1.0, GREY),
        (0.7, 0.05, 2.0, 0, -0.88, 1.0, GREY),
    ]
    for k in range(4):
        z = 0.28 + 0.4 * k
        parts.append((0.5, 1.7, 0.02, -0.02, 0, z, GLASS))
        parts += goods_row(0.02, 0, z + 0.01, 1.66, deep=0.3, high=0.27, shift=3 + k, count=7)
    parts += [(0.02, 0.04, 1.6, 0.33, y, 1.05, STEEL) for y in (-0.44, 0.0, 0.44)]
    return piece("fridge_display", parts, kind="fridge")


def _freezer() -> Model:
    parts: list[Part] = [
        (0.95, 1.9, 0.75, 0, 0, 0.375, WHITE),
        (0.8, 1.75, 0.02, 0, 0, 0.76, GLASS),
        (0.97, 1.92, 0.1, 0, 0, 0.2, (62, 96, 132)),
    ]
    parts += goods_row(0.15, 0, 0.66, 1.6, deep=0.25, high=0.12, shift=1, count=6)
    parts += goods_row(-0.15, 0, 0.66, 1.6, deep=0.25, high=0.12, shift=4, count=6)
    return piece("freezer_chest", parts, kind="fridge")


def _checkout() -> Model:
    """A till with a belt; customers pass at +x."""
    return piece(
        "checkout",
        [
            (0.6, 2.2, 0.85, 0, 0, 0.425, (92, 112, 96)),
            (0.64, 2.24, 0.05, 0, 0, 0.875, STEEL),
            (0.44, 1.1, 0.012, 0, -0.45, 0.905, BLACK),
            (0.3, 0.3, 0.1, -0.1, 0.4, 0.95, DARK),
            (0.03, 0.3, 0.24, -0.16, 0.4, 1.14, BLACK),
            (0.01, 0.26, 0.2, -0.14, 0.4, 1.14, SCREEN),
            (0.05, 0.05, 1.1, -0.22, -0.9, 1.45, STEEL),
            (0.06, 0.3, 0.22, -0.22, -0.9, 2.0, YELLOW),
            (0.2, 0.24, 0.12, 0.05, -0.3, 0.97, RED),
            (0.14, 0.14, 0.2, 0.0, -0.62, 1.01, GREEN),
        ],
        kind="counter",
        top=Top("table", 0.9, (0.5, 0.5), (0.0, 0.82)),
    )


def _pastry_case() -> Model:
    """A glass counter with cakes and bread; customers stand at +x."""
    parts: list[Part] = [
        (0.7, 1.6, 0.5, 0, 0, 0.25, WALNUT),
        (0.66, 1.56, 0.02, 0, 0, 0.6, WHITE),
        (0.5, 1.56, 0.02, -0.06, 0, 0.9, WHITE),
        (0.7, 1.6, 0.03, 0, 0, 1.22, OAK),
        (0.02, 1.6, 0.7, -0.34, 0, 0.86, WALNUT),
        (0.68, 0.02, 0.7, 0, 0.79, 0.86, GLASS),
        (0.68, 0.02, 0.7, 0, -0.79, 0.86, GLASS),
    ]
    tones: tuple[Colour, ...] = (_BREAD, (112, 70, 46), (238, 208, 200), (228, 190, 120), (176, 52, 60))
    for k in range(5):
        y = -0.6 + 0.3 * k
        parts += [(0.3, 0.2, 0.09, 0.12, y, 0.66, tones[k]), (0.24, 0.18, 0.08, 0.0, y, 0.95, tones[(k + 2) % 5])]
    return piece("pastry_case", parts, kind="counter", top=Top("table", 1.235, (0.6, 1.5)))


def _bread_shelf() -> Model:
    parts: list[Part] = [
        (0.03, 1.6, 1.9, -0.2, 0, 0.95, OAK),
        (0.4, 0.04, 1.9, 0, 0.78, 0.95, OAK),
        (0.4, 0.04, 1.9, 0, -0.78, 0.95, OAK),
    ]
    loaves = []
    for k in range(4):
        z = 0.4 + 0.4 * k
        parts.append((0.4, 1.54, 0.03, 0, 0, z, BIRCH))
        loaves += [
            ball(
                (0.15, 0.08, 0.07),
                (0.0, -0.55 + 0.275 * j, z + 0.07),
                sides=6,
                rings=4,
                colour=(198 - 14 * ((j + k) % 3), 146 - 14 * ((j + k) % 3), 84),
            )
            for j in range(5)
        ]
    return piece("bread_shelf", parts, *loaves, kind="shelf")


def _bar_counter() -> Model:
    """Guests sit at +x."""
    parts: list[Part] = [
        (0.5, 2.4, 1.0, -0.1, 0, 0.5, (86, 56, 40)),
        (0.7, 2.46, 0.06, 0, 0, 1.06, WALNUT),
        (0.03, 2.4, 0.04, 0.24, 0, 0.2, (188, 154, 84)),
        (0.16, 0.16, 0.34, -0.16, 0.7, 1.26, STEEL),
        (0.06, 0.4, 0.06, -0.16, 0.7, 1.46, STEEL),
    ]
    parts += [(0.02, 0.03, 0.9, 0.155, -1.1 + 0.44 * k, 0.5, (62, 40, 30)) for k in range(6)]
    return piece("bar_counter", parts, kind="counter", top=Top("table", 1.09, (0.6, 1.6), (0.0, -0.3)))


def _back_bar() -> Model:
    """Shelves of bottles behind a bar."""
    parts: list[Part] = [
        (0.4, 2.4, 0.95, 0, 0, 0.475, WALNUT),
        (0.42, 2.44, 0.04, 0, 0, 0.97, DARK),
        (0.03, 2.4, 1.3, -0.18, 0, 1.65, GLASS),
    ]
    bottles = []
    tones: tuple[Colour, ...] = ((44, 84, 52), (148, 92, 40), (196, 204, 196), (92, 34, 40), (60, 88, 124))
    for k in range(3):
        z = 1.0 + 0.42 * k
        if k:
            parts.append((0.2, 2.36, 0.03, -0.08, 0, z, OAK))
        bottles += [
            lathe(
                [(0.045, z + 0.015), (0.045, z + 0.2), (0.016, z + 0.25), (0.016, z + 0.32), (0, z + 0.32)],
                sides=5,
                colour=tones[(j + k) % 5],
                centre=(-0.06, -1.05 + 0.3 * j, 0),
            )
            for j in range(8)
        ]
    return piece("back_bar", parts, *bottles, kind="shelf")


def _bar_stool() -> Model:
    parts = [
        cylinder(0.18, 0.06, sides=9, colour=(120, 62, 44), centre=(0, 0, 0.7)),
        cylinder(0.025, 0.68, sides=6, colour=STEEL, centre=(0, 0, 0.02)),
        cylinder(0.2, 0.025, sides=9, colour=STEEL),
        cylinder(0.14, 0.02, sides=8, colour=STEEL, centre=(0, 0, 0.28)),
    ]
    return piece("bar_stool", [], *parts, kind="stool", top=Top("chair", 0.76, (0.3, 0.3)))


def _booth() -> Model:
    """A cushioned bench for two, used from +x."""
    return piece(
        "booth",
        [
            (0.6, 1.3, 0.4, 0, 0, 0.2, WALNUT),
            (0.56, 1.24, 0.1, 0.02, 0, 0.44, (136, 46, 46)),
            (0.14, 1.3, 0.65, -0.26, 0, 0.8, (120, 40, 40)),
            (0.16, 1.32, 0.05, -0.26, 0, 1.14, WALNUT),
        ],
        kind="sofa",
        top=Top("sofa", 0.49, (0.42, 1.2), (0.05, 0.0)),
    )


def _high_table() -> Model:
    parts = [
        cylinder(0.33, 0.03, sides=14, colour=WALNUT, centre=(0, 0, 1.07)),
        cylinder(0.04, 1.06, sides=6, colour=BLACK, centre=(0, 0, 0.02)),
        cylinder(0.22, 0.03, sides=12, colour=BLACK),
    ]
    return piece("high_table", [], *parts, kind="table", top=Top("table", 1.1, (0.46, 0.46)))


def _menu_board() -> Model:
    parts: list[Part] = [(0.04, 1.8, 0.8, 0, 0, 2.0, OAK), (0.01, 1.7, 0.7, 0.022, 0, 2.0, (44, 52, 48))]
    parts += [
        (0.004, 0.3 + 0.08 * ((k * 7) % 4), 0.035, 0.03, -0.5 + 0.5 * (k % 3), 2.2 - 0.13 * (k // 3), LINEN)
        for k in range(12)
    ]
    return piece("menu_board", parts, kind="sign", solid=False)


def _order_kiosk() -> Model:
    return piece(
        "order_kiosk",
        [
            (0.3, 0.5, 0.06, 0, 0, 0.03, DARK),
            (0.1, 0.3, 0.8, 0, 0, 0.45, WHITE),
            (0.12, 0.55, 1.0, 0, 0, 1.3, BLACK),
            (0.01, 0.48, 0.9, 0.062, 0, 1.32, (214, 120, 60)),
            (0.012, 0.4, 0.3, 0.064, 0, 1.5, YELLOW),
        ],
    )


def _oven() -> Model:
    parts: list[Part] = [(0.8, 0.85, 1.75, 0, 0, 0.9, STEEL)]
    for k in range(3):
        parts += [(0.02, 0.7, 0.4, 0.4, 0, 0.4 + 0.48 * k, BLACK), (0.04, 0.6, 0.03, 0.43, 0, 0.62 + 0.48 * k, STEEL)]
    return piece("oven", parts)


def _steel_sink() -> Model:
    return piece(
        "steel_sink",
        [
            (0.65, 1.4, 0.08, 0, 0, 0.86, STEEL),
            (0.45, 0.5, 0.01, 0.04, -0.33, 0.905, DARK),
            (0.45, 0.5, 0.01, 0.04, 0.33, 0.905, DARK),
            (0.04, 0.04, 0.35, -0.26, 0, 1.07, GREY),
            (0.2, 0.04, 0.04, -0.17, 0, 1.24, GREY),
            (0.6, 1.3, 0.03, 0, 0, 0.25, STEEL),
            *[(0.05, 0.05, 0.84, i, j, 0.42, STEEL) for i in (-0.29, 0.29) for j in (-0.66, 0.66)],
        ],
        kind="sink",
    )


def _store_rack(name: str, tone: Colour, shift: int) -> Model:
    parts: list[Part] = [(0.05, 0.05, 2.0, i, j, 1.0, tone) for i in (-0.22, 0.22) for j in (-0.75, 0.75)]
    for k in range(4):
        z = 0.15 + 0.55 * k
        parts.append((0.5, 1.55, 0.04, 0, 0, z, STEEL))
        if k < 3:
            parts += [
                (
                    0.38,
                    0.36 + 0.05 * ((j + k + shift) % 2),
                    0.28 + 0.06 * ((j + k) % 3),
                    0,
                    -0.5 + 0.5 * j,
                    z + 0.19,
                    (186, 144 + 6 * ((j + k) % 3), 96),
                )
                for j in range(3)
            ]
    return piece(name, parts, kind="shelf")


def _shoe_wall() -> Model:
    parts: list[Part] = [(0.03, 1.8, 2.1, -0.15, 0, 1.05, LINEN)]
    for k in range(5):
        z = 0.3 + 0.38 * k
        parts.append((0.28, 1.78, 0.025, 0, 0, z, BIRCH))
        for j in range(5):
            tone = GOODS_COLOURS[(j * 2 + k) % 7]
            y = -0.7 + 0.35 * j
            parts += [(0.25, 0.085, 0.05, 0, y, z + 0.04, tone), (0.11, 0.08, 0.07, -0.06, y, z + 0.09, tone)]
    return piece("shoe_wall", parts, kind="shelf")


def _mannequin(name: str, cloth: Colour, skirt: Colour) -> Model:
    skin: Colour = (222, 206, 186)
    parts = [
        cylinder(0.2, 0.02, sides=10, colour=STEEL),
        ball((0.085, 0.075, 0.115), (0, 0, 1.62), colour=skin, sides=8, rings=6),
        cylinder(0.04, 0.12, sides=6, colour=skin, centre=(0, 0, 1.45)),
        lathe([(0.0, 0.95), (0.15, 0.95), (0.13, 1.15), (0.17, 1.4), (0.06, 1.48), (0, 1.48)], sides=9, colour=cloth),
        lathe([(0.2, 0.45), (0.2, 0.45), (0.15, 0.97), (0, 0.97)], sides=9, colour=skirt),
    ]
    rows: list[Part] = [(0.08, 0.07, 0.44, 0, y, 0.24, skin) for y in (-0.08, 0.08)]
    rows += [(0.07, 0.07, 0.55, 0, y, 1.14, cloth) for y in (-0.21, 0.21)]
    return piece(name, rows, *parts, kind="mannequin")


def _fitting_booth() -> Model:
    return piece(
        "fitting_booth",
        [
            (1.0, 0.05, 2.1, 0, 0.52, 1.05, BIRCH),
            (1.0, 0.05, 2.1, 0, -0.52, 1.05, BIRCH),
            (0.05, 1.0, 2.1, -0.48, 0, 1.05, BIRCH),
            (0.03, 0.55, 1.85, 0.47, 0.22, 1.1, (146, 52, 60)),
            (0.04, 1.04, 0.05, 0.47, 0, 2.08, STEEL),
            (0.01, 0.5, 1.5, -0.45, 0, 1.2, GLASS),
        ],
    )


def _produce() -> Model:
    """Sloping crates of fruit and vegetables, used from +x."""
    parts: list[Part] = [(0.9, 1.8, 0.5, 0, 0, 0.25, (92, 74, 52))]
    fruit = []
    tones: tuple[Colour, ...] = (
        (196, 44, 40),
        (226, 132, 36),
        (116, 164, 56),
        (232, 204, 70),
        (120, 60, 110),
        (210, 96, 60),
    )
    for k in range(2):
        for j in range(3):
            x, y, z = 0.22 - 0.44 * k, -0.6 + 0.6 * j, 0.55 + 0.2 * k
            parts.append((0.42, 0.56, 0.12, x, y, z, OAK))
            fruit += [
                ball((0.07, 0.07, 0.06), (x + dx, y + dy, z + 0.07), sides=5, rings=3, colour=tones[(3 * k + j) % 6])
                for dx in (-0.11, 0.09)
                for dy in (-0.17, 0.0, 0.17)
            ]
    parts.append((0.44, 1.76, 0.2, -0.22, 0, 0.58, (92, 74, 52)))
    return piece("produce_stand", parts, *fruit, kind="shelf")


def _flowers() -> Model:
    pots, heads = [], []
    tones: tuple[Colour, ...] = (
        (204, 60, 80),
        (236, 196, 60),
        (226, 150, 186),
        (240, 240, 236),
        (124, 92, 168),
        (230, 120, 60),
    )
    for k in range(2):
        for j in range(3):
            x, y, z = 0.2 - 0.4 * k, -0.45 + 0.45 * j, 0.3 * k
            pots.append(lathe([(0.12, z), (0.16, z + 0.32), (0, z + 0.3)], sides=8, colour=DARK, centre=(x, y, 0)))
            pots.append(
                lathe([(0.03, z + 0.3), (0.17, z + 0.55), (0, z + 0.6)], sides=7, colour=LEAF, centre=(x, y, 0))
            )
            heads += [
                ball((0.06, 0.06, 0.05), (x + dx, y + dy, z + 0.62), sides=5, rings=3, colour=tones[(3 * k + j) % 6])
                for dx, dy in ((0.08, 0), (-0.06, 0.07), (-0.05, -0.07), (0, 0))
            ]
    return piece("flower_stand", [(0.4, 1.4, 0.3, -0.2, 0, 0.15, OAK)], *pots, *heads, kind="plant")


def _vending() -> Model:
    parts: list[Part] = [
        (0.8, 0.95, 1.85, 0, 0, 0.925, (176, 48, 44)),
        (0.02, 0.6, 1.2, 0.4, -0.12, 1.15, (30, 38, 48)),
        (0.02, 0.2, 0.4, 0.405, 0.36, 1.3, DARK),
        (0.02, 0.6, 0.2, 0.405, -0.12, 0.3, BLACK),
    ]
    for k in range(4):
        parts += goods_row(0.41, -0.12, 0.62 + 0.28 * k, 0.54, deep=0.02, high=0.2, shift=k, count=5)
    return piece("vending_machine", parts)


def _atm() -> Model:
    return piece(
        "cash_machine",
        [
            (0.55, 0.6, 1.5, 0, 0, 0.75, (52, 84, 130)),
            (0.02, 0.4, 0.3, 0.28, 0, 1.25, SCREEN),
            (0.12, 0.4, 0.03, 0.32, 0, 1.0, STEEL),
            (0.02, 0.3, 0.03, 0.285, 0, 0.85, BLACK),
            (0.02, 0.56, 0.12, 0.28, 0, 1.43, WHITE),
        ],
    )


def _jewel_case() -> Model:
    parts: list[Part] = [
        (0.55, 1.3, 0.85, 0, 0, 0.425, (64, 50, 46)),
        (0.5, 1.25, 0.02, 0, 0, 0.86, (40, 54, 84)),
        (0.55, 1.3, 0.02, 0, 0, 1.03, GLASS),
    ]
    parts += [(0.03, 0.03, 0.16, i, j, 0.94, STEEL) for i in (-0.26, 0.26) for j in (-0.63, 0.63)]
    parts += [
        (0.07, 0.07, 0.04, 0.1 - 0.2 * (k % 2), -0.48 + 0.2 * k, 0.89, (214, 184, 96) if k % 2 else (220, 224, 230))
        for k in range(6)
    ]
    return piece("jewel_case", parts, kind="counter", top=Top("table", 1.04, (0.5, 1.2)))


def _barber_chair() -> Model:
    return piece(
        "barber_chair",
        [
            (0.55, 0.55, 0.12, 0, 0, 0.52, BLACK),
            (0.1, 0.52, 0.6, -0.26, 0, 0.86, BLACK),
            (0.5, 0.07, 0.05, 0, 0.3, 0.72, STEEL),
            (0.5, 0.07, 0.05, 0, -0.3, 0.72, STEEL),
            (0.3, 0.4, 0.04, 0.36, 0, 0.24, STEEL),
            (0.12, 0.12, 0.45, 0, 0, 0.25, STEEL),
        ],
        cylinder(0.28, 0.03, sides=12, colour=STEEL),
        kind="chair",
        top=Top("chair", 0.58, (0.5, 0.5)),
    )


def _salon_mirror() -> Model:
    return piece(
        "salon_mirror",
        [
            (0.3, 1.0, 0.04, 0, 0, 0.8, WALNUT),
            (0.03, 0.8, 1.2, -0.13, 0, 1.5, GLASS),
            (0.04, 0.9, 0.05, -0.13, 0, 2.13, OAK),
            (0.25, 0.06, 0.8, -0.02, 0.4, 0.4, WALNUT),
            (0.25, 0.06, 0.8, -0.02, -0.4, 0.4, WALNUT),
        ],
        cylinder(0.03, 0.2, sides=7, colour=TEAL, centre=(0, 0.3, 0.82)),
        cylinder(0.025, 0.15, sides=7, colour=RED, centre=(0.02, 0.2, 0.82)),
    )


def _sewing_bench() -> Model:
    return piece(
        "repair_bench",
        [
            (0.65, 1.6, 0.05, 0, 0, 0.88, OAK),
            (0.6, 0.5, 0.8, 0, 0.5, 0.44, WALNUT),
            (0.06, 0.06, 0.86, 0.27, -0.74, 0.43, OAK),
            (0.06, 0.06, 0.86, -0.27, -0.74, 0.43, OAK),
            (0.03, 1.5, 0.7, -0.3, 0, 1.4, BIRCH),
            (0.03, 0.06, 0.4, -0.27, -0.5, 1.4, STEEL),
            (0.03, 0.05, 0.3, -0.27, -0.3, 1.4, RED),
            (0.03, 0.12, 0.3, -0.27, -0.05, 1.45, DARK),
            (0.03, 0.06, 0.36, -0.27, 0.25, 1.4, STEEL),
        ],
        top=Top("table", 0.905, (0.5, 1.0), (0.05, -0.2)),
    )


def _electronics() -> Model:
    parts: list[Part] = [(0.8, 1.8, 0.05, 0, 0, 0.9, WHITE), (0.6, 1.5, 0.86, 0, 0, 0.43, BIRCH)]
    for k in range(4):
        y = -0.66 + 0.44 * k
        parts += [
            (0.02, 0.26, 0.18, -0.12, y, 1.05, BLACK),
            (0.005, 0.24, 0.16, -0.108, y, 1.05, SCREEN),
            (0.15, 0.26, 0.015, 0.0, y, 0.935, GREY),
        ]
    return piece("gadget_table", parts, kind="table", top=Top("table", 0.925, (0.3, 1.7), (0.24, 0.0)))


def _newsstand() -> Model:
    parts: list[Part] = [(0.35, 1.4, 1.7, -0.06, 0, 0.85, DARK)]
    for k in range(4):
        for j in range(4):
            tone = GOODS_COLOURS[(k * 3 + j) % 7]
            parts += [
                (0.02, 0.26, 0.34, 0.12 + 0.03 * (3 - k), -0.49 + 0.33 * j, 0.3 + 0.42 * k, tone),
                (0.022, 0.2, 0.08, 0.122 + 0.03 * (3 - k), -0.49 + 0.33 * j, 0.4 + 0.42 * k, CREAM),
            ]
    return piece("newsstand", parts, kind="shelf")


def shop_models() -> list[Model]:
    """Models for shops and for places that serve food and drink."""
    return [
        _gondola(),
        _wall_shelf("pharmacy_shelf", 0, 10, 0.16),
        _wall_shelf("wine_shelf", 3, 9, 0.3),
        _wall_shelf("toy_shelf", 5, 5, 0.28),
        _fridge_display(),
        _freezer(),
        _checkout(),
        _pastry_case(),
        _bread_shelf(),
        _bar_counter(),
        _back_bar(),
        _bar_stool(),
        _booth(),
        _high_table(),
        _menu_board(),
        _order_kiosk(),
        _oven(),
        _steel_sink(),
        _store_rack("store_rack", STEEL, 0),
        _store_rack("pallet_rack", (62, 96, 152), 1),
        _shoe_wall(),
        _mannequin("mannequin", RED, DARK),
        _mannequin("mannequin_blue", TEAL, LINEN),
        _fitting_booth(),
        _produce(),
        _flowers(),
        _vending(),
        _atm(),
        _jewel_case(),
        _barber_chair(),
        _salon_mirror(),
        _sewing_bench(),
        _electronics(),
        _newsstand(),
    ]
