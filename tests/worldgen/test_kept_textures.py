"""Painted pictures in the user's cache: the same texels and files as when they are painted, or painted anew."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from vico.world.glb import packed_png
from vico.worldgen import texture_canvas
from vico.worldgen.facades.textures import materials
from vico.worldgen.facades.textures.materials import material
from vico.worldgen.texture_canvas import TextureCache

NAMES = ["wall_brick", "doors", "roof_tiles", "dormer"]


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("VICO_CACHE", str(tmp_path))
    return tmp_path / "textures"


def painters() -> TextureCache:
    return TextureCache(materials.__file__, materials.__name__)


def picture() -> np.ndarray:
    return np.random.default_rng(3).integers(0, 256, (32, 64, 4)).astype(np.uint8)


def never() -> np.ndarray:
    pytest.fail("painted again")


@pytest.mark.parametrize("name", NAMES)
def test_what_is_read_is_what_was_painted(name: str, cache: Path) -> None:
    painted, read = material(name), material(name)
    assert len(list(cache.rglob("*.png"))) == 1
    assert painted.texture is not None
    assert read.texture is not None
    assert painted.texture.dtype == read.texture.dtype == np.uint8
    assert np.array_equal(painted.texture, read.texture)
    assert painted.png == read.png == packed_png(painted.texture)
    assert (painted.cutout, painted.emission) == (read.cutout, read.emission)


def test_a_picture_is_painted_once_for_a_name_and_the_data_it_is_made_of(cache: Path) -> None:
    first = painters().picture("wall", picture, data="a")
    assert np.array_equal(painters().picture("wall", never, data="a")[0], first[0])
    painters().picture("wall", picture, data="b")
    painters().picture("roof ../x", picture, data="b")
    assert len(list(cache.rglob("*.png"))) == 3


@pytest.mark.parametrize("damage", [b"", b"no picture", packed_png(picture())[:200]])
def test_a_damaged_file_is_painted_anew(damage: bytes, cache: Path) -> None:
    whole = painters().picture("wall", picture)[1]
    (file,) = cache.rglob("*.png")
    file.write_bytes(damage)
    assert painters().picture("wall", picture)[1] == whole
    assert file.read_bytes() == whole
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(whole))), picture())


def test_without_a_cache_pictures_are_painted_as_ever(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("a file, where a folder should be")
    monkeypatch.setenv("VICO_CACHE", str(tmp_path / "file"))
    assert np.array_equal(painters().picture("wall", picture)[0], picture())


def test_few_folders_are_kept(cache: Path) -> None:
    for k in range(texture_canvas._KEPT_FOLDERS + 3):
        painters().picture("wall", picture, data=str(k))
    assert len(list(cache.iterdir())) == texture_canvas._KEPT_FOLDERS
