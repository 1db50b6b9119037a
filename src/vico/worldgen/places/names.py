"""Names and addresses for places that bring none: homes, and what may only be told to be there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import shapely

from vico.geo.osm import Tags
from vico.world.model import Roads
from vico.worldgen.facts.named_places import NamedPlace, place_names
from vico.worldgen.places.doors import MATCH, Finder


class StreetAddresses:
    """Street names and house numbers."""

    def __init__(self, finder: Finder, roads: Roads) -> None:
        self._finder = finder
        self._named = [(r.name, shapely.LineString(r.line)) for r in roads.roads if r.name and len(r.line) > 1]
        self._tree = shapely.STRtree([line for _, line in self._named])
        self._used: set[str] = set()

    @cached_property
    def addresses(self) -> dict[str, str]:
        """Street and number by building: its own tags, else the address points in it."""
        return _addresses(self._finder)

    def nearest(self, xy: Sequence[float]) -> str | None:
        """Name of the street nearest to a point, None where no street has one."""
        return self._named[int(self._tree.nearest(shapely.Point(xy)))][0] if self._named else None

    def invented(self, named: NamedPlace) -> NamedPlace:
        """Give a place a name of our making: what it is, and the address of the building it is in."""
        at = self._finder.building_at(named.xy, MATCH)
        if at is None:
            return named
        building = self._finder.buildings[at]
        address = self.addresses.get(building.id)
        street = None if address else self.nearest(shapely.Polygon(building.footprint[0]).centroid.coords[0])
        name = place_names().called(place_names().of(named.kind), where=address, street=street)
        return replace(named, name=unused(name, self._used))


def unused(name: str, used: set[str]) -> str:
    """Return the name, or the name with the first free letter or number."""
    candidates = [name, *(f"{name} {letter}" for letter in "BCDEFGHJKLMN"), *(f"{name} {k}" for k in range(14, 999))]
    chosen = next(candidate for candidate in candidates if candidate not in used)
    used.add(chosen)
    return chosen


def _addresses(finder: Finder) -> dict[str, str]:
    """Street and number by building: its own tags, else the address points in it."""
    found: dict[str, str] = {}
    for building in finder.buildings:
        if text := _address(finder.tags_of(building)):
            found[building.id] = text
    for node in finder.osm.nodes:
        text = _address(node.tags)
        if text and (at := finder.building_at(node.xy, 1.5)) is not None:
            found.setdefault(finder.buildings[at].id, text)
    return found


def _address(tags: Tags) -> str | None:
    street, number = tags.get("addr:street"), tags.get("addr:housenumber")
    return f"{street} {number.split(';')[0].split(',')[0]}" if street and number else None
