"""`vico world build`, `vico world info`, `vico check world`."""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, replace
from itertools import chain
from pathlib import Path
from typing import Any

from vico.cli.console import check_output, print_export, print_json, print_table, progress_bars
from vico.cli.options import WorldBuildOptions
from vico.errors import InputError, MissingFileError
from vico.geo.gtfs_feed import NO_TIMETABLE
from vico.world.folder import read_world
from vico.world.model import FLAT_GROUND
from vico.world.world import WORLD_FOLDER, World, stage_seconds
from vico.worldgen.batch import PlaceTable, read_place_table
from vico.worldgen.indoor.layout_llm import LlmLayoutAuthor
from vico.worldgen.photos.texturing import Texturing
from vico.worldgen.pipeline import build_world, extract_centre, rebuild_world
from vico.worldgen.request import BuildOptions, Sources

_DEFAULTS = BuildOptions()
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


def build(
    sources: Sources,
    *,
    out: Path,
    centre: tuple[float, float] | None = None,
    half: float = 400.0,
    seed: int = 0,
    options: BuildOptions = _DEFAULTS,
    force: bool = False,
    json: bool = False,
) -> int:
    """Build a world; without a centre (latitude and longitude) around the map's middle."""
    lat, lon = centre or extract_centre(sources.osm)
    check_output(out, *sources.files(), force=force, kind=WORLD_FOLDER)
    with progress_bars() as report:
        build_world(
            sources,
            lat=lat,
            lon=lon,
            half=half,
            seed=seed,
            out=out,
            force=force,
            options=replace(options, progress=report),
        )
    if options.author is not None:
        print(f"language model: {options.author.model.budget.spent}", file=sys.stderr)
    code = info(out, json=json)
    manifest = read_world(out).manifest
    if manifest.is_flat:
        print(f"{out}: {FLAT_GROUND}", file=sys.stderr)
    for what in [what for stage in manifest.stages for what in stage.dropped]:
        if what.reason.startswith(NO_TIMETABLE):
            print(f"{out}: {what.id} {what.reason}", file=sys.stderr)
    return code


def build_as_asked(options: WorldBuildOptions) -> int:
    """Build the world that the command line asks for, from a map that is found if none is given."""
    centre, osm = options.centre(), options.osm
    if osm is None:
        lat, lon = centre or (None, None)
        osm = locate(lat, lon, options.radius, overpass=options.overpass, refresh=options.refresh)
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
    how = Texturing(
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
        author = layout_author(options.llm_calls, options.llm_tokens, options.llm_cost)
    return build(
        sources,
        out=options.out,
        centre=centre,
        half=options.radius,
        seed=options.seed,
        options=BuildOptions(texturing=how, author=author),
        force=options.force,
        json=options.json,
    )


def layout_author(calls: int | None, tokens: int | None, cost: float | None) -> LlmLayoutAuthor:
    """Return the language model that the environment names, as an author of floor plans."""
    from vico.io.cache import cache_folder
    from vico.llm import Budget, LanguageModel

    budget = Budget(calls=calls, tokens=tokens, cost=cost)
    return LlmLayoutAuthor(LanguageModel.from_environment(cache=cache_folder() / "llm", budget=budget))


def locate(
    lat: float | None, lon: float | None, half: float, *, overpass: str | None = None, refresh: bool = False
) -> Path:
    """Find a map that covers a window: the packaged extract, else one from an Overpass server (``off``: none)."""
    from vico.geo.overpass import Overpass
    from vico.worldgen.request import map_for

    endpoint = overpass or os.environ.get("VICO_OVERPASS")
    source = None if endpoint == "off" else Overpass(endpoint, refresh=refresh)
    return map_for(lat, lon, half, source=source)


def rebuild(path: Path, stages: Sequence[str], *, author: LlmLayoutAuthor | None = None, json: bool = False) -> int:
    """Run stages of a world again."""
    with progress_bars() as report:
        rebuild_world(path, stages, progress=report, author=author)
    return info(path, json=json)


def rows_of_table(table: Path, *, extracts: Path | None, only: str) -> PlaceTable:
    """Return the places of a table, which is a file, or of a list that is known by name."""
    from vico.worldgen.batch import place_lists, rows_of

    names = {name.strip() for name in only.split(",") if name.strip()}
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


def build_table(
    table: PlaceTable,
    *,
    out: str,
    workers: int,
    ray: str | None = None,
    force: bool = False,
    json: bool = False,
) -> int:
    """Build places; 1 if any failed, or a row of the table could not be read."""
    from vico.io.stores import store_at
    from vico.worldgen.batch import Outcome, build_many

    rows = table.rows
    for note in table.notes:
        print(note, file=sys.stderr)
    with progress_bars() as report:
        report("places", 0, len(rows))
        outcomes = build_many(
            rows,
            store_at(out),
            locate=locate,
            workers=workers,
            force=force,
            ray=ray,
            finished=lambda _, done, total: report("places", done, total),
        )
    outcomes += [Outcome(row.name, "failed", reason=row.reason) for row in table.bad]
    failed = [outcome for outcome in outcomes if outcome.state == "failed"]
    if json:
        print_json({"ok": not failed, "places": [asdict(outcome) for outcome in outcomes]})
    else:
        for o in outcomes:
            what = o.reason or f"{o.buildings} buildings, {o.places} places, {o.seconds:.1f} s"
            what += "; flat, no --dem" if o.flat else ""
            print(f"{o.name}: {o.state}: {what}")
    return 1 if failed else 0


def facts(world: World) -> dict[str, Any]:
    """Return what `world info` tells."""
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


def info(path: Path, *, json: bool = False) -> int:
    """Say what a world holds."""
    content = facts(read_world(path))
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


def check(path: Path, *, json: bool = False) -> int:
    """Check a world; 1 if anything is wrong."""
    from vico.world.check import check_world

    findings = check_world(read_world(path))
    if json:
        print_json({"ok": not findings, "findings": [finding._asdict() for finding in findings]})
    else:
        for finding in findings:
            at = "" if finding.at is None else f" at {finding.at[0]:.1f} m east, {finding.at[1]:.1f} m north"
            print(f"{finding.id}: {finding.where}{at}: {finding.what}")
        print(f"{path}: {len(findings)} findings" if findings else f"{path}: all is well")
    return 1 if findings else 0


def export(path: Path, to: str, *, out: Path, rooms: bool = False, force: bool = False, json: bool = False) -> int:
    """Write a world in another format."""
    from vico.world.exports import EXPORT_FOLDER, export_world

    check_output(out, path, force=force, kind=EXPORT_FOLDER)
    counts = export_world(read_world(path), to, out, rooms=rooms, force=force)
    print_export(out, to, counts, json=json)
    return 0
