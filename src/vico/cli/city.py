"""The verbs of `vico city`."""

from __future__ import annotations

import os
import sys
from itertools import chain
from pathlib import Path

from vico.cli.city_options import CityBuildOptions
from vico.cli.output import check_output, print_export, print_json, print_table, progress_bars
from vico.errors import InputError
from vico.world.city import read_city
from vico.world.city_world import CityWorld
from vico.world.model import FLAT_GROUND


def build(options: CityBuildOptions) -> int:
    """Build a city; 1 if a tile could not be built."""
    from vico.worldgen.city_build import build_city, city_request
    from vico.worldgen.pipeline import extract_centre
    from vico.worldgen.sources import Sources

    box = _box(options.bbox) if options.bbox else None
    if options.center:
        lat, lon = _degrees(options.center)
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
        city = build_city(request, workers=options.workers or os.cpu_count() or 1, ray=options.ray, progress=report)
    info(options.out, json=options.json)
    if not options.dem:
        print(f"{options.out}: {FLAT_GROUND}", file=sys.stderr)
    return 1 if city.manifest.failed else 0


def _degrees(text: str) -> tuple[float, float]:
    parts = text.split(",")
    try:
        lat, lon = map(float, parts)
    except ValueError:
        raise InputError(f"center: {text!r}; give latitude and longitude, as in --center 60.1690,24.9435") from None
    return lat, lon


def _box(text: str) -> tuple[float, float, float, float]:
    try:
        west, south, east, north = map(float, text.split(","))
    except ValueError:
        raise InputError(
            f"bbox: {text!r}; give west, south, east and north, as in --bbox 24.93,60.16,24.96,60.18"
        ) from None
    return west, south, east, north


def info(path: Path, *, json: bool = False) -> int:
    """Say what a city holds."""
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


def check(path: Path, *, tiles: bool = True, json: bool = False) -> int:
    """Check a city; 1 if anything is wrong."""
    from vico.world.borders import border_findings
    from vico.world.check import check_whole, check_world

    city = read_city(path)
    findings: list[str] = []
    with progress_bars() as report:
        borders = city.borders()
        for k, (first, second, axis) in enumerate(borders, 1):
            findings += border_findings(city, first, second, axis)
            report("borders", k, len(borders))
        for k, tile in enumerate(city.manifest.tiles if tiles else [], 1):
            found = check_world(city.world((tile.column, tile.row)), part=True)
            findings += [f"{tile.name}: {one.where}: {one.what}" for one in found]
            report("tiles", k, len(city.manifest.tiles))
        if tiles:
            findings += [f"{one.where}: {one.what}" for one in check_whole(CityWorld(city))]
            report("streets", 1, 1)
    findings += [f"{name}: not built: {reason}" for name, reason in city.manifest.failed.items()]
    if json:
        print_json({"ok": not findings, "borders": len(borders), "findings": findings})
    else:
        for finding in findings:
            print(finding)
        print(f"{path}: {len(findings)} findings" if findings else f"{path}: {len(borders)} borders, all is well")
    return 1 if findings else 0


def export(path: Path, to: str, *, out: Path, rooms: bool = False, force: bool = False, json: bool = False) -> int:
    """Write a city in another format."""
    from vico.world.exports import EXPORT_FOLDER, export_city

    check_output(out, path, force=force, kind=EXPORT_FOLDER)
    counts = export_city(read_city(path), to, out, rooms=rooms, force=force)
    print_export(out, to, counts, json=json)
    return 0
