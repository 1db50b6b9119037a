"""What directs and serves traffic: signs, signals, gates, stands, mirrors, masts, lifts."""

from __future__ import annotations

import itertools
import math

from vico.assets.model import Model, model
from vico.assets.shapes import Colour, ball, box, cylinder, lathe
from vico.assets.street_parts import (
    BLACK,
    BLUE,
    GLASS,
    IRON,
    RED,
    STEEL,
    STONE,
    WHITE,
    WOOD,
    YELLOW,
    bicycle,
    hoop,
    plate,
    polygon,
    post,
    ring,
    tilted,
    tube,
)
from vico.world.mesh import Surface

_UP, _DOWN = math.pi / 2, -math.pi / 2


def _sign(name: str, plates: list[Surface], height: float = 2.75) -> Model:
    return model(name, [post(height, 0.03, STEEL, x=-0.05), *plates], kind="sign", foot=(0.15, 0.15))


def _face(sides: int, radius: float, colour: Colour, layer: int, *, turn: float = 0.0, z: float = 2.4) -> Surface:
    """A plate of a sign; higher layers lie on lower ones."""
    return plate(polygon(sides, radius, turn), 0.02, colour, 0.012 * layer, 0, z)


def _rectangle(wide: float, high: float, colour: Colour, layer: int, z: float, y: float = 0.0) -> Surface:
    return box((0.02, wide, high), (0.012 * layer, y, z), colour=colour)


def _man(layer: int, z: float, colour: Colour, y: float = 0.0) -> list[Surface]:
    """A walking figure on a sign."""
    return [
        plate(polygon(6, 0.035), 0.02, colour, 0.012 * layer, y, z + 0.13),
        _rectangle(0.07, 0.13, colour, layer, z + 0.02, y),
        plate([(-0.09, -0.14), (-0.05, -0.14), (0.03, -0.02), (-0.02, -0.02)], 0.02, colour, 0.012 * layer, y, z),
        plate([(0.05, -0.14), (0.09, -0.14), (0.03, -0.02), (-0.02, -0.02)], 0.02, colour, 0.012 * layer, y, z),
    ]


def _signs() -> list[Model]:
    eighth = math.pi / 8
    text = [_rectangle(0.07, 0.16, WHITE, 2, 2.4, -0.18 + 0.12 * k) for k in range(4)]
    ban: Colour = (196, 30, 36)
    return [
        _sign("sign_stop", [_face(8, 0.40, WHITE, 0, turn=eighth), _face(8, 0.37, ban, 1, turn=eighth), *text]),
        _sign("sign_give_way", [_face(3, 0.48, ban, 0, turn=_DOWN), _face(3, 0.32, WHITE, 1, turn=_DOWN)]),
        _sign(
            "sign_warning",
            [
                _face(3, 0.48, ban, 0, turn=_UP, z=2.3),
                _face(3, 0.34, (240, 214, 90), 1, turn=_UP, z=2.3),
                *_man(2, 2.28, BLACK),
            ],
        ),
        _sign("sign_ban", [_face(14, 0.34, ban, 0), _face(14, 0.26, WHITE, 1)]),
        _sign("sign_no_entry", [_face(14, 0.34, ban, 0), _rectangle(0.46, 0.11, WHITE, 1, 2.4)]),
        _sign(
            "sign_no_stopping",
            [
                _face(14, 0.34, ban, 0),
                _face(14, 0.27, BLUE, 1),
                _bar(ban, 2.4, 1.0),
            ],
        ),
        _sign(
            "sign_speed",
            [
                _face(14, 0.34, ban, 0),
                _face(14, 0.26, WHITE, 1),
                *[_rectangle(0.11, 0.03, BLACK, 2, 2.4 + dz, -0.08) for dz in (-0.11, 0.0, 0.11)],
                _rectangle(0.03, 0.22, BLACK, 2, 2.4, -0.03),
                *[_rectangle(0.03, 0.25, BLACK, 2, 2.4, 0.06 + dy) for dy in (0.0, 0.1)],
                *[_rectangle(0.13, 0.03, BLACK, 2, 2.4 + dz, 0.11) for dz in (-0.11, 0.11)],
            ],
        ),
        _sign(
            "sign_mandatory",
            [_face(14, 0.34, WHITE, 0), _face(14, 0.32, BLUE, 1), *_man(2, 2.4, WHITE)],
        ),
        _sign(
            "sign_crossing",
            [
                _rectangle(0.64, 0.64, WHITE, 0, 2.4),
                _rectangle(0.6, 0.6, BLUE, 1, 2.4),
                _face(3, 0.31, WHITE, 2, turn=_UP, z=2.34),
                *_man(3, 2.33, BLACK),
            ],
        ),
        _sign(
            "sign_parking",
            [
                _rectangle(0.64, 0.64, WHITE, 0, 2.4),
                _rectangle(0.6, 0.6, BLUE, 1, 2.4),
                _rectangle(0.08, 0.42, WHITE, 2, 2.4, -0.1),
                _rectangle(0.22, 0.07, WHITE, 2, 2.575, 0.05),
                _rectangle(0.22, 0.07, WHITE, 2, 2.4, 0.05),
                _rectangle(0.07, 0.2, WHITE, 2, 2.49, 0.15),
            ],
        ),
        _sign(
            "sign_guide",
            [
                _rectangle(1.1, 0.3, WHITE, 0, 2.45, 0.3),
                _rectangle(1.06, 0.26, BLUE, 1, 2.45, 0.3),
                _rectangle(0.6, 0.06, WHITE, 2, 2.45, 0.25),
                _rectangle(1.1, 0.3, WHITE, 0, 2.1, 0.3),
                _rectangle(1.06, 0.26, BLUE, 1, 2.1, 0.3),
                _rectangle(0.7, 0.06, WHITE, 2, 2.1, 0.3),
            ],
        ),
        _sign(
            "sign_street",
            [
                _rectangle(0.9, 0.2, WHITE, 0, 2.6, 0.0),
                _rectangle(0.86, 0.16, (30, 96, 62), 1, 2.6, 0.0),
                _rectangle(0.6, 0.05, WHITE, 2, 2.6, 0.0),
            ],
        ),
        _sign(
            "sign_taxi",
            [
                _rectangle(0.7, 0.36, BLACK, 0, 2.45),
                _rectangle(0.64, 0.3, YELLOW, 1, 2.45),
                *[_rectangle(0.08, 0.16, BLACK, 2, 2.45, -0.2 + 0.13 * k) for k in range(4)],
            ],
        ),
    ]


def _bar(colour: Colour, z: float, turn: float) -> Surface:
    """A diagonal stroke over a round sign."""
    c, s = math.cos(math.pi / 4 * turn), math.sin(math.pi / 4 * turn)
    outline = [(-0.29, -0.035), (0.29, -0.035), (0.29, 0.035), (-0.29, 0.035)]
    return plate([(c * y + s * z1, -s * y + c * z1) for y, z1 in outline], 0.02, colour, 0.024, 0, z)


def _lift_gate() -> Model:
    """A barrier, raised."""
    parts = [
        box((0.34, 0.34, 1.0), (0, 0, 0.5), colour=YELLOW),
        box((0.36, 0.36, 0.08), (0, 0, 1.04), colour=IRON),
        box((0.02, 0.2, 0.3), (0.175, 0, 0.6), colour=BLACK),
        tube((0, 0.22, 0.95), (0, 0.5, 4.1), 0.05, WHITE, tip=0.035),
    ]
    for k in range(4):
        a, b = 0.12 + 0.24 * k, 0.23 + 0.24 * k
        parts.append(
            tube((0, 0.22 + 0.28 * a, 0.95 + 3.15 * a), (0, 0.22 + 0.28 * b, 0.95 + 3.15 * b), 0.054, RED, tip=0.05)
        )
    return model("lift_gate", parts, foot=(0.35, 0.35))


def _swing_gate() -> Model:
    parts = [post(1.2, 0.07, RED, y=-1.4), tube((0, -1.4, 1.0), (1.9, -1.0, 1.0), 0.04, WHITE)]
    parts += [tube((0.1, -1.38, 0.2), (1.2, -1.15, 1.0), 0.025, WHITE)]
    parts += [tube((0.45 * k + 0.3, -1.34 + 0.1 * k, 1.0), (0.45 * k + 0.5, -1.3 + 0.1 * k, 1.0), 0.044, RED)
              for k in range(3)]  # fmt: skip
    return model("swing_gate", parts, kind="gate", solid=False)


def _gate() -> Model:
    """A pair of wings that stand open, hung on two posts."""
    parts: list[Surface] = []
    for side in (-1, 1):
        y = 1.15 * side
        parts += [box((0.14, 0.14, 1.35), (0, y, 0.675), colour=IRON), ball((0.1, 0.1, 0.1), (0, y, 1.43), colour=IRON,
                                                                            sides=6, rings=4)]  # fmt: skip
        parts += [tube((0.05, y, z), (1.0, y, z), 0.02, IRON) for z in (0.2, 1.1)]
        parts += [tube((0.15 + 0.14 * k, y, 0.1), (0.15 + 0.14 * k, y, 1.2), 0.012, IRON, sides=3) for k in range(7)]
    return model("gate", parts, solid=False)


def _cycle_barrier() -> Model:
    parts = []
    for side, x in ((-1, -0.6), (1, 0.6)):
        for y0, y1 in ((0.15 * side, 1.25 * side),):
            parts += [tube((x, y0, 0), (x, y0, 0.95), 0.03, RED), tube((x, y1, 0), (x, y1, 0.95), 0.03, RED)]
            parts += [tube((x, y0, z), (x, y1, z), 0.03, RED if z > 0.6 else WHITE) for z in (0.5, 0.95)]
    return model("cycle_barrier", parts)


def _parking_rows() -> list[Model]:
    """Stands for bicycles by their number, some of them taken."""
    paints: tuple[Colour, ...] = ((150, 40, 40), (44, 72, 120), (50, 54, 58), (190, 190, 190), (60, 110, 80))
    found = []
    for name, hoops, bikes in (
        ("bicycle_stand", 1, ()),
        ("bicycle_parking_small", 2, (0,)),
        ("bicycle_parking", 4, (1,)),
        ("bicycle_parking_empty", 4, ()),
        ("bicycle_parking_large", 6, (2,)),
    ):
        parts: list[Surface] = []
        for k in range(hoops):
            y = (k - (hoops - 1) / 2) * 0.85
            parts += hoop(0, y)
            if k in bikes:
                parts += bicycle(0.05, y + 0.14, paints[(k + hoops) % len(paints)])
        found.append(model(name, parts, kind="bicycle_parking"))
    return found


def _motorcycles() -> Model:
    """Two parked motorcycles, across the row."""
    parts: list[Surface] = []
    tones: tuple[Colour, ...] = ((150, 30, 32), (40, 44, 50))
    for k, paint in enumerate(tones):
        y = (k - 0.5) * 1.0
        for x in (-0.68, 0.68):
            parts.append(cylinder(0.3, 0.12, sides=9, colour=BLACK).moved(_across(x, y - 0.06, 0.3)))
        parts += [
            box((0.62, 0.24, 0.34), (-0.02, y, 0.5), colour=STEEL),
            box((0.5, 0.26, 0.2), (0.14, y, 0.82), colour=paint),
            box((0.62, 0.24, 0.1), (-0.4, y, 0.84), colour=BLACK),
            box((0.24, 0.2, 0.16), (-0.78, y, 0.78), colour=paint),
            tube((0.68, y, 0.3), (0.42, y, 1.02), 0.04, STEEL),
            tube((0.42, y - 0.36, 1.06), (0.42, y + 0.36, 1.06), 0.02, BLACK),
            box((0.12, 0.18, 0.18), (0.56, y, 0.92), colour=WHITE),
            tube((-0.1, y + 0.14, 0.28), (-0.8, y + 0.16, 0.34), 0.045, STEEL),
        ]
    return model("motorcycles", parts, kind="motorcycle_parking")


def _across(x: float, y: float, z: float):  # type: ignore[no-untyped-def]
    """Turn the z axis to +y, then move."""
    matrix = tilted(x, y, z)
    matrix[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    return matrix


def _signals() -> Model:
    """Two lamp heads with visors on a pole, one for walkers to the side."""
    parts = [
        post(3.5, 0.06, (58, 60, 60)),
        box((0.2, 0.32, 0.96), (0.18, 0, 2.95), colour=BLACK),
        box((0.02, 0.44, 1.1), (0.08, 0, 2.95), colour=(36, 38, 40)),
    ]
    for z, tone in ((3.26, (220, 50, 42)), (2.95, (150, 112, 32)), (2.64, (36, 110, 66))):
        parts.append(plate(polygon(10, 0.105), 0.02, tone, 0.285, 0, z))
        parts.append(box((0.16, 0.24, 0.02), (0.36, 0, z + 0.115), colour=BLACK))
    parts.append(box((0.24, 0.2, 0.5), (0, 0.24, 2.25), colour=BLACK))
    parts += [box((0.16, 0.02, 0.16), (0, 0.35, z), colour=tone) for z, tone in
              ((2.37, (200, 50, 42)), (2.13, (40, 120, 70)))]  # fmt: skip
    parts.append(box((0.14, 0.12, 0.2), (0.06, 0, 1.1), colour=YELLOW))
    return model("traffic_signals", parts, foot=(0.2, 0.2))


def _bus_stop() -> Model:
    parts = [
        post(3.0, 0.045, STEEL),
        box((0.04, 0.52, 0.52), (0, 0.3, 2.66), colour=YELLOW),
        box((0.046, 0.46, 0.46), (0, 0.3, 2.66), colour=BLUE),
        # A bus from the front.
        box((0.05, 0.28, 0.24), (0, 0.3, 2.7), colour=WHITE),
        box((0.054, 0.22, 0.1), (0, 0.3, 2.73), colour=BLUE),
        box((0.05, 0.06, 0.07), (0, 0.2, 2.55), colour=WHITE),
        box((0.05, 0.06, 0.07), (0, 0.4, 2.55), colour=WHITE),
        box((0.06, 0.34, 0.62), (0.02, 0, 1.5), colour=IRON),
        box((0.066, 0.28, 0.54), (0.02, 0, 1.5), colour=WHITE),
        box((0.07, 0.22, 0.08), (0.02, 0, 1.68), colour=BLUE),
        *[box((0.07, 0.22, 0.012), (0.02, 0, 1.58 - 0.05 * k), colour=(120, 124, 128)) for k in range(6)],
    ]
    return model("bus_stop", parts, group="transit", foot=(0.2, 0.2))


def _shelter() -> Model:
    """A glazed waiting shelter, open to +x, with a bench and a lit poster."""
    roof: Colour = (74, 80, 84)
    parts = [
        box((1.6, 3.7, 0.1), (0, 0, 2.42), colour=roof),
        box((0.06, 3.7, 0.16), (0.78, 0, 2.4), colour=BLUE),
        box((0.34, 2.3, 0.05), (-0.42, 0.2, 0.46), colour=WOOD),
        box((0.05, 2.3, 0.24), (-0.6, 0.2, 0.74), colour=WOOD),
        box((1.0, 0.12, 1.75), (-0.15, -1.72, 1.2), colour=IRON),
        box((0.86, 0.13, 1.55), (-0.15, -1.72, 1.22), colour=(202, 110, 70)),
        box((0.5, 0.14, 0.3), (-0.15, -1.72, 1.6), colour=WHITE),
    ]
    for k in range(3):
        parts.append(box((0.02, 1.1, 1.9), (-0.68, (k - 1) * 1.16, 1.32), colour=GLASS))
        parts.append(box((0.03, 1.1, 0.05), (-0.68, (k - 1) * 1.16, 0.35), colour=IRON))
    parts.append(box((1.0, 0.02, 1.9), (-0.15, 1.72, 1.32), colour=GLASS))
    parts += [box((0.07, 0.07, 2.8), (-0.68, y, 1.0), colour=IRON) for y in (-1.74, -0.58, 0.58, 1.74)]
    parts += [box((0.07, 0.07, 2.8), (0.4, y, 1.0), colour=IRON) for y in (-1.74, 1.74)]
    parts += [box((0.06, 0.05, 0.86), (-0.42, y, 0.03), colour=IRON) for y in (-0.7, 1.1)]
    return model("shelter", parts)


def _camera() -> Model:
    parts = [
        post(4.2, 0.05, STEEL),
        tube((0, 0, 4.05), (0.5, 0, 4.1), 0.025, STEEL),
        box((0.34, 0.13, 0.13), (0.56, 0, 3.98), colour=WHITE),
        cylinder(0.05, 0.04, sides=8, colour=BLACK).moved(tilted(0.73, 0, 3.98)),
        ball((0.11, 0.11, 0.11), (0.3, 0, 3.92), colour=BLACK, sides=8, rings=5),
        box((0.2, 0.26, 0.36), (-0.12, 0, 2.6), colour=(196, 198, 196)),
    ]
    return model("surveillance", parts, foot=(0.2, 0.2))


def _mirror() -> Model:
    parts = [
        post(2.9, 0.035, STEEL, x=-0.1),
        plate(polygon(12, 0.4), 0.05, RED, 0.0, 0, 2.5),
        plate(polygon(12, 0.33), 0.05, (176, 196, 210), 0.02, 0, 2.5),
    ]
    return model("traffic_mirror", parts, foot=(0.15, 0.15))


def _speed_camera() -> Model:
    parts = [
        post(2.6, 0.09, STEEL),
        box((0.5, 0.36, 0.7), (0.05, 0, 2.85), colour=(140, 146, 146)),
        box((0.02, 0.24, 0.16), (0.31, 0, 2.98), colour=BLACK),
        box((0.02, 0.24, 0.2), (0.31, 0, 2.7), colour=WHITE),
    ]
    return model("speed_camera", parts, foot=(0.25, 0.25))


def _buffer_stop() -> Model:
    parts = [
        box((0.3, 2.4, 0.4), (0.3, 0, 1.0), colour=RED),
        *[box((0.31, 0.3, 0.41), (0.3, -0.9 + 0.6 * k, 1.0), colour=WHITE) for k in range(4)],
    ]
    for y in (-0.75, 0.75):
        parts += [
            tube((-0.9, y, 0), (0.2, y, 1.1), 0.07, IRON),
            box((0.14, 0.14, 1.2), (0.25, y, 0.6), colour=IRON),
            cylinder(0.2, 0.14, sides=8, colour=IRON).moved(tilted(0.45, y, 1.0)),
        ]
    return model("buffer_stop", parts)


def _railway_signal() -> Model:
    parts = [
        post(4.6, 0.09, STEEL),
        box((0.16, 0.62, 1.3), (0.12, 0, 4.2), colour=BLACK),
        *[plate(polygon(8, 0.11), 0.02, tone, 0.21, y, z) for y, z, tone in
          ((-0.14, 4.6, (206, 44, 40)), (0.14, 4.6, (120, 90, 30)), (0.0, 4.2, (40, 130, 70)), (0.0, 3.8, WHITE))],
        *[box((0.03, 0.34, 0.03), (-0.12, 0, 0.5 + 0.34 * k), colour=STEEL) for k in range(9)],
    ]  # fmt: skip
    return model("railway_signal", parts, foot=(0.25, 0.25))


def _masts() -> list[Model]:
    """Poles with something on top."""
    timber: Colour = (120, 96, 72)
    pole = [cylinder(0.15, 8.4, top=0.11, sides=7, colour=timber), box((0.12, 2.0, 0.12), (0, 0, 7.9), colour=timber)]
    pole += [cylinder(0.05, 0.16, sides=6, colour=WHITE, centre=(0, y, 7.96)) for y in (-0.9, -0.35, 0.35, 0.9)]
    steel = [
        lathe([(0.17, 0), (0.17, 0.5), (0.12, 0.56), (0.085, 7.6), (0, 7.7)], sides=8, colour=(104, 110, 112)),
        *[ring((0, 0, z), 0.15, 0.06, (86, 90, 92), axis="z", sides=8) for z in (6.6, 6.9)],
        tube((0.08, 0, 6.75), (0.6, 0, 6.75), 0.02, IRON),
        cylinder(0.05, 0.16, sides=6, colour=(130, 70, 50)).moved(tilted(0.5, 0, 6.75)),
    ]
    mast = [cylinder(0.2, 14.0, top=0.1, sides=8, colour=STEEL), box((0.4, 0.6, 1.0), (0.2, 0, 0.9), colour=STONE)]
    for k in range(3):
        turn = 2 * math.pi * k / 3
        c, s = math.cos(turn), math.sin(turn)
        mast += [
            box((0.16, 0.3, 1.9), (0.45 * c, 0.45 * s, 12.6), colour=WHITE, yaw=turn),
            tube((0, 0, 12.9), (0.45 * c, 0.45 * s, 12.9), 0.03, STEEL),
            tube((0, 0, 12.2), (0.45 * c, 0.45 * s, 12.2), 0.03, STEEL),
        ]
    catenary = [
        cylinder(0.16, 7.0, top=0.12, sides=8, colour=(96, 108, 100)),
        tube((0, 0, 6.4), (3.0, 0, 6.2), 0.04, (96, 108, 100)),
        tube((0, 0, 6.95), (2.4, 0, 6.25), 0.015, IRON, sides=3),
        cylinder(0.06, 0.3, sides=6, colour=(130, 70, 50)).moved(tilted(0.2, 0, 6.4)),
    ]
    tower: list[Surface] = []
    feet = [(-1.6, -1.6), (1.6, -1.6), (1.6, 1.6), (-1.6, 1.6)]
    levels = [(0.0, 1.0), (6.0, 0.62), (12.0, 0.34), (21.0, 0.14)]
    for (z0, s0), (z1, s1) in itertools.pairwise(levels):
        for k, (x, y) in enumerate(feet):
            nx, ny = feet[(k + 1) % 4]
            tower.append(tube((x * s0, y * s0, z0), (x * s1, y * s1, z1), 0.07, STEEL, sides=3))
            tower.append(tube((x * s0, y * s0, z0), (nx * s1, ny * s1, z1), 0.04, STEEL, sides=3))
    for z in (14.0, 17.0, 20.0):
        tower.append(tube((0, -3.4, z + 0.4), (0, 3.4, z + 0.4), 0.08, STEEL, sides=3))
        tower += [tube((0, y, z + 0.4), (0, y, z - 0.6), 0.06, (110, 70, 50), sides=4) for y in (-3.3, 3.3)]
    return [
        model("utility_pole", pole, foot=(0.3, 0.3)),
        model("pole_steel", steel, kind="utility_pole", foot=(0.3, 0.3)),
        model("mast", mast, foot=(0.5, 0.5)),
        model("catenary_mast", catenary, foot=(0.35, 0.35)),
        model("power_tower", tower),
    ]


def _elevator() -> Model:
    parts = [
        box((2.0, 2.0, 2.9), (0, 0, 1.05), colour=(140, 168, 180)),
        box((2.2, 2.2, 0.16), (0, 0, 2.58), colour=IRON),
        box((0.04, 1.1, 2.1), (1.01, 0, 1.05), colour=STEEL),
        box((0.05, 0.02, 2.1), (1.02, 0, 1.05), colour=BLACK),
        box((0.05, 0.14, 0.3), (1.02, 0.75, 1.1), colour=BLACK),
        box((0.05, 0.4, 0.4), (1.02, 0, 2.3), colour=BLUE),
        *[box((0.08, 0.08, 2.5), (x, y, 1.25), colour=IRON) for x in (-1, 1) for y in (-1, 1)],
    ]
    return model("elevator", parts)


def _traffic_cylinder() -> Model:
    parts = [
        cylinder(0.16, 0.05, sides=8, colour=BLACK),
        lathe([(0.06, 0.05), (0.05, 0.95), (0.0, 0.98)], sides=8, colour=(226, 84, 40)),
        cylinder(0.065, 0.12, sides=8, colour=WHITE, centre=(0, 0, 0.7)),
    ]
    return model("delineator", parts, kind="bollard")


def _life_ring() -> Model:
    parts = [
        post(1.6, 0.05, RED),
        box((0.06, 0.8, 0.8), (0.06, 0, 1.2), colour=WHITE),
        ring((0.11, 0, 1.2), 0.36, 0.12, (230, 80, 30), axis="x"),
    ]
    return model("life_ring", parts, foot=(0.3, 0.8))


def traffic_models() -> list[Model]:
    """Everything that directs traffic or serves it."""
    return [
        *_signs(), _lift_gate(), _swing_gate(), _gate(), _cycle_barrier(), *_parking_rows(), _motorcycles(),
        _signals(), _bus_stop(), _shelter(), _camera(), _mirror(), _speed_camera(), _buffer_stop(), _railway_signal(),
        *_masts(), _elevator(), _traffic_cylinder(), _life_ring(),
    ]  # fmt: skip
