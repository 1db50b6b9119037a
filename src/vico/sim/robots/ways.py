"""Ways for robots over the walkable map, wide enough for them and clear of who stands in the way."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.sim.robots.state import RobotRun

_NOBODY = np.zeros((0, 3))


def way_to(
    run: RobotRun,
    robot: int,
    goal: NDArray[np.float64],
    closed: NDArray[np.float64] = _NOBODY,
    *,
    start: NDArray[np.float64] | None = None,
) -> NDArray[np.float64] | None:
    """Return a way outdoors to a point that keeps clear of discs and of closed ground; None if there is none.

    Whoever stands on ground that is closed may take any way out of it.

    Parameters
    ----------
    goal
        ENU metres; its x and y count.
    closed
        Discs to keep out of: x, y, radius, metres, shape ``(m, 3)``.
    start
        Where it begins, ENU metres; None: where the robot is.

    Returns
    -------
    ndarray or None
        Points of a polyline that begins at the robot, ENU metres, shape ``(k, 2)``, ``k >= 2``.
    """
    scene, walkable = run.scene, run.scene.world.walkable
    blocked = scene.narrow(robot)
    here = run.position(robot)[:2] if start is None else start[:2]
    if run.closed_ground:
        if is_closed(run, np.asarray(goal, np.float64)[None, :2]):
            return None
        if not is_closed(run, here[None]):
            blocked = blocked | walkable.cells_within(run.closed_ground)
    if len(closed):
        blocked = blocked.copy()
        for x, y, radius in closed:
            (i0, j0), (i1, j1) = walkable.cell_of([[x - radius, y - radius], [x + radius, y + radius]])
            yy, xx = np.mgrid[j0 : j1 + 1, i0 : i1 + 1]
            centres = walkable.centre_of(np.stack([xx, yy], axis=-1))
            blocked[j0 : j1 + 1, i0 : i1 + 1] |= np.hypot(centres[..., 0] - x, centres[..., 1] - y) < radius
    path = scene.router.path(here, np.asarray(goal, np.float64)[:2], blocked=blocked)
    if path is None:
        return None
    # The search may begin in a cell beside the robot's own.
    return path if len(path) > 1 and np.allclose(path[0], here) else np.vstack([here, path])


def is_closed(run: RobotRun, points: NDArray[np.float64]) -> bool:
    """Return whether events close the ground at any of some points, ENU metres, shape ``(k, 2)``."""
    x, y, radius = np.array(run.closed_ground).reshape(-1, 3).T
    return bool((np.hypot(points[:, :1] - x, points[:, 1:] - y) < radius).any())


def next_errand(run: RobotRun, robot: int) -> NDArray[np.float64] | None:
    """Draw another place for a robot, 40 to 250 m away, and return a way there; None if there is none."""
    run.arrays.errand[robot] += 1
    goals = run.scene.goals
    away = np.hypot(*(goals - run.position(robot)[:2]).T)
    order = run.errand_stream(robot).permutation(np.flatnonzero((away > 40.0) & (away < 250.0)))
    ways = (way_to(run, robot, goals[index]) for index in order[:5])
    return next((way for way in ways if way is not None), None)
