"""A city on disk: tiles of a fixed grid, each a world folder of its own.

::

    city.json        what the city is: where, which tiles, what they were made of
    tiles/C_R/       the world of the tile in column C and row R, east and north of the middle one
    .plans/          what tiles planned: streets and ground, as their neighbours need them; no part of the city
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationError

from vico.errors import MissingFileError, SchemaError
from vico.io.files import read_json
from vico.world.folder import World, read_world
from vico.world.model import Origin, Record

VERSION = 1


class CityTile(Record):
    """A tile that is built."""

    column: int
    row: int
    name: str
    digest: str
    buildings: int
    places: int


class CityManifest(Record):
    """`city.json`.

    Attributes
    ----------
    origin
        Middle of the tile (0, 0), and of the projection that all tiles share.
    size
        Side of a tile, metres.
    first, last
        Column and row of the south-western and the north-eastern tile.
    tiles
        Those that are built, row by row from the south-west.
    failed
        Why others are not, by name.
    """

    schema_name: Literal["vico.city"] = "vico.city"
    version: Literal[1] = 1
    producer: str
    origin: Origin
    size: Annotated[float, Field(gt=0)]
    first: tuple[int, int]
    last: tuple[int, int]
    seed: int
    tiles: list[CityTile]
    failed: dict[str, str] = Field(default_factory=dict)


class City:
    """A city of tiles.

    Parameters
    ----------
    manifest
        What it is.
    path
        Its folder.
    """

    def __init__(self, manifest: CityManifest, path: Path) -> None:
        self.manifest = manifest
        self.path = path
        self._tiles = {(tile.column, tile.row): tile for tile in manifest.tiles}

    def __contains__(self, tile: object) -> bool:
        return tile in self._tiles

    def borders(self) -> list[tuple[tuple[int, int], tuple[int, int], int]]:
        """Return all pairs of tiles side by side, and along which axis the second follows: 0 east, 1 north."""
        found = []
        for column, row in self._tiles:
            for axis, after in ((0, (column + 1, row)), (1, (column, row + 1))):
                if after in self._tiles:
                    found.append(((column, row), after, axis))
        return found

    def world(self, tile: tuple[int, int]) -> World:
        """Open the world of a tile.

        Raises
        ------
        MissingFileError
            If the city has no such tile, or its folder is gone.
        """
        known = self._tiles.get(tile)
        if known is None:
            raise MissingFileError(f"{self.path}: has no tile {tile[0]}_{tile[1]}; vico city info lists its tiles")
        return read_world(self.path / "tiles" / known.name)


def read_city(path: Path) -> City:
    """Open a city folder.

    Raises
    ------
    MissingFileError
        If there is none at `path`.
    SchemaError
        If its manifest is damaged, or of another version.
    """
    file = Path(path) / "city.json"
    if not file.exists():
        raise MissingFileError(f"{path}: holds no city.json, so it is no city; make one with vico city build")
    content = read_json(file)
    if isinstance(content, dict) and content.get("version", VERSION) != VERSION:
        raise SchemaError(f"{file}: version {content['version']!r}, but this one reads {VERSION}; build the city anew")
    try:
        return City(CityManifest.model_validate(content), Path(path))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise SchemaError(f"{file}: {where}: {first['msg']}; build the city anew") from None
