"""Elevation files: written here to the byte, and the real ones where they are."""

import contextlib
import gzip
import io
import struct
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image, TiffImagePlugin
from pyproj import Transformer

from vico.errors import EmptyInputError, InputError, MissingFileError, SchemaError
from vico.geo.elevation import read_elevation
from vico.geo.frame import LocalFrame

FRAME = LocalFrame(43.5, 7.5)


def write_geotiff(
    path: Path,
    heights: np.ndarray,
    *,
    west: float,
    north: float,
    step: float,
    code: int = 4326,
    more: Sequence[tuple[Any, ...]] = (),
    **how: Any,
) -> Path:
    kind = 2048 if code in (4326, 4269) else 3072
    keys = (1, 1, 0, 3, 1024, 0, 1, 2, 1025, 0, 1, 2, kind, 0, 1, code)
    tags = [
        (33550, "d", 3, (step, step, 0.0), False),
        (33922, "d", 6, (0.0, 0.0, 0.0, west, north, 0.0), False),
        (34735, "H", len(keys), keys, False),
        (42113, "s", 0, "-9999", False),
        *more,
    ]
    tifffile.imwrite(path, heights, extratags=tags, **how)
    return path


def slope(step: float = 0.0005, size: int = 60) -> np.ndarray:
    """Ten metres a pixel to the south: the row's number, times ten."""
    return np.repeat(np.arange(size, dtype=np.float32)[:, None] * 10, size, axis=1)


def test_a_geotiff_s_heights_lie_where_its_tags_say(tmp_path: Path) -> None:
    path = write_geotiff(tmp_path / "a.tif", slope(), west=7.485, north=43.515, step=0.0005)
    samples = read_elevation(path, FRAME, 300.0)
    lat, _ = FRAME.to_geodetic(samples.points[:, :2])
    # Pixel is point: row r lies at north - r * step, and is 10 r high.
    assert np.abs(samples.points[:, 2] - (43.515 - lat) / 0.0005 * 10).max() < 1e-3


@pytest.mark.parametrize(
    ("items", "scale", "offset"),
    [
        ('<Item name="SCALE" sample="0" role="scale">0.1</Item>', 0.1, 0.0),
        (
            '<Item sample="0" role="offset" name="OFFSET">500</Item>\n<Item name="SCALE" role="scale">0.1</Item>',
            0.1,
            500.0,
        ),
        ('<Item name="UNITTYPE" sample="0" role="unittype">ft</Item>', 0.3048, 0.0),
        ('<Item name="UNITTYPE" sample="0" role="unittype">cm</Item>', 0.01, 0.0),
        ('<Item name="SCALE" sample="1" role="scale">0.1</Item>', 1.0, 0.0),
    ],
)
def test_the_band_s_scale_offset_and_unit_count(tmp_path: Path, items: str, scale: float, offset: float) -> None:
    metadata = (42112, "s", 0, f"<GDALMetadata>{items}</GDALMetadata>", False)
    counts = np.round((slope() + 500.0 - offset) / scale).astype(np.int32)
    path = write_geotiff(tmp_path / "a.tif", counts, west=7.485, north=43.515, step=0.0005, more=[metadata])
    samples = read_elevation(path, FRAME, 300.0)
    lat, _ = FRAME.to_geodetic(samples.points[:, :2])
    assert samples.points[:, 2] == pytest.approx(500.0 + (43.515 - lat) / 0.0005 * 10, abs=0.6)


def test_a_scale_that_is_no_number_is_refused(tmp_path: Path) -> None:
    metadata = (42112, "s", 0, '<GDALMetadata><Item role="scale">much</Item></GDALMetadata>', False)
    path = write_geotiff(tmp_path / "a.tif", slope(), west=7.485, north=43.515, step=0.0005, more=[metadata])
    with pytest.raises(SchemaError, match="its band's scale 'much' and offset '0' are no numbers"):
        read_elevation(path, FRAME, 300.0)


def test_voids_are_filled_from_their_neighbours_and_counted(tmp_path: Path) -> None:
    heights = slope()
    heights[25:28, 25:28] = -9999
    path = write_geotiff(tmp_path / "a.tif", heights, west=7.485, north=43.515, step=0.0005)
    samples = read_elevation(path, FRAME, 300.0)
    assert samples.filled == 9
    lat, _ = FRAME.to_geodetic(samples.points[:, :2])
    assert np.abs(samples.points[:, 2] - (43.515 - lat) / 0.0005 * 10).max() < 1e-2
    whole = write_geotiff(tmp_path / "b.tif", slope(), west=7.485, north=43.515, step=0.0005)
    assert len(samples.points) == len(read_elevation(whole, FRAME, 300).points)


def test_a_spike_is_left_out_filled_and_told(tmp_path: Path) -> None:
    heights = slope()
    heights[30, 30] = 8850.0
    path = write_geotiff(tmp_path / "a.tif", heights, west=7.485, north=43.515, step=0.0005)
    samples = read_elevation(path, FRAME, 300.0)
    ((name, lat, lon, height),) = samples.outliers
    assert (name, height, samples.filled) == ("a.tif", 8850.0, 1)
    assert (lat, lon) == pytest.approx((43.5, 7.5), abs=1e-6)
    assert samples.points[:, 2].max() < 600.0


def test_a_window_that_is_mostly_void_is_refused(tmp_path: Path) -> None:
    heights = slope()
    heights[:, :32] = -9999
    path = write_geotiff(tmp_path / "a.tif", heights, west=7.485, north=43.515, step=0.0005)
    with pytest.raises(EmptyInputError, match=r"\d\d % void"):
        read_elevation(path, FRAME, 300.0)


def hgt_bytes() -> bytes:
    """A 3 arc second tile that rises a metre a row to the south."""
    return np.repeat(np.arange(1201, dtype=">i2")[:, None], 1201, axis=1).tobytes()


def test_a_zipped_hgt_is_read_by_its_member_s_name(tmp_path: Path) -> None:
    path = tmp_path / "tile.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("N43E007.hgt", hgt_bytes())
    samples = read_elevation(path, FRAME, 300.0)
    lat, _ = FRAME.to_geodetic(samples.points[:, :2])
    assert np.abs(samples.points[:, 2] - (44.0 - lat) * 1200).max() < 1e-3


def test_a_zip_that_unpacks_to_no_tile_is_not_unpacked(tmp_path: Path) -> None:
    path = tmp_path / "bomb.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("N43E007.hgt", bytes(30_000_000))
    with pytest.raises(SchemaError, match="no HGT tile"):
        read_elevation(path, FRAME, 300.0)


@pytest.mark.parametrize("name", ["a.tif", "N43E007.hgt", "a.zip"])
def test_rubbish_is_refused_in_one_sentence(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(b"rubbish" * 100)
    with pytest.raises(SchemaError, match=name.split(".")[0]):
        read_elevation(path, FRAME, 300.0)


def test_a_geotiff_without_coordinates_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "plain.tif"
    tifffile.imwrite(path, slope())
    with pytest.raises(SchemaError, match="EPSG"):
        read_elevation(path, FRAME, 300.0)


def test_a_tile_of_another_place_is_refused(tmp_path: Path) -> None:
    path = write_geotiff(tmp_path / "a.tif", slope(), west=8.485, north=43.515, step=0.0005)
    with pytest.raises(EmptyInputError, match=r"nothing of the 600 m .* longitudes 8\.4848\.\.8\.5147"):
        read_elevation(path, FRAME, 300.0)


def test_other_files_and_no_file_are_told_apart(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"x")
    with pytest.raises(InputError, match="must end in"):
        read_elevation(tmp_path / "a.png", FRAME, 300.0)
    with pytest.raises(MissingFileError, match="no such"):
        read_elevation(tmp_path / "b.tif", FRAME, 300.0)


def test_monaco_s_geotiff_agrees_with_the_tile_it_was_cut_from(shared_data: Path) -> None:
    monaco = shared_data / "places" / "monaco"
    frame = LocalFrame(43.73384, 7.41813)
    clip = read_elevation(monaco / "dem_srtm.tif", frame, 400.0)
    tile = read_elevation(monaco / "N43E007.hgt.zip", frame, 400.0)
    assert np.allclose(clip.points, tile.points, atol=1e-5)


def test_andorra_s_and_portland_s_heights_are_those_of_their_notes(shared_data: Path) -> None:
    # SOURCE.txt: Andorra's window has 1000..1218 m, Portland's clip 0..175.4 m.
    points = read_elevation(
        shared_data / "places" / "andorra" / "dem_srtm.tif", LocalFrame(42.50745, 1.52536), 400.0
    ).points
    andorra = points[np.abs(points[:, :2]).max(axis=1) <= 400.0, 2]
    assert 1000 <= andorra.min() < 1010
    assert 1150 < andorra.max() <= 1218
    portland = read_elevation(
        shared_data / "places" / "portland" / "dem_ned13.tif", LocalFrame(45.52336, -122.67457), 400.0
    )
    assert portland.spacing == pytest.approx(10.3, abs=0.2)  # a third of an arc second, the longer way
    assert 0 <= portland.points[:, 2].min() < portland.points[:, 2].max() < 175.5


def test_the_tile_beside_the_clip_adds_nothing_where_they_agree(shared_data: Path) -> None:
    monaco = shared_data / "places" / "monaco"
    frame = LocalFrame(43.73384, 7.41813)
    both = read_elevation([monaco / "dem_srtm.tif", monaco / "N43E007.hgt.zip"], frame, 400.0)
    clip = read_elevation(monaco / "dem_srtm.tif", frame, 400.0)
    assert np.array_equal(both.points, clip.points)
    assert [name for name, _, _ in both.files] == ["dem_srtm.tif"]


def plane(frame: LocalFrame, xy: np.ndarray) -> np.ndarray:
    """A hillside: 100 m high, rising 0.1 to the east and 0.05 to the north."""
    return 100 + 0.1 * xy[:, 0] + 0.05 * xy[:, 1]


def hillside(path: Path, code: int, step: float, *, reach: float = 700.0, shift: float = 0.0, **how: Any) -> Path:
    """`plane` around FRAME in any CRS; `step` in its units; `shift` metres to the east."""
    to = Transformer.from_crs(4326, code, always_xy=True)
    lat, lon = FRAME.to_geodetic(np.array([(shift - reach, reach), (shift + reach, -reach)]))
    x, y = to.transform(lon, lat)
    columns, rows = round((x[1] - x[0]) / step), round((y[0] - y[1]) / step)
    grid = np.stack(np.meshgrid(x[0] + step * np.arange(columns), y[0] - step * np.arange(rows)), axis=-1)
    lon, lat = to.transform(grid[..., 0].ravel(), grid[..., 1].ravel(), direction="INVERSE")
    heights = plane(FRAME, FRAME.to_enu(lat, lon)).reshape(rows, columns).astype(how.pop("dtype", np.float32))
    return write_geotiff(path, heights, west=x[0], north=y[0], step=step, code=code, **how)


@pytest.mark.parametrize(("code", "step"), [(4326, 0.0003), (4269, 0.0003), (32632, 30.0), (3857, 30.0), (2154, 30.0)])
def test_a_hillside_is_the_same_in_every_coordinate_system(tmp_path: Path, code: int, step: float) -> None:
    samples = read_elevation(hillside(tmp_path / "a.tif", code, step), FRAME, 300.0)
    assert np.abs(samples.points[:, 2] - plane(FRAME, samples.points)).max() < 0.01
    assert len(samples.points) > 300


@pytest.mark.parametrize(
    "how",
    [
        {"compression": "deflate"},
        {"compression": "adobe_deflate", "tile": (16, 32)},
        {"compression": "adobe_deflate", "rowsperstrip": 7},
        {"tile": (16, 16), "bigtiff": True},
        {"byteorder": ">", "dtype": np.int16},
        {"byteorder": ">", "dtype": np.float64, "rowsperstrip": 5},
        {"byteorder": ">", "dtype": np.int32, "tile": (32, 16), "compression": "adobe_deflate", "predictor": 2},
    ],
)
def test_tiles_strips_and_byte_orders_are_all_the_same(tmp_path: Path, how: dict[str, Any]) -> None:
    off = 0.6 if np.issubdtype(how.get("dtype", np.float32), np.integer) else 0.01
    path = hillside(tmp_path / "a.tif", 32632, 40.0, **how)
    samples = read_elevation(path, FRAME, 300.0)
    error = samples.points[:, 2] - plane(FRAME, samples.points)
    assert np.abs(error - (-0.5 if off > 0.5 else 0.0)).max() < off


PACKED = [(kind, p, d) for kind in ("tiff_lzw", "tiff_adobe_deflate") for p in (1, 2) for d in ("<i4", "<u2")]
PACKED += [("tiff_lzw", 3, "<f4"), ("tiff_adobe_deflate", 3, "<f4"), ("packbits", 1, "<f4"), ("tiff_lzw", 1, "<f4")]


@pytest.mark.parametrize(("kind", "predictor", "dtype"), PACKED)
def test_libtiff_s_packing_and_predictors_are_undone(tmp_path: Path, kind: str, predictor: int, dtype: str) -> None:
    # Written by libtiff through Pillow; unpacked by us.
    heights = (slope()[:, ::-1] + np.arange(60) ** 2 % 37).astype(dtype)
    tags: dict[int, Any] = {
        33550: (0.0005, 0.0005, 0.0),
        33922: (0.0, 0.0, 0.0, 7.485, 43.515, 0.0),
        34735: (1, 1, 0, 3, 1024, 0, 1, 2, 1025, 0, 1, 2, 2048, 0, 1, 4326),
    }
    info = TiffImagePlugin.ImageFileDirectory_v2()
    for tag, value in tags.items():
        info.tagtype[tag] = 3 if tag == 34735 else 12
        info[tag] = value
    if predictor > 1:
        info[317] = predictor
    path = tmp_path / "a.tif"
    Image.fromarray(heights).save(path, compression=kind, tiffinfo=info)
    with tifffile.TiffFile(path) as file:
        assert (int(file.pages[0].predictor), file.pages[0].compression.name.lower()[:3]) == (
            predictor,
            {"tiff_lzw": "lzw", "packbits": "pac"}.get(kind, "ado"),
        )
    samples = read_elevation(path, FRAME, 300.0)
    lat, lon = FRAME.to_geodetic(samples.points[:, :2])
    row, column = np.round((43.515 - lat) / 0.0005).astype(int), np.round((lon - 7.485) / 0.0005).astype(int)
    assert np.allclose(samples.points[:, 2], heights[row, column])
    assert len(samples.points) > 100


def test_files_side_by_side_are_one(tmp_path: Path) -> None:
    west = hillside(tmp_path / "w.tif", 32632, 30.0, shift=-700.0)
    east = hillside(tmp_path / "e.tif", 32632, 30.0, shift=690.0)
    half = read_elevation(west, FRAME, 300.0)
    assert 0.3 < half.covered < 0.8
    assert "w.tif covers latitudes" in half.beyond
    samples = read_elevation([west, east], FRAME, 300.0)
    assert np.abs(samples.points[:, 2] - plane(FRAME, samples.points)).max() < 0.01
    assert [count > 100 for _, _, count in samples.files] == [True, True]
    assert samples.name == "w.tif, e.tif"
    other = read_elevation([east, west], FRAME, 300.0)
    assert len(other.points) == pytest.approx(len(samples.points), rel=0.05)


def test_the_finer_file_counts_and_there_is_no_step_where_it_ends(tmp_path: Path) -> None:
    fine = hillside(tmp_path / "fine.tif", 32632, 10.0, reach=200.0)
    coarse = hillside(tmp_path / "coarse.tif", 32632, 40.0)
    content = tifffile.imread(coarse) + 5  # of another vertical datum, say
    with tifffile.TiffFile(coarse) as file:
        tags = file.pages[0].tags
        x, y = tags[33922].value[3:5]
    write_geotiff(coarse, content, west=x, north=y, step=40.0, code=32632)
    samples = read_elevation([coarse, fine], FRAME, 600.0)
    assert samples.spacing == pytest.approx(10, abs=0.1)
    assert [name for name, _, _ in samples.files] == ["fine.tif", "coarse.tif"]
    error = samples.points[:, 2] - plane(FRAME, samples.points)
    away = np.abs(samples.points[:, :2]).max(axis=1)
    assert np.abs(error[away < 190]).max() < 0.01
    assert np.abs(error[(away > 205) & (away < 240)]).max() < 1.0
    assert np.abs(error[away > 560] - 5).max() < 0.1


def test_a_void_in_the_fine_file_is_filled_from_the_coarse_one(tmp_path: Path) -> None:
    coarse = hillside(tmp_path / "coarse.tif", 32632, 40.0)
    fine = hillside(tmp_path / "fine.tif", 32632, 10.0, reach=500.0)
    with tifffile.TiffFile(fine) as file:
        x, y = file.pages[0].tags[33922].value[3:5]
        heights = file.pages[0].asarray()
    heights[30:70, 30:70] = -9999
    write_geotiff(fine, heights, west=x, north=y, step=10.0, code=32632)
    samples = read_elevation([fine, coarse], FRAME, 300.0)
    assert samples.filled == 0
    assert samples.files[1][2] > 50
    assert np.abs(samples.points[:, 2] - plane(FRAME, samples.points)).max() < 0.01


def test_tiles_meet_at_a_whole_degree_and_over_the_date_line(tmp_path: Path) -> None:
    for name in ("S17E179", "S17W180"):
        (tmp_path / f"{name}.hgt").write_bytes(hgt_bytes())
    frame = LocalFrame(-16.5, 180.0)
    assert read_elevation(tmp_path / "S17E179.hgt", frame, 800.0).covered == pytest.approx(0.5, abs=0.05)
    samples = read_elevation([tmp_path / f"{name}.hgt" for name in ("S17E179", "S17W180")], frame, 800.0)
    lat, lon = frame.to_geodetic(samples.points[:, :2])
    assert np.abs(samples.points[:, 2] - (-16.0 - lat) * 1200).max() < 1e-3
    places = np.round(np.column_stack([lat, lon % 360]), 6)
    assert len(np.unique(places, axis=0)) == len(places)  # the shared column is there once


def test_very_fine_files_are_averaged(tmp_path: Path) -> None:
    samples = read_elevation(hillside(tmp_path / "a.tif", 32632, 0.5, reach=120.0), FRAME, 60.0, margin=20.0)
    assert samples.spacing == pytest.approx(2.0, abs=0.01)
    assert np.abs(samples.points[:, 2] - plane(FRAME, samples.points)).max() < 0.01


def test_a_gzipped_tile_is_read_and_a_gzip_bomb_is_not_unpacked(tmp_path: Path) -> None:
    path = tmp_path / "N43E007.hgt.gz"
    path.write_bytes(gzip.compress(hgt_bytes()))
    assert len(read_elevation(path, FRAME, 300.0).points) > 50
    path.write_bytes(gzip.compress(bytes(100_000_000), 1))
    with pytest.raises(SchemaError, match="25,934,403 bytes"):
        read_elevation(path, FRAME, 300.0)


def test_a_zip_that_lies_about_its_size_is_found_out(tmp_path: Path) -> None:
    path = tmp_path / "liar.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("N43E007.hgt", bytes(5_000_000))
    content = path.read_bytes().replace(struct.pack("<I", 5_000_000), struct.pack("<I", 1201 * 1201 * 2))
    path.write_bytes(content)
    with pytest.raises(SchemaError, match="liar"):
        read_elevation(path, FRAME, 300.0)


def noisy_files() -> dict[str, bytes]:
    """A small whole file of each kind."""
    made: dict[str, bytes] = {}
    tags = [
        (33550, "d", 3, (0.0005, 0.0005, 0.0), False),
        (33922, "d", 6, (0.0, 0.0, 0.0, 7.485, 43.515, 0.0), False),
        (34735, "H", 16, (1, 1, 0, 3, 1024, 0, 1, 2, 1025, 0, 1, 2, 2048, 0, 1, 4326), False),
    ]
    for compression in (None, "adobe_deflate"):
        buffer = io.BytesIO()
        tifffile.imwrite(buffer, slope(), extratags=tags, compression=compression)
        made[f"{compression}.tif"] = buffer.getvalue()
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("N43E007.hgt", zlib.compress(b""))
    made["a.zip"] = buffer.getvalue()
    made["N43E007.hgt.gz"] = gzip.compress(b"\0\1" * 5000)
    return made


FILES = noisy_files()


@given(
    st.sampled_from(sorted(FILES)),
    st.lists(st.tuples(st.integers(0, 700) | st.integers(0, 20000), st.integers(0, 255)), max_size=6),
    st.integers(0, 20000),
)
@settings(max_examples=60, deadline=None)
def test_damaged_files_give_heights_or_one_of_our_errors(
    tmp_path_factory: pytest.TempPathFactory, name: str, damage: list[tuple[int, int]], length: int
) -> None:
    content = bytearray(FILES[name])
    for place, value in damage:
        content[place % len(content)] = value
    path = tmp_path_factory.getbasetemp() / name
    path.write_bytes(content[: length or None] if length < len(content) // 4 else content)
    with contextlib.suppress(SchemaError, EmptyInputError, InputError):
        points = read_elevation(path, FRAME, 300.0).points
        assert np.isfinite(points).all()
        assert len(points) >= 3
