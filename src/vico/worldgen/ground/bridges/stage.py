"""What a place has of bridges above streets and of tunnels: decided once, drawn and kept clear of later."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from shapely import Polygon

from vico.world.decks import Decks
from vico.world.heights import HeightField
from vico.world.mesh import Surface
from vico.worldgen.facts.site import SiteFacts
from vico.worldgen.facts.streets import StreetPolygons
from vico.worldgen.ground.bridges.decks import Deck, decks_of, kept_clear, pier_feet
from vico.worldgen.ground.bridges.portals import Portal, portal_feet, portal_surfaces, portals_of
from vico.worldgen.ground.bridges.surfaces import bridge_surfaces
from vico.worldgen.ground.bridges.usable import deck_surfaces, low_parts, usable_decks


@dataclass(frozen=True)
class Bridges:
    """Decks above streets, and the mouths of tunnels.

    Attributes
    ----------
    decks
        Pieces of decks with their heights.
    portals
        Mouths of tunnels.
    feet
        Where piers and mouths stand, for those who must not walk through them, metres.
    usable
        Ids of the ways whose decks can be driven or walked on.
    low
        Where decks lie too low for people to pass under them, metres.
    """

    decks: list[Deck]
    portals: list[Portal]
    feet: list[Polygon]
    usable: frozenset[int] = frozenset()
    low: Sequence[Polygon] = ()

    def levels(self) -> Decks | None:
        """Return the decks that can be used as surfaces of the world; None if there are none."""
        return deck_surfaces(self.decks, self.usable)

    def surfaces(
        self, site: SiteFacts, terrain: HeightField, streets: StreetPolygons, window: Polygon
    ) -> list[Surface]:
        """Draw them, and the railings of bridges that are the ground."""
        return [
            *bridge_surfaces(self.decks, site, terrain, streets, window),
            *portal_surfaces(self.portals, terrain, window),
        ]


def bridges_of(site: SiteFacts, terrain: HeightField, streets: StreetPolygons) -> Bridges:
    """Decide the bridges above streets and the mouths of tunnels; `terrain` is graded to `streets`."""
    decks = decks_of(site, terrain)
    portals = portals_of(site.osm, streets)
    feet = [*pier_feet(decks, terrain, kept_clear(site.osm, streets)), *portal_feet(portals)]
    return Bridges(decks, portals, feet, usable_decks(site, decks, terrain), low_parts(decks, terrain))
