"""What fails for one object costs that object alone, and is told."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest
import shapely

from vico.errors import InputError
from vico.geo.overlay import OverlayError
from vico.world.check import check_world
from vico.world.folder import read_world
from vico.world.model import Dropped
from vico.world.world import World
from vico.worldgen.buildings import solids
from vico.worldgen.facts.fault_isolation import NamedShape, buffer_named, collect_losses, drop_on_failure, union_named
from vico.worldgen.pipeline import build_world
from vico.worldgen.request import BuildOptions

EXTRACT = Path(__file__).parents[2] / "src" / "vico" / "data" / "helsinki.osm.pbf"


def built_with(error: Exception, share: int, out: Path, monkeypatch: pytest.MonkeyPatch) -> World:
    """A world in which every `share`-th building can't be seated."""
    seat_of, count = solids.seat_of, iter(range(10_000))

    def failing(*given: object) -> object:
        if next(count) % share == 0:
            raise error
        return seat_of(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(solids, "seat_of", failing)
    build_world(EXTRACT, lat=60.1690, lon=24.9435, half=60, out=out, options=BuildOptions(previews=False))
    return read_world(out)


def lost(world: World) -> list[Dropped]:
    return [d for s in world.manifest.stages for d in s.dropped if d.reason.startswith("can't be made")]


def test_a_building_without_geometry_is_left_out_with_its_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = built_with(OverlayError("side location conflict"), 1000, tmp_path / "w", monkeypatch)
    (gone,) = lost(world)
    assert gone.reason == "can't be made: OverlayError: side location conflict"
    assert gone.id not in world.building_by_id
    assert world.buildings
    assert check_world(world) == []


def test_a_fault_of_the_program_costs_one_building_and_is_a_finding(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        world = built_with(IndexError("list index out of range"), 1000, tmp_path / "w", monkeypatch)
    (gone,) = lost(world)
    assert [(f.id, f.where) for f in check_world(world)] == [("program fault", gone.id)]
    assert "IndexError: list index out of range at test_expendable.py" in gone.reason
    assert gone.id in caplog.text


def test_more_than_a_few_are_a_finding(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    world = built_with(shapely.errors.GEOSException("TopologyException"), 1, tmp_path / "w", monkeypatch)
    assert len(lost(world)) > 2
    assert [(f.id, f.where) for f in check_world(world)] == [("much left out", "buildings")]


def test_what_is_about_the_whole_build_ends_it() -> None:
    for error in (InputError("no such file"), OSError(28, "No space left on device"), MemoryError()):
        with pytest.raises(type(error)), drop_on_failure("w1"):
            raise error


def refusing(operation: str, culprit: shapely.Geometry, monkeypatch: pytest.MonkeyPatch) -> None:
    """The geometry engine does not do this with a geometry, alone or among others."""
    does, cleans = getattr(shapely, operation), shapely.set_precision

    def given(shapes: object) -> bool:
        return any(shape is culprit or shape.equals(culprit) for shape in np.atleast_1d(np.asarray(shapes, object)))

    def failing(shapes: object, *rest: object, **options: object) -> object:
        if given(shapes):
            raise shapely.errors.GEOSException("TopologyException: side location conflict")
        return does(shapes, *rest, **options)

    def not_cleaned(shapes: object, *rest: object, **options: object) -> object:
        return failing(shapes) if given(shapes) else cleans(shapes, *rest, **options)

    failing.__name__ = operation
    monkeypatch.setattr(shapely, operation, failing)
    monkeypatch.setattr(shapely, "set_precision", not_cleaned)


BOXES = [NamedShape(f"w{k}", shapely.box(3 * k, 0, 3 * k + 2, 2)) for k in range(5)]


@pytest.mark.parametrize("culprit", [0, 2, 4])
def test_the_one_that_the_engine_refuses_is_found_among_many(culprit: int, monkeypatch: pytest.MonkeyPatch) -> None:
    refusing("union_all", BOXES[culprit].shape, monkeypatch)
    with collect_losses() as losses:
        whole = union_named(BOXES)
    assert losses.ids == {f"w{culprit}"}
    assert shapely.area(whole) == pytest.approx(16.0)


def test_the_others_keep_their_own_amounts(monkeypatch: pytest.MonkeyPatch) -> None:
    refusing("buffer", BOXES[1].shape, monkeypatch)
    with collect_losses() as losses:
        wide = buffer_named(BOXES, np.array([0.1, 0.2, 0.3, 0.4, 0.5]), join_style="mitre")
    assert losses.ids == {"w1"}
    assert {one.id: round(one.shape.bounds[3] - 2.0, 3) for one in wide} == {"w0": 0.1, "w2": 0.3, "w3": 0.4, "w4": 0.5}


def test_what_is_lost_twice_is_told_once_and_only_to_who_listens() -> None:
    with collect_losses() as outer:
        with collect_losses() as inner:
            for _ in range(2):
                with drop_on_failure("w1"):
                    raise OverlayError("side location conflict")
        with drop_on_failure("w2"):
            pass
    assert [one.id for one in inner.dropped] == ["w1"]
    assert (inner.tried, outer.tried, outer.dropped) == ({"w1"}, {"w2"}, [])
