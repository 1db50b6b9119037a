"""What hangs on facades and stands on flat roofs: balconies, fire escapes, water tanks; closed solids each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from vico.geo import overlay
from vico.worldgen.buildings.roofs.eaves import Edges, edges_of
from vico.worldgen.buildings.storeys import Storeys, storeys_of
from vico.worldgen.facades.catalogue import styles
from vico.worldgen.facades.looks import FacadeStyle
from vico.worldgen.facades.records import RegionalStyle
from vico.worldgen.facts.outlines.plans import BuildingPlan, PartPlan
from vico.worldgen.facts.outlines.roof_shapes import Roof

_LEAST_HEIGHT = 2.9  # metres under whatever hangs over a pavement
_MOST = 40  # pieces a building
_STOREY = 3.25  # metres: of an oriel


@dataclass(frozen=True)
class _Wall:
    """A wall to hang things on, `s` along it."""

    edges: Edges
    k: int
    storeys: Storeys
    bay: float

    @property
    def length(self) -> float:
        return float(self.edges.length[self.k])

    def box(self, s0: float, s1: float, d0: float, d1: float) -> Polygon:
        """Return a rectangle before the wall; side, front and side come first, the edge at the wall last."""
        start, along, out = self.edges.start[self.k], self.edges.along[self.k], self.edges.out[self.k]
        corners = [(s0, d0), (s0, d1), (s1, d1), (s1, d0)]
        return Polygon([start + along * s + out * d for s, d in corners])

    def bay_window(self, s0: float, s1: float) -> Polygon:
        """Return the canted outline of an oriel; its corners come in the order of a box's."""
        start, along, out = self.edges.start[self.k], self.edges.along[self.k], self.edges.out[self.k]
        corners = [(s0, 0.0), (s0 + _CANT, _ORIEL), (s1 - _CANT, _ORIEL), (s1, 0.0)]
        return Polygon([start + along * s + out * d for s, d in corners])


def projections(
    plan: BuildingPlan,
    look: FacadeStyle,
    fronts: list[NDArray[np.bool_]],
    free: Callable[[Polygon, float, float], bool],
    region: str,
    random: np.random.Generator,
) -> list[PartPlan]:
    """Balconies and fire escapes of a building, by the family of its facade.

    Parameters
    ----------
    plan, look
        The building and what it wears.
    fronts
        Of each part the edges that show a front, shape ``(n,)``.
    free
        Whether nothing stands in an outline between two heights above the building's base.
    region
        As `facades.catalogue.region_of` says.
    random
        The building's own stream.

    Returns
    -------
    list of PartPlan
        Heights above the building's base.
    """
    customs = styles().region(region)
    maker = _MAKERS.get(styles().families[look.wall].hangs)
    share = float(random.random())
    if maker is None or plan.use in ("garage", "industrial", "religious"):
        return []
    made: list[PartPlan] = []
    for part, shown in zip(plan.parts, fronts, strict=True):
        if part.low > 0.0 or part.levels < 2:
            continue
        edges = edges_of(part.polygon)
        storeys = storeys_of(plan, part, hall=look.hall)
        if storeys.bottom >= storeys.top - 2.0:
            continue
        for k in np.flatnonzero(shown).tolist():
            count = max(round(float(edges.length[k]) / look.bay), 1)
            wall = _Wall(edges, k, storeys, float(edges.length[k]) / count)
            hung = list(made)  # pieces of one wall belong together; those of others are in the way
            for pieces in maker(wall, share, customs, random):
                box, low, high = pieces[0][0], pieces[0][1], max(piece[2] for piece in pieces)
                crossed = any(
                    low < other.eaves + 0.3 and high + 0.3 > other.low and other.polygon.distance(box) < 0.2
                    for other in hung
                )
                if len(made) < _MOST and low > _LEAST_HEIGHT and not crossed and free(box, low, high):
                    made += [_planned(*piece) for piece in pieces]
    return made


_Pieces = list[tuple[Polygon, float, float, str]]
"""What stands or falls together: outlines, heights and finishes; the first is the lowest and the widest."""


def _planned(box: Polygon, low: float, high: float, finish: str) -> PartPlan:
    if finish == "oriel":
        return PartPlan(box, low, high, max(round((high - low) / _STOREY), 1), Roof("flat", 0.0), {}, finish)
    if finish != "steps":
        return PartPlan(box, low, high, 0, Roof("flat", 0.0), {}, finish)
    # A flight of steps is a sheet seen from both sides: closed, but without the edges of a board.
    a, b = (np.asarray(box.exterior.coords)[k, :2] for k in (1, 2))
    points = np.array([(*a, low), (*b, low), (*b, high), (*a, high)])
    faces = np.array([(0, 1, 2), (0, 2, 3), (1, 0, 3), (1, 3, 2)], np.int64)
    return PartPlan(box, low, high, 0, Roof("flat", 0.0), {}, finish, (points, faces))


def _balcony(wall: _Wall, s0: float, s1: float, floor: float, deep: float, rail: str) -> _Pieces:
    """One box: its sides show the slab's edge and the railing on it, its underside is the slab's, its top is open."""
    # No canopy over a door is so deep: their fronts never lie in one plane.
    return [(wall.box(s0, s1, 0.0, deep + 0.017), floor - 0.2, floor + 1.05, rail)]


def _running(wall: _Wall, share: float, region: RegionalStyle, random: np.random.Generator) -> list[_Pieces]:
    """Homes of the last decades: balconies in every other bay, or right along where the sun shines."""
    rail = "rail_glass" if share < 0.55 else "rail_iron"
    made: list[_Pieces] = []
    if wall.length < 4.0:
        return made
    bays = round(wall.length / wall.bay)
    right_along = region.balconies_right_along or share < 0.3
    for k in range(int(wall.storeys.count)):
        floor = wall.storeys.floor(k)
        if right_along:
            made.append(_balcony(wall, 0.5, wall.length - 0.5, floor, 1.3, rail))
            continue
        for i in range(1, bays, 2):
            made.append(_balcony(wall, i * wall.bay + 0.06, (i + 1) * wall.bay - 0.06, floor, 1.2, rail))
    return made


def _iron(wall: _Wall, share: float, region: RegionalStyle, random: np.random.Generator) -> list[_Pieces]:
    """Return the balconies of a Paris house: one running balcony on the second and one on the last floor."""
    count = int(wall.storeys.count)
    if wall.length < 4.0 or count < 3:
        return []
    return [
        _balcony(wall, 0.3, wall.length - 0.3, wall.storeys.floor(k), 0.7, "rail_iron") for k in sorted({1, count - 1})
    ]


def _southern(wall: _Wall, share: float, region: RegionalStyle, random: np.random.Generator) -> list[_Pieces]:
    """Return a small iron balcony before a window here and there."""
    made: list[_Pieces] = []
    if not region.small_balconies or wall.length < 4.0:
        return made
    for k in range(int(wall.storeys.count)):
        for i in range(round(wall.length / wall.bay)):
            if random.random() < 0.4 and (i + k) % 2 == 0:
                middle = (i + 0.5) * wall.bay
                made.append(
                    _balcony(wall, middle - 0.85, middle + 0.85, wall.storeys.floor(k) + 0.06, 0.75, "rail_iron")
                )
    return made


def _alpine(wall: _Wall, share: float, region: RegionalStyle, random: np.random.Generator) -> list[_Pieces]:
    """Return a wooden balcony along the whole front, on every upper floor or the highest."""
    count = int(wall.storeys.count)
    if not 5.0 < wall.length < 26.0:
        return []
    made: list[_Pieces] = []
    for k in range(count) if share < 0.4 else range(count - 1, count):
        floor = wall.storeys.floor(k)
        made.append(_balcony(wall, 0.35, wall.length - 0.35, floor, 1.1, "rail_wood"))
    return made


_ORIEL, _CANT = 0.85, 0.3  # metres: how far an oriel juts out, and by how much its front is narrower


def _oriels(wall: _Wall, share: float, region: RegionalStyle, random: np.random.Generator) -> list[_Pieces]:
    """Return oriels: closed bays before one axis in four, from the first floor up to below the last, or none."""
    count, bays = int(wall.storeys.count), round(wall.length / wall.bay)
    if share > 0.62 or count < 2 or bays < 2 or wall.length < 4.6:
        return []
    half = min(max(0.46 * wall.bay, 0.95), 1.5)
    made: list[_Pieces] = []
    for i in range(bays // 2 if bays < 6 else 1, bays, 4):
        middle = (i + 0.5) * wall.bay
        low, high = wall.storeys.floor(0) - 0.12, wall.storeys.floor(count - 1 if count > 2 else count) - 0.12
        if middle - half > 0.5 and middle + half < wall.length - 0.5:
            made.append([(wall.bay_window(middle - half, middle + half), low, high, "oriel")])
    return made


def _oriels_and_balconies(
    wall: _Wall, share: float, region: RegionalStyle, random: np.random.Generator
) -> list[_Pieces]:
    """Return oriels, or an iron balcony before the middle axis of every floor where a house has none."""
    made = _oriels(wall, share * 1.2, region, random)
    count, bays = int(wall.storeys.count), round(wall.length / wall.bay)
    if made or bays < 3 or wall.length < 6.0:
        return made
    half = min(0.8 * wall.bay, 1.6)
    for k in range(count):
        for i in range(bays // 2 if bays < 7 else 1, bays, 4):
            middle = (i + 0.5) * wall.bay
            if middle - half > 0.3 and middle + half < wall.length - 0.3:
                made.append(_balcony(wall, middle - half, middle + half, wall.storeys.floor(k), 1.0, "rail_iron"))
    return made


def _escape(wall: _Wall, share: float, region: RegionalStyle, random: np.random.Generator) -> list[_Pieces]:
    """Return iron fire escapes as in New York: a landing at every floor before two windows, steps between."""
    count = int(wall.storeys.count)
    if not region.fire_escapes or not 3 <= count <= 7 or wall.length < 5.0 or share > 0.85:
        return []
    made: list[_Pieces] = []
    towers = 1 if wall.length < 18.0 else 2 if wall.length < 36.0 else 3
    bays = max(round(wall.length / wall.bay), 1)
    for t in range(towers):
        middle = (min(int(bays * (t + 0.5) / towers), bays - 1) + 0.5) * wall.bay
        half = min(1.75, middle - 0.3, wall.length - middle - 0.3)
        if half < 1.2:
            continue
        for k in range(count):
            floor = wall.storeys.floor(k) + 0.35
            pieces = [(wall.box(middle - half, middle + half, 0.03, 1.05), floor - 0.1, floor + 0.95, "rail_landing")]
            if k < count - 1:
                above = wall.storeys.floor(k + 1) + 0.25
                pieces.append((wall.box(middle - half + 0.2, middle + half - 0.2, 0.7, 0.72), floor, above, "steps"))
            made.append(pieces)
    return made


_MAKERS: dict[str, Callable[[_Wall, float, RegionalStyle, np.random.Generator], list[_Pieces]]] = {
    "balconies": _running,
    "french_balconies": _iron,
    "small_balconies": _southern,
    "wooden_balconies": _alpine,
    "fire_escapes": _escape,
    "oriels": _oriels,
    "oriels_and_balconies": _oriels_and_balconies,
}


def water_tank(plan: BuildingPlan, region: str, random: np.random.Generator) -> list[PartPlan]:
    """Return a wooden water tank on four legs, on flat roofs of American houses of five storeys and more."""
    draw = random.random(4)
    if not styles().region(region).water_tanks or plan.use in ("garage", "religious", "industrial"):
        return []
    part = max(plan.parts, key=lambda part: part.top)
    if part.roof.shape != "flat" or not 6 <= plan.levels <= 22 or part.polygon.area < 200.0 or draw[0] > 0.6:
        return []
    inner = overlay.buffer(part.polygon, -3.2)
    if inner.is_empty:
        return []
    west, south, east, north = inner.bounds
    x, y = west + (east - west) * draw[1], south + (north - south) * draw[2]
    if not inner.contains(shapely.Point(x, y)):
        x, y = inner.representative_point().coords[0]
    radius = 1.35 + 0.5 * float(draw[3])
    angles = np.arange(9) / 9 * 2 * np.pi
    barrel = Polygon(np.stack([x + radius * np.cos(angles), y + radius * np.sin(angles)], axis=1))
    foot, side = part.eaves + 1.9, 0.72 * radius
    frame = shapely.box(x - side, y - side, x + side, y + side)
    return [
        PartPlan(frame, part.eaves - 0.15, foot + 0.05, 0, Roof("flat", 0.0), {}, "trestle"),
        PartPlan(barrel, foot, foot + 3.2, 0, Roof("pyramidal", 1.1), {}, "tank"),
    ]
