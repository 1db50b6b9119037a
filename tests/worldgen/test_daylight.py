"""The sun in photos of walls."""

import numpy as np
import pytest

from vico.world.mesh import Surface
from vico.worldgen.facts.ray_casting import RayCaster
from vico.worldgen.photos.atlas import Atlas, unwrap
from vico.worldgen.photos.enhancement import find_sun, remove_sunlight
from vico.worldgen.photos.streetview.projection import texel_centres

SUN = np.array([np.sin(np.radians(140)), np.cos(np.radians(140)), 1.0]) / np.sqrt(2)


def block(x: float, y: float, height: float, entity: int) -> list[Surface]:
    """Four walls of 20 m; a rectangle of two triangles each."""
    ring = np.array([[0, 0], [20, 0], [20, 20], [0, 20]], float) + np.array([x, y])
    walls = []
    for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        points = np.array([[*a, 0], [*b, 0], [*b, height], [*a, height]])
        triangles = np.array([[0, 1, 2], [0, 2, 3]])
        walls.append(Surface.from_triangles(points, triangles, entity=entity))
    return walls


@pytest.fixture(scope="module")
def city() -> tuple[Atlas, RayCaster]:
    """Nine blocks of different grey without any light in it, all of it photographed."""
    pytest.importorskip("embreex", reason="casts rays")
    surfaces = [s for k in range(9) for s in block(32.0 * (k % 3), 32.0 * (k // 3), 12.0 + 4 * (k % 4), entity=100 + k)]
    atlas = unwrap(surfaces, [], texel=0.5, page=512)[2]
    pages = [page.copy() for page in atlas.pages]
    for chart in atlas.charts:
        pages[chart.page][chart.box] = 90 + 8 * (chart.entity - 100)
    corners = np.concatenate([s.positions[s.triangles] for s in surfaces]).reshape(-1, 3)
    sight = RayCaster(corners, np.arange(len(corners)).reshape(-1, 3))
    return Atlas(tuple(pages), atlas.inside, atlas.inside, atlas.charts, atlas.texel, atlas.pieces), sight


def sunny(atlas: Atlas, sight: RayCaster) -> Atlas:
    """The same in the light of a sun as strong as the sky, shadows and all."""
    pages = [page.copy() for page in atlas.pages]
    for chart in atlas.charts:
        points = texel_centres(chart, slice(None), slice(None)).reshape(-1, 3)
        cosine = max(float(chart.normal @ SUN), 0.0)
        free = sight.first(points + 0.05 * chart.normal, np.tile(SUN, (len(points), 1))).triangle < 0
        light = (0.55 * (1 + 1.0 * cosine * free)).reshape(chart.height, chart.width, 1)
        pages[chart.page][chart.box] = np.round(pages[chart.page][chart.box] * light).astype(np.uint8)
    return Atlas(tuple(pages), atlas.inside, atlas.known, atlas.charts, atlas.texel, atlas.pieces)


def test_the_sun_is_where_it_was_and_its_shadows_go(city: tuple[Atlas, RayCaster]) -> None:
    atlas, sight = city
    photos = sunny(atlas, sight)
    sun = find_sun(photos, sight)
    assert sun is not None
    assert float(sun.direction @ SUN) > np.cos(np.radians(8))
    assert sun.strength == pytest.approx(1.0, abs=0.15)
    mended = remove_sunlight(photos, sun, sight)
    full = 0.55 * (1 + np.hypot(*SUN[:2]))

    def error(pages: Atlas) -> float:
        there = [
            (a.astype(float) - full * b)[i] for a, b, i in zip(pages.pages, atlas.pages, atlas.inside, strict=True)
        ]
        return float(np.abs(np.concatenate(there)).mean())

    assert error(mended) < 0.25 * error(photos)


def test_under_clouds_there_is_no_sun(city: tuple[Atlas, RayCaster]) -> None:
    atlas, sight = city
    random = np.random.default_rng(1)
    pages = tuple(np.clip(p * 0.7 + random.normal(0, 6, p.shape), 0, 255).astype(np.uint8) for p in atlas.pages)
    assert find_sun(Atlas(pages, atlas.inside, atlas.known, atlas.charts, atlas.texel, atlas.pieces), sight) is None
