"""What is done to one tile of a city: planned, built, and fitted to what its neighbours drew."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from vico.errors import VicoError, sentence_of
from vico.io.arrays import mapped_array
from vico.io.files import read_json, write_json
from vico.world.city import COST, ROOM, TILES, WHOLE, Side, TileShift, profile_of
from vico.world.city_gates import tile_gates
from vico.world.glb import write_glb
from vico.world.mesh import Surface, merge_surfaces
from vico.world.model import Building
from vico.world.world import STAGES, World, read_stored, seal, stage_seconds
from vico.worldgen.city_request import CityRequest
from vico.worldgen.city_streets import LEVELS, SHAPE
from vico.worldgen.evidence import Evidence, gather
from vico.worldgen.pipeline import OF_A_CITY, build_requested
from vico.worldgen.previews.stage import write_map
from vico.worldgen.product import digest_of, read_head
from vico.worldgen.seams.border_fit import conformed
from vico.worldgen.seams.grid import Tile, tile_name
from vico.worldgen.seams.join import BORES, CUT, JOINED, MAP, WATERS
from vico.worldgen.seams.mosaic import TileShape
from vico.worldgen.seams.walking import around, square_of
from vico.worldgen.shaping import SEAMS, among_neighbours, map_of, planned, shaped
from vico.worldgen.stages import SUFFIX, Stages, code_digest, keep_product, kept_product

#: Product with a tile's gates.
GATES = "gates"


def builder(options: Mapping[str, Any], _: object) -> Callable[[Mapping[str, Any]], dict[str, Any]]:
    """Return what does a step of a tile: a service of `vico.jobs`."""
    request = CityRequest.from_json(dict(options))

    def work(content: Mapping[str, Any]) -> dict[str, Any]:
        column, row = content["tile"]
        return STEPS[content["step"]](request, (column, row))

    return work


def plan(request: CityRequest, tile: Tile) -> dict[str, Any]:
    """Plan a tile's streets and ground; bare ground where that fails, for its neighbours need one."""
    folder = request.plans / tile_name(tile)
    terrain = request.plans / f"terrain{SUFFIX}"
    made_of = [_head(folder, MAP), _head(folder, WATERS), read_head(terrain)[1] if terrain.exists() else ""]
    return _unless_kept(request, tile, "plan", made_of, lambda: _plan(request, tile))


def _plan(request: CityRequest, tile: Tile) -> dict[str, Any]:
    stages, evidence = _evidence(request, tile)
    try:
        planned(evidence, request.tile(tile), stages)
    except VicoError as error:
        none = replace(evidence.data, nodes=[], ways=[], areas=[], relations=[])
        planned(replace(evidence, data=stages.given(none, digest_of(none))), request.tile(tile), stages)
        return {"failed": sentence_of(error)}
    return {}


def _evidence(request: CityRequest, tile: Tile) -> tuple[Stages, Evidence]:
    """Return what keeps a tile's plan, and the sources there."""
    asked, place = request.tile(tile), request.place(tile)
    stages = Stages(place.own)
    return stages, gather(asked.sources, asked.frame, asked.reach, stages, part=map_of(place))


def join(request: CityRequest, tile: Tile) -> dict[str, Any]:
    """Make a tile's streets and ground one with its neighbours', for the city's tunnels."""

    def made() -> dict[str, Any]:
        stages, evidence = _evidence(request, tile)
        asked = request.tile(tile)
        among_neighbours(planned(evidence, asked, stages), asked, stages)
        return {}

    made_of = _plans(request, tile)
    if not (request.plans / tile_name(tile) / f"{JOINED}{SUFFIX}").exists():
        _forget(request, tile, "join")
    return _unless_kept(request, tile, "join", made_of, made)


def shape(request: CityRequest, tile: Tile) -> dict[str, Any]:
    """Make what stands in a tile, for the city's streets."""
    made_of = [*_plans(request, tile), _head(request.plans / tile_name(tile), BORES)]
    return _unless_kept(request, tile, "shape", made_of, lambda: _shape(request, tile))


def _shape(request: CityRequest, tile: Tile) -> dict[str, Any]:
    stages, evidence = _evidence(request, tile)
    asked = request.tile(tile)
    made = shaped(planned(evidence, asked, stages), asked, stages)
    own = [*made.built.standing(made.plan.height), *made.bridges.feet]
    found = TileShape(own, made.bridges.open_ways, made.plan.streets)
    folder = request.plans / tile_name(tile)
    keep_product(folder, SHAPE, found)
    keep_product(folder, LEVELS, made.levels)
    return {}


def build(request: CityRequest, tile: Tile) -> dict[str, Any]:
    """Build a tile's world; its ground ends at its borders."""
    folder, out = request.plans / tile_name(tile), request.out / TILES / tile_name(tile)
    if not (out / "world.json").exists():
        _forget(request, tile, "build")
    made_of = [*_plans(request, tile), _head(folder, BORES), _head(folder, CUT)]

    def made() -> dict[str, Any]:
        build_requested(request.tile(tile), out)
        return {}

    return _unless_kept(request, tile, "build", made_of, made)


def _plans(request: CityRequest, tile: Tile) -> list[str]:
    """Return digests of a tile's map, and of what it and its neighbours planned."""
    around = [request.plans / tile_name(one) for one in request.grid.around(tile)]
    own = request.plans / tile_name(tile)
    return [_head(own, MAP), _head(own, WATERS), *(_head(folder, name) for folder in around for name in SEAMS)]


def fit(request: CityRequest, tile: Tile) -> dict[str, Any]:
    """Make a tile's ground meet that of the tiles before it, draw its map, and return what the tile came to."""
    out = request.out / TILES / tile_name(tile)
    before = {axis: (tile[0] - (axis == 0), tile[1] - (axis == 1)) for axis in (0, 1)}
    there = {axis: request.out / TILES / tile_name(one) for axis, one in before.items()}
    there = {axis: folder for axis, folder in there.items() if (folder / STAGES / f"ground{SUFFIX}").exists()}
    made_of = [_head(folder / STAGES, name) for folder in (out, *there.values()) for name in ("ground", "wires")]
    folders = {one: request.out / TILES / tile_name(one) for one in request.grid.around(tile)}
    around = [one for one, folder in folders.items() if (folder / "world.json").exists()]
    made_of += [read_stored(folders[one]).manifest.files["buildings.json"] for one in around]
    known = _known(request, tile, "fit")
    if known is not None and read_stored(out).digest != known["found"]["digest"]:
        _forget(request, tile, "fit")  # it was built anew
    return _unless_kept(request, tile, "fit", [*map(str, there), *made_of], lambda: _fit(request, tile, there, around))


def _fit(request: CityRequest, tile: Tile, there: Mapping[int, Path], around: Sequence[Tile]) -> dict[str, Any]:
    out, half = request.out / TILES / tile_name(tile), request.grid.size / 2
    world = read_stored(out)
    ground = _drawn(out)
    for axis, folder in there.items():
        ground = conformed(ground, Side(axis, -half), profile_of(_drawn(folder), Side(axis, half)))
    wires: list[Surface] = kept_product(out / STAGES, "wires")[0]
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


def _drawn(tile: Path) -> list[Surface]:
    """Return the ground of a tile as it was made, not yet fitted to any neighbour."""
    ground: list[Surface] = kept_product(tile / STAGES, "ground")[0]
    return ground


def gates(request: CityRequest, tile: Tile) -> dict[str, Any]:
    """Find where one walks from a tile into others, and what ways between these places cost."""
    cost, room = (mapped_array(request.out / WHOLE / name) for name in (COST, ROOM))
    square = square_of(tile, request.grid, len(cost) // (2 * request.grid.reach + 1))
    wide = around(square, 1)[0]
    made_of = [str(square), sha256(np.ascontiguousarray(cost[wide]).tobytes()).hexdigest()]
    made_of.append(sha256(np.ascontiguousarray(room[square]).tobytes()).hexdigest())
    cell = request.grid.size / (square[0].stop - square[0].start)

    def made() -> dict[str, Any]:
        keep_product(request.plans / tile_name(tile), GATES, tile_gates(cost, room, square, cell=cell))
        return {}

    return _unless_kept(request, tile, "gates", made_of, made)


def _head(folder: Path, name: str) -> str:
    """Return the digest of a product."""
    return read_head(folder / f"{name}{SUFFIX}")[1]


def _known(request: CityRequest, tile: Tile, step: str) -> dict[str, Any] | None:
    """Return what is kept of a step that was done: its key, and what it found."""
    path = request.plans / tile_name(tile) / f"{step}.json"
    content: dict[str, Any] | None = read_json(path) if path.exists() else None
    return content


def _forget(request: CityRequest, tile: Tile, step: str) -> None:
    (request.plans / tile_name(tile) / f"{step}.json").unlink(missing_ok=True)


def _unless_kept(
    request: CityRequest, tile: Tile, step: str, made_of: Sequence[str], made: Callable[[], dict[str, Any]]
) -> dict[str, Any]:
    """Do a step, or return what it found when it was done with the same code, request and inputs."""
    content = request.to_json()
    asked = [tile_name(tile), *(str(content[name]) for name in ("lat", "lon", "seed")), str(request.grid.size)]
    key = sha256("\n".join([code_digest(), *asked, *made_of]).encode()).hexdigest()
    known = _known(request, tile, step)
    if known is not None and known["key"] == key:
        found: dict[str, Any] = known["found"]
        return found
    _forget(request, tile, step)
    found = made()
    write_json(request.plans / tile_name(tile) / f"{step}.json", {"key": key, "found": found})
    return found


STEPS: dict[str, Callable[[CityRequest, Tile], dict[str, Any]]] = {
    "plan": plan,
    "join": join,
    "shape": shape,
    "build": build,
    "fit": fit,
    "gates": gates,
}
