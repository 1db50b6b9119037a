"""What the social network of a community measures: degrees, clustering, assortativity, path lengths.

The measures are those of Newman, "Networks" (2nd edition, 2018), so that they can be held against published ones.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vico.community.model import Community, RelationKind


@dataclass(frozen=True)
class NetworkMeasures:
    """Measures of an undirected network without weights.

    Attributes
    ----------
    people, ties
        Nodes and edges.
    mean_degree, median_degree, most_degree
        Ties of a person.
    degree_skew
        Third standardised moment of the degrees: 0 where they lie evenly about the mean, positive where a few have
        many.
    alone
        Share of people without any tie.
    clustering
        Mean over those with two ties or more of the share of their pairs of neighbours that are tied (Watts and
        Strogatz).
    transitivity
        Three times the triangles over the connected triples.
    degree_assortativity, age_assortativity
        Pearson correlation over the ties of the degrees, and of the ages, at their two ends.
    largest
        Share of people in the largest connected component.
    mean_path
        Mean number of ties between two people of the largest component.
    """

    people: int
    ties: int
    mean_degree: float
    median_degree: float
    most_degree: int
    degree_skew: float
    alone: float
    clustering: float
    transitivity: float
    degree_assortativity: float
    age_assortativity: float
    largest: float
    mean_path: float


def network_measures(
    community: Community, kinds: Collection[RelationKind] = tuple(RelationKind), *, adults_only: bool = False
) -> NetworkMeasures:
    """Measure the network of the relations of some kinds.

    Parameters
    ----------
    kinds
        Relations that count.
    adults_only
        Leave out whoever is younger than 18.

    Returns
    -------
    NetworkMeasures
        A measure that is not defined, as the correlation of equal numbers, is 0.
    """
    people = [r for r in community.residents if r.age >= 18 or not adults_only]
    row = {r.id: k for k, r in enumerate(people)}
    pairs = [
        (row[a], row[b])
        for (a, b), kind in ((r.between, r.kind) for r in community.relations)
        if kind in kinds and a in row and b in row
    ]
    return measures_of(len(people), np.array(pairs, np.int64).reshape(-1, 2), np.array([r.age for r in people], float))


def measures_of(people: int, pairs: NDArray[np.int64], ages: NDArray[np.float64]) -> NetworkMeasures:
    """Measure a network given by its edges.

    Parameters
    ----------
    pairs
        The two ends of every edge, each edge once; shape ``(edges, 2)``.
    ages
        Of the nodes, years; shape ``(people,)``.
    """
    from scipy.sparse import coo_matrix  # slow to import, and most who import this measure nothing
    from scipy.sparse.csgraph import connected_components, shortest_path

    ends = np.concatenate([pairs, pairs[:, ::-1]])
    graph = coo_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(people, people)).tocsr()
    degrees = np.asarray(graph.sum(axis=1)).ravel()
    triangles = np.asarray((graph @ graph).multiply(graph).sum(axis=1)).ravel() / 2.0
    triples = degrees * (degrees - 1.0) / 2.0
    some = triples > 0
    _, labels = connected_components(graph, directed=False)
    sizes = np.bincount(labels, minlength=1)
    members = np.flatnonzero(labels == int(np.argmax(sizes)))
    steps = shortest_path(graph[members][:, members], unweighted=True, directed=False)
    apart = len(members) * (len(members) - 1)
    spread = float(degrees.std())
    return NetworkMeasures(
        people=people,
        ties=len(pairs),
        mean_degree=float(degrees.mean()),
        median_degree=float(np.median(degrees)),
        most_degree=int(degrees.max()),
        degree_skew=float(((degrees - degrees.mean()) ** 3).mean() / spread**3) if spread else 0.0,
        alone=float((degrees == 0).mean()),
        clustering=float((triangles[some] / triples[some]).mean()) if some.any() else 0.0,
        transitivity=float(triangles.sum() / triples.sum()) if some.any() else 0.0,
        degree_assortativity=_correlation(degrees[ends[:, 0]], degrees[ends[:, 1]]),
        age_assortativity=_correlation(ages[ends[:, 0]], ages[ends[:, 1]]),
        largest=float(sizes.max() / people),
        mean_path=float(steps.sum() / apart) if apart else 0.0,
    )


def _correlation(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    if len(a) < 2 or a.std() == 0 or b.std() == 0:
        return 0.0
    return float(np.corrcoef(a, b)[0, 1])
