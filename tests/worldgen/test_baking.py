from dataclasses import replace

import numpy as np
import pytest

from vico.errors import EmptyInputError, InputError
from vico.geo.tiles3d import TileMesh
from vico.world.mesh import Surface
from vico.worldgen.photos.baking import BakeResult, bake

pytest.importorskip("embreex", reason="baking casts rays with embreex")

FACES = np.array([(0, 1, 2), (0, 2, 3)])


def wall(x: float = 0.0, y: float = 0.0, entity: int = 5) -> Surface:
    """A wall of 12 m x 8 m that looks south."""
    corners = np.array([(x, y, 0), (x + 12, y, 0), (x + 12, y, 8), (x, y, 8)], np.float64)
    return Surface.from_triangles(corners, FACES, entity=entity)


def picture() -> np.ndarray:
    """Columns turn blue eastwards, rows redden upwards (row 0 is at the top of the photo, v = 0)."""
    photo = np.zeros((64, 96, 3), np.uint8)
    photo[..., 2] = np.linspace(60, 200, 96).astype(np.uint8)
    photo[..., 0] = np.linspace(220, 100, 64).astype(np.uint8)[:, None]
    photo[..., 1] = 90
    return photo


def photographed(y: float, photo: np.ndarray | None = None, x: float = 0.0) -> TileMesh:
    corners = np.array([(x, y, 0), (x + 12, y, 0), (x + 12, y, 8), (x, y, 8)], np.float64)
    uv = np.array([(0, 1), (1, 1), (1, 0), (0, 0)], np.float32)
    colour = np.full((4, 3), 255, np.uint8)
    return TileMesh(
        corners, FACES.astype(np.int32), uv, np.zeros(2, np.int32), (picture() if photo is None else photo,), colour
    )


def with_box(mesh: TileMesh, low: tuple[float, ...], high: tuple[float, ...], rgb: tuple[int, int, int]) -> TileMesh:
    """Put a plain-coloured panel that looks south in front of it."""
    corners = np.array([low, (high[0], low[1], low[2]), high, (low[0], low[1], high[2])], np.float64)
    return replace(
        mesh,
        positions=np.concatenate([mesh.positions, corners]),
        triangles=np.concatenate([mesh.triangles, FACES.astype(np.int32) + 4]),
        uv=np.concatenate([mesh.uv, np.zeros((4, 2), np.float32)]),
        texture_of=np.concatenate([mesh.texture_of, np.full(2, -1, np.int32)]),
        colour=np.concatenate([mesh.colour, np.broadcast_to(np.uint8(rgb), (4, 3))]),
    )


def painted(baked: BakeResult) -> tuple[np.ndarray, np.ndarray]:
    """The one chart's colours and known texels, foot of the wall first."""
    (chart,) = baked.atlas.charts
    return baked.atlas.pages[chart.page][chart.box], baked.atlas.known[chart.page][chart.box]


@pytest.mark.parametrize("offset", [0.0, -1.2, 0.9])
def test_a_wall_shows_its_photo_upright_and_not_mirrored(offset: float) -> None:
    baked = bake([wall()], [], photographed(offset), texel=0.125, page=256)
    colours, known = painted(baked)
    assert colours.shape == (64, 96, 3)
    assert known[1:-1, 1:-1].all()
    expected = picture()[::-1].astype(int)  # charts begin at the wall's foot, photos at its top
    assert np.abs(colours[2:-2, 2:-2].astype(int) - expected[2:-2, 2:-2]).max() <= 3
    assert baked.coverage[5] > 0.97
    assert {s.material.name for s in baked.walls} == {"atlas_0"}


def test_what_stands_beyond_the_cage_or_looks_away_paints_nothing() -> None:
    far = bake([wall()], [], photographed(-3.5), page=256)
    assert far.atlas.charts == ()
    assert far.coverage == {5: 0.0}
    assert [s.material.name for s in far.walls] == ["plain"]
    mesh = photographed(0.0)
    back = bake([wall()], [], replace(mesh, triangles=mesh.triangles[:, ::-1].copy()), page=256)
    assert back.atlas.charts == ()


def test_half_covered_walls_stay_procedural_where_asked() -> None:
    mesh = photographed(0.0, x=8.0)  # reaches over the eastern third
    assert bake([wall()], [], mesh, least=0.5, page=256).atlas.charts == ()
    baked = bake([wall()], [], mesh, least=0.2, texel=0.125, page=256)
    known = painted(baked)[1]
    assert known[:, 66:].mean() > 0.97
    assert not known[:, :62].any()
    assert baked.coverage[5] == pytest.approx(1 / 3, abs=0.02)


def test_the_wall_behind_a_tree_is_found_and_leaves_melted_into_it_are_not_kept() -> None:
    tree = with_box(photographed(0.0), (4.0, -1.5, 1.0), (6.0, -1.5, 5.0), (50, 100, 40))
    colours, known = painted(bake([wall()], [], tree, texel=0.125, page=256))
    assert known[1:-1, 1:-1].all()
    assert np.abs(colours[2:-2, 2:-2].astype(int) - picture()[::-1][2:-2, 2:-2]).max() <= 3
    photo = picture()
    photo[20:40, 30:50] = (50, 100, 40)  # rows from the top
    known = painted(bake([wall()], [], photographed(0.0, photo), texel=0.125, page=256))[1]
    assert not known[25:43, 31:49].any()
    assert known[50:63, 1:-1].all()


def test_a_car_before_a_hole_in_the_photograph_is_no_wall() -> None:
    mesh = photographed(0.0)
    upper = mesh.positions.copy()
    upper[:2, 2] = 2.0  # nothing was seen below 2 m
    mesh = with_box(replace(mesh, positions=upper), (3.0, -1.2, 0.1), (7.0, -1.2, 1.6), (180, 30, 30))
    colours, known = painted(bake([wall()], [], mesh, texel=0.125, page=256))
    assert not known[:15].any()
    assert known[17:-1, 1:-1].all()
    assert not (colours[known] == (180, 30, 30)).all(axis=1).any()


@pytest.mark.parametrize("reach", [0.5, 1.2])
def test_a_foot_rounded_off_into_the_ground_does_not_paint_the_wall(reach: float) -> None:
    mesh = photographed(0.0)
    upper = mesh.positions.copy()
    upper[:2, 2] = 1.0
    ground = (230, 90, 40)
    slope = with_box(replace(mesh, positions=upper), (0.0, -reach, 0.0), (12.0, -reach, 1.0), ground)
    corners = slope.positions.copy()
    corners[6:, 1] = 0.0  # the panel leans on the wall
    colours, known = painted(bake([wall()], [], replace(slope, positions=corners), texel=0.125, page=256))
    assert known[9:-1, 1:-1].all()
    assert not known[:7].any()
    assert not (colours[known] == ground).all(axis=1).any()


def test_a_steep_slope_keeps_its_foot() -> None:
    def leaning(points: np.ndarray) -> np.ndarray:
        return points + points[:, 2:] * (0.0, 0.5, 0.0)  # 27 degrees: it looks up more than a rounded foot does

    upright = wall()
    slope = Surface.from_triangles(leaning(upright.positions.astype(np.float64)), upright.triangles, entity=5)
    mesh = photographed(0.0)
    _, known = painted(bake([slope], [], replace(mesh, positions=leaning(mesh.positions)), texel=0.125, page=256))
    assert known[1:-1, 1:-1].all()


def test_an_edge_rounded_off_is_forgotten_but_a_roof_where_the_map_has_a_wall_is_not() -> None:
    mesh = photographed(0.0)
    lower = mesh.positions.copy()
    lower[2:, 2] = 3.0  # the wall ends at 3 m,
    roof = (150, 40, 30)
    sloped = with_box(replace(mesh, positions=lower), (0.0, 0.0, 3.0), (12.0, 0.0, 8.0), roof)
    corners = sloped.positions.copy()
    corners[6:, 1] = 5.0  # and a roof of 45 degrees begins
    colours, known = painted(bake([wall()], [], replace(sloped, positions=corners), texel=0.125, page=256))
    rows = np.arange(64) * 0.125
    assert known[rows < 2.8][1:, 1:-1].all()
    assert not known[(rows > 3.1) & (rows < 4.0)].any()
    kept = (rows > 4.4) & (rows < 4.8)
    assert known[kept][:, 1:-1].all()
    assert (colours[kept][:, 1:-1] == roof).all()
    assert not known[rows > 5.1].any()  # beyond the cage


def test_equal_inputs_give_equal_bytes_and_entities_stay_apart() -> None:
    mesh = photographed(0.0)
    first, second = (bake([wall(), wall(y=-30, entity=6)], [], mesh, page=256) for _ in range(2))
    assert [p.tobytes() for p in first.atlas.pages] == [p.tobytes() for p in second.atlas.pages]
    assert first.coverage == second.coverage
    assert first.coverage[6] == 0.0
    charted = [s for s in first.walls if s.material.name == "atlas_0"]
    assert {int(e) for s in charted for e in s.entity} == {5}


def test_wrong_arguments_are_refused() -> None:
    with pytest.raises(InputError, match="cage"):
        bake([wall()], [], photographed(0.0), cage=0.0)
    empty = replace(photographed(0.0), triangles=np.zeros((0, 3), np.int32), texture_of=np.zeros(0, np.int32))
    with pytest.raises(EmptyInputError, match="tile mesh"):
        bake([wall()], [], empty)
