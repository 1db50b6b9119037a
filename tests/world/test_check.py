"""The checker finds nothing in a sound world, and what was spoiled in a spoiled one."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vico.world.check import check_world
from vico.world.folder import read_world
from vico.world.objects import write_objects
from vico.world.world import World, write_records


@pytest.fixture
def copy(corner_path: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(corner_path, tmp_path / "world"))


def rules(path: Path) -> set[str]:
    return {finding.id for finding in check_world(read_world(path))}


def test_a_fresh_world_has_nothing_wrong(helsinki_path: Path) -> None:
    assert check_world(read_world(helsinki_path)) == []


def test_a_changed_file_is_found(copy: Path) -> None:
    (copy / "transit.json").write_bytes((copy / "transit.json").read_bytes() + b"\n")
    assert "file changed" in rules(copy)


def test_a_missing_file_is_found(copy: Path) -> None:
    (copy / "map.png").unlink()
    assert "file missing" in rules(copy)


def test_an_entrance_off_its_wall_is_found(copy: Path, corner: World) -> None:
    first, *rest = corner.entrances
    x, y, z = first.position
    write_records(copy / "entrances.json", [first.model_copy(update={"position": (x + 1.5, y + 1.5, z)}), *rest])
    assert {"entrance off the wall"} <= rules(copy)


def test_a_place_in_a_building_that_is_not_there_is_found(copy: Path, corner: World) -> None:
    inside = [p for p in corner.places if p.building]
    broken = inside[0].model_copy(update={"building": "w0"})
    write_records(copy / "places.json", [broken, *(p for p in corner.places if p.id != broken.id)])
    assert "place lost" in rules(copy)


def test_rooms_that_overlap_are_found(copy: Path, corner: World) -> None:
    first, second, *rest = corner.rooms
    write_records(copy / "rooms.json", [first, second.model_copy(update={"centre": first.centre}), *rest])
    assert "rooms overlap" in rules(copy)


def test_a_thing_within_a_wall_is_found(copy: Path, corner: World) -> None:
    objects = corner.objects
    outdoors = int(np.flatnonzero(objects.outdoors)[0])
    body = max(corner.surfaces("collision"), key=lambda s: float(np.ptp(s.positions[:, 0])))
    x, y = objects.x.copy(), objects.y.copy()
    x[outdoors], y[outdoors] = body.positions[:, :2].mean(axis=0)
    write_objects(copy / "objects.parquet", replace(objects, x=x, y=y))
    assert "object in a building" in rules(copy)


def test_an_unreadable_part_is_a_finding_and_no_crash(copy: Path) -> None:
    (copy / "rooms.json").write_text("[{]")
    assert "readable" in rules(copy)
