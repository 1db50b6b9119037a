"""How many storeys houses have in a place that says nothing of any."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from vico.worldgen.facts.building_heights import level_estimates


def _storeys(wide: float, deep: float, gap: float, lon: float = 15.6, **tags: str) -> tuple[set[int], set[str]]:
    rows = [
        (f"w{i}.{j}", shapely.box(x, y, x + wide, y + deep), {"building": "yes", **tags})
        for i, x in enumerate(np.arange(0.0, 300.0, wide + gap))
        for j, y in enumerate(np.arange(0.0, 300.0, deep + gap))
    ]
    none = np.zeros(len(rows), np.int64)
    levels, rules = level_estimates(rows, none, none, ["residential"] * len(rows), lon)
    return set(levels.tolist()), set(rules)


@pytest.mark.parametrize(
    ("wide", "deep", "gap", "storeys"),
    [
        pytest.param(24.0, 20.0, 6.0, 5, id="blocks of a city"),
        pytest.param(14.0, 12.0, 3.0, 3, id="houses of an old town"),
        pytest.param(16.0, 14.0, 30.0, 2, id="a suburb"),
        pytest.param(60.0, 13.0, 50.0, 5, id="slabs of flats on lawns"),
        pytest.param(40.0, 30.0, 100.0, 2, id="halls"),
    ],
)
def test_footprints_tell_what_kind_of_place_it_is(wide: float, deep: float, gap: float, storeys: int) -> None:
    assert _storeys(wide, deep, gap) == ({storeys}, {"town"})


def test_what_is_no_house_is_no_slab() -> None:
    assert _storeys(60.0, 13.0, 50.0, building="retail")[0] == {2}
    assert _storeys(24.0, 20.0, 6.0, lon=-76.6)[0] == {4}
