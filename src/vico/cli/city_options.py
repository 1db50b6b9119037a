"""Options of `vico city`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from vico.cli.options import Files, RayAddress


@dataclass(frozen=True)
class CityBuildOptions:
    """What `vico city build` is asked for.

    Attributes
    ----------
    osm
        Map extract, .osm or .osm.pbf, of the whole city.
    out
        Folder to make, or to go on in.
    center
        Latitude and longitude of the middle tile; the middle of the extract without.
    size
        Side of the square to cover, metres; whole tiles are built.
    dem
        Elevation files; flat ground without.
    tile
        Side of a tile, metres, a multiple of 8.
    seed
        Decides what the map leaves open.
    workers
        Processes side by side; 0 is one a processor.
    ray
        Hand the tiles to a Ray cluster instead (the extra "ray"): its address; without one, that which runs here.
    json
        Print the result as JSON.
    """

    osm: Path
    out: Path
    center: str = ""
    size: float = 2000.0
    dem: Files = ()
    tile: float = 400.0
    seed: int = 0
    workers: int = 0
    ray: RayAddress = None
    json: bool = False
