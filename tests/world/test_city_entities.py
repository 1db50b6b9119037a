"""Kind and name of a city's things are looked up in its tiles, and are those of all its things joined."""

from __future__ import annotations

import shutil
from functools import cached_property
from pathlib import Path

import numpy as np
import pytest

from vico.world.city import City, CityManifest, CityTile
from vico.world.city_world import CityEntities, CityWorld
from vico.world.model import FIRST_STOP, Origin
from vico.world.objects import write_objects
from vico.world.transit import Transit
from vico.world.world import World

TILES = [(-1, 0), (1, 0), (0, 1)]


class Joined(CityWorld):
    """A city of which all is read and joined, as of a world."""

    entities = World.__dict__["entities"]


class WithTransit(CityWorld):
    """A city that has the stops of the corner."""

    @cached_property
    def transit(self) -> Transit:
        """Stops of one tile."""
        return self.city.world((1, 0)).transit


class JoinedWithTransit(WithTransit, Joined):
    """Both."""


@pytest.fixture(scope="module")
def city(corner: World, corner_path: Path, tmp_path_factory: pytest.TempPathFactory) -> City:
    """Three tiles of a grid of six, each the corner; one has a thing beside a stop that no list of stops names."""
    folder = tmp_path_factory.mktemp("city")
    tiles = []
    for column, row in TILES:
        name = f"{column}_{row}"
        shutil.copytree(corner_path, folder / "tiles" / name)
        tiles.append(CityTile(column=column, row=row, name=name, digest=corner.digest, buildings=1, places=1))
    for (column, row), (there, number) in zip(TILES[:2], [(3, 9_000), (5, 9_000)], strict=True):
        objects = corner.objects.where(np.arange(len(corner.objects)))
        objects.entity[there] = FIRST_STOP + number
        write_objects(folder / "tiles" / f"{column}_{row}" / "objects.parquet", objects)
    manifest = CityManifest(
        producer="x", origin=Origin(lat=60.0, lon=24.0), size=120.0, first=(-1, 0), last=(1, 1), seed=0, tiles=tiles
    )
    return City(manifest, folder)


def test_each_is_what_it_is_where_all_are_joined(city: City) -> None:
    world, joined = WithTransit(city), JoinedWithTransit(city).entities
    found = world.entities
    assert isinstance(found, CityEntities)
    assert isinstance(joined, dict)
    assert len(joined) > 3000
    assert FIRST_STOP + 9_000 in joined
    assert {entity: found[entity] for entity in joined} == joined
    assert found == joined
    assert len(found) == len(joined)
    assert len(list(found)) == len(set(found)) == len(joined)
    last = int(np.random.default_rng(0).choice(list(joined)))
    assert found[np.int32(last)] == found.get(last) == joined[last]  # type: ignore[index]


def test_what_there_is_not_is_not_found(city: City) -> None:
    found, joined = WithTransit(city).entities, JoinedWithTransit(city).entities
    between = {around + step for around in joined for step in (-1, 1)} - set(joined)
    for entity in [*between, -5, 0, 7, 1_000, FIRST_STOP, 1_000_000, 1_999_999, 2_500_001, 4_500_000, 5_001_000, 10**9]:
        assert (entity in found) == (entity in joined)
        assert found.get(entity) == joined.get(entity)
    with pytest.raises(KeyError):
        found[0]


def test_only_tiles_whose_things_are_asked_for_are_read(city: City, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[tuple[int, int]] = []
    world = WithTransit(city)
    number = world.buildings[-1].entity
    found = world.entities
    monkeypatch.setattr(city, "world", lambda tile: opened.append(tile) or City.world(city, tile))  # type: ignore[func-returns-value]
    assert found[number]["kind"] == "building"
    assert number + 1_000_000 not in found
    assert 1 in found
    assert [found[number] for _ in range(3)]
    assert opened == [(0, 1)]
