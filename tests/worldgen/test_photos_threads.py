from dataclasses import replace

import numpy as np
import pytest

from vico.geo.tiles3d import TileMesh
from vico.seeds import rng
from vico.threads import WORKERS
from vico.world.glb import glb_bytes
from vico.world.mesh import Surface
from vico.worldgen.photos import baking
from vico.worldgen.photos.texturing import Texturing, enhance, keep_photographed_faces, mesh_of, paint_from_tiles
from vico.worldgen.stages import digest_of

pytest.importorskip("embreex", reason="baking casts rays with embreex")

FACES = np.array([(0, 1, 2), (0, 2, 3)])


def houses() -> list[Surface]:
    """Walls of nine houses that look south and east, with a patchwork of colours."""
    surfaces = []
    for k in range(9):
        x, y, high = 30.0 * (k % 3), 30.0 * (k // 3), 6.0 + k
        south = [(x, y, 0), (x + 12, y, 0), (x + 12, y, high), (x, y, high)]
        east = [(x + 12, y, 0), (x + 12, y + 9, 0), (x + 12, y + 9, high), (x + 12, y, high)]
        surfaces += [Surface.from_triangles(np.array(c, np.float64), FACES, entity=9 + k) for c in (south, east)]
    return surfaces


def photographed(walls: list[Surface]) -> TileMesh:
    """The walls as photos show them: noise in the texture, and a hole in every third."""
    mesh = mesh_of(walls)
    grey = rng(0, "photo").integers(60, 220, (128, 128, 1)).astype(np.uint8)  # what is green counts as leaves
    noise = np.repeat(grey, 3, axis=2)
    uv = np.tile(np.array([(0, 1), (1, 1), (1, 0), (0, 1), (1, 0), (0, 0)], np.float32), (len(walls), 1))
    kept = np.arange(len(mesh.triangles)) % 6 != 0
    return replace(
        mesh,
        uv=uv,
        textures=(noise,),
        texture_of=np.zeros(int(kept.sum()), np.int32),
        triangles=mesh.triangles[kept],
    )


@pytest.mark.parametrize("upscale", ["none", "sharpen"])
def test_photos_are_the_same_bytes_however_many_threads_paint_them(
    monkeypatch: pytest.MonkeyPatch, upscale: str
) -> None:
    walls = houses()
    mesh = photographed(walls)
    worlds = []
    for many, batch in (("1", 1 << 17), ("2", 1 << 11), ("5", 1 << 9)):
        monkeypatch.setenv(WORKERS, many)
        monkeypatch.setattr(baking, "_BATCH", batch)
        painted = paint_from_tiles(walls, [], mesh, texel=0.3)
        done = enhance(painted, Texturing(texel=0.3, upscale=upscale))
        assert painted.counts["texels_known"] > 0.7 * painted.counts["texels"]
        assert done.counts["texels_filled"] > 0.05 * painted.counts["texels"]
        assert not np.shares_memory(done.atlas.pages[0], painted.atlas.pages[0])
        worlds.append((painted.counts, done.counts, glb_bytes({"walls": done.surfaces()[0]})))
    assert worlds[0] == worlds[1] == worlds[2]


def test_faces_that_photos_hardly_cover_go_at_once_or_afterwards() -> None:
    walls = houses()
    mesh = photographed(walls)
    later = keep_photographed_faces(walls, [], paint_from_tiles(walls, [], mesh, texel=0.3), least=0.7)
    at_once = paint_from_tiles(walls, [], mesh, texel=0.3, least=0.7)
    assert 0 < len(at_once.atlas.charts) < at_once.counts["charts"]
    assert digest_of(at_once) == digest_of(later)
    assert keep_photographed_faces(walls, [], at_once, least=0.7) is at_once
