"""Places of a world: what they are for, which building they are in, and the door they are entered by."""

from __future__ import annotations

from collections.abc import Sequence

import shapely

from vico.geo.places import FoundPlace
from vico.world.check.outdoors import entrance_findings, is_reachable
from vico.world.heights import HeightField
from vico.world.model import Building, Category, Dropped, Entrance, Place, Roads
from vico.world.routing import Router
from vico.world.transit import Transit
from vico.world.walkable import WalkableMap
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.named_places import NamedPlace, place_names
from vico.worldgen.facts.site import SiteFacts
from vico.worldgen.places.doors import Finder
from vico.worldgen.places.found import Compared, compared
from vico.worldgen.places.names import StreetAddresses, unused

_LARGE_HOUSE = 4000.0  # square metres of floor above which a house has two stairways
_HOMES_WANTED, _MOST_HOMES = 60, 240


def places_from_osm(
    site: SiteFacts,
    *,
    buildings: Sequence[Building],
    walkable: WalkableMap,
    height: HeightField,
    roads: Roads,
    transit: Transit | None = None,
    found: Sequence[FoundPlace] = (),
) -> tuple[list[Place], list[Entrance], list[Dropped]]:
    """Find the places of a map, the buildings they are in, and their entrances.

    Parameters
    ----------
    site
        The map and its facts.
    buildings
        Buildings with footprints.
    walkable
        Where people can walk; entrances are reachable on it.
    height
        Ground heights.
    roads
        Named streets, for the addresses of homes.
    transit
        Stops and stations, which become places of their own with the same ids.
    found
        Places of other sources: they confirm, refine or close the map's places, and add those it lacks. Of sources
        whose content may not be kept (Google) nothing but ids and what is decided here gets into the result.

    Returns
    -------
    places, entrances, dropped
        Places in the order of the map, then homes, then transit; what was left out, with the reason.
    """
    finder = Finder(site.osm, buildings, walkable, height)
    streets = StreetAddresses(finder, roads)
    mapped = site.named
    told = compared(mapped, found)
    dropped: list[Dropped] = list(told.dropped)
    places: list[Place] = []
    seen: set[tuple[str, str | None]] = set()
    for named in [*mapped, *told.added]:
        with drop_on_failure(named.id):
            named, made = _made(named, finder, streets, told)
            if isinstance(made, Place):
                key = (made.name.casefold(), made.building or f"{made.category}")
                if key not in seen:
                    seen.add(key)
                    places.append(made)
                    continue
                made = "mapped twice"
            label = f"{named.kind} {named.name!r}" if named.name else named.kind
            dropped.append(Dropped(id=named.id, reason=f"{label}: {made}"))
    places += _homes(finder, streets)
    if transit is not None:
        places += _transit_places(transit, walkable, height, dropped)
    return (*_sound(places, finder, dropped), dropped)


def _made(
    named: NamedPlace, finder: Finder, streets: StreetAddresses, told: Compared
) -> tuple[NamedPlace, Place | str]:
    """Make a place of something named, as other sources refine it; or say why it is none."""
    reason = "closed, as another source says" if named.id in told.closed else finder.misfit(named)
    if reason is not None:
        return named, reason
    named = told.refined.get(named.id, named)
    if not named.name:
        named = streets.invented(named)
    return named, finder.outdoors(named) if finder.is_outdoors(named) else finder.indoors(named)


def _sound(places: list[Place], finder: Finder, dropped: list[Dropped]) -> tuple[list[Place], list[Entrance]]:
    """Return places and entrances by the rules that `check_world` has for them, and list the others."""
    walkable, height = finder.walkable, finder.height
    doors: list[Entrance] = []
    for door in finder.entrances:
        outline = finder.shapes[finder.index[door.building]]
        found = next(entrance_findings(door, outline, walkable, height), None)
        if found is None:
            doors.append(door)
        else:
            dropped.append(Dropped(id=door.id, reason=f"{found.id}: {found.what}"))
    usable = {None, *(door.id for door in doors)}
    kept: list[Place] = []
    for place in places:
        if place.entrance in usable and is_reachable(place, walkable):
            kept.append(place)
        else:
            dropped.append(Dropped(id=place.id, reason=f"{place.kind} {place.name!r}: can't be reached on foot"))
    return kept, doors


def _homes(finder: Finder, streets: StreetAddresses) -> list[Place]:
    """Apartments in residential buildings, a place for each stairway; more buildings count where these are few."""
    used: set[str] = set()
    homes: list[Place] = []

    def add(building: Building, shape: shapely.Polygon) -> None:
        floor = shape.area * max(building.levels, 1)
        tags = finder.tags_of(building)
        address = streets.addresses.get(building.id)
        for k in range(2 if floor > _LARGE_HOUSE else 1):
            door = finder.building_door(building, k)
            if door is None:
                return
            where = address or tags.get("name")
            street = None if where else streets.nearest(door.position[:2])
            name = place_names().called(place_names().home, where=where, street=street)
            homes.append(
                Place(
                    id=f"{building.id}.home{k}",
                    name=unused(name, used),
                    category=Category.ACCOMMODATION,
                    kind="apartments",
                    building=building.id,
                    entrance=door.id,
                    position=finder.ground(door.approach),
                )
            )

    rest: list[tuple[Building, shapely.Polygon]] = []
    houses: list[tuple[Building, shapely.Polygon]] = []
    for building, shape in zip(finder.buildings, finder.shapes, strict=True):
        if shape.area < 45.0 or building.height < 2.4 or not finder.in_window(shape):
            continue
        if building.use == "residential":
            houses.append((building, shape))
        elif building.use in ("commercial", "retail", "office", "other") and building.levels >= 3 and shape.area > 150:
            rest.append((building, shape))
    # In a quarter of small houses not every one needs rooms: an even share of them has.
    stride = max(1, -(-len(houses) // _MOST_HOMES))
    for building, shape in houses[::stride]:
        with drop_on_failure(building.id):
            add(building, shape)
    # Over shops and offices of old towns people live too.
    for building, shape in rest:
        if len(homes) >= _HOMES_WANTED:
            break
        with drop_on_failure(building.id):
            add(building, shape)
    return homes


def _transit_places(
    transit: Transit, walkable: WalkableMap, height: HeightField, dropped: list[Dropped]
) -> list[Place]:
    router = Router(walkable)
    places: list[Place] = []
    rows = [(s.id, s.name, "bus_stop", s.wait) for s in transit.stops]
    rows += [(b.id, b.name, "bicycle_rental", b.position) for b in transit.bike_stations]
    for key, name, kind, position in rows:
        with drop_on_failure(key):
            spot = router.nearest_walkable(position[:2], within=6.0)
            if spot is None:
                dropped.append(Dropped(id=key, reason=f"{kind} {name!r}: can't be reached on foot"))
                continue
            x, y = round(float(spot[0]), 3), round(float(spot[1]), 3)
            z = round(float(height((x, y))), 3)
            places.append(
                Place(
                    id=key,
                    name=name,
                    category=Category.TRANSIT,
                    kind=kind,
                    building=None,
                    entrance=None,
                    position=(x, y, z),
                )
            )
    return places
