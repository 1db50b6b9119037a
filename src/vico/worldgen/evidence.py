"""Content of a world's sources, read once before its stages run; and values of the map that could not be read.

A build's report lists each value that is not plain: what was read by a rule ("G+4" as five storeys), what can't be
read ("two"), and what can't be true ("9999"). Nothing else is decided here; stages read the same values by
`vico.geo.quantities` and `vico.world.opening_hours`.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.errors import EmptyInputError, InputError
from vico.geo.building_files import checked_files, read_buildings
from vico.geo.buildings import FoundBuildings
from vico.geo.detections import Detections, read_detections
from vico.geo.elevation import HeightSamples, read_elevation
from vico.geo.frame import LocalFrame
from vico.geo.gtfs import read_gtfs
from vico.geo.gtfs_feed import NO_TIMETABLE, Feed
from vico.geo.mapillary import Mapillary
from vico.geo.osm import OsmData, Tags, read_osm
from vico.geo.overture import OverturePlaces
from vico.geo.places import FoundPlace, GooglePlaces, google_key
from vico.geo.quantities import QUANTITIES, Kind, Range, read
from vico.geo.street_image_folder import FolderImages
from vico.geo.street_images import StreetImage, StreetImages
from vico.geo.tiles3d import TileMesh, read_tileset
from vico.geo.tiles3d_files import tile_source
from vico.io.cache import cache_folder
from vico.io.files import sha256_of
from vico.io.http import HttpClient
from vico.world.model import Dropped, Place, Source
from vico.world.opening_hours import how_read, standard_spelling
from vico.worldgen.facts.conflation import Precedence, read_precedence
from vico.worldgen.request import SERVICES, Sources
from vico.worldgen.stages import Stages, digest_of

_UNITS = {
    Kind.LENGTH: " m",
    Kind.STOREYS: " storeys",
    Kind.SPEED: " m/s",
    Kind.ANGLE: " degrees",
    Kind.NUMBER: "",
    Kind.LANES: "",
}
# Values of `maxspeed` that say no speed, and mean to.
_PLAIN_WORDS = frozenset({"none", "signals", "variable", "no", "unknown"})


def quantity_notes(osm: OsmData) -> tuple[dict[str, int], list[Dropped]]:
    """List the heights, storeys, widths and speeds of a window that were read by a rule or not at all.

    Returns
    -------
    tuple
        Counts of values ``by_rule`` and ``not_read`` (empty where all are plain), and id and sentence of each.
    """
    told: list[Dropped] = []
    counts = {"by_rule": 0, "not_read": 0}
    for name, shape, tags in _tagged_objects(osm):
        for key, text in tags.items():
            of = QUANTITIES.get(key)
            if of is None or (sentence := _note_on_value(text, of)) is None or not np.any(osm.holds(shape)):
                continue
            counts["by_rule" if " read as " in sentence else "not_read"] += 1
            told.append(Dropped(id=name, reason=f"{key}={text!r} {sentence}"))
    return (counts if told else {}), told


def opening_hours_notes(places: Sequence[Place]) -> tuple[dict[str, int], list[Dropped]]:
    """List the opening hours of places that were respelled or can't be read; the counts as of quantities."""
    told: list[Dropped] = []
    counts = {"by_rule": 0, "not_read": 0}
    for place in places:
        text = place.opening_hours
        if text is None or (how := how_read(text)) == "as typed":
            continue
        counts["not_read" if how == "not read" else "by_rule"] += 1
        read_as = (
            f"was read as {standard_spelling(text)!r}" if how == "respelled" else "can't be read: usual hours hold"
        )
        told.append(Dropped(id=place.id, reason=f"opening_hours={text!r} {read_as}"))
    return (counts if told else {}), told


def _tagged_objects(osm: OsmData) -> Iterator[tuple[str, NDArray[np.float64], Tags]]:
    """Yield everything of a map that has tags: its id, points of its shape, and its tags; a closed way once."""
    yield from ((f"n{node.id}", node.xy[None], node.tags) for node in osm.nodes)
    yield from ((f"w{way.id}", way.line, way.tags) for way in osm.ways)
    relations: Iterable[tuple[str, NDArray[np.float64], Tags]] = (
        (area.id, shapely.get_coordinates(area.polygon), area.tags) for area in osm.areas if area.id.startswith("r")
    )
    yield from relations


def _note_on_value(text: str, of: Range) -> str | None:
    """Say how a value was read, or why not; None where it is plain."""
    if text in _PLAIN_WORDS and of.kind is Kind.SPEED:
        return None
    found = read(text, of.kind)
    if found.value is None:
        return "can't be read: decided by rule"
    if not of.least <= found.value <= of.most:
        return f"can't be ({of.least:g} to {of.most:g}{_UNITS[of.kind]}): decided by rule"
    if found.rule:
        return f"was read as {found.value:.4g}{_UNITS[of.kind]}: {found.rule}"
    return None


_TILE_MARGIN = 80.0  # metres: as far as the terrain goes beyond the window, and what hides its border
_TILE_ERROR = 0.4  # metres: coarser tiles have photos too blurred for walls with texels of 10 cm
_MOST_PHOTOS = 400
_SHOWN_OUTLIERS = 3


@dataclass(frozen=True)
class Evidence:
    """Content of the sources.

    Attributes
    ----------
    data
        The map.
    samples
        Heights, if there is an elevation file.
    tiles
        The photogrammetry mesh of the place, if there is a tileset.
    images
        Street photos.
    found
        Places that other sources know.
    feeds
        Timetables.
    detections
        What photos show, if there is a file of it.
    credits
        Every source, with what its licence asks for.
    buildings
        What files of buildings have.
    precedence
        Which source decides what; None where only the map was asked.
    """

    data: OsmData
    samples: HeightSamples | None
    tiles: TileMesh | None
    images: Sequence[StreetImage]
    found: Sequence[FoundPlace]
    feeds: Sequence[Feed]
    credits: list[Source]
    buildings: list[FoundBuildings] = field(default_factory=list)
    precedence: Precedence | None = None
    detections: Detections | None = None


def read_evidence(
    sources: Sources, frame: LocalFrame, half: float, stages: Stages, *, part: tuple[OsmData, str] | None = None
) -> Evidence:
    """Read every source, and report what could not be read.

    Parameters
    ----------
    part
        What of the map lies here, and its digest, if this is a part of a larger place: then nothing need be there, and
        a change elsewhere changes nothing.

    Raises
    ------
    VicoError
        Of whichever kind the source's reader raises; each is one sentence.
    """
    where = f"{frame} {half}"
    # Which source decides what is read before anything that takes long; where only the map is asked, nothing is.
    precedence = None
    if sources.buildings or sources.precedence is not None:
        precedence = read_precedence(sources.precedence, [path.name for path, _ in checked_files(sources.buildings)])
    with stages.timer("map"):
        if part is None:
            data = read_osm(sources.osm, frame, half)
            stages.register(data, f"{data.sha256} {where}")
        else:
            data = stages.register(*part)
        finest = precedence is None or precedence.terrain == "finest"
        samples, without = _heights(sources, frame, half, finest_first=finest, part=part is not None)
        if samples is not None:
            stages.register(samples, f"{samples.sha256} {where}{'' if finest else ' as given'}")
    _report_map(data, samples, without, stages)
    credits = [
        Source(
            kind="map",
            name=sources.osm.name,
            licence="ODbL-1.0",
            attribution="© OpenStreetMap contributors",
            timestamp=data.timestamp,
            sha256=data.sha256 or sha256_of(sources.osm) if part is None else None,
        )
    ]
    if samples is not None:
        credits += [
            Source(kind="elevation", name=name, licence="as its provider states", attribution=name, sha256=digest)
            for name, digest, _ in samples.files
        ]
    tiles = None
    if sources.tiles is not None:
        with stages.timer("tiles"):
            tiles = _tile_mesh(sources.tiles, frame, half, stages, credits)
    images: list[StreetImage] = []
    if sources.photos is not None:
        with stages.timer("photos"):
            images = _photos(sources.photos, frame, half, stages, credits)
    found: list[FoundPlace] = []
    if sources.places:
        with stages.timer("found places"):
            found = _places(sources.places, frame, half, stages, credits)
    feeds = []
    if sources.gtfs:
        with stages.timer("timetables"):
            as_of = None if data.timestamp is None else date.fromisoformat(data.timestamp[:10])
            feeds = [read_gtfs(path, frame, half, as_of=as_of) for path in sources.gtfs]
        for path, feed in zip(sources.gtfs, feeds, strict=True):
            stages.register(feed, f"{feed.sha256} {where}")
            credits.append(
                Source(
                    kind="timetable",
                    name=path.name,
                    licence="as its provider states",
                    attribution=feed.attribution,
                    sha256=feed.sha256,
                )
            )
        silent = [
            Dropped(id=feed.name, reason=f"{NO_TIMETABLE} or tram here: {feed.nothing}")
            for feed in feeds
            if feed.nothing
        ]
        broken = [Dropped(id=key, reason=reason) for feed in feeds for key, reason in feed.broken]
        stages.report("timetables", {"feeds": len(feeds)}, silent + broken)
    buildings: list[FoundBuildings] = []
    if sources.buildings:
        with stages.timer("found buildings"):
            buildings = _buildings(sources, frame, half, stages, credits)
    detections = None
    if sources.detections is not None:
        with stages.timer("detections file"):
            detections = _detections(sources.detections, sources, frame, half, stages, credits)
    return Evidence(data, samples, tiles, images, found, feeds, credits, buildings, precedence, detections)


def _report_map(data: OsmData, samples: HeightSamples | None, without: Dropped | None, stages: Stages) -> None:
    """Say what was read of the map and the elevation models, and what was not."""
    stages.report(
        "map",
        {
            "nodes": len(data.nodes),
            "ways": len(data.ways),
            "areas": len(data.areas),
            "heights": 0 if samples is None else len(samples.points),
            "heights_filled": 0 if samples is None else samples.filled,
        },
        [Dropped(id=key, reason=reason) for key, reason in data.broken],
    )
    if (typed := quantity_notes(data))[1]:
        stages.report("values of the map", *typed)
    if without is not None:
        stages.report("map", {}, [without])
    if samples is not None and samples.beyond:
        stages.report(
            "map",
            {"heights_cover_percent": round(100 * samples.covered)},
            [Dropped(id=samples.name, reason=samples.beyond)],
        )
    if samples is not None and samples.outliers:
        told = [Dropped(id=name, reason=reason) for name, reason in _outlier_notes(samples)]
        stages.report("map", {"heights_outlying": len(samples.outliers)}, told)
    if samples is not None and (samples.voids or samples.doubtful):
        told = [Dropped(id=name, reason=reason) for name, reason in _void_notes(samples)]
        stages.report("map", {"heights_void": sum(count for *_, count, _ in samples.voids)}, told)


def _void_notes(samples: HeightSamples) -> list[tuple[str, str]]:
    """Return the file of each patch of one height that is a void or may be one, and a sentence on it."""
    told = []
    for rows, said in (
        (samples.voids, "no ground does: left out as void and filled in; to say so in the file"),
        (samples.doubtful, "so does a sea below cliffs or the top of a tower: kept; if there is no data, say so"),
    ):
        for name, lat, lon, height, count, step in rows[:_SHOWN_OUTLIERS]:
            what = f"{count:,} pixels of exactly {height:g} m around {lat:.5f}, {lon:.5f}"
            lies = f"lie {abs(step):.0f} m {'below' if step > 0 else 'above'} the ground on nearly all sides"
            told.append((name, f"{what} {lies}; {said}: gdal_edit.py -a_nodata {height:g} {name}"))
        if len(rows) > _SHOWN_OUTLIERS:
            rest = rows[_SHOWN_OUTLIERS:]
            pixels = sum(count for *_, count, _ in rest)
            told.append((rows[-1][0], f"{len(rest)} more such patches, {pixels:,} pixels"))
    return told


def _outlier_notes(samples: HeightSamples) -> list[tuple[str, str]]:
    """Return each file with heights that no ground has, and a sentence on them."""
    told = []
    for name in dict.fromkeys(row[0] for row in samples.outliers):
        rows = [row for row in samples.outliers if row[0] == name]
        shown = ", ".join(f"{height:.0f} m at {lat:.5f}, {lon:.5f}" for _, lat, lon, height in rows[:_SHOWN_OUTLIERS])
        more = f" and {len(rows) - _SHOWN_OUTLIERS} more" if len(rows) > _SHOWN_OUTLIERS else ""
        what = "1 height stands" if len(rows) == 1 else f"{len(rows)} heights stand"
        told.append((name, f"{what} far above or below all around, left out and filled in: {shown}{more}"))
    return told


def _heights(
    sources: Sources, frame: LocalFrame, half: float, *, finest_first: bool, part: bool
) -> tuple[HeightSamples | None, Dropped | None]:
    """Read the elevation files; where they have nothing of a part of a place, what lies around decides, and say so."""
    if not sources.dem:
        return None, None
    try:
        return read_elevation(sources.dem, frame, half, finest_first=finest_first), None
    except EmptyInputError as error:
        if not part:
            raise
        return None, Dropped(id=sources.dem[0].name, reason=str(error))


def _buildings(
    sources: Sources, frame: LocalFrame, half: float, stages: Stages, credits: list[Source]
) -> list[FoundBuildings]:
    made = read_buildings(sources.buildings, frame, half)
    dropped: list[Dropped] = []
    for found in made:
        dropped += [Dropped(id=key, reason=reason) for key, reason in found.refused]
        if not found.buildings:
            reason = "holds no building in the window; check its place and its reference system"
            dropped.append(Dropped(id=found.file, reason=reason))
        credits.append(
            Source(
                kind="buildings",
                name=found.file,
                licence=found.licence,
                attribution="; ".join(found.attributions) or found.file,
                sha256=found.sha256,
            )
        )
    counts = {f"{found.kind} {found.file}": len(found.buildings) for found in made}
    measured = sum(bool(building.facets) for found in made for building in found.buildings)
    stages.report("found buildings", {**counts, "with_measured_roofs": measured}, dropped)
    return made


def _detections(
    path: Path, sources: Sources, frame: LocalFrame, half: float, stages: Stages, credits: list[Source]
) -> Detections:
    photos = None if sources.photos in (None, *SERVICES) else Path(str(sources.photos))
    found = read_detections(path, frame, half, photos=photos)
    stages.register(found, f"{found.sha256} {frame} {half}")
    credits.append(
        Source(
            kind="detections",
            name=path.name,
            licence="as its provider states",
            attribution=found.attribution or path.name,
            sha256=found.sha256,
        )
    )
    return found


def _tile_mesh(source: str, frame: LocalFrame, half: float, stages: Stages, credits: list[Source]) -> TileMesh:
    mesh, report = read_tileset(
        tile_source(source, web=HttpClient(cache=cache_folder() / "tiles")),
        frame,
        half,
        error=_TILE_ERROR,
        margin=_TILE_MARGIN,
    )
    stages.register(mesh, digest_of(mesh))
    dropped = [Dropped(id=uri, reason=reason) for uri, reason in report.left_out]
    stages.report("tiles", {"tiles": report.read, "triangles": len(mesh.triangles)}, dropped)
    attribution = "; ".join(mesh.attributions) or _file_name(source)
    credits.append(
        Source(kind="tiles", name=_file_name(source), licence="as its provider states", attribution=attribution)
    )
    return mesh


def _photos(source: str, frame: LocalFrame, half: float, stages: Stages, credits: list[Source]) -> list[StreetImage]:
    reader: StreetImages
    if source == "mapillary":
        token = os.environ.get("MAPILLARY_TOKEN")
        if not token:
            raise InputError("photos: set MAPILLARY_TOKEN in the environment to your access token of mapillary.com")
        reader = Mapillary(token, HttpClient(cache=cache_folder() / "photos"))
    else:
        reader = FolderImages(Path(source))
    images = list(reader.near(frame, half, most=_MOST_PHOTOS))
    dropped = [Dropped(id=key, reason=reason) for key, reason in reader.refused]
    stages.report("photos", {"photos": len(images)}, dropped)
    for attribution in dict.fromkeys(image.attribution for image in images):
        name = "Mapillary" if source == "mapillary" else _file_name(source)
        licence = "CC-BY-SA-4.0" if source == "mapillary" else "as its provider states"
        credits.append(Source(kind="photos", name=name, licence=licence, attribution=attribution))
    return images


def _places(
    names: Sequence[str], frame: LocalFrame, half: float, stages: Stages, credits: list[Source]
) -> list[FoundPlace]:
    files = [Path(name) for name in names if name != "google"]
    readers: list[OverturePlaces | GooglePlaces] = [OverturePlaces(files)] if files else []
    if "google" in names:
        readers.append(GooglePlaces(google_key(), HttpClient()))
    found: list[FoundPlace] = []
    dropped: list[Dropped] = []
    for reader in readers:
        near = reader.near(frame, half)
        found += near
        dropped += [Dropped(id=key, reason=reason) for key, reason in reader.refused]
        for attribution in dict.fromkeys(place.attribution for place in near):
            google = isinstance(reader, GooglePlaces)
            licence = "Google Maps Platform terms: place ids only" if google else "CDLA-Permissive-2.0, ODbL-1.0"
            name = "Google Places" if google else "Overture Maps"
            credits.append(Source(kind="places", name=name, licence=licence, attribution=attribution))
    stages.report("found places", {"found": len(found)}, dropped)
    return found


def _file_name(source: str) -> str:
    """Return the last part of a path or address, without a query: it may hold a key."""
    return source.split("?")[0].rstrip("/").rsplit("/", 1)[-1]
