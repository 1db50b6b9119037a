"""How well street photos find their place and paint the walls, against a known truth.

    python benchmarks/streetview.py [--photos 24] [--world FOLDER] [--berlin FOLDER] [--table FILE] [--pictures FOLDER]

The known world is the packaged place with its own facades, cars and people in its streets and the light of an
afternoon. Photos are rendered from it, then given noise, another exposure, and poses that are wrong as a phone's are.
The model is the same geometry in a blurred, discoloured texture, as aerial photogrammetry leaves it, at noon and with
nobody about. Pose errors are against the true cameras, colours against the true facades' texels.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from reporting import machine, publish, row, vico

from vico.assets.people import body_of, passer_by
from vico.assets.vehicles import vehicle_prototypes
from vico.geo.frame import LocalFrame
from vico.geo.street_image_folder import FolderImages
from vico.geo.street_images import StreetImage, camera_rotation, pinhole
from vico.render import Cameras, Lighting, Scene, render
from vico.render.world_scene import scene_of
from vico.seeds import rng
from vico.world.folder import read_world
from vico.world.mesh import Surface
from vico.world.world import World
from vico.worldgen.facts.ray_casting import RayCaster
from vico.worldgen.photos.atlas import Atlas, unwrap, with_atlas_pages
from vico.worldgen.photos.streetview.masking import PhotoView
from vico.worldgen.photos.streetview.matching import SiftMatcher
from vico.worldgen.photos.streetview.projection import texel_centres
from vico.worldgen.photos.streetview.registration import Pose, correction, relative_pose
from vico.worldgen.photos.streetview.reprojection import Photographer, StreetviewConfig, reproject
from vico.worldgen.previews import viewpoints
from vico.worldgen.request import packaged_extract

MOVER = 1 << 23
"""Entities from here on are cars and people."""

SIGMA_METRES, SIGMA_DEGREES = 1.0, 2.0
WIDE, HIGH = 1280, 960
EYE = 2.2
TEXEL = 0.1


def photographer_of(scene: Scene, *, samples: int = 1) -> Photographer:
    """Return a photographer of a scene: pinhole cameras whose principal point is the middle."""

    def photograph(
        position: NDArray[np.float64], rotation: NDArray[np.float64], intrinsics: NDArray[np.float64], w: int, h: int
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.int32]]:
        fov = 2 * math.atan(h / 2 / intrinsics[1, 1])
        camera = Cameras(position[None], rotation[2][None], up=-rotation[1], fov_y=fov, width=w, height=h)
        frames = render(scene, camera, samples=samples)
        return frames.rgb[0], frames.depth[0], frames.segmentation[0]

    return photograph


def true_pages(atlas: Atlas, surfaces: list[Surface], *, reach: float = 0.03) -> tuple[NDArray[np.uint8], ...]:
    """Paint the atlas's pages in the colours that the surfaces have: their textures times their vertex colours.

    Surfaces may stand `reach` metres before the atlas's walls, and at least 0.17 m behind; grey (128) where none are.
    """
    corners = np.concatenate([s.positions[s.triangles] for s in surfaces]).reshape(-1, 3)
    owner = np.repeat(np.arange(len(surfaces)), [len(s.triangles) for s in surfaces])
    uv = np.concatenate([s.uv[s.triangles] for s in surfaces])
    colour = np.concatenate([s.colour[s.triangles] for s in surfaces]).astype(np.float32)
    sight = RayCaster(corners, np.arange(len(corners)).reshape(-1, 3))
    small = [_reduced(s, atlas.texel) for s in surfaces]
    pages = [page.copy() for page in atlas.pages]
    for chart in atlas.charts:
        inside = atlas.inside[chart.page][chart.box]
        points = texel_centres(chart, slice(None), slice(None))[inside]
        hits = sight.first(points + reach * chart.normal, -chart.normal, most=reach + max(reach, 0.17))
        found = hits.triangle >= 0
        tri = hits.triangle[found]
        weights = np.stack([1 - hits.u - hits.v, hits.u, hits.v], axis=1)[found]
        at = np.einsum("nk,nkc->nc", weights, uv[tri])
        tint = np.einsum("nk,nkc->nc", weights, colour[tri]) / 255
        texels = np.full((len(points), 3), 128, np.uint8)
        mine = np.zeros((len(tri), 3), np.float32)
        for k in np.unique(owner[tri]).tolist():
            which = owner[tri] == k
            texture = small[k]
            mine[which] = _between(texture, at[which])
        texels[found] = np.round(mine * tint)
        pages[chart.page][chart.box][inside] = texels
    return tuple(pages)


def _reduced(surface: Surface, texel: float) -> NDArray[np.float32]:
    """Reduce a surface's texture to the atlas's fineness: each of its pixels is the mean of about a texel."""
    texture = surface.material.texture
    if texture is None:
        return np.full((1, 1, 3), 255, np.float32)
    h, w = texture.shape[:2]
    points, uv = (v[surface.triangles].astype(np.float64) for v in (surface.positions, surface.uv))
    area = np.linalg.norm(np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]), axis=1)
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    pixels = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) * h * w
    good = (area > 1e-6) & (pixels > 1e-6)
    finer = math.sqrt(float(np.median(pixels[good] / area[good]))) * texel if good.any() else 1.0
    size = tuple(max(round(side / max(finer, 1.0)), 1) for side in (w, h))
    rgb = np.ascontiguousarray(texture[..., :3])
    return np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), np.float32)


def _between(texture: NDArray[np.float32], at: NDArray[Any]) -> NDArray[np.float32]:
    """Colours between the pixels of a texture that repeats, shape ``(n, 3)``."""
    h, w = texture.shape[:2]
    x, y = at[:, 0] * w - 0.5, at[:, 1] * h - 0.5
    column, row = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    right, low = (x - column)[:, None], (y - row)[:, None]
    (c0, c1), (r0, r1) = (column % w, (column + 1) % w), (row % h, (row + 1) % h)
    upper = texture[r0, c0] * (1 - right) + texture[r0, c1] * right
    lower = texture[r1, c0] * (1 - right) + texture[r1, c1] * right
    return np.asarray(upper * (1 - low) + lower * low, np.float32)


def aerial(atlas: Atlas, pages: tuple[NDArray[np.uint8], ...], seed: int) -> Atlas:
    """Return the atlas as seen from the air: blurred (0.2 m standard deviation), recoloured, noisy; all of it known."""
    random = rng(seed, "aerial texture")
    made = [page.copy() for page in atlas.pages]
    for chart in atlas.charts:
        patch = pages[chart.page][chart.box].astype(np.float32)
        soft = cv2.GaussianBlur(patch, (0, 0), 0.2 / TEXEL, borderType=cv2.BORDER_REPLICATE)
        soft = soft * np.array([0.94, 0.97, 1.0]) + 4 + random.normal(0, 3, soft.shape)
        made[chart.page][chart.box] = np.clip(np.round(soft), 0, 255)
    return replace(atlas, pages=tuple(made), known=tuple(i.copy() for i in atlas.inside))


def street_life(world: World, cameras: list[Pose], seed: int) -> tuple[Scene, int]:
    """Put cars and people before most cameras of the known world in the afternoon; return how many there are too."""
    random = rng(seed, "street life")
    models = vehicle_prototypes()
    names = [name for name in sorted(models) if name != "bicycle"]
    people = [body_of(passer_by(k), source="procedural") for k in range(6)]
    for k, body in enumerate(people):
        plain = Surface.from_triangles(body.vertices, body.triangles, normals=body.normals, colour=body.colour)
        models = {**models, f"person {k}": [plain]}
    light = Lighting.at(15.5 * 3600, 60.0, day=140, clouds=0.3)
    scene = scene_of(world, rooms=False, lighting=light, prototypes=models)
    placed, transforms = [], []
    for pose in cameras:
        for _ in range(3):
            kind = names[random.integers(len(names))] if random.random() < 0.5 else f"person {random.integers(6)}"
            near = 7.0 if kind.startswith("person") else 11.0
            ahead = random.uniform(near, near + 14)
            aside = random.uniform(-0.55, 0.55) * ahead
            forward, right = pose.rotation[2] * (1, 1, 0), pose.rotation[0] * (1, 1, 0)
            xy = (pose.position + forward / np.linalg.norm(forward) * ahead + right * aside)[:2]
            yaw = random.uniform(0, 2 * np.pi)
            if int(world.walkable.class_at(xy)) == 0 and kind.startswith("person"):
                continue
            matrix = np.eye(4)
            matrix[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
            matrix[:3, 3] = *xy, float(world.height(xy))
            placed.append(kind)
            transforms.append(matrix)
    scene.place(placed, np.array(transforms), MOVER + np.arange(len(placed)))
    return scene, len(placed)


def true_cameras(world: World, count: int, seed: int) -> list[Pose]:
    """Where photos are taken: on the streets, looking along them and at the houses beside."""
    random = rng(seed, "cameras")
    spots = viewpoints(world, count=-(-count // 3))
    cameras = []
    for k in range(count):
        spot = spots[k % len(spots)]
        heading = math.degrees(math.atan2(spot.forward[0], spot.forward[1])) + (0.0, 48.0, -48.0)[k // len(spots) % 3]
        xy = np.array(spot.position[:2]) + random.uniform(-1, 1, 2)
        position = np.array([*xy, float(world.height(xy)) + EYE])
        cameras.append(Pose(position, camera_rotation(heading + random.uniform(-8, 8), random.uniform(3, 12))))
    return cameras


def photos_of(take: Photographer, cameras: list[Pose], seed: int) -> tuple[list[StreetImage], list[NDArray[np.bool_]]]:
    """Photos with wrong poses, in other exposures, and where they show cars and people."""
    random = rng(seed, "photos")
    photos, movers = [], []
    lens = pinhole(WIDE, HIGH, 0.72 * WIDE)
    for k, true in enumerate(cameras):
        rgb, _, entity = take(true.position, true.rotation, lens, WIDE, HIGH)
        value = (
            (rgb / 255.0) ** random.uniform(0.85, 1.15) * random.uniform(0.8, 1.2) * random.uniform(0.95, 1.05, 3) * 255
        )
        noisy = np.clip(np.round(value + random.normal(0, 4, rgb.shape)), 0, 255).astype(np.uint8)
        turn = np.radians(random.normal(0, SIGMA_DEGREES, 3))
        wrong = cv2.Rodrigues(turn)[0] @ true.rotation
        position = true.position + random.normal(0, SIGMA_METRES, 3) * (1, 1, 0.3)
        photos.append(StreetImage(f"{k:02d}", noisy, position, wrong, lens, None, "rendered", "the benchmark"))
        movers.append(entity >= MOVER)
    return photos, movers


def psnr(pages: tuple[NDArray[np.uint8], ...], true: tuple[NDArray[np.uint8], ...], where: list[Any]) -> float:
    """Peak signal-to-noise ratio over some texels, dB."""
    errors = [((a[w].astype(np.float64) - b[w]) ** 2) for a, b, w in zip(pages, true, where, strict=True)]
    return float(10 * np.log10(255**2 / np.concatenate(errors).mean()))


def berlin(folder: Path) -> list[str]:
    """Relative rotation and direction among real photos, from matches alone, against OpenSfM's reconstruction."""
    source = FolderImages(folder, longest=1280)
    frame = LocalFrame(52.51896, 13.40038)
    photos = sorted(source.near(frame, 100.0, most=10), key=lambda p: p.id)
    lines = [
        "| photos | matches | agree | rotation off, degrees | direction off, degrees | step, m |",
        "|---|---|---|---|---|---|",
    ]
    for i in range(len(photos)):
        for j in range(i + 1, len(photos)):
            a, b = photos[i], photos[j]
            anywhere = np.full(a.picture.shape[:2], 1e4, np.float32)
            matches = SiftMatcher(ratio=0.8, turn=45.0).match(a.picture, b.picture, anywhere)
            found = relative_pose(matches, a.intrinsics)
            if found is None:
                lines.append(f"| {a.id}, {b.id} | {len(matches)} | none | | | |")
                continue
            turn, direction, agreed = found
            true_turn = b.rotation @ a.rotation.T
            off = np.degrees(np.arccos(np.clip((np.trace(turn @ true_turn.T) - 1) / 2, -1, 1)))
            # Positions in a world file have no height; the step's direction is compared on the ground.
            step = a.rotation.T @ (-turn.T @ direction)
            true_step = b.position - a.position
            cosine = abs(step[:2] @ true_step[:2]) / np.linalg.norm(step[:2]) / np.linalg.norm(true_step[:2])
            lines.append(
                f"| {a.id}, {b.id} | {len(matches)} | {agreed.sum()} | {off:.2f} | "
                f"{np.degrees(np.arccos(min(cosine, 1))):.1f} | {np.linalg.norm(true_step[:2]):.1f} |"
            )
    return lines


def measure(world: World, count: int, seed: int, pictures: Path | None) -> list[str]:
    """Lines of the report on one world."""
    walls, roofs = world.surfaces("buildings"), world.surfaces("roofs")
    new_walls, new_roofs, empty = unwrap(walls, roofs, texel=TEXEL)
    true = true_pages(empty, [*walls, *roofs])
    model = aerial(empty, true, seed)
    ground = world.surfaces("ground")
    solids = [*ground, *walls, *roofs]
    starts = np.cumsum([0, *(len(s.positions) for s in solids)])
    sight = RayCaster(
        np.concatenate([s.positions for s in solids]),
        np.concatenate([s.triangles + k for s, k in zip(solids, starts, strict=False)]),
    )
    cameras = true_cameras(world, count, seed)
    life, movers_placed = street_life(world, cameras, seed)
    photos, movers = photos_of(photographer_of(life, samples=2), cameras, seed)
    plain = World(world.manifest, world.path, layers={
        "ground": _softened(ground), "buildings": with_atlas_pages(new_walls, model),
        "roofs": with_atlas_pages(new_roofs, model),
    })  # fmt: skip
    take = photographer_of(scene_of(plain, rooms=False))
    recorder = _Watched(StreetviewConfig())
    start = time.process_time()
    result, report = reproject(model, photos, take, sight, config=recorder.config, ground=world.height)
    spent = time.process_time() - start
    before = [correction(Pose(p.position, p.rotation), t) for p, t in zip(photos, cameras, strict=True)]
    accepted = [k for k, p in enumerate(report.photos) if p.pose is not None]
    after = {k: correction(report.photos[k].pose, cameras[k]) for k in accepted}  # type: ignore[arg-type]
    better = sum(after[k].norm < before[k].norm for k in accepted)
    changed = [(a != b).any(axis=2) & i for a, b, i in zip(result.pages, model.pages, model.inside, strict=True)]
    lines = [
        f"{world.manifest.name}, {2 * world.half:.0f} m x {2 * world.half:.0f} m, {len(model.charts):,} charts, "
        f"{sum(int(i.sum()) for i in model.inside):,} texels of {TEXEL * 100:.0f} cm; {count} photos of "
        f"{WIDE} x {HIGH} pixels, {movers_placed} cars and people among them; metadata wrong by {SIGMA_METRES:g} m and "
        f"{SIGMA_DEGREES:g} degrees (standard deviation per axis; 0.3 m in height).",
        "",
        "| pose error | median | least | greatest | n |",
        "|---|---|---|---|---|",
        row("position in the metadata, m", [c.shift for c in before], 2),
        row("position after, m", [after[k].shift for k in accepted], 3),
        row("rotation in the metadata, degrees", [c.turn for c in before], 2),
        row("rotation after, degrees", [after[k].turn for k in accepted], 3),
    ]
    five = {k: correction(pose, cameras[k]) for k in accepted if (pose := report.photos[k].five_point_pose) is not None}
    lines += [
        row("position by the five-point method alone, m", [c.shift for c in five.values()], 3),
        row("rotation by the five-point method alone, degrees", [c.turn for c in five.values()], 3),
        row("norm of the correction used, m", [p.moved.norm for p in report.photos if p.pose and p.moved], 2),
        "",
        f"{len(accepted)} of {count} poses accepted, {better} of these nearer to the truth than the metadata; "
        f"{count - len(accepted)} refused.",
        "",
    ]
    lines += [f"- refused {p.id}: {p.reason}" for p in report.photos if not p.used] + [""]
    if any(c.any() for c in changed):
        painted = sum(int(c.sum()) for c in changed)
        lines += [
            "| colours of the painted texels against the true facades | before | after |",
            "|---|---|---|",
            f"| PSNR, dB ({painted:,} texels) | {psnr(model.pages, true, changed):.2f} | "
            f"{psnr(result.pages, true, changed):.2f} |",
            f"| correlation of detail (below 0.5 m) | {_detail(model.pages, true, changed, model):.2f} | "
            f"{_detail(result.pages, true, changed, model):.2f} |",
            "",
        ]
    lines += _movers(recorder.masks, [movers[k] for k in accepted], pictures)
    lines += [f"Processor time: {spent / count:.1f} s a photo, renders and projection included.", ""]
    if pictures is not None:
        _sheet(pictures, world, photos, result, model, new_walls, new_roofs, cameras)
    return lines


class _Watched:
    """The default configuration, with a look at what its detector masks."""

    def __init__(self, config: StreetviewConfig) -> None:
        self.masks: list[tuple[PhotoView, NDArray[np.bool_]]] = []
        self._movers = config.movers
        self.config = replace(config, movers=self)

    def mask(self, view: PhotoView) -> NDArray[np.bool_]:
        assert self._movers is not None
        found = self._movers.mask(view)
        self.masks.append((view, found))
        return found


def _movers(
    masks: list[tuple[PhotoView, NDArray[np.bool_]]], true: list[NDArray[np.bool_]], pictures: Path | None
) -> list[str]:
    caught = missed = false = still = 0
    for k, ((view, found), moving) in enumerate(zip(masks, true, strict=True)):
        size = found.shape[::-1]
        there = cv2.resize(moving.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
        # What counts is what hides walls: a car's wheels on the asphalt do no harm.
        wall = (view.above > 0.3) & (view.depth > 0)
        caught += int((found & there & wall).sum())
        missed += int((~found & there & wall).sum())
        false += int((found & ~there & wall).sum())
        still += int((~there & wall).sum())
        if pictures is not None:
            tinted = view.photo.copy()
            tinted[found] = tinted[found] // 2 + np.array([110, 0, 60], np.uint8)
            pictures.mkdir(parents=True, exist_ok=True)
            Image.fromarray(np.concatenate([tinted, view.render], axis=1)).save(pictures / f"mask {k:02d}.png")
    return [
        f"Cars and people before walls: {caught / max(caught + missed, 1):.0%} of their pixels masked; "
        f"{false / max(still, 1):.1%} of the walls' own pixels masked without need.",
        "",
    ]


def _detail(pages: Any, true: Any, where: list[Any], atlas: Atlas) -> float:
    """Correlation of what is finer than half a metre, over the charts' painted texels."""
    a, b = [], []
    for chart in atlas.charts:
        mask = where[chart.page][chart.box]
        if mask.sum() < 100:
            continue
        pair = []
        for source in (pages, true):
            patch = source[chart.page][chart.box].astype(np.float32).mean(axis=2)
            pair.append((patch - cv2.GaussianBlur(patch, (0, 0), 0.25 / TEXEL))[mask])
        a.append(pair[0])
        b.append(pair[1])
    return float(np.corrcoef(np.concatenate(a), np.concatenate(b))[0, 1])


def _softened(surfaces: list[Surface]) -> list[Surface]:
    """Surfaces whose textures are blurred: the ground of the model has no detail of the true one either."""
    soft = []
    for surface in surfaces:
        texture = surface.material.texture
        if texture is not None:
            wide = np.pad(texture, ((64, 64), (64, 64), (0, 0)), mode="wrap")
            texture = cv2.GaussianBlur(wide, (0, 0), 16)[64:-64, 64:-64]
        soft.append(replace(surface, material=replace(surface.material, texture=texture)))
    return soft


def _sheet(
    folder: Path,
    world: World,
    photos: Any,
    result: Atlas,
    model: Atlas,
    walls: Any,
    roofs: Any,
    cameras: Any,
) -> None:
    """Write a sheet of the model before and after from the first cameras, beside the photos."""
    takes = []
    for atlas in (model, result):
        layers = {
            "ground": world.surfaces("ground"),
            "buildings": with_atlas_pages(walls, atlas),
            "roofs": with_atlas_pages(roofs, atlas),
        }
        takes.append(
            photographer_of(scene_of(World(world.manifest, world.path, layers=layers), rooms=False), samples=2)
        )
    for k in range(0, len(photos), 3):
        lens = photos[k].intrinsics / 2
        lens[2, 2] = 1
        views = [take(cameras[k].position, cameras[k].rotation, lens, WIDE // 2, HIGH // 2)[0] for take in takes]
        photo = cv2.resize(photos[k].picture, (WIDE // 2, HIGH // 2), interpolation=cv2.INTER_AREA)
        Image.fromarray(np.concatenate([photo, *views], axis=1)).save(folder / f"view {k:02d}.png")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--photos", type=int, default=24)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--radius", type=float, default=130.0)
    parser.add_argument("--world", type=Path, help="a world folder; without, the packaged place is built")
    parser.add_argument("--berlin", type=Path, help="the folder of OpenSfM's data/berlin")
    parser.add_argument("--table", type=Path)
    parser.add_argument("--pictures", type=Path)
    given = parser.parse_args()
    lines = [
        "# Street photos: poses mended and walls painted",
        "",
        f"{machine()[:-1]}, OpenCV {cv2.__version__}.",
        "Made by `python benchmarks/streetview.py --berlin FOLDER --table benchmarks/results/streetview.md`.",
        "",
    ]
    if given.world is not None:
        lines += measure(read_world(given.world), given.photos, given.seed, given.pictures)
    else:
        place = packaged_extract()
        with tempfile.TemporaryDirectory(prefix="vico-") as folder:
            out = Path(folder) / place.name
            where = ["--lat", str(place.lat), "--lon", str(place.lon), "--radius", str(given.radius)]
            vico("world", "build", *where, "--out", str(out))
            lines += measure(read_world(out), given.photos, given.seed, given.pictures)
    if given.berlin is not None:
        lines += ["## Three real photos (Berlin, from OpenSfM): the five-point method against their reconstruction", ""]
        lines += [*berlin(given.berlin), ""]
    publish(lines, given.table)


if __name__ == "__main__":
    main()
