"""The waters of a whole city: how high they lie is decided once, by all their banks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.affinity import translate

from vico.geo import overlay
from vico.geo.overlay import polygons_of
from vico.world.heights import HeightField
from vico.worldgen.city_map import RegionMap
from vico.worldgen.city_request import CityRequest
from vico.worldgen.facts.land_cover import water_of_map
from vico.worldgen.facts.site import WaterBody
from vico.worldgen.ground.kerbs_and_banks import piped_waters, water_bodies
from vico.worldgen.seams.grid import HALO, tile_name
from vico.worldgen.seams.join import WATERS
from vico.worldgen.stages import Stages, keep_product


def divide_waters(request: CityRequest, region: RegionMap, ground: HeightField) -> None:
    """Keep for each tile the bodies of water in and around it, as high everywhere as the whole city has them.

    How high a river lies is told by its banks, and how far below them by how large it is: of its part in one tile other
    numbers would come than next to it.
    """
    stages = Stages(request.plans)
    stages.given(region, region.key)
    bodies = stages.run("bodies", _bodies, region, ground)
    outlines = shapely.STRtree([body.outline for body in bodies])
    half = request.grid.size / 2 + HALO
    for tile in request.grid:
        middle = np.array(request.grid.centre(tile))
        window = shapely.box(*(middle - half), *(middle + half))
        near = [bodies[k] for k in np.sort(outlines.query(window, predicate="intersects")).tolist()]
        parts = [part for body in near for part in _part_of(body, window, middle)]
        keep_product(request.plans / tile_name(tile), WATERS, parts)


def _bodies(region: RegionMap, ground: HeightField) -> list[WaterBody]:
    osm, half = region.whole, ground.half
    return water_bodies(ground, [*water_of_map(osm, shapely.box(-half, -half, half, half)), *piped_waters(osm)])


def _part_of(body: WaterBody, window: shapely.Polygon, middle: NDArray[np.float64]) -> list[WaterBody]:
    """Return what of a body lies in a window, as high as it is, told from another middle."""
    here = polygons_of(overlay.intersection(body.outline, window))
    return [replace(body, outline=translate(part, *(-middle).tolist()), shore=body.shore - middle) for part in here]
