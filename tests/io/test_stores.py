"""A store is the same to whoever uses it: a folder, or a bucket of a real S3 server."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from s3_server import S3Server, needs_s3
from vico.errors import InputError, MissingExtraError, OutputError, SourceError
from vico.io.stores import Store, is_url, store_at


@pytest.fixture(params=["folder", pytest.param("s3", marks=needs_s3)])
def store(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Store]:
    if request.param == "folder":
        yield store_at(tmp_path / "store")
        return
    with S3Server() as server:
        yield store_at(f"{server.bucket('bucket')}/some/prefix/")


def test_files_are_read_as_they_were_written(store: Store) -> None:
    assert store.read("episodes/a.json") is None
    assert store.names("episodes") == []
    assert not store.has("episodes")
    store.write("episodes/a.json", b"one")
    store.write("episodes/b.json", b"")
    store.write("episodes/a.json", b"two")
    assert store.read("episodes/a.json") == b"two"
    assert store.read("episodes") is None
    assert store.names("episodes") == ["a.json", "b.json"]
    assert store.has("episodes")
    assert store.has("episodes/b.json")
    assert not store.has("episodes/c.json")
    store.remove("episodes/a.json")
    store.remove("episodes/a.json")
    assert store.names("episodes") == ["b.json"]
    assert store_at(str(store)).read("episodes/b.json") == b""


def test_a_folder_goes_there_and_comes_back(store: Store, tmp_path: Path) -> None:
    with store.new_folder("worlds/east", last="world.json") as folder:
        (folder / "meshes").mkdir(parents=True)
        (folder / "meshes" / "ground.glb").write_bytes(bytes(range(256)) * 1000)
        (folder / "world.json").write_text("{}")
    assert store.names("worlds/east") == ["meshes/ground.glb", "world.json"]
    store.fetch_folder("worlds/east", tmp_path / "copy")
    assert (tmp_path / "copy" / "meshes" / "ground.glb").read_bytes() == bytes(range(256)) * 1000
    store.remove("worlds/east")
    assert not store.has("worlds/east")


@needs_s3
def test_a_folder_replaces_what_was_there_and_one_that_fails_leaves_it(tmp_path: Path) -> None:
    with S3Server() as server:
        store = store_at(f"{server.bucket('bucket')}/x")
        with store.new_folder("w") as folder:
            (folder / ".stages").mkdir(parents=True)
            (folder / ".stages" / "kept.npz").touch()
            (folder / "old.json").write_text("old")
        assert store.names("w") == ["old.json"]

        def fail() -> None:
            with store.new_folder("w") as folder:
                folder.mkdir()
                (folder / "new.json").write_text("new")
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            fail()
        assert store.names("w") == ["old.json"]
        with store.new_folder("w") as folder:
            folder.mkdir()
            (folder / "new.json").write_text("new")
        assert store.names("w") == ["new.json"]


@needs_s3
def test_what_a_store_says_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    with S3Server():
        with pytest.raises(OutputError, match=r"s3://nowhere: there is no such bucket; make it"):
            store_at("s3://nowhere").write("a", b"")
        assert store_at("s3://nowhere").read("a") is None
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "x")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "x")
    monkeypatch.setenv("AWS_MAX_ATTEMPTS", "1")
    with pytest.raises(SourceError, match=r"s3://bucket/a: cannot be read: .*; check the address and the keys"):
        store_at("s3://bucket").read("a")
    with pytest.raises(InputError, match="names no bucket"):
        store_at("s3://")
    with pytest.raises(InputError, match="Protocol not known"):
        store_at("nonsense://bucket/x")


def test_without_the_extra_a_url_is_refused_with_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "fsspec", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'virtual-community\[s3\]'"):
        store_at("s3://bucket/x")
    assert is_url("s3://bucket")
    assert not is_url(Path("s3/bucket"))
