"""Lanes and walkways read from a real network."""

from pathlib import Path

import numpy as np
import pytest
import shapely

from road_city import road_city
from vico.errors import MissingFileError, SchemaError
from vico.world.lanes import read_lanes
from vico.world.walkways import CROSSING, SIDEWALK


def test_every_lane_begins_where_the_ones_before_it_end() -> None:
    lanes = road_city().lanes
    gaps = [
        float(np.linalg.norm(lanes.line(i)[-1] - lanes.line(int(j))[0]))
        for i in range(len(lanes))
        for j in lanes.following(i)
    ]
    assert max(gaps) < 0.5


def test_previous_lanes_are_the_next_lanes_reversed() -> None:
    lanes = road_city().lanes
    ahead = {(i, int(j)) for i in range(len(lanes)) for j in lanes.following(i)}
    behind = {(int(j), i) for i in range(len(lanes)) for j in lanes.preceding(i)}
    assert ahead == behind


def test_neighbour_lanes_lie_a_lane_width_apart() -> None:
    lanes = road_city().lanes
    for i in np.flatnonzero(lanes.left >= 0).tolist():
        apart = shapely.LineString(lanes.line(i)).distance(
            shapely.LineString(lanes.line(int(lanes.left[i]))).interpolate(0.5, normalized=True)
        )
        assert 2.0 < apart < 4.5


def test_the_pose_half_way_along_a_straight_lane_is_between_its_ends() -> None:
    lanes = road_city().lanes
    lane = next(i for i in range(len(lanes)) if len(lanes.line(i)) == 2 and lanes.length[i] > 20)
    start, end = lanes.line(lane)
    x, y, yaw = lanes.at(lane, lanes.length[lane] / 2)
    assert np.allclose((x, y), (start + end) / 2)
    assert np.allclose((np.cos(yaw), np.sin(yaw)), (end - start) / lanes.length[lane])


def test_the_nearest_lane_to_a_point_on_a_lane_is_that_lane() -> None:
    lanes = road_city().lanes
    lane = int(np.argmax(np.where(lanes.inside < 0, lanes.length, 0)))
    found = lanes.nearest(lanes.at(lane, 30.0)[:2])
    assert found is not None
    assert found[0] == lane
    assert found[1] == pytest.approx(30.0, abs=0.01)


def test_every_crossing_can_be_reached_from_a_sidewalk_on_both_sides() -> None:
    walks = road_city().lanes.walks
    reached = np.zeros(len(walks), int)
    for crossing in np.flatnonzero(walks.kind == CROSSING).tolist():
        for end in walks.ends[crossing]:
            reached[crossing] += len(walks.meeting[walks.meeting_first[end] : walks.meeting_first[end + 1]]) > 1
    both = reached[walks.kind == CROSSING] == 2
    assert both.mean() > 0.9


def test_walkways_clear_of_buildings_never_enter_one() -> None:
    city = road_city()
    walks = city.lanes.walks.clear_of(city.solids)
    tree = shapely.STRtree(city.solids)
    lines = [shapely.LineString(walks.line(i)) for i in range(len(walks))]
    assert not len(tree.query(lines, predicate="dwithin", distance=0.25)[0])


def test_most_sidewalks_of_helsinki_stay_when_buildings_are_kept_clear() -> None:
    city = road_city()
    before, after = city.lanes.walks, city.lanes.walks.clear_of(city.solids)
    assert after.length[after.kind == SIDEWALK].sum() > 0.95 * before.length[before.kind == SIDEWALK].sum()


def test_a_missing_network_is_named(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match=r"roads\.net\.xml"):
        read_lanes(tmp_path / "roads.net.xml")


@pytest.mark.parametrize("content", [b"<net><edge", b"<other/>", b"<!DOCTYPE net [<!ENTITY a 'b'>]><net>&a;</net>"])
def test_a_broken_or_hostile_network_is_refused(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "roads.net.xml").write_bytes(content)
    with pytest.raises(SchemaError):
        read_lanes(tmp_path / "roads.net.xml")
