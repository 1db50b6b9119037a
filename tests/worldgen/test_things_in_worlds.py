"""Worlds that show models of an installed pack: carried in their own meshes, credited in their manifest."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vico.assets import furniture_pack as things
from vico.assets.furniture_pack import baked_things, our_models, read_things
from vico.assets.shapes import box
from vico.errors import MissingExtraError
from vico.io.files import sha256_of, write_json
from vico.world.glb import write_glb
from vico.world.objects import Objects
from vico.worldgen.objects.stage import models_of
from vico.worldgen.request import Sources


def _row(prototype: str, k: int) -> dict[str, object]:
    model = our_models()[prototype]
    x, y, z = model.size
    row: dict[str, object] = {"id": f"o{k}", "entity": k, "kind": model.kind, "group": model.group}
    row |= {"prototype": prototype, "x": 0.0, "y": 0.0, "z": 0.0, "yaw": 0.0, "scale": 1.0}
    return row | {"size_x": x, "size_y": y, "size_z": z, "solid": True, "room": ""}


@pytest.fixture
def baked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> object:
    """A cache in which the pack gives a red chair and a red sofa."""
    monkeypatch.setenv("VICO_CACHE", str(tmp_path))
    for kept in (baked_things, read_things):
        kept.cache_clear()
    path = things.baked_things()
    write_glb(path, {name: [box((1, 1, 1), (0, 0, 0.5), colour=(255, 0, 0))] for name in ("chair", "sofa")})
    made_of = {name: [{"pack": "K", "name": f"their {name}", "creator": "Ada"}] for name in ("chair", "sofa")}
    write_json(path.with_suffix(".json"), {"schema": "vico.things", "sha256": sha256_of(path), "models": made_of})
    yield path
    for kept in (baked_things, read_things):
        kept.cache_clear()


def test_a_world_carries_what_it_shows_and_thanks_for_that_alone(baked: Path) -> None:
    objects = Objects.from_rows([_row("chair", 1), _row("bench", 2)])
    models, credits = models_of(objects, installed=True)
    assert models.keys() == {"chair", "bench"}
    assert (models["chair"][0].colour == (255, 0, 0)).all()
    assert np.array_equal(models["bench"][0].positions, our_models()["bench"].surfaces[0].positions)
    (credit,) = credits
    assert (credit.kind, credit.licence, credit.sha256) == ("things", "CC-BY-3.0-US", sha256_of(baked))
    assert "their chair by Ada" in credit.attribution
    assert "sofa" not in credit.attribution


def test_worlds_show_our_own_models_unless_asked(baked: Path) -> None:
    objects = Objects.from_rows([_row("chair", 1)])
    models, credits = models_of(objects, installed=False)
    assert credits == []
    assert np.array_equal(models["chair"][0].positions, our_models()["chair"].surfaces[0].positions)


def test_sources_remember_whose_models_were_asked_for(tmp_path: Path) -> None:
    osm = tmp_path / "map.osm"
    osm.touch()
    assert Sources.from_json(Sources(osm, installed_things=True).to_json()).installed_things
    assert not Sources.from_json(Sources(osm).to_json()).installed_things


def test_a_pack_that_is_not_there_is_told_before_anything_is_built(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from road_city import EXTRACT
    from vico.worldgen.pipeline import build_world

    monkeypatch.setenv("VICO_CACHE", str(tmp_path / "cache"))
    for kept in (baked_things, read_things):
        kept.cache_clear()
    with pytest.raises(MissingExtraError, match="vico assets install things"):
        build_world(Sources(EXTRACT, installed_things=True), lat=60.169, lon=24.9435, half=50.0, out=tmp_path / "w")
    assert not (tmp_path / "w").exists()
    read_things.cache_clear()
    baked_things.cache_clear()
