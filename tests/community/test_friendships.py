"""Is the social network one of people? Its measures against small graphs, and the author's against real networks."""

from __future__ import annotations

import numpy as np
import pytest

from vico.community import Community, RelationKind, build_community
from vico.community.relations import measures_of, network_measures
from vico.world.world import World

_CLOSE = [RelationKind.FRIEND]


@pytest.fixture(scope="module")
def large(town: World) -> Community:
    return build_community(town, residents=150, seed=2)


def test_a_triangle_with_a_tail_measures_as_reckoned_by_hand() -> None:
    # 0, 1 and 2 know each other, 3 knows 2 only; 4 knows nobody.
    found = measures_of(5, np.array([[0, 1], [0, 2], [1, 2], [2, 3]]), np.array([20.0, 22.0, 40.0, 41.0, 60.0]))
    assert found.mean_degree == 8 / 5
    assert found.most_degree == 3
    assert found.alone == 1 / 5
    assert found.clustering == pytest.approx((1 + 1 + 1 / 3) / 3)
    assert found.transitivity == pytest.approx(3 / 5)
    assert found.largest == 4 / 5
    assert found.mean_path == pytest.approx((1 + 1 + 2 + 1 + 2 + 1) / 6)


def test_a_star_is_disassortative_and_ages_of_pairs_correlate() -> None:
    star = measures_of(4, np.array([[0, 1], [0, 2], [0, 3]]), np.array([30.0, 30.0, 30.0, 30.0]))
    assert star.degree_assortativity == pytest.approx(-1.0)
    assert star.clustering == star.transitivity == 0.0
    pairs = measures_of(4, np.array([[0, 1], [2, 3]]), np.array([20.0, 20.0, 60.0, 60.0]))
    assert pairs.age_assortativity == pytest.approx(1.0)


def test_friends_are_as_many_and_as_close_as_real_ones(large: Community) -> None:
    """Bounds around the networks of friends in ``benchmarks/results/people.md``."""
    found = network_measures(large, _CLOSE)
    assert 4.0 <= found.mean_degree <= 11.0
    assert 0.1 <= found.clustering <= 0.5
    assert found.degree_skew > 0.4
    assert found.age_assortativity > 0.3
    assert found.alone < 0.02
    adults = network_measures(large, _CLOSE, adults_only=True)
    assert adults.largest > 0.95
    assert 2.0 <= adults.mean_path <= 5.0


def test_nobody_knows_hundreds(large: Community) -> None:
    assert network_measures(large).most_degree <= 60


def test_the_outgoing_have_more_friends(town: World) -> None:
    friends, outgoing = [], []
    for seed in range(2):
        community = build_community(town, residents=120, seed=seed)
        for resident in community.residents:
            friends.append(sum(r.kind is RelationKind.FRIEND for r in community.relations_of(resident.id)))
            outgoing.append(resident.personality.extraversion)
    assert np.corrcoef(friends, outgoing)[0, 1] > 0.15


def test_children_have_friends_of_their_age(large: Community) -> None:
    ages = {r.id: r.age for r in large.residents}
    pairs = [sorted(ages[i] for i in r.between) for r in large.relations if r.kind is RelationKind.FRIEND]
    children = [(a, b) for a, b in pairs if a < 18]
    assert children
    assert all(b < 18 and b - a <= 2 for a, b in children)
