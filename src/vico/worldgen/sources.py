"""What a world is made from: files and services, as the caller names them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from vico.errors import InputError, MissingFileError
from vico.geo.frame import split_crs


@dataclass(frozen=True)
class Sources:
    """What a world is made from; only the map is needed.

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
                content[name] = [_plain(item) for item in value]
            else:
                content[name] = _plain(value)
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


def _plain(value: Any) -> Any:
    if isinstance(value, Path):
        return str(value.absolute())
    if isinstance(value, str) and "://" not in value and value not in SERVICES:
        return str(Path(value).absolute())
    return value
