"""Walkways lead past what stands on them, and are narrow only there."""

import numpy as np
import pytest
import shapely

from vico.world.heights import EDGE_RANGE, HeightField, Steps
from vico.world.walkways import SIDEWALK, Walkways, walkways_of


def past(*solids: shapely.Polygon) -> Walkways:
    """A sidewalk of 40 m, 2 m wide, from west to east, led past solids."""
    line = np.array([(0.0, 0.0), (40.0, 0.0)])
    plain = walkways_of([("w", False, line, np.zeros(2), 2.0, -1)], [])
    return plain.clear_of(list(solids))


def post(x: float, y: float, half: float = 0.1) -> shapely.Polygon:
    return shapely.box(x - half, y - half, x + half, y + half)


def test_a_post_beside_a_sidewalk_takes_its_room_only_there() -> None:
    walks = past(post(20.0, 0.8))
    assert len(walks) == 1
    left = [walks.room_at(0, offset)[0] for offset in (5.0, 20.0, 35.0)]
    assert left[0] == left[2] == 0.7
    assert 0.3 < left[1] < 0.4
    assert walks.room_at(0, 20.0)[1] == 0.7


def test_a_sidewalk_bends_past_posts_in_its_middle_on_one_side_and_two_can_still_pass_elsewhere() -> None:
    posts = [post(15.0, 0.05), post(18.0, 0.05), post(21.0, 0.05)]
    walks = past(*posts)
    assert walks.kind.tolist() == [SIDEWALK]
    line = shapely.LineString(walks.line(0))
    assert min(line.distance(p) for p in posts) > 0.3
    between = np.array([line.interpolate(x, normalized=True).y for x in np.linspace(0.38, 0.52, 8)])
    assert (between < -0.3).all()
    assert walks.room_at(0, 5.0).sum() > 1.3


def test_a_wall_across_a_sidewalk_cuts_it() -> None:
    walks = past(shapely.box(20.0, -5.0, 20.3, 5.0))
    assert len(walks) == 2
    assert 37.0 < walks.length.sum() < 39.4
    assert len(np.unique(walks.ends)) == 4


def test_nothing_solid_is_nearer_to_a_line_than_a_walker_is_wide() -> None:
    random = np.random.default_rng(5)
    for _ in range(20):
        posts = [post(x, y) for x, y in zip(random.uniform(0, 40, 12), random.uniform(-1.5, 1.5, 12), strict=True)]
        walks = past(*posts)
        for i in range(len(walks)):
            line = shapely.LineString(walks.line(i))
            assert min(line.distance(p) for p in posts) > 0.28


def kerbed(north: float) -> HeightField:
    """Ground whose kerb runs along y = `north`, the carriageway beyond it."""
    y = np.linspace(-50.0, 50.0, 201)
    edge = np.repeat(np.clip((north - y) * 127 / EDGE_RANGE, -127, 127)[:, None], 201, axis=1)
    low, high = np.full((201, 201), -120, np.int16), np.zeros((201, 201), np.int16)
    return HeightField(np.zeros((2, 2), np.float32), 50.0, Steps(edge.round().astype(np.int8), low, high))


@pytest.mark.parametrize("kerb", [-0.3, 0.1, 0.5])
def test_walkways_stay_above_the_edge_of_a_kerb_and_have_on_the_other_side_what_it_takes(kerb: float) -> None:
    line = np.array([(0.0, 0.0), (40.0, 0.0)])
    plain = walkways_of([("w", False, line, np.zeros(2), 2.0, -1), ("c", True, line + 9.0, np.zeros(2), 2.0, 0)], [])
    walks = plain.clear_of([], kerbed(kerb))
    assert walks.kind.tolist() == plain.kind.tolist()
    for offset in (5.0, 20.0, 35.0):
        y = shapely.LineString(walks.line(0)).interpolate(offset).y
        left, right = walks.room_at(0, offset)
        assert y + left <= kerb - (0.25 if kerb > 0.0 else 0.1)  # strips too narrow to pass on are used further
        assert left + right > 0.4
    # Crossings lead over the carriageway.
    assert (walks.line(1) == plain.line(1)).all()
    assert (walks.room_at(1, 5.0) == plain.room_at(1, 5.0)).all()
