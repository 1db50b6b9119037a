"""What a place has of bridges above streets and of tunnels: decided once, drawn and kept clear of later."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from shapely import Polygon

from vico.world.heights import Decks, HeightField
from vico.world.mesh import Surface
from vico.worldgen.facts.site import SiteFacts
from vico.worldgen.facts.streets import StreetPolygons
from vico.worldgen.ground.bridges.bores import bore_surfaces
from vico.worldgen.ground.bridges.decks import Deck, decks_of, kept_clear, pier_feet
from vico.worldgen.ground.bridges.portals import Portal, portal_feet, portal_surfaces, portals_of
from vico.worldgen.ground.bridges.surfaces import bridge_surfaces
from vico.worldgen.ground.bridges.tunnels import Bore, bores_of, cuts_of, paved_of
from vico.worldgen.ground.bridges.usable import deck_surfaces, low_parts, usable_decks


@dataclass(frozen=True)
class Bridges:
    """Decks above streets, tunnels, and the mouths of those that nobody can use.

    Attributes
    ----------
    decks
        Pieces of decks with their heights.
    portals
        Mouths of tunnels that are closed.
    feet
        Where piers and mouths stand, for those who must not walk through them, metres.
    usable
        Ids of the ways whose decks can be driven or walked on.
    low
        Where decks lie too low for people to pass under them, metres.
    bores
        Pieces of the tunnels that can be used.
    cuts
        Where those are open to the sky, metres: the ground has holes there.
    """

    decks: list[Deck]
    portals: list[Portal]
    feet: list[Polygon]
    usable: frozenset[int] = frozenset()
    low: Sequence[Polygon] = ()
    bores: Sequence[Bore] = ()
    cuts: Sequence[Polygon] = ()

    @property
    def open_ways(self) -> frozenset[int]:
        """Ids of the ways on decks and in tunnels that can be used."""
        return self.usable.union(bore.way.id for bore in self.bores)

    def levels(self) -> Decks | None:
        """Return the decks and tunnels that can be used as surfaces of the world; None if there are none."""
        return deck_surfaces([deck for deck in self.decks if deck.way.id in self.usable], self.bores)

    def surfaces(
        self, site: SiteFacts, terrain: HeightField, streets: StreetPolygons, window: Polygon
    ) -> list[Surface]:
        """Draw them, and the railings of bridges that are the ground."""
        return [
            *bridge_surfaces(self.decks, site, terrain, streets, window),
            *portal_surfaces(self.portals, terrain, window),
            *bore_surfaces(self.bores, terrain, window),
        ]


def bridges_of(
    site: SiteFacts, terrain: HeightField, streets: StreetPolygons, bores: Sequence[Bore] | None = None
) -> Bridges:
    """Decide the bridges above streets and the tunnels.

    Parameters
    ----------
    site
        The map.
    terrain
        The ground, graded to `streets`.
    streets
        The streets.
    bores
        The tunnels that can be used, where a whole city has decided; None: they are decided here.
    """
    decks = decks_of(site, terrain)
    if bores is None:
        reach = terrain.half - 1.0
        bores = bores_of(site, terrain, (-reach, -reach, reach, reach), paved_of(streets))
    used = {bore.way.id for bore in bores}
    portals = [portal for portal in portals_of(site.osm, streets) if portal.way not in used]
    feet = [*pier_feet(decks, terrain, kept_clear(site.osm, streets)), *portal_feet(portals)]
    usable = usable_decks(site, decks, terrain)
    return Bridges(decks, portals, feet, usable, low_parts(decks, terrain), bores, cuts_of(bores))
