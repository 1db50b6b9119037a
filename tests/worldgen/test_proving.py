"""Buildings that would be findings are made again, plainer, and told."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import shapely
from shapely import Polygon

from stages_alone import buildings_of
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmArea, OsmData
from vico.geo.overlay import OverlayError
from vico.world.check.buildings import check_buildings_apart, check_buildings_closed, check_buildings_seated
from vico.world.world import World
from vico.worldgen.buildings import repair, solids, stage
from vico.worldgen.buildings.stage import BuildingsResult, buildings_from_plans, clad
from vico.worldgen.facts.building_plans import BuildingPlan, BuildingPlans, PartPlan
from vico.worldgen.facts.roofs import Roof
from vico.worldgen.ground.terrain import flat_terrain

TERRAIN = flat_terrain(half=60.0)
NOWHERE = OsmData(LocalFrame(50.0, 8.0), 100.0, 60.0, [], [], [], [])
HOUSE = shapely.box(0, 0, 12, 10)


def house(name: str, polygon: Polygon = HOUSE, **more: Any) -> BuildingPlan:
    part = PartPlan(polygon, 0.0, 10.0, 3, Roof("hipped", 3.0), {"roof:shape": "hipped"})
    return BuildingPlan(name, None, "residential", {}, polygon, 3, 0, [replace(part, **more)])


def findings(built: BuildingsResult) -> list[str]:
    cladding = clad(built.bare, NOWHERE, seed=0)
    layers = {"buildings": cladding.walls, "roofs": cladding.roofs, "collision": built.collision}
    world = SimpleNamespace(path=None, surfaces=layers.__getitem__, buildings=built.records, height=TERRAIN)
    rules = (check_buildings_closed, check_buildings_apart, check_buildings_seated)
    return [finding.id for rule in rules for finding in rule(cast(World, world))]


def built_of(*plans: BuildingPlan) -> tuple[BuildingsResult, dict[str, str]]:
    built = buildings_from_plans(BuildingPlans(list(plans), []), NOWHERE, TERRAIN, seed=0)
    assert findings(built) == []
    return built, {entry.id: entry.reason for entry in built.dropped}


def box_mesh(polygon: Polygon, low: float, high: float) -> Any:
    """A box without its lid."""
    ring = np.asarray(shapely.orient_polygons(polygon).exterior.coords)[:-1, :2]
    points = np.concatenate([np.c_[ring, np.full(4, low)], np.c_[ring, np.full(4, high)]])
    sides = [(k, (k + 1) % 4, (k + 1) % 4 + 4) for k in range(4)] + [(k, (k + 1) % 4 + 4, k + 4) for k in range(4)]
    return points, np.array([*sides, (0, 2, 1), (0, 3, 2)])


def test_a_sound_building_stays_as_it_was_planned() -> None:
    built, told = built_of(house("w1"), house("w2", shapely.box(12, 0, 20, 10)))
    assert told == {}
    assert [record.roof_shape for record in built.records] == ["hipped", "hipped"]


def test_of_two_buildings_on_one_spot_one_is_left_out() -> None:
    built, told = built_of(house("w1"), house("w2"))
    assert len(built.records) == 1
    assert [reason for name, reason in told.items() if " " not in name] == [
        "can't be made: OverlayError: nothing is left of it beside what stands there; see whether it is mapped twice"
    ]


def test_a_building_with_a_wall_in_its_neighbours_plane_is_cut_there() -> None:
    flap = Polygon([(-8, 0), (9, 0), (9, 10), (0, 10), (0, 0.003), (-8, 0.003)])  # along its neighbour's wall
    built, told = built_of(house("w1", shapely.box(-12, 0, 0, 10)), house("w2", flap))
    assert [record.roof_shape for record in built.records] == ["hipped", "hipped"]
    assert "in one plane with faces of w1" in told["w2 details"]
    assert shapely.Polygon(built.records[1].footprint[0]).bounds == pytest.approx((0.05, 0, 9, 10), abs=0.002)


def test_a_building_that_stays_in_anothers_plane_when_cut_becomes_a_block(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(repair, "_cut", lambda plan, _: plan.parts)
    flap = Polygon([(-8, 0), (9, 0), (9, 10), (0, 10), (0, 0.003), (-8, 0.003)])
    built, told = built_of(house("w1", shapely.box(-12, 0, 0, 10)), house("w2", flap))
    assert [record.roof_shape for record in built.records] == ["hipped", "flat"]
    assert "in one plane with faces of w1" in told["w2 roof and details"]
    assert shapely.Polygon(built.records[1].footprint[0]).bounds == pytest.approx((0.02, 0.02, 8.98, 9.98), abs=0.002)


def test_an_open_part_becomes_a_block_with_a_flat_roof() -> None:
    built, told = built_of(house("w1", mesh=box_mesh(HOUSE, 0.0, 9.0)), house("w2", shapely.box(12, 0, 20, 10)))
    one, two = built.records
    assert (one.roof_shape, two.roof_shape) == ("flat", "hipped")
    assert one.height == pytest.approx(10.0)
    assert shapely.Polygon(one.footprint[0]).symmetric_difference(HOUSE).area < 0.05 * HOUSE.length
    assert list(told) == ["w1 roof and details"]
    assert "edges have no counterpart" in told["w1 roof and details"]
    assert built.watertight == 2


@pytest.mark.parametrize("kind", ["carport", "roof"])
def test_a_low_carport_stays_open_below(kind: str) -> None:
    areas = [OsmArea("w1", shapely.box(0, 0, 6, 5), {"building": kind, "height": "2"})]
    osm = replace(NOWHERE, areas=areas)
    built = buildings_of(osm, TERRAIN, seed=0)
    assert findings(built) == []
    assert built.dropped == []
    lowest = sorted(float(body.positions[:, 2].min()) for body in built.collision)
    assert lowest[-1] == pytest.approx(1.55)  # the roof itself; what stands below it are posts


def test_a_part_that_hovers_is_brought_down() -> None:
    built, told = built_of(house("w1", low=1.0, levels=0))
    assert "brought down" in told["w1 details"]
    assert min(float(body.positions[:, 2].min()) for body in built.collision) < 0.0


def test_a_small_solid_at_fault_goes_and_its_building_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    of = stage.details_of

    def with_sheets(*given: Any, **more: Any) -> list[list[PartPlan]]:
        made = of(*given, **more)
        flush = shapely.box(2, 0, 10, 4)  # in the plane of the house's wall
        leaky = shapely.box(-3, 2, -1, 4)
        made[0] += [
            PartPlan(flush, 3.0, 6.0, 0, Roof("flat", 0.0), {}, "penthouse"),
            PartPlan(leaky, 3.0, 6.0, 0, Roof("flat", 0.0), {}, "cornice_stone", box_mesh(leaky, 3.0, 6.0)),
        ]
        return made

    monkeypatch.setattr(stage, "details_of", with_sheets)
    built, told = built_of(house("w1"))
    assert built.records[0].roof_shape == "hipped"
    assert list(told) == ["w1 penthouse", "w1 cornice_stone"]
    assert "faces of itself" in told["w1 penthouse"]


def test_what_cant_be_cut_costs_a_building_its_details_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(plan: BuildingPlan, *_: Any, **__: Any) -> list[PartPlan]:
        if plan.id == "w2":
            raise OverlayError("side location conflict")
        return []

    monkeypatch.setattr(stage, "rooftop_parts", failing)
    built, told = built_of(house("w1"), house("w2", shapely.box(12, 0, 20, 10)))
    assert [record.id for record in built.records] == ["w1", "w2"]
    assert told == {"w2 details": "can't be made: OverlayError: side location conflict"}


def test_a_small_solid_that_cant_be_meshed_is_left_out_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    made = solids.part_mesh

    def failing(part: PartPlan, seat: Any) -> Any:
        if part.finish == "chimney":
            raise OverlayError("side location conflict")
        return made(part, seat)

    monkeypatch.setattr(solids, "part_mesh", failing)
    _, told = built_of(house("w1"))
    assert told == {"w1 chimney": "can't be made: OverlayError: side location conflict"}
