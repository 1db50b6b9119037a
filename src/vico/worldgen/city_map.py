"""The map of a city's region."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from hashlib import sha256

import shapely

from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmData, checked_extract, read_osm
from vico.io.files import sha256_of
from vico.worldgen.city_request import CityRequest
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.land_cover import sea_of_map
from vico.worldgen.seams.grid import HALO
from vico.worldgen.stages import code_digest


class RegionMap:
    """The map of a city's region; it is read when it is asked for.

    Attributes
    ----------
    key
        Of the file, of the code that reads it, and of the region: where it is the same, so is the map.
    """

    def __init__(self, request: CityRequest) -> None:
        self._path, self._grid = checked_extract(request.sources.osm), request.grid
        self._frame, self._reach = LocalFrame(request.lat, request.lon), request.grid.half + HALO
        where = f"{self._frame} {self._reach} {self._grid.edges} in tiles of {self._grid.size}"
        made_of = [code_digest(), sha256_of(self._path), where]
        self.key = sha256("\n".join(made_of).encode()).hexdigest()

    @cached_property
    def whole(self) -> OsmData:
        """The map of the square around the city, and what is near it."""
        whole = read_osm(self._path, self._frame, self._reach, need_buildings=False)
        # The sea is found for all tiles at once: of one that no coastline meets nobody could say whether it is land.
        # Where that fails each tile looks for its own, and reports what is wrong.
        with drop_on_failure("sea"):
            reach = self._reach
            return replace(whole, sea=sea_of_map(whole, shapely.box(-reach, -reach, reach, reach)))
        return whole

    @property
    def of_city(self) -> OsmData:
        """The map as one that ends with the city's tiles."""
        whole = self.whole
        return replace(whole, half=self._grid.half, margin=whole.margin + HALO, edges=self._grid.edges)
