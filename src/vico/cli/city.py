"""`vico city build`, `info`, `check` and `export`: cities of tiles."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional
from tyro.extras import SubcommandApp

from vico.cli.options import FLAT, Files, RayAddress
from vico.errors import InputError

city = SubcommandApp()


@dataclass(frozen=True)
class CityBuildOptions:
    """What `vico city build` is asked for."""

    osm: Path  # Map extract, .osm or .osm.pbf, of the whole city.
    out: Path  # Folder to make, or to go on in.
    center: str = ""  # Latitude and longitude of the middle tile; the middle of the extract without.
    size: float = 2000.0  # Side of the square to cover, metres; whole tiles are built.
    #: Box to cover instead: west, south, east and north, degrees, as in 24.93,60.16,24.96,60.18. Its middle is the
    #: centre where --center names none.
    bbox: str = ""
    dem: Files = ()  # Elevation files; flat ground without.
    tile: float = 400.0  # Side of a tile, metres, a multiple of 8.
    seed: int = 0  # Decides what the map leaves open.
    workers: int = 0  # Processes side by side; 0 is one a processor.
    #: Hand the tiles to a Ray cluster instead (the extra "ray"): its address; without one, that which runs here.
    ray: RayAddress = None
    json: bool = False  # Print the result as JSON.


@city.command(name="build")
def city_build(options: Annotated[CityBuildOptions, FLAT]) -> int:
    """Build a city of tiles that meet without a seam; each is a world of its own.

    A build that was stopped goes on where it was, and one with a changed map builds anew the tiles that changed.

    Example: vico city build --osm region.osm.pbf --center 60.1690,24.9435 --size 2000 --out city --workers 2
    """
    from vico.cli.console import progress_bars
    from vico.world.model import FLAT_GROUND
    from vico.worldgen.city_build import build_city, city_request
    from vico.worldgen.pipeline import extract_centre
    from vico.worldgen.request import Sources

    box = _box(options.bbox) if options.bbox else None
    if options.center:
        try:
            lat, lon = map(float, options.center.split(","))
        except ValueError:
            raise InputError(
                f"center: {options.center!r}; give latitude and longitude, as in --center 60.1690,24.9435"
            ) from None
    elif box is not None:
        lat, lon = (box[1] + box[3]) / 2, (box[0] + box[2]) / 2
    else:
        lat, lon = extract_centre(options.osm)
    request = city_request(
        Sources(options.osm, dem=tuple(chain.from_iterable(options.dem))),
        lat=lat,
        lon=lon,
        extent=options.size if box is None else box,
        out=options.out,
        tile=options.tile,
        seed=options.seed,
    )
    with progress_bars() as report:
        built = build_city(request, workers=options.workers or os.cpu_count() or 1, ray=options.ray, progress=report)
    city_info(options.out, json=options.json)
    if not options.dem:
        print(f"{options.out}: {FLAT_GROUND}", file=sys.stderr)
    return 1 if built.manifest.failed else 0


@city.command(name="info")
def city_info(path: Positional[Path], json: bool = False) -> int:
    """Say which tiles a city has, and what is in them.

    Example: vico city info city

    Args:
        path: City folder.
        json: Print JSON.
    """
    from vico.cli.console import print_json, print_table
    from vico.world.city import read_city

    manifest = read_city(path).manifest
    if json:
        print_json(manifest.model_dump(mode="json"))
        return 0
    side = manifest.size
    print_table(
        f"city {path}",
        {
            "centre": f"{manifest.origin.lat:.5f}, {manifest.origin.lon:.5f}",
            "tiles": f"{len(manifest.tiles)} of {side:.0f} m, columns {manifest.first[0]} to {manifest.last[0]}, rows "
            f"{manifest.first[1]} to {manifest.last[1]}",
            "square kilometres": round(len(manifest.tiles) * side * side / 1e6, 2),
            "buildings": sum(tile.buildings for tile in manifest.tiles),
            "places": sum(tile.places for tile in manifest.tiles),
            "seed": manifest.seed,
            **{f"not built: {name}": reason for name, reason in manifest.failed.items()},
        },
    )
    return 0


@city.command(name="check")
def city_check(path: Positional[Path], borders: bool = False, json: bool = False) -> int:
    """Check every tile of a city, and every border between two; exit 1 if anything is wrong.

    Example: vico city check city --borders

    Args:
        path: City folder.
        borders: Borders alone.
        json: Print JSON.
    """
    from vico.cli.console import print_json, progress_bars
    from vico.world.check import check_whole, check_world
    from vico.world.city import border_findings, read_city
    from vico.world.city_world import CityWorld

    read = read_city(path)
    findings: list[str] = []
    with progress_bars() as report:
        pairs = read.borders()
        for k, (first, second, axis) in enumerate(pairs, 1):
            findings += border_findings(read, first, second, axis)
            report("borders", k, len(pairs))
        for k, tile in enumerate(read.manifest.tiles if not borders else [], 1):
            found = check_world(read.world((tile.column, tile.row)), part=True)
            findings += [f"{tile.name}: {one.where}: {one.what}" for one in found]
            report("tiles", k, len(read.manifest.tiles))
        if not borders:
            findings += [f"{one.where}: {one.what}" for one in check_whole(CityWorld(read))]
            report("streets", 1, 1)
    findings += [f"{name}: not built: {reason}" for name, reason in read.manifest.failed.items()]
    if json:
        print_json({"ok": not findings, "borders": len(pairs), "findings": findings})
    else:
        for finding in findings:
            print(finding)
        print(f"{path}: {len(findings)} findings" if findings else f"{path}: {len(pairs)} borders, all is well")
    return 1 if findings else 0


@city.command(name="export")
def city_export(
    path: Positional[Path], to: str, out: Path, rooms: bool = False, force: bool = False, json: bool = False
) -> int:
    """Write a city in another format: streets and places as one, meshes tile by tile.

    Example: vico city export city --to gltf --out city_gltf

    Args:
        path: City folder.
        to: gltf, usd, mjcf, geojson or xodr.
        out: Folder to make; refused if it exists, unless --force.
        rooms: With what lies indoors.
        force: Replace what this verb made there before; refused if the folder holds anything else.
        json: Print JSON.
    """
    from vico.cli.console import check_output, print_export
    from vico.world.city import read_city
    from vico.world.exports import EXPORT_FOLDER, export_city

    check_output(out, path, force=force, kind=EXPORT_FOLDER)
    counts = export_city(read_city(path), to, out, rooms=rooms, force=force)
    print_export(out, to, counts, json=json)
    return 0


def _box(text: str) -> tuple[float, float, float, float]:
    try:
        west, south, east, north = map(float, text.split(","))
    except ValueError:
        raise InputError(
            f"bbox: {text!r}; give west, south, east and north, as in --bbox 24.93,60.16,24.96,60.18"
        ) from None
    return west, south, east, north
