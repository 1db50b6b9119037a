"""From the parts of a model's entry to its surfaces."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from vico.assets import shapes
from vico.assets.models import schema
from vico.assets.shapes import Colour
from vico.errors import InputError
from vico.seeds import rng
from vico.world.mesh import Surface

#: Colours of packets on a shelf, in turn.
PACKET_COLOURS: tuple[Colour, ...] = (
    (196, 72, 60), (222, 180, 70), (80, 140, 98), (76, 112, 168), (200, 130, 70), (238, 236, 226), (140, 86, 140),
)  # fmt: skip
_MIRRORS = {None: ((1, 1),), "x": ((1, 1), (-1, 1)), "y": ((1, 1), (1, -1)), "xy": ((1, 1), (1, -1), (-1, 1), (-1, -1))}
_ORIGIN = (0.0, 0.0, 0.0)
_DEEPEST = 8  # groups and assemblies inside each other

Palette = Mapping[str, schema.ColourSpec]


@dataclass(frozen=True)
class Placement:
    """Where a copy of a part stands: a point p of the part lies at ``linear @ p + offset``; shapes are turned by `yaw`.

    A mirrored placement moves points alone: the shape there is a copy, not a reflection.

    Attributes
    ----------
    linear
        Rotation about z and reflection, float64, shape ``(3, 3)``.
    offset
        Metres, float64, shape ``(3,)``.
    yaw
        Radians about z.
    number
        Which copy it is, from 0: chooses from lists of colours.
    """

    linear: NDArray[np.float64]
    offset: NDArray[np.float64]
    yaw: float = 0.0
    number: int = 0

    def point(self, p: schema.Point) -> NDArray[np.float64]:
        """Where a point of the part lies."""
        return self.linear @ np.asarray(p, np.float64) + self.offset


@dataclass(frozen=True)
class Scope:
    """What names mean at a part: colours, assemblies, and how deep it lies in groups."""

    colours: Palette
    assemblies: Mapping[str, schema.Assembly]
    depth: int = 0

    def deeper(self, colours: Palette | None = None) -> Scope:
        """Return the scope inside a group or an assembly."""
        if self.depth >= _DEEPEST:
            raise InputError(f"groups and assemblies lie more than {_DEEPEST} deep in each other")
        return replace(self, colours={**self.colours, **(colours or {})}, depth=self.depth + 1)

    def colour(self, spec: schema.ColourSpec | list[schema.ColourSpec], number: int) -> Colour:
        """Value of a colour, or of the one in a list that the copy `number` gets."""
        chosen = spec[number % len(spec)] if isinstance(spec, list) else spec
        for _ in range(_DEEPEST):
            if not isinstance(chosen, str):
                return chosen
            if chosen not in self.colours:
                raise InputError(f"no colour is called {chosen!r}; there are {', '.join(self.colours)}")
            chosen = self.colours[chosen]
        raise InputError(f"the colour {chosen!r} is named after itself")


HERE = Placement(np.eye(3), np.zeros(3))


def surfaces_of(parts: list[schema.Part], scope: Scope, place: Placement = HERE) -> list[Surface]:
    """Surfaces of the parts in their order, unjoined."""
    found: list[Surface] = []
    for part in parts:
        copies = list(copies_of(part, place))
        for copy in copies:
            if len(copies) == 1:
                copy = replace(copy, number=place.number)
            if isinstance(part, schema.GroupPart):
                found += _group(part, copy, scope)
            elif isinstance(part, schema.AssemblyPart):
                found += _assembly(part, copy, scope)
            elif isinstance(part, schema.PacketsPart):
                found += _packets(part, copy)
            else:
                found += _BUILDERS[part.shape](part, copy, scope.colour(part.colour, copy.number))
    return found


def copies_of(part: schema.Part, outer: Placement = HERE) -> Iterator[Placement]:
    """Where the copies of a part stand: mirrored places outermost, then the list `at`, then repeats."""
    places = part.at if isinstance(part.at, list) else [part.at]
    number = 0
    for sx, sy in _MIRRORS[part.mirror]:
        for at in places:
            for k in range(part.repeat):
                turned = math.radians(part.turn * k)
                linear = _about_z(turned)
                offset = linear @ np.asarray(at, np.float64) + k * np.asarray(part.step, np.float64)
                sign = np.array([sx, sy, 1.0])
                yield Placement(
                    outer.linear @ (sign[:, None] * linear),
                    outer.linear @ (sign * offset) + outer.offset,
                    outer.yaw + turned,
                    number,
                )
                number += 1


def _about_z(angle: float) -> NDArray[np.float64]:
    return shapes.pose_matrix(yaw=angle)[:3, :3] if angle else np.eye(3)


def _group(part: schema.GroupPart, place: Placement, scope: Scope) -> list[Surface]:
    inner = scope.deeper()
    if not part.pitch and not part.yaw:
        return surfaces_of(part.parts, inner, place)
    pitched = _pitch_matrix(math.radians(part.pitch))
    surfaces = surfaces_of(part.parts, inner, replace(HERE, number=place.number))
    matrix = _pose(place.offset, math.radians(part.yaw) + place.yaw) @ pitched
    return [surface.moved(matrix) for surface in surfaces]


def _pose(at: NDArray[np.float64], yaw: float = 0.0) -> NDArray[np.float64]:
    return shapes.pose_matrix(float(at[0]), float(at[1]), float(at[2]), yaw)


def _pitch_matrix(pitch: float) -> NDArray[np.float64]:
    c, s = np.cos(pitch), np.sin(pitch)
    return np.array([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1]])


def _assembly(part: schema.AssemblyPart, place: Placement, scope: Scope) -> list[Surface]:
    if part.name not in scope.assemblies:
        raise InputError(f"no assembly is called {part.name!r}; there are {', '.join(scope.assemblies)}")
    used = scope.assemblies[part.name]
    given = {name: scope.colour(spec, place.number) for name, spec in part.colours.items()}
    unknown = sorted(set(given) - set(used.colours))
    if unknown:
        raise InputError(f"the assembly {part.name!r} has no colour {unknown[0]!r} to change")
    return surfaces_of(used.parts, scope.deeper({**used.colours, **given}), place)


def _packets(part: schema.PacketsPart, place: Placement) -> list[Surface]:
    deep, length, high = part.size
    each = length / part.count
    x, y, z = place.offset
    row = []
    for k in range(part.count):
        tall = high * (0.72 + 0.14 * ((k + part.first) % 3))
        tone = PACKET_COLOURS[(k * 2 + part.first) % len(PACKET_COLOURS)]
        middle = (x, y - length / 2 + each * (k + 0.5), z + tall / 2)
        row.append(shapes.box((deep, each * 0.86, tall), middle, colour=tone))
    return row


def _pose_shape(part: schema.Part, place: Placement, make: Callable[[NDArray[np.float64]], Surface]) -> list[Surface]:
    """Return a shape made at a point if it stands upright and unturned, else made at the origin and moved."""
    turnable = cast("schema.BoxPart", part)
    yaw = math.radians(turnable.yaw) + place.yaw
    if turnable.facing == "up" and yaw == 0.0:
        return [make(place.offset)]
    if turnable.facing == "up":
        return [make(np.zeros(3)).moved(_pose(place.offset, yaw))]
    lay = shapes.facing_x if turnable.facing == "x" else shapes.facing_y
    matrix = lay(*place.offset)
    if yaw:
        matrix[:3, :3] = _about_z(yaw) @ matrix[:3, :3]
    return [make(np.zeros(3)).moved(matrix)]


def _box(part: schema.BoxPart, place: Placement, colour: Colour) -> list[Surface]:
    return _pose_shape(part, place, lambda at: shapes.box(part.size, at, colour=colour))


def _cylinder(part: schema.CylinderPart, place: Placement, colour: Colour) -> list[Surface]:
    def make(at: NDArray[np.float64]) -> Surface:
        return shapes.cylinder(
            part.radius, part.length, top=part.top_radius, sides=part.sides, colour=colour, centre=at
        )

    return _pose_shape(part, place, make)


def _lathe(part: schema.LathePart, place: Placement, colour: Colour) -> list[Surface]:
    def make(at: NDArray[np.float64]) -> Surface:
        solid = shapes.lathe(part.profile, sides=part.sides, colour=colour, centre=at, smooth=part.smooth)
        return shapes.inside_out(solid) if part.inside_out else solid

    return _pose_shape(part, place, make)


def _ball(part: schema.BallPart, place: Placement, colour: Colour) -> list[Surface]:
    return _pose_shape(
        part, place, lambda at: shapes.ball(part.radii, at, colour=colour, sides=part.sides, rings=part.rings)
    )


def _tube(part: schema.TubePart, place: Placement, colour: Colour) -> list[Surface]:
    path = [place.point(p) for p in part.path]
    return [
        shapes.tube(a, b, part.radius, colour, sides=part.sides, tip=part.end_radius)
        for a, b in itertools.pairwise(path)
    ]


def _ring(part: schema.RingPart, place: Placement, colour: Colour) -> list[Surface]:
    return [shapes.ring(place.offset, part.radius, part.width, colour, axis=part.axis, sides=part.sides)]


def _extrusion(part: schema.ExtrusionPart, place: Placement, colour: Colour) -> list[Surface]:
    solid = shapes.extrusion(part.outline, part.width, colour=colour)
    stays = part.at == _ORIGIN and not place.offset.any()  # moving it nowhere would change the signs of zeros
    return _pose_shape(part, place, lambda at: solid if stays else solid.moved(_pose(at)))


def _plate(part: schema.PlatePart, place: Placement, colour: Colour) -> list[Surface]:
    return [_facing_plate(part.outline, part.thickness, place, colour)]


def _disc(part: schema.DiscPart, place: Placement, colour: Colour) -> list[Surface]:
    outline = shapes.polygon(part.sides, part.radius, math.radians(part.angle))
    return [_facing_plate(outline, part.thickness, place, colour)]


def _facing_plate(outline: list[tuple[float, float]], thickness: float, place: Placement, colour: Colour) -> Surface:
    return shapes.plate(outline, thickness, colour, place.offset, yaw=place.yaw)


def _shade_colour(tone: Colour, shade: float) -> Colour:
    return min(int(tone[0] * shade), 255), min(int(tone[1] * shade), 255), min(int(tone[2] * shade), 255)


def _boards(part: schema.BoardsPart, place: Placement, colour: Colour) -> list[Surface]:
    (length, thick, height), (x, y, z) = part.size, place.offset
    wide = length / part.count - part.gap
    random = rng(0, "fence", part.seed)
    row = []
    for k in range(part.count):
        tone = _shade_colour(colour, float(random.uniform(0.86, 1.06)))
        top = height + float(random.uniform(-0.01, 0.01))
        middle = (x + (k + 0.5) * length / part.count - length / 2, y, z + (top - part.below) / 2)
        row.append(shapes.box((wide, thick, top + part.below), middle, colour=tone))
    return row


def _masonry(part: schema.MasonryPart, place: Placement, colour: Colour) -> list[Surface]:
    (length, thick, height), (x, y, z) = part.size, place.offset
    random = rng(0, "wall", part.seed)
    step, each = height / part.courses, length / part.blocks
    wall = []
    for j in range(part.courses):
        shift = 0.0 if j % 2 else each / 2
        for k in range(part.blocks if j % 2 else part.blocks - 1):
            tone = _shade_colour(colour, float(random.uniform(0.88, 1.1)))
            middle = (x + (k + 0.5) * length / part.blocks - length / 2 + shift, y, z + (j + 0.5) * step)
            wall.append(shapes.box((each - part.joint, thick, step - part.joint), middle, colour=tone))
    return wall


_BUILDERS: dict[str, Callable[..., list[Surface]]] = {
    "box": _box,
    "cylinder": _cylinder,
    "lathe": _lathe,
    "ball": _ball,
    "tube": _tube,
    "ring": _ring,
    "extrusion": _extrusion,
    "plate": _plate,
    "disc": _disc,
    "boards": _boards,
    "masonry": _masonry,
}
