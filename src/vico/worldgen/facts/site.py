"""What the map says of a place that several stages need: decided once, before anything is made."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass, replace

from vico.geo.osm import OsmData
from vico.worldgen.facts.driving_side import keeps_left
from vico.worldgen.facts.levels import StreetLevels, street_levels
from vico.worldgen.facts.named_places import NamedPlace, named_places
from vico.worldgen.facts.waters import WaterBody


@dataclass(frozen=True)
class SiteFacts:
    """A map and what follows from it alone.

    Attributes
    ----------
    osm
        The map, local metres.
    levels
        Which ways pass above a street, and where.
    left_driving
        Whether traffic keeps left.
    named
        Named places people go to, in the order of the map.
    waters
        Of a part of a city: the bodies of water in it as the whole city has them; None: this map is all there is.
    """

    osm: OsmData
    levels: StreetLevels
    left_driving: bool
    named: list[NamedPlace]
    waters: list[WaterBody] | None = None

    def without(self, ids: Set[str]) -> SiteFacts:
        """Return the site without objects of these ids: what one stage can't make, no later stage is to see."""
        osm = replace(
            self.osm,
            nodes=[node for node in self.osm.nodes if f"n{node.id}" not in ids],
            ways=[way for way in self.osm.ways if f"w{way.id}" not in ids],
            areas=[area for area in self.osm.areas if area.id not in ids],
        )
        return replace(self, osm=osm, named=[named for named in self.named if named.id not in ids])


def site_facts(osm: OsmData, waters: list[WaterBody] | None = None) -> SiteFacts:
    """Read the facts of a site off its map; see `SiteFacts` for its waters."""
    return SiteFacts(osm, street_levels(osm), keeps_left(osm), named_places(osm), waters)
