"""The build of a city: all tiles are planned, then built, then fitted to each other; each step in any order.

What a tile plans depends on the map around it alone, what is built in it on the plans of its neighbours, and how its
ground ends on what its neighbours to the west and south drew. So tiles are the same bytes in whatever order, by
however many processes, and whatever was there before. A build that was stopped goes on: a tile's stages are kept.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from vico.errors import InputError, StageError, VicoError, sentence_of
from vico.geo.elevation import read_elevation
from vico.geo.frame import LocalFrame
from vico.geo.osm_parts import OsmParts
from vico.io.arrays import mapped_array
from vico.io.files import read_json, sha256_of, write_json
from vico.io.memory import give_back_memory
from vico.jobs import Answer, Service, Task, open_executor
from vico.version import __version__
from vico.world.city import (
    CITY,
    COST,
    REACHED,
    ROOM,
    SURFACES,
    TILES,
    WHOLE,
    City,
    CityManifest,
    CityTile,
    Side,
    TileShift,
    profile_of,
    read_city,
)
from vico.world.city_gates import tile_gates
from vico.world.glb import write_glb
from vico.world.heights import HeightField
from vico.world.mesh import Surface, merge_surfaces
from vico.world.model import Building, Origin
from vico.world.world import STAGES, World, read_stored, seal, stage_seconds
from vico.worldgen.city_region import CityRequest, RegionMap, divide_tunnels, divide_waters, tiles_with_tunnels
from vico.worldgen.city_streets import LEVELS, SHAPE, make_streets
from vico.worldgen.construction import SEAMS, build_shape, map_of, plan_site, plan_with_neighbours
from vico.worldgen.evidence import Evidence, read_evidence
from vico.worldgen.ground.terrain import APRON, flat_terrain, terrain_from_dem
from vico.worldgen.pipeline import OF_A_CITY, build_requested
from vico.worldgen.previews import write_map
from vico.worldgen.report import write_city_report
from vico.worldgen.request import Sources
from vico.worldgen.seams.joins import (
    BORES,
    CUT,
    HALO,
    JOINED,
    MAP,
    WATERS,
    Tile,
    TileGrid,
    fit_border,
    grid_of,
    grid_over,
    tile_name,
)
from vico.worldgen.seams.mosaic import TileShape, cells_of_tile, window_around, write_gates, write_walking
from vico.worldgen.stages import (
    SUFFIX,
    Progress,
    Stages,
    code_digest,
    digest_of,
    load_product,
    read_head,
    store_product,
)

#: Product with a tile's gates.
GATES = "gates"


def tile_builder(options: Mapping[str, Any], _: object) -> Callable[[Mapping[str, Any]], dict[str, Any]]:
    """Return what does a step of a tile: a service of `vico.jobs`."""
    request = CityRequest.from_json(dict(options))

    def work(content: Mapping[str, Any]) -> dict[str, Any]:
        column, row = content["tile"]
        return STEPS[content["step"]](request, (column, row))

    return work


def plan_tile(request: CityRequest, tile: Tile) -> dict[str, Any]:
    """Plan a tile's streets and ground; bare ground where that fails, for its neighbours need one."""
    folder = request.plans / tile_name(tile)
    terrain = request.plans / f"terrain{SUFFIX}"
    made_of = [_head(folder, MAP), _head(folder, WATERS), read_head(terrain)[1] if terrain.exists() else ""]
    return _cached_step(request, tile, "plan", made_of, lambda: _plan_stages(request, tile))


def _plan_stages(request: CityRequest, tile: Tile) -> dict[str, Any]:
    stages, evidence = _evidence(request, tile)
    try:
        plan_site(evidence, request.tile(tile), stages)
    except VicoError as error:
        none = replace(evidence.data, nodes=[], ways=[], areas=[], relations=[])
        plan_site(replace(evidence, data=stages.register(none, digest_of(none))), request.tile(tile), stages)
        return {"failed": sentence_of(error)}
    return {}


def _evidence(request: CityRequest, tile: Tile) -> tuple[Stages, Evidence]:
    """Return what keeps a tile's plan, and the sources there."""
    asked, place = request.tile(tile), request.place(tile)
    stages = Stages(place.own)
    return stages, read_evidence(asked.sources, asked.frame, asked.reach, stages, part=map_of(place))


def join_tile(request: CityRequest, tile: Tile) -> dict[str, Any]:
    """Make a tile's streets and ground one with its neighbours', for the city's tunnels."""

    def join() -> dict[str, Any]:
        stages, evidence = _evidence(request, tile)
        asked = request.tile(tile)
        plan_with_neighbours(plan_site(evidence, asked, stages), asked, stages)
        return {}

    made_of = _plans(request, tile)
    if not (request.plans / tile_name(tile) / f"{JOINED}{SUFFIX}").exists():
        _forget_step(request, tile, "join")
    return _cached_step(request, tile, "join", made_of, join)


def shape_tile(request: CityRequest, tile: Tile) -> dict[str, Any]:
    """Make what stands in a tile, for the city's streets."""
    made_of = [*_plans(request, tile), _head(request.plans / tile_name(tile), BORES)]
    return _cached_step(request, tile, "shape", made_of, lambda: _shape_stages(request, tile))


def _shape_stages(request: CityRequest, tile: Tile) -> dict[str, Any]:
    stages, evidence = _evidence(request, tile)
    asked = request.tile(tile)
    made = build_shape(plan_site(evidence, asked, stages), asked, stages)
    own = [*made.built.standing(made.plan.height), *made.bridges.feet]
    found = TileShape(own, made.bridges.open_ways, made.plan.streets)
    folder = request.plans / tile_name(tile)
    store_product(folder, SHAPE, found)
    store_product(folder, LEVELS, made.levels)
    return {}


def build_tile(request: CityRequest, tile: Tile) -> dict[str, Any]:
    """Build a tile's world; its ground ends at its borders."""
    folder, out = request.plans / tile_name(tile), request.out / TILES / tile_name(tile)
    if not (out / "world.json").exists():
        _forget_step(request, tile, "build")
    made_of = [*_plans(request, tile), _head(folder, BORES), _head(folder, CUT)]

    def build() -> dict[str, Any]:
        build_requested(request.tile(tile), out)
        return {}

    return _cached_step(request, tile, "build", made_of, build)


def _plans(request: CityRequest, tile: Tile) -> list[str]:
    """Return digests of a tile's map, and of what it and its neighbours planned."""
    around = [request.plans / tile_name(one) for one in request.grid.around(tile)]
    own = request.plans / tile_name(tile)
    return [_head(own, MAP), _head(own, WATERS), *(_head(folder, name) for folder in around for name in SEAMS)]


def fit_tile(request: CityRequest, tile: Tile) -> dict[str, Any]:
    """Make a tile's ground meet that of the tiles before it, draw its map, and return what the tile came to."""
    out = request.out / TILES / tile_name(tile)
    before = {axis: (tile[0] - (axis == 0), tile[1] - (axis == 1)) for axis in (0, 1)}
    there = {axis: request.out / TILES / tile_name(one) for axis, one in before.items()}
    there = {axis: folder for axis, folder in there.items() if (folder / STAGES / f"ground{SUFFIX}").exists()}
    made_of = [_head(folder / STAGES, name) for folder in (out, *there.values()) for name in ("ground", "wires")]
    folders = {one: request.out / TILES / tile_name(one) for one in request.grid.around(tile)}
    around = [one for one, folder in folders.items() if (folder / "world.json").exists()]
    made_of += [read_stored(folders[one]).manifest.files["buildings.json"] for one in around]
    known = _stored_step(request, tile, "fit")
    if known is not None and read_stored(out).digest != known["found"]["digest"]:
        _forget_step(request, tile, "fit")  # it was built anew
    return _cached_step(
        request, tile, "fit", [*map(str, there), *made_of], lambda: _fit_ground(request, tile, there, around)
    )


def _fit_ground(request: CityRequest, tile: Tile, there: Mapping[int, Path], around: Sequence[Tile]) -> dict[str, Any]:
    out, half = request.out / TILES / tile_name(tile), request.grid.size / 2
    world = read_stored(out)
    ground = _unfitted_ground(out)
    for axis, folder in there.items():
        ground = fit_border(ground, Side(axis, -half), profile_of(_unfitted_ground(folder), Side(axis, half)))
    wires: list[Surface] = load_product(out / STAGES, "wires")[0]
    write_glb(out / "meshes" / "ground.glb", {"ground": merge_surfaces([*ground, *wires])})
    houses: list[Building] = []
    for one in around:
        east, north = ((a - b) * request.grid.size for a, b in zip(one, tile, strict=True))
        shift = TileShift(east, north, 0, tile_name(one))
        houses += map(shift.building, read_stored(request.out / TILES / tile_name(one)).buildings)
    write_map(World(world.manifest, out, buildings=houses), out)
    seal(out, world.manifest, seconds=stage_seconds(world), without=OF_A_CITY)
    done = read_stored(out)
    return {
        "digest": done.digest,
        "buildings": done.manifest.counts["buildings"],
        "places": done.manifest.counts["places"],
    }


def _unfitted_ground(tile: Path) -> list[Surface]:
    """Return the ground of a tile as it was made, not yet fitted to any neighbour."""
    ground: list[Surface] = load_product(tile / STAGES, "ground")[0]
    return ground


def find_gates(request: CityRequest, tile: Tile) -> dict[str, Any]:
    """Find where one walks from a tile into others, and what ways between these places cost."""
    cost, room = (mapped_array(request.out / WHOLE / name) for name in (COST, ROOM))
    square = cells_of_tile(tile, request.grid, len(cost) // (2 * request.grid.reach + 1))
    wide = window_around(square, 1)[0]
    made_of = [str(square), sha256(np.ascontiguousarray(cost[wide]).tobytes()).hexdigest()]
    made_of.append(sha256(np.ascontiguousarray(room[square]).tobytes()).hexdigest())
    cell = request.grid.size / (square[0].stop - square[0].start)

    def cut_gates() -> dict[str, Any]:
        store_product(request.plans / tile_name(tile), GATES, tile_gates(cost, room, square, cell=cell))
        return {}

    return _cached_step(request, tile, "gates", made_of, cut_gates)


def _head(folder: Path, name: str) -> str:
    """Return the digest of a product."""
    return read_head(folder / f"{name}{SUFFIX}")[1]


def _stored_step(request: CityRequest, tile: Tile, step: str) -> dict[str, Any] | None:
    """Return what is kept of a step that was done: its key, and what it found."""
    path = request.plans / tile_name(tile) / f"{step}.json"
    content: dict[str, Any] | None = read_json(path) if path.exists() else None
    return content


def _forget_step(request: CityRequest, tile: Tile, step: str) -> None:
    (request.plans / tile_name(tile) / f"{step}.json").unlink(missing_ok=True)


def _cached_step(
    request: CityRequest, tile: Tile, step: str, made_of: Sequence[str], made: Callable[[], dict[str, Any]]
) -> dict[str, Any]:
    """Do a step, or return what it found when it was done with the same code, request and inputs."""
    content = request.to_json()
    asked = [tile_name(tile), *(str(content[name]) for name in ("lat", "lon", "seed")), str(request.grid.size)]
    key = sha256("\n".join([code_digest(), *asked, *made_of]).encode()).hexdigest()
    known = _stored_step(request, tile, step)
    if known is not None and known["key"] == key:
        found: dict[str, Any] = known["found"]
        return found
    _forget_step(request, tile, step)
    found = made()
    write_json(request.plans / tile_name(tile) / f"{step}.json", {"key": key, "found": found})
    return found


STEPS: dict[str, Callable[[CityRequest, Tile], dict[str, Any]]] = {
    "plan": plan_tile,
    "join": join_tile,
    "shape": shape_tile,
    "build": build_tile,
    "fit": fit_tile,
    "gates": find_gates,
}


TILE = 400.0
_CELL = 8.0
_LEAST = 160.0  # metres, the side of a tile at least
_MOST = 1200.0  # and at most
_LARGEST = 20_000.0  # metres, the side of a city at most


def city_request(
    sources: Sources,
    *,
    lat: float,
    lon: float,
    extent: float | tuple[float, float, float, float],
    out: Path,
    tile: float = TILE,
    seed: int = 0,
) -> CityRequest:
    """Return what `build_city` is to build.

    Parameters
    ----------
    sources
        What to build from: a map, elevation files. Photographed cities and street photos are not read.
    lat, lon
        The centre, degrees.
    extent
        Side of the square around the centre to cover, metres; or a box that holds the centre: west, south, east and
        north, degrees. Whole tiles are built.
    out
        Folder to make, or to go on in.
    tile
        Side of a tile, metres: a multiple of 8.
    seed
        Decides what the map leaves open.

    Raises
    ------
    InputError
        If sizes are out of range.
    """
    if not (_LEAST <= tile <= _MOST) or tile % _CELL:
        raise InputError(f"tile: {tile:g} m; give a multiple of {_CELL:g} within {_LEAST:g}..{_MOST:g}")
    if seed < 0:
        raise InputError(f"seed: {seed}; it must not be negative")
    frame = LocalFrame(lat, lon)  # refuses what is no place
    grid = _grid_over(frame, extent, tile) if isinstance(extent, tuple) else _grid_around(extent, tile)
    return CityRequest(sources, lat, lon, grid, seed, Path(out).resolve())


def _grid_around(extent: float, tile: float) -> TileGrid:
    if not (math.isfinite(extent) and 0 < extent <= _LARGEST):
        raise InputError(f"size: {extent:g} m; give the side of the square to build, up to {_LARGEST:g}")
    return grid_of(extent, tile)


def _grid_over(frame: LocalFrame, box: tuple[float, float, float, float], tile: float) -> TileGrid:
    west, south, east, north = box
    what = f"bbox: {west:g},{south:g},{east:g},{north:g}"
    if not (-180.0 <= west < east <= 180.0 and -90.0 < south < north < 90.0):
        raise InputError(f"{what}; give west, south, east and north, degrees, the smaller of each first")
    if not (west <= frame.lon <= east and south <= frame.lat <= north):
        raise InputError(f"{what}: the centre {frame.lat:g},{frame.lon:g} lies outside; leave it out, or move it")
    corners = np.array([frame.to_enu(lat, lon) for lat in (south, north) for lon in (west, east)])[:, :2]
    low, high = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    if max(b - a for a, b in zip(low, high, strict=True)) > _LARGEST:
        raise InputError(f"{what}: more than {_LARGEST:g} m wide or high; give a smaller box")
    return grid_over((low[0], low[1]), (high[0], high[1]), tile)


def build_city(
    request: CityRequest, *, workers: int = 1, ray: str | None = None, progress: Progress | None = None
) -> City:
    """Build a city of tiles, or what of it is missing.

    Parameters
    ----------
    request
        Which city; see `city_request`.
    workers, ray
        How many processes side by side, or which Ray cluster; see `vico.jobs.open_executor`.
    progress
        Called as tiles are done.

    Returns
    -------
    City
        What could be built; its manifest says why other tiles could not.

    Raises
    ------
    InputError
        If no tile could be built.
    VicoError
        If the sources can't be used, and then a city that was there stays; or if the streets can't be made.
    """
    request.plans.mkdir(parents=True, exist_ok=True)
    region = divide_sources(request)
    # The sources are good: from here on what the city has as a whole may be another one's until all is written.
    (request.out / CITY).unlink(missing_ok=True)
    failed: dict[str, str] = {}
    found: dict[Tile, Any] = {}
    workers = min(workers, len(request.grid)) if ray is None else workers
    with open_executor(workers=workers, ray=ray) as executor:
        service = Service("vico.worldgen.city_build:tile_builder", request.to_json())

        def run_step(step: str, tiles: Sequence[Tile]) -> list[Tile]:
            """Do a step to tiles, and return those that it went well with."""
            nonlocal found
            answers = _run_step(executor, service, tiles, step, progress)
            refused = {one: answer.reason for one, answer in answers.items() if answer.content is None}
            found = {one: answer.content for one, answer in answers.items() if answer.content is not None}
            refused |= {one: content["failed"] for one, content in found.items() if "failed" in content}
            failed.update({tile_name(one): reason for one, reason in refused.items()})
            return [one for one in tiles if one not in refused]

        left = run_step("plan", list(request.grid))
        tunnels = run_step("join", [tile for tile in tiles_with_tunnels(request, region) if tile in left])
        divide_tunnels(request, region, tunnels)
        give_back_memory()
        left = run_step("shape", left)
        if left:
            _report_step(progress, "streets", 0)
            reports = make_streets(request, region)
            _report_step(progress, "streets", 1)
        del region
        give_back_memory()
        left = run_step("fit", run_step("build", left))
        if left:
            tiles = dict(found)
            maps = {one: request.out / TILES / tile_name(one) / "walkable.npz" for one in left}
            _write_walkable(request, maps)
            give_back_memory()
            if lost := set(left).difference(run_step("gates", left)):
                name = tile_name(min(lost))
                raise StageError(f"city build: the ways out of tile {name} can't be found: {failed[name]}")
    if not left:
        raise InputError(f"{request.out}: no tile could be built: {next(iter(failed.values()))}")
    whole = request.out / WHOLE
    write_gates(whole, [load_product(request.plans / tile_name(one), GATES)[0] for one in left])
    manifest = CityManifest(
        producer=f"vico {__version__}",
        origin=Origin(lat=request.lat, lon=request.lon),
        size=request.grid.size,
        first=request.grid.first,
        last=request.grid.last,
        seed=request.seed,
        tiles=[CityTile(column=one[0], row=one[1], name=tile_name(one), **tiles[one]) for one in left],
        failed=dict(sorted(failed.items())),
        reports=reports,
        files={f"{WHOLE}/{path.name}": sha256_of(path) for path in sorted(whole.iterdir())},
    )
    write_json(request.out / CITY, manifest.model_dump(mode="json"))
    city = read_city(request.out)
    write_city_report(city)
    return city


def _write_walkable(request: CityRequest, maps: Mapping[Tile, Path]) -> None:
    """Write the walkable map of the city, if those of its tiles are not what they were."""
    known = request.plans / "walking.json"
    files = [request.out / WHOLE / name for name in (SURFACES, ROOM, REACHED, COST)]
    made_of = [
        code_digest(),
        str(request.grid.edges),
        *(f"{tile_name(tile)} {sha256_of(path)}" for tile, path in maps.items()),
    ]
    key = {"key": sha256("\n".join(made_of).encode()).hexdigest()}
    if not (known.exists() and read_json(known) == key and all(path.exists() for path in files)):
        known.unlink(missing_ok=True)
        write_walking(request.out / WHOLE, request.grid, maps)
        write_json(known, key)


def _report_step(progress: Progress | None, step: str, done: int) -> None:
    if progress is not None:
        progress(step, done, 1)


def divide_sources(request: CityRequest) -> RegionMap:
    """Keep for each tile what the region's map and ground say of it; return that map, as `divide_map`."""
    region = divide_map(request)
    divide_waters(request, region, _bare_ground(request))
    return region


def divide_map(request: CityRequest) -> RegionMap:
    """Keep for each tile what of the region's map lies there, and return that map: read if it has changed alone."""
    region, known = RegionMap(request), request.plans / "map.json"
    kept = [request.plans / tile_name(tile) / f"{MAP}{SUFFIX}" for tile in request.grid]
    if not (known.exists() and read_json(known) == {"key": region.key} and all(path.exists() for path in kept)):
        known.unlink(missing_ok=True)
        parts = OsmParts(region.whole)
        half = request.grid.size / 2 + HALO
        for tile in request.grid:
            east, north = request.grid.centre(tile)
            part = parts.within(half=half, margin=region.whole.margin, east=east, north=north)
            store_product(request.plans / tile_name(tile), MAP, replace(part, sha256="", timestamp=None))
        write_json(known, {"key": region.key})
    return region


def _bare_ground(request: CityRequest) -> HeightField:
    """Fit the bare ground of the whole city, level where its heights are unknown."""
    half = request.grid.half + HALO
    if not request.sources.dem:
        return flat_terrain(half=half)
    frame = LocalFrame(request.lat, request.lon)
    stages = Stages(request.plans)
    samples = read_elevation(request.sources.dem, frame, half)
    stages.register(samples, f"{samples.sha256} {frame} {half}")
    return stages.run("terrain", terrain_from_dem, samples, half=half, apron=APRON)


def _run_step(
    executor: Any, service: Service, tiles: Sequence[Tile], step: str, progress: Progress | None
) -> dict[Tile, Answer]:
    """Do a step to all tiles; return what came of each, in the order of the tiles."""
    answers: dict[Tile, Answer] = {}

    def record(index: int, answer: Answer) -> None:
        answers[tiles[index]] = answer
        if progress is not None:
            progress(step, len(answers), len(tiles))

    executor.run(service, [Task({"tile": list(tile), "step": step}) for tile in tiles], done=record)
    return {tile: answers[tile] for tile in tiles}
