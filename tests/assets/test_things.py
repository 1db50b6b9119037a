"""Furniture of an installed pack: read as untrusted, thinned, fitted in place of ours, credited."""

from __future__ import annotations

import io
import lzma
import tarfile
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from vico.assets import furniture_pack as things
from vico.assets.furniture_archive import COLLECTIONS, archives, read_obj
from vico.assets.furniture_pack import (
    OURS,
    STAND_INS,
    StandIn,
    available_things,
    baked_things,
    credits_of,
    fetch_things,
    our_models,
    read_things,
    transfer_uv,
)
from vico.assets.packages import FetchError, IntegrityError
from vico.assets.simplification import simplify_mesh
from vico.errors import MissingExtraError, MissingFileError, SchemaError

BOX = """mtllib box.mtl
v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nv 0 0 4\nv 2 0 4\nv 2 1 4\nv 0 1 4
vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1
usemtl wood
f 4/1 3/2 2/3 1/4\nf 1/1 2/2 6/3 5/4\nf 2/1 3/2 7/3 6/4\nf 3/1 4/2 8/3 7/4\nf 4/1 1/2 5/3 8/4
usemtl front
f 5 6 7 8
"""
MTL = "newmtl wood\nKd 1 1 1\nmap_Kd wood.png\nnewmtl front\nKd 1 0 0\n"
LISTING = """id#1=Made#box
creator#1=Ada
model#1=/made/box/box.obj
width#1=200
depth#1=400
height#1=100
"""


def _png(size: tuple[int, int] = (40, 20)) -> bytes:
    data = io.BytesIO()
    Image.new("RGB", size, (120, 80, 40)).save(data, "PNG")
    return data.getvalue()


def _members(**changed: str | bytes) -> dict[str, bytes]:
    files: dict[str, str | bytes] = {"box.obj": BOX, "box.mtl": MTL, "wood.png": _png()} | changed
    return {name: data.encode() if isinstance(data, str) else data for name, data in files.items()}


def _pack(folder: Path, **changed: str | bytes) -> Path:
    folder.mkdir(exist_ok=True)
    with zipfile.ZipFile(folder / "Scopia.sh3f", "w") as file:
        file.writestr("PluginFurnitureCatalog.properties", LISTING)
        for name, data in _members(**changed).items():
            file.writestr(f"made/box/{name}", data)
    return folder


def _digest(folder: Path) -> str:
    archive = archives(folder)["S"]
    return read_obj("made/box/box.obj", archive.read).digest


@pytest.fixture
def empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("VICO_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(things, "SYSTEM_FOLDER", tmp_path / "nowhere")
    for kept in (baked_things, read_things):
        kept.cache_clear()
    return tmp_path


@pytest.fixture(autouse=True)
def _forgotten() -> object:
    yield None
    for kept in (baked_things, read_things):
        kept.cache_clear()


def _choose(monkeypatch: pytest.MonkeyPatch, **pieces: tuple[StandIn, ...]) -> None:
    monkeypatch.setattr(things, "STAND_INS", pieces)


def test_a_pack_is_read_from_a_folder_and_from_a_debian_package(tmp_path: Path) -> None:
    folder = _pack(tmp_path / "pack")
    tar = io.BytesIO()
    with tarfile.open(fileobj=tar, mode="w") as file:
        file.add(folder / "Scopia.sh3f", "./usr/share/sweethome3d/furniture/Scopia.sh3f")
    data = lzma.compress(tar.getvalue())
    deb = b"!<arch>\n"
    for name, content in (("debian-binary", b"2.0\n"), ("data.tar.xz", data)):
        deb += f"{name:<16}{0:<12}{0:<6}{0:<6}{100644:<8}{len(content):<10}`\n".encode() + content
        deb += b"\n" * (len(content) % 2)
    (tmp_path / "made.deb").write_bytes(deb)
    from_folder, from_deb = archives(folder), archives(tmp_path / "made.deb")
    assert from_folder.keys() == from_deb.keys() == {"S"}
    assert from_folder["S"].entries == from_deb["S"].entries
    assert from_deb["S"].entries["box"].size == (2.0, 4.0, 1.0)
    (tmp_path / "cut.deb").write_bytes(deb[:-40])
    with pytest.raises(IntegrityError, match=r"cut\.deb: a damaged Debian package"):
        archives(tmp_path / "cut.deb")
    with pytest.raises(MissingFileError, match="holds none of"):
        archives(tmp_path)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"box.mtl": MTL.replace("wood.png", "../../../etc/passwd")}, "not beside it"),
        ({"box.mtl": MTL.replace("wood.png", "/etc/passwd")}, "not beside it"),
        ({"box.obj": BOX.replace("f 5 6 7 8", "f 5 6 77 8")}, "line 21 can't be read"),
        ({"box.obj": BOX.replace("v 2 0 0", "v nan 0 0")}, "numbers that are none"),
        ({"box.obj": BOX.replace("v 2 0 0", "v 2 0")}, "other than three numbers"),
        ({"box.obj": "v 0 0 0\n"}, "no triangles"),
        ({"box.obj": BOX.replace("box.mtl", "other.mtl")}, "holds no made/box/other.mtl"),
        ({"wood.png": b"not a picture"}, "not a readable picture"),
        ({"wood.png": _png((9000, 6000))}, "a picture of more than"),
        ({"box.mtl": MTL.replace("1 1 1", "1 x 1")}, "line 2 can't be read"),
    ],
)
def test_a_bad_model_is_refused_in_one_sentence(tmp_path: Path, changed: dict[str, str], message: str) -> None:
    archive = archives(_pack(tmp_path / "pack", **changed))["S"]
    with pytest.raises(IntegrityError, match=message) as caught:
        read_obj("made/box/box.obj", archive.read)
    assert "\n" not in str(caught.value)


@settings(max_examples=40, deadline=None)
@given(st.text("vft usemli 0123456789./-\n", max_size=200), st.text("newmtlKd map.png0123 \n/", max_size=80))
def test_whatever_a_file_holds_it_is_read_or_refused(obj: str, mtl: str) -> None:
    files = {"a/x.obj": f"mtllib x.mtl\n{BOX[16:]}\n{obj}".encode(), "a/x.mtl": mtl.encode()}

    def read(name: str) -> bytes:
        if name not in files:
            raise IntegrityError(f"no {name}")
        return files[name]

    try:
        solid = read_obj("a/x.obj", read)
    except IntegrityError:
        return
    assert 0 <= solid.faces.min() <= solid.faces.max() < len(solid.points)
    assert 0 <= solid.paint.min() <= solid.paint.max() < len(solid.paints)


def test_thinning_keeps_a_ball_round_and_a_plank_that_touches_nothing() -> None:
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.3)
    plank = trimesh.creation.box((1.4, 0.1, 0.03), trimesh.transformations.translation_matrix((0, 1, 0)))
    points = np.concatenate([ball.vertices, plank.vertices])
    faces = np.concatenate([ball.faces, plank.faces + len(ball.vertices)])
    paint = np.r_[np.zeros(len(ball.faces), int), np.ones(len(plank.faces), int)]
    few, kept_faces, kept = simplify_mesh(points, faces, 400, kinds=paint)
    assert 350 <= len(kept_faces) <= 400
    worn = paint[kept]
    board = few[np.unique(kept_faces[worn == 1])]
    assert np.allclose(np.ptp(board, axis=0), (1.4, 0.1, 0.03), atol=1e-6)
    away = np.linalg.norm(few[np.unique(kept_faces[worn == 0])], axis=1)
    assert np.abs(away - 0.3).max() < 0.01
    light = trimesh.Trimesh(few, kept_faces[worn == 0], process=False)
    assert light.volume == pytest.approx(ball.volume, rel=0.03)


def test_a_picture_stays_in_its_place_on_a_thinned_surface() -> None:
    n = 24
    x, y = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n))
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(n * n)])
    a = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate([np.stack([a, a + 1, a + n], 1), np.stack([a + 1, a + n + 1, a + n], 1)])
    paint = np.zeros(len(faces), int)
    few, kept_faces, kept = simplify_mesh(points, faces, 60, kinds=paint)
    uv = transfer_uv(few, kept_faces, paint[kept], points, faces, points[faces][..., :2], paint)
    assert len(kept_faces) <= 60
    assert np.allclose(uv, few[kept_faces][..., :2], atol=1e-9)
    assert np.allclose([few.min(0), few.max(0)], [points.min(0), points.max(0)], atol=1e-3)


def test_a_model_fills_ours_and_looks_our_way(empty_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pack = _pack(empty_cache / "pack")
    _choose(monkeypatch, wardrobe=(StandIn("S", "box", _digest(pack)[:20]),))
    said: list[str] = []
    fetch_things(pack, say=said.append)
    ours = our_models()["wardrobe"].bounds
    surfaces = read_things()[0]["wardrobe"]
    points = np.concatenate([s.positions for s in surfaces])
    assert np.allclose([points.min(0), points.max(0)], ours, atol=1e-5)
    by_name = {s.material.name: s for s in surfaces}
    # The list's front is z, ours is x: the red face.
    front = by_name["thing"]
    assert np.allclose(front.normals, (1, 0, 0), atol=1e-5)
    assert (front.colour == (255, 0, 0)).all()
    wood = by_name["S/box/0"].material.texture
    assert wood is not None
    assert wood.shape == (16, 32, 3)
    (credit,) = credits_of(["wardrobe"])
    assert credit.licence == "CC-BY-3.0"
    assert "box by Ada" in credit.words
    assert any("box by Ada" in sentence for sentence in said)


def test_the_same_pack_bakes_to_the_same_bytes(empty_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pack = _pack(empty_cache / "pack")
    _choose(monkeypatch, chair=(StandIn("S", "box", ""), StandIn(OURS, "chair", "", box=(1, 0, 0, 1, 0, 0))))
    first = fetch_things(pack).read_bytes()
    assert fetch_things(pack, force=True).read_bytes() == first


def test_another_model_than_the_one_tried_is_left_out(empty_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pack = _pack(empty_cache / "pack")
    _choose(monkeypatch, chair=(StandIn("S", "box", "0123"),), sofa=(StandIn("S", "box", ""),))
    said: list[str] = []
    fetch_things(pack, say=said.append)
    assert read_things()[0].keys() == {"sofa"}
    assert any("chair stays our own model" in sentence for sentence in said)


def test_a_damaged_cache_is_told_and_baked_anew(empty_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pack = _pack(empty_cache / "pack")
    _choose(monkeypatch, sofa=(StandIn("S", "box", ""),))
    baked = fetch_things(pack)
    baked.write_bytes(baked.read_bytes()[:-9])
    read_things.cache_clear()
    assert not available_things()
    with pytest.raises(SchemaError, match="vico assets install things --force"):
        read_things()
    fetch_things(pack)
    assert available_things()


def test_without_a_pack_the_command_to_type_is_told(empty_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(MissingExtraError, match="vico assets install things"):
        read_things()
    monkeypatch.setenv("PATH", "")
    with pytest.raises(FetchError, match=r"no apt-get: .*--pack FILE"):
        fetch_things()


def test_every_stand_in_is_for_a_model_of_ours_and_light() -> None:
    models = our_models()
    for name, pieces in STAND_INS.items():
        assert name in models
        assert sum(piece.triangles for piece in pieces if piece.pack != OURS) <= 14_000
        for piece in pieces:
            assert piece.pack == OURS or (piece.pack in COLLECTIONS and len(piece.digest) == 20)
            assert piece.pack != OURS or piece.name in models
            if piece.box is not None and piece.pack != OURS:
                reach = np.array(models[name].size) * (0.5, 0.5, 1.0) + 0.05
                assert (np.abs(piece.box) <= np.tile(reach, 2)).all()
