"""Walkways of a city are led past what stands there once, and then read."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
import shapely

from vico.world.walkways import Walkways, walkways_of, walkways_past

POSTS = [shapely.box(19.9, 0.7, 20.1, 0.9), shapely.box(9.9, -0.9, 10.1, -0.7)]


def _plain() -> Walkways:
    lines = [("w", np.array([(0.0, 0.0), (40.0, 0.0)])), ("é", np.array([(40.0, 0.0), (40.0, 40.0)]))]
    return walkways_of([(name, False, line, np.zeros(2), 2.0, -1) for name, line in lines], [])


def _same(one: Walkways, other: Walkways) -> bool:
    values = [(getattr(one, field.name), getattr(other, field.name)) for field in fields(Walkways)]
    return all(np.array_equal(a, b) and np.asarray(a).dtype == np.asarray(b).dtype for a, b in values)


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("VICO_CACHE", str(tmp_path))
    return tmp_path / "walkways"


def test_what_was_found_once_is_read_and_is_the_same(cache: Path) -> None:
    found = _plain().clear_of(POSTS)
    assert _same(walkways_past(_plain(), POSTS, None, kept_as="a"), found)
    with mock.patch.object(Walkways, "clear_of", side_effect=AssertionError):
        assert _same(walkways_past(_plain(), POSTS, None, kept_as="a"), found)
    assert len(list(cache.iterdir())) == 1


def test_other_solids_another_city_and_a_damaged_file_are_found_anew(cache: Path) -> None:
    first = walkways_past(_plain(), POSTS, None, kept_as="a")
    assert not _same(walkways_past(_plain(), POSTS[:1], None, kept_as="a"), first)
    walkways_past(_plain(), POSTS, None, kept_as="b")
    assert len(list(cache.iterdir())) == 3
    for path in cache.iterdir():
        path.write_bytes(path.read_bytes()[:60])
    assert _same(walkways_past(_plain(), POSTS, None, kept_as="a"), first)


def test_nothing_is_kept_of_a_world_that_has_no_digest(cache: Path) -> None:
    walkways_past(_plain(), POSTS, None)
    assert not cache.exists()
    cache.parent.joinpath("walkways").write_text("no folder")
    assert _same(walkways_past(_plain(), POSTS, None, kept_as="a"), _plain().clear_of(POSTS))
