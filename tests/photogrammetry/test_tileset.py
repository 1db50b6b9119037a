"""Tilesets that are written: they read back as what they were, fine and coarse."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from photogrammetry.tileset import leaf_cells, write_tileset
from vico.errors import EmptyInputError, InputError, MissingExtraError, OutputExistsError
from vico.geo.frame import LocalFrame
from vico.geo.tiles3d import TileMesh, read_tileset

FRAME = LocalFrame(43.73384, 7.41813)


def hilly(n: int = 41, reach: float = 100.0) -> TileMesh:
    """Return a hill with a picture of its own coordinates on it, and one red triangle without."""
    side = np.linspace(-reach, reach, n)
    x, y = np.meshgrid(side, side)
    z = 60.0 + 12.0 * np.exp(-(x**2 + y**2) / 50**2)
    points = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    a = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate([np.stack([a, a + 1, a + n + 1], 1), np.stack([a, a + n + 1, a + n], 1)])
    uv = np.stack([(x.ravel() + reach) / (2 * reach), (reach - y.ravel()) / (2 * reach)], axis=1)
    ramp = np.arange(256, dtype=np.uint8)
    picture = np.stack(
        [np.tile(ramp, (256, 1)), np.tile(ramp[::-1, None], (1, 256)), np.full((256, 256), 90, np.uint8)], -1
    )
    extra = np.array([[10.0, 10.0, 90.0], [20.0, 10.0, 90.0], [10.0, 20.0, 90.0]])
    return TileMesh(
        np.concatenate([points, extra]),
        np.concatenate([faces, [[len(points), len(points) + 1, len(points) + 2]]]).astype(np.int32),
        np.concatenate([uv, np.zeros((3, 2))]).astype(np.float32),
        np.concatenate([np.zeros(len(faces)), [-1]]).astype(np.int32),
        (picture,),
        np.concatenate([np.full((len(points), 3), 255), np.full((3, 3), (200, 30, 40))]).astype(np.uint8),
        ("© the maker", "another"),
    )


def corners(mesh: TileMesh) -> np.ndarray:
    """All triangles by their middles, in an order of their own."""
    middle = mesh.positions[mesh.triangles].mean(axis=1)
    return middle[np.lexsort(np.round(middle, 1).T)]


@pytest.mark.parametrize("draco", [True, False])
def test_a_tileset_reads_back_as_it_was(tmp_path: Path, draco: bool) -> None:
    if draco:
        pytest.importorskip("DracoPy", reason="Draco is an extra")
    mesh = hilly()
    assert write_tileset(mesh, FRAME, tmp_path / "t", draco=draco) == 21
    back, report = read_tileset(tmp_path / "t", FRAME, 150.0, error=0.0)
    assert (report.read, report.left_out) == (16, ())
    assert back.attributions == mesh.attributions
    assert len(back.triangles) == len(mesh.triangles)
    # 16 bits of a tile's 60 m: a millimetre; and a tenth of one from float32 without Draco.
    assert np.abs(np.sort(corners(back), axis=0) - np.sort(corners(mesh), axis=0)).max() < (4e-3 if draco else 2e-4)
    untextured = back.texture_of < 0
    assert untextured.sum() == 1
    assert np.abs(back.colour[back.triangles[untextured]].astype(int) - (200, 30, 40)).max() <= 1
    # The picture tells where it should lie: red grows eastward, green northward, 255 over the whole hill.
    for k, picture in enumerate(back.textures):
        used = np.unique(back.triangles[back.texture_of == k])
        h, w = picture.shape[:2]
        x = np.minimum((back.uv[used, 0] * w).astype(int), w - 1)
        y = np.minimum((back.uv[used, 1] * h).astype(int), h - 1)
        seen = picture[y, x].astype(float)
        wanted = (back.positions[used, :2] + 100.0) / 200.0 * 255
        assert np.abs(seen[:, :2] - wanted).max() < 9.0  # JPEG and half a texel


def test_coarser_levels_hold_fewer_triangles_and_smaller_pictures(tmp_path: Path) -> None:
    write_tileset(hilly(), FRAME, tmp_path / "t", detail=6.0, draco=False)
    sizes = []
    for error in (0.0, 6.0, 12.0):
        mesh, report = read_tileset(tmp_path / "t", FRAME, 150.0, error=error)
        sizes.append((report.read, len(mesh.triangles), sum(p.size for p in mesh.textures)))
        assert np.abs(mesh.positions[:, :2]).max() < 101.0 + error
    assert [s[0] for s in sizes] == [16, 4, 1]
    assert sizes[0][1] > sizes[1][1] > sizes[2][1] > 50
    assert sizes[0][2] > 2 * sizes[1][2] > 4 * sizes[2][2]


def test_neighbour_tiles_meet_without_a_gap_after_welding(tmp_path: Path) -> None:
    pytest.importorskip("DracoPy", reason="Draco is an extra")
    mesh = replace(hilly(), texture_of=np.full(len(hilly().triangles), -1, np.int32), textures=())
    write_tileset(mesh, FRAME, tmp_path / "t")
    back, _ = read_tileset(tmp_path / "t", FRAME, 150.0, error=0.0)
    edges = np.sort(
        np.unique(np.round(back.positions, 6), axis=0, return_inverse=True)[1]
        .ravel()[back.triangles][:, [[0, 1], [1, 2], [2, 0]]]
        .reshape(-1, 2),
        axis=1,
    )
    _, times = np.unique(edges, axis=0, return_counts=True)
    # Open are only the hill's own rim, 4 x 40 edges, and the loose triangle's three.
    assert (times == 1).sum() == 163


def test_the_same_mesh_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_tileset(hilly(), FRAME, tmp_path / name, draco=False, levels=2)
    files = sorted(p.relative_to(tmp_path / "a") for p in (tmp_path / "a").rglob("*.*"))
    assert len(files) == 6
    assert all((tmp_path / "a" / f).read_bytes() == (tmp_path / "b" / f).read_bytes() for f in files)


def test_regions_hold_what_lies_in_them(tmp_path: Path) -> None:
    write_tileset(hilly(), FRAME, tmp_path / "t", draco=False)
    root = json.loads((tmp_path / "t" / "tileset.json").read_text())["root"]
    lat, lon = FRAME.to_geodetic(hilly().positions[:, :2])
    west, south, east, north, low, high = root["boundingVolume"]["region"]
    assert west < np.radians(lon.min()) < np.radians(lon.max()) < east
    assert south < np.radians(lat.min()) < np.radians(lat.max()) < north
    assert low < 60.0 < 90.0 < high
    assert len(root["children"]) == 4


def test_leaves_divide_the_square_evenly() -> None:
    mesh = hilly()
    cells = leaf_cells(mesh.positions, mesh.triangles, 3)
    _, counts = np.unique(cells, axis=0, return_counts=True)
    assert len(counts) == 16
    assert counts.max() - counts.min() <= 2


def test_without_dracopy_both_ways_say_what_to_type(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("DracoPy", reason="Draco is an extra")
    write_tileset(hilly(5), FRAME, tmp_path / "t")
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'virtual-community\[photos\]'"):
        read_tileset(tmp_path / "t", FRAME, 150.0)
    with pytest.raises(MissingExtraError, match=r"pip install 'virtual-community\[photos\]'"):
        write_tileset(hilly(5), FRAME, tmp_path / "u")


def test_what_can_not_be_written_says_so(tmp_path: Path) -> None:
    mesh = hilly()
    with pytest.raises(InputError, match="9 levels"):
        write_tileset(mesh, FRAME, tmp_path / "t", levels=9)
    with pytest.raises(EmptyInputError, match="no triangles"):
        write_tileset(replace(mesh, triangles=mesh.triangles[:0]), FRAME, tmp_path / "t")
    (tmp_path / "t").mkdir()
    (tmp_path / "t" / "mine").write_text("keep")
    with pytest.raises(OutputExistsError, match="exists already"):
        write_tileset(mesh, FRAME, tmp_path / "t")
