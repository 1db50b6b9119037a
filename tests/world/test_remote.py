"""Worlds in an object store are copied once, checked, and the same as where they came from."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from s3_server import S3Server, needs_s3
from vico.errors import MissingFileError, SchemaError
from vico.io.stores import store_at
from vico.world.folder import fetch_manifest, fetch_world, read_world

pytestmark = needs_s3


@pytest.fixture
def url(corner_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Return where the small world is in a bucket."""
    monkeypatch.setenv("VICO_CACHE", str(tmp_path / "cache"))
    with S3Server() as server:
        bucket = server.bucket("worlds")
        with store_at(bucket).new_folder("helsinki", last="world.json") as folder:
            shutil.copytree(corner_path, folder)
        yield f"{bucket}/helsinki"


def test_a_world_is_copied_once_and_is_the_same(url: str, corner_path: Path) -> None:
    with ThreadPoolExecutor(3) as threads:
        folders = set(threads.map(fetch_world, [url] * 3))
    (folder,) = folders
    assert folder.name == "helsinki"
    world = read_world(folder)
    assert world.digest == read_world(corner_path).digest
    assert len(world.buildings) == len(read_world(corner_path).buildings)
    before = (folder / "terrain.npz").stat().st_mtime_ns
    assert fetch_world(f"{url}/") == folder
    assert (folder / "terrain.npz").stat().st_mtime_ns == before


def test_its_manifest_says_which_it_is(url: str, corner_path: Path) -> None:
    folder = fetch_manifest(url)
    assert [path.name for path in folder.iterdir()] == ["world.json"]
    assert read_world(folder).digest == read_world(corner_path).digest


def test_what_is_not_whole_is_refused_and_not_kept(url: str) -> None:
    store = store_at(url)
    store.write("terrain.npz", b"other")
    with pytest.raises(SchemaError, match=r"terrain.npz is not the file that world.json names"):
        fetch_world(url)
    store.remove("terrain.npz")
    with pytest.raises(MissingFileError, match=r"lacks terrain.npz"):
        fetch_world(url)
    with pytest.raises(MissingFileError, match=r"holds no world.json"):
        fetch_world(f"{url}/nothing")
