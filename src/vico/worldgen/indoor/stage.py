"""Rooms for the places in buildings: floor plans by use, stacked below ground so that nothing shows from outside."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely

from vico.assets.interior import RISE
from vico.geo import overlay
from vico.seeds import rng
from vico.world.heights import HeightField
from vico.world.model import Building, Category, Entrance, Place
from vico.worldgen.facts.fault_isolation import drop_on_failure, leave_out
from vico.worldgen.facts.named_places import place_names
from vico.worldgen.indoor.catalogue import use_of, uses
from vico.worldgen.indoor.floorplans import area_of
from vico.worldgen.indoor.furnished_plans import VARIANTS, FloorPlan, Indoors, Slot, place_plans, plan_of
from vico.worldgen.indoor.layout_library import LayoutAuthor, Library, layout_from_author, read_library

__all__ = ["Indoors", "furnish"]
_COVER = 3.3  # metres of ground over the highest ceiling
_GAP = 0.4
_DEEPEST = 3000.0
# Storeys of a house from which on a plan may have two floors, and three.
_LEVELS_FOR = (3, 6)
_KEPT_FREE = 0.9  # share of a place's part of the house that its plan may cover
_BY_USE = {
    "residential": ("apartments", Category.ACCOMMODATION),
    "hotel": ("hotel", Category.ACCOMMODATION),
    "office": ("company", Category.OFFICE),
    "commercial": ("company", Category.OFFICE),
    "retail": ("shop", Category.STORE),
    "industrial": ("workshop", Category.OFFICE),
    "religious": ("place_of_worship", Category.ENTERTAINMENT),
    "education": ("school", Category.OFFICE),
    "health": ("clinic", Category.OFFICE),
    "civic": ("townhall", Category.OFFICE),
    "transport": ("station", Category.TRANSIT),
    "garage": ("parking", Category.TRANSIT),
}


class _Ground:
    """The rooms there are, so that no two meet."""

    def __init__(self) -> None:
        self._cells: dict[tuple[int, int], list[tuple[float, float, shapely.Polygon]]] = defaultdict(list)

    def take(self, slot: Slot) -> bool:
        """Claim a slot if it is free."""
        room = overlay.buffer(slot.shape, _GAP / 2, join_style="mitre")
        low, high = slot.z - _GAP / 2, slot.z + slot.height + _GAP / 2
        cells = list(self._around(room))
        for cell in cells:
            for bottom, top, other in self._cells[cell]:
                if low < top and bottom < high and other.intersects(room):
                    return False
        for cell in cells:
            self._cells[cell].append((low, high, room))
        return True

    @staticmethod
    def _around(shape: shapely.Polygon) -> Iterator[tuple[int, int]]:
        x0, y0, x1, y1 = shape.bounds
        for i in range(math.floor(x0 / 16), math.floor(x1 / 16) + 1):
            for j in range(math.floor(y0 / 16), math.floor(y1 / 16) + 1):
                yield i, j


def furnish(
    places: Sequence[Place],
    *,
    buildings: Sequence[Building],
    height: HeightField,
    seed: int = 0,
    entrances: Sequence[Entrance] = (),
    library: Path | None = None,
    author: LayoutAuthor | None = None,
) -> Indoors:
    """Give every place in a building its rooms.

    Parameters
    ----------
    places
        Places; those without a building keep none.
    buildings
        The buildings they are in; their area and levels decide how large and how high a plan is. A place in a building
        that has no room for it, or whose rooms can't be made, is left out (`expendable`).
    height
        Ground heights: all rooms lie at least 3 m below.
    seed
        Decides plans, colours, handedness.
    entrances
        Doors; a building that has one but no place gets a place of its own, as its use suggests.
    library
        Folder of layouts (see `indoor.layout_library`): a place whose use they cover gets the nearest fit.
    author
        Somebody who draws layouts; asked for the places that the library does not cover.

    Returns
    -------
    Indoors
        Rooms lie under their building's footprint where it has room for them; no two overlap.

    Raises
    ------
    MissingFileError, SchemaError, InputError
        If the library can't be used.
    """
    shelf = read_library(library) if library is not None else None
    everyone = [*places, *_default_places(places, buildings, entrances)]
    by_id = {b.id: b for b in buildings}
    wanted: dict[str, list[int]] = defaultdict(list)
    for k, place in enumerate(everyone):
        if place.building is not None:
            wanted[place.building].append(k)
    ground = _Ground()
    slots: dict[int, tuple[Slot, FloorPlan]] = {}
    for building in buildings:
        if building.id in wanted:
            count = len(wanted[building.id])
            chosen: list[tuple[int, FloorPlan]] = []
            for k in wanted[building.id]:
                with drop_on_failure(everyone[k].id):
                    chosen.append((k, _plan(everyone[k], building, count, seed, shelf, author)))
            with drop_on_failure(building.id):
                for k, slot, plan in _stack_slots(by_id[building.id], chosen, height, ground):
                    slots[k] = (slot, plan)
            for k, _ in chosen:
                if k not in slots:
                    leave_out(everyone[k].id, f"no room for it under building {building.id}")
    # A place indoors is its rooms: without them there is nowhere to go in.
    housed = [k for k, place in enumerate(everyone) if place.building is None or k in slots]
    return place_plans([everyone[k] for k in housed], {n: slots[k] for n, k in enumerate(housed) if k in slots})


def _default_places(
    places: Sequence[Place], buildings: Sequence[Building], entrances: Sequence[Entrance]
) -> Iterator[Place]:
    """Places for buildings that can be entered but hold none."""
    known = {place.building for place in places}
    doors: dict[str, Entrance] = {}
    for door in entrances:
        doors.setdefault(door.building, door)
    for building in buildings:
        entrance = doors.get(building.id)
        if entrance is not None and building.id not in known:
            kind, category = _BY_USE.get(building.use, ("events_venue", Category.ENTERTAINMENT))
            called = place_names()
            name = building.name or called.building.format(what=called.of(building.use), id=building.id)
            x, y = entrance.approach
            yield Place(id=f"{building.id}.hall", name=name, category=category, kind=kind, building=building.id,
                        entrance=entrance.id, position=(x, y, entrance.position[2]))  # fmt: skip


def _plan(
    place: Place, building: Building, count: int, seed: int, shelf: Library | None, author: LayoutAuthor | None
) -> FloorPlan:
    """Return the plan of a place: from the library, from the author, else by its use and its part of the house."""
    chance = rng(seed, "rooms", place.id)
    use = use_of(place.category, place.kind)
    area = shapely.Polygon(building.footprint[0], building.footprint[1:]).area
    share = _KEPT_FREE * area * max(1, building.levels) / count
    if shelf is not None:
        found = shelf.nearest(use, place.category, min(share, area), chance)
        if found is not None:
            return found.plan(seed)
    if author is not None:
        drawn = layout_from_author(author, place, use=use, area=min(share, area), seed=seed)
        if drawn is not None:
            return drawn.plan(seed)
    variant = int(chance.integers(VARIANTS))
    if use == "flat":
        # Homes that fit the house and the place's part of it are drawn by how common they are.
        known = uses()
        smallest = area_of(known.homes[0], 0)
        options = [
            name
            for name in known.homes
            if area_of(name, 0) * known.uses[name].storeys <= max(share, smallest)
            and known.uses[name].least_storeys <= max(building.levels, 1)
        ]
        weights = np.array([known.uses[name].home for name in options], float)
        return plan_of(options[int(chance.choice(len(options), p=weights / weights.sum()))], 0, 1, variant)
    storeys = _storeys(use, building.levels, share)
    size = max((k for k in range(len(uses().uses[use].sizes)) if area_of(use, k) * storeys <= share), default=0)
    return plan_of(use, size, storeys, variant)


def _storeys(use: str, levels: int, share: float) -> int:
    """Floors a plan gets: as many as use, house and the place's part of it allow, three only in high houses."""
    most = 1 + sum(levels >= least for least in _LEVELS_FOR)
    fits = max(1, int(share / area_of(use, 0)))
    return max(1, min(uses().uses[use].storeys, most, fits))


def _stack_slots(
    building: Building, wanted: list[tuple[int, FloorPlan]], height: HeightField, ground: _Ground
) -> Iterator[tuple[int, Slot, FloorPlan]]:
    """Slots for a building's plans: side by side in rows along its longer side, then the next storey down."""
    shape = shapely.Polygon(building.footprint[0], building.footprint[1:])
    centre, yaw, extent = _frame(shape)
    c, s = math.cos(yaw), math.sin(yaw)
    down = 0.0
    waiting = list(wanted)
    while waiting:
        rest: list[tuple[int, FloorPlan]] = []
        u, v, row, layer = 0.0, 0.0, 0.0, 0.0
        for k, plan in waiting:
            w, h = plan.size
            if u > 0.0 and u + w > extent[0]:
                u, v, row = 0.0, v + row + _GAP, 0.0
            if v > 0.0 and v + h > extent[1]:
                rest.append((k, plan))
                continue
            across = max(0.0, extent[1] - h) / 2 if v == 0.0 and h > extent[1] / 2 else v
            a = (u + w / 2) - max(extent[0], w) / 2
            b = (across + h / 2) - max(extent[1], h) / 2
            x, y = round(centre[0] + c * a - s * b, 3), round(centre[1] + s * a + c * b, 3)
            slot = Slot(x, y, 0.0, yaw, plan.size, plan.height)
            low = min(float(height(slot.samples()).min()), building.base)
            slot = replace(slot, z=round(low - _COVER - plan.height - down, 3))
            u += w + _GAP
            if not ground.take(slot):
                rest.append((k, plan))
                continue
            row, layer = max(row, h), max(layer, plan.height)
            yield k, slot, plan
        down += max(layer, RISE) + _GAP
        if down > _DEEPEST:
            return
        waiting = rest


def _frame(shape: shapely.Polygon) -> tuple[tuple[float, float], float, tuple[float, float]]:
    """Middle, direction and extent of the smallest rectangle around a footprint, longer side first."""
    corners = np.array(shapely.minimum_rotated_rectangle(shape).exterior.coords)[:4]
    first, second = corners[1] - corners[0], corners[2] - corners[1]
    a, b = float(np.hypot(*first)), float(np.hypot(*second))
    along = first if a >= b else second
    yaw = math.atan2(along[1], along[0]) % math.pi
    middle = corners.mean(axis=0)
    return (float(middle[0]), float(middle[1])), yaw, (max(a, b), min(a, b))
