"""The conforming mesh of the ground: no corner of one triangle on another's edge, and fewer corners at no cost."""

import numpy as np
import shapely

from vico.worldgen.ground.decimation import decimate_mesh
from vico.worldgen.ground.mesh import PlanMesh, conforming_mesh, triangulate


def area_of(plan: PlanMesh) -> float:
    a, b, c = (plan.corners[plan.triangles[:, k]] for k in range(3))
    return float(((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]).sum() / 2)


def pieces(n: int = 6) -> list[tuple[np.ndarray, np.ndarray]]:
    """A large square beside a column of small ones."""
    small = [shapely.box(8, 8 * k / n, 10, 8 * (k + 1) / n) for k in range(n)]
    return [triangulate([shapely.box(0, 0, 8, 8)]), triangulate(small)]


def test_neighbours_share_their_corners() -> None:
    plan = conforming_mesh(pieces())
    edges = np.concatenate([plan.triangles[:, [0, 1]], plan.triangles[:, [1, 2]], plan.triangles[:, [2, 0]]])
    known = {tuple(edge) for edge in edges.tolist()}
    alone = np.array([edge for edge in edges.tolist() if (edge[1], edge[0]) not in known])
    middle = plan.corners[alone].mean(axis=1)
    rim = (np.abs(middle) < 1e-9).any(axis=1) | (np.abs(middle - [10, 8]) < 1e-9).any(axis=1)
    assert rim.all()
    assert abs(area_of(plan) - 80.0) < 1e-6


def test_a_plane_needs_few_corners_and_a_bump_keeps_its_own() -> None:
    plan = conforming_mesh(pieces())
    used, tolerance = np.zeros(2, np.int64), np.full(2, 0.02)
    slope = decimate_mesh(plan, [lambda xy: 0.3 * xy[:, 0]], used, tolerance)
    assert len(slope.triangles) <= 6
    assert abs(area_of(slope) - 80.0) < 1e-6
    bump = decimate_mesh(plan, [lambda xy: np.abs(xy[:, 1] - 4.0)], used, tolerance)
    top = np.flatnonzero(np.abs(bump.corners[:, 1] - 4.0) < 1e-9)
    assert np.isin(top, bump.triangles).any()


def test_what_lies_along_a_side_stays_on_it() -> None:
    # A kerb that comes up to the side at a sharp angle: what is left of the pavement beside it is a sliver of 3 mm.
    tip, bend = (2.058, 10.0), (2.0, 9.997)
    stone = shapely.Polygon([bend, (4.6, 9.925), (6.0, 10.0), (4.0, 10.0), tip])
    pavement = shapely.Polygon([(0, 9.7), bend, (2.0, 10.0), (0, 10.0)])
    street = shapely.Polygon([(0, 0), (10, 0), (10, 10), (6.0, 10.0), (4.6, 9.925), bend, (0, 9.7)])
    plan = conforming_mesh([triangulate([shape]) for shape in (stone, pavement, street)])
    made = decimate_mesh(plan, [lambda xy: np.zeros(len(xy))], np.zeros(3, np.int64), np.full(3, 0.02))
    corners = made.corners[np.unique(made.triangles[made.piece == 0])]
    assert sorted(corners[corners[:, 1] == 10.0, 0].tolist()) == [2.058, 6.0]
