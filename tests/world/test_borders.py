"""What the check of a city's borders sees, and what it need not."""

import numpy as np

from vico.world.city import Profile, _unmatched_edges

NO_HOUSES = np.zeros((0, 2))


def _profile(*rows: tuple[float, float, float, str]) -> Profile:
    """Level edges: start, end, height, stuff."""
    start, end, height = np.array([row[:3] for row in rows], np.float64).T
    return Profile(start, end, height, height.copy(), [row[3] for row in rows])


def test_a_hole_beside_a_paving_is_found() -> None:
    whole = _profile((0.0, 10.0, 0.0, "setts"), (10.0, 20.0, 0.0, "asphalt"))
    torn = _profile((0.0, 8.0, 0.0, "setts"), (10.0, 20.0, 0.0, "asphalt"), (0.0, 20.0, -0.5, "slabs"))
    assert _unmatched_edges(whole, torn, NO_HOUSES) == ["nothing meets setts at 9.000 m, 0.00 m high"]
    assert _unmatched_edges(whole, torn, np.array([[7.5, 10.5]])) == []
    assert _unmatched_edges(whole, whole, NO_HOUSES) == []


def test_what_lies_under_ground_on_both_sides_is_not_missed_and_elsewhere_is() -> None:
    paved = _profile((0.0, 10.0, 0.0, "setts"))
    below = _profile((0.0, 10.0, 0.0, "setts"), (2.0, 8.0, -0.5, "slabs"))
    assert _unmatched_edges(below, paved, NO_HOUSES) == []
    bare = _profile((20.0, 30.0, 0.0, "setts"), (2.0, 8.0, -0.5, "slabs"))
    assert len(_unmatched_edges(bare, _profile((20.0, 30.0, 0.0, "setts")), NO_HOUSES)) == 3
