"""No window of any map ends a build or gives a world with a finding, however badly the map is drawn.

A small share of what ``benchmarks/search.py`` searches; ``HYPOTHESIS_PROFILE=search`` makes it another and larger.
"""

from __future__ import annotations

import os
from copy import deepcopy
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from damaged_maps import DAMAGES, read_map, write_map
from random_windows import PACKAGED, Window, damaged_map, extracts, random_window, try_window, window_at
from vico.geo.frame import LocalFrame
from vico.geo.osm import read_osm
from vico.seeds import rng

_SEARCH = os.environ.get("HYPOTHESIS_PROFILE") == "search"
# Shrinking would build hundreds of worlds; the window that failed is printed instead.
_windows = settings(
    max_examples=300 if _SEARCH else 3,
    phases=[Phase.explicit, Phase.reuse, Phase.generate],
    suppress_health_check=list(HealthCheck),
)
_CENTRE = LocalFrame(60.1690, 24.9435)


def _held(window: Window) -> None:
    trial = try_window(window)
    again = f"benchmarks/search.py --window '{window}'"
    assert trial.state in ("fine", "empty"), "\n".join([trial.state, *trial.what, again, trial.detail])


_SHARE = st.floats(0, 1)
_RADIUS = st.integers(60, 150 if _SEARCH else 62)


@_windows
@given(st.sampled_from(extracts()), _SHARE, _SHARE, _RADIUS, st.integers(0, 1000))
def test_any_window_becomes_a_world(extract: Path, east: float, north: float, half: int, seed: int) -> None:
    _held(window_at(extract, east, north, half, (), seed))


@_windows
@given(
    st.sampled_from(extracts()),
    _SHARE,
    _SHARE,
    _RADIUS,
    st.lists(st.sampled_from(sorted(DAMAGES)), min_size=1, max_size=3, unique=True),
    st.integers(0, 1000),
)
def test_any_window_of_a_damaged_map_becomes_a_world(
    extract: Path, east: float, north: float, half: int, damage: list[str], seed: int
) -> None:
    _held(window_at(extract, east, north, half, damage, seed))


def test_a_map_that_is_only_copied_reads_the_same(tmp_path: Path) -> None:
    copy = write_map(read_map(PACKAGED, _CENTRE, 200.0), tmp_path / "copy.osm.pbf")
    one, two = (read_osm(path, _CENTRE, 90.0) for path in (PACKAGED, copy))
    assert {way.id for way in one.ways} <= {way.id for way in two.ways}
    areas = {area.id: area.polygon for area in two.areas}
    assert all(areas[area.id].hausdorff_distance(area.polygon) < 0.02 for area in one.areas)


def test_every_damage_changes_the_map_and_what_its_seed_says() -> None:
    whole = read_map(PACKAGED, _CENTRE, 60.0)
    for name, damage in DAMAGES.items():
        once, again = deepcopy(whole), deepcopy(whole)
        damage(once, rng(1, name))
        damage(again, rng(1, name))
        assert once == again, name
        assert once != whole, name


def test_a_window_is_told_so_that_it_can_be_built_again(tmp_path: Path) -> None:
    window = random_window(7, seed=3, damaged=True, places=[PACKAGED], radius=(60, 90))
    again = Window.parse(str(window))
    assert again == window
    files = [damaged_map(w, tmp_path).read_bytes() for w in (window, again)]
    assert files[0] == files[1]
