"""How a world looks in the street, with and without each photo stage, against the known place that was photographed.

    PYTHONPATH=tests python benchmarks/appearance.py [--radius 150] [--photos 40] [--views 50] [--aerial 0.25]
                                                    [--work FOLDER] [--table FILE] [--pictures FOLDER]

The known place is the packaged one, with the facades of one seed. A synthetic photogrammetry tileset and street photos
with wrong poses are made of it. The place is then built again with another seed by `build_world` as users would:
without photos, and with each photo stage added. It sees a map as most cities have it (`ordinary_map`): without levels,
heights, roofs, colours, materials, dates and building parts, its buildings half a metre off at most, by blocks. The
packaged map says all that of most of its buildings, and the truth is made by the same generator from the same words:
built from the whole map, a world "without photos" shares the truth's walls and window rows (`--whole-map`). The same
views are rendered of all worlds, in the same light and without trees, cars and other objects.

Needs ``pip install flip-evaluator`` (NVIDIA's FLIP) beside the extras ``bake`` and ``streetview``.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import math
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from ordinary_map import ordinary_map
from PIL import Image, ImageDraw, ImageFont
from reporting import machine, publish
from scipy.ndimage import gaussian_filter

from photogrammetry.aerial import Photogrammetry, photogrammetry
from photogrammetry.tileset import write_tileset
from vico.geo.street_images import camera_rotation, heading_of
from vico.render import Cameras, Scene, render
from vico.render.world_scene import scene_of
from vico.seeds import rng
from vico.world.folder import read_world
from vico.world.walkable import SIDEWALK
from vico.world.world import World
from vico.worldgen.facts.ray_casting import RayCaster
from vico.worldgen.photos.enhancement import find_sun, remove_sunlight
from vico.worldgen.photos.streetview.registration import Correction, Pose, correction
from vico.worldgen.photos.streetview.reprojection import StreetviewReport
from vico.worldgen.photos.texturing import PhotoSurfaces, Texturing
from vico.worldgen.pipeline import STAGES, build_world
from vico.worldgen.request import BuildOptions, Sources, packaged_extract
from vico.worldgen.stages import read_product

EYE = 1.6
WIDE, HIGH = 640, 360
FOV = math.radians(62.0)
PIXELS_PER_DEGREE = 67.0  # FLIP's own default: a 0.7 m wide 4K screen, 0.7 m away
TRUE_SEED, SEED = 0, 7
MAP_OFF = 0.5  # metres


@dataclass(frozen=True)
class Variant:
    """A way of building the place again.

    Attributes
    ----------
    label
        As the table names it.
    texturing
        How photos come onto the walls.
    tiles, photos
        Which photos are given.
    """

    label: str
    texturing: Texturing
    tiles: bool = True
    photos: bool = False


VARIANTS = {
    "plain": Variant("map alone", Texturing(), tiles=False),
    "baked": Variant("tiles baked, holes grey", Texturing(inpaint="none", even=False)),
    "filled": Variant("tiles baked, enhanced", Texturing()),
    "sharp": Variant("the same, made finer", Texturing(upscale="sharpen")),
    "street": Variant("tiles baked, street photos, enhanced", Texturing(), photos=True),
}
DEFAULT = ["plain", "baked", "filled", "street"]
_STAGES = ("tiles", "photos", "bake", "streetview", "enhance", "write")


def known_place(work: Path, radius: float, photos: int, *, aerial: float = 0.25) -> None:
    """Build the truth, and take its aerial and street photos; `aerial` is metres a pixel of the former on walls."""
    place = packaged_extract()
    truth = work / "truth"
    if not (truth / "world.json").exists():
        build_world(
            Sources(place.path),
            lat=place.lat,
            lon=place.lon,
            half=radius,
            seed=TRUE_SEED,
            out=truth,
            options=BuildOptions(keep_stages=False, previews=False),
        )
    world = read_world(truth)
    if not (work / "tiles" / "tileset.json").exists():
        # Photos from the air and from the street show one and the same place: it is the map that is off.
        seen = Photogrammetry(shift=0.0, height_error=0.0, texel=aerial)
        write_tileset(photogrammetry(world, seen), world.frame, work / "tiles")
    if not (work / "map.osm.pbf").exists():
        ordinary_map(place.path, work / "map.osm.pbf", off=MAP_OFF, seed=TRUE_SEED)
    if not (work / "photos" / "photos.json").exists():
        _street_photos(world, work / "photos", photos)


def _street_photos(world: World, folder: Path, count: int) -> None:
    """Write a folder of photos as a phone makes them: JPEG, position and angles in a file, all somewhat wrong."""
    from streetview import WIDE as PHOTO_WIDE
    from streetview import photographer_of, photos_of, street_life, true_cameras

    cameras = true_cameras(world, count, TRUE_SEED)
    life, _ = street_life(world, cameras, TRUE_SEED)
    photos, _ = photos_of(photographer_of(life, samples=2), cameras, TRUE_SEED)
    folder.mkdir(parents=True)
    records, true = [], {}
    for photo, camera in zip(photos, cameras, strict=True):
        name = f"{photo.id}.jpg"
        Image.fromarray(photo.picture).save(folder / name, quality=90)
        lat, lon = world.frame.to_geodetic(photo.position[:2])
        height = photo.picture.shape[0]
        heading, pitch, roll = angles_of(photo.rotation)
        records.append(
            {
                "file": name,
                "lat": float(lat),
                "lon": float(lon),
                "eye": max(float(photo.position[2]) - float(world.height(photo.position[:2])), 0.0),
                "heading": heading,
                "pitch": pitch,
                "roll": roll,
                "fov": math.degrees(2 * math.atan(height / 2 / photo.intrinsics[1, 1])),
            }
        )
        true[name] = {"position": camera.position.tolist(), "rotation": camera.rotation.tolist()}
    (folder.parent / "cameras.json").write_text(json.dumps({"wide": PHOTO_WIDE, "cameras": true}))
    content = {"schema": "vico.photos", "version": 1, "attribution": "the benchmark", "photos": records}
    (folder / "photos.json").write_text(json.dumps(content, indent=1))


def angles_of(rotation: NDArray[np.float64]) -> tuple[float, float, float]:
    """Heading, pitch and roll, degrees, of a world-to-camera rotation: what `looking` makes it of."""
    heading = heading_of(rotation)
    pitch = math.degrees(math.asin(float(np.clip(rotation[2, 2], -1, 1))))
    level = camera_rotation(heading, pitch)
    roll = math.degrees(math.atan2(float(rotation[0] @ level[1]), float(rotation[0] @ level[0])))
    return heading, pitch, roll


def build(work: Path, name: str, radius: float, *, whole_map: bool) -> None:
    """Build one variant in this process, and write down what it cost."""
    place = packaged_extract()
    variant = VARIANTS[name]
    start = time.process_time()
    build_world(
        Sources(
            place.path if whole_map else work / "map.osm.pbf",
            tiles=str(work / "tiles" / "tileset.json") if variant.tiles else None,
            photos=str(work / "photos") if variant.photos else None,
        ),
        lat=place.lat,
        lon=place.lon,
        half=radius,
        seed=SEED,
        out=work / name,
        force=True,
        options=BuildOptions(texturing=variant.texturing, previews=False),
    )
    cost = {
        "cpu": time.process_time() - start,
        "gigabytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e6 if sys.platform != "darwin" else 1e9),
    }
    (work / f"{name}.json").write_text(json.dumps(cost))


def spots(world: World, scene: Scene, count: int, seed: int) -> list[Pose]:
    """Choose views on pavements of the middle of a world that show facades: near enough, and not only these."""
    random = rng(seed, "views")
    walkable = world.walkable
    cells = np.argwhere(walkable.cls == SIDEWALK)[:, ::-1]
    places = walkable.centre_of(cells)
    places = places[np.abs(places).max(axis=1) < 0.65 * world.half]
    buildings = np.array([b.entity for b in world.buildings])
    chosen: list[Pose] = []
    while len(chosen) < count:
        xy = places[random.integers(len(places))]
        pose = Pose(np.array([*xy, float(world.height(xy)) + EYE]), camera_rotation(random.uniform(0, 360), 6.0))
        if any(np.linalg.norm(pose.position - other.position) < 4.0 for other in chosen):
            continue
        _, depth, entity = picture(scene, pose, width=96, height=54)
        wall = np.isin(entity, buildings)
        if 0.35 <= wall.mean() <= 0.9 and np.quantile(depth[wall], 0.2) > 3.5 and np.median(depth[wall]) < 45.0:
            chosen.append(pose)
    return chosen


def picture(scene: Scene, pose: Pose, *, width: int = WIDE, height: int = HIGH, samples: int = 1) -> tuple[Any, ...]:
    """Colours, depth and entities of a view."""
    camera = Cameras(
        pose.position[None], pose.rotation[2][None], up=-pose.rotation[1], fov_y=FOV, width=width, height=height
    )
    frames = render(scene, camera, samples=samples)
    return frames.rgb[0], frames.depth[0], frames.segmentation[0]


def bare(world: World) -> Scene:
    """Ground, walls and roofs alone."""
    return Scene([*world.surfaces("ground"), *world.surfaces("buildings"), *world.surfaces("roofs")], {})


def psnr(a: NDArray[np.uint8], b: NDArray[np.uint8], where: NDArray[np.bool_]) -> float:
    """Peak signal-to-noise ratio over some pixels, dB."""
    error = float(((a[where].astype(np.float64) - b[where]) ** 2).mean())
    return 10 * math.log10(255**2 / max(error, 1e-9))


def ssim(a: NDArray[np.uint8], b: NDArray[np.uint8], where: NDArray[np.bool_]) -> float:
    """Structural similarity of the luminance, Gaussian windows (Wang et al. 2004), averaged over some pixels."""
    weights = np.array([0.299, 0.587, 0.114])
    x, y = a @ weights, b @ weights
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2

    def smooth(values: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(gaussian_filter(values, 1.5, truncate=3.5))

    mx, my = smooth(x), smooth(y)
    vx, vy, vxy = smooth(x * x) - mx * mx, smooth(y * y) - my * my, smooth(x * y) - mx * my
    found = (2 * mx * my + c1) * (2 * vxy + c2) / ((mx * mx + my * my + c1) * (vx + vy + c2))
    return float(found[where].mean())


def flip(true: NDArray[np.uint8], test: NDArray[np.uint8]) -> NDArray[np.float32]:
    """FLIP's error in each pixel: what a person sees who switches between two pictures; 0..1."""
    from flip_evaluator import evaluate

    pair = [picture.astype(np.float32) / 255 for picture in (true, test)]
    options = {"ppd": PIXELS_PER_DEGREE}
    return np.asarray(evaluate(*pair, "LDR", applyMagma=False, parameters=options)[0], np.float32)[..., 0]


def scores(true: Sequence[Any], made: NDArray[np.uint8], buildings: NDArray[np.int64]) -> dict[str, float]:
    """All figures of one view."""
    rgb, _, entity = true
    wall = np.isin(entity, buildings)
    everything = np.ones_like(wall)
    error = flip(rgb, made)
    return {
        "psnr": psnr(rgb, made, wall),
        "ssim": ssim(rgb, made, wall),
        "flip": float(error[wall].mean()),
        "psnr all": psnr(rgb, made, everything),
        "ssim all": ssim(rgb, made, everything),
        "flip all": float(error.mean()),
    }


def cell(values: Sequence[float], digits: int) -> str:
    """Median and quartiles."""
    low, middle, high = np.quantile(values, (0.25, 0.5, 0.75))
    return f"{middle:.{digits}f} ({low:.{digits}f}..{high:.{digits}f})"


def appearance(names: Sequence[str], figures: dict[str, list[dict[str, float]]], count: int) -> list[str]:
    """Lay out the table of all variants."""
    lines = [
        f"Median (quartiles) over {count} views. PSNR in dB and SSIM: more is better; FLIP: less is better.",
        "",
        "| world | PSNR, buildings | SSIM, buildings | FLIP, buildings | PSNR, all | SSIM, all | FLIP, all "
        "| nearer than the map alone (FLIP) |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name in names:
        mine = figures[name]
        cells = [
            cell([row[key + suffix] for row in mine], digits)
            for suffix in ("", " all")
            for key, digits in (("psnr", 1), ("ssim", 3), ("flip", 3))
        ]
        better = sum(a["flip"] < b["flip"] for a, b in zip(mine, figures[names[0]], strict=True))
        cells.append("" if name == names[0] else f"{better} of {count}")
        lines.append(f"| {VARIANTS[name].label} | {' | '.join(cells)} |")
    return [*lines, ""]


def costs(work: Path, names: Sequence[str]) -> list[str]:
    """Tabulate what each variant took."""
    lines = [
        "| world | " + " | ".join(f"{stage}, s" for stage in _STAGES) + " | all stages, s | processor, s | peak, GB "
        "| world, MB | pages | texels | of photos |",
        "|---|" + "---|" * (len(_STAGES) + 7),
    ]
    for name in names:
        world = read_world(work / name)
        cost = json.loads((work / f"{name}.json").read_text())
        seconds = json.loads((work / name / "build.json").read_text())["seconds"]
        megabytes = sum(world.file(file).stat().st_size for file in world.manifest.files) / 1e6
        texture = next((stage.counts for stage in world.manifest.stages if stage.name == "texture"), {})
        texels, seen = texture.get("texels", 0), texture.get("texels_known", 0)
        cells = [f"{seconds[stage]:.1f}" if stage in seconds else "" for stage in _STAGES]
        cells += [f"{sum(seconds.values()):.0f}", f"{cost['cpu']:.0f}", f"{cost['gigabytes']:.2f}", f"{megabytes:.0f}"]
        cells += [str(texture.get("pages", 0)), f"{texels / 1e6:.1f} M", f"{seen / max(texels, 1):.0%}"]
        lines.append(f"| {VARIANTS[name].label} | {' | '.join(cells)} |")
    return [*lines, ""]


def poses(work: Path, world: World, reports: StreetviewReport) -> list[str]:
    """How far the photos' poses are off, before and after."""
    true = json.loads((work / "cameras.json").read_text())["cameras"]
    given = {record["file"]: record for record in json.loads((work / "photos" / "photos.json").read_text())["photos"]}

    def metadata(name: str) -> Pose:
        record = given[name]
        xy = world.frame.to_enu(record["lat"], record["lon"])
        place = np.array([*xy, float(world.height(xy)) + record["eye"]])
        return Pose(place, camera_rotation(record["heading"], record["pitch"], record["roll"]))

    def off(pose: Pose, name: str) -> Correction:
        return correction(pose, Pose(np.array(true[name]["position"]), np.array(true[name]["rotation"])))

    before = [off(metadata(photo.id), photo.id) for photo in reports.photos]
    mended = [photo for photo in reports.photos if photo.pose is not None]
    after = [off(photo.pose, photo.id) for photo in mended if photo.pose is not None]
    used = sum(photo.used for photo in reports.photos)
    lines = [
        f"{len(reports.photos)} photos; {len(mended)} poses mended, {used} photos painted "
        f"({reports.painted_texels:,} texels on {reports.painted_charts} charts).",
        "",
        "| pose error, median (quartiles) | n | position, m | rotation, degrees |",
        "|---|---|---|---|",
    ]
    for label, found in (("in the metadata", before), ("after", after)):
        shift, turn = cell([c.shift for c in found], 2), cell([c.turn for c in found], 2)
        lines.append(f"| {label} | {len(found)} | {shift} | {turn} |")
    lines += ["", *(f"- not used: {photo.id}: {photo.reason}" for photo in reports.photos if not photo.used), ""]
    return lines


def texels(truth: World, before: PhotoSurfaces, after: PhotoSurfaces) -> list[str]:
    """Error of the texels that street photos gave, before and after, against the true facades."""
    from streetview import psnr as psnr_of
    from streetview import true_pages

    changed = [
        (a != b).any(axis=2) & inside
        for a, b, inside in zip(after.atlas.pages, before.atlas.pages, before.atlas.inside, strict=True)
    ]
    charts = tuple(chart for chart in before.atlas.charts if changed[chart.page][chart.box].any())
    # Walls stand where the tiles show them, some tenths of a metre off.
    true = true_pages(replace(before.atlas, charts=charts), [*truth.surfaces("buildings"), *truth.surfaces("roofs")],
                      reach=0.6)  # fmt: skip
    changed = [mask & (page != 128).any(axis=2) for mask, page in zip(changed, true, strict=True)]
    was = [mask & known for mask, known in zip(changed, before.atlas.known, strict=True)]
    new = [mask & ~known for mask, known in zip(changed, before.atlas.known, strict=True)]
    # Both without the light of their day, as the enhancement leaves them.
    faces = [*after.walls, *after.roofs]
    corners = np.concatenate([s.positions[s.triangles] for s in faces]).reshape(-1, 3)
    sight = RayCaster(corners, np.arange(len(corners)).reshape(-1, 3))
    pair = []
    for atlas in (before.atlas, after.atlas):
        sun = find_sun(atlas, sight)
        pair.append(atlas.pages if sun is None else remove_sunlight(atlas, sun, sight).pages)
    lines = [
        "| texels that street photos painted, against the true facades | n | PSNR, dB "
        "| with each wall's exposure fitted | correlation below 0.5 m | below 2 m |",
        "|---|---|---|---|---|---|",
    ]
    for label, where in (("photographed from the air too", was), ("holes before (grey)", new)):
        count = sum(int(mask.sum()) for mask in where)
        for when, pages in zip(("before", "after"), pair, strict=True) if count else ():
            found = psnr_of(pages, true, where), *against(pages, true, where, charts, before.atlas.texel)
            cells = [f"{value:.{digits}f}" for value, digits in zip(found, (2, 2, 3, 3), strict=True)]
            lines.append(f"| {label}, {when} | {count:,} | {' | '.join(cells)} |")
    return [*lines, ""]


def against(
    pages: Sequence[Any], true: Sequence[Any], where: Sequence[Any], charts: Sequence[Any], texel: float
) -> tuple[float, float, float]:
    """Compare pages with the true ones: PSNR, and the correlation of what is finer than half a metre, and than two.

    PSNR is with each wall's colours scaled to the true ones' (a photo can't tell a dark wall from a dark day).
    """
    error, fine, broad, count = 0.0, 0.0, 0.0, 0
    for chart in charts:
        mask = where[chart.page][chart.box]
        n = int(mask.sum())
        if n < 300:
            continue
        made, right = (p[chart.page][chart.box].astype(np.float64) for p in (pages, true))
        a, b = made[mask], right[mask]
        gain = (a * b).sum(axis=0) / np.maximum((a * a).sum(axis=0), 1.0)
        weight = mask.astype(np.float64)
        detail = []
        for sigma in (0.25, 1.0):
            share = np.maximum(gaussian_filter(weight, sigma / texel), 1e-3)
            pair = [
                (grey - gaussian_filter(grey * weight, sigma / texel) / share)[mask]
                for grey in (made.mean(axis=2), right.mean(axis=2))
            ]
            detail.append(
                float((pair[0] * pair[1]).sum() / max(math.sqrt((pair[0] ** 2).sum() * (pair[1] ** 2).sum()), 1e-9))
            )
        error += float(((a * gain - b) ** 2).mean()) * n
        fine, broad, count = fine + detail[0] * n, broad + detail[1] * n, count + n
    if not count:
        return math.nan, math.nan, math.nan
    return 10 * math.log10(255**2 / max(error / count, 1e-9)), fine / count, broad / count


def sheet(pictures: Sequence[tuple[str, NDArray[np.uint8]]], path: Path, *, across: int) -> None:
    """Labelled pictures side by side."""
    font = ImageFont.load_default(18)
    height, width = pictures[0][1].shape[:2]
    strip, gap = 26, 4
    down = -(-len(pictures) // across)
    made = Image.new("RGB", (across * (width + gap) - gap, down * (height + strip)), (255, 255, 255))
    draw = ImageDraw.Draw(made)
    for k, (label, rgb) in enumerate(pictures):
        x, y = k % across * (width + gap), k // across * (height + strip)
        draw.text((x + 4, y + 2), label, fill=(20, 20, 20), font=font)
        made.paste(Image.fromarray(rgb), (x, y + strip))
    quality = 88
    made.save(path, quality=quality, optimize=True)
    while path.stat().st_size > 250_000 and quality > 40:
        quality -= 4
        made.save(path, quality=quality, optimize=True)


def before_and_after(work: Path, names: Sequence[str], chosen: Sequence[Pose], folder: Path) -> None:
    """One sheet a view, with trees and all that stands in the street."""
    folder.mkdir(parents=True, exist_ok=True)
    shown: list[list[tuple[str, NDArray[np.uint8]]]] = [[] for _ in chosen]
    for name in (*names, "truth"):
        scene = scene_of(read_world(work / name), rooms=False)
        label = "the place that was photographed" if name == "truth" else VARIANTS[name].label
        for k, pose in enumerate(chosen):
            shown[k].append((label, picture(scene, pose, samples=2)[0]))
    for k, pictures in enumerate(shown):
        sheet(pictures, folder / f"photo_{k + 1}.jpg", across=2)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--radius", type=float, default=150.0)
    parser.add_argument("--photos", type=int, default=40)
    parser.add_argument("--views", type=int, default=50)
    parser.add_argument("--aerial", type=float, default=0.25, help="metres a pixel of the aerial photos has on walls")
    parser.add_argument("--work", type=Path, help="folder to keep worlds in; what is there is used again")
    parser.add_argument("--whole-map", action="store_true", help="build again from all that the packaged map says")
    parser.add_argument("--only", nargs="*", default=DEFAULT, choices=list(VARIANTS))
    parser.add_argument("--build", choices=list(VARIANTS), help=argparse.SUPPRESS)
    parser.add_argument("--sheets", type=int, nargs="*", default=[], help="numbers of the views to make pictures of")
    parser.add_argument("--table", type=Path)
    parser.add_argument("--pictures", type=Path)
    given = parser.parse_args()
    if importlib.util.find_spec("flip_evaluator") is None:
        raise SystemExit("appearance: FLIP is not installed; type: python -m pip install --no-deps flip-evaluator")
    if given.build:
        build(given.work, given.build, given.radius, whole_map=given.whole_map)
        return
    with tempfile.TemporaryDirectory(prefix="vico-") as temporary:
        work = given.work or Path(temporary)
        work.mkdir(parents=True, exist_ok=True)
        words = ["FOLDER" if word in (str(given.work), str(given.pictures)) else word for word in sys.argv[1:]]
        lines = [
            "# How worlds look: baking, enhancement, street photos",
            "",
            machine(),
            f"Made by `PYTHONPATH=tests python benchmarks/appearance.py {' '.join(words)}` in one go.",
            "",
        ]
        publish([*lines, *measure(work, given)], given.table)


def conditions(given: argparse.Namespace) -> list[str]:
    """Say what the worlds are built from, and what that makes of the figures."""
    lines = [
        f"Aerial photos have {given.aerial:g} m a pixel on walls; the tiles are melted and bumpy, and show the "
        "place where the street photos do.",
    ]
    if given.whole_map:
        lines.append(
            "The map is the packaged one, with all it says of levels, roofs, colours and materials. The truth is made "
            "of the same words by the same generator, so the map alone shares its walls and window rows: no real place "
            "is so like its map."
        )
    else:
        lines.append(
            "The map says nothing of levels, heights, roofs, colours, materials, dates and parts, and its blocks of "
            f"buildings are up to {MAP_OFF:g} m off, as in most cities. It is still one that the truth's own generator "
            "reads: real facades differ from the map alone by more."
        )
    return lines


def yardstick(true: Sequence[tuple[Any, ...]], buildings: NDArray[np.int64]) -> list[str]:
    """Tabulate what the figures say of pictures whose fault is known."""
    faults = {
        "moved aside by 3 pixels": lambda rgb: np.roll(rgb, 3, axis=1),
        "blurred by 2 pixels": lambda rgb: np.round(gaussian_filter(rgb.astype(np.float32), (2, 2, 0))).astype(
            np.uint8
        ),
    }
    parts = []
    for name, fault in faults.items():
        pairs = [(view, fault(view[0]), np.isin(view[2], buildings)) for view in true]
        figures = [(psnr(view[0], made, wall), ssim(view[0], made, wall)) for view, made, wall in pairs]
        level, alike = np.median(figures, axis=0)
        parts.append(f"{name} {level:.1f} dB and {alike:.3f}")
    return [f"For scale, PSNR and SSIM of the buildings in the true views themselves: {', '.join(parts)}.", ""]


def measure(work: Path, given: argparse.Namespace) -> list[str]:
    """Build what is not there, look at all of it, and report."""
    known_place(work, given.radius, given.photos, aerial=given.aerial)
    for name in given.only:
        if not (work / f"{name}.json").exists():
            command = [sys.executable, __file__, "--work", str(work), "--build", name, "--radius", str(given.radius)]
            command += ["--whole-map"] if given.whole_map else []
            subprocess.run(command, check=True)
    truth = read_world(work / "truth")
    scene = bare(truth)
    views = spots(truth, scene, given.views, SEED)
    true = [picture(scene, pose) for pose in views]
    buildings = np.array([b.entity for b in truth.buildings])
    figures: dict[str, list[dict[str, float]]] = {}
    for name in given.only:
        scene = bare(read_world(work / name))
        made = [picture(scene, pose)[0] for pose in views]
        figures[name] = [scores(t, m, buildings) for t, m in zip(true, made, strict=True)]
        if given.pictures is not None:
            (given.pictures / name).mkdir(parents=True, exist_ok=True)
            for k, rgb in enumerate(made):
                Image.fromarray(rgb).save(given.pictures / name / f"{k:02d}.png")
    if given.pictures is not None:
        (given.pictures / "truth").mkdir(parents=True, exist_ok=True)
        for k, (rgb, _, _) in enumerate(true):
            Image.fromarray(rgb).save(given.pictures / "truth" / f"{k:02d}.png")
        before_and_after(work, given.only, [views[k] for k in given.sheets], given.pictures)
    share = statistics.median(float(np.isin(entity, buildings).mean()) for _, _, entity in true)
    lines = [
        f"{truth.manifest.name}, {2 * given.radius:.0f} m x {2 * given.radius:.0f} m, {len(truth.buildings)} "
        f"buildings; views of {WIDE} x {HIGH} pixels, a median of {share:.0%} of them buildings, on pavements at "
        f"{EYE} m within {0.65 * given.radius:.0f} m of the middle; the truth has seed {TRUE_SEED}, what is built "
        f"again seed {SEED}. Ground, walls and roofs only: trees and street furniture differ by seed.",
        *conditions(given),
        "The paper reports FID and KID; both need the weights of a trained network, which are not at hand here.",
        "",
        *appearance(given.only, figures, given.views),
        *yardstick(true, buildings),
        *costs(work, given.only),
    ]
    if "street" in given.only:
        kept = work / "street" / STAGES
        after, report = read_product(kept / "streetview.stage")[0]
        before = read_product(kept / "bake.stage")[0]
        world = read_world(work / "street")
        lines += [*poses(work, world, report), *texels(truth, before, after)]
    return lines


if __name__ == "__main__":
    main()
