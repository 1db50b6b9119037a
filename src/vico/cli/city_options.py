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
    bbox
        Box to cover instead: west, south, east and north, degrees, as in 24.93,60.16,24.96,60.18. Its middle is the
        centre where --center names none.
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
    bbox: str = ""
    dem: Files = ()
    tile: float = 400.0
    seed: int = 0
    workers: int = 0
    ray: RayAddress = None
    json: bool = False
