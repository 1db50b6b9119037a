"""Draw a sheet of cities: of each world a street and a square, at eye height, with its name.

python scripts/cities_sheet.py docs/images/cities.jpg WORLD... [--columns 3] [--width 480]

Worlds are named by their folders. The street is the first of the world's own views that has houses on both sides. The
square is the widest place where people walk and nobody drives; it is seen from its edge towards the most houses.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np
import shapely
from PIL import Image, ImageDraw, ImageFont
from scipy import ndimage

from vico.world.folder import read_world
from vico.world.walkable import OPEN, SIDEWALK
from vico.world.world import World
from vico.worldgen.previews import Viewpoint, render_views, viewpoints

_EYE, _LABEL = 1.7, 22
_TURNS = (-0.7, -0.35, 0.35, 0.7)  # directions in which houses are to stand along a street, radians
_CLOSE, _NEAR, _FAR = 18.0, 70.0, 110.0  # metres: houses round a square, from and to, and along a street
_SQUARE, _WIDE = 7.0, 20.0  # metres from the middle of a square to its edge: the least, and what counts as wide
_MARGIN = 40.0  # metres from the world's edge


def sheet(worlds: list[Path], columns: int, width: int) -> Image.Image:
    """Return the pictures of all worlds, a pair each, in rows."""
    height = width * 9 // 16
    rows = -(-len(worlds) // columns)
    picture = Image.new("RGB", (columns * (2 * width + 6), rows * (height + _LABEL)), "white")
    draw, font = ImageDraw.Draw(picture), ImageFont.load_default(size=15)
    for k, folder in enumerate(worlds):
        x, y = k % columns * (2 * width + 6), k // columns * (height + _LABEL)
        draw.text((x + 4, y + 2), folder.name.replace("_", " ").title(), fill="black", font=font)
        world = read_world(folder)
        walls = shapely.STRtree([shapely.Polygon(building.footprint[0]) for building in world.buildings])
        for j, frame in enumerate(render_views(world, [street_of(world, walls), square_of(world, walls)])):
            small = Image.fromarray(frame).resize((width, height), Image.Resampling.LANCZOS)
            picture.paste(small, (x + j * width, y + _LABEL))
    return picture


def street_of(world: World, walls: shapely.STRtree) -> Viewpoint:
    """Return the first of a world's views that looks along a street with houses on both sides."""
    spots = viewpoints(world, count=24)

    def met(spot: Viewpoint) -> int:
        yaw = math.atan2(spot.forward[1], spot.forward[0])
        return sum(_meets(walls, spot.position[:2], yaw + turn, _FAR) < _FAR for turn in _TURNS)

    return next((spot for spot in spots if met(spot) >= len(_TURNS) - 1), spots[0])


def square_of(world: World, walls: shapely.STRtree) -> Viewpoint:
    """Return a view across the widest place where people walk and nobody drives."""
    walkable = world.walkable
    edge = round(_MARGIN / walkable.cell)
    room = np.zeros(walkable.cls.shape)
    for kinds in ((SIDEWALK,), (SIDEWALK, OPEN)):  # squares that are mapped, else open ground
        free = np.isin(walkable.cls, kinds) & walkable.connected
        free[:edge], free[-edge:], free[:, :edge], free[:, -edge:] = False, False, False, False
        room = np.minimum(ndimage.distance_transform_edt(free) * walkable.cell, _WIDE)
        if room.max() >= _SQUARE:
            break
    # Of places that are as wide the one with most houses round it.
    best, chosen = -1.0, (0.0, 0.0, 1.0)
    for iy, ix in np.argwhere(room >= 0.7 * room.max())[::97].tolist():
        x, y = walkable.centre_of((ix, iy)).tolist()
        turns = np.linspace(0, 2 * math.pi, 24, endpoint=False)
        away = np.array([_meets(walls, (x, y), turn, _NEAR) for turn in turns])
        around = ((away > _CLOSE) & (away < _NEAR)).astype(float)
        worth = around.sum() + room[iy, ix] / 10
        if worth > best:
            ahead = [around[(np.arange(-3, 4) + k) % 24].sum() for k in range(24)]
            best, chosen = worth, (x, y, float(turns[int(np.argmax(ahead))]))
    x, y, yaw = chosen
    reach = 0.8 * float(room[tuple(walkable.cell_of((x, y))[::-1])])
    x, y = x - reach * math.cos(yaw), y - reach * math.sin(yaw)
    z = float(world.height((x, y))) + _EYE
    return Viewpoint((x, y, z), (math.cos(yaw), math.sin(yaw), 0.06))


def _meets(walls: shapely.STRtree, start: tuple[float, float], yaw: float, far: float) -> float:
    """Return how far away a house is in a direction; `far` where none is nearer."""
    x, y = start
    ray = shapely.LineString([(x, y), (x + far * math.cos(yaw), y + far * math.sin(yaw))])
    near = [walls.geometries[k] for k in walls.query(ray, predicate="intersects").tolist()]
    return min((float(shapely.distance(shapely.Point(x, y), house)) for house in near), default=far)


def main() -> None:
    """Draw the sheet."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("worlds", type=Path, nargs="+")
    parser.add_argument("--columns", type=int, default=3)
    parser.add_argument("--width", type=int, default=480)
    arguments = parser.parse_args()
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    sheet(arguments.worlds, arguments.columns, arguments.width).save(arguments.out, quality=88)


if __name__ == "__main__":
    main()
