"""Pictures of a finished world: its map, the square from straight above, and views at eye height.

The map is drawn from above, with legend, scale bar and attribution. Views are taken from spots on sidewalks that look
along streets.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from vico.geo import overlay
from vico.io.compiled import compiled
from vico.render.cameras import Cameras
from vico.render.frames import render, render_top_down
from vico.render.scene import Scene
from vico.render.world_scene import scene_of
from vico.threads import for_each, in_order, meanwhile
from vico.world.model import ENTITY_GREEN, ENTITY_ROAD, ENTITY_WATER, Category
from vico.world.walkable import CROSSING, OPEN, SIDEWALK
from vico.world.world import World

_TILT = 0.02  # radians, a little up: more facades, less pavement


@dataclass(frozen=True)
class Viewpoint:
    """A camera at eye height: `position` and `forward`, ENU; `fov_y` radians."""

    position: tuple[float, float, float]
    forward: tuple[float, float, float]
    fov_y: float = math.radians(62.0)
    width: int = 960
    height: int = 540


@dataclass(frozen=True)
class Overhead:
    """The whole square of a world from straight above, north up; side in pixels."""

    side: int = 1200


def viewpoints(world: World, *, count: int = 8) -> list[Viewpoint]:
    """Choose spots on sidewalks that look along streets: open, varied, far from each other.

    Returns
    -------
    list of Viewpoint
        At most `count`, at 1.7 m; the same for the same world.
    """
    half = world.half
    shapes = [shapely.Polygon(b.footprint[0], b.footprint[1:]) for b in world.buildings]
    walls = shapely.STRtree(shapes)
    objects = world.objects.where(world.objects.outdoors)
    things = objects.position[:, :2] if len(objects) else np.zeros((0, 2))
    trees = things[objects.kind == "tree"] if len(objects) else things
    found: list[tuple[float, tuple[float, float], float]] = []
    ways = [road for road in world.roads.roads if road.layer == 0]
    streets = [road for road in ways if road.lanes or road.kind == "pedestrian"]
    # Where there is no street, footways are where people look from.
    for road in streets or ways:
        line = shapely.LineString(road.line)
        for d in np.arange(min(10.0, line.length / 2), line.length, 22.0):
            here, ahead = line.interpolate(d), line.interpolate(min(d + 2.0, line.length))
            back = line.interpolate(max(d - 2.0, 0.0))
            yaw = math.atan2(ahead.y - back.y, ahead.x - back.x)
            for turn in (0.0, math.pi):
                spot = _beside(world, (here.x, here.y), yaw + turn, road.width / 2 + 1.6 if road.lanes else 0.0)
                if spot is None or max(abs(spot[0]), abs(spot[1])) > 0.9 * half:
                    continue
                score = _openness(spot, yaw + turn, walls, shapes, things, trees, half)
                if score is not None:
                    found.append((score, spot, yaw + turn))
    found.sort(key=lambda row: (-row[0], row[1]))
    chosen: list[tuple[tuple[float, float], float]] = []
    for apart in (0.45 * half, 0.25 * half, 0.1 * half):
        for _, spot, yaw in found:
            if len(chosen) < count and all(math.dist(spot, other) > apart for other, _ in chosen):
                chosen.append((spot, yaw))
    views = []
    for (x, y), yaw in chosen:
        z = float(world.height((x, y))) + 1.7
        forward = (math.cos(yaw) * math.cos(_TILT), math.sin(yaw) * math.cos(_TILT), math.sin(_TILT))
        views.append(Viewpoint((x, y, z), forward))
    return views


def _beside(world: World, xy: tuple[float, float], yaw: float, aside: float) -> tuple[float, float] | None:
    """Find a free spot on the right-hand sidewalk."""
    for distance in (aside, aside + 0.7, aside + 1.4, aside - 0.5):
        spot = (xy[0] + math.sin(yaw) * distance, xy[1] - math.cos(yaw) * distance)
        if int(world.walkable.class_at(spot)) in (SIDEWALK, CROSSING, OPEN) and bool(world.walkable.is_connected(spot)):
            return round(spot[0], 2), round(spot[1], 2)
    return None


def _openness(
    spot: tuple[float, float],
    yaw: float,
    walls: shapely.STRtree,
    shapes: Sequence[shapely.Polygon],
    things: NDArray[np.float64],
    trees: NDArray[np.float64],
    half: float,
) -> float | None:
    """How good a view is: far, with facades to the sides and trees within, nothing before the lens; None: hidden."""
    ahead = np.array([math.cos(yaw), math.sin(yaw)])
    point = shapely.Point(spot)
    reach = 220.0
    for spread in (-0.14, 0.0, 0.14):
        far = (spot[0] + reach * math.cos(yaw + spread), spot[1] + reach * math.sin(yaw + spread))
        ray = shapely.LineString([spot, far])
        hits = walls.query(ray, predicate="intersects")
        free = min((point.distance(overlay.crossing(shapes[i], ray)) for i in hits.tolist()), default=reach)
        if free < 35.0:
            return None
        if spread == 0.0:
            depth = free
    beyond = np.array(spot) + ahead * 100.0
    if np.abs(beyond).max() > half:  # looks out of the world
        return None
    score = min(depth, 160.0)
    rel = things - np.array(spot)
    along, across = rel @ ahead, rel @ np.array([-ahead[1], ahead[0]])
    if ((along > -0.5) & (along < 7.0) & (np.abs(across) < 1.0 + 0.35 * np.maximum(along, 0.0))).any():
        return None
    score += 1.5 * min(int(((along > 0) & (along < 60) & (np.abs(across) < 20)).sum()), 30)
    rel = trees - np.array(spot)
    if (np.hypot(*rel.T) < 7.0).any():  # no leaves before the lens
        return None
    score += 4.0 * min(int((np.hypot(*rel.T) < 50).sum()), 8)
    near = walls.query(overlay.buffer(point, 25.0), predicate="intersects")
    return score + 6.0 * min(len(near), 6)


Rgb = tuple[int, int, int]

_MAP_SIDE = 1500  # pixels a side of the map proper
_PANEL_WIDTH = 380
_PAPER: Rgb = (246, 243, 236)
_INK: Rgb = (52, 54, 58)
_GROUNDS: dict[int, Rgb] = {ENTITY_ROAD: (206, 207, 212), ENTITY_GREEN: (205, 224, 190), ENTITY_WATER: (160, 200, 226)}
_BUILDING: Rgb = (168, 156, 148)
_ACCESSIBLE: Rgb = (192, 172, 152)
_OUTLINE: Rgb = (118, 106, 100)

# Okabe and Ito's colours, distinct for all kinds of colour vision; a shape of its own for each.
_MARKS: dict[Category, tuple[Rgb, str]] = {
    Category.ACCOMMODATION: ((0, 114, 178), "square"),
    Category.FOOD: ((213, 94, 0), "circle"),
    Category.STORE: ((230, 159, 0), "triangle"),
    Category.OFFICE: ((86, 180, 233), "square"),
    Category.ENTERTAINMENT: ((204, 121, 167), "diamond"),
    Category.OPEN: ((0, 128, 96), "circle"),
    Category.TRANSIT: ((30, 30, 30), "diamond"),
}


@compiled
def _fill_triangles(image, corners, colours):
    """Fill triangles given in pixels, shape (m, 3, 2); where two meet in a pixel's centre the later wins."""
    n = image.shape[0]
    for t in range(len(corners)):
        ax, ay = corners[t, 0]
        bx, by = corners[t, 1]
        cx, cy = corners[t, 2]
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if area == 0.0:
            continue
        j0, j1 = max(0, int(min(ay, by, cy) - 0.5)), min(n - 1, int(max(ay, by, cy) + 0.5))
        i0, i1 = max(0, int(min(ax, bx, cx) - 0.5)), min(n - 1, int(max(ax, bx, cx) + 0.5))
        for j in range(j0, j1 + 1):
            for i in range(i0, i1 + 1):
                x, y = i + 0.5, j + 0.5
                u = ((bx - x) * (cy - y) - (cx - x) * (by - y)) / area
                v = ((cx - x) * (ay - y) - (ax - x) * (cy - y)) / area
                if u >= 0.0 and v >= 0.0 and u + v <= 1.0:
                    for k in range(3):
                        image[j, i, k] = colours[t, k]


def _map_picture(world: World) -> Image.Image:
    """Draw a world from above with legend, scale bar, north arrow and attribution."""
    scale = 2  # drawn larger, then reduced
    side = _MAP_SIDE * scale
    metre = side / (2 * world.half)

    def at(xy: Sequence[float] | NDArray[np.float64]) -> tuple[float, float]:
        return (float(xy[0]) + world.half) * metre, (world.half - float(xy[1])) * metre

    pixels = np.empty((side, side, 3), np.uint8)
    pixels[:] = _PAPER
    for surface in world.surfaces("ground"):
        entity = surface.entity[surface.triangles[:, 0]]
        for number in (ENTITY_GREEN, ENTITY_WATER, ENTITY_ROAD):
            chosen = surface.triangles[entity == number]
            if len(chosen):
                corners = surface.positions[chosen][..., :2].astype(np.float64)
                corners = np.stack([(corners[..., 0] + world.half), (world.half - corners[..., 1])], axis=-1) * metre
                _fill_triangles(pixels, corners, np.tile(np.array(_GROUNDS[number], np.uint8), (len(chosen), 1)))
    image = Image.fromarray(pixels)
    draw = ImageDraw.Draw(image)
    for road in world.roads.roads:
        if road.lanes == 0 and road.layer >= 0:
            draw.line([at(p) for p in road.line], fill=(226, 214, 190), width=max(2, int(1.2 * metre)))
    for building in world.buildings:
        rings = [[at(p) for p in ring] for ring in building.footprint]
        draw.polygon(rings[0], fill=_ACCESSIBLE if building.accessible else _BUILDING)
        for hole in rings[1:]:
            draw.polygon(hole, fill=_PAPER)
        for ring in rings:
            draw.line([*ring, ring[0]], fill=_OUTLINE, width=2)
    trees = world.objects.where((world.objects.kind == "tree") & world.objects.outdoors)
    for xy in trees.position:
        x, y = at(xy)
        r = 1.7 * metre
        draw.ellipse((x - r, y - r, x + r, y + r), fill=(126, 168, 104))
    # A tile's lines use lanes of other tiles, too.
    lanes = world.lanes
    for line in world.transit.lines:
        for there, names in groupby(line.lanes, lambda name: name in lanes.index):
            points = [at(p) for name in names if there for p in lanes.line(lanes.index[name]).tolist()]
            if len(points) > 1:
                draw.line(points, fill=line.colour, width=2 * scale, joint="curve")
    _street_names(image, world, at, metre, scale)
    draw = ImageDraw.Draw(image)
    for place in sorted(world.places, key=lambda p: list(_MARKS).index(p.category)):
        colour, shape = _MARKS[place.category]
        _mark(draw, at(place.position), 5.0 * scale, colour, shape)
    image = image.resize((_MAP_SIDE, _MAP_SIDE), Image.Resampling.BOX)
    canvas = Image.new("RGB", (_MAP_SIDE + _PANEL_WIDTH, _MAP_SIDE), (255, 255, 255))
    canvas.paste(image, (0, 0))
    _legend(ImageDraw.Draw(canvas), world)
    return canvas


def _street_names(
    image: Image.Image,
    world: World,
    at: Callable[[Sequence[float]], tuple[float, float]],
    metre: float,
    scale: int,
) -> None:
    """Each street's name once, along its longest straight stretch."""
    font = ImageFont.load_default(size=11 * scale)
    longest: dict[str, tuple[float, tuple[float, float], tuple[float, float]]] = {}
    for road in world.roads.roads:
        if road.name is None or (road.lanes == 0 and road.kind != "pedestrian"):
            continue
        a, b = road.line[0], road.line[-1]
        length = math.dist(a, b)
        if length > longest.get(road.name, (0.0, a, b))[0]:
            longest[road.name] = (length, a, b)
    for name in sorted(longest):
        length, a, b = longest[name]
        wide = font.getlength(name)
        if length * metre < wide * 0.9:
            continue
        label = Image.new("RGBA", (int(wide) + 8, 18 * scale), (255, 255, 255, 0))
        ImageDraw.Draw(label).text(
            (4, 1 * scale),
            name,
            font=font,
            fill=(70, 72, 80, 255),
            stroke_width=scale,
            stroke_fill=(255, 255, 255, 255),
        )
        angle = math.degrees(math.atan2(b[1] - a[1], b[0] - a[0]))
        angle = (angle + 90) % 180 - 90
        turned = label.rotate(angle, expand=True, resample=Image.Resampling.BICUBIC)
        x, y = at(((a[0] + b[0]) / 2, (a[1] + b[1]) / 2))
        image.paste(turned, (int(x - turned.width / 2), int(y - turned.height / 2)), turned)


def _mark(draw: ImageDraw.ImageDraw, xy: tuple[float, float], r: float, colour: Rgb, shape: str) -> None:
    x, y = xy
    edge = (255, 255, 255)
    wide = max(1, int(r / 5))
    if shape == "circle":
        draw.ellipse((x - r, y - r, x + r, y + r), fill=colour, outline=edge, width=wide)
    elif shape == "square":
        draw.rectangle((x - 0.85 * r, y - 0.85 * r, x + 0.85 * r, y + 0.85 * r), fill=colour, outline=edge, width=wide)
    elif shape == "triangle":
        draw.polygon([(x, y - 1.15 * r), (x + 1.1 * r, y + 0.8 * r), (x - 1.1 * r, y + 0.8 * r)], fill=colour,
                     outline=edge)  # fmt: skip
    else:
        draw.polygon([(x, y - 1.2 * r), (x + 1.2 * r, y), (x, y + 1.2 * r), (x - 1.2 * r, y)], fill=colour,
                     outline=edge)  # fmt: skip


def _legend(draw: ImageDraw.ImageDraw, world: World) -> None:
    x, y = _MAP_SIDE + 28, 30
    big, middle, small = (ImageFont.load_default(size=size) for size in (28, 17, 13))
    origin = world.manifest.origin
    draw.text((x, y), world.manifest.name.replace("_", " ").title(), font=big, fill=_INK)
    draw.text((x, y + 42), f"{origin.lat:.4f}, {origin.lon:.4f}", font=small, fill=_INK)
    draw.text((x, y + 60), f"{2 * world.half:.0f} m x {2 * world.half:.0f} m", font=small, fill=_INK)
    # North arrow.
    nx, ny = x + 300, y + 34
    draw.polygon([(nx, ny - 34), (nx + 13, ny + 22), (nx, ny + 12), (nx - 13, ny + 22)], fill=_INK)
    draw.text((nx - 6, ny + 26), "N", font=middle, fill=_INK)
    y += 110
    draw.text((x, y), "Places", font=middle, fill=_INK)
    y += 32
    count = Counter(place.category for place in world.places)
    for category, (colour, shape) in _MARKS.items():
        _mark(draw, (x + 9, y + 9), 9, colour, shape)
        draw.text((x + 30, y), f"{category.value}  ({count[category]})", font=middle, fill=_INK)
        y += 30
    y += 22
    rows: list[tuple[str, Rgb]] = [
        ("building people can enter", _ACCESSIBLE),
        ("other building", _BUILDING),
        ("carriageway", _GROUNDS[ENTITY_ROAD]),
        ("green", _GROUNDS[ENTITY_GREEN]),
        ("water", _GROUNDS[ENTITY_WATER]),
        ("tree", (126, 168, 104)),
    ]
    for text, colour in rows:
        draw.rectangle((x, y, x + 20, y + 16), fill=colour, outline=_OUTLINE)
        draw.text((x + 30, y - 2), text, font=middle, fill=_INK)
        y += 28
    for line in world.transit.lines[:8]:
        draw.line((x, y + 9, x + 20, y + 9), fill=line.colour, width=4)
        name = line.name if len(line.name) < 30 else f"{line.name[:28]}…"
        draw.text((x + 30, y - 2), f"bus {name}", font=middle, fill=_INK)
        y += 28
    # Scale bar.
    metre = _MAP_SIDE / (2 * world.half)
    length = next(m for m in (500, 200, 100, 50, 20, 10) if m * metre <= 300)
    y = _MAP_SIDE - 150
    for k in range(4):
        a, b = x + k * length * metre / 4, x + (k + 1) * length * metre / 4
        draw.rectangle((a, y, b, y + 9), fill=_INK if k % 2 == 0 else (255, 255, 255), outline=_INK)
    draw.text((x - 3, y + 14), "0", font=small, fill=_INK)
    draw.text((x + length * metre - 22, y + 14), f"{length} m", font=small, fill=_INK)
    y += 50
    for source in world.manifest.sources:
        draw.text((x, y), f"{source.attribution} ({source.licence})", font=small, fill=_INK)
        y += 18


_VIEWS = 8
_PNG_LEVEL = 2  # a tenth larger than 6, which takes four times as long


def write_previews(world: World, folder: Path, *, views: bool) -> dict[str, int]:
    """Write ``map.png`` and, with `views`, the rendered pictures of ``previews/``; return how many there are."""
    if not views:
        write_map(world, folder)
        return {"maps": 1, "views": 0}
    scene = meanwhile(lambda: _lit_scene(world))
    write_map(world, folder)
    spots = viewpoints(world, count=_VIEWS)
    (folder / "previews").mkdir(exist_ok=True)
    names = ["above", *(f"view_{k}" for k in range(len(spots)))]
    frames = _render_views(scene(), world.half, [Overhead(), *spots])

    def save(taken: tuple[str, NDArray[np.uint8]]) -> None:
        name, frame = taken
        Image.fromarray(frame).save(folder / "previews" / f"{name}.png", compress_level=_PNG_LEVEL)

    for_each(save, zip(names, frames, strict=True))
    return {"maps": 1, "views": len(spots)}


def write_map(world: World, folder: Path) -> None:
    """Write ``map.png``."""
    _map_picture(world).save(folder / "map.png")


def render_views(world: World, views: Sequence[Viewpoint | Overhead]) -> Iterator[NDArray[np.uint8]]:
    """Render a world from viewpoints.

    Yields
    ------
    ndarray
        RGB, uint8, shape ``(height, width, 3)``, in the order of `views`.
    """
    return _render_views(_lit_scene(world), world.half, views)


def _lit_scene(world: World) -> Scene:
    scene = scene_of(world, rooms=False)
    scene.light()
    return scene


def _render_views(scene: Scene, half: float, views: Sequence[Viewpoint | Overhead]) -> Iterator[NDArray[np.uint8]]:
    def take(view: Viewpoint | Overhead) -> NDArray[np.uint8]:
        if isinstance(view, Overhead):
            return render_top_down(scene, half, view.side)
        cameras = Cameras(
            np.array([view.position]),
            np.array([view.forward]),
            fov_y=view.fov_y,
            width=view.width,
            height=view.height,
        )
        return render(scene, cameras, depth=False, segmentation=False, samples=2, threads=1).rgb[0]

    return in_order(take, views)
