"""Photos onto clean buildings: seconds, memory and how near the truth, with a synthetic photogrammetry mesh.

The mesh is made from a world's own walls and roofs: their procedural look is the truth. It is what such meshes are:
cut in small triangles, bent, shifted, blurred, without the walls nobody can see, with leaves and cars melted in front.

Run: ``PYTHONPATH=tests python benchmarks/baking.py WORLD... [--table FILE] [--pictures FOLDER]``; prints a table in
markdown.

With ``--district FOLDER [--radius 400] [--threads 1 2]`` it also builds the packaged place as users do, from a tileset
that is made of it (bumpy, melted, with trees, cars and shadows): minutes, processor seconds, peak memory and size of
the whole command, once for each number of threads. Truth and tileset are kept in FOLDER for the next run.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import resource
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from reporting import machine, publish, vico
from scipy.ndimage import gaussian_filter

from photogrammetry.aerial import photogrammetry as from_the_air
from photogrammetry.tileset import write_tileset
from vico.geo.tiles3d import TileMesh
from vico.seeds import rng
from vico.threads import WORKERS, workers
from vico.world.folder import read_world
from vico.world.glb import glb_bytes
from vico.world.mesh import Surface
from vico.world.world import stage_seconds
from vico.worldgen.facts.ray_casting import RayCaster
from vico.worldgen.photos.atlas import Atlas, unwrap, with_atlas_pages
from vico.worldgen.photos.baking import BakeResult, PhotoColours, _Expected, _paint, bake
from vico.worldgen.photos.enhancement import inpaint_atlas, pad_gutters, upscale_atlas
from vico.worldgen.request import packaged_extract

_PHOTO_TEXEL = 0.12  # metres: what a city's photogrammetry shows
_EDGE = 4.0  # metres, the longest edge of its triangles
GOAL_MINUTES, GOAL_GB, GOAL_MB = 10.0, 4.0, 100.0
_HEAVY = ("buildings", "bake", "enhance", "write")  # stages with work for more than one thread


def as_tile_mesh(surfaces: Sequence[Surface]) -> TileMesh:
    """Surfaces as a tile mesh, colours and all."""
    positions, triangles, uv, colour, texture_of = [], [], [], [], []
    textures: list[NDArray[np.uint8]] = []
    known: dict[str, int] = {}
    count = 0
    for surface in surfaces:
        picture = surface.material.texture
        if picture is not None and surface.material.name not in known:
            known[surface.material.name] = len(textures)
            textures.append(np.ascontiguousarray(picture[..., :3]))
        index = known[surface.material.name] if picture is not None else -1
        positions.append(surface.positions.astype(np.float64))
        triangles.append(surface.triangles + count)
        uv.append(surface.uv)
        colour.append(surface.colour)
        texture_of.append(np.full(len(surface.triangles), index, np.int32))
        count += len(surface.positions)
    return TileMesh(
        np.concatenate(positions),
        np.concatenate(triangles).astype(np.int32),
        np.concatenate(uv).astype(np.float32),
        np.concatenate(texture_of),
        tuple(textures),
        np.concatenate(colour),
        ("synthetic",),
    )


def truth_of(atlas: Atlas, mesh: TileMesh) -> tuple[NDArray[np.uint8], ...]:
    """Return what the pages would be if the photos were perfect, by charts of the exact mesh."""
    pages = tuple(page.copy() for page in atlas.pages)
    known = tuple(np.zeros_like(mask) for mask in atlas.known)
    exact = replace(atlas, pages=pages, known=known)
    _paint(
        exact, _Expected.nothing(len(atlas.charts)), RayCaster(mesh.positions, mesh.triangles), PhotoColours(mesh), 0.12
    )
    return pages


def photogrammetry(walls: Sequence[Surface], roofs: Sequence[Surface], *, seed: int, bent: float = 1.0) -> TileMesh:
    """Make a photogrammetry mesh of buildings: small bent triangles, blurred colours, holes, leaves, cars in front."""
    random = rng(seed, "photogrammetry")
    new_walls, new_roofs, atlas = unwrap(walls, roofs, texel=_PHOTO_TEXEL, page=2048)
    exact = as_tile_mesh([*walls, *roofs])
    pages = truth_of(atlas, exact)
    pages = tuple(
        np.clip(gaussian_filter(page.astype(np.float32), (0.6, 0.6, 0)) + 0.5, 0, 255).astype(np.uint8)
        for page in pages
    )
    photos = with_atlas_pages([*new_walls, *new_roofs], replace(atlas, pages=pages))
    mesh = _cut(as_tile_mesh([s for s in photos if s.material.name.startswith("atlas_")]), _EDGE)
    # Nobody photographs a wall between two houses: a hand's breadth outside of it is inside another building.
    corners = mesh.positions[mesh.triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    middle = corners.mean(axis=1)
    faces = exact.positions[exact.triangles]
    upward = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])[:, 2] > 0
    over = RayCaster(exact.positions, exact.triangles).first(middle + 0.3 * normal, np.array([0.0, 0.0, 1.0]))
    hidden = (over.triangle >= 0) & upward[over.triangle]
    low = middle[:, 2] < np.median(exact.positions[:, 2].min()) + 2.0
    gone = hidden | (low & (random.random(len(middle)) < 0.5)) | (random.random(len(middle)) < 0.02)
    mesh = replace(mesh, triangles=mesh.triangles[~gone], texture_of=mesh.texture_of[~gone])
    x, y, z = mesh.positions.T
    waves = np.column_stack([np.sin(y / 3.1 + z / 2.3), np.sin(x / 2.9 + z / 2.7), np.sin(x / 3.7 + y / 3.3)])
    mesh = replace(mesh, positions=mesh.positions + bent * (0.1 * waves + (0.25, -0.2, 0.1)))
    upright = np.flatnonzero((np.abs(normal[:, 2]) < 0.2) & ~gone & (middle[:, 2] < middle[:, 2].min() + 6.0))
    blobs = []
    for k in random.choice(upright, min(len(upright), 60), replace=False):
        leafy = random.random() < 0.6
        centre = middle[k] + normal[k] * (1.4 if leafy else 1.2)
        size = np.array([1.2, 1.2, 1.6]) if leafy else np.array([1.0, 1.0, 0.8])
        if not leafy:
            centre[2] = exact.positions[:, 2].min() + 1.0
        blobs.append(_blob(centre, size, (58, 96, 44) if leafy else (150, 30, 30), random))
    return _together([mesh, *blobs])


def _cut(mesh: TileMesh, longest: float) -> TileMesh:
    """Split triangles at the middles of their sides until none is longer."""
    corners = mesh.positions[mesh.triangles]
    uv = mesh.uv[mesh.triangles].astype(np.float64)
    colour = mesh.colour[mesh.triangles].astype(np.float64)
    texture = mesh.texture_of
    done: list[tuple[Any, Any, Any, Any]] = []
    while len(corners):
        length = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).max(axis=1)
        small = length <= longest
        done.append((corners[small], uv[small], colour[small], texture[small]))
        parts = []
        for values in (corners[~small], uv[~small], colour[~small]):
            a, b, c = values[:, 0], values[:, 1], values[:, 2]
            ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
            quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
            parts.append(np.concatenate([np.stack(q, axis=1) for q in quarters]))
        corners, uv, colour = parts
        texture = np.tile(texture[~small], 4)
    corners, uv, colour, texture = (np.concatenate([part[k] for part in done]) for k in range(4))
    return replace(
        mesh,
        positions=corners.reshape(-1, 3),
        triangles=np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3),
        uv=uv.reshape(-1, 2).astype(np.float32),
        colour=colour.reshape(-1, 3).astype(np.uint8),
        texture_of=texture.astype(np.int32),
    )


def _blob(centre: NDArray[Any], size: NDArray[Any], colour: tuple[int, int, int], random: Any) -> TileMesh:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=2)
    points = np.asarray(ball.vertices) * size * random.uniform(0.85, 1.15, (len(ball.vertices), 1)) + centre
    shade = np.clip(np.array(colour) + random.integers(-18, 18, (len(points), 1)), 0, 255).astype(np.uint8)
    faces = np.asarray(ball.faces, np.int32)
    return TileMesh(points, faces, np.zeros((len(points), 2), np.float32), np.full(len(faces), -1, np.int32), (), shade)


def _together(meshes: Sequence[TileMesh]) -> TileMesh:
    starts = np.cumsum([0, *(len(mesh.positions) for mesh in meshes[:-1])])
    return replace(
        meshes[0],
        positions=np.concatenate([mesh.positions for mesh in meshes]),
        triangles=np.concatenate([m.triangles + np.int32(s) for m, s in zip(meshes, starts, strict=True)]),
        uv=np.concatenate([mesh.uv for mesh in meshes]),
        texture_of=np.concatenate([mesh.texture_of for mesh in meshes]),
        colour=np.concatenate([mesh.colour for mesh in meshes]),
    )


def psnr(pages: Sequence[NDArray[np.uint8]], truth: Sequence[NDArray[np.uint8]], where: Sequence[Any]) -> float:
    """Peak signal-to-noise ratio over chosen texels, dB."""
    total, count = 0.0, 0
    for page, true, mask in zip(pages, truth, where, strict=True):
        total += float(((page[mask].astype(np.float32) - true[mask]) ** 2).sum(dtype=np.float64))
        count += 3 * int(mask.sum())
    return float(10 * np.log10(255**2 * max(count, 1) / max(total, 1e-9)))


def measured(name: str, world: Path, *, texel: float, finer: bool, bent: float, pictures: Path | None) -> str:
    """One line of the table."""
    there = read_world(world)
    walls, roofs = there.surfaces("buildings"), there.surfaces("roofs")
    mesh = photogrammetry(walls, roofs, seed=0, bent=bent)
    exact = as_tile_mesh([*walls, *roofs])
    seconds = [time.process_time()]
    baked: BakeResult = bake(walls, roofs, mesh, texel=texel, page=2048 if finer else 4096)
    seconds.append(time.process_time())
    filled = inpaint_atlas(baked.atlas)
    seconds.append(time.process_time())
    final = upscale_atlas(filled) if finer else pad_gutters(filled)
    seconds.append(time.process_time())
    bake_s, fill_s, last_s = np.diff(seconds)
    truth = truth_of(baked.atlas, exact)
    known = baked.atlas.known
    holes = [inside & ~mask for inside, mask in zip(baked.atlas.inside, known, strict=True)]
    texels = sum(int(inside.sum()) for inside in baked.atlas.inside)
    share = sum(int(mask.sum()) for mask in known) / max(texels, 1)
    gain = ""
    if finer:
        fine_truth = truth_of(final, exact)
        bicubic = [
            np.asarray(Image.fromarray(page).resize(new.shape[1::-1], Image.Resampling.BICUBIC))
            for page, new in zip(pad_gutters(filled).pages, final.pages, strict=True)
        ]
        gain = f"{psnr(bicubic, fine_truth, final.known):.1f} -> {psnr(final.pages, fine_truth, final.known):.1f}"
    glb = (
        len(
            glb_bytes(
                {"buildings": with_atlas_pages(baked.walls, final), "roofs": with_atlas_pages(baked.roofs, final)}
            )
        )
        / 1e6
    )
    if pictures is not None:
        pictures.mkdir(parents=True, exist_ok=True)
        for k, page in enumerate(final.pages):
            Image.fromarray(page[::-1]).save(pictures / f"{name}-{texel:g}-{k}.jpg", quality=88)
    # Roofs and walls that are in the atlas, of the buildings there are.
    return (
        f"| {name}, {'bent' if bent else 'exact'} photos | {texel:g}{' -> ' + format(texel / 2, 'g') if finer else ''} "
        f"| {len(there.buildings)} | {len(baked.atlas.charts)} of {baked.pieces} | {texels / 1e6:.1f} "
        f"| {100 * share:.0f} % | {bake_s:.1f} | {fill_s:.1f} | {last_s:.1f} "
        f"| {psnr(baked.atlas.pages, truth, known):.1f} "
        f"| {psnr(baked.atlas.pages, truth, holes):.1f} -> {psnr(filled.pages, truth, holes):.1f} | {gain} "
        f"| {glb:.0f} | {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6:.2f} |"
    )


def district(work: Path, radius: float, threads: Sequence[int]) -> list[str]:
    """Tabulate whole builds from a tileset with texels of 10 cm, one line for each number of threads."""
    place = packaged_extract()
    where = ["--lat", f"{place.lat}", "--lon", f"{place.lon}", "--radius", f"{radius:g}", "--overpass", "off"]
    truth, tiles = work / f"truth{radius:g}", work / f"tiles{radius:g}" / "tileset.json"
    if not (truth / "world.json").exists():
        vico("world", "build", *where, "--out", str(truth))
    if not tiles.exists():
        world = read_world(truth)
        write_tileset(from_the_air(world), world.frame, tiles.parent)
    lines = [
        "",
        f"## A district from its tileset, radius {radius:g} m, texels of 0.1 m",
        "",
        f"The whole command. Goals: {GOAL_MINUTES:g} minutes, {GOAL_GB:g} GB, {GOAL_MB:g} MB. Charts stands for plane",
        "pieces with photos. A stage's seconds are wall time. Equal digits mean equal meshes, byte for byte.",
        "",
        "| threads | min | processor s | peak GB | MB | charts | M texels | "
        + " | ".join(f"{name} s" for name in _HEAVY)
        + " | meshes |",
        "|---|---|---|---|---|---|---|" + "---|" * (len(_HEAVY) + 1),
    ]
    for count in threads or [workers()]:
        os.environ[WORKERS] = str(count)
        with tempfile.TemporaryDirectory(dir=work) as scratch:
            out = Path(scratch) / "world"
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            child = vico("world", "build", *where, "--seed", "7", "--tiles", str(tiles), "--out", str(out))
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            built = read_world(out)
            seconds = stage_seconds(built)
            counts = next(stage.counts for stage in built.manifest.stages if stage.name == "texture")
            files = [p for p in out.rglob("*") if p.is_file() and ".stages" not in p.relative_to(out).parts]
            size = sum(p.stat().st_size for p in files) / 1e6
            meshes = hashlib.sha256()
            for path in sorted(p for p in files if p.suffix == ".glb"):
                meshes.update(path.read_bytes())
        spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        lines.append(
            f"| {count} | {child.seconds / 60:.1f} | {spent:.0f} | {child.peak_mb / 1e3:.2f} | {size:.0f} "
            f"| {counts['charts']} | {counts['texels'] / 1e6:.1f} | "
            + " | ".join(f"{seconds.get(name, 0.0):.0f}" for name in _HEAVY)
            + f" | {meshes.hexdigest()[:8]} |"
        )
        print(lines[-1], file=sys.stderr, flush=True)
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("worlds", type=Path, nargs="*")
    parser.add_argument("--table", type=Path)
    parser.add_argument("--pictures", type=Path)
    parser.add_argument("--district", type=Path, help="folder to build the packaged place in, from a tileset of it")
    parser.add_argument("--radius", type=float, default=400.0, help="of the district, metres")
    parser.add_argument(
        "--threads", type=int, nargs="*", default=[], help="to build the district with, one after another"
    )
    given = parser.parse_args()
    if not given.worlds and given.district is None:
        parser.error("name worlds, or a folder with --district")
    lines = ["# Photos onto buildings: bake, in-paint, enlarge", "", machine()]
    if given.worlds:
        lines += [
            "Made by `PYTHONPATH=tests python benchmarks/baking.py WORLD... --district FOLDER",
            "--table benchmarks/results/baking.md`:",
            "mocked-up photos of each world (bent: 0.1 m waves, 0.4 m shift; exact: neither), CPU seconds, PSNR",
            "against the world's own look in dB. Finer: back-projection against bicubic enlargement. The peak",
            "includes making mesh and truth.",
            "",
            "| world | texel, m | buildings | charts | M texels | covered | bake s | in-paint s | enlarge or pad s "
            "| photos dB | holes dB | finer dB | GLB MB | peak GB |",
            "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|",
        ]
    for world in given.worlds:
        for texel, finer, bent in ((0.2, True, 1.0), (0.2, True, 0.0), (0.1, False, 1.0)):
            line = measured(world.name, world, texel=texel, finer=finer, bent=bent, pictures=given.pictures)
            lines.append(line)
            print(line, flush=True)
    if given.district is not None:
        lines += district(given.district, given.radius, given.threads)
    publish(lines, given.table)


if __name__ == "__main__":
    main()
