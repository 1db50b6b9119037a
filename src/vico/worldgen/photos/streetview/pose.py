"""Where a photo was really taken: its camera's pose, from points it shares with a rendered view.

The paper's way is the essential matrix by the five-point method (Nister 2004), which leaves the length of the step
open: the render's depth tells it. As every point of the render is a known point of the world, the pose is then refined
on reprojection errors, which also holds where all points lie on one facade or the step is short, and the five-point
method does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.worldgen.photos.streetview.matching import Matches, opencv

_NORM_METRES = 20.0
_ABOVE, _LEFT, _HERE, _RIGHT, _BELOW = 1, 3, 4, 5, 7  # of a pixel and its eight neighbours, row by row
_ENOUGH = 12  # points that agree on a pose
_PRIOR_METRES, _PRIOR_RADIANS = 3.0, 0.07  # what is expected of the metadata: a weak pull where points say little


@dataclass(frozen=True)
class Pose:
    """Where a camera is and how it looks.

    Attributes
    ----------
    position
        ENU metres, shape ``(3,)``.
    rotation
        World to camera (right, down, forward), shape ``(3, 3)``.
    """

    position: NDArray[np.float64]
    rotation: NDArray[np.float64]

    def seen(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """World points in the camera's axes, shape ``(n, 3)``."""
        return np.asarray((points - self.position) @ self.rotation.T)

    def world(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points in the camera's axes as world points, shape ``(n, 3)``."""
        return np.asarray(points @ self.rotation + self.position)


@dataclass(frozen=True)
class Correction:
    """How far one pose is from another: metres, degrees, and the norm of `se3_norm`, metres."""

    shift: float
    turn: float
    norm: float


@dataclass(frozen=True)
class PoseFit:
    """What the matches say about the pose.

    Attributes
    ----------
    five_point
        Pose of the five-point method with the depth's scale; None if it found none.
    refined
        Pose refined on the points' reprojection; None if no consensus was found.
    inliers
        Which matches agree with `refined`, bool, shape ``(n,)``.
    error
        Their root mean square reprojection error, pixels.
    uncertainty
        Standard deviation of the refined position along its least certain direction, metres.
    """

    five_point: Pose | None
    refined: Pose | None
    inliers: NDArray[np.bool_]
    error: float
    uncertainty: float


def correction(before: Pose, after: Pose) -> Correction:
    """How far `after` is from `before`."""
    turn = after.rotation @ before.rotation.T
    angle = float(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1.0, 1.0)))
    shift = float(np.linalg.norm(after.position - before.position))
    step = after.rotation @ (before.position - after.position)
    return Correction(shift, float(np.degrees(angle)), se3_norm(turn, step))


def se3_norm(rotation: NDArray[np.float64], translation: NDArray[np.float64], metres: float = _NORM_METRES) -> float:
    """Norm of the se(3) vector (the logarithm) of a rigid motion, in metres.

    Its rotational part, radians, counts `metres` to the radian: the norm is about how far a point that far off moves.
    """
    cosine = np.clip((np.trace(rotation) - 1) / 2, -1.0, 1.0)
    angle = float(np.arccos(cosine))
    skew = rotation - rotation.T
    axis = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    if angle < 1e-9:
        return float(np.linalg.norm(translation))
    if np.pi - angle < 1e-6:  # the axis can't be read from the skew part there; any such motion is far too large
        return float(np.hypot(np.linalg.norm(translation), metres * angle))
    vector = axis * (angle / (2 * np.sin(angle)))
    cross = _cross(vector)
    share = (1 - angle * np.sin(angle) / (2 * (1 - cosine))) / angle**2
    inverse = np.eye(3) - cross / 2 + share * (cross @ cross)
    return float(np.hypot(np.linalg.norm(inverse @ translation), metres * angle))


def fit_pose(
    matches: Matches, depth: NDArray[np.float32], prior: Pose, intrinsics: NDArray[np.float64], *, pixels: float = 2.5
) -> PoseFit:
    """Find the photo's pose.

    Parameters
    ----------
    matches
        Points of the view rendered from `prior` and of the photo.
    depth
        Depth of that view along the optical axis, metres, 0 where nothing is, shape ``(h, w)``.
    prior
        Pose the view was rendered from.
    intrinsics
        Camera matrix of both pictures.
    pixels
        Matches within this reprojection error agree.
    """
    points, solid = lifted(matches.render, depth, prior, intrinsics)
    none = PoseFit(None, None, np.zeros(len(matches), np.bool_), float("nan"), float("inf"))
    if solid.sum() < 8:
        return none
    used = matches.taken(solid)
    world = points[solid]
    best: tuple[Pose, NDArray[np.bool_], float] | None = None
    start = _by_points(used, world, intrinsics, pixels)
    if start is not None:
        best = _refined(start, used, world, prior, intrinsics, pixels)
    # A consensus search among what agrees already is a matter of a few tries; among all, of thousands.
    agreed = np.ones(len(used), np.bool_) if best is None or best[1].sum() < _ENOUGH else best[1]
    five_point = _five_point(used.taken(agreed), world[agreed], prior, intrinsics, pixels)
    if five_point is not None:
        other = _refined(five_point, used, world, prior, intrinsics, pixels)
        if best is None or other[1].sum() > best[1].sum():
            best = other
    inliers = np.zeros(len(matches), np.bool_)
    if best is None or best[1].sum() < 6:
        return PoseFit(five_point, None, inliers, float("nan"), float("inf"))
    pose, inlier, spread = best
    inliers[solid] = inlier
    gap = np.linalg.norm(projected(world[inlier], pose, intrinsics) - used.photo[inlier], axis=1)
    return PoseFit(five_point, pose, inliers, float(np.sqrt((gap**2).mean())), spread)


def lifted(
    xy: NDArray[np.float64], depth: NDArray[np.float32], pose: Pose, intrinsics: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """World points of a view's pixels, shape ``(n, 3)``, and which have a depth that is clear.

    A point beside an edge may belong to what is before it or behind: it has none that is clear.
    """
    height, width = depth.shape
    column = np.clip(np.floor(xy[:, 0]).astype(np.int64), 1, width - 2)
    row = np.clip(np.floor(xy[:, 1]).astype(np.int64), 1, height - 2)
    around = np.stack([depth[row + i, column + j] for i in (-1, 0, 1) for j in (-1, 0, 1)], axis=1)
    here = around[:, _HERE].astype(np.float64)
    # On a plane the middle of opposite neighbours is the pixel itself, in inverse depth exactly.
    safe = np.where(around > 0, around, np.inf)
    bend = np.abs((1 / safe[:, _LEFT] + 1 / safe[:, _RIGHT]) * here / 2 - 1) + np.abs(
        (1 / safe[:, _ABOVE] + 1 / safe[:, _BELOW]) * here / 2 - 1
    )
    solid = (around > 0).all(axis=1) & (bend < 0.02)
    rays = np.column_stack([xy, np.ones(len(xy))]) @ np.linalg.inv(intrinsics).T
    return pose.world(rays * here[:, None]), solid


def projected(points: NDArray[np.float64], pose: Pose, intrinsics: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixels of world points, shape ``(n, 2)``; NaN behind the camera."""
    seen = pose.seen(points)
    ahead = np.where(seen[:, 2:] > 1e-6, seen[:, 2:], np.nan)
    return np.asarray((seen[:, :2] / ahead) * np.diag(intrinsics)[:2] + intrinsics[:2, 2])


def _five_point(
    matches: Matches, world: NDArray[np.float64], prior: Pose, intrinsics: NDArray[np.float64], pixels: float
) -> Pose | None:
    """Return the essential matrix's rotation and direction, and the step's length from the points' depths."""
    relative = relative_pose(matches, intrinsics, pixels=pixels / 2)
    if relative is None:
        return None
    turn, direction, agreed = relative
    # Photo ray x, render point X: x is parallel to turn @ X + s * direction, which gives s for each point.
    ray = np.column_stack([matches.photo, np.ones(len(matches))]) @ np.linalg.inv(intrinsics).T
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    moved = prior.seen(world) @ turn.T
    along, across = np.cross(ray, np.broadcast_to(direction, ray.shape)), np.cross(ray, moved)
    parallax = (along * along).sum(axis=1)
    steps = -(along * across).sum(axis=1) / np.maximum(parallax, 1e-12)
    use = agreed & (parallax > 1e-3)
    if use.sum() < 5:
        return None
    # Far points tell little of the step: weigh each by what a pixel's error would change.
    weight = (np.sqrt(parallax) / np.linalg.norm(moved, axis=1))[use]
    order = np.argsort(steps[use], kind="stable")
    total = np.cumsum(weight[order])
    step = float(steps[use][order][np.searchsorted(total, total[-1] / 2)])
    centre = -turn.T @ (direction * step)
    return Pose(prior.world(centre[None])[0], turn @ prior.rotation)


def relative_pose(
    matches: Matches, intrinsics: NDArray[np.float64], *, pixels: float = 1.0
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]] | None:
    """Rotation and unit direction of the step between two views, by the five-point method in a consensus search.

    Returns
    -------
    tuple or None
        Rotation R, direction t (a point X in the first camera's axes is ``R X + s t`` in the second's, s of either
        sign) and which matches agree; None if there is no consensus.
    """
    cv2 = opencv()
    if len(matches) < 8:
        return None
    matrix, mask = cv2.findEssentialMat(
        matches.render, matches.photo, intrinsics, method=cv2.RANSAC, prob=0.9999, threshold=pixels, maxIters=3000
    )
    if matrix is None or matrix.shape[0] < 3 or mask is None:
        return None
    first, second, direction = cv2.decomposeEssentialMat(matrix[:3])
    # The cameras look about the same way: the solution with the small turn. Depth decides the direction's sign.
    turn = first if np.trace(first) > np.trace(second) else second
    return np.asarray(turn, np.float64), np.asarray(direction, np.float64).ravel(), mask.ravel().astype(np.bool_)


def _by_points(
    matches: Matches, world: NDArray[np.float64], intrinsics: NDArray[np.float64], pixels: float
) -> Pose | None:
    """Consensus search with poses of three points."""
    cv2 = opencv()
    try:
        found, turn, shift, _ = cv2.solvePnPRansac(
            world, matches.photo, intrinsics, None,
            iterationsCount=3000, reprojectionError=pixels * 1.5, confidence=0.9999, flags=cv2.SOLVEPNP_AP3P,
        )  # fmt: skip
    except cv2.error:  # points in one spot or on one line
        return None
    if not found or not (np.isfinite(turn).all() and np.isfinite(shift).all()):
        return None
    rotation = np.asarray(cv2.Rodrigues(turn)[0], np.float64)
    return Pose(-rotation.T @ np.asarray(shift, np.float64).ravel(), rotation)


def _refined(
    start: Pose,
    matches: Matches,
    world: NDArray[np.float64],
    prior: Pose,
    intrinsics: NDArray[np.float64],
    pixels: float,
) -> tuple[Pose, NDArray[np.bool_], float]:
    """Gauss-Newton on robust reprojection errors, weakly pulled to the prior."""
    pose = start
    hessian = np.eye(6)
    focal = intrinsics[0, 0]
    for _ in range(12):
        seen = pose.seen(world)
        ahead = seen[:, 2] > 0.1
        xy = projected(world, pose, intrinsics)
        gap = np.where(ahead[:, None], xy - matches.photo, 0.0)
        size = np.linalg.norm(gap, axis=1)
        # Tukey's weights: what is twice as far off as agrees has no say.
        weight = np.where(ahead & (size < 2 * pixels), (1 - (size / (2 * pixels)) ** 2) ** 2, 0.0)
        x, y, z = seen.T
        z = np.where(ahead, z, 1.0)
        zero = np.zeros_like(z)
        image = np.stack(
            [np.stack([focal / z, zero, -focal * x / z**2], 1), np.stack([zero, focal / z, -focal * y / z**2], 1)], 1
        )
        # A small turn w and step v in the camera's axes: seen' = seen + w x seen - v.
        cross = np.zeros((len(seen), 3, 3))
        cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = z, -y, x
        jacobian = np.concatenate([image @ (cross - cross.transpose(0, 2, 1)), -image], axis=2)
        hessian = np.einsum("nij,n,nik->jk", jacobian, weight, jacobian)
        slope = np.einsum("nij,n,ni->j", jacobian, weight, gap)
        off = _log(pose.rotation @ prior.rotation.T)
        step_off = pose.rotation @ (pose.position - prior.position)
        pull = np.array([1 / _PRIOR_RADIANS**2] * 3 + [1 / _PRIOR_METRES**2] * 3)
        hessian += np.diag(pull)
        slope += pull * np.concatenate([off, step_off])
        delta = -np.linalg.solve(hessian, slope)
        pose = Pose(pose.position + pose.rotation.T @ delta[3:], _exp(delta[:3]) @ pose.rotation)
        if np.abs(delta).max() < 1e-7:
            break
    gap = np.linalg.norm(projected(world, pose, intrinsics) - matches.photo, axis=1)
    inlier = np.nan_to_num(gap, nan=np.inf) <= pixels
    covariance = np.linalg.inv(hessian)[3:, 3:]
    return pose, inlier, float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))


def _cross(v: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def _exp(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    angle = float(np.linalg.norm(vector))
    if angle < 1e-12:
        return np.eye(3)
    cross = _cross(vector / angle)
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross))


def _log(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angle-axis vector of a rotation; good away from half a turn."""
    angle = float(np.arccos(np.clip((np.trace(rotation) - 1) / 2, -1.0, 1.0)))
    skew = rotation - rotation.T
    axis: NDArray[Any] = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    return np.asarray(axis / 2 if angle < 1e-6 else axis * (angle / (2 * np.sin(angle))))
