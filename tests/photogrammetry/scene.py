"""A known world as an aircraft's cameras see it: every triangle with its colours, as one thing to cast rays at."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.assets.vehicles import vehicle_prototypes
from vico.seeds import rng
from vico.world.mesh import Surface
from vico.world.world import World
from vico.worldgen.facts.ray_casting import RayCaster, RayHits

GROUND, BUILDING, THING = 0, 1, 2

_LEAST_WIDTH = 0.9  # metres; thinner things (lamps, signs) are lost between the pixels of an aerial photo
_CARS = ("sedan", "hatchback", "suv", "van", "taxi")


@dataclass(frozen=True)
class Seen:
    """Triangles with colours.

    Attributes
    ----------
    sight
        To cast rays at them.
    normal
        Of each triangle, shape ``(m, 3)``.
    kind
        `GROUND`, `BUILDING` or `THING`, shape ``(m,)``.
    """

    sight: RayCaster
    normal: NDArray[np.float32]
    kind: NDArray[np.uint8]
    _uv: NDArray[np.float32]
    _colour: NDArray[np.float32]
    _picture: NDArray[np.int32]
    _pictures: tuple[NDArray[np.uint8], ...]

    def colours(self, hits: RayHits) -> NDArray[np.float32]:
        """Return the colours at what rays met, sRGB 0..1, shape ``(n, 3)``; zeros where they met nothing."""
        out = np.zeros((len(hits.triangle), 3), np.float32)
        met = np.flatnonzero(hits.triangle >= 0)
        triangle = hits.triangle[met]
        v, w = hits.u[met, None], hits.v[met, None]
        u = 1.0 - v - w
        tint = self._colour[triangle]
        shade = tint[:, 0] * u + tint[:, 1] * v + tint[:, 2] * w
        corner = self._uv[triangle]
        place = corner[:, 0] * u + corner[:, 1] * v + corner[:, 2] * w
        picture = self._picture[triangle]
        order = np.argsort(picture, kind="stable")
        bounds = np.searchsorted(picture[order], np.arange(len(self._pictures) + 1))
        for k, texels in enumerate(self._pictures):
            mine = order[bounds[k] : bounds[k + 1]]
            if not len(mine):
                continue
            h, w_ = texels.shape[:2]
            spot = place[mine] - np.floor(place[mine])
            x = np.minimum((spot[:, 0] * w_).astype(np.int32), w_ - 1)
            y = np.minimum((spot[:, 1] * h).astype(np.int32), h - 1)
            shade[mine] *= texels[y, x].astype(np.float32) / 255.0
        out[met] = shade
        return out


def seen_world(
    world: World, *, seed: int, texel: float, height_error: float, shift: float, cars: float, reach: float
) -> Seen:
    """Gather what an aircraft sees of a world.

    Parameters
    ----------
    world
        The known world.
    seed
        Decides how far each building is off, and where cars stand.
    texel
        Metres a pixel of the aerial photos: textures are seen no finer.
    height_error, shift
        How far a building's top and place are off the known ones at most, metres.
    cars
        Share of the parking lots along the kerbs that are taken.
    reach
        Half the side of the square that cars are parked in, metres.
    """
    base = {b.entity: b.base for b in world.buildings}
    layers: list[tuple[int, Surface]] = [(GROUND, s) for s in world.surfaces("ground")]
    offsets = {
        b.entity: rng(seed, "building", b.id).uniform(-1.0, 1.0, 3) * (shift, shift, height_error)
        for b in world.buildings
    }
    for layer in ("buildings", "roofs"):
        layers += [(BUILDING, _displaced(s, offsets, base)) for s in world.surfaces(layer)]
    layers += [(THING, s) for s in _things(world)]
    layers += [(THING, s) for s in _parked(world, seed, cars, reach)]
    layers = [(kind, s) for kind, s in layers if len(s.triangles)]
    positions, triangles, count = [], [], 0
    for _, surface in layers:
        positions.append(surface.positions.astype(np.float64))
        triangles.append(surface.triangles.astype(np.int64) + count)
        count += len(surface.positions)
    points, faces = np.concatenate(positions), np.concatenate(triangles)
    corner = points[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    numbers: dict[str, int] = {}
    pictures: list[NDArray[np.uint8]] = []
    which = []
    for _, surface in layers:
        name = surface.material.name
        if surface.material.texture is not None and name not in numbers:
            numbers[name] = len(pictures)
            pictures.append(_as_seen(surface, texel))
        which.append(np.full(len(surface.triangles), numbers.get(name, -1), np.int32))
    return Seen(
        RayCaster(points, faces),
        normal.astype(np.float32),
        np.concatenate([np.full(len(s.triangles), kind, np.uint8) for kind, s in layers]),
        np.concatenate([s.uv[s.triangles] for _, s in layers]),
        np.concatenate([s.colour[s.triangles].astype(np.float32) / 255.0 for _, s in layers]),
        np.concatenate(which),
        tuple(pictures),
    )


def _displaced(surface: Surface, offsets: dict[int, NDArray[np.float64]], base: dict[int, float]) -> Surface:
    """Move buildings a little off, as a whole, and stretched above their ground floor."""
    points = surface.positions.astype(np.float64)
    top = int(surface.entity.max(initial=0)) + 1
    by = np.zeros((top, 3))
    floor = np.full(top, np.inf)
    for entity, offset in offsets.items():
        if entity < top:
            by[entity], floor[entity] = offset, base[entity]
    move = by[surface.entity]
    high = points[:, 2] > floor[surface.entity] + 2.5
    points[:, :2] += move[:, :2]
    points[:, 2] += np.where(high, move[:, 2], 0.0)
    return replace(surface, positions=points.astype(np.float32))


def _things(world: World) -> list[Surface]:
    """Trees and whatever else outdoors is wide enough to be seen."""
    objects = world.objects
    wide = np.minimum(objects.size_x, objects.size_y) >= _LEAST_WIDTH
    outdoors = np.flatnonzero((objects.room == "") & wide)
    models = world.prototypes()
    transforms = objects.transforms()
    return [
        surface.moved(transforms[k]) for k in outdoors.tolist() for surface in models.get(str(objects.prototype[k]), [])
    ]


def _parked(world: World, seed: int, share: float, reach: float) -> list[Surface]:
    """Cars at the kerbs."""
    models = vehicle_prototypes()
    names = sorted(name for name in models if name.split("_")[0] in _CARS)
    found: list[Surface] = []
    for road in world.roads.roads:
        if road.kind not in ("residential", "unclassified", "tertiary", "living_street", "secondary") or road.layer:
            continue
        random = rng(seed, "cars", road.id)
        line = np.asarray(road.line, np.float64)
        length = np.hypot(*np.diff(line, axis=0).T)
        along = np.concatenate([[0.0], np.cumsum(length)])
        for side in (-1.0, 1.0):
            for place in np.arange(7.0, along[-1] - 7.0, 5.6).tolist():
                taken, pick, wobble = random.random(3)
                if taken > share:
                    continue
                k = min(int(np.searchsorted(along, place, "right")) - 1, len(length) - 1)
                ahead = (line[k + 1] - line[k]) / max(length[k], 1e-9)
                name = names[int(pick * len(names))]
                out = side * (road.width / 2 - 1.1)
                spot = line[k] + ahead * (place - along[k] + wobble) + out * np.array([ahead[1], -ahead[0]])
                if np.abs(spot).max() > reach:
                    continue
                yaw = math.atan2(ahead[1], ahead[0])
                c, s = math.cos(yaw), math.sin(yaw)
                matrix = np.array(
                    [[c, -s, 0, spot[0]], [s, c, 0, spot[1]], [0, 0, 1, float(world.height(spot))], [0, 0, 0, 1]]
                )
                found += [surface.moved(matrix) for surface in models[name]]
    return found


def _as_seen(surface: Surface, texel: float) -> NDArray[np.uint8]:
    """Return a material's texture no finer than the aerial photo, and whole where leaves have holes."""
    texture = surface.material.texture
    assert texture is not None
    colours = texture[..., :3].astype(np.float32)
    if surface.material.cutout and texture.shape[2] == 4:  # elsewhere alpha is what shines at night
        solid = texture[..., 3:] >= 128
        mean = colours[solid[..., 0]].mean(axis=0) if solid.any() else np.full(3, 128.0)
        colours = np.where(solid, colours, mean)
    faces = surface.triangles[:: max(len(surface.triangles) // 500, 1)]
    p, t = surface.positions[faces].astype(np.float64), surface.uv[faces].astype(np.float64)
    metres = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
    a, b = t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]
    texels = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) * texture.shape[0] * texture.shape[1]
    good = (metres > 1e-6) & (texels > 1e-6)
    finer = math.sqrt(float(np.median(texels[good] / metres[good]))) * texel if good.any() else 1.0
    picture = Image.fromarray(np.round(colours).astype(np.uint8))
    if finer > 1.2:
        size = (max(round(picture.width / finer), 1), max(round(picture.height / finer), 1))
        picture = picture.resize(size, Image.Resampling.BOX)
    return np.asarray(picture)
