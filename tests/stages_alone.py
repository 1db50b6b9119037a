"""Single stages of world generation, run on a map alone with what they need made on the way."""

from __future__ import annotations

from vico.geo.osm import OsmData
from vico.world.heights import HeightField
from vico.world.mesh import Surface
from vico.worldgen.buildings.stage import BuildingsResult, buildings_from_plans
from vico.worldgen.facts.building_outlines import building_plans
from vico.worldgen.facts.site import site_facts
from vico.worldgen.facts.streets import StreetPolygons
from vico.worldgen.ground.grade_separation import bridges_of
from vico.worldgen.ground.stage import GROUND_APRON, ground_from_osm
from vico.worldgen.ground.stairs import flights_of
from vico.worldgen.ground.yards import yards_of


def buildings_of(osm: OsmData, terrain: HeightField, *, seed: int) -> BuildingsResult:
    """The buildings of a map as they are planned, built."""
    return buildings_from_plans(building_plans(osm, seed=seed), osm, terrain, seed=seed)


def ground_of(osm: OsmData, terrain: HeightField, streets: StreetPolygons) -> list[Surface]:
    """The ground of a map, its bridges with it."""
    site = site_facts(osm)
    flights = flights_of(site, terrain, streets.steps)
    yards = yards_of(site, streets.carriageway, reach=osm.half + GROUND_APRON)
    return ground_from_osm(site, terrain, streets, bridges_of(site, terrain, streets), flights, yards)
