"""A city on disk: tiles of a fixed grid, each a world folder of its own.

::

    city.json        what the city is: where, which tiles, what they were made of; written last
    tiles/C_R/       the world of the tile in column C and row R, east and north of the middle one
    whole/           what the city has as a whole: ground, streets, where people walk (`vico.world.city_files`)
    .plans/          what tiles planned: streets and ground, as their neighbours need them; no part of the city
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationError

from vico.errors import MissingFileError, SchemaError
from vico.io.files import read_json
from vico.world.model import Origin, Record, StageReport
from vico.world.stored import read_stored
from vico.world.world import World

VERSION = 3
#: Name of a city's manifest.
CITY = "city.json"
_AGAIN = "the vico city build that made the city makes it again"
#: Folder of the folders of the tiles' worlds.
TILES = "tiles"


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
    reports
        What the streets of the city as a whole have, and what was left out.
    files
        SHA-256 of what the city has as a whole, by path.
    """

    schema_name: Literal["vico.city"] = "vico.city"
    version: Literal[3] = 3
    producer: str
    origin: Origin
    size: Annotated[float, Field(gt=0)]
    first: tuple[int, int]
    last: tuple[int, int]
    seed: int
    tiles: list[CityTile]
    failed: dict[str, str] = Field(default_factory=dict)
    reports: list[StageReport] = Field(default_factory=list)
    files: dict[str, str] = Field(default_factory=dict)


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

    @property
    def half(self) -> float:
        """Half the side of the square around the middle of the tile (0, 0) that holds all tiles, metres."""
        return (max(abs(k) for k in (*self.manifest.first, *self.manifest.last)) + 0.5) * self.manifest.size

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
        SchemaError
            If the tile is not the one that the city was built of.
        """
        known = self._tiles.get(tile)
        if known is None:
            raise MissingFileError(f"{self.path}: has no tile {tile[0]}_{tile[1]}; vico city info lists its tiles")
        folder = self.path / TILES / known.name
        if not (folder / "world.json").exists():
            raise MissingFileError(f"tile {known.name}: {folder} is gone or not whole; {_AGAIN}")
        world = read_stored(folder)
        if world.digest != known.digest:
            raise SchemaError(f"tile {known.name}: {folder} is of another build than {self.path / CITY}; {_AGAIN}")
        return world


def read_city(path: Path) -> City:
    """Open a city folder.

    Raises
    ------
    MissingFileError
        If there is none at `path`.
    SchemaError
        If its manifest is damaged, or of another version.
    """
    file = Path(path) / CITY
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
