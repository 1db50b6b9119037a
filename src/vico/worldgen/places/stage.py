"""Places of a world: what they are for, which building they are in, and the door they are entered by.

Places of other sources are compared with those of the map: same, closed, of another kind, or missing. Of a source
whose content may not be kept (Google) only the id and our own decisions go on: a place it adds has the category
decided here, no name (one is made from the building's address), and no position but its building's door.

The words of other sources are Google's place types (tables A and B of the new API, and the legacy ones) and
Overture's categories of both taxonomies. Overture has some two thousand: those that differ from their group are
listed in ``data/worldgen/places/words.toml``, the rest follow from their wider words, their endings, or are offices.
"""

from __future__ import annotations

import re
import unicodedata
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from difflib import SequenceMatcher
from functools import cached_property

import numpy as np
import shapely

from vico.geo.osm import Tags
from vico.geo.places import FoundPlace
from vico.geometry import distance
from vico.world.check.outdoors import entrance_findings, is_reachable
from vico.world.heights import HeightField
from vico.world.model import Building, Category, Dropped, Entrance, Place, Roads
from vico.world.routing import Router
from vico.world.transit import Transit
from vico.world.walkable import WalkableMap
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.named_places import NamedPlace, place_names, source_words
from vico.worldgen.facts.site import SiteFacts
from vico.worldgen.places.doors import MATCH, DoorFinder


def meaning_of(source: str, kind: str, wider: Sequence[str] = ()) -> tuple[Category, str] | None:
    """Our category and kind of a place that a source calls so; None for what nobody goes to.

    Parameters
    ----------
    source
        ``overture`` or ``google``.
    kind, wider
        Its own word, and wider ones, the nearest first.
    """
    listed = source_words()
    if kind in listed.words:
        meaning = listed.words[kind]
        # Google's "point_of_interest" says nothing, but a second word may.
        if meaning is not None or source != "google":
            return meaning
    for ending in listed.endings:
        if kind.endswith(ending.endings):
            return ending.category, ending.kind
    for word in wider:
        known = listed.words.get(word)
        if known is not None:
            return known
    return (Category.OFFICE, "company") if source == "overture" and kind not in listed.words else None


# The farther apart two entries are, the more alike their names have to be: metres, likeness.
_ALIKE = ((15.0, 0.6), (40.0, 0.75), (80.0, 0.9))
_VAGUE = {"shop", "office", "craft", "healthcare", "company", "yes"}
_FORM_WORDS = "the der die das le la el ltd inc llc gmbh co kg oy oyj ab sa srl bv and und et"
_FORMS = frozenset(_FORM_WORDS.split())


@dataclass(frozen=True)
class PlaceComparison:
    """Result of comparing places.

    Attributes
    ----------
    added
        Places the map lacks; without a name where the source's may not be kept.
    refined
        The map's places of a vague kind, by id, with the kind another source gives.
    closed
        Ids of the map's places that another source calls closed.
    dropped
        What the sources had and the world will not have, with the reason.
    """

    added: list[NamedPlace] = field(default_factory=list)
    refined: dict[str, NamedPlace] = field(default_factory=dict)
    closed: set[str] = field(default_factory=set)
    dropped: list[Dropped] = field(default_factory=list)


def compare_places(mapped: Sequence[NamedPlace], found: Sequence[FoundPlace]) -> PlaceComparison:
    """Compare the map's places with those of other sources.

    Parameters
    ----------
    mapped
        The map's places.
    found
        The others', of any number of sources; compared in the order of their ids.
    """
    result = PlaceComparison()
    known = _MappedPlaces(mapped)
    for place in sorted(found, key=lambda p: p.id):
        meaning = meaning_of(place.source, place.kind, place.kinds)
        label = f"{place.kind} {place.name!r}" if place.may_be_kept else meaning[1] if meaning else "place"
        twin = known.like(place, None if meaning is None else meaning[0])
        if not place.open:
            if twin is not None:
                result.closed.add(twin.id)
            result.dropped.append(Dropped(id=place.id, reason=f"{label}: closed"))
        elif twin is not None:
            if meaning is not None and twin.kind in _VAGUE and meaning[1] not in _VAGUE:
                result.refined[twin.id] = replace(twin, category=meaning[0], kind=meaning[1])
            result.dropped.append(Dropped(id=place.id, reason=f"{label}: the same as {twin.id}"))
        elif meaning is None:
            result.dropped.append(Dropped(id=place.id, reason=f"{label}: nobody goes to such a thing"))
        elif not place.may_be_kept and meaning[0] in (Category.OPEN, Category.TRANSIT):
            result.dropped.append(Dropped(id=place.id, reason=f"{label}: only the map says where it is"))
        else:
            name = place.name if place.may_be_kept else ""
            named = NamedPlace(place.id, name, *meaning, np.array(place.xy), {}, None, exact=place.may_be_kept)
            result.added.append(named)
            known.add(replace(named, name=place.name))
    return result


class _MappedPlaces:
    """Places to compare with, found by where they are."""

    def __init__(self, mapped: Sequence[NamedPlace]) -> None:
        self._mapped = list(mapped)
        self._tree = shapely.STRtree([m.area if m.area is not None else shapely.Point(m.xy) for m in mapped])
        self._added: dict[tuple[int, int], list[NamedPlace]] = defaultdict(list)

    def add(self, named: NamedPlace) -> None:
        self._added[_bin(named.xy[0], named.xy[1])].append(named)

    def like(self, place: FoundPlace, category: Category | None) -> NamedPlace | None:
        """Find the known place that is most likely the same, None if none is."""
        point = shapely.Point(place.xy)
        reach = _ALIKE[-1][0]
        hits = sorted(self._tree.query(point, predicate="dwithin", distance=reach).tolist())
        near = [(self._mapped[i], float(self._tree.geometries[i].distance(point))) for i in hits]
        i, j = _bin(*place.xy)
        for cell in [(a, b) for a in (i - 1, i, i + 1) for b in (j - 1, j, j + 1)]:
            near += [(named, distance(named.xy, place.xy)) for named in self._added.get(cell, [])]
        best: tuple[float, NamedPlace] | None = None
        for named, away in near:
            alike = likeness(place.name, named.name)
            least = next((least for within, least in _ALIKE if away <= within), 2.0)
            if category is not None and named.category is not category:
                least += 0.1
            if alike >= least and (best is None or alike - away / 200.0 > best[0]):
                best = (alike - away / 200.0, named)
        return None if best is None else best[1]


def _bin(x: float, y: float) -> tuple[int, int]:
    return int(x // _ALIKE[-1][0]), int(y // _ALIKE[-1][0])


def likeness(one: str, other: str) -> float:
    """How alike two names are, 0 to 1: letters without accents and case, words in any order, legal forms apart."""
    a, b = _name_words(one), _name_words(other)
    if not a or not b:
        return 1.0 if one.casefold() == other.casefold() else 0.0
    if set(a) == set(b):
        return 1.0
    short, long = sorted((set(a), set(b)), key=lambda words: (len(words), sorted(words)))
    inside = 0.85 if short <= long and sum(map(len, short)) >= 4 else 0.0
    return max(inside, SequenceMatcher(None, " ".join(a), " ".join(b), autojunk=False).ratio())


def _name_words(name: str) -> list[str]:
    plain = "".join(c for c in unicodedata.normalize("NFKD", name) if not unicodedata.combining(c)).casefold()
    words = re.findall(r"\w+", plain.replace("'", "").replace("’", ""))
    return [word for word in words if word not in _FORMS] or words


class StreetAddresses:
    """Street names and house numbers."""

    def __init__(self, finder: DoorFinder, roads: Roads) -> None:
        self._finder = finder
        self._named = [(r.name, shapely.LineString(r.line)) for r in roads.roads if r.name and len(r.line) > 1]
        self._tree = shapely.STRtree([line for _, line in self._named])
        self._used: set[str] = set()

    @cached_property
    def addresses(self) -> dict[str, str]:
        """Street and number by building: its own tags, else the address points in it."""
        finder = self._finder
        found: dict[str, str] = {}
        for building in finder.buildings:
            if text := _address(finder.tags_of(building)):
                found[building.id] = text
        for node in finder.osm.nodes:
            text = _address(node.tags)
            if text and (at := finder.building_at(node.xy, 1.5)) is not None:
                found.setdefault(finder.buildings[at].id, text)
        return found

    def nearest(self, xy: Sequence[float]) -> str | None:
        """Name of the street nearest to a point, None where no street has one."""
        return self._named[int(self._tree.nearest(shapely.Point(xy)))][0] if self._named else None

    def with_invented_name(self, named: NamedPlace) -> NamedPlace:
        """Give a place a name of our making: what it is, and the address of the building it is in."""
        at = self._finder.building_at(named.xy, MATCH)
        if at is None:
            return named
        building = self._finder.buildings[at]
        address = self.addresses.get(building.id)
        street = None if address else self.nearest(shapely.Polygon(building.footprint[0]).centroid.coords[0])
        name = place_names().describe(place_names().of(named.kind), where=address, street=street)
        return replace(named, name=unused_name(name, self._used))


def unused_name(name: str, used: set[str]) -> str:
    """Return the name, or the name with the first free letter or number."""
    candidates = [name, *(f"{name} {letter}" for letter in "BCDEFGHJKLMN"), *(f"{name} {k}" for k in range(14, 999))]
    chosen = next(candidate for candidate in candidates if candidate not in used)
    used.add(chosen)
    return chosen


def _address(tags: Tags) -> str | None:
    street, number = tags.get("addr:street"), tags.get("addr:housenumber")
    return f"{street} {number.split(';')[0].split(',')[0]}" if street and number else None


_LARGE_HOUSE = 4000.0  # square metres of floor above which a house has two stairways
_HOMES_WANTED = 60  # homes that are enough for a place
_MOST_HOMES = 240  # houses that are looked at for more homes


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
    finder = DoorFinder(site.osm, buildings, walkable, height)
    streets = StreetAddresses(finder, roads)
    mapped = site.named
    told = compare_places(mapped, found)
    dropped: list[Dropped] = list(told.dropped)
    places: list[Place] = []
    seen: set[tuple[str, str | None]] = set()
    for named in [*mapped, *told.added]:
        with drop_on_failure(named.id):
            named, made = _make_place(named, finder, streets, told)
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
    return (*_check_places(places, finder, dropped), dropped)


def _make_place(
    named: NamedPlace, finder: DoorFinder, streets: StreetAddresses, told: PlaceComparison
) -> tuple[NamedPlace, Place | str]:
    """Make a place of something named, as other sources refine it; or say why it is none."""
    reason = "closed, as another source says" if named.id in told.closed else finder.misfit(named)
    if reason is not None:
        return named, reason
    named = told.refined.get(named.id, named)
    if not named.name:
        named = streets.with_invented_name(named)
    return named, finder.outdoors(named) if finder.is_outdoors(named) else finder.indoors(named)


def _check_places(
    places: list[Place], finder: DoorFinder, dropped: list[Dropped]
) -> tuple[list[Place], list[Entrance]]:
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


def _homes(finder: DoorFinder, streets: StreetAddresses) -> list[Place]:
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
            name = place_names().describe(place_names().home, where=where, street=street)
            homes.append(
                Place(
                    id=f"{building.id}.home{k}",
                    name=unused_name(name, used),
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
