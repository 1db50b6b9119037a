"""Lists of places that come with the package, or lie in a folder of one's own: data for `vico world build-many`.

A list is a file ``NAME.toml`` in ``vico/data/worlds``, or in the folder ``worlds`` of ``$VICO_DATA``.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from pydantic import Field, model_validator

from vico.errors import InputError, MissingFileError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record
from vico.worldgen.place_tables import PlaceRow

_ROOM = "worlds"
_GUIDE = "docs/places35.md"


class ListedPlace(DataRecord):
    """A place of a list.

    Attributes
    ----------
    name
        Of the world's folder.
    title
        What it is called.
    country
        ISO 3166-1 alpha-2.
    lat, lon
        The centre, degrees.
    radius
        Half the side, metres.
    extract, dem
        Map and elevation, relative to a folder with extracts, for whoever has one.
    paper
        Which figure of the paper shows it, if one does.
    seed
        Of the build.
    """

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9_]{0,60}$")
    title: str = Field(min_length=1)
    country: str = Field(pattern=r"^[A-Z]{2}$")
    lat: float = Field(ge=-85.0, le=85.0)
    lon: float = Field(ge=-180.0, le=180.0)
    radius: float = Field(default=400.0, ge=50.0, le=2000.0)
    extract: str = ""
    dem: tuple[str, ...] = ()
    paper: str = ""
    seed: int = Field(default=0, ge=0)


class PlaceList(DataRecord):
    """Places, and what they are for, in a sentence."""

    about: str
    places: tuple[ListedPlace, ...] = Field(min_length=1, alias="place")

    @model_validator(mode="after")
    def _names_differ(self) -> PlaceList:
        names = [place.name for place in self.places]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"{', '.join(twice)} twice; every world needs a folder of its own")
        return self


@cached_data
def place_lists() -> dict[str, PlaceList]:
    """Return every list by name; a user's takes the place of ours of its name.

    Raises
    ------
    SchemaError
        If a file is not as it should be.
    """
    return {path.stem: read_record(path, PlaceList, guide=_GUIDE) for path in data_files(_ROOM)}


def rows_of(places: PlaceList, *, extracts: Path | None = None, only: Collection[str] = ()) -> list[PlaceRow]:
    """Return what `build_many` is told of a list.

    Parameters
    ----------
    places
        The list.
    extracts
        Folder with maps and elevation models; without, and where it has none for a place, its map is fetched.
    only
        Names of the places to take; all without.

    Raises
    ------
    InputError, MissingFileError
        If a name is none of the list's, or there is no such folder.
    """
    known = [place.name for place in places.places]
    unknown = sorted(set(only) - set(known))
    if unknown:
        raise InputError(f"build-many: {unknown[0]!r} is no place of the list; there are {', '.join(known)}")
    if extracts is not None and not extracts.is_dir():
        raise MissingFileError(f"{extracts}: no such folder of extracts")
    return [_row(place, extracts) for place in places.places if not only or place.name in only]


def _row(place: ListedPlace, extracts: Path | None) -> PlaceRow:
    osm, dem = "", ""
    if extracts is not None and place.extract and (extracts / place.extract).is_file():
        osm = str(extracts / place.extract)
        dem = ";".join(str(extracts / name) for name in place.dem if (extracts / name).is_file())
    return PlaceRow(place.name, place.lat, place.lon, osm=osm, radius=place.radius, dem=dem, seed=place.seed)
