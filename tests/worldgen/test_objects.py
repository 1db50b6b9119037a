"""Street objects of central Helsinki: where the map has them, clear of walls and lanes."""

from collections.abc import Sequence

import numpy as np
import pytest
import shapely

from vico.assets.models.library import street_models
from vico.assets.models.plants import plant_models
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmData, OsmNode, OsmWay
from vico.world.heights import HeightField
from vico.world.objects import Objects
from vico.world.transit import TramLine, Transit
from vico.world.world import World
from vico.worldgen.objects.stage import Surroundings, objects_from_osm

NOTHING = shapely.Polygon()


def placed(nodes: list[OsmNode], *, ways: Sequence[OsmWay] = (), **given: object) -> tuple[Objects, list[str]]:
    osm = OsmData(LocalFrame(60.0, 25.0), 50.0, 60.0, nodes, list(ways), [], [])
    grounds = Surroundings(**{name: given.pop(name) for name in ("solids", "carriageway", "openings") if name in given})
    objects, dropped = objects_from_osm(osm, grounds, **{"height": HeightField.flat(60.0)} | given)
    return objects, [entry.reason for entry in dropped]


def node(number: int, x: float, y: float, **tags: str) -> OsmNode:
    return OsmNode(number, np.array([x, y]), tags)


def test_a_tree_stands_where_it_is_mapped() -> None:
    objects, _ = placed([node(1, 3.0, 4.0, natural="tree")])
    assert (objects.kind[0], objects.x[0], objects.y[0]) == ("tree", 3.0, 4.0)


def test_a_mapped_height_decides_how_tall_a_tree_is() -> None:
    objects, _ = placed([node(1, 0.0, 0.0, natural="tree", height="8", genus="Betula")])
    assert objects.size_z[0] == pytest.approx(8.0, abs=0.1)
    assert objects.prototype[0] == "tree_birch"


def test_a_bench_mapped_on_the_road_stands_beside_it() -> None:
    road = shapely.box(-50, -3, 50, 3)
    objects, dropped = placed([node(1, 0.0, 2.0, amenity="bench")], carriageway=road)
    assert dropped == []
    assert not shapely.intersects(road, shapely.Polygon(objects.corners()[0]))


def test_a_bench_deep_in_a_building_is_dropped_with_the_reason() -> None:
    _, dropped = placed([node(1, 0.0, 0.0, amenity="bench")], solids=[shapely.box(-20, -20, 20, 20)])
    assert dropped == ["bench: inside a building, and no room within 3 m"]


def test_two_things_at_one_point_do_not_stand_in_each_other() -> None:
    objects, _ = placed([node(1, 0.0, 0.0, amenity="bench"), node(2, 0.0, 0.0, amenity="post_box")])
    first, second = (shapely.Polygon(foot) for foot in objects.feet())
    assert not first.intersects(second)


def test_a_bollard_mapped_twice_stands_once() -> None:
    objects, dropped = placed([node(1, 0.0, 0.0, barrier="bollard"), node(2, 0.28, 0.05, barrier="bollard")])
    assert objects.id.tolist() == ["n1"]
    assert dropped == ["bollard: mapped twice"]


def test_a_row_of_bollards_lets_those_stand_that_are_mapped_one_by_one() -> None:
    row = OsmWay(7, [1, 2], np.array([[0.0, 0.0], [8.5, 0.0]]), False, {"barrier": "bollard"})
    alone, _ = placed([], ways=[row])
    objects, _ = placed([node(3, 3.7, 0.0, barrier="bollard")], ways=[row])
    assert len(alone) == len(objects) == 6
    assert "n3" in objects.id
    assert "w7.2" not in objects.id
    assert np.diff(np.sort(objects.x)).min() > 1.1


@pytest.mark.parametrize(
    "tags",
    [{"highway": "street_lamp"}, {"amenity": "waste_basket"}, {"barrier": "bollard"}, {"amenity": "bicycle_parking"}],
)
@pytest.mark.parametrize("north", [0.0, 0.3, 0.9, 1.3, 2.1])
def test_whatever_stands_on_a_pavement_leaves_a_way_past(tags: dict[str, str], north: float) -> None:
    wall, road, pavement = shapely.box(-50, 2.2, 50, 12), shapely.box(-50, -8, 50, 0), shapely.box(-50, 0, 50, 2.2)
    objects, dropped = placed([node(1, 0.0, north, **tags)], solids=[wall], carriageway=road, openings=pavement)
    assert len(objects) + len(dropped) == 1
    for foot in objects.feet():
        assert max(2.2 - foot[:, 1].max(), foot[:, 1].min()) > 0.89


def test_lamps_stand_at_both_kerbs_of_a_street_in_town_but_where_some_are_mapped_or_none_are_lit() -> None:
    def lamps(mapped: Sequence[OsmNode] = (), **tags: str) -> list[tuple[float, float]]:
        street = OsmWay(1, [1, 2], np.array([[-50.0, 0.0], [50.0, 0.0]]), False, {"highway": "residential"} | tags)
        objects, _ = placed(
            list(mapped), ways=[street], carriageway=shapely.box(-50, -3, 50, 3), solids=[shapely.box(-30, 12, 30, 20)]
        )
        return [(float(x), float(y)) for x, y in zip(objects.x, objects.y, strict=True)]

    everywhere = lamps()
    assert len(everywhere) == 4
    assert all(3.0 < abs(y) < 5.5 for _, y in everywhere)
    assert len({y > 0 for _, y in everywhere}) == 2
    assert lamps(lit="no") == []
    assert len(lamps([node(k, -40.0 + 20.0 * k, 4.5, highway="street_lamp") for k in range(5)])) == 5


def test_nothing_stands_on_tracks_beside_the_street() -> None:
    line = TramLine(
        id="t", name="1", kind="tram", colour="#000000", track=[(-50.0, 10.0), (50.0, 10.0)],
        stops=[], offsets=[], departures=[], travel=[],
    )  # fmt: skip
    trams = Transit(stops=[], lines=[], bike_stations=[], origin={}, tram_lines=[line])
    mapped = [node(1, 0.0, 10.2, highway="street_lamp"), node(2, 20.0, 13.0, amenity="bench")]
    objects, _ = placed(mapped, transit=trams)
    assert len(objects) == 2
    assert (np.abs(objects.y - 10.0) > 1.3).all()
    assert np.abs(placed(mapped)[0].y - 10.0).min() < 0.3


def test_posts_across_a_path_leave_it_open() -> None:
    path, hedge = shapely.box(-20, -1.5, 20, 1.5), [shapely.box(-20, 1.5, 20, 3), shapely.box(-20, -3, 20, -1.5)]
    posts = [node(k, 0.0, y, barrier="bollard") for k, y in enumerate((-1.2, -0.7, 0.0, 0.7, 1.2), 1)]
    objects, _ = placed(posts, solids=hedge, openings=path)
    blocked = shapely.union_all([shapely.buffer(shapely.Polygon(foot), 0.44) for foot in objects.feet()])
    free = shapely.difference(shapely.buffer(path, -0.44), blocked)
    ways = [part for part in shapely.get_parts(free) if part.bounds[0] < -19 and part.bounds[2] > 19]
    assert len(objects) >= 2
    assert len(ways) == 1


def test_another_object_on_the_map_changes_none_of_the_others() -> None:
    trees = [node(k, 6.0 * k - 30, 0.0, natural="tree") for k in range(1, 9)]
    before, _ = placed(trees)
    after, _ = placed([*trees, node(99, 0.0, 20.0, natural="tree")])
    np.testing.assert_array_equal(before.yaw, after.yaw[: len(before)])


def test_stops_carry_the_entities_of_their_records(helsinki: World) -> None:
    entity = dict(zip(helsinki.objects.id.tolist(), helsinki.objects.entity.tolist(), strict=True))
    assert all(entity[s.id] == s.entity for s in helsinki.transit.stops if s.id in entity)


def test_feet_are_out_of_the_way_of_walkers(helsinki: World) -> None:
    outdoors = helsinki.objects.where(helsinki.objects.outdoors & helsinki.objects.solid)
    inside = helsinki.walkable.inside(outdoors.position)
    assert (helsinki.walkable.class_at(outdoors.position[inside]) == 0).all()


@pytest.mark.parametrize("name", sorted(street_models()))
def test_a_model_stands_on_the_ground_and_is_light(name: str) -> None:
    thing = street_models()[name]
    assert thing.triangles <= 400
    assert -0.51 < thing.bounds[0, 2] < 0.15  # walls, posts and hedges reach into the ground, for slopes
    assert all(np.isfinite(surface.positions).all() for surface in thing.surfaces)


def test_plants_are_the_same_in_every_build() -> None:
    first, second = ({plant.name: plant for plant in plant_models()}["tree_lime"].surfaces for _ in range(2))
    assert all(np.array_equal(a.positions, b.positions) for a, b in zip(first, second, strict=True))


def test_steep_ground_that_nobody_mapped_grows_wild() -> None:
    axis = np.linspace(-60.0, 60.0, 121)
    rise = np.where(axis > 0.0, 0.5 * axis, 0.0).astype(np.float32)  # flat in the west, a slope in the east
    slope, street = HeightField(np.tile(rise, (121, 1)), 60.0), shapely.box(30.0, -60.0, 38.0, 60.0)
    grown, _ = placed([], height=slope, carriageway=street)
    assert len(grown) > 30
    assert grown.x.min() > -10.0
    assert {"tree", "shrub"} <= set(grown.kind.tolist())
    assert not ((grown.x > 30.0) & (grown.x < 38.0)).any()
    # What is mapped elsewhere changes none of them.
    more, _ = placed([node(7, -40.0, 0.0, amenity="bench")], height=slope, carriageway=street)
    both = [set(zip(o.id.tolist(), o.x.tolist(), o.y.tolist(), strict=True)) for o in (grown, more)]
    assert len(both[1] - both[0]) == 1
    assert both[0] <= both[1]
    assert len(placed([], carriageway=street)[0]) == 0


def gap_beside(objects: Objects, walls: Sequence[shapely.Polygon]) -> float:
    """The widest way past the first thing in an alley between walls, metres."""
    foot = shapely.Polygon(objects.feet()[0])
    return max(shapely.distance(foot, wall) for wall in walls)


@pytest.mark.parametrize("joined", [True, False])
def test_a_board_leaves_a_way_past_in_an_alley_between_two_houses_and_between_the_wings_of_one(joined: bool) -> None:
    wings = [shapely.box(-20, -10, -0.8, 30), shapely.box(0.8, -10, 20, 30)]
    house = [shapely.union_all([*wings, shapely.box(-20, 25, 20, 30)])] if joined else wings
    objects, dropped = placed([node(1, 0.0, 0.0, tourism="information", information="board")], solids=house)
    if dropped:
        assert dropped[0].split(": ")[1].startswith("in the only way past")
    else:
        assert gap_beside(objects, wings) >= 0.9
