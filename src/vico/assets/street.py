"""Things that stand outdoors, at life size: the commonest here, further lots in the modules beside this one."""

from __future__ import annotations

import math
from functools import cache

from vico.assets.model import Model, Top, model
from vico.assets.plants import plant_models
from vico.assets.shapes import Colour, ball, box, cylinder, extrusion, lathe, pose_matrix
from vico.assets.street_barriers import barrier_models
from vico.assets.street_civic import civic_models
from vico.assets.street_parts import BLUE, GREEN, IRON, RED, STEEL, STONE, WHITE, WOOD, YELLOW, post, tilted
from vico.assets.street_play import play_models
from vico.assets.street_traffic import traffic_models
from vico.world.mesh import Surface


def _bench() -> Model:
    parts = [box((0.09, 1.7, 0.035), (x, 0, 0.44), colour=WOOD) for x in (-0.16, -0.05, 0.06, 0.17)]
    parts += [box((0.03, 1.7, 0.09), (-0.25 - 0.03 * k, 0, 0.58 + 0.13 * k), colour=WOOD) for k in range(3)]
    for y in (-0.7, 0.7):
        parts += [
            box((0.05, 0.06, 0.44), (0.17, y, 0.22), colour=IRON),
            box((0.05, 0.06, 0.88), (-0.24, y, 0.44), colour=IRON),
            box((0.46, 0.06, 0.04), (-0.02, y, 0.40), colour=IRON),
            box((0.40, 0.05, 0.04), (-0.02, y, 0.64), colour=IRON),
        ]
    return model("bench", parts, foot=(0.6, 1.7))


def _picnic_table() -> Model:
    parts = [box((0.16, 1.8, 0.04), (x, 0, 0.75), colour=WOOD) for x in (-0.27, -0.09, 0.09, 0.27)]
    for x in (-0.68, 0.68):
        parts.append(box((0.28, 1.8, 0.04), (x, 0, 0.45), colour=WOOD))
    for y in (-0.6, 0.6):
        parts += [
            box((1.5, 0.07, 0.08), (0, y, 0.40), colour=WOOD),
            box((0.07, 0.07, 0.72), (-0.25, y, 0.37), colour=WOOD),
            box((0.07, 0.07, 0.72), (0.25, y, 0.37), colour=WOOD),
        ]
    return model("picnic_table", parts, top=Top("table", 0.77, (0.7, 1.8)))


def _waste_basket() -> Model:
    parts = [
        lathe([(0.0, 0.06), (0.19, 0.06), (0.22, 0.78), (0.22, 0.78), (0.17, 0.78), (0.16, 0.6), (0, 0.6)],
              sides=8, colour=GREEN),
        cylinder(0.05, 0.06, colour=IRON, sides=6),
        lathe([(0.0, 0.95), (0.24, 0.92), (0.0, 1.04)], sides=8, colour=IRON),
        box((0.03, 0.03, 0.2), (0, 0.2, 0.86), colour=IRON),
        box((0.03, 0.03, 0.2), (0, -0.2, 0.86), colour=IRON),
    ]  # fmt: skip
    return model("waste_basket", parts)


def _recycling() -> Model:
    parts = []
    for k, colour in enumerate((GREEN, BLUE, YELLOW)):
        y = (k - 1) * 1.25
        parts += [
            box((1.1, 1.1, 1.3), (0, y, 0.68), colour=(96, 104, 100)),
            box((1.14, 1.14, 0.16), (0, y, 1.4), colour=colour),
            cylinder(0.14, 0.03, colour=(28, 30, 30), sides=8, centre=(0, 0, 0)).moved(
                tilted(0.56, y, 1.12)
            ),
            box((0.01, 0.6, 0.3), (0.555, y, 0.7), colour=colour),
        ]  # fmt: skip
    return model("recycling", parts)


def _fountain() -> Model:
    basin = lathe(
        [(0.0, 0.0), (1.9, 0.0), (1.9, 0.0), (2.0, 0.55), (2.0, 0.55), (1.72, 0.55), (1.72, 0.55), (1.66, 0.36)],
        sides=16,
        colour=STONE,
    )
    water = lathe([(1.7, 0.42), (0.0, 0.42)], sides=16, colour=(92, 138, 164))
    bowl = lathe(
        [(0.3, 0.3), (0.16, 0.9), (0.16, 1.1), (0.75, 1.4), (0.75, 1.4), (0.62, 1.4), (0, 1.3)], sides=10, colour=STONE
    )
    jet = lathe([(0.12, 1.34), (0.05, 1.7), (0.0, 1.95)], sides=6, colour=(206, 226, 236))
    return model("fountain", [basin, _flipped(water), bowl, jet])


def _flipped(surface: Surface) -> Surface:
    """Facing up, where a profile was given from the rim inwards at one height."""
    up = surface.normals[:, 2].mean() > 0
    if up:
        return surface
    return Surface(
        surface.positions,
        -surface.normals,
        surface.uv,
        surface.colour,
        surface.entity,
        surface.triangles[:, ::-1].copy(),
        surface.material,
    )


def _post_box() -> Model:
    colour = (238, 120, 24)
    parts = [
        box((0.08, 0.3, 0.75), (0, 0, 0.38), colour=IRON),
        box((0.36, 0.5, 0.6), (0, 0, 1.02), colour=colour),
        extrusion([(-0.2, 1.32), (0.2, 1.32), (0.2, 1.36), (-0.2, 1.42)], 0.54, colour=colour),
        box((0.01, 0.36, 0.04), (0.185, 0, 1.2), colour=(40, 34, 30)),
        box((0.01, 0.2, 0.16), (0.185, 0, 0.98), colour=WHITE),
    ]
    return model("post_box", parts)


def _vending_machine() -> Model:
    parts = [
        box((0.75, 0.95, 1.85), (0, 0, 0.95), colour=BLUE),
        box((0.02, 0.6, 1.2), (0.38, 0.1, 1.15), colour=(60, 78, 92)),
        box((0.02, 0.16, 0.6), (0.38, -0.35, 1.2), colour=WHITE),
        box((0.02, 0.6, 0.2), (0.38, 0.1, 0.35), colour=(30, 32, 34)),
    ]
    for k in range(4):
        for j in range(4):
            tone = ((196, 60, 50), (230, 190, 60), (70, 150, 90), (220, 220, 214))[(k + j) % 4]
            parts.append(box((0.02, 0.09, 0.16), (0.392, -0.1 + 0.14 * j, 0.75 + 0.27 * k), colour=tone))
    return model("vending_machine", parts)


def _parking_meter() -> Model:
    parts = [
        box((0.2, 0.26, 1.15), (0, 0, 0.575), colour=(70, 74, 80)),
        box((0.26, 0.34, 0.5), (0, 0, 1.38), colour=BLUE),
        box((0.01, 0.2, 0.14), (0.134, 0, 1.46), colour=(190, 206, 196)),
        box((0.02, 0.3, 0.3), (0, 0, 1.85), colour=BLUE),
        box((0.024, 0.1, 0.2), (0, 0, 1.85), colour=WHITE),
    ]
    return model("parking_meter", parts)


def _atm() -> Model:
    parts = [
        box((0.6, 0.8, 1.75), (-0.05, 0, 0.875), colour=(64, 88, 120)),
        box((0.02, 0.5, 0.36), (0.255, 0, 1.35), colour=(30, 44, 60)),
        box((0.2, 0.5, 0.05), (0.3, 0, 1.06), colour=STEEL),
        box((0.02, 0.8, 0.2), (0.255, 0, 1.66), colour=YELLOW),
    ]
    return model("atm", parts)


def _drinking_water() -> Model:
    parts = [
        lathe([(0.22, 0), (0.14, 0.1), (0.12, 0.7), (0.26, 0.86), (0.26, 0.86), (0.2, 0.88), (0, 0.82)],
              sides=8, colour=STEEL),
        box((0.04, 0.04, 0.14), (-0.12, 0, 0.94), colour=IRON),
        box((0.14, 0.03, 0.03), (-0.06, 0, 1.0), colour=IRON),
    ]  # fmt: skip
    return model("drinking_water", parts)


def _bollard() -> Model:
    profile = [(0.11, 0), (0.11, 0.06), (0.08, 0.1), (0.08, 0.78), (0.1, 0.82), (0.09, 0.9), (0, 0.95)]
    return model("bollard", [lathe(profile, sides=8, colour=IRON)])


def _street_lamp() -> Model:
    parts = [
        lathe([(0.14, 0), (0.14, 0.5), (0.085, 0.6), (0.05, 6.4), (0, 6.4)], sides=8, colour=(84, 90, 94)),
        box((1.3, 0.06, 0.06), (0.6, 0, 6.38), colour=(84, 90, 94)),
        extrusion([(0.9, 6.30), (1.7, 6.36), (1.7, 6.42), (0.9, 6.46)], 0.26, colour=(70, 74, 78)),
        box((0.62, 0.2, 0.03), (1.3, 0, 6.305), colour=(250, 240, 208)),
    ]
    return model("street_lamp", parts, foot=(0.3, 0.3))


def _park_lamp() -> Model:
    parts = [
        lathe(
            [(0.12, 0), (0.12, 0.4), (0.06, 0.5), (0.045, 3.3), (0.12, 3.4), (0, 3.45)], sides=8, colour=(40, 52, 46)
        ),
        ball((0.2, 0.2, 0.24), (0, 0, 3.62), colour=(250, 240, 212), sides=8, rings=5),
        lathe([(0.24, 3.8), (0.0, 4.0)], sides=8, colour=(40, 52, 46)),
    ]
    return model("park_lamp", parts, kind="street_lamp", foot=(0.28, 0.28))


def _fire_hydrant() -> Model:
    parts = [
        lathe([(0.16, 0), (0.16, 0.05), (0.11, 0.06), (0.11, 0.55), (0.14, 0.56), (0.14, 0.6), (0.09, 0.72), (0, 0.76)],
              sides=8, colour=RED),
        box((0.12, 0.36, 0.12), (0, 0, 0.42), colour=RED),
        box((0.3, 0.12, 0.12), (0.05, 0, 0.42), colour=YELLOW),
    ]  # fmt: skip
    return model("fire_hydrant", parts)


def _advertising_column() -> Model:
    parts = [
        cylinder(0.68, 0.3, colour=STONE, sides=14),
        cylinder(0.6, 2.5, colour=(214, 202, 178), sides=14, centre=(0, 0, 0.3)),
        cylinder(0.7, 0.25, colour=GREEN, sides=14, centre=(0, 0, 2.8)),
        lathe([(0.7, 3.05), (0.3, 3.35), (0.0, 3.5)], sides=14, colour=GREEN),
    ]
    tones: tuple[Colour, ...] = ((176, 62, 54), (58, 96, 136), (214, 170, 70), (86, 128, 92), (120, 84, 120))
    for k, tone in enumerate(tones):
        turn = 2 * math.pi * k / 5
        x, y = 0.585 * math.cos(turn), 0.585 * math.sin(turn)
        parts.append(box((0.06, 0.55, 1.3), (x, y, 1.6), colour=tone, yaw=turn))
    return model("advertising_column", parts)


def _board(name: str, wide: float, high: float, lift: float, tones: tuple[Colour, Colour, Colour], legs: int) -> Model:
    """A framed board with a picture of three tones on both sides."""
    paper, shape, line = tones
    parts = [
        box((0.1, wide, high), (0, 0, lift + high / 2), colour=IRON),
        box((0.11, wide - 0.12, high - 0.12), (0, 0, lift + high / 2), colour=paper),
        box((0.114, wide - 0.12, high * 0.3), (0, 0, lift + high * 0.25), colour=shape),
        box((0.118, wide * 0.3, high * 0.4), (0, -wide * 0.2, lift + high * 0.36), colour=line),
        box((0.118, wide * 0.4, high * 0.08), (0, wide * 0.16, lift + high * 0.82), colour=line),
        box((0.118, wide * 0.4, high * 0.04), (0, wide * 0.16, lift + high * 0.70), colour=shape),
        box((0.118, wide * 0.4, high * 0.04), (0, wide * 0.16, lift + high * 0.62), colour=shape),
    ]
    for k in range(legs):
        y = 0.0 if legs == 1 else (k - 0.5) * (wide - 0.3)
        parts.append(post(lift, 0.06, IRON, y=y))
    return model(name, parts)


def _flagpole() -> Model:
    parts = [
        lathe([(0.12, 0), (0.08, 0.3), (0.045, 8.0), (0.08, 8.06), (0, 8.16)], sides=7, colour=WHITE),
        box((0.9, 0.012, 0.55), (0.5, 0, 7.6), colour=(48, 88, 160)),
        box((0.9, 0.016, 0.14), (0.5, 0, 7.6), colour=WHITE),
    ]
    return model("flagpole", parts, foot=(0.25, 0.25))


def _obelisk() -> Model:
    parts = [
        box((1.6, 1.6, 0.4), (0, 0, 0.2), colour=STONE),
        box((1.0, 1.0, 0.8), (0, 0, 0.8), colour=STONE),
        cylinder(0.5, 5.0, top=0.3, sides=4, colour=(170, 162, 150), centre=(0, 0, 1.2)),
        cylinder(0.3, 0.4, top=0.01, sides=4, colour=(150, 142, 130), centre=(0, 0, 6.2)),
    ]
    return model("obelisk", parts, kind="monument")


def _bike_station() -> Model:
    """A dock for ten bicycles along y; they stand in front of it, towards +x."""
    parts = [
        box((0.5, 0.4, 1.7), (-0.1, 3.4, 0.85), colour=(250, 196, 40)),
        box((0.02, 0.28, 0.4), (0.16, 3.4, 1.35), colour=(36, 44, 52)),
    ]
    parts.append(box((0.2, 6.2, 0.08), (0, 0, 0.04), colour=(70, 74, 78)))
    for k in range(10):
        y = -2.8 + 0.62 * k
        parts += [
            box((0.14, 0.1, 0.7), (0, y, 0.4), colour=(70, 74, 78)),
            box((0.2, 0.12, 0.12), (0.04, y, 0.74), colour=(250, 196, 40)),
        ]
    return model("bike_station", parts, group="transit")


def _clock() -> Model:
    parts = [
        post(3.4, 0.07, (36, 48, 44)),
        box((0.26, 0.8, 0.8), (0, 0, 3.75), colour=(36, 48, 44)),
        box((0.28, 0.66, 0.66), (0, 0, 3.75), colour=WHITE),
        box((0.29, 0.04, 0.26), (0, 0, 3.86), colour=(20, 20, 20)),
        box((0.29, 0.2, 0.04), (0, 0.09, 3.75), colour=(20, 20, 20)),
    ]
    return model("clock", parts, foot=(0.2, 0.2))


def _charging_station() -> Model:
    parts = [
        box((0.35, 0.5, 1.6), (0, 0, 0.8), colour=WHITE),
        box((0.02, 0.4, 0.3), (0.18, 0, 1.3), colour=(40, 60, 70)),
        box((0.36, 0.51, 0.14), (0, 0, 0.98), colour=(76, 168, 84)),
        box((0.1, 0.1, 0.3), (0.22, 0.14, 0.7), colour=(28, 30, 30)),
    ]
    return model("charging_station", parts)


def _parcel_locker() -> Model:
    parts = [box((0.7, 3.2, 2.1), (0, 0, 1.05), colour=(214, 150, 40))]
    for k in range(6):
        for j in range(4):
            if (k, j) != (3, 2):
                parts.append(box((0.01, 0.46, 0.44), (0.352, -1.3 + 0.52 * k, 0.32 + 0.5 * j), colour=(240, 220, 170)))
    parts.append(box((0.01, 0.4, 0.36), (0.352, 0.26, 1.34), colour=(36, 44, 52)))
    return model("parcel_locker", parts)


def _binoculars() -> Model:
    parts = [post(1.25, 0.06, STEEL), box((0.4, 0.3, 0.24), (0, 0, 1.4), colour=STEEL)]
    parts += [cylinder(0.07, 0.16, sides=7, colour=IRON).moved(tilted(0.18, y, 1.42)) for y in (-0.08, 0.08)]
    return model("binoculars", parts)


def _planter() -> Model:
    parts = [lathe([(0.38, 0), (0.5, 0.55), (0.5, 0.55), (0.42, 0.55), (0.4, 0.48), (0, 0.48)], sides=8, colour=STONE)]
    tones: tuple[Colour, ...] = ((92, 136, 66), (196, 74, 96), (224, 190, 80), (88, 126, 60), (190, 90, 160))
    for k, tone in enumerate(tones):
        turn = 2 * math.pi * k / 5
        parts.append(ball((0.18, 0.18, 0.2), (0.22 * math.cos(turn), 0.22 * math.sin(turn), 0.6), colour=tone, sides=6,
                          rings=4))  # fmt: skip
    return model("planter", parts)


def _subway_entrance() -> Model:
    """A canopy over stairs that open to +x."""
    parts = [
        box((4.2, 0.25, 1.0), (0, 1.35, 0.5), colour=STONE),
        box((4.2, 0.25, 1.0), (0, -1.35, 0.5), colour=STONE),
        box((0.25, 2.9, 1.0), (-2.0, 0, 0.5), colour=STONE),
        box((4.5, 3.2, 0.12), (0, 0, 2.7), colour=IRON),
        box((0.1, 1.6, 0.5), (2.2, 0, 2.4), colour=(244, 124, 36)),
        box((3.9, 2.45, 0.02), (0, 0, 0.02), colour=(40, 40, 42)),
    ]
    parts += [box((0.1, 0.1, 2.7), (x, y, 1.35), colour=IRON) for x in (-2.0, 2.0) for y in (-1.35, 1.35)]
    parts += [box((0.3, 2.45, 0.03), (1.8 - 0.4 * k, 0, 0.03), colour=(90 - 12 * k,) * 3) for k in range(5)]
    return model("subway_entrance", parts, group="transit")


def _pole(name: str, height: float, radius: float, colour: Colour) -> Model:
    return model(name, [post(height, radius, colour)], foot=(2 * radius, 2 * radius))


def _table_tennis() -> Model:
    parts = [
        box((1.52, 2.74, 0.08), (0, 0, 0.76), colour=(64, 104, 128)),
        box((1.6, 0.03, 0.16), (0, 0, 0.88), colour=STEEL),
        box((0.8, 0.3, 0.72), (0, 0.8, 0.36), colour=STONE),
        box((0.8, 0.3, 0.72), (0, -0.8, 0.36), colour=STONE),
    ]
    return model("table_tennis", parts, top=Top("table", 0.8, (1.5, 2.7)))


def _swing() -> Model:
    parts = [box((0.08, 3.2, 0.08), (0, 0, 2.3), colour=RED)]
    for y in (-1.5, 1.5):
        parts += [box((0.08, 0.08, 2.3), (x, y, 1.15), colour=BLUE) for x in (-0.5, 0.5)]
        parts.append(box((1.1, 0.08, 0.08), (0, y, 2.28), colour=BLUE))
    for y in (-0.6, 0.6):
        parts.append(box((0.2, 0.5, 0.04), (0, y, 0.5), colour=(30, 30, 30)))
        parts += [box((0.015, 0.015, 1.8), (0, y + s, 1.4), colour=STEEL) for s in (-0.22, 0.22)]
    return model("swing", parts, kind="playground")


def _slide() -> Model:
    chute = extrusion([(-0.2, 1.35), (1.9, 0.2), (1.9, 0.3), (-0.2, 1.45)], 0.5, colour=YELLOW)
    parts = [chute, box((0.7, 0.7, 0.08), (-0.55, 0, 1.4), colour=BLUE)]
    parts += [box((0.07, 0.07, 2.2), (x, y, 1.1), colour=RED) for x in (-0.85, -0.25) for y in (-0.3, 0.3)]
    parts += [box((0.05, 0.6, 0.05), (-0.95, 0, 0.3 * k + 0.2), colour=STEEL) for k in range(4)]
    parts.append(lathe([(0.62, 2.1), (0.0, 2.6)], sides=4, colour=RED).moved(pose_matrix(-0.55, 0, 0)))
    return model("slide", parts, kind="playground")


@cache
def street_models() -> dict[str, Model]:
    """Models of everything that stands outdoors, by prototype name."""
    models = [
        _bench(), _picnic_table(), _waste_basket(), _recycling(), _fountain(), _post_box(),
        _vending_machine(), _parking_meter(), _atm(), _drinking_water(), _bollard(), _street_lamp(),
        _park_lamp(), _fire_hydrant(), _advertising_column(), _flagpole(),
        _obelisk(), _bike_station(), _clock(),
        _charging_station(), _parcel_locker(), _binoculars(), _planter(), _subway_entrance(),
        _table_tennis(), _swing(), _slide(),
        _board("billboard", 3.6, 2.6, 1.6, ((226, 214, 186), (58, 110, 150), (206, 92, 56)), 2),
        _board("poster_box", 1.3, 1.9, 0.5, ((214, 222, 226), (176, 62, 74), (40, 48, 60)), 2),
        _board("information", 1.5, 1.1, 0.9, ((226, 230, 214), (96, 140, 92), (60, 92, 130)), 2),
        _board("sign", 0.6, 0.6, 2.0, ((44, 90, 160), (44, 90, 160), (232, 232, 228)), 1),
        _pole("pillar", 3.0, 0.25, STONE),
    ]  # fmt: skip
    lots = [models, civic_models(), traffic_models(), play_models(), barrier_models(), plant_models()]
    return {m.name: m for lot in lots for m in lot}
