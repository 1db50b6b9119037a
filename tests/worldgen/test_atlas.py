from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vico.errors import InputError
from vico.world.glb import read_glb, write_glb
from vico.world.mesh import Material, Surface
from vico.world.world import World
from vico.worldgen.photos.atlas import Atlas, Chart, coverage, repack, texel_centres, unwrap, with_atlas_pages

FACES = np.array([(0, 1, 2), (0, 2, 3)])


def quad(a: tuple[float, ...], right: tuple[float, ...], up: tuple[float, ...], entity: int) -> Surface:
    o, r, u = (np.array(v, np.float64) for v in (a, right, up))
    return Surface.from_triangles(np.array([o, o + r, o + r + u, o + u]), FACES, entity=entity)


def box(width: float, depth: float, height: float, entity: int, x: float = 0.0) -> tuple[list[Surface], list[Surface]]:
    """Four walls and a flat roof, outwards."""
    w, d, h = width, depth, height
    walls = [
        quad((x, 0, 0), (w, 0, 0), (0, 0, h), entity),
        quad((x + w, 0, 0), (0, d, 0), (0, 0, h), entity),
        quad((x + w, d, 0), (-w, 0, 0), (0, 0, h), entity),
        quad((x, d, 0), (0, -d, 0), (0, 0, h), entity),
    ]
    return walls, [quad((x, 0, h), (w, 0, 0), (0, d, 0), entity)]


def placed(surfaces: list[Surface], atlas: Atlas) -> tuple[np.ndarray, np.ndarray]:
    """Distance of each charted vertex from where its texture coordinates say it is, and whether entities agree."""
    away, same = [np.zeros(0)], [np.zeros(0, bool)]
    for surface in surfaces:
        if not surface.material.name.startswith("atlas_"):
            continue
        page = int(surface.material.name.removeprefix("atlas_"))
        height, width = atlas.pages[page].shape[:2]
        owner = np.full((height, width), -1)
        for k, chart in enumerate(atlas.charts):
            if chart.page == page:
                assert (owner[chart.box] == -1).all(), "charts overlap"
                owner[chart.y - 1 : chart.y + chart.height + 1, chart.x - 1 : chart.x + chart.width + 1] = k
        pixel = surface.uv.astype(float) * (width, height)
        column, row = np.floor(pixel + 1e-3).astype(int).T
        charts = [atlas.charts[k] for k in owner[row, column]]
        points = np.array(
            [c.origin + (p[0] - c.x) * c.right + (p[1] - c.y) * c.up for c, p in zip(charts, pixel, strict=True)]
        )
        away.append(np.linalg.norm(points - surface.positions, axis=1))
        same.append(np.array([c.entity for c in charts]) == surface.entity)
    return np.concatenate(away), np.concatenate(same)


def test_every_face_of_a_box_has_an_upright_chart() -> None:
    walls, roofs, atlas = unwrap(*box(6, 4, 3, 7), texel=0.1, page=256)
    assert len(atlas.charts) == 5 == atlas.pieces
    away, same = placed([*walls, *roofs], atlas)
    assert len(away) == 30
    assert away.max() < 1e-4
    assert same.all()
    for chart in atlas.charts:
        np.testing.assert_allclose(np.cross(chart.right, chart.up), chart.normal * 0.01, atol=1e-9)
        if abs(chart.normal[2]) < 0.5:
            assert chart.up[2] == pytest.approx(0.1)
    assert sum(int(inside.sum()) for inside in atlas.inside) == 2 * 60 * 30 + 2 * 40 * 30 + 60 * 40
    chart = next(chart for chart in atlas.charts if chart.normal[1] < -0.5)
    centres = texel_centres(chart, np.array([0, 59]), np.array([0, 29]))
    np.testing.assert_allclose(centres, [(0.05, 0, 0.05), (5.95, 0, 2.95)], atol=1e-6)


@settings(max_examples=15, deadline=None)
@given(st.lists(st.tuples(*[st.floats(1.2, 40)] * 3), min_size=1, max_size=6), st.sampled_from([0.1, 0.25, 1.0]))
def test_boxes_of_any_size_are_packed_without_overlap(sizes: list[tuple[float, float, float]], texel: float) -> None:
    walls, roofs = [], []
    for k, size in enumerate(sizes):
        more = box(*size, entity=k + 1, x=50.0 * k)
        walls += more[0]
        roofs += more[1]
    new_walls, new_roofs, atlas = unwrap(walls, roofs, texel=texel, page=256)
    away, same = placed([*new_walls, *new_roofs], atlas)
    assert len(atlas.charts) == 5 * len(sizes)
    assert away.max() < 1e-3
    assert same.all()


def test_the_charts_of_helsinki_hold_its_faces(helsinki: World) -> None:
    walls, roofs = helsinki.surfaces("buildings"), helsinki.surfaces("roofs")
    new_walls, new_roofs, atlas = unwrap(walls, roofs, texel=0.5, page=1024)
    away, same = placed([*new_walls, *new_roofs], atlas)
    assert away.max() < 0.11, "bent pieces stay within 0.1 m of their plane"
    assert same.all()
    for old, new in ((walls, new_walls), (roofs, new_roofs)):
        assert sum(len(s.triangles) for s in old) == sum(len(s.triangles) for s in new)
    again = unwrap(walls, roofs, texel=0.5, page=1024)
    for a, b in zip((*new_walls, *new_roofs), (*again[0], *again[1]), strict=True):
        assert a.uv.tobytes() == b.uv.tobytes()


def test_charts_without_photos_go_and_the_others_keep_their_texels() -> None:
    walls, roofs = box(6, 4, 3, 7)
    atlas = unwrap(walls, roofs, texel=0.1, page=256)[2]
    painted = atlas.charts[1]
    atlas.pages[painted.page][painted.box] = (10, 200, 30)
    atlas.known[painted.page][painted.box] = atlas.inside[painted.page][painted.box]
    assert coverage(atlas).tolist() == [0, 1, 0, 0, 0]
    new_walls, new_roofs, small = repack(walls, roofs, atlas, least=0.5)
    assert [chart.patch for chart in small.charts] == [painted.patch]
    chart = small.charts[0]
    assert (small.pages[chart.page][chart.box] == (10, 200, 30)).all()
    assert small.known[chart.page][chart.box].all()
    assert [s.material.name for s in (*new_walls, *new_roofs)].count("atlas_0") == 1


def test_pages_are_kept_as_jpeg_and_come_back_as_photos(tmp_path: Path) -> None:
    walls, roofs, atlas = unwrap(*box(6, 4, 3, 7), texel=0.1, page=256)
    for page in atlas.pages:
        page[:] = np.linspace(40, 220, page.shape[1]).astype(np.uint8)[None, :, None]
    layers = {"buildings": with_atlas_pages(walls, atlas), "roofs": with_atlas_pages(roofs, atlas)}
    write_glb(tmp_path / "a.glb", layers)
    assert b"image/jpeg" in (tmp_path / "a.glb").read_bytes()
    back = read_glb(tmp_path / "a.glb")
    assert {s.material.photo for layer in back.values() for s in layer} == {True}
    # Walls and roofs are written to files of their own: a page that both shared would be in both.
    assert not {s.material.name for s in back["buildings"]} & {s.material.name for s in back["roofs"]}
    texture = back["buildings"][0].material.texture
    assert texture is not None
    assert texture.shape == atlas.pages[0].shape
    assert np.abs(texture.astype(int) - atlas.pages[0]).max() <= 4
    assert (back["buildings"][0].colour == 255).all()
    assert back["roofs"][0].entity.tolist() == [7] * 6


def test_holes_mouldings_and_undersides_stay_as_they_are() -> None:
    fence = quad((0, 0, 0), (5, 0, 0), (0, 0, 2), 3)
    fence = Surface(**{**vars(fence), "material": Material("fence", cutout=True)})
    rim = quad((0, 0, 5), (20, 0, 0), (0, 0, 0.2), 3)
    floor = quad((0, 0, 0), (0, 5, 0), (5, 0, 0), 3)
    walls, _, atlas = unwrap([fence, rim, floor], [], page=256)
    assert atlas.charts == ()
    assert atlas.pages == ()
    assert [s.material.name for s in walls] == ["fence", "plain", "plain"]


def test_wrong_arguments_are_refused() -> None:
    with pytest.raises(InputError, match="power of two"):
        unwrap([], [], page=1000)
    with pytest.raises(InputError, match="texel"):
        unwrap([], [], texel=0.0)
    walls, roofs = box(6, 4, 3, 7)
    with pytest.raises(InputError, match="3 pieces"):
        unwrap(walls, roofs, wanted=np.ones(3, bool))
    assert isinstance(unwrap(walls, roofs, page=256)[2].charts[0], Chart)
