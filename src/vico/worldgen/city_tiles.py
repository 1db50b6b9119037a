"""What is done to one tile of a city: planned, built, and fitted to what its neighbours drew."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

from vico.io.files import read_json, sha256_of, write_json
from vico.world.borders import Side, profile_of
from vico.world.folder import read_world, seal, stage_seconds
from vico.world.glb import write_glb
from vico.world.mesh import Surface, joined
from vico.worldgen.city_request import TILES, CityRequest
from vico.worldgen.evidence import gather
from vico.worldgen.pipeline import STAGES, build_requested
from vico.worldgen.recipe import SEAMS, planned
from vico.worldgen.seams.border_fit import conformed
from vico.worldgen.seams.grid import Tile, tile_name
from vico.worldgen.stages import SUFFIX, Stages, code_digest, kept_product

_MAP, _BUILT = "map.json", "built.json"


def builder(options: Mapping[str, Any], _: object) -> Callable[[Mapping[str, Any]], dict[str, Any]]:
    """Return what does a step of a tile: a service of `vico.jobs`."""
    request = CityRequest.from_json(dict(options))

    def work(content: Mapping[str, Any]) -> dict[str, Any]:
        column, row = content["tile"]
        return STEPS[content["step"]](request, (column, row))

    return work


def plan(request: CityRequest, tile: Tile) -> dict[str, Any]:
    """Plan a tile's streets and ground."""
    asked = request.tile(tile)
    folder = request.plans / tile_name(tile)
    folder.mkdir(parents=True, exist_ok=True)
    stages = Stages(folder)
    evidence = gather(asked.sources, asked.frame, asked.reach, stages, part=True)
    planned(evidence, asked, stages)
    write_json(folder / _MAP, {"digest": stages.digest(evidence.data)})
    return {}


def build(request: CityRequest, tile: Tile) -> dict[str, Any]:
    """Build a tile's world; its ground ends at its borders."""
    out = request.out / TILES / tile_name(tile)
    known, key = request.plans / tile_name(tile) / _BUILT, _key(request, tile)
    if not ((out / "world.json").exists() and known.exists() and read_json(known) == {"key": key}):
        known.unlink(missing_ok=True)
        build_requested(request.tile(tile), out)
        write_json(known, {"key": key})
    return {}


def _key(request: CityRequest, tile: Tile) -> str:
    """Return what decides a tile's world: code, map, request, and what it and its neighbours planned."""
    plans = [request.plans / tile_name(one) / f"{name}{SUFFIX}" for one in request.grid.around(tile) for name in SEAMS]
    content = request.to_json()
    parts = [
        code_digest(),
        tile_name(tile),
        str([content[name] for name in ("lat", "lon", "seed")]),
        str(request.grid.size),
        read_json(request.plans / tile_name(tile) / _MAP)["digest"],
        *(sha256_of(path) for path in plans),
    ]
    return sha256("\n".join(parts).encode()).hexdigest()


def fit(request: CityRequest, tile: Tile) -> dict[str, Any]:
    """Make a tile's ground meet that of the tiles before it, and return what the tile came to."""
    out = request.out / TILES / tile_name(tile)
    world = read_world(out)
    half = request.grid.size / 2
    ground = _drawn(out)
    for axis, before in ((0, (tile[0] - 1, tile[1])), (1, (tile[0], tile[1] - 1))):
        there = request.out / TILES / tile_name(before)
        if (there / STAGES / "ground.stage").exists():
            ground = conformed(ground, Side(axis, -half), profile_of(_drawn(there), Side(axis, half)))
    mesh = out / "meshes" / "ground.glb"
    wires: list[Surface] = kept_product(out / STAGES, "wires")[0]
    write_glb(mesh, {"ground": joined([*ground, *wires])})
    if sha256_of(mesh) != world.manifest.files["meshes/ground.glb"]:
        seal(out, world.manifest, seconds=stage_seconds(world))
    done = read_world(out)
    return {
        "digest": done.digest,
        "buildings": done.manifest.counts["buildings"],
        "places": done.manifest.counts["places"],
    }


def _drawn(tile: Path) -> list[Surface]:
    """Return the ground of a tile as it was made, not yet fitted to any neighbour."""
    ground: list[Surface] = kept_product(tile / STAGES, "ground")[0]
    return ground


STEPS: dict[str, Callable[[CityRequest, Tile], dict[str, Any]]] = {"plan": plan, "build": build, "fit": fit}
