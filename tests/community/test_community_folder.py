"""A community on disk: whole, the same again, and refused when it is not what it should be."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from toytown import make_world
from vico.community import Community, digest_of, read_community, read_manifest, write_community
from vico.errors import MissingFileError, OutputExistsError, SchemaError
from vico.io.files import sha256_of
from vico.world.world import World


@pytest.fixture
def folder(community: Community, tmp_path: Path) -> Path:
    write_community(community, tmp_path / "people")
    return tmp_path / "people"


def test_what_is_written_is_read_again(community: Community, folder: Path, town: World) -> None:
    assert read_community(folder, town) == community


def test_the_digest_is_the_manifests_hash(community: Community, folder: Path) -> None:
    assert digest_of(community) == sha256_of(folder / "community.json")


def test_the_manifest_counts_what_is_there(community: Community, folder: Path) -> None:
    counts = read_manifest(folder).counts
    assert counts == {
        "residents": 15,
        "groups": len(community.groups),
        "relations": len(community.relations),
        "days": 0,
    }


def test_an_existing_folder_is_refused_without_force(community: Community, folder: Path) -> None:
    with pytest.raises(OutputExistsError, match="--force"):
        write_community(community, folder)


def test_force_replaces_a_community(community: Community, folder: Path) -> None:
    write_community(community, folder, force=True)
    assert read_community(folder) == community


def test_force_spares_a_folder_with_other_things(community: Community, folder: Path) -> None:
    (folder / "thesis.tex").write_text("years of work")
    with pytest.raises(OutputExistsError, match=r"thesis\.tex"):
        write_community(community, folder, force=True)
    assert (folder / "thesis.tex").exists()


def test_nothing_half_written_is_left(community: Community, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError("no space left on device")

    monkeypatch.setattr("vico.community.folder.write_bytes", full)
    with pytest.raises(OSError, match="no space"):
        write_community(community, tmp_path / "people")
    assert list(tmp_path.iterdir()) == []


def change_manifest(folder: Path, **change: object) -> None:
    content = json.loads((folder / "community.json").read_text())
    (folder / "community.json").write_text(json.dumps({**content, **change}))


def test_another_version_is_refused(folder: Path) -> None:
    change_manifest(folder, version=99)
    with pytest.raises(SchemaError, match="version 99"):
        read_community(folder)


def test_another_schema_is_refused(folder: Path) -> None:
    change_manifest(folder, schema_name="vico.world")
    with pytest.raises(SchemaError, match=r"vico\.world"):
        read_community(folder)


def test_another_world_is_refused(folder: Path) -> None:
    with pytest.raises(SchemaError, match="made for world 'toytown'"):
        read_community(folder, make_world(name="elsewhere"))


def test_a_changed_part_is_refused(folder: Path) -> None:
    (folder / "groups.json").write_text("[]")
    with pytest.raises(SchemaError, match="changed since"):
        read_community(folder)


def test_a_missing_folder_says_so(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="no such folder"):
        read_community(tmp_path / "nobody")


def test_an_unfinished_folder_says_so(folder: Path) -> None:
    (folder / "community.json").unlink()
    with pytest.raises(MissingFileError, match="no finished community"):
        read_community(folder)
