"""Overlays of outlines that nearly coincide, touch or cross themselves: valid, of one dimension, of the right area."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely import LineString, MultiPolygon, Point, Polygon, box
from shapely.errors import GEOSException
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.overlay import GRID, OverlayError

_OVERLAYS = [overlay.intersection, overlay.difference, overlay.union, overlay.symmetric_difference]
_BOW_TIE = Polygon([(0, 0), (10, 10), (10, 0), (0, 10)])
# As overlays of touching outlines leave them: no exact overlay takes it.
_MIXED = shapely.GeometryCollection([box(0, 0, 4, 4), LineString([(4, 4), (9, 4)]), Point(20, 20)])


@st.composite
def outlines(draw: st.DrawFn) -> Polygon:
    """Outlines as people draw buildings: few corners, centimetres or nothing between some of them, any winding."""
    count = draw(st.integers(3, 12))
    angles = sorted(draw(st.lists(st.integers(0, 628), min_size=count, max_size=count)))
    radii = draw(st.lists(st.sampled_from([0.004, 3.0, 5.0, 5.001, 9.0]), min_size=count, max_size=count))
    x, y = draw(st.floats(-6, 6)), draw(st.floats(-6, 6))
    ring = [(x + r * math.cos(a / 100), y + r * math.sin(a / 100)) for a, r in zip(angles, radii, strict=True)]
    return Polygon(ring[::-1] if draw(st.booleans()) else ring)


@st.composite
def neighbours(draw: st.DrawFn) -> tuple[Polygon, Polygon]:
    """Two outlines; the second is another, or the first again but for rounding, a shift, or corners on its walls."""
    first = draw(outlines())
    off = draw(st.sampled_from([0.0, 1e-12, 1e-9, 1e-5, 4e-4, 0.011]))
    way = draw(st.sampled_from(["other", "again", "shifted", "dense"]))
    if way == "other":
        return first, draw(outlines())
    if way == "again":
        ring = np.array(first.exterior.coords)[:-1]
        signs = draw(st.lists(st.sampled_from([-1.0, 0.0, 1.0]), min_size=2 * len(ring), max_size=2 * len(ring)))
        return first, Polygon(ring + off * np.array(signs).reshape(-1, 2))
    if way == "shifted" or first.length < 1.0:
        return first, shapely.transform(first, lambda points: points + off)
    return first, shapely.transform(shapely.segmentize(first, 0.7), lambda points: points + off)


def _near(one: float, other: float, *shapes: BaseGeometry) -> bool:
    """Whether areas agree within what rounding corners by one grid cell may move outlines."""
    return abs(one - other) <= 4 * GRID * sum(shapely.length(shape) + GRID for shape in shapes)


@given(neighbours())
def test_overlays_of_near_outlines_are_valid_areas_that_add_up(pair: tuple[Polygon, Polygon]) -> None:
    first, second = pair
    made = {operation.__name__: operation(first, second) for operation in _OVERLAYS}
    for shape in made.values():
        assert shape.is_valid
        assert shape.geom_type in ("Polygon", "MultiPolygon")
    a, b = (shapely.make_valid(shape).area for shape in pair)
    common, only_first = made["intersection"].area, made["difference"].area
    if first.is_valid and second.is_valid:
        assert _near(common + only_first, a, first, second)
        assert _near(made["union"].area, a + b - common, first, second)
        assert _near(made["symmetric_difference"].area, a + b - 2 * common, first, second)


@given(neighbours())
def test_results_lie_on_the_grid(pair: tuple[Polygon, Polygon]) -> None:
    points = shapely.get_coordinates(overlay.union(*pair)) / GRID
    assert np.abs(points - np.round(points)).max(initial=0.0) < 1e-6


@given(neighbours())
def test_results_are_overlaid_like_copies_of_them_from_a_file(pair: tuple[Polygon, Polygon]) -> None:
    """A stage is given what another one computed, or what it wrote before: it must come to the same."""
    made = [overlay.union(*pair), overlay.difference(*pair), overlay.on_grid(pair[0]), overlay.union_all(pair)]
    assert (shapely.get_precision(np.array(made, object)) == 0.0).all()
    copies = [shapely.from_wkb(shapely.to_wkb(shape)) for shape in made]
    first, second = (overlay.union_all(shapes, grid=None) for shapes in (made, copies))
    assert shapely.to_wkb(first) == shapely.to_wkb(second)


@given(st.lists(neighbours(), min_size=1, max_size=4))
def test_arrays_give_what_their_elements_give(pairs: list[tuple[Polygon, Polygon]]) -> None:
    first, second = (np.array(column, object) for column in zip(*pairs, strict=True))
    for operation in _OVERLAYS:
        one_by_one = [operation(a, b) for a, b in pairs]
        assert shapely.equals_exact(operation(first, second), one_by_one).all()


@given(st.lists(outlines(), min_size=1, max_size=8), st.floats(-2, 2), st.sampled_from([0.01, 0.3]))
def test_unions_buffers_and_simplified_outlines_are_valid(shapes: list[Polygon], distance: float, off: float) -> None:
    whole = overlay.union_all(shapes)
    assert whole.is_valid
    assert whole.geom_type in ("Polygon", "MultiPolygon")
    assert overlay.buffer(whole, distance, join_style="mitre").is_valid
    assert overlay.simplify(whole, off).is_valid
    assert overlay.on_grid(whole, grid=0.01).is_valid


@given(neighbours())
def test_measures_agree_with_overlays(pair: tuple[Polygon, Polygon]) -> None:
    first, second = (overlay.make_valid(shape) for shape in pair)
    assert _near(overlay.common_area(first, second), overlay.intersection(first, second).area, first, second)


@pytest.mark.parametrize("operation", _OVERLAYS)
def test_what_the_engine_refuses_is_mended(operation: Callable[..., BaseGeometry]) -> None:
    with pytest.raises(GEOSException, match="mixed-dimension"):
        shapely.intersection(_MIXED, box(2, 2, 6, 6), grid_size=GRID)
    with pytest.raises(GEOSException, match="side location conflict"):
        shapely.intersection(_BOW_TIE, box(1, 1, 9, 9))
    for first, second in ((_BOW_TIE, box(1, 1, 9, 9)), (_MIXED, box(2, 2, 6, 6)), (box(2, 2, 6, 6), _MIXED)):
        made = operation(first, second)
        assert made.is_valid
        assert made.geom_type in ("Polygon", "MultiPolygon")
    assert overlay.intersection(_MIXED, box(2, 2, 6, 6)).area == pytest.approx(4.0)
    assert overlay.union_all([_MIXED, _BOW_TIE, box(2, 2, 6, 6)]).is_valid
    assert overlay.common_area(_MIXED, box(2, 2, 6, 6)) == pytest.approx(4.0)


def test_one_that_is_refused_does_not_spoil_an_array() -> None:
    made = overlay.intersection(np.array([box(0, 0, 1, 1), _MIXED, box(0, 0, 3, 3)], object), box(0, 0, 2, 2))
    assert shapely.area(made).tolist() == [1.0, 4.0, 4.0]


def test_areas_that_touch_share_no_area() -> None:
    line = overlay.intersection(box(0, 0, 1, 1), box(1, 0, 2, 1))
    assert (line.geom_type, line.is_empty) == ("Polygon", True)
    comb = Polygon([(0, 0), (9, 0), (9, 3), (6, 3), (6, 1), (3, 1), (3, 3), (0, 3)])
    assert overlay.intersection(comb, box(0, 1, 9, 2)).geom_type == "MultiPolygon"  # and no line along its notch


def test_a_line_across_areas_stays_a_line() -> None:
    line = LineString([(0, 0), (10, 0)])
    crossed = overlay.intersection(line, MultiPolygon([box(1, -1, 2, 1), box(5, 0, 6, 1)]))
    assert crossed.length == pytest.approx(2.0)
    assert overlay.difference(line, box(1, -1, 2, 1)).length == pytest.approx(9.0)
    assert overlay.common_length(line, box(1, -1, 2, 1)) == pytest.approx(1.0)
    assert overlay.offset_curve(line, 1.0).bounds == (0.0, 1.0, 10.0, 1.0)


def test_faces_are_found_where_lines_cross_without_a_common_point() -> None:
    lines = [LineString([(0, k), (3, k)]) for k in range(3)] + [LineString([(k, -1), (k, 3)]) for k in range(3)]
    assert sorted(face.area for face in overlay.polygonize(lines)) == [1.0] * 4
    assert overlay.polygonize([]) == []


def test_nothing_is_the_union_of_nothing() -> None:
    assert overlay.union_all([]).equals(Polygon())
    assert overlay.union_all([Polygon(), box(0, 0, 1, 1)]).area == 1.0


def test_what_can_not_be_overlaid_is_an_error_that_says_where(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: Any, **__: Any) -> BaseGeometry:
        raise GEOSException("TopologyException: side location conflict at 3 4")

    refused.__name__ = "intersection"
    monkeypatch.setattr(shapely, "intersection", refused)
    with pytest.raises(OverlayError, match=r"Polygon of 5 corners at 2\.00, 3\.00.*side location conflict"):
        overlay.intersection(box(2, 3, 9, 9), box(0, 0, 1, 1))
    with pytest.raises(OverlayError) as found:
        overlay.intersection(np.array([box(2, 3, 9, 9)], object), box(0, 0, 1, 1))
    assert found.value.at == 0
