"""Building solids: every roof on every kind of outline is closed and as high as asked."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import Polygon

from vico.worldgen.roofs import SHAPES, Roof, building_solid, shape_named

RECTANGLE = shapely.box(-10, -4, 10, 4)
ELL = Polygon([(0, 0), (20, 0), (20, 8), (8, 8), (8, 20), (0, 20)])
COURTYARD = Polygon(shapely.box(-20, -15, 20, 15).exterior.coords, [shapely.box(-9, -5, 9, 5).exterior.coords])
STAR = Polygon(
    [
        (10 * math.cos(a) * (1 + k % 2), 10 * math.sin(a) * (1 + k % 2))
        for k, a in enumerate(np.arange(10) * math.pi / 5)
    ]
)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("outline", [RECTANGLE, ELL, COURTYARD, STAR], ids=["rectangle", "ell", "courtyard", "star"])
def test_the_solid_lies_between_its_walls_and_its_full_prism(shape: str, outline: Polygon) -> None:
    solid = building_solid(outline, -0.3, 9.0, Roof(shape, 3.0, 0.4 if shape == "skillion" else None))
    assert solid.status().name == "NoError"
    assert outline.area * 9.3 - 0.1 <= solid.volume() <= outline.area * 12.3 + 0.1


@pytest.mark.parametrize("shape", ["gabled", "hipped", "pyramidal", "skillion", "dome", "round"])
def test_a_pitched_roof_reaches_its_height(shape: str) -> None:
    box = building_solid(RECTANGLE, 0.0, 6.0, Roof(shape, 3.0)).bounding_box()
    assert box[5] == pytest.approx(9.0, abs=0.05)


def test_a_gable_is_half_a_prism() -> None:
    volume = building_solid(RECTANGLE, 0.0, 6.0, Roof("gabled", 3.0)).volume()
    assert volume == pytest.approx(RECTANGLE.area * (6 + 1.5), rel=2e-3)


def test_a_pyramid_is_a_third_of_a_prism() -> None:
    volume = building_solid(RECTANGLE, 0.0, 6.0, Roof("pyramidal", 3.0)).volume()
    assert volume == pytest.approx(RECTANGLE.area * (6 + 1.0), rel=2e-3)


def test_a_hip_loses_its_ends() -> None:
    # A gable of width w loses a third of w * w/2 * h/2 at each end to the hips, w = 8, h = 3.
    gable = building_solid(RECTANGLE, 0.0, 6.0, Roof("gabled", 3.0)).volume()
    hip = building_solid(RECTANGLE, 0.0, 6.0, Roof("hipped", 3.0)).volume()
    assert gable - hip == pytest.approx(2 * 8 * 4 * 3 / 6, rel=0.02)


def test_a_valley_falls_to_its_inner_corner() -> None:
    solid = building_solid(ELL, 0.0, 6.0, Roof("hipped", 3.0))
    # Just inside the reflex corner (8, 8) the roof is at the eaves; half way into the wing it is well above.
    at_corner = solid.slice(6.3)
    square = [np.asarray(ring) for ring in at_corner.to_polygons()]
    section = shapely.union_all([Polygon(ring) for ring in square])
    assert not section.contains(shapely.Point(7.8, 7.8))
    assert section.contains(shapely.Point(4, 4))


@given(st.lists(st.tuples(st.floats(5, 25), st.floats(0.05, 0.95)), min_size=4, max_size=12), st.sampled_from(SHAPES))
@settings(max_examples=60, deadline=None)
def test_any_outline_gives_a_closed_solid(spokes: list[tuple[float, float]], shape: str) -> None:
    n = len(spokes)
    angles = [2 * math.pi * (k + 0.8 * turn) / n for k, (_, turn) in enumerate(spokes)]
    outline = Polygon([(r * math.cos(a), r * math.sin(a)) for (r, _), a in zip(spokes, angles, strict=True)])
    if not outline.is_valid or outline.area < 10:
        return
    solid = building_solid(outline, 0.0, 8.0, Roof(shape, 2.5, 0.1 if shape == "skillion" else None))
    assert solid.status().name == "NoError"
    assert 8.0 * outline.area * 0.999 <= solid.volume() <= 10.5 * outline.area * 1.001


@pytest.mark.parametrize(
    ("tag", "expected"), [("half-hipped", "hipped"), ("onion", "dome"), ("wavy", None), (None, None)]
)
def test_tagged_shapes_map_to_the_nearest_built(tag: str | None, expected: str | None) -> None:
    assert shape_named(tag) == expected
