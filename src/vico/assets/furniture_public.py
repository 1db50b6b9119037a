"""Furniture of offices, schools, clinics, churches, cinemas, gyms, museums, workshops, stations and garages."""

from __future__ import annotations

from vico.assets.furniture_parts import (
    BIRCH,
    BLACK,
    BLUE,
    CREAM,
    DARK,
    GLASS,
    GREEN,
    GREY,
    LINEN,
    OAK,
    RED,
    SCREEN,
    STEEL,
    STONE,
    TEAL,
    WALNUT,
    WHITE,
    YELLOW,
    Part,
    legs,
    lying,
    piece,
)
from vico.assets.model import Model, Top
from vico.assets.shapes import Colour, ball, cylinder, extrusion, lathe
from vico.world.model import LANDING

_GOLD: Colour = (204, 168, 84)
#: Height from one floor of a place to the next, and the plan of a stairs room, metres.
RISE = 3.2
STAIRS = (4.5, 2.5)


def _seats(name: str, count: int, pitch: float, cloth: Colour, top: bool) -> Model:
    """A row of tip-up seats, used from +x."""
    parts: list[Part] = []
    wide = count * pitch
    for k in range(count):
        y = -wide / 2 + pitch * (k + 0.5)
        parts += [(0.45, pitch - 0.1, 0.1, 0.04, y, 0.44, cloth), (0.1, pitch - 0.08, 0.6, -0.24, y, 0.75, cloth)]
    parts += [(0.46, 0.06, 0.62, 0, -wide / 2 + pitch * k, 0.31, BLACK) for k in range(count + 1)]
    return piece(name, parts, kind="chair", top=Top("chair", 0.49, (0.36, wide - 0.2), (0.05, 0.0)) if top else None)


def _screen() -> Model:
    return piece(
        "cinema_screen",
        [
            (0.1, 5.0, 2.3, 0, 0, 1.75, BLACK),
            (0.02, 4.8, 2.1, 0.055, 0, 1.75, (206, 214, 224)),
            (0.01, 4.8, 0.9, 0.068, 0, 1.2, (74, 98, 92)),
            (0.012, 1.2, 0.9, 0.07, 1.0, 1.6, (196, 150, 110)),
            (0.3, 0.5, 1.0, 0.05, 2.75, 0.5, BLACK),
            (0.3, 0.5, 1.0, 0.05, -2.75, 0.5, BLACK),
        ],
        kind="screen",
    )


def _altar() -> Model:
    candles = [cylinder(0.03, 0.3, sides=7, colour=LINEN, centre=(0, y, 1.03)) for y in (-0.9, 0.9)]
    return piece(
        "altar",
        [
            (1.6, 3.2, 0.16, 0, 0, 0.08, STONE),
            (0.7, 2.0, 0.85, 0, 0, 0.55, STONE),
            (0.85, 2.3, 0.06, 0, 0, 1.0, WHITE),
            (0.01, 1.2, 0.7, 0.43, 0, 0.65, (150, 40, 48)),
            (0.05, 0.06, 0.55, -0.2, 0, 1.3, _GOLD),
            (0.05, 0.34, 0.06, -0.2, 0, 1.4, _GOLD),
        ],
        *candles,
        top=Top("table", 1.03, (0.5, 1.2), (0.1, 0.0)),
    )


def _pulpit() -> Model:
    return piece(
        "pulpit",
        [
            (0.8, 0.8, 1.2, 0, 0, 0.6, WALNUT),
            (0.9, 0.9, 0.06, 0, 0, 1.23, OAK),
            (0.3, 0.4, 0.04, 0.1, 0, 1.3, RED),
            (0.012, 0.5, 0.8, 0.405, 0, 0.62, OAK),
        ],
    )


def _font() -> Model:
    return piece(
        "font",
        [],
        lathe(
            [(0.3, 0), (0.3, 0.06), (0.12, 0.14), (0.12, 0.6), (0.36, 0.85), (0.36, 0.95), (0.3, 0.94), (0, 0.88)],
            sides=10,
            colour=STONE,
        ),
    )


def _organ() -> Model:
    parts: list[Part] = [
        (0.8, 2.6, 1.0, 0, 0, 0.5, WALNUT),
        (0.5, 2.8, 0.2, -0.1, 0, 1.1, OAK),
        (0.25, 1.2, 0.06, 0.45, 0, 0.78, WHITE),
    ]
    pipes = [
        cylinder(0.07, 1.2 + 0.1 * abs(k - 6), sides=6, colour=(196, 200, 204), centre=(-0.1, -1.14 + 0.19 * k, 1.2))
        for k in range(13)
    ]
    return piece("organ", parts, *pipes)


def _cross() -> Model:
    return piece(
        "wall_cross", [(0.08, 0.16, 2.6, 0, 0, 3.4, WALNUT), (0.08, 1.4, 0.16, 0, 0, 4.0, WALNUT)], solid=False
    )


def _stained() -> Model:
    """A tall window of coloured glass."""
    parts: list[Part] = [(0.06, 1.3, 3.6, 0, 0, 3.2, DARK)]
    tones: tuple[Colour, ...] = ((70, 120, 196), (214, 70, 60), (236, 196, 80), (88, 160, 104), (150, 100, 176))
    for k in range(6):
        parts += [(0.02, 0.54, 0.5, 0.03, y, 1.75 + 0.57 * k, tones[(k + (y > 0)) % 5]) for y in (-0.3, 0.3)]
    return piece("stained_glass", parts, kind="window", solid=False)


def _school_desk() -> Model:
    return piece(
        "school_desk",
        [(0.55, 1.2, 0.03, 0, 0, 0.735, BIRCH), (0.4, 1.1, 0.02, 0, 0, 0.6, GREY)],
        *legs(0.5, 1.14, 0.72, STEEL, 0.035),
        kind="desk",
        top=Top("desk", 0.75, (0.5, 1.15)),
    )


def _board(name: str, colour: Colour, mark: Colour) -> Model:
    parts: list[Part] = [
        (0.03, 2.6, 1.2, 0, 0, 1.55, OAK),
        (0.01, 2.5, 1.1, 0.018, 0, 1.55, colour),
        (0.08, 2.4, 0.03, 0.05, 0, 0.95, OAK),
    ]
    parts += [(0.004, 0.3 + 0.1 * (k % 3), 0.03, 0.026, -0.8 + 0.25 * (k % 3), 1.9 - 0.12 * k, mark) for k in range(5)]
    parts += [(0.004, 0.03, 0.5, 0.026, 0.5, 1.55, mark), (0.004, 0.5, 0.03, 0.026, 0.72, 1.35, mark)]
    return piece(name, parts, kind="board", solid=False)


def _reception() -> Model:
    """Visitors stand at +x."""
    return piece(
        "reception_desk",
        [
            (0.3, 2.6, 1.05, 0.3, 0, 0.525, OAK),
            (0.4, 2.7, 0.05, 0.3, 0, 1.08, WHITE),
            (0.6, 2.4, 0.04, -0.15, 0, 0.73, BIRCH),
            (0.6, 0.05, 0.72, -0.15, 1.2, 0.36, OAK),
            (0.6, 0.05, 0.72, -0.15, -1.2, 0.36, OAK),
            (0.03, 0.5, 0.34, -0.02, 0.5, 0.98, BLACK),
            (0.006, 0.46, 0.3, -0.038, 0.5, 0.98, SCREEN),
            (0.012, 1.6, 0.3, 0.456, 0, 0.6, TEAL),
        ],
        kind="counter",
        top=Top("table", 1.105, (0.36, 2.4), (0.3, 0.0)),
    )


def _conference() -> Model:
    return piece(
        "conference_table",
        [
            (1.1, 3.0, 0.05, 0, 0, 0.725, WALNUT),
            (0.5, 0.1, 0.7, 0, 1.1, 0.35, DARK),
            (0.5, 0.1, 0.7, 0, -1.1, 0.35, DARK),
            (0.2, 0.2, 0.03, 0, 0, 0.76, BLACK),
        ],
        kind="table",
        top=Top("table", 0.75, (1.0, 1.2), (0.0, -0.85)),
    )


def _copier() -> Model:
    return piece(
        "photocopier",
        [
            (0.6, 0.65, 0.9, 0, 0, 0.5, (214, 214, 210)),
            (0.62, 0.68, 0.14, 0, 0, 1.02, DARK),
            (0.1, 0.4, 0.05, 0.32, 0.0, 0.8, WHITE),
            (0.02, 0.3, 0.2, 0.3, 0.1, 1.15, SCREEN),
            (0.01, 0.56, 0.2, 0.302, 0, 0.3, GREY),
        ],
    )


def _cooler() -> Model:
    bottle = lathe([(0.06, 1.0), (0.14, 1.08), (0.14, 1.36), (0, 1.38)], sides=9, colour=(160, 196, 220))
    return piece("water_cooler", [(0.32, 0.32, 1.0, 0, 0, 0.5, WHITE), (0.06, 0.2, 0.2, 0.14, 0, 0.75, GREY)], bottle)


def _hospital_bed() -> Model:
    """Head at -x."""
    return piece(
        "hospital_bed",
        [
            (2.0, 0.9, 0.12, 0, 0, 0.45, STEEL),
            (1.95, 0.86, 0.14, 0, 0, 0.57, WHITE),
            (1.3, 0.9, 0.05, 0.3, 0, 0.655, (150, 196, 206)),
            (0.4, 0.6, 0.1, -0.75, 0, 0.68, LINEN),
            (0.05, 0.9, 0.5, -1.0, 0, 0.75, CREAM),
            (0.05, 0.9, 0.3, 1.0, 0, 0.65, CREAM),
            (1.0, 0.03, 0.04, 0, 0.46, 0.85, STEEL),
            (1.0, 0.03, 0.04, 0, -0.46, 0.85, STEEL),
            *[(0.08, 0.08, 0.4, i, j, 0.2, GREY) for i in (-0.8, 0.8) for j in (-0.35, 0.35)],
        ],
        kind="bed",
        top=Top("bed", 0.68, (1.2, 0.8), (0.3, 0.0)),
    )


def _couch() -> Model:
    return piece(
        "exam_couch",
        [
            (1.9, 0.65, 0.1, 0, 0, 0.65, TEAL),
            (0.5, 0.65, 0.08, -0.72, 0, 0.74, TEAL),
            (1.8, 0.05, 0.02, 0, 0, 0.705, WHITE),
            (0.1, 0.5, 0.6, 0.6, 0, 0.3, STEEL),
            (0.1, 0.5, 0.6, -0.6, 0, 0.3, STEEL),
        ],
        kind="bed",
        top=Top("bed", 0.71, (1.2, 0.55), (0.3, 0.0)),
    )


def _cabinet(name: str, colour: Colour, door: Colour) -> Model:
    return piece(
        name,
        [
            (0.45, 0.9, 1.8, 0, 0, 0.9, colour),
            (0.012, 0.42, 0.85, 0.228, 0.22, 1.3, door),
            (0.012, 0.42, 0.85, 0.228, -0.22, 1.3, door),
            (0.012, 0.42, 0.75, 0.228, 0.22, 0.45, colour),
            (0.02, 0.02, 0.12, 0.24, 0.04, 1.2, STEEL),
            (0.02, 0.02, 0.12, 0.24, -0.04, 1.2, STEEL),
        ],
        kind="cabinet",
    )


def _waiting_bench() -> Model:
    parts: list[Part] = [(0.06, 1.9, 0.06, -0.05, 0, 0.36, STEEL)]
    for k in range(3):
        y = -0.62 + 0.62 * k
        parts += [(0.45, 0.54, 0.05, 0, y, 0.43, BLUE), (0.05, 0.54, 0.42, -0.22, y, 0.68, BLUE)]
    parts += [(0.5, 0.06, 0.04, 0, y, 0.02, STEEL) for y in (-0.7, 0.7)] + [
        (0.05, 0.05, 0.36, 0, y, 0.18, STEEL) for y in (-0.7, 0.7)
    ]
    return piece("waiting_bench", parts, kind="bench", top=Top("chair", 0.46, (0.4, 1.8)))


def _bike() -> Model:
    wheel = cylinder(0.22, 0.06, sides=12, colour=DARK).moved(lying(0.35, -0.03, 0.35))
    return piece(
        "exercise_bike",
        [
            (1.1, 0.08, 0.06, 0, 0, 0.06, BLACK),
            (0.06, 0.45, 0.05, 0.5, 0, 0.03, BLACK),
            (0.06, 0.45, 0.05, -0.5, 0, 0.03, BLACK),
            (0.06, 0.06, 0.75, -0.25, 0, 0.45, STEEL),
            (0.24, 0.16, 0.06, -0.25, 0, 0.86, BLACK),
            (0.06, 0.06, 0.95, 0.35, 0, 0.55, STEEL),
            (0.06, 0.45, 0.04, 0.35, 0, 1.05, BLACK),
            (0.03, 0.2, 0.14, 0.4, 0, 1.18, SCREEN),
        ],
        wheel,
    )


def _bench_press() -> Model:
    discs = [cylinder(0.2, 0.06, sides=12, colour=BLACK).moved(lying(-0.5, y, 1.05)) for y in (-0.75, 0.69)]
    return piece(
        "bench_press",
        [
            (1.25, 0.3, 0.1, 0, 0, 0.42, RED),
            (0.08, 0.4, 0.36, 0.45, 0, 0.18, STEEL),
            (0.08, 0.4, 0.36, -0.45, 0, 0.18, STEEL),
            (0.06, 0.06, 1.1, -0.55, 0.4, 0.55, BLACK),
            (0.06, 0.06, 1.1, -0.55, -0.4, 0.55, BLACK),
            (0.03, 1.7, 0.03, -0.5, 0, 1.05, STEEL),
        ],
        *discs,
    )


def _dumbbells() -> Model:
    parts: list[Part] = [(0.5, 0.06, 0.9, 0, y, 0.45, BLACK) for y in (-0.85, 0.85)]
    for k in range(3):
        z = 0.25 + 0.3 * k
        parts.append((0.3, 1.7, 0.03, 0.08 - 0.08 * k, 0, z, STEEL))
        parts += [
            (0.24, 0.1 + 0.02 * (j % 3), 0.12, 0.08 - 0.08 * k, -0.65 + 0.26 * j, z + 0.075, DARK) for j in range(6)
        ]
    return piece("dumbbell_rack", parts)


def _lockers() -> Model:
    parts: list[Part] = [(0.5, 1.2, 1.9, 0, 0, 0.95, (96, 124, 146))]
    parts += [
        (0.012, 0.36, 0.86, 0.252, -0.4 + 0.4 * k, 0.52 + 0.92 * j, (118, 150, 174)) for k in range(3) for j in range(2)
    ]
    parts += [(0.02, 0.03, 0.08, 0.262, -0.27 + 0.4 * k, 0.55 + 0.92 * j, BLACK) for k in range(3) for j in range(2)]
    return piece("lockers", parts, kind="cabinet")


def _gym_mirror() -> Model:
    return piece(
        "mirror_wall",
        [
            (0.02, 3.0, 1.9, 0, 0, 1.15, GLASS),
            (0.03, 3.04, 0.04, 0, 0, 2.12, STEEL),
            (0.03, 3.04, 0.04, 0, 0, 0.18, STEEL),
        ],
        kind="mirror",
        solid=False,
    )


def _yoga() -> Model:
    return piece("yoga_mat", [(1.8, 0.6, 0.012, 0, 0, 0.006, (120, 90, 150))], kind="mat", solid=False)


def _pool_table() -> Model:
    return piece(
        "pool_table",
        [
            (1.3, 2.4, 0.18, 0, 0, 0.74, WALNUT),
            (1.06, 2.16, 0.02, 0, 0, 0.835, (44, 116, 78)),
            *[(0.16, 0.16, 0.66, i, j, 0.33, WALNUT) for i in (-0.5, 0.5) for j in (-1.0, 1.0)],
        ],
        *[
            ball((0.03, 0.03, 0.03), (0.1 * (k % 3) - 0.1, 0.5 + 0.1 * (k // 3), 0.87), sides=6, rings=4, colour=c)
            for k, c in enumerate((RED, YELLOW, BLUE, GREEN, BLACK, WHITE))
        ],
    )


def _slot_machine() -> Model:
    return piece(
        "slot_machine",
        [
            (0.6, 0.6, 1.0, 0, 0, 0.5, DARK),
            (0.4, 0.6, 0.8, -0.1, 0, 1.4, (140, 40, 110)),
            (0.02, 0.46, 0.4, 0.11, 0, 1.35, (236, 200, 90)),
            (0.022, 0.12, 0.16, 0.112, 0, 1.35, WHITE),
            (0.2, 0.5, 0.06, 0.15, 0, 1.03, STEEL),
            (0.04, 0.04, 0.3, 0.0, 0.34, 1.2, RED),
        ],
    )


def _dj() -> Model:
    return piece(
        "dj_booth",
        [
            (0.8, 2.0, 1.0, 0, 0, 0.5, BLACK),
            (0.02, 1.8, 0.8, 0.41, 0, 0.5, (120, 50, 150)),
            (0.5, 0.5, 0.08, -0.05, 0.55, 1.04, DARK),
            (0.5, 0.5, 0.08, -0.05, -0.55, 1.04, DARK),
            (0.4, 0.3, 0.08, -0.05, 0, 1.04, STEEL),
            (0.5, 0.5, 1.6, -0.1, 1.4, 0.8, BLACK),
            (0.5, 0.5, 1.6, -0.1, -1.4, 0.8, BLACK),
        ],
        *[cylinder(0.17, 0.02, sides=12, colour=GREY, centre=(-0.05, y, 1.08)) for y in (-0.55, 0.55)],
    )


def _sculpture() -> Model:
    return piece(
        "sculpture",
        [(0.7, 0.7, 0.6, 0, 0, 0.3, WHITE)],
        lathe(
            [(0.2, 0.6), (0.12, 0.8), (0.26, 1.15), (0.1, 1.4), (0.16, 1.6), (0, 1.75)],
            sides=10,
            colour=(168, 158, 146),
        ),
    )


def _large_painting(name: str, tones: tuple[Colour, ...]) -> Model:
    parts: list[Part] = [(0.05, 2.0, 1.4, 0, 0, 1.6, _GOLD), (0.01, 1.84, 1.24, 0.026, 0, 1.6, tones[0])]
    parts += [
        (0.006, 1.84, 0.45, 0.033, 0, 1.22, tones[1]),
        (0.006, 0.7, 0.5, 0.038, -0.4, 1.6, tones[2]),
        (0.006, 0.3, 0.3, 0.04, 0.5, 1.9, tones[3]),
    ]
    return piece(name, parts, kind="painting", solid=False)


def _vitrine() -> Model:
    parts: list[Part] = [
        (0.7, 1.5, 0.8, 0, 0, 0.4, DARK),
        (0.66, 1.46, 0.02, 0, 0, 0.81, LINEN),
        (0.7, 1.5, 0.03, 0, 0, 1.15, GLASS),
    ]
    parts += [(0.03, 0.03, 0.34, i, j, 0.98, STEEL) for i in (-0.33, 0.33) for j in (-0.73, 0.73)]
    pots = [
        lathe([(0.05, 0.82), (0.09, 0.9), (0.04, 1.0), (0, 1.0)], sides=8, colour=c, centre=(0, y, 0))
        for y, c in ((-0.45, (172, 96, 60)), (0.0, (92, 110, 96)), (0.45, (190, 160, 96)))
    ]
    return piece("display_case", parts, *pots, kind="display")


def _rope() -> Model:
    posts = [cylinder(0.03, 0.95, sides=7, colour=_GOLD, centre=(0, y, 0)) for y in (-0.75, 0.75)] + [
        cylinder(0.14, 0.03, sides=9, colour=_GOLD, centre=(0, y, 0)) for y in (-0.75, 0.75)
    ]
    return piece("rope_barrier", [(0.04, 1.5, 0.05, 0, 0, 0.82, (140, 30, 40))], *posts)


def _workbench() -> Model:
    return piece(
        "workbench",
        [
            (0.75, 2.0, 0.08, 0, 0, 0.9, OAK),
            *[(0.1, 0.1, 0.86, i, j, 0.43, WALNUT) for i in (-0.3, 0.3) for j in (-0.9, 0.9)],
            (0.68, 1.8, 0.04, 0, 0, 0.25, OAK),
            (0.2, 0.24, 0.2, 0.2, 0.8, 1.04, (70, 96, 130)),
            (0.3, 0.4, 0.2, 0, -0.5, 0.37, RED),
        ],
        kind="table",
        top=Top("table", 0.94, (0.65, 1.4), (0.0, -0.2)),
    )


def _lathe() -> Model:
    return piece(
        "machine_tool",
        [
            (0.8, 1.9, 0.7, 0, 0, 0.35, (74, 110, 96)),
            (0.6, 0.5, 0.7, 0, 0.65, 1.05, (84, 124, 108)),
            (0.5, 1.3, 0.16, 0, -0.2, 0.78, STEEL),
            (0.3, 0.3, 0.4, 0, -0.7, 1.0, (84, 124, 108)),
            (0.1, 0.9, 0.1, 0, 0.0, 1.1, STEEL),
            (0.02, 0.3, 0.3, 0.31, 0.65, 1.2, BLACK),
            (0.06, 0.06, 0.06, 0.34, 0.55, 0.95, RED),
        ],
    )


def _pallet() -> Model:
    parts: list[Part] = [(0.8, 1.2, 0.14, 0, 0, 0.07, (172, 134, 88))]
    parts += [
        (0.37, 0.37, 0.34, -0.2 + 0.4 * (k % 2), -0.39 + 0.39 * (k // 2), 0.31, (190, 150, 100)) for k in range(6)
    ]
    parts += [(0.37, 0.37, 0.34, -0.2 + 0.4 * (k % 2), -0.2 + 0.39 * (k // 2), 0.65, (182, 142, 94)) for k in range(3)]
    return piece("pallet", parts)


def _car(name: str, paint: Colour) -> Model:
    side = [(-2.15, 0.3), (2.15, 0.3), (2.15, 0.7), (1.2, 0.88), (-2.1, 0.92)]
    cabin = [(-1.9, 0.9), (1.05, 0.86), (0.45, 1.42), (-1.45, 1.42)]
    body = extrusion(side, 1.76, colour=paint)
    top = extrusion(cabin, 1.56, colour=(54, 64, 74))
    wheels = [
        cylinder(0.32, 0.22, sides=12, colour=BLACK).moved(lying(x, y - 0.11, 0.32))
        for x in (-1.35, 1.35)
        for y in (-0.78, 0.78)
    ]
    return piece(
        name,
        [
            (1.3, 1.4, 0.04, -0.5, 0, 1.43, paint),
            (0.04, 0.4, 0.12, 2.15, 0.6, 0.62, WHITE),
            (0.04, 0.4, 0.12, 2.15, -0.6, 0.62, WHITE),
            (0.04, 0.4, 0.12, -2.15, 0.6, 0.7, RED),
            (0.04, 0.4, 0.12, -2.15, -0.6, 0.7, RED),
        ],
        body,
        top,
        *wheels,
        kind="car",
    )


def _pillar() -> Model:
    return piece(
        "pillar",
        [
            (0.4, 0.4, 2.7, 0, 0, 1.35, STONE),
            (0.42, 0.42, 0.5, 0, 0, 1.0, YELLOW),
            (0.43, 0.43, 0.12, 0, 0, 1.0, BLACK),
        ],
    )


def _church_pillar() -> Model:
    return piece(
        "column",
        [(0.7, 0.7, 0.3, 0, 0, 0.15, STONE), (0.7, 0.7, 0.3, 0, 0, 4.65, STONE)],
        cylinder(0.26, 4.3, sides=12, colour=(206, 198, 184), centre=(0, 0, 0.3)),
    )


def _turnstile() -> Model:
    return piece(
        "turnstile",
        [
            (1.2, 0.25, 1.0, 0, 0, 0.5, STEEL),
            (0.1, 0.12, 0.02, 0.4, 0, 1.01, (80, 180, 110)),
            (0.05, 0.55, 0.3, 0, 0.38, 0.85, GLASS),
        ],
    )


def _ticket_machine() -> Model:
    return piece(
        "ticket_machine",
        [
            (0.5, 0.7, 1.7, 0, 0, 0.85, (58, 108, 96)),
            (0.02, 0.45, 0.4, 0.255, 0, 1.3, SCREEN),
            (0.02, 0.5, 0.16, 0.255, 0, 0.9, DARK),
            (0.02, 0.6, 0.14, 0.255, 0, 1.6, YELLOW),
        ],
    )


def _timetable() -> Model:
    parts: list[Part] = [(0.1, 2.4, 0.9, 0, 0, 2.1, BLACK)]
    parts += [(0.01, 2.2, 0.07, 0.055, 0, 2.42 - 0.12 * k, (236, 188, 70) if k else WHITE) for k in range(6)]
    return piece("departures_board", parts, kind="sign", solid=False)


def _flag() -> Model:
    return piece(
        "flag_stand",
        [(0.04, 0.5, 0.8, 0.05, 0.2, 1.6, WHITE), (0.042, 0.5, 0.2, 0.05, 0.2, 1.6, BLUE)],
        cylinder(0.2, 0.03, sides=10, colour=_GOLD),
        cylinder(0.02, 2.1, sides=6, colour=OAK),
    )


def _double_bookcase() -> Model:
    parts: list[Part] = [
        (0.6, 2.0, 0.1, 0, 0, 0.05, OAK),
        (0.03, 2.0, 1.9, 0, 0, 0.95, OAK),
        (0.62, 0.04, 1.9, 0, 0.99, 0.95, OAK),
        (0.62, 0.04, 1.9, 0, -0.99, 0.95, OAK),
        (0.62, 2.0, 0.04, 0, 0, 1.88, OAK),
    ]
    tones: tuple[Colour, ...] = ((140, 54, 48), (52, 82, 112), (196, 168, 110), (70, 104, 74), (98, 70, 98))
    for k in range(4):
        z = 0.1 + 0.44 * k
        for side in (-1, 1):
            parts.append((0.28, 1.94, 0.03, 0.15 * side, 0, z, OAK))
            parts += [
                (
                    0.2,
                    0.36,
                    0.24 + 0.03 * ((j + k) % 3),
                    0.16 * side,
                    -0.76 + 0.38 * j,
                    z + 0.15,
                    tones[(j * 2 + k + side) % 5],
                )
                for j in range(5)
            ]
    return piece("double_bookcase", parts, kind="bookcase")


def _stair_wall() -> Model:
    """Between the two flights of a stairs room; its middle stands at the middle of its own length."""
    return piece(
        "stair_wall",
        [
            (STAIRS[0] - LANDING, 0.1, RISE + 1.0, 0, 0, (RISE + 1.0) / 2, (214, 208, 198)),
            (STAIRS[0] - LANDING, 0.12, 0.05, 0, 0, RISE + 1.02, OAK),
        ],
        kind="wall",
    )


def _lift_panel() -> Model:
    parts: list[Part] = [(0.03, 0.3, 0.9, 0, 0, 1.25, STEEL), (0.01, 0.2, 0.14, 0.016, 0, 1.58, BLACK)]
    buttons = [(0.01, 0.06, 0.06, 0.018, 0.06 * (-1) ** k, 0.95 + 0.12 * (k // 2), YELLOW) for k in range(6)]
    return piece("lift_panel", parts + buttons, kind="lift_panel", solid=False)


def _partition() -> Model:
    return piece(
        "partition",
        [
            (0.06, 1.6, 1.3, 0, 0, 0.68, (140, 152, 160)),
            (0.08, 0.05, 1.36, 0, 0.78, 0.68, STEEL),
            (0.08, 0.05, 1.36, 0, -0.78, 0.68, STEEL),
        ],
    )


def _easel_stage() -> Model:
    return piece(
        "stage_large",
        [
            (2.2, 5.0, 0.5, 0, 0, 0.25, WALNUT),
            (0.1, 0.6, 2.2, -1.0, 2.2, 1.6, (132, 34, 44)),
            (0.1, 0.6, 2.2, -1.0, -2.2, 1.6, (132, 34, 44)),
            (0.06, 3.8, 2.1, -1.05, 0, 1.6, (96, 30, 44)),
            (0.04, 0.04, 1.2, 0.4, 0, 1.1, BLACK),
            (0.06, 0.06, 0.14, 0.4, 0, 1.75, DARK),
        ],
        kind="stage",
    )


def public_models() -> list[Model]:
    """Models for public buildings and places of work."""
    coast = ((150, 180, 198), (84, 104, 92), (226, 214, 190), (236, 226, 170))
    still = ((70, 56, 48), (112, 84, 60), (196, 146, 70), (176, 60, 48))
    bold = ((232, 226, 210), (204, 78, 58), (44, 70, 112), (238, 196, 70))
    return [
        _seats("cinema_seats", 4, 0.58, (136, 34, 42), True),
        _seats("cinema_seats_pair", 2, 0.58, (136, 34, 42), True),
        _screen(),
        _altar(),
        _pulpit(),
        _font(),
        _organ(),
        _cross(),
        _stained(),
        _school_desk(),
        _board("blackboard", (44, 74, 60), LINEN),
        _board("whiteboard", (246, 246, 244), BLUE),
        _reception(),
        _conference(),
        _copier(),
        _cooler(),
        _hospital_bed(),
        _couch(),
        _cabinet("medical_cabinet", WHITE, GLASS),
        _cabinet("tool_cabinet", (178, 60, 52), (196, 80, 70)),
        _cabinet("cupboard", BIRCH, OAK),
        _waiting_bench(),
        _bike(),
        _bench_press(),
        _dumbbells(),
        _lockers(),
        _gym_mirror(),
        _yoga(),
        _pool_table(),
        _slot_machine(),
        _dj(),
        _sculpture(),
        _large_painting("painting_coast", coast),
        _large_painting("painting_still", still),
        _large_painting("painting_bold", bold),
        _vitrine(),
        _rope(),
        _workbench(),
        _lathe(),
        _pallet(),
        _car("car_red", (164, 44, 42)),
        _car("car_blue", (54, 84, 128)),
        _car("car_grey", (150, 152, 154)),
        _pillar(),
        _church_pillar(),
        _turnstile(),
        _ticket_machine(),
        _timetable(),
        _flag(),
        _double_bookcase(),
        _stair_wall(),
        _lift_panel(),
        _partition(),
        _easel_stage(),
    ]
