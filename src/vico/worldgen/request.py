"""Request for a build: which world, from which sources, and how it is made.

`Sources` are the files and services that a world is made from; only the map is needed. `map_for` finds a map that
covers a window: the packaged extract, else one from a server. A `WorldRequest` is everything that decides what is in
a world.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator
from dataclasses import asdict, dataclass, field, fields
from importlib.resources import files
from pathlib import Path
from typing import Any

from vico.errors import InputError, MissingFileError
from vico.geo.frame import LocalFrame, split_crs
from vico.geo.overpass import MapSource, Overpass
from vico.worldgen.indoor.layout_llm import LlmLayoutAuthor
from vico.worldgen.photos.texturing import Texturing
from vico.worldgen.seams.joins import HALO, TilePlace
from vico.worldgen.stages import Progress


@dataclass(frozen=True)
class Sources:
    """Sources that a world is made from; only the map is needed.

    Attributes
    ----------
    osm
        OpenStreetMap extract, ``.osm`` or ``.osm.pbf``.
    dem
        Elevation files; flat ground without (or the ground of `tiles`).
    buildings
        Buildings of other sources: CityJSON, CityGML, Overture's GeoParquet; a model that does not say its reference
        system is followed by it, as in ``city.json@EPSG:7415``.
    precedence
        Which source decides what; the package's own order without.
    tiles
        A photogrammetry tileset: path or address of its ``tileset.json``.
    photos
        Street pictures: a folder with poses, or ``mapillary``.
    places
        Further places: GeoParquet files of Overture, or ``google``.
    gtfs
        Timetables: zipped GTFS feeds.
    layouts
        A folder of room layouts to choose from.
    detections
        What a detector found in street photos, or somebody located: COCO's JSON, or GeoJSON.
    installed_things
        Show the models of `vico assets install things` instead of ours, where there are.
    """

    osm: Path
    dem: tuple[Path, ...] = ()
    tiles: str | None = None
    photos: str | None = None
    places: tuple[str, ...] = ()
    gtfs: tuple[Path, ...] = ()
    layouts: Path | None = None
    installed_things: bool = False
    buildings: tuple[str, ...] = ()
    precedence: Path | None = None
    detections: Path | None = None

    def __post_init__(self) -> None:
        for what, value, reader in (
            ("tiles", self.tiles, "vico.geo.tiles3d.read_tileset"),
            ("photos", self.photos, "vico.geo.google_street_view.GoogleStreetView"),
        ):
            if value == "google":
                raise InputError(
                    f"{what}: Google's terms forbid to keep its content or what is derived from it, and a world is a "
                    f"folder of files; read it in memory with {reader}, or give another source"
                )

    def files(self) -> Iterator[Path]:
        """Every local file or folder among them."""
        yield self.osm
        yield from (split_crs(given)[0] for given in [*map(str, self.dem), *self.buildings])
        yield from self.gtfs
        for given in (self.tiles, self.photos, *self.places):
            if given is not None and "://" not in given and given not in SERVICES:
                yield Path(given)
        for path in (self.layouts, self.precedence, self.detections):
            if path is not None:
                yield path

    def to_json(self) -> dict[str, Any]:
        """As plain values, with absolute paths."""
        content: dict[str, Any] = {}
        for name in (f.name for f in fields(self)):
            value = getattr(self, name)
            if isinstance(value, tuple):
                content[name] = [_plain_value(item) for item in value]
            else:
                content[name] = _plain_value(value)
        return content

    @classmethod
    def from_json(cls, content: dict[str, Any]) -> Sources:
        """From what `to_json` gave.

        Raises
        ------
        InputError
            If it is something else.
        MissingFileError
            If a file is gone since.
        """
        try:
            made = cls(
                osm=Path(content["osm"]),
                dem=tuple(Path(p) for p in content["dem"]),
                tiles=content["tiles"],
                photos=content["photos"],
                places=tuple(content["places"]),
                gtfs=tuple(Path(p) for p in content["gtfs"]),
                layouts=None if content["layouts"] is None else Path(content["layouts"]),
                installed_things=bool(content["installed_things"]),
                buildings=tuple(content.get("buildings", ())),
                precedence=None if content.get("precedence") is None else Path(content["precedence"]),
                detections=None if content.get("detections") is None else Path(content["detections"]),
            )
        except (KeyError, TypeError) as error:
            raise InputError(f"the recorded sources of the world can't be read ({error}); build it anew") from None
        for path in made.files():
            if not path.exists():
                raise MissingFileError(f"{path}: the world was built from it, and it is gone; build the world anew")
        return made


LEAST_RADIUS, MOST_RADIUS = 50.0, 2000.0
"""Of a world, metres."""
#: Words that name a service instead of a file.
SERVICES = ("google", "mapillary")


def _plain_value(value: Any) -> Any:
    if isinstance(value, Path):
        return str(value.absolute())
    if isinstance(value, str) and "://" not in value and value not in SERVICES:
        return str(Path(value).absolute())
    return value


@dataclass(frozen=True)
class Extract:
    """A map extract and the window it was cut for."""

    path: Path
    name: str
    lat: float
    lon: float
    half: float


def packaged_extract() -> Extract:
    """Return the one place that comes with the package: central Helsinki (ODbL, (c) OpenStreetMap contributors)."""
    path = Path(str(files("vico").joinpath("data/helsinki.osm.pbf")))
    if not path.exists():
        raise MissingFileError(f"{path}: the packaged map extract is missing; reinstall virtual-community")
    return Extract(path, "helsinki", 60.1690, 24.9435, 400.0)


def covers(extract: Extract, lat: float, lon: float, half: float) -> bool:
    """Whether an extract holds the whole window."""
    if abs(lat - extract.lat) > 0.1 or abs(lon - extract.lon) > 0.1:
        return False
    east, north = LocalFrame(extract.lat, extract.lon).to_enu(lat, lon)
    return max(abs(float(east)), abs(float(north))) + half <= extract.half + 1.0


def map_for(lat: float | None, lon: float | None, half: float, *, source: MapSource | None) -> Path:
    """Find a map that covers a window: the packaged extract, else what `source` fetches.

    Raises
    ------
    InputError
        If no place is given, it is not on Earth, or the packaged extract does not cover it and there is no `source`.
    SourceError
        If the source can't be reached.
    """
    if lat is None or lon is None:
        raise InputError("world build: say where: --osm FILE, or --lat and --lon")
    if not (-90 <= lat <= 90 and -180 <= lon <= 180):
        raise InputError(f"world build: {lat}, {lon} is not on Earth; latitude is -90..90, longitude -180..180 degrees")
    extract = packaged_extract()
    if covers(extract, lat, lon, half):
        return extract.path
    if source is None:
        raise InputError(
            f"world build: no map data for {half:.0f} m around {lat}, {lon}: the packaged extract covers "
            f"{extract.half:.0f} m around {extract.lat}, {extract.lon} ({extract.name}), and asking a server is off; "
            "pass --osm FILE, or --overpass URL"
        )
    return source.fetch(lat, lon, half)


def locate_map(
    lat: float | None, lon: float | None, half: float, *, overpass: str | None = None, refresh: bool = False
) -> Path:
    """Find a map that covers a window: the packaged extract, else one from an Overpass server.

    Parameters
    ----------
    overpass
        Its address, or ``off``; else the environment's VICO_OVERPASS, else the public one.
    refresh
        Ask the server even if its answer is in the cache.
    """
    endpoint = overpass or os.environ.get("VICO_OVERPASS")
    return map_for(lat, lon, half, source=None if endpoint == "off" else Overpass(endpoint, refresh=refresh))


@dataclass(frozen=True)
class BuildOptions:
    """How a world is built; the defaults are those of ``vico world build``.

    Attributes
    ----------
    texturing
        How photos come onto the walls.
    author
        Draws the floor plans of places that no layout of the sources covers; None leaves them to rules.
    previews
        Whether pictures are rendered into ``previews/``; the map is always drawn.
    keep_stages
        Keep what the stages made in ``<out>/.stages``, so that one can be run again.
    again
        Names of stages to run even where their product is kept.
    progress
        Called with a stage's name, how much of it is done, and how much there is.
    """

    texturing: Texturing = field(default_factory=Texturing)
    author: LlmLayoutAuthor | None = None
    previews: bool = True
    keep_stages: bool = True
    again: Collection[str] = ()
    progress: Progress | None = None


@dataclass(frozen=True)
class WorldRequest:
    """Everything that decides what is in a world: the same request gives the same folder, byte for byte.

    Attributes
    ----------
    sources
        What to build from.
    lat, lon
        The window's centre, degrees.
    half
        Half the window's side, metres.
    seed
        Decides what the map leaves open.
    texturing
        How photos come onto the walls.
    author
        Draws floor plans, if a language model is asked for them.
    previews
        Whether pictures are rendered.
    place
        Which tile of a city it is; None for a world by itself.
    """

    sources: Sources
    lat: float
    lon: float
    half: float
    seed: int
    texturing: Texturing
    author: LlmLayoutAuthor | None
    previews: bool
    place: TilePlace | None = None

    @property
    def frame(self) -> LocalFrame:
        """The world's frame."""
        east, north = (0.0, 0.0) if self.place is None else self.place.grid.centre(self.place.tile)
        return LocalFrame(self.lat, self.lon, east, north)

    @property
    def reach(self) -> float:
        """Half the side of the square of which streets and ground are planned, metres."""
        return self.half + (0.0 if self.place is None else HALO)

    def to_json(self) -> dict[str, Any]:
        """Return plain values, with absolute paths; of the author only whether there is one."""
        return {
            "lat": self.lat,
            "lon": self.lon,
            "half": self.half,
            "seed": self.seed,
            "sources": self.sources.to_json(),
            "texturing": asdict(self.texturing),
            "drawn_layouts": self.author is not None,
            "previews": self.previews,
        }

    @classmethod
    def from_json(cls, content: dict[str, Any], *, author: LlmLayoutAuthor | None) -> WorldRequest:
        """Return the request that `to_json` wrote, with an author that may draw for it."""
        return cls(
            Sources.from_json(content["sources"]),
            content["lat"],
            content["lon"],
            content["half"],
            content["seed"],
            Texturing(**content["texturing"]),
            author,
            content.get("previews", True),
        )
