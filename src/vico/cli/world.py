"""`vico world` builds worlds and looks into them; `vico check world` and `vico export` are beside it.

What a verb needs is imported when it runs, so that `vico --help` is quick.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from dataclasses import asdict, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import Positional
from tyro.extras import SubcommandApp

from vico.cli.console import check_output, print_export, print_json, print_table, progress_bars
from vico.cli.options import FLAT, CommaSeparated, RayAddress, WorldBuildOptions, split_names
from vico.errors import InputError, MissingFileError

if TYPE_CHECKING:
    from vico.world.world import World
    from vico.worldgen.batch import PlaceTable
    from vico.worldgen.indoor.layout_llm import LlmLayoutAuthor

world = SubcommandApp()

_DROPPED = "features of the map left out, mended or noted; world.json says which and why"
# What `world info` tells, in words.
_MEANINGS = {
    "half": "metres from the middle to each side",
    "seed": "decides what the map leaves open",
    "digest": "the same for the same world",
    "accessible_buildings": "buildings that people can go into",
    "amenity_objects": "lamps, benches, bins and the like in the streets",
    "barrier_pieces": "pieces of fences, hedges and walls",
    "collision_faces": "triangles of walls and roofs that bodies can touch",
    "crossings": "where people cross streets",
    "entrances": "street doors",
    "indoor_objects": "furniture and things in rooms",
    "junctions": "where streets meet",
    "kinds": "kinds of objects out of doors",
    "natural_objects": "trees, bushes and rocks",
    "places": "flats, shops, offices: where people can be",
    "roads": "stretches of street between junctions",
    "transit": "stops and lines of buses and trams, and stations of bicycles",
    "walkways": "stretches of sidewalk, path and crossing",
    "watertight_buildings": "buildings whose surface is closed; all should be",
    "megabytes": "on disk",
    "seconds": "that it took to build; --json says how many each stage",
}


@world.command(name="build")
def world_build(options: Annotated[WorldBuildOptions, FLAT]) -> int:
    """Make a world from OpenStreetMap data. A build that was killed goes on where it stopped.

    Example: vico world build --lat 60.1690 --lon 24.9435 --out helsinki

    Example: vico world build --lat 48.8530 --lon 2.3499 --out paris

    Example: vico world build --osm monaco.osm.pbf --center 43.7338,7.4181 --dem srtm.tif --out monaco
    Example: vico world build --osm berlin.osm.pbf --buildings lod2.gml --buildings overture.parquet --out berlin
    """
    from vico.geo.gtfs_feed import NO_TIMETABLE
    from vico.world.folder import read_world
    from vico.world.model import FLAT_GROUND
    from vico.world.world import WORLD_FOLDER
    from vico.worldgen.photos.texturing import Texturing
    from vico.worldgen.pipeline import build_world, extract_centre
    from vico.worldgen.request import BuildOptions, Sources, locate_map

    centre, osm, out = options.centre(), options.osm, options.out
    if osm is None:
        lat, lon = centre or (None, None)
        osm = locate_map(lat, lon, options.radius, overpass=options.overpass, refresh=options.refresh)
    sources = Sources(
        osm,
        dem=tuple(chain.from_iterable(options.dem)),
        buildings=tuple(map(str, chain.from_iterable(options.buildings))),
        precedence=options.precedence,
        tiles=options.tiles,
        photos=options.photos,
        places=options.places,
        gtfs=tuple(chain.from_iterable(options.gtfs)),
        layouts=options.layouts,
        detections=options.detections,
        installed_things=options.things == "installed",
    )
    texturing = Texturing(
        texel=options.texel,
        inpaint=options.inpaint,
        upscale=options.upscale,
        model=options.model,
        matcher=options.matcher,
        matcher_weights=options.matcher_weights,
        mask=options.mask,
        mask_detector=options.mask_detector,
        mask_segmenter=options.mask_segmenter,
    )
    author = None
    if options.layout_llm:
        author = _layout_author(options.llm_calls, options.llm_tokens, options.llm_cost)
    lat, lon = centre or extract_centre(osm)
    check_output(out, *sources.files(), force=options.force, kind=WORLD_FOLDER)
    with progress_bars() as report:
        build_world(
            sources,
            lat=lat,
            lon=lon,
            half=options.radius,
            seed=options.seed,
            out=out,
            force=options.force,
            options=BuildOptions(texturing=texturing, author=author, progress=report),
        )
    if author is not None:
        print(f"language model: {author.model.budget.spent}", file=sys.stderr)
    code = world_info(out, json=options.json)
    manifest = read_world(out).manifest
    if manifest.is_flat:
        print(f"{out}: {FLAT_GROUND}", file=sys.stderr)
    for what in [what for stage in manifest.stages for what in stage.dropped]:
        if what.reason.startswith(NO_TIMETABLE):
            print(f"{out}: {what.id} {what.reason}", file=sys.stderr)
    return code


def _layout_author(calls: int | None, tokens: int | None, cost: float | None) -> LlmLayoutAuthor:
    """Return the language model that the environment names, as an author of floor plans."""
    from vico.io.cache import cache_folder
    from vico.llm import Budget, LanguageModel
    from vico.worldgen.indoor.layout_llm import LlmLayoutAuthor

    budget = Budget(calls=calls, tokens=tokens, cost=cost)
    return LlmLayoutAuthor(LanguageModel.from_environment(cache=cache_folder() / "llm", budget=budget))


@world.command(name="rebuild")
def world_rebuild(path: Positional[Path], stage: CommaSeparated, layout_llm: bool = False, json: bool = False) -> int:
    """Run stages of a world again, and whatever depends on what they change.

    Example: vico world rebuild helsinki --stage objects,indoor

    Args:
        path: World folder.
        stage: Names of stages, separated by commas; a wrong one names them all.
        layout_llm: With the language model that drew its floor plans.
        json: Print the result as JSON.
    """
    from vico.worldgen.pipeline import rebuild_world

    author = _layout_author(None, None, None) if layout_llm else None
    with progress_bars() as report:
        rebuild_world(path, split_names(stage), progress=report, author=author)
    return world_info(path, json=json)


@world.command(name="build-many")
def world_build_many(
    table: Positional[Path],
    out: str,
    extracts: Path | None = None,
    only: str = "",
    workers: int = 0,
    ray: RayAddress = None,
    force: bool = False,
    json: bool = False,
) -> int:
    """Build a table of places side by side.

    The table is CSV: name,lat,lon and, where wanted, osm,radius,dem,tiles,gtfs,places,photos,layouts,things,
    buildings,precedence,seed. Semicolons, tabs, decimal commas and columns such as City or Longitude are read too; a
    row that can't be read is told with its line.
    Worlds that are there are kept, those that fail are told at the end (exit 1) and do not stop the others.

    Example: vico world build-many places.csv --out worlds --workers 4

    Example: vico world build-many paper35 --out worlds

    Example: vico world build-many places.csv --out s3://bucket/worlds --ray

    Args:
        table: The places; file names in it are relative to it. Or the name of a list, such as paper35.
        extracts: For a list: folder with maps of its places; the others are fetched.
        only: Names of the places to build, separated by commas; all without.
        out: Parent folder of the worlds, or a URL like s3://BUCKET/worlds (the extra "s3").
        workers: Processes side by side; 0 is one a processor.
        ray: Hand the places to a Ray cluster instead (the extra "ray"): its address; without one, that which runs here.
        force: Build anew worlds that are there.
        json: Print the outcomes as JSON.
    """
    from vico.io.stores import store_at
    from vico.worldgen.batch import Outcome, build_many
    from vico.worldgen.request import locate_map

    places = _rows_of_table(table, extracts=extracts, only=only)
    rows = places.rows
    for note in places.notes:
        print(note, file=sys.stderr)
    with progress_bars() as report:
        report("places", 0, len(rows))
        outcomes = build_many(
            rows,
            store_at(out),
            locate=locate_map,
            workers=workers or os.cpu_count() or 1,
            force=force,
            ray=ray,
            finished=lambda _, done, total: report("places", done, total),
        )
    outcomes += [Outcome(row.name, "failed", reason=row.reason) for row in places.bad]
    failed = [outcome for outcome in outcomes if outcome.state == "failed"]
    if json:
        print_json({"ok": not failed, "places": [asdict(outcome) for outcome in outcomes]})
    else:
        for o in outcomes:
            what = o.reason or f"{o.buildings} buildings, {o.places} places, {o.seconds:.1f} s"
            what += "; flat, no --dem" if o.flat else ""
            print(f"{o.name}: {o.state}: {what}")
    return 1 if failed else 0


def _rows_of_table(table: Path, *, extracts: Path | None, only: str) -> PlaceTable:
    """Return the places of a table, which is a file, or of a list that is known by name."""
    from vico.worldgen.batch import PlaceTable, place_lists, read_place_table, rows_of

    names = set(split_names(only))
    lists = place_lists()
    if not table.exists() and str(table) in lists:
        return PlaceTable(tuple(rows_of(lists[str(table)], extracts=extracts, only=names)))
    if not table.exists() and table.suffix == "":
        raise MissingFileError(f"{table}: no such file, and no list of that name; there are {', '.join(lists)}")
    if extracts is not None:
        raise InputError("build-many: --extracts is for lists known by name; a table names its files itself")
    read = read_place_table(table)
    unknown = sorted(names - {row.name for row in read.rows} - {row.name for row in read.bad})
    if unknown:
        raise InputError(f"build-many: {table} has no place {unknown[0]!r}")
    rows = tuple(row for row in read.rows if not names or row.name in names)
    return replace(read, rows=rows, bad=tuple(row for row in read.bad if not names or row.name in names))


@world.command(name="info")
def world_info(path: Positional[Path], json: bool = False) -> int:
    """Say what a world holds.

    Example: vico world info helsinki --json

    Args:
        path: World folder.
        json: Print JSON.
    """
    from vico.world.folder import read_world

    content = _facts(read_world(path))
    if json:
        print_json(content)
        return 0
    rows = {name: value for name, value in content.items() if not isinstance(value, dict | list)}
    rows |= {f"places: {kind}": number for kind, number in content["places_by_type"].items()}
    for what in ("footprint", "height", "roof"):
        rows |= {f"{what} from {name}": number for name, number in content.get(f"{what}_from", {}).items()}
    rows |= {f"dropped: {stage}": number for stage, number in content["dropped"].items()}
    rows |= {"seconds": content["seconds"]["total"]}
    rows |= {f"source: {source['name']}": source["attribution"] for source in content["sources"]}
    dropped = {f"dropped: {stage}": _DROPPED for stage in list(content["dropped"])[:1]}
    print_table(f"world {path}", rows, _MEANINGS | dropped)
    return 0


def _facts(world: World) -> dict[str, Any]:
    """Return what `world info` tells."""
    from vico.world.world import stage_seconds

    manifest = world.manifest
    seconds = stage_seconds(world)
    return {
        "name": manifest.name,
        "origin": [manifest.origin.lat, manifest.origin.lon],
        "half": manifest.half,
        "seed": manifest.seed,
        "digest": world.digest,
        **manifest.counts,
        "places_by_type": manifest.places_by_type,
        **_building_sources(world),
        "dropped": {stage.name: len(stage.dropped) for stage in manifest.stages if stage.dropped},
        "seconds": {**seconds, "total": round(sum(seconds.values()), 3)},
        "megabytes": round(sum(world.file(name).stat().st_size for name in manifest.files) / 1e6, 2),
        "sources": [source.model_dump(mode="json") for source in manifest.sources],
    }


def _building_sources(world: World) -> dict[str, dict[str, int]]:
    """Count where outlines, heights and roofs are from; nothing for a world of a map alone."""
    told = [building.sources for building in world.buildings if building.sources is not None]
    if not told:
        return {}
    return {
        f"{what}_from": dict(Counter(getattr(one, what) for one in told).most_common())
        for what in ("footprint", "height", "roof")
    }


def check_world(path: Positional[Path], json: bool = False) -> int:
    """Check a world: schema, hashes, buildings, entrances, rooms, lanes, transit. Exit 1 if anything is wrong.

    Args:
        path: World folder.
        json: Print JSON.
    """
    from vico.world.check import check_world as findings_of
    from vico.world.folder import read_world

    findings = findings_of(read_world(path))
    if json:
        print_json({"ok": not findings, "findings": [finding._asdict() for finding in findings]})
    else:
        for finding in findings:
            at = "" if finding.at is None else f" at {finding.at[0]:.1f} m east, {finding.at[1]:.1f} m north"
            print(f"{finding.id}: {finding.where}{at}: {finding.what}")
        print(f"{path}: {len(findings)} findings" if findings else f"{path}: all is well")
    return 1 if findings else 0


def export(
    path: Positional[Path],
    to: Literal["gltf", "usd", "mjcf", "geojson", "xodr"],
    out: Path,
    rooms: bool = False,
    force: bool = False,
    json: bool = False,
) -> int:
    """Write a world in another format: glTF, OpenUSD, MuJoCo, GeoJSON, OpenDRIVE.

    Example: vico export helsinki --to mjcf --out helsinki_mjcf

    Args:
        path: World folder.
        to: The format. "usd" needs the extra of that name.
        out: Folder to make; refused if it exists, unless --force.
        rooms: With what lies indoors.
        force: Replace what this verb made there before; refused if the folder holds anything else.
        json: Print the result as JSON.
    """
    from vico.world.exports import EXPORT_FOLDER, export_world
    from vico.world.folder import read_world

    check_output(out, path, force=force, kind=EXPORT_FOLDER)
    counts = export_world(read_world(path), to, out, rooms=rooms, force=force)
    print_export(out, to, counts, json=json)
    return 0
