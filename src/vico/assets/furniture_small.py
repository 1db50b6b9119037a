"""Small things that lie about on tables, desks and shelves. They are part of the scene: nobody picks them up."""

from __future__ import annotations

from vico.assets.furniture_parts import (
    BLACK,
    BLUE,
    CERAMIC,
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
    boxes,
)
from vico.assets.model import Model, model
from vico.assets.shapes import Colour, ball, box, cylinder, lathe
from vico.world.mesh import Surface


def _small(name: str, *parts: Surface, rows: list[Part] | None = None, kind: str | None = None) -> Model:
    return model(name, [*boxes(rows or []), *parts], kind=kind, group="indoor", solid=False)


def _bottle(name: str, glass: Colour, label: Colour) -> Model:
    body = lathe(
        [(0.0, 0), (0.035, 0.0), (0.035, 0.17), (0.013, 0.22), (0.013, 0.29), (0, 0.29)], sides=8, colour=glass
    )
    band = lathe([(0.036, 0.05), (0.036, 0.12)], sides=8, colour=label)
    return _small(name, body, band, kind="bottle")


def _stack(name: str, tones: tuple[Colour, ...]) -> Model:
    parts = [box((0.17, 0.24, 0.03), (0, 0, 0.016 + 0.031 * k), colour=t, yaw=0.1 * k) for k, t in enumerate(tones)]
    return _small(name, *parts, kind="book")


def _vase() -> Model:
    pot = lathe([(0.0, 0), (0.05, 0), (0.075, 0.1), (0.035, 0.2), (0.045, 0.22), (0, 0.2)], sides=10, colour=TEAL)
    stems = [
        cylinder(0.006, 0.2, sides=4, colour=LEAF, centre=(x, y, 0.2)) for x, y in ((0, 0), (0.02, 0.02), (-0.02, 0.01))
    ]
    heads = [
        ball((0.035, 0.035, 0.03), (x, y, z), colour=c, sides=6, rings=4)
        for x, y, z, c in ((0, 0, 0.42, RED), (0.045, 0.03, 0.39, YELLOW), (-0.045, 0.02, 0.38, (232, 150, 176)))
    ]
    return _small("vase", pot, *stems, *heads)


def _fruit() -> Model:
    bowl = lathe([(0.0, 0.0), (0.06, 0.0), (0.14, 0.08), (0.13, 0.08), (0.05, 0.02), (0, 0.02)], sides=12, colour=WHITE)
    fruit = [
        ball((0.042, 0.042, 0.042), (x, y, z), colour=c, sides=7, rings=5)
        for x, y, z, c in (
            (0.05, 0, 0.075, RED),
            (-0.03, 0.05, 0.075, YELLOW),
            (-0.03, -0.05, 0.075, (226, 128, 40)),
            (0, 0, 0.12, (134, 168, 60)),
        )
    ]
    return _small("fruit_bowl", bowl, *fruit)


def _cup(name: str, colour: Colour) -> Model:
    cup = lathe(
        [(0, 0.012), (0.03, 0.012), (0.042, 0.09), (0.042, 0.09), (0.036, 0.088), (0.0, 0.075)], sides=9, colour=colour
    )
    saucer = lathe([(0, 0), (0.05, 0), (0.075, 0.015), (0, 0.012)], sides=10, colour=CERAMIC)
    return _small(name, cup, saucer, box((0.012, 0.03, 0.045), (0, 0.052, 0.052), colour=colour), kind="cup")


def _plate(name: str, food: tuple[Colour, ...]) -> Model:
    plate = lathe([(0, 0), (0.07, 0), (0.12, 0.018), (0.115, 0.02), (0, 0.01)], sides=14, colour=CERAMIC)
    lumps = [
        ball((0.035, 0.03, 0.02), (0.035 * (k - 1), 0.03 * (-1) ** k, 0.022), colour=c, sides=6, rings=4)
        for k, c in enumerate(food)
    ]
    return _small(name, plate, *lumps, kind="plate")


def _place_setting() -> Model:
    """A plate between knife and fork, a glass beside."""
    plate = lathe([(0, 0), (0.08, 0), (0.13, 0.018), (0.125, 0.02), (0, 0.01)], sides=14, colour=CERAMIC)
    glass = lathe(
        [(0, 0), (0.03, 0), (0.035, 0.1), (0.03, 0.1), (0, 0.02)], sides=8, colour=GLASS, centre=(-0.13, 0.12, 0)
    )
    return _small(
        "place_setting",
        plate,
        glass,
        rows=[(0.19, 0.02, 0.005, 0, 0.17, 0.003, STEEL), (0.19, 0.025, 0.005, 0, -0.17, 0.003, STEEL)],
    )


def _lamp() -> Model:
    shade = lathe([(0.12, 0.26), (0.12, 0.26), (0.075, 0.42), (0, 0.42)], sides=10, colour=(246, 232, 196))
    return _small(
        "table_lamp", shade, cylinder(0.07, 0.02, sides=10, colour=OAK), cylinder(0.012, 0.26, sides=5, colour=OAK)
    )


def _candle() -> Model:
    return _small(
        "candle",
        cylinder(0.03, 0.07, sides=8, colour=LINEN),
        cylinder(0.05, 0.01, sides=9, colour=STEEL),
        cylinder(0.004, 0.02, sides=4, colour=(240, 170, 60), centre=(0, 0, 0.07)),
    )


def _bread() -> Model:
    basket = lathe([(0, 0), (0.1, 0), (0.14, 0.08), (0.12, 0.08), (0, 0.02)], sides=10, colour=(172, 128, 78))
    loaves = [
        ball((0.08, 0.035, 0.035), (0.0, 0.05 * (k - 1), 0.08), colour=(198, 146, 84), sides=7, rings=4)
        for k in range(3)
    ]
    return _small("bread_basket", basket, *loaves)


def _plant() -> Model:
    pot = lathe([(0, 0), (0.05, 0), (0.07, 0.11), (0.06, 0.11), (0, 0.1)], sides=9, colour=(186, 104, 76))
    leaves = [
        ball((0.05, 0.02, 0.08), (0.03 * a, 0.03 * b, 0.18), colour=LEAF, sides=5, rings=4)
        for a, b in ((1, 0), (-1, 0), (0, 1), (0, -1))
    ]
    return _small("small_plant", pot, *leaves, kind="plant")


def small_models() -> list[Model]:
    """Small things, by prototype: none of them solid, none carried."""
    g = GOODS_COLOURS
    return [
        _small("book", rows=[(0.16, 0.22, 0.03, 0, 0, 0.015, RED), (0.15, 0.21, 0.02, 0.007, 0, 0.015, LINEN)]),
        _small(
            "open_book",
            rows=[
                (0.2, 0.3, 0.02, 0, 0, 0.01, BLUE),
                (0.19, 0.14, 0.012, 0, -0.072, 0.024, WHITE),
                (0.19, 0.14, 0.012, 0, 0.072, 0.024, WHITE),
            ],
            kind="book",
        ),
        _stack("book_stack", (g[3], g[1], g[0])),
        _stack("magazines", (g[5], g[6])),
        _cup("cup", CERAMIC),
        _cup("mug", BLUE),
        _plate("plate", ()),
        _plate("meal", ((176, 96, 52), (92, 140, 62), (236, 206, 120))),
        _place_setting(),
        _bottle("wine_bottle", (44, 74, 52), (226, 216, 188)),
        _bottle("water_bottle", (156, 196, 214), (70, 120, 176)),
        _bottle("sauce_bottle", (176, 44, 36), (244, 236, 210)),
        _small("glass", lathe([(0, 0), (0.03, 0), (0.036, 0.12), (0.03, 0.12), (0, 0.03)], sides=8, colour=GLASS)),
        _small(
            "wine_glass",
            lathe(
                [(0, 0), (0.035, 0), (0.006, 0.01), (0.006, 0.08), (0.038, 0.14), (0.03, 0.19), (0, 0.1)],
                sides=8,
                colour=GLASS,
            ),
        ),
        _small(
            "laptop",
            rows=[
                (0.23, 0.33, 0.018, 0, 0, 0.009, GREY),
                (0.02, 0.33, 0.21, -0.115, 0, 0.12, DARK),
                (0.006, 0.3, 0.18, -0.104, 0, 0.125, SCREEN),
                (0.1, 0.28, 0.004, -0.02, 0, 0.02, BLACK),
            ],
        ),
        _small("phone", rows=[(0.15, 0.072, 0.009, 0, 0, 0.0045, BLACK), (0.13, 0.064, 0.002, 0, 0, 0.01, SCREEN)]),
        _small("tablet", rows=[(0.25, 0.18, 0.01, 0, 0, 0.005, BLACK), (0.23, 0.16, 0.002, 0, 0, 0.011, SCREEN)]),
        _small(
            "papers",
            rows=[
                (0.3, 0.21, 0.012, 0, 0, 0.006, WHITE),
                (0.24, 0.012, 0.002, 0, 0.05, 0.013, GREY),
                (0.24, 0.012, 0.002, 0, 0.02, 0.013, GREY),
                (0.24, 0.012, 0.002, 0, -0.01, 0.013, GREY),
            ],
        ),
        _small(
            "newspaper",
            rows=[(0.28, 0.4, 0.014, 0, 0, 0.007, (222, 218, 206)), (0.24, 0.17, 0.003, 0, -0.09, 0.015, GREY)],
        ),
        _small(
            "pen_pot",
            cylinder(0.04, 0.1, sides=9, colour=DARK),
            rows=[
                (0.01, 0.01, 0.08, 0.01, 0.01, 0.13, RED),
                (0.01, 0.01, 0.07, -0.01, 0.01, 0.13, BLUE),
                (0.01, 0.01, 0.06, 0.0, -0.015, 0.12, YELLOW),
            ],
        ),
        _small(
            "cardboard_box",
            rows=[(0.26, 0.34, 0.22, 0, 0, 0.11, (186, 144, 96)), (0.262, 0.05, 0.222, 0, 0, 0.111, (206, 176, 130))],
            kind="box",
        ),
        _small(
            "gift_box",
            rows=[
                (0.2, 0.2, 0.14, 0, 0, 0.07, TEAL),
                (0.205, 0.04, 0.145, 0, 0, 0.0725, YELLOW),
                (0.04, 0.205, 0.145, 0, 0, 0.0725, YELLOW),
            ],
            kind="box",
        ),
        _small(
            "toy_blocks",
            rows=[
                (0.06, 0.06, 0.06, -0.05, 0, 0.03, RED),
                (0.06, 0.06, 0.06, 0.04, 0.03, 0.03, BLUE),
                (0.06, 0.06, 0.06, 0.0, 0.0, 0.09, YELLOW),
            ],
            kind="toy",
        ),
        _small(
            "toy_car",
            rows=[
                (0.18, 0.08, 0.04, 0, 0, 0.04, RED),
                (0.09, 0.07, 0.04, -0.01, 0, 0.08, GLASS),
                (0.04, 0.09, 0.04, 0.055, 0, 0.02, BLACK),
                (0.04, 0.09, 0.04, -0.055, 0, 0.02, BLACK),
            ],
            kind="toy",
        ),
        _small(
            "basket", lathe([(0, 0), (0.1, 0), (0.13, 0.14), (0.115, 0.14), (0, 0.02)], sides=10, colour=(176, 134, 86))
        ),
        _small(
            "folded_clothes",
            rows=[
                (0.24, 0.3, 0.05, 0, 0, 0.025, BLUE),
                (0.24, 0.29, 0.05, 0, 0, 0.075, LINEN),
                (0.23, 0.28, 0.04, 0, 0, 0.12, g[0]),
            ],
            kind="clothes",
        ),
        _small("towels", rows=[(0.26, 0.36, 0.06, 0, 0, 0.03, WHITE), (0.25, 0.35, 0.06, 0, 0, 0.09, TEAL)]),
        _small(
            "pan", cylinder(0.11, 0.05, sides=12, colour=DARK), box((0.16, 0.025, 0.02), (0.18, 0, 0.035), colour=BLACK)
        ),
        _small(
            "pot",
            cylinder(0.12, 0.15, sides=12, colour=STEEL),
            cylinder(0.125, 0.02, sides=12, colour=GREY, centre=(0, 0, 0.15)),
            box((0.03, 0.05, 0.03), (0, 0, 0.185), colour=BLACK),
        ),
        _small(
            "toaster",
            rows=[
                (0.18, 0.28, 0.18, 0, 0, 0.09, STEEL),
                (0.03, 0.2, 0.01, -0.03, 0, 0.182, BLACK),
                (0.03, 0.2, 0.01, 0.03, 0, 0.182, BLACK),
            ],
        ),
        _small(
            "coffee_machine",
            rows=[
                (0.38, 0.4, 0.4, 0, 0, 0.2, STEEL),
                (0.12, 0.3, 0.04, 0.2, 0, 0.3, BLACK),
                (0.16, 0.34, 0.03, 0.2, 0, 0.03, DARK),
                (0.3, 0.34, 0.06, 0, 0, 0.43, WALNUT),
            ],
        ),
        _small(
            "till",
            rows=[
                (0.34, 0.36, 0.12, 0, 0, 0.06, BLACK),
                (0.03, 0.3, 0.22, -0.08, 0, 0.25, DARK),
                (0.006, 0.27, 0.19, -0.062, 0, 0.25, SCREEN),
                (0.12, 0.1, 0.05, 0.1, 0.1, 0.14, GREY),
            ],
        ),
        _small(
            "soap", cylinder(0.03, 0.12, sides=8, colour=GREEN), box((0.05, 0.01, 0.01), (0.015, 0, 0.14), colour=WHITE)
        ),
        _small(
            "globe",
            ball((0.12, 0.12, 0.12), (0, 0, 0.18), colour=BLUE, sides=10, rings=7),
            cylinder(0.07, 0.04, sides=8, colour=OAK),
            cylinder(0.012, 0.06, sides=5, colour=OAK, centre=(0, 0, 0.03)),
        ),
        _small(
            "bible",
            rows=[
                (0.16, 0.22, 0.05, 0, 0, 0.025, BLACK),
                (0.12, 0.02, 0.002, 0, 0, 0.051, YELLOW),
                (0.02, 0.08, 0.002, 0.02, 0, 0.051, YELLOW),
            ],
            kind="book",
        ),
        _small(
            "first_aid",
            rows=[
                (0.2, 0.28, 0.14, 0, 0, 0.07, WHITE),
                (0.12, 0.04, 0.004, 0, 0, 0.141, RED),
                (0.04, 0.12, 0.004, 0, 0, 0.141, RED),
            ],
            kind="box",
        ),
        _small(
            "tools",
            rows=[
                (0.24, 0.04, 0.04, 0, 0.06, 0.02, STEEL),
                (0.1, 0.05, 0.05, 0.12, 0.06, 0.025, RED),
                (0.22, 0.03, 0.03, 0, -0.04, 0.015, WALNUT),
                (0.06, 0.1, 0.04, -0.11, -0.04, 0.03, DARK),
            ],
            kind="tool",
        ),
        _vase(),
        _fruit(),
        _lamp(),
        _candle(),
        _bread(),
        _plant(),
        _small("remote", rows=[(0.17, 0.05, 0.02, 0, 0, 0.01, BLACK), (0.02, 0.02, 0.004, 0.05, 0, 0.021, RED)]),
        _small(
            "clock_small",
            box((0.05, 0.18, 0.12), (0, 0, 0.06), colour=WALNUT),
            box((0.004, 0.14, 0.09), (0.027, 0, 0.06), colour=WHITE),
            kind="clock",
        ),
        _small(
            "printer",
            rows=[
                (0.4, 0.45, 0.2, 0, 0, 0.1, (214, 214, 210)),
                (0.3, 0.35, 0.05, 0, 0, 0.225, DARK),
                (0.12, 0.3, 0.01, 0.22, 0, 0.06, WHITE),
            ],
        ),
    ]
