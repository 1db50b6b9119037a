"""The world folder: what is written is what is read, and what is wrong is said in one sentence."""

import json
import os
import shutil
from pathlib import Path

import pytest

from vico.errors import MissingFileError, SchemaError
from vico.world.folder import kept_world, read_world
from vico.world.model import VERSION, Place
from vico.world.world import LAYERS, World, read_records, seal


@pytest.fixture
def copy(helsinki_path: Path, tmp_path: Path) -> Path:
    """A world folder to spoil."""
    return Path(shutil.copytree(helsinki_path, tmp_path / "world"))


def test_every_layer_has_triangles(helsinki: World) -> None:
    empty = [name for name in LAYERS if not sum(len(s.triangles) for s in helsinki.surfaces(name))]
    assert empty == []


def test_every_object_has_a_model(helsinki: World) -> None:
    assert set(helsinki.objects.prototype.tolist()) <= set(helsinki.prototypes())


def test_the_digest_is_the_manifests(helsinki: World, copy: Path) -> None:
    assert read_world(copy).digest == helsinki.digest


def test_an_opened_world_is_kept_until_it_is_built_anew(copy: Path) -> None:
    world = kept_world(copy)
    assert kept_world(copy / "." / "") is world
    later = (copy / "world.json").stat().st_mtime_ns + 1_000_000
    os.utime(copy / "world.json", ns=(later, later))
    assert kept_world(copy) is not world
    (copy / "world.json").unlink()
    with pytest.raises(MissingFileError, match=r"no finished world"):
        kept_world(copy)


def test_a_folder_without_manifest_is_no_finished_world(copy: Path) -> None:
    (copy / "world.json").unlink()
    with pytest.raises(MissingFileError, match=r"no finished world; make one with vico world build"):
        read_world(copy)


def test_a_world_of_another_version_is_refused_in_one_sentence(copy: Path) -> None:
    manifest = json.loads((copy / "world.json").read_text())
    manifest["version"] = VERSION + 1
    (copy / "world.json").write_text(json.dumps(manifest))
    with pytest.raises(SchemaError, match=rf"version {VERSION + 1}.*reads version {VERSION}; build the world anew"):
        read_world(copy)


def test_a_folder_of_another_kind_is_refused(copy: Path) -> None:
    (copy / "world.json").write_text('{"schema_name": "vico.community", "version": 1}')
    with pytest.raises(SchemaError, match=r"'vico.community' is not 'vico.world'"):
        read_world(copy)


def test_an_unknown_field_is_named_with_its_place(copy: Path) -> None:
    places = json.loads((copy / "places.json").read_text())
    places[3]["colour"] = "red"
    (copy / "places.json").write_text(json.dumps(places))
    with pytest.raises(SchemaError, match=r"3\.colour"):
        read_records(copy / "places.json", Place)


@pytest.mark.parametrize("name", ["walkable.npz", "objects.parquet", "terrain.npz", "meshes/ground.glb"])
def test_a_truncated_file_is_refused_by_name(copy: Path, name: str) -> None:
    content = (copy / name).read_bytes()
    (copy / name).write_bytes(content[: len(content) // 2])
    world = read_world(copy)
    with pytest.raises(SchemaError, match=Path(name).name):
        _ = (world.walkable, world.objects, world.height, world.surfaces("ground"))


def test_entities_are_unique_and_named(helsinki: World) -> None:
    things = len(helsinki.buildings) + len(helsinki.rooms) + len(helsinki.objects)
    assert len(helsinki.entities) >= things


@pytest.mark.parametrize("name", ["terrain.npz", "meshes/roofs.glb", "roads.net.xml"])
def test_a_world_that_lost_a_file_while_it_was_built_is_not_finished(helsinki: World, copy: Path, name: str) -> None:
    (copy / "world.json").unlink()
    (copy / name).unlink()
    with pytest.raises(MissingFileError, match=f"{name}: taken away while the world was built"):
        seal(copy, helsinki.manifest, seconds={})
    assert not (copy / "world.json").exists()
