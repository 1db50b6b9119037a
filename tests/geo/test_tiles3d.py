"""Reading 3D tilesets: real ones against their batch tables, small ones made by hand against what they say."""

import gzip
import io
import json
import tarfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tile_files import at_place, b3dm, box, cmpt, ecef, enu_axes, glb, square
from vico.errors import EmptyInputError, InputError, MissingFileError, SchemaError
from vico.geo.frame import LocalFrame
from vico.geo.gltf import read_gltf
from vico.geo.tiles3d import TileLimits, TileMesh, TileReport, credits_of, read_tileset, weld_borders
from vico.geo.tiles3d_files import ECEF, TileWindow, boxes_touch, read_tile_file

FRAME = LocalFrame(60.169, 24.9435)
PLACE = at_place(60.169, 24.9435)


def write(folder: Path, root: dict[str, Any], files: dict[str, bytes], **document: Any) -> Path:
    for name, data in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    text = {"asset": {"version": "1.0"}, "geometricError": 500, "root": root, **document}
    (folder / "tileset.json").write_text(json.dumps(text))
    return folder


def read(folder: Path, error: float = 0.0, **options: Any) -> tuple[TileMesh, TileReport]:
    return read_tileset(folder, FRAME, 200.0, error=error, **options)


def leaf(name: str, x: float, y: float, size: float = 40.0, **more: Any) -> dict[str, Any]:
    return {"boundingVolume": box(x, y, size), "geometricError": 0, "content": {"uri": name}, **more}


def parent(children: list[dict[str, Any]], error: float = 16.0, refine: str = "REPLACE", **more: Any) -> dict[str, Any]:
    return {
        "transform": PLACE,
        "boundingVolume": box(0, 0, 400),
        "geometricError": error,
        "refine": refine,
        "children": children,
        **more,
    }


def tile(x: float, y: float, z: float = 5.0, size: float = 40.0, **more: Any) -> bytes:
    return glb(*square(x, y, z, size), **more)


# --- real tilesets


def test_tokyo_stands_where_its_batch_table_says(shared_data: Path) -> None:
    folder = shared_data / "tiles3d" / "tokyo_chiyoda_plateau"
    frame = LocalFrame(35.6848, 139.75055)
    mesh, report = read_tileset(folder, frame, 2500.0)
    assert (report.read, report.left_out, report.crs) == (1, (), "EPSG:4978")
    assert len(mesh.triangles) == 14_756
    assert len(mesh.textures) == 28
    lat, lon = frame.to_geodetic(mesh.positions[:, :2])
    # SOURCE.txt: 139.7386..139.7625 E, 35.6695..35.7001 N.
    assert (lon.min(), lon.max()) == pytest.approx((139.7386, 139.7625), abs=1e-4)
    assert (lat.min(), lat.max()) == pytest.approx((35.6695, 35.7001), abs=1e-4)

    content = read_tile_file((folder / "tile.b3dm").read_bytes(), "tile.b3dm").models[0]
    scene = read_gltf(content.model, "tile.b3dm")
    height = np.array(content.batch["計測高さ"], float)
    assert len(height) == 300
    numbers = np.concatenate([part.feature for part in scene.parts if part.feature is not None])
    assert len(numbers) == len(mesh.positions)
    bottom, top = np.full(300, np.inf), np.full(300, -np.inf)
    np.minimum.at(bottom, numbers, mesh.positions[:, 2])
    np.maximum.at(top, numbers, mesh.positions[:, 2])
    tall = top - bottom
    assert np.corrcoef(tall, height)[0, 1] > 0.98
    # The table has the highest point that was measured, the mesh ends at the roof.
    assert np.median(np.abs(tall - height)) < 3.0


def test_a_window_of_tokyo_holds_only_what_reaches_into_it(shared_data: Path) -> None:
    mesh, _ = read_tileset(
        shared_data / "tiles3d" / "tokyo_chiyoda_plateau", LocalFrame(35.69652, 139.75824), 400.0, margin=0.0
    )
    corner = mesh.positions[mesh.triangles]
    assert 2000 < len(mesh.triangles) < 4000
    assert (corner[..., :2].min(axis=1) <= 400).all()
    assert (corner[..., :2].max(axis=1) >= -400).all()
    assert mesh.texture_of.max() < len(mesh.textures) or not mesh.textures


def test_rotterdam_is_read_whole_from_its_archive(shared_data: Path) -> None:
    archive = shared_data / "tiles3d" / "rotterdam_lod2" / "rotterdam_3dtiles_small.tar.gz"
    frame = LocalFrame(51.92, 4.49)
    mesh, report = read_tileset(archive, frame, 6000.0, error=0.0)
    assert (report.read, report.left_out, report.crs) == (801, (), "EPSG:3857")
    # Rotterdam lies around its town hall; its tallest buildings of 2020 end at 160 to 165 m, its ground at -1 to 5 m.
    lat, lon = frame.to_geodetic(mesh.positions[:, :2])
    assert 51.88 < lat.min() < lat.max() < 51.93
    assert 4.45 < lon.min() < lon.max() < 4.53
    assert -1.5 < mesh.positions[:, 2].min() < 1.0
    assert 150.0 < mesh.positions[:, 2].max() < 180.0


def test_rotterdam_in_a_window_reads_few_tiles(shared_data: Path) -> None:
    archive = shared_data / "tiles3d" / "rotterdam_lod2" / "rotterdam_3dtiles_small.tar.gz"
    frame = LocalFrame(51.915, 4.48)
    fine, all_of_it = read_tileset(archive, frame, 500.0, error=0.0)
    coarse, some = read_tileset(archive, frame, 500.0, error=100.0)
    assert all_of_it.read < 120
    assert some.read < all_of_it.read
    assert len(coarse.triangles) < len(
        fine.triangles
    )  # ADD refinement: what is coarse stays, what is finer comes on top


# --- frames and transforms


def test_points_come_back_to_the_local_frame_to_a_tenth_of_a_millimetre(tmp_path: Path) -> None:
    spots = np.array([[-150.0, 80.0, 3.0], [120.0, -90.0, 47.5], [0.0, 0.0, 0.0]])
    lat, lon = FRAME.to_geodetic(spots[:, :2])
    there = np.stack([ecef(a, b, z) for a, b, z in zip(lat, lon, spots[:, 2], strict=True)])
    centre = ecef(60.169, 24.9435, 0.0)
    # As Google does: float32 around a centre that is in the node's matrix, in glTF's axes.
    x, y, z = centre
    model = glb(there - centre, np.array([[0, 1, 2]]), matrix=[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, z, -y, 1])
    root = {"boundingVolume": {"sphere": [*centre, 500.0]}, "geometricError": 0, "content": {"uri": "a.glb"}}
    mesh, _ = read(write(tmp_path, root, {"a.glb": model}))
    assert np.abs(mesh.positions - spots).max() < 1e-4


@pytest.mark.parametrize("way", ["RTC_CENTER", "CESIUM_RTC", "transform"])
def test_the_three_ways_to_say_where_a_tile_lies_agree(tmp_path: Path, way: str) -> None:
    points, triangles = square(10.0, 20.0, 5.0, 40.0)
    centre = ecef(60.169, 24.9435, 0.0)
    turned = points @ enu_axes(60.169, 24.9435).T
    root: dict[str, Any] = {"boundingVolume": {"sphere": [*centre, 500.0]}, "geometricError": 0}
    if way == "RTC_CENTER":
        data = b3dm(
            glb(turned, triangles), features=json.dumps({"BATCH_LENGTH": 0, "RTC_CENTER": list(centre)}).encode()
        )
    elif way == "CESIUM_RTC":

        def edit(document: dict[str, Any]) -> None:
            document["extensions"] = {"CESIUM_RTC": {"center": list(centre)}}

        data = b3dm(glb(turned, triangles, edit=edit))
    else:
        data = b3dm(glb(points, triangles))
        root |= {"transform": PLACE, "boundingVolume": {"sphere": [0, 0, 0, 500.0]}}
    mesh, _ = read(write(tmp_path, {**root, "content": {"url": "t.b3dm"}}, {"t.b3dm": data}))
    east_north_up = np.array([[-10.0, 0.0], [30.0, 0.0], [30.0, 40.0], [-10.0, 40.0]])
    assert np.abs(mesh.positions[:, :2] - east_north_up).max() < 2e-3
    assert np.abs(mesh.positions[:, 2] - 5.0).max() < 2e-3


def test_transforms_of_nested_tiles_are_multiplied(tmp_path: Path) -> None:
    moved = np.eye(4)
    moved[:3, 3] = (100.0, 0.0, 0.0)
    child = leaf("a.glb", 0, 0, transform=moved.T.ravel().tolist())
    mesh, _ = read(write(tmp_path, parent([child]), {"a.glb": tile(0, 0)}))
    assert mesh.positions[:, 0].mean() == pytest.approx(100.0, abs=1e-2)


def test_faces_look_up_where_the_ground_does(tmp_path: Path) -> None:
    mesh, _ = read(write(tmp_path, parent([leaf("a.glb", 0, 0)]), {"a.glb": tile(0, 0)}))
    corner = mesh.positions[mesh.triangles]
    assert (np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[:, 2] > 0).all()


def test_legacy_headers_of_b3dm_are_read() -> None:
    model = tile(0, 0)
    batch = b'{"name":["a","b"]}'
    batch += b" " * (-len(batch) % 4)
    short = b"b3dm" + np.array([1, 20 + len(batch) + len(model), 2, len(batch)], "<u4").tobytes() + batch + model
    long = b"b3dm" + np.array([1, 24 + len(batch) + len(model), len(batch), 0, 2], "<u4").tobytes() + batch + model
    for data in (short, long):
        content = read_tile_file(data, "t.b3dm").models[0]
        assert content.batch == {"name": ["a", "b"]}
        assert len(read_gltf(content.model, "t").parts[0].triangles) == 2


def test_binary_columns_of_a_batch_table_are_read() -> None:
    batch = json.dumps({"h": {"byteOffset": 8, "componentType": "DOUBLE", "type": "SCALAR"}}).encode()
    data = b3dm(
        tile(0, 0), features=b'{"BATCH_LENGTH":2}', batch=batch, binary=np.array([0.0, 4.5, 9.25], "<f8").tobytes()
    )
    assert read_tile_file(data, "t").models[0].batch == {"h": [4.5, 9.25]}


# --- refinement


def four(files: dict[str, bytes]) -> list[dict[str, Any]]:
    children = []
    for k, (x, y) in enumerate([(-50, -50), (50, -50), (-50, 50), (50, 50)]):
        files[f"{k}.glb"] = tile(x, y, 5.0, 100.0)
        children.append(leaf(f"{k}.glb", x, y, 100.0))
    return children


def test_replace_shows_children_or_the_parent_never_both(tmp_path: Path) -> None:
    files = {"p.glb": tile(0, 0, 9.0, 200.0)}
    folder = write(tmp_path, parent(four(files), content={"uri": "p.glb"}), files)
    fine, report = read(folder, error=4.0)
    assert report.read == 4
    assert np.allclose(fine.positions[:, 2], 5.0, atol=0.05)
    coarse, report = read(folder, error=16.0)
    assert report.read == 1
    assert np.allclose(coarse.positions[:, 2], 9.0, atol=0.05)


def test_add_shows_both(tmp_path: Path) -> None:
    files = {"p.glb": tile(0, 0, 9.0, 200.0)}
    mesh, report = read(write(tmp_path, parent(four(files), refine="add", content={"uri": "p.glb"}), files))
    assert report.read == 5
    assert len(mesh.triangles) == 10


def test_the_parent_stands_in_for_a_missing_child(tmp_path: Path) -> None:
    files = {"p.glb": tile(0, 0, 9.0, 200.0)}
    children = four(files)
    del files["2.glb"]
    mesh, report = read(write(tmp_path, parent(children, content={"uri": "p.glb"}), files))
    assert np.allclose(mesh.positions[:, 2], 9.0, atol=0.05)
    assert [name for name, _ in report.left_out] == ["2.glb"]
    assert "no such file" in report.left_out[0][1]


def test_without_a_parent_the_other_children_stay(tmp_path: Path) -> None:
    files: dict[str, bytes] = {}
    children = four(files)
    files["1.glb"] = files["1.glb"][:200]
    mesh, report = read(write(tmp_path, parent(children), files))
    assert report.read == 3
    assert len(mesh.triangles) == 6
    assert report.left_out[0][0] == "1.glb"
    assert "truncated" in report.left_out[0][1]


def test_children_outside_the_window_are_not_asked_for(tmp_path: Path) -> None:
    far = leaf("far.glb", 5000, 0)
    mesh, report = read(write(tmp_path, parent([leaf("a.glb", 0, 0), far]), {"a.glb": tile(0, 0)}))
    assert (report.read, report.left_out, len(mesh.triangles)) == (1, (), 2)


def test_nested_tilesets_composites_and_gzip_are_opened(tmp_path: Path) -> None:
    points = b"pnts" + np.array([1, 28, 0, 0, 0, 0], "<u4").tobytes()
    inner = {
        "asset": {"version": "1.0"},
        "geometricError": 8,
        "root": {
            "boundingVolume": box(0, 0, 300),
            "geometricError": 8,
            "refine": "ADD",
            "contents": [{"uri": "two.cmpt"}, {"uri": "zip.glb"}],
        },
    }
    files = {
        "sub/in.json": json.dumps(inner).encode(),
        "sub/two.cmpt": cmpt(b3dm(tile(0, 0)), points, cmpt(tile(60, 0))),
        "sub/zip.glb": gzip.compress(tile(-60, 0)),
    }
    mesh, report = read(write(tmp_path, parent([leaf("sub/in.json", 0, 0, 300.0)]), files))
    assert report.read == 3
    assert report.left_out == (("sub/two.cmpt", "a point cloud (pnts) are not read"),)
    assert len(mesh.triangles) == 6


def test_archives_are_read_in_place(tmp_path: Path) -> None:
    folder = write(tmp_path / "t", parent([leaf("tiles/a.glb", 0, 0)]), {"tiles/a.glb": tile(0, 0)})
    plain, _ = read(folder)
    with zipfile.ZipFile(tmp_path / "t.3tz", "w") as archive:
        for path in sorted(folder.rglob("*.*")):
            archive.write(path, path.relative_to(folder))
    with tarfile.open(tmp_path / "t.tar.gz", "w:gz") as tar:
        tar.add(folder, "inside")
        evil = tarfile.TarInfo("../../evil.glb")
        evil.size = 4
        tar.addfile(evil, io.BytesIO(b"evil"))
    before = sorted(p.name for p in tmp_path.iterdir())
    for name in ("t.3tz", "t.tar.gz"):
        mesh, _ = read(tmp_path / name)
        assert np.array_equal(mesh.positions, plain.positions)
    assert sorted(p.name for p in tmp_path.iterdir()) == before


# --- looks


def test_textures_keep_their_picture_and_coordinates(tmp_path: Path) -> None:
    picture = np.zeros((4, 8, 3), np.uint8)
    picture[0, 0], picture[3, 7] = (255, 0, 0), (0, 255, 0)
    uv = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], float)
    for kind in ("PNG", "WEBP"):
        data = glb(*square(0, 0, 5, 40), picture=picture, uv=uv, kind=kind)
        mesh, _ = read(write(tmp_path, parent([leaf("a.glb", 0, 0)]), {"a.glb": data}))
        assert np.array_equal(mesh.textures[0], picture)
        assert np.array_equal(mesh.uv, uv.astype(np.float32))
        assert mesh.texture_of.tolist() == [0, 0]


def test_texture_transforms_are_applied() -> None:
    uv = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    picture = np.zeros((2, 2, 3), np.uint8)
    change = {"offset": [0.25, 0.5], "rotation": np.pi / 2, "scale": [0.5, 2.0]}
    scene = read_gltf(glb(*square(0, 0, 0, 1), picture=picture, uv=uv, change=change), "t")
    # The extension's text: uv' = T * R * S * uv, with R = [[cos, sin], [-sin, cos]].
    rotation = np.array([[0.0, 1.0], [-1.0, 0.0]])
    assert np.allclose(scene.parts[0].uv, (uv * [0.5, 2.0]) @ rotation.T + [0.25, 0.5], atol=1e-6)


def test_quantised_positions_are_dequantised_by_the_node() -> None:
    def edit(document: dict[str, Any]) -> None:
        document["extensionsRequired"] = ["KHR_mesh_quantization"]
        document["accessors"][1] |= {"componentType": 5121, "count": 3, "byteOffset": 0}
        document["accessors"][0] |= {"componentType": 5122, "count": 3, "normalized": True}
        document["bufferViews"][0]["byteStride"] = 8
        document["nodes"][0] |= {"scale": [10, 10, 10], "translation": [1, 2, 3]}

    raw = np.zeros((3, 4), "<i2")
    raw[1, 0], raw[2, 1] = 32767, -32768
    points = np.frombuffer(raw.tobytes(), "<f4").reshape(-1, 3)
    turned = np.stack([points[:, 0], -points[:, 2], points[:, 1]], axis=1)
    data = glb(turned, np.frombuffer(bytes([0, 1, 2, 0, 0, 0]), "<u2").reshape(1, 3), edit=edit)
    part = read_gltf(data, "t").parts[0]
    assert np.allclose(part.positions, [[1, 2, 3], [11, 2, 3], [1, -8, 3]], atol=1e-6)


def test_credits_are_split_and_the_most_frequent_comes_first(tmp_path: Path) -> None:
    assert credits_of(["A;B", " B ; C", "", "B;A"]) == ("B", "A", "C")
    files = {"0.glb": tile(-50, 0, copyright="Google;Maxar"), "1.glb": tile(50, 0, copyright="Airbus;Maxar")}
    mesh, _ = read(write(tmp_path, parent([leaf("0.glb", -50, 0), leaf("1.glb", 50, 0)]), files))
    assert mesh.attributions == ("Maxar", "Google", "Airbus")


# --- welding


def test_borders_of_neighbour_tiles_are_welded(tmp_path: Path) -> None:
    files = {"0.glb": tile(-50, 0, 5.0, 100.0), "1.glb": tile(50.05, 0, 5.03, 100.0)}
    folder = write(tmp_path, parent([leaf("0.glb", -50, 0, 100.0), leaf("1.glb", 50, 0, 101.0)]), files)
    loose, _ = read(folder, weld=0.0)
    mesh, _ = read(folder)
    seam = np.abs(loose.positions[:, 0]) < 1.0
    assert len(np.unique(np.round(loose.positions[seam], 2), axis=0)) == 4
    assert len(np.unique(mesh.positions[seam], axis=0)) == 2
    assert np.array_equal(mesh.positions[~seam], loose.positions[~seam])


def test_welding_leaves_the_inside_of_a_tile_alone() -> None:
    rows = np.array([(x, y, 0.0) for y in range(3) for x in range(3)])
    faces = [[a, a + 1, a + 4] for a in (0, 1, 3, 4)] + [[a, a + 4, a + 3] for a in (0, 1, 3, 4)]
    other = rows + np.array([0.05, 0.0, 0.0])
    points = np.concatenate([rows, other])
    moved = weld_borders(points, np.array([*faces, *(np.array(faces) + 9)]), np.repeat([0, 1], 9), 0.2)
    assert np.array_equal(moved[:9], rows)
    assert np.array_equal(moved[13], other[4])  # the middle is no border
    assert np.array_equal(np.delete(moved[9:], 4, axis=0), np.delete(rows, 4, axis=0))


# --- volumes


def test_regions_touch_the_window_on_the_ellipsoid() -> None:
    window = TileWindow.of(LocalFrame(10.0, 179.999), 500.0, ECEF)
    east_of_the_date_line = [np.radians(v) for v in (-179.9999, 9.99, -179.99, 10.01)]
    over_it = [np.radians(v) for v in (179.9, 9.0, -179.9, 11.0)]
    elsewhere = [np.radians(v) for v in (-179.9, 9.99, -179.8, 10.01)]
    touches = [window.touches({"region": [*r, 0, 100]}, np.eye(4)) for r in (east_of_the_date_line, over_it, elsewhere)]
    assert touches == [True, True, False]


def test_boxes_touch_as_sampled_points_say() -> None:
    random = np.random.default_rng(4)
    grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 9)] * 3), axis=-1).reshape(-1, 3)
    for _ in range(200):
        a, b = (np.linalg.qr(random.standard_normal((3, 3)))[0] * random.uniform(0.2, 2, 3)[:, None] for _ in range(2))
        centre = random.uniform(-3, 3, 3)
        shared = np.abs((centre + grid @ b) @ np.linalg.inv(a)).max(axis=1).min() <= 1.0
        if shared:
            assert boxes_touch(np.zeros(3), a, centre, b)
        elif np.linalg.norm(centre) > np.linalg.norm(a) + np.linalg.norm(b):
            assert not boxes_touch(np.zeros(3), a, centre, b)


# --- bad input


@pytest.mark.parametrize(
    ("uri", "reason"),
    [
        ("../secret.glb", "leads out of"),
        ("%2e%2e/secret.glb", "leads out of"),
        ("/etc/passwd", "no relative path"),
        ("file:///etc/passwd", "another host"),
        ("http://127.0.0.1/x.glb", "another host"),
        ("link.glb", "leads out of"),
        ("a\0b", "no relative path"),
    ],
)
def test_no_address_leads_out_of_the_folder(tmp_path: Path, uri: str, reason: str) -> None:
    (tmp_path / "secret.glb").write_bytes(tile(0, 0))
    folder = write(tmp_path / "t", parent([leaf(uri, 0, 0), leaf("a.glb", 0, 0)]), {"a.glb": tile(0, 0)})
    (folder / "link.glb").symlink_to(tmp_path / "secret.glb")
    _, report = read(folder)
    assert report.read == 1
    assert reason in report.left_out[0][1]


def test_a_tileset_that_holds_itself_is_left_out(tmp_path: Path) -> None:
    folder = write(tmp_path, parent([leaf("tileset.json", 0, 0), leaf("a.glb", 0, 0)]), {"a.glb": tile(0, 0)})
    _, report = read(folder)
    assert (report.read, report.left_out) == (1, (("tileset.json", "is a tileset that holds itself"),))


def test_limits_end_the_reading_in_one_sentence(tmp_path: Path) -> None:
    files: dict[str, bytes] = {}
    folder = write(tmp_path, parent(four(files)), files)
    for limits in (TileLimits(tiles=3), TileLimits(total=2000), TileLimits(triangles=5)):
        with pytest.raises(InputError, match="larger geometric error"):
            read(folder, limits=limits)


def test_too_many_levels_are_left_out(tmp_path: Path) -> None:
    deep: dict[str, Any] = leaf("a.glb", 0, 0)
    for _ in range(150):
        deep = {"boundingVolume": box(0, 0, 300), "geometricError": 5, "children": [deep]}
    with pytest.raises(EmptyInputError, match="more than 96 levels"):
        read(write(tmp_path, parent([deep]), {"a.glb": tile(0, 0)}))


def edited(change: Any) -> bytes:
    return glb(*square(0, 0, 5, 40), edit=change)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (edited(lambda d: d.update(extensionsRequired=["EXT_meshopt_compression"])), "EXT_meshopt_compression"),
        (edited(lambda d: d.update(extensionsRequired=["KHR_texture_basisu"])), "KTX2"),
        (edited(lambda d: d.update(extensionsRequired=["ACME_secret"])), "ACME_secret"),
        (edited(lambda d: d["accessors"][0].update(count=9999)), "reaches past"),
        (edited(lambda d: d["accessors"][0].update(byteOffset=-4)), "reaches past"),
        (edited(lambda d: d["bufferViews"][0].update(byteLength=10**9)), "leaves the file"),
        (edited(lambda d: d["accessors"][1].update(bufferView=0, count=6)), "names vertex"),
        (edited(lambda d: d["nodes"][0].update(children=[0])), "its own ancestor"),
        (edited(lambda d: d["nodes"][0].update(matrix=[float("nan")] * 16)), "no finite transform"),
        (edited(lambda d: d["buffers"][0].update(uri="../../x.bin")), "leads out of"),
        (tile(0, 0)[:-30], "truncated"),
        (b"b3dm" + np.array([1, 4000, 0, 0, 0, 0], "<u4").tobytes(), "truncated"),
        (b3dm(tile(0, 0))[:12] + np.array([10**9, 0, 0, 0], "<u4").tobytes() + tile(0, 0), "leave"),
        (b"i3dm" + bytes(40), "instanced models"),
        (b"<html>not here</html>", "no 3D tile"),
        (b"", "no 3D tile"),
    ],
)
def test_a_broken_tile_is_left_out_with_its_reason(tmp_path: Path, data: bytes, reason: str) -> None:
    folder = write(
        tmp_path, parent([leaf("bad.glb", 0, 0), leaf("a.glb", 0, 0)]), {"a.glb": tile(0, 0), "bad.glb": data}
    )
    mesh, report = read(folder)
    assert (report.read, len(mesh.triangles)) == (1, 2)
    assert report.left_out[0][0] == "bad.glb"
    assert reason in report.left_out[0][1]


def test_a_window_beside_the_tileset_says_so(tmp_path: Path) -> None:
    folder = write(tmp_path, parent([leaf("a.glb", 0, 0)]), {"a.glb": tile(0, 0)})
    with pytest.raises(EmptyInputError, match=r"does not reach within 200 m of 60\.3, 24\.9"):
        read_tileset(folder, LocalFrame(60.3, 24.9), 180.0)


def test_sources_that_are_none_say_so(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="no such tileset"):
        read(tmp_path / "none")
    (tmp_path / "tileset.json").write_text('{"asset": {}}')
    with pytest.raises(SchemaError, match="neither a tileset nor glTF"):
        read(tmp_path)
    (tmp_path / "x.tar.gz").write_bytes(b"\x1f\x8bnonsense")
    with pytest.raises(SchemaError, match="broken archive"):
        read(tmp_path / "x.tar.gz")
    with pytest.raises(InputError, match="crs 'EPSG:4326': has no metres"):
        read(write(tmp_path / "t", parent([leaf("a.glb", 0, 0)]), {"a.glb": tile(0, 0)}), crs="EPSG:4326")
