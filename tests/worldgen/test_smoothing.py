"""Lanes without kinks: corners are rounded, and paths through junctions begin and end as the streets do."""

import numpy as np

from road_city import road_city
from vico.world.lanes import LaneGraph
from vico.worldgen.streets.lane_shapes import round_corners, smooth_lanes


def _turns(line: np.ndarray) -> np.ndarray:
    step = np.diff(line, axis=0)
    heading = np.arctan2(step[:, 1], step[:, 0])
    return np.abs((np.diff(heading) + np.pi) % (2 * np.pi) - np.pi)


def _jumps(lanes: LaneGraph, least: float) -> int:
    """Return at how many points vehicles' paths turn by more than `least` degrees, in lanes and between them."""
    found = 0
    for i in range(len(lanes)):
        line = lanes.line(i)
        found += int((_turns(line) > np.radians(least)).sum())
        for k in lanes.following(i).tolist():
            found += int(_turns(np.concatenate([line[-2:], lanes.line(k)[1:2]]))[0] > np.radians(least))
    return found


def test_a_rounded_corner_keeps_its_ends_and_stays_near_its_corner() -> None:
    corner = np.array([(0.0, 0.0), (30.0, 0.0), (30.0, 25.0)])
    line = round_corners(corner)
    assert np.array_equal(line[[0, -1]], corner[[0, -1]])
    assert np.degrees(_turns(line)).max() < 15.0
    assert np.hypot(*(line - corner[1]).T).min() < 0.85
    assert np.array_equal(round_corners(corner[:2]), corner[:2])


def test_paths_of_central_helsinki_have_hardly_a_kink() -> None:
    # netconvert's own lanes turn by more than 20 degrees at 124 points.
    assert _jumps(road_city().lanes, 20.0) <= 10


def test_smooth_lanes_stay_as_they_are_and_the_rest_of_the_file_too() -> None:
    net = road_city().network.net_xml
    again = smooth_lanes(net)
    assert again.count(b"<lane ") == net.count(b"<lane ")
    assert again.count(b"<connection ") == net.count(b"<connection ")
    assert smooth_lanes(b'<net><edge id="a"><lane id="a_0" length="5.0" shape="0,0 5,0"/></edge></net>') == (
        b'<net><edge id="a"><lane id="a_0" length="5.0" shape="0,0 5,0"/></edge></net>'
    )
