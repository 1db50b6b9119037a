"""Building solids: every roof on every kind of outline is closed and as high as asked."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import Polygon

from vico.world.check.buildings import open_edges
from vico.worldgen.buildings.roofs import building_solid
from vico.worldgen.facts.roofs import SHAPES, Roof, shape_named

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


@pytest.mark.parametrize("shape", [shape for shape in SHAPES if shape != "flat"])
@pytest.mark.parametrize("outline", [RECTANGLE, ELL, COURTYARD], ids=["rectangle", "ell", "courtyard"])
def test_a_roof_is_as_high_as_asked(shape: str, outline: Polygon) -> None:
    box = building_solid(outline, 0.0, 6.0, Roof(shape, 3.0)).bounding_box()
    if outline is COURTYARD and shape in ("dome", "onion", "pyramidal"):
        assert 6.5 < box[5] < 9.0, "its top lies over the courtyard"
    else:
        assert box[5] == pytest.approx(9.0, abs=0.01)
    assert box[2] == pytest.approx(0.0, abs=1e-6)


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


def volume_over_eaves(shape: str, outline: Polygon = RECTANGLE, direction: float | None = None) -> float:
    return float(building_solid(outline, 0.0, 6.0, Roof(shape, 3.0, direction)).volume() - 6.0 * outline.area)


def test_a_half_hip_loses_the_tips_of_its_ends() -> None:
    # Of each end's hip (8 * 4 * 3 / 6) the part above 0.55 of the rise: 0.45 cubed of it.
    lost = volume_over_eaves("gabled") - volume_over_eaves("half-hipped")
    assert lost == pytest.approx(2 * 0.45**3 * 8 * 4 * 3 / 6, rel=0.02)


def test_a_gambrel_and_a_mansard_bulge_over_the_straight_slopes() -> None:
    assert volume_over_eaves("gambrel") > 1.15 * volume_over_eaves("gabled")
    assert volume_over_eaves("mansard") > 1.15 * volume_over_eaves("hipped")


def test_a_barrel_is_half_an_ellipse_and_a_dome_half_an_ellipsoid() -> None:
    assert volume_over_eaves("round") == pytest.approx(20 * math.pi * 4 * 3 / 2, rel=0.02)
    disc = shapely.Point(0, 0).buffer(8, 16)
    assert volume_over_eaves("dome", disc) == pytest.approx(2 / 3 * math.pi * 8 * 8 * 3, rel=0.02)


def test_an_onion_bulges_and_is_not_a_dome() -> None:
    disc = shapely.Point(0, 0).buffer(8, 8)
    solid = building_solid(disc, 0.0, 6.0, Roof("onion", 10.0))
    areas = [abs(solid.slice(6.0 + 10.0 * share).area()) for share in (0.02, 0.21, 0.6, 0.95)]
    assert areas[0] < areas[1]
    assert areas[1] > areas[2] > areas[3] > 0.0
    assert areas[1] == pytest.approx(disc.area, rel=0.02)


def test_a_butterfly_is_low_in_its_middle_and_a_saltbox_uneven() -> None:
    butterfly = building_solid(RECTANGLE, 0.0, 6.0, Roof("butterfly", 3.0)).slice(7.5)
    rings = shapely.union_all([Polygon(np.asarray(ring)) for ring in butterfly.to_polygons()])
    assert not rings.contains(shapely.Point(0, 0))
    assert rings.contains(shapely.Point(0, 3.5))
    saltbox = building_solid(RECTANGLE, 0.0, 6.0, Roof("saltbox", 3.0)).slice(7.0)
    cut = Polygon(np.asarray(saltbox.to_polygons()[0]))
    # The long slope lies left of the ridge, which runs east: it leaves more wall on the right.
    assert cut.bounds[1] == pytest.approx(-4.0, abs=0.01)
    assert cut.bounds[3] < 3.0


def test_gables_of_a_wing_stand_and_hips_of_a_wing_lean() -> None:
    gabled, hipped = (
        building_solid(ELL, 0.0, 6.0, Roof(shape, 3.0)).slice(6.5).bounds() for shape in ("gabled", "hipped")
    )
    assert gabled[2] == pytest.approx(20.0, abs=0.01)
    assert hipped[2] < 19.7


def test_the_ridge_runs_where_it_is_told() -> None:
    # Across the short side the slopes are long: at half height the section is half as long, not half as wide.
    along = building_solid(RECTANGLE, 0.0, 6.0, Roof("gabled", 3.0)).slice(7.5).bounds()
    across = building_solid(RECTANGLE, 0.0, 6.0, Roof("gabled", 3.0, math.pi / 2)).slice(7.5).bounds()
    assert (along[2] - along[0], along[3] - along[1]) == pytest.approx((20.0, 4.0), abs=0.05)
    assert (across[2] - across[0], across[3] - across[1]) == pytest.approx((10.0, 8.0), abs=0.05)


def closed(solid: object) -> bool:
    return not open_edges(np.asarray(solid.to_mesh64().tri_verts, np.int64)).any()  # type: ignore[attr-defined]


@given(
    st.lists(st.tuples(st.floats(5, 25), st.floats(0.05, 0.95)), min_size=4, max_size=12),
    st.sampled_from(SHAPES),
    st.floats(0.0, 0.35),
    st.one_of(st.none(), st.floats(-3.2, 3.2)),
)
@settings(max_examples=80, deadline=None)
def test_any_outline_gives_a_closed_solid(
    spokes: list[tuple[float, float]], shape: str, hole: float, direction: float | None
) -> None:
    n = len(spokes)
    angles = [2 * math.pi * (k + 0.8 * turn) / n for k, (_, turn) in enumerate(spokes)]
    outline = Polygon([(r * math.cos(a), r * math.sin(a)) for (r, _), a in zip(spokes, angles, strict=True)])
    if hole > 0.05:
        cut = (
            shapely.difference(outline, shapely.box(-8 * hole, -3 * hole, 12 * hole, 8 * hole))
            if outline.is_valid
            else outline
        )
        outline = cut if isinstance(cut, Polygon) else outline
    if not outline.is_valid or outline.area < 10:
        return
    solid = building_solid(outline, 0.0, 8.0, Roof(shape, 2.5, direction))
    assert solid.status().name == "NoError"
    assert closed(solid)
    assert 8.0 * outline.area * 0.999 <= solid.volume() <= 10.5 * outline.area * 1.001
    if shape != "flat" and not (outline.interiors and shape in ("dome", "onion", "pyramidal")):
        assert solid.bounding_box()[5] == pytest.approx(10.5, abs=0.02)


@pytest.mark.parametrize(
    ("tag", "expected"),
    [
        ("half-hipped", "half-hipped"),
        ("onion", "onion"),
        ("Gambrel", "gambrel"),
        ("cone", "pyramidal"),
        ("cross_gabled", "crosspitched"),
        ("lean-to", "skillion"),
        ("gabled;hipped", "gabled"),
        ("many", None),
        (None, None),
    ],
)
def test_tagged_shapes_are_built_as_named(tag: str | None, expected: str | None) -> None:
    assert shape_named(tag) == expected
