"""OpenStreetMap files: one read, clipped to a window, in local metres."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import osmium
import shapely
from numpy.typing import NDArray
from shapely import LineString, MultiPolygon, Polygon

from vico.errors import EmptyInputError, InputError, MissingFileError, SchemaError
from vico.geo.frame import LocalFrame
from vico.geo.osm_editing import FIRST_DRAFT, deleted_objects, draft_places, overpass_remark, own_id, places_in_ways
from vico.geo.outlines import GAP, MemberWay, area_of_members, check_size, repair_outline, role_meant, simplify_outline
from vico.geo.overlay import OverlayError
from vico.geometry import distance
from vico.io.files import sha256_of

Tags = dict[str, str]

# Keys whose closed ways are areas. The rest of closed ways (a roundabout, a circular footway) are lines unless they
# say area=yes; of these keys some values are lines all the same.
_AREA_KEYS = (
    "building",
    "building:part",
    "landuse",
    "leisure",
    "natural",
    "amenity",
    "shop",
    "tourism",
    "office",
    "historic",
    "place",
    "water",
    "waterway",
    "man_made",
    "public_transport",
    "railway",
    "aeroway",
    "military",
    "area:highway",
    "craft",
    "healthcare",
    "emergency",
    "power",
)
_LINEAR_VALUES = {
    "natural": {"coastline", "cliff", "ridge", "arete", "tree_row", "valley"},
    "waterway": {"river", "stream", "canal", "ditch", "drain", "weir", "dam"},
    "man_made": {"embankment", "cutline", "pipeline", "breakwater", "groyne", "pier", "dyke", "quay"},
    "leisure": {"track", "slipway"},
    "railway": {"rail", "tram", "subway", "light_rail", "narrow_gauge", "disused", "abandoned", "construction"},
    "power": {"line", "minor_line", "cable"},
    "historic": {"citywalls", "city_wall"},
}
_MOST_TOLD = 100  # deleted objects
_STAMP = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ")


@dataclass(frozen=True)
class OsmNode:
    """A tagged point; `xy` metres, shape ``(2,)``."""

    id: int
    xy: NDArray[np.float64]
    tags: Tags


@dataclass(frozen=True)
class OsmWay:
    """A line; `line` metres, shape ``(n, 2)``, one row a node of `nodes`."""

    id: int
    nodes: list[int]
    line: NDArray[np.float64]
    closed: bool
    tags: Tags


@dataclass(frozen=True)
class OsmArea:
    """An area from a closed way (id ``w123``) or a multipolygon relation (``r45``), whole even beyond the window."""

    id: str
    polygon: Polygon | MultiPolygon
    tags: Tags


@dataclass(frozen=True)
class OsmRelation:
    """A relation; members are (type ``n``, ``w`` or ``r``, id, role), in the file's order."""

    id: int
    members: list[tuple[str, int, str]]
    tags: Tags


@dataclass(frozen=True)
class OsmData:
    """Content of an OSM file within a window, in the order of the file.

    Attributes
    ----------
    half
        Half side of the window, metres; objects that touch the window widened by `margin` are kept.
    nodes
        Points with tags.
    ways
        Every way with tags (the closed ones too, also where they are areas).
    areas
        Closed ways and multipolygons that mean an area.
    relations
        Relations with a member that was kept.
    sha256, timestamp
        Of the file: digest of its bytes and the newest object's time, or the one in its header where objects have none
        (ISO 8601; None where neither has).
    broken
        Id and what is wrong with it, of each object that was left out or mended.
    edges
        West, south, east and north of a rectangle in the window, metres, where streets and transit end; None where they
        end at the window's own sides.
    covered
        West, south, east and north of what the file says that it covers, whole metres; None where it says nothing.
    sea
        As it was found for a larger map that this is a part of; None where the coastlines of this one tell it.
    """

    frame: LocalFrame
    half: float
    margin: float
    nodes: list[OsmNode]
    ways: list[OsmWay]
    areas: list[OsmArea]
    relations: list[OsmRelation]
    sha256: str = ""
    timestamp: str | None = None
    broken: list[tuple[str, str]] = field(default_factory=list)
    edges: tuple[float, float, float, float] | None = None
    covered: tuple[float, float, float, float] | None = None
    sea: list[Polygon] | None = None

    @property
    def box(self) -> tuple[float, float, float, float]:
        """West, south, east and north of where streets and transit end, metres."""
        return (-self.half, -self.half, self.half, self.half) if self.edges is None else self.edges

    @property
    def sides(self) -> tuple[float, float]:
        """Return how wide and how high that box is, metres."""
        west, south, east, north = self.box
        return east - west, north - south

    def holds(
        self, xy: Sequence[float] | NDArray[np.float64], *, inset: float = 0.0, edge: bool = True
    ) -> NDArray[np.bool_]:
        """Return which points lie in the box.

        Parameters
        ----------
        xy
            Metres, shape ``(..., 2)``.
        inset
            How much smaller the box is to be on each side, metres.
        edge
            Whether points on its sides do.
        """
        points, (west, south, east, north) = np.asarray(xy), self.box
        low, high = np.array([west + inset, south + inset]), np.array([east - inset, north - inset])
        inside = (low <= points) & (points <= high) if edge else (low < points) & (points < high)
        return np.asarray(inside.all(axis=-1))


def means_area(tags: Mapping[str, str]) -> bool:
    """Whether a closed way with these tags is an area rather than a line.

    Follows the OSM wiki's rule: `area` decides; else a key of things that have an extent, unless its value is linear.
    """
    if (said := tags.get("area")) in ("yes", "no"):
        return said == "yes"
    return any(key in tags and tags[key] not in _LINEAR_VALUES.get(key, ()) for key in _AREA_KEYS)


def checked_extract(path: Path) -> Path:
    """Return `path` if it can be an OpenStreetMap extract; say what is wrong with it if not."""
    if not path.exists():
        raise MissingFileError(f"{path}: no such file; give an OpenStreetMap extract (.osm or .osm.pbf)")
    if not path.is_file():
        raise InputError(f"{path}: is a folder; give an OpenStreetMap extract (.osm or .osm.pbf)")
    if not path.name.endswith((".osm", ".pbf", ".osm.xml", ".osm.gz", ".osm.bz2")):
        raise InputError(
            f"{path}: not an OpenStreetMap file by its name; it must end in .osm, .osm.xml, .osm.gz, .osm.bz2 or "
            ".osm.pbf"
        )
    if path.stat().st_size == 0:
        raise SchemaError(f"{path}: the file is empty; download it again")
    with path.open("rb") as file:
        start = file.read(512).lstrip(b"\xef\xbb\xbf \t\r\n").lower()
    for mark, (ends, sentence) in _OTHER_FILES.items():
        if start.startswith(mark) and not path.name.endswith(ends):
            raise SchemaError(f"{path}: {sentence}")
    return path


# How files begin that are another thing than their names say: which names are right, and what to do.
_OTHER_FILES: Mapping[bytes, tuple[tuple[str, ...], str]] = {
    b"{": ((), "is JSON, which is not read; ask Overpass for XML with [out:xml]"),
    b"\x1f\x8b": ((".gz",), "is packed with gzip; give it a name that ends in .osm.gz"),
    b"bzh": ((".bz2",), "is packed with bzip2; give it a name that ends in .osm.bz2"),
    b"pk\x03\x04": ((), "is a ZIP archive; unpack it, and give the file in it"),
    b"<!doctype html": ((), "is a web page, not a map; download the file itself"),
    b"<html": ((), "is a web page, not a map; download the file itself"),
}
# Buildings that the map says are not there, or not yet.
_NOT_STANDING = frozenset({"proposed", "planned", "demolished", "razed", "removed", "destroyed", "dismantled"})


class _Reader:
    """The two passes over a file: relations first, to know which ways they need, then nodes and ways."""

    def __init__(self, path: Path, frame: LocalFrame, reach: float) -> None:
        self.path = str(path)
        self.frame = frame
        self.reach = reach
        self.west, self.south, self.east, self.north = frame.bbox(reach)
        # Over the date line, longitudes are counted on beyond 180 degrees.
        self.wraps = self.west > self.east
        self.east += 360.0 * self.wraps
        self.newest = 0.0
        self.stamp = ""
        self.covered: tuple[float, float, float, float] | None = None
        self.relations: list[OsmRelation] = []
        self.node_rows: list[tuple[int, float, float, Tags]] = []
        self.way_rows: list[tuple[int, list[int], list[float], list[float], Tags, bool]] = []
        self.unlocated = 0
        self.partial: dict[int, int] = {}  # way -> nodes that are missing
        self.drafts = 0
        self.objects = 0
        self.deleted: frozenset[tuple[str, int]] = frozenset()
        self.places: dict[int, tuple[float, float]] | None = None  # of nodes with negative ids
        self.not_standing: dict[str, str] = {}  # what a building is said to be that is not there, by its key

    def read(self) -> None:
        with osmium.io.Reader(self.path, osmium.osm.NOTHING) as file:
            if file.header().has_multiple_object_versions:
                raise SchemaError(
                    f"{self.path}: holds the history of its objects; cut out a day with: osmium time-filter FILE "
                    "2026-01-01T00:00:00Z -o DAY.osm.pbf"
                )
            self.stamp = file.header().get("osmosis_replication_timestamp")
            self.covered = self._box(file.header().box())
        self.deleted = deleted_objects(Path(self.path))
        wanted: set[int] = set()
        for relation in osmium.FileProcessor(self.path, osmium.osm.RELATION):
            self.objects += 1
            if relation.deleted or ("r", relation.id) in self.deleted:
                continue
            self.newest = max(self.newest, relation.timestamp.timestamp())
            tags = self._standing(f"r{own_id(relation.id)}", dict(relation.tags))
            members = [
                (member.type, own_id(member.ref), member.role)
                for member in relation.members
                if (member.type, member.ref) not in self.deleted
            ]
            self.drafts += relation.id < 0
            self.relations.append(OsmRelation(own_id(relation.id), members, tags))
            if tags.get("type") == "multipolygon":
                wanted.update(ref for kind, ref, _ in members if kind == "w")
        entities = osmium.osm.NODE | osmium.osm.WAY
        untagged = osmium.filter.EmptyTagFilter().enable_for(osmium.osm.NODE)
        for thing in osmium.FileProcessor(self.path, entities).with_locations().with_filter(untagged):
            self.objects += 1
            if thing.deleted or (self.deleted and (thing.type_str(), thing.id) in self.deleted):
                continue
            self.newest = max(self.newest, thing.timestamp.timestamp())
            if thing.is_node():
                self._node(thing)
            else:
                self._way(thing, own_id(thing.id) in wanted)

    def _box(self, told: osmium.osm.Box) -> tuple[float, float, float, float] | None:
        """Return what a file's header says that it covers, whole metres; None where it says nothing."""
        if self.wraps or not told.valid():
            return None
        low, high = told.bottom_left, told.top_right
        lats, lons = np.array([low.lat, low.lat, high.lat, high.lat]), np.array([low.lon, high.lon, low.lon, high.lon])
        # Meridians are not upright in the frame: the rectangle within the four corners.
        x, y = self.frame.to_enu(lats, lons).T
        west, south = np.ceil((max(x[0], x[2]), max(y[0], y[1]))).tolist()
        east, north = np.floor((min(x[1], x[3]), min(y[2], y[3]))).tolist()
        return west, south, east, north

    def _node(self, node: osmium.osm.Node) -> None:
        place = node.location
        if not place.valid():
            return
        lat, lon = place.lat, place.lon
        east = lon + 360.0 if self.wraps and lon < 0.0 else lon
        if self.west <= east <= self.east and self.south <= lat <= self.north:
            self.drafts += node.id < 0
            self.node_rows.append((own_id(node.id), lat, lon, dict(node.tags)))

    def _way(self, way: osmium.osm.Way, wanted: bool) -> None:
        refs: list[int] = []
        lats: list[float] = []
        lons: list[float] = []
        count = 0
        for node in way.nodes:
            if self.deleted and ("n", node.ref) in self.deleted:
                continue
            count += 1
            place = node.location
            if node.ref < 0:
                lat, lon = self._draft_place(node.ref)
            elif place.valid():
                lat, lon = place.lat, place.lon
            else:
                continue
            if math.isfinite(lat):
                refs.append(own_id(node.ref))
                lats.append(lat)
                lons.append(lon + 360.0 if self.wraps and lon < 0.0 else lon)
        if len(refs) < 2:
            self.unlocated += 1
            return
        number = own_id(way.id)
        if len(refs) < count:
            self.partial[number] = count - len(refs)
        near = max(lats) >= self.south and min(lats) <= self.north and max(lons) >= self.west and min(lons) <= self.east
        if near or wanted:
            self.drafts += way.id < 0
            tags = self._standing(f"w{number}", dict(way.tags))
            self.way_rows.append((number, refs, lats, lons, tags, near))

    def _standing(self, key: str, tags: Tags) -> Tags:
        """Return tags without those of a building that is planned or gone."""
        for tag in ("building", "building:part"):
            if tags.get(tag) in _NOT_STANDING:
                self.not_standing[key] = f"{tag}={tags.pop(tag)}: it is not there"
        return tags

    def _draft_place(self, number: int) -> tuple[float, float]:
        """Return latitude and longitude of a node with a negative id; NaN where it is not in the file."""
        if self.places is None:
            self.places = draft_places(Path(self.path))
        return self.places.get(number, (math.nan, math.nan))


def read_osm(
    path: Path, frame: LocalFrame, half: float, margin: float = 60.0, *, need_buildings: bool = True
) -> OsmData:
    """Read what an OSM file holds around the frame's origin.

    Parameters
    ----------
    path
        An ``.osm``, ``.osm.xml``, ``.osm.gz``, ``.osm.bz2`` or ``.osm.pbf`` file, nodes before ways before relations
        (as all extracts are).
    frame
        Local frame whose origin is the window's centre.
    half
        Half side of the window, metres.
    margin
        Objects up to this far outside the window are kept too, so that what crosses its edge is whole.
    need_buildings
        Whether a window without any building is an error.

    Returns
    -------
    OsmData
        Coordinates in local metres.

    Raises
    ------
    MissingFileError, InputError
        If there is no such file, or it is none by its name.
    SchemaError
        If the file is truncated or broken.
    EmptyInputError
        If it holds nothing in the window, or no building.
    """
    path = Path(path)
    checked_extract(path)
    if not (np.isfinite(half) and half > 0):
        raise InputError(f"radius: {half} m; it must be a positive number of metres, as in --radius 400")
    check_size(path)
    reader = _Reader(path, frame, half + margin)
    try:
        reader.read()
    except (RuntimeError, ValueError, OSError, osmium.InvalidLocationError) as error:
        # libosmium reports everything from a cut block to a bad tag as one of these.
        raise SchemaError(f"{path}: truncated or broken ({error}); download it again, or clip it anew") from None
    _check_whole(path)
    data = _build_osm_data(reader, half, margin, sha256_of(path))
    window = f"the {2 * half:.0f} m square around {frame.lat}, {frame.lon}"
    if not (data.ways or data.nodes or data.areas):
        if reader.objects and reader.unlocated and not reader.way_rows:
            if places_in_ways(path):
                raise SchemaError(
                    f"{path}: its nodes are not in it (Overpass's out geom); ask with (._;>;); out meta; instead"
                )
            raise SchemaError(f"{path}: ways come before their nodes; sort it with: osmium sort FILE -o SORTED.osm.pbf")
        raise EmptyInputError(f"{path}: nothing in {window}; {_elsewhere(path, frame)}")
    square = shapely.box(-half, -half, half, half)
    if need_buildings and not any(
        area.tags.get("building", "no") != "no" and shapely.intersects(area.polygon, square) for area in data.areas
    ):
        raise EmptyInputError(f"{path}: no building in {window}; {_elsewhere(path, frame)}")
    return data


def _check_whole(path: Path) -> None:
    """Make sure that Overpass could finish its answer."""
    if "error" in (remark := overpass_remark(path)).lower():
        raise SchemaError(f"{path}: Overpass stopped before its answer was whole ({remark}); ask it for less, or again")


def extract_bounds(path: Path) -> tuple[float, float, float, float]:
    """South, west, north and east of an OSM extract, degrees: of its stated bounds, else of its nodes.

    Raises
    ------
    MissingFileError, SchemaError
        If there is no such file, or it is broken or empty.
    """
    checked_extract(path)
    try:
        box = osmium.io.Reader(str(path)).header().box()
        if box.valid():
            low, high = box.bottom_left, box.top_right
            return low.lat, low.lon, high.lat, high.lon
        deleted = deleted_objects(path)
        places = [
            (node.location.lat, node.location.lon)
            for node in osmium.FileProcessor(str(path), osmium.osm.NODE)
            if node.location.valid() and not node.deleted and ("n", node.id) not in deleted
        ]
    except RuntimeError as error:
        raise SchemaError(f"{path}: truncated or broken ({error}); download it again, or clip it anew") from None
    if not places:
        _check_whole(path)
        raise SchemaError(f"{path}: holds no points; download it again, or clip it anew")
    lats, lons = zip(*places, strict=True)
    return min(lats), min(lons), max(lats), max(lons)


def _elsewhere(path: Path, frame: LocalFrame) -> str:
    """Return how to mend a window that lies beside what an extract covers: where that is, or what is exchanged."""
    south, west, north, east = extract_bounds(path)
    where = f"the extract covers {south:.4f} to {north:.4f} north, {west:.4f} to {east:.4f} east"
    if south <= frame.lat <= north and west <= frame.lon <= east:
        return f"{where}: move the window, or use another extract"
    if south <= frame.lon <= north and west <= frame.lat <= east:
        return f"latitude and longitude are exchanged: {where}; give --lat {frame.lon:g} --lon {frame.lat:g}"
    return f"{where}: check the coordinates, or use another extract"


def _build_osm_data(reader: _Reader, half: float, margin: float, digest: str) -> OsmData:
    """Turn rows of degrees into lines, areas and relations in metres."""
    reach = reader.reach
    nodes = _nodes(reader)
    window = shapely.box(-reach, -reach, reach, reach)
    shapely.prepare(window)
    ways: list[OsmWay] = []
    areas: list[OsmArea] = []
    broken = [(f"{kind}{key}", "deleted in the editor that saved the file") for kind, key in sorted(reader.deleted)]
    if len(broken) > _MOST_TOLD:
        broken = [("map", f"{len(broken):,} objects are deleted in the editor that saved the file")]
    if reader.drafts:
        ids = FIRST_DRAFT + 1
        broken.append(("map", f"{reader.drafts:,} objects are drafts of an editor (negative ids); -1 is read as {ids}"))
    by_id: dict[int, tuple[NDArray[np.float64], Tags]] = {}
    for (way_id, refs, _, _, tags, near), line in zip(reader.way_rows, _lines(reader), strict=True):
        by_id[way_id] = (line, tags)
        if not near:
            continue
        if sentence := reader.not_standing.get(f"w{way_id}"):
            broken.append((f"w{way_id}", sentence))
        if not tags:
            continue
        way = OsmWay(way_id, refs, line, len(refs) > 3 and refs[0] == refs[-1], tags)
        if not way.closed and any(tags.get(key, "no") != "no" for key in ("building", "building:part")):
            way = _close_outline(way, reader, window, broken)
        if way.closed and means_area(tags):
            area = _area_of_way(way, window, reader.partial.get(way_id, 0), broken)
            if area is not None:
                areas.append(_plain(area, broken))
                ways.append(way)
        elif np.isfinite(line).all() and window.intersects(shapely.LineString(line)):
            ways.append(way)
    kept = {("w", way.id) for way in ways} | {("n", node.id) for node in nodes}
    relations: list[OsmRelation] = []
    for relation in reader.relations:
        if relation.tags.get("type") == "multipolygon":
            area = _area_of(relation, by_id, reader, window, broken)
            if area is not None:
                areas.append(_plain(area, broken))
        if any((kind, ref) in kept for kind, ref, _ in relation.members):
            relations.append(relation)
            if sentence := reader.not_standing.get(f"r{relation.id}"):
                broken.append((f"r{relation.id}", sentence))
    found = OsmData(reader.frame, half, margin, nodes, ways, areas, relations, digest, _newest(reader), broken)
    return replace(found, covered=reader.covered)


def _close_outline(way: OsmWay, reader: _Reader, window: Polygon, broken: list[tuple[str, str]]) -> OsmWay:
    """Return a building's outline that is no ring, closed if its ends nearly meet; say so, or why it is no building."""
    if not np.isfinite(way.line).all() or not window.intersects(LineString(way.line)):
        return way
    key = f"w{way.id}"
    width = distance(way.line[0], way.line[-1])
    if missing := reader.partial.get(way.id, 0):
        broken.append(
            (key, f"{missing} of its nodes are not in the file, so that its outline is not closed; no building")
        )
    elif len(way.nodes) < 3 or way.nodes[0] == way.nodes[-1]:
        broken.append((key, "area without extent"))
    elif width > GAP:
        lat, lon = reader.frame.to_geodetic((way.line[0] + way.line[-1]) / 2)
        where = f"{float(lat):.6f}, {float(lon):.6f}"
        broken.append((key, f"its outline is not closed in the map: a gap of {width:.1f} m at {where}; no building"))
    else:
        broken.append((key, f"its outline is not closed in the map; a gap of {width:.1f} m is closed"))
        line = np.concatenate([way.line, way.line[:1]])
        return replace(way, nodes=[*way.nodes, way.nodes[0]], line=line, closed=True)
    return way


def _nodes(reader: _Reader) -> list[OsmNode]:
    """Return the tagged nodes within reach, projected in one call."""
    if not reader.node_rows:
        return []
    places = reader.frame.to_enu([row[1] for row in reader.node_rows], [row[2] for row in reader.node_rows])
    inside = np.all(np.abs(places) <= reader.reach, axis=1).tolist()
    rows = zip(reader.node_rows, places, inside, strict=True)
    return [OsmNode(row[0], xy, row[3]) for row, xy, kept in rows if kept]


def _newest(reader: _Reader) -> str | None:
    """Return the time of the newest object, else of the file, as its header states it; None where neither is told."""
    if reader.newest > 0:
        return str(np.datetime_as_string(np.datetime64(int(reader.newest), "s"))) + "Z"
    return reader.stamp if _STAMP.fullmatch(reader.stamp) else None


def _area_of_way(way: OsmWay, window: shapely.Polygon, missing: int, broken: list[tuple[str, str]]) -> OsmArea | None:
    """Return the area inside a closed way; None where it has none, or none in the window.

    Parameters
    ----------
    missing
        How many of its nodes are not in the file.
    broken
        Told what is wrong with it.
    """
    try:
        polygon, fault = repair_outline(Polygon(way.line))
    except OverlayError as error:
        broken.append((f"w{way.id}", f"its ring can't be made into an area ({error})"))
        return None
    if polygon.is_empty:
        broken.append((f"w{way.id}", fault or "area without extent"))
        return None
    if not window.intersects(polygon):
        return None
    if fault:
        broken.append((f"w{way.id}", fault))
    if missing:
        broken.append((f"w{way.id}", f"{missing} of its nodes are not in the file"))
    return OsmArea(f"w{way.id}", polygon, way.tags)


def _lines(reader: _Reader) -> list[NDArray[np.float64]]:
    """Project all ways in one call."""
    if not reader.way_rows:
        return []
    lats = np.concatenate([row[2] for row in reader.way_rows])
    lons = np.concatenate([row[3] for row in reader.way_rows])
    return np.split(reader.frame.to_enu(lats, lons), np.cumsum([len(row[1]) for row in reader.way_rows])[:-1])


def _plain(area: OsmArea, broken: list[tuple[str, str]]) -> OsmArea:
    """Return the area; a building's outline without more corners than walls and roofs can be made for."""
    if "building" not in area.tags and "building:part" not in area.tags:
        return area
    try:
        shape, what = simplify_outline(area.polygon)
    except OverlayError as error:
        broken.append((area.id, f"its outline stays as it is: it can't be simplified ({error})"))
        return area
    if what is None:
        return area
    broken.append((area.id, what))
    return OsmArea(area.id, shape, area.tags)


def _area_of(
    relation: OsmRelation,
    ways: Mapping[int, tuple[NDArray[np.float64], Tags]],
    reader: _Reader,
    window: Polygon,
    broken: list[tuple[str, str]],
) -> OsmArea | None:
    """Return the multipolygon's area; None where it has no meaning as one, has none, or none in the window."""
    given = [(ref, role) for kind, ref, role in relation.members if kind == "w"]
    members = [MemberWay(ref, role, ways[ref][0], ref in reader.partial) for ref, role in given if ref in ways]
    tags = relation.tags
    if not any(key != "type" for key in tags):
        # Old style: the outer way carries the tags.
        tags = next((ways[m.id][1] for m in members if role_meant(m.role) != "inner" and ways[m.id][1]), tags)
    if not given or not (means_area({**tags, "area": tags.get("area", "")}) or "highway" in tags):
        return None
    shape, told = area_of_members(members, len(given) - len(members), reader.frame)
    near = [shape] if shape is not None else [LineString(m.line) for m in members if np.isfinite(m.line).all()]
    if near and not any(window.intersects(one) for one in near):
        return None
    broken.extend((f"r{relation.id}", reason) for reason in told)
    return None if shape is None else OsmArea(f"r{relation.id}", shape, tags)
