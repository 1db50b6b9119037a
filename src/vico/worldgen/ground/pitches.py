"""Lines of sports fields, as flat quads."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from vico.worldgen.ground.strokes import ribbon


def pitch_lines(shape: Polygon, sport: str) -> list[NDArray[np.float64]]:
    """Lay out the lines of a sports field, fitted into its outline; empty for sports without."""
    box = shapely.minimum_rotated_rectangle(shape)
    if not isinstance(box, Polygon) or shape.area < 0.75 * box.area or shape.area < 80.0:
        return []
    corner = np.asarray(box.exterior.coords)[:4]
    u, v = corner[1] - corner[0], corner[3] - corner[0]
    if np.hypot(*u) < np.hypot(*v):
        u, v = v, u
    length, width = float(np.hypot(*u)), float(np.hypot(*v))
    u, v = u / length, v / width
    middle = corner.mean(axis=0)

    def at(points: list[tuple[float, float]]) -> NDArray[np.float64]:
        return np.array([middle + u * x + v * y for x, y in points])

    def frame(x0: float, y0: float, x1: float, y1: float) -> NDArray[np.float64]:
        return at([(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)])

    def circle(x: float, radius: float, start: float = 0.0, end: float = 360.0) -> NDArray[np.float64]:
        turn = np.radians(np.linspace(start, end, 25))
        return at([(x + radius * float(np.cos(t)), radius * float(np.sin(t))) for t in turn])

    name = sport.split(";")[0]
    if name == "tennis":
        a, b = min(length / 2 - 0.5, 11.885), min(width / 2 - 0.5, 5.485)
        s, net = b * 0.75, a * 0.5385
        lines = [frame(-a, -b, a, b), frame(-a, -s, a, s), frame(-net, -s, net, s), at([(-net, 0), (net, 0)])]
        lines.append(at([(0, -b), (0, b)]))
        thick = 0.06
    elif name in ("basketball", "multi", "netball", "streetball"):
        a, b = min(length / 2 - 0.4, 14.0), min(width / 2 - 0.4, 7.5)
        lines = [frame(-a, -b, a, b), at([(0, -b), (0, b)]), circle(0.0, min(1.8, b / 2))]
        for side in (-1.0, 1.0):
            basket, key = side * (a - 1.575), min(5.8, a * 0.45)
            lines.append(frame(side * a, -min(2.45, b), side * (a - key), min(2.45, b)))
            first = 90.0 if side > 0 else -90.0
            lines.append(circle(basket, min(6.75, b - 0.3), first, first + 180.0))
        thick = 0.07
    elif name in ("soccer", "football", "futsal", "handball"):
        a, b = length / 2 - 1.0, width / 2 - 1.0
        lines = [frame(-a, -b, a, b), at([(0, -b), (0, b)]), circle(0.0, min(9.15, 0.27 * b))]
        for side in (-1.0, 1.0):
            for deep, broad in ((16.5, 20.16), (5.5, 9.16)):
                deep, broad = min(deep, 0.32 * a), min(broad, broad / 34.0 * b)
                lines.append(frame(side * a, -broad, side * (a - deep), broad))
        thick = 0.12
    else:
        return []
    return [quad for line in lines for quad in ribbon(line, 0.0, thick)]
