"""Buildings of several sources as one town: who is whose, whose word counts, and roofs as they were measured."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import manifold3d
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import Polygon, box

from vico.errors import InputError, SchemaError
from vico.geo.buildings import FoundBuilding, FoundBuildings, RoofFacet
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmArea, OsmData
from vico.geo.overlay import OverlayError
from vico.io.data_files import PACKAGED
from vico.worldgen.buildings.stage import BuildingsResult, buildings_from_plans
from vico.worldgen.facts.building_outlines import building_plans
from vico.worldgen.facts.building_plans import parts_of_roof
from vico.worldgen.facts.conflation import ConflatedMap, Precedence, conflate_buildings, read_precedence
from vico.worldgen.facts.roofs import measured_solid
from vico.worldgen.ground.terrain import flat_terrain

FRAME = LocalFrame(52.51, 13.39)
USUAL = read_precedence(None, [])
HOUSE = box(-5, -4, 5, 4)


def gable(outline: Polygon, eaves: float, ridge: float) -> tuple[RoofFacet, ...]:
    """Two slopes over a box, the ridge along its length."""
    west, south, east, north = outline.bounds
    middle, rise = (south + north) / 2, (ridge - eaves) / ((north - south) / 2)
    return (
        RoofFacet(box(west, south, east, middle), (eaves - rise * south, 0.0, rise)),
        RoofFacet(box(west, middle, east, north), (eaves + rise * north, 0.0, -rise)),
    )


def level(outline: Polygon, height: float) -> RoofFacet:
    return RoofFacet(outline, (height, 0.0, 0.0))


def town(*areas: tuple[str, Polygon, dict[str, str]]) -> OsmData:
    return OsmData(FRAME, 100.0, 60.0, [], [], [OsmArea(*area) for area in areas], [])


def model(*buildings: FoundBuilding, kind: str = "citygml", file: str = "city.gml") -> FoundBuildings:
    return FoundBuildings(kind, file, "0", buildings)


def found(
    outline: Polygon, *, kind: str = "citygml", file: str = "city.gml", key: str = "a", **more: Any
) -> FoundBuilding:
    return FoundBuilding(f"{kind}:{key}", kind, file, outline, more.pop("tags", {}), **more)


def built(merged: ConflatedMap) -> BuildingsResult:
    plans = building_plans(merged.osm, seed=0, measured=merged.facets, origins=merged.origins)
    return buildings_from_plans(plans, merged.osm, flat_terrain(half=100.0), seed=0)


MAPPED = {"building": "apartments", "name": "Linden House", "addr:street": "Lindenweg", "building:levels": "2",
          "roof:shape": "flat"}  # fmt: skip


def test_a_measured_roof_is_built_and_the_map_s_tags_stay() -> None:
    shifted = shapely.affinity.translate(HOUSE, 0.4, 0.3)
    house = found(shifted, facets=gable(shifted, 6.0, 9.0), tags={"height": "9.00", "roof:shape": "gabled"})
    merged = conflate_buildings(town(("w1", HOUSE, MAPPED)), [model(house)], USUAL)
    (record,) = built(merged).records
    assert record.name == "Linden House"
    assert record.tags["addr:street"] == "Lindenweg"
    assert record.use == "residential"
    assert record.levels == 2
    assert record.roof_shape == "gabled"
    assert record.height == pytest.approx(9.0, abs=0.01)
    assert Polygon(record.footprint[0]).symmetric_difference(shifted).area < 0.5
    assert record.sources is not None
    assert record.sources.model_dump() == {
        "footprint": "citygml:city.gml",
        "height": "citygml:city.gml",
        "roof": "citygml:city.gml surfaces",
    }


def test_every_building_says_where_its_facts_are_from_and_the_town_is_watertight() -> None:
    osm = town(
        ("w1", HOUSE, MAPPED),
        ("w2", box(20, 0, 32, 10), {"building": "yes", "height": "8"}),
        ("w3", box(40, 0, 52, 10), {"building": "yes"}),
    )
    lod2 = model(found(HOUSE, facets=gable(HOUSE, 6.0, 9.0), tags={"height": "9.00"}))
    footprints = model(
        found(box(40, 0, 52, 10), kind="overture", file="o.parquet", tags={"building:levels": "5"}),
        found(box(-40, 0, -20, 10), kind="overture", file="o.parquet", key="new", tags={"height": "7"}),
        found(box(5, 3, 11, 9), kind="overture", file="o.parquet", key="half", tags={}),
        kind="overture", file="o.parquet",
    )  # fmt: skip
    merged = conflate_buildings(osm, [lod2, footprints], USUAL)
    result = built(merged)
    sources = {record.id: record.sources for record in result.records}
    assert result.watertight == len(result.records) == 5
    assert [sources[key].height for key in ("w1", "w2", "w3")] == [  # type: ignore[union-attr]
        "citygml:city.gml", "osm height tag", "overture:o.parquet",
    ]  # fmt: skip
    assert sources["w2"].roof.startswith("rule")  # type: ignore[union-attr]
    new = [record for record in result.records if record.id.startswith("x")]
    assert {record.sources.footprint for record in new} == {"overture:o.parquet"}  # type: ignore[union-attr]
    # A tenth of it lies in the map's house: free, so it is added; what it shares is cut from the lower one.
    assert len(new) == 2
    assert merged.counts["buildings_matched"] == 2


def test_what_half_overlaps_is_neither_the_same_nor_another() -> None:
    aside = model(found(box(0, -4, 16, 4), tags={"height": "9"}))
    merged = conflate_buildings(town(("w1", HOUSE, MAPPED)), [aside], replace_precedence(same=0.6))
    assert merged.osm.areas[0].tags == MAPPED
    assert len(merged.osm.areas) == 1
    assert [(one.id, "w1 covers 31 %" in one.reason) for one in merged.dropped] == [("citygml:a", True)]


def replace_precedence(**more: Any) -> Precedence:
    return USUAL.model_copy(update=more)


def test_another_order_gives_the_map_its_word_back() -> None:
    house = found(HOUSE, facets=gable(HOUSE, 9.0, 12.0), tags={"height": "12.00"})
    osm_first = ("osm", "lod2")
    order = replace_precedence(footprint=osm_first, height=osm_first, roof=osm_first)
    merged = conflate_buildings(town(("w1", HOUSE, MAPPED)), [model(house)], order)
    assert merged.osm.areas[0].tags == MAPPED
    assert merged.facets == {}
    (record,) = built(merged).records
    assert record.sources is not None
    assert record.sources.height == "osm levels tag"
    assert record.sources.roof == "osm roof:shape tag"
    # A source that a list does not name does not count, not even the map.
    nobody = replace_precedence(height=(), roof=())
    assert (
        "building:levels"
        not in conflate_buildings(town(("w1", HOUSE, MAPPED)), [model(house)], nobody).osm.areas[0].tags
    )


def test_a_file_s_own_name_goes_before_its_kind() -> None:
    old = found(HOUSE, file="old.gml", tags={"height": "7"})
    new = found(HOUSE, file="new.gml", tags={"height": "11"})
    order = replace_precedence(height=("new.gml", "lod2"))
    merged = conflate_buildings(
        town(("w1", HOUSE, MAPPED)), [model(old, file="old.gml"), model(new, file="new.gml")], order
    )
    assert merged.osm.areas[0].tags["height"] == "11"


def test_two_models_in_one_outline_are_its_roof_together_and_one_over_two_is_each_s() -> None:
    west, east = box(-5, -4, 0, 4), box(0, -4, 5, 4)
    two = model(
        found(west, key="w", facets=(level(west, 6.0),), tags={"height": "6"}),
        found(east, key="e", facets=(level(east, 12.0),), tags={"height": "12"}),
    )
    (record,) = built(conflate_buildings(town(("w1", HOUSE, MAPPED)), [two], USUAL)).records
    assert record.height == pytest.approx(12.0, abs=0.7)
    one = model(found(HOUSE, facets=gable(HOUSE, 6.0, 9.0), tags={"height": "9"}))
    osm = town(("w1", west, {"building": "house"}), ("w2", east, {"building": "house"}))
    merged = conflate_buildings(osm, [one], USUAL)
    assert set(merged.facets) == {"w1", "w2"}
    assert {origin.footprint for origin in merged.origins.values()} == {"osm"}
    assert [record.height for record in built(merged).records] == pytest.approx([9.0, 9.0], abs=0.01)


def test_parts_that_the_map_draws_give_way_to_a_measured_roof() -> None:
    osm = town(("w1", HOUSE, MAPPED), ("w2", box(-5, -4, 0, 4), {"building:part": "yes", "height": "30"}))
    merged = conflate_buildings(osm, [model(found(HOUSE, facets=gable(HOUSE, 6.0, 9.0)))], USUAL)
    assert [area.id for area in merged.osm.areas] == ["w1"]
    assert merged.dropped[0].reason == "part of w1, whose roof is measured"


def test_a_measured_solid_encloses_what_its_surfaces_say() -> None:
    solid = measured_solid(HOUSE, 0.0, gable(HOUSE, 6.0, 9.0))
    assert solid.volume() == pytest.approx(80 * 7.5, rel=1e-3)
    assert solid.genus() == 0


def test_a_tower_beside_a_wing_is_two_parts_and_a_dormer_is_none() -> None:
    tower, wing, dormer = box(-5, -4, 1, 4), box(1, -4, 5, 4), box(-3, -1, -1, 1)
    parts = parts_of_roof(HOUSE, [level(tower, 20.0), level(wing, 6.0), level(dormer, 21.5)], {"building": "yes"})
    assert sorted((round(part.polygon.area), round(part.eaves)) for part in parts) == [(32, 6), (48, 20)]


def test_a_roof_under_the_floor_is_refused_and_the_house_gets_a_fitted_one() -> None:
    sunk = (RoofFacet(HOUSE, (3.0, 1.0, 0.0)),)
    with pytest.raises(OverlayError, match="below its floor"):
        parts_of_roof(HOUSE, sunk, {})
    merged = conflate_buildings(
        town(("w1", HOUSE, MAPPED)),
        [model(found(HOUSE, facets=sunk, tags={"height": "9", "roof:shape": "hipped"}))],
        USUAL,
    )
    result = built(merged)
    assert result.records[0].sources is not None
    assert result.records[0].sources.roof == "citygml:city.gml fitted"
    assert result.records[0].roof_shape == "hipped"
    assert "fitted instead of built" in result.dropped[0].reason


@settings(max_examples=15)
@given(st.lists(st.tuples(*(st.floats(-0.02, 0.02) for _ in range(8))), min_size=6, max_size=6), st.floats(0.0, 6.28))
def test_surfaces_that_nearly_fit_make_a_closed_solid(noise: list[tuple[float, ...]], turn: float) -> None:
    # Six pieces of a gable whose shared corners were each moved by up to 2 cm, as models have them.
    facets = []
    for k, moves in enumerate(noise):
        facet = gable(HOUSE, 6.0, 9.0)[k % 2]
        west, south, _, north = facet.polygon.bounds
        x = west + (k // 2) * 10 / 3
        piece = np.array(box(x, south, x + 10 / 3, north).exterior.coords)[:4] + np.array(moves).reshape(4, 2)
        facets.append(RoofFacet(shapely.affinity.rotate(Polygon(piece), 0.0), facet.plane))
    rotated = [
        RoofFacet(
            shapely.affinity.rotate(f.polygon, turn, origin=(0, 0), use_radians=True), rotated_plane(f.plane, turn)
        )
        for f in facets
    ]
    outline = shapely.affinity.rotate(HOUSE, turn, origin=(0, 0), use_radians=True)
    solid = measured_solid(outline, 0.0, rotated)
    assert solid.status() == manifold3d.Error.NoError
    assert solid.volume() == pytest.approx(600.0, rel=0.02)


def rotated_plane(plane: tuple[float, float, float], turn: float) -> tuple[float, float, float]:
    c, gx, gy = plane
    return c, float(gx * np.cos(turn) - gy * np.sin(turn)), float(gx * np.sin(turn) + gy * np.cos(turn))


@pytest.mark.parametrize(
    ("old", "new", "error", "says"),
    [
        ('terrain = "finest"', 'terrain = "best"', SchemaError, "terrain"),
        ("same = 0.5", "same = 0.1", InputError, r"free \(0\.2\) is larger than same"),
        ("same = 0.5", "same = 0.5\nlook = 1", SchemaError, "look"),
        ('added = ["lod2", "overture"]', 'added = ["lod2", "google"]', InputError, "added: no source 'google'"),
        ('added = ["lod2", "overture"]', 'added = ["lod2", "lod2"]', InputError, "added: lod2 twice"),
        ('added = ["lod2", "overture"]', "", SchemaError, "added: field required"),
    ],
)
def test_an_order_that_is_none_is_refused(
    old: str, new: str, error: type[Exception], says: str, tmp_path: Path
) -> None:
    text = (PACKAGED / "worldgen" / "sources" / "precedence.toml").read_text()
    assert old in text
    path = tmp_path / "mine.toml"
    path.write_text(text.replace(old, new))
    with pytest.raises(error, match=says):
        read_precedence(path, ["city.gml"])


def test_worlds_of_a_map_alone_keep_their_records_as_they_were() -> None:
    osm = town(("w1", HOUSE, MAPPED))
    (record,) = buildings_from_plans(building_plans(osm, seed=0), osm, flat_terrain(half=100.0), seed=0).records
    assert record.sources is None
    assert "sources" not in record.model_dump(mode="json")
    assert replace(building_plans(osm, seed=0).plans[0], origin=None) == building_plans(osm, seed=0).plans[0]
