"""What is asked of a city, as every process that builds a part of it is told."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from vico.worldgen.photos.texturing import Texturing
from vico.worldgen.request import WorldRequest
from vico.worldgen.seams.grid import Tile, TileGrid
from vico.worldgen.seams.join import TilePlace
from vico.worldgen.sources import Sources

PLANS = ".plans"


@dataclass(frozen=True)
class CityRequest:
    """Everything that decides what is in a city.

    Attributes
    ----------
    sources
        What to build from.
    lat, lon
        Its centre, degrees.
    grid
        Its tiles.
    seed
        Decides what the map leaves open.
    out
        Its folder.
    """

    sources: Sources
    lat: float
    lon: float
    grid: TileGrid
    seed: int
    out: Path

    @property
    def plans(self) -> Path:
        """Folder of what tiles planned."""
        return self.out / PLANS

    def place(self, tile: Tile) -> TilePlace:
        """Return which tile of the city a world is."""
        return TilePlace(self.grid, tile, self.plans)

    def tile(self, tile: Tile) -> WorldRequest:
        """Return what is asked of one tile's world."""
        place = self.place(tile)
        half = self.grid.size / 2
        return WorldRequest(self.sources, self.lat, self.lon, half, self.seed, Texturing(), None, False, place)

    def to_json(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "sources": self.sources.to_json(),
            "lat": self.lat,
            "lon": self.lon,
            "grid": asdict(self.grid),
            "seed": self.seed,
            "out": str(self.out),
        }

    @classmethod
    def from_json(cls, content: dict[str, Any]) -> CityRequest:
        """Return what `to_json` told."""
        grid = content["grid"]
        return cls(
            Sources.from_json(content["sources"]),
            content["lat"],
            content["lon"],
            TileGrid(grid["size"], (grid["first"][0], grid["first"][1]), (grid["last"][0], grid["last"][1])),
            content["seed"],
            Path(content["out"]),
        )
