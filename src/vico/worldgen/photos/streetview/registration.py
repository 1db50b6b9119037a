"""Registration of street photos: a camera's pose, and a shift of its colours for each wall.

The pose is found from points that the photo shares with a rendered view. The paper's way is the essential matrix by
the five-point method (Nister 2004), which leaves the length of the step open: the render's depth tells it. As every
point of the render is a known point of the world, the pose is then refined on reprojection errors, which also holds
where all points lie on one facade or the step is short, and the five-point method does not.

A pose may be a few centimetres and a tenth of a degree off, and a wall may stand a little before or behind its place.
Both move a photo on the wall by tenths of a metre, more than a window's frame is wide. So a photo is nudged to what
the wall's texels show already.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.worldgen.photos.atlas import Chart
from vico.worldgen.photos.streetview.matching import Matches, opencv

_NORM_METRES = 20.0
# Of a pixel and its eight neighbours, row by row
_ABOVE = 1
_LEFT = 3
_HERE = 4
_RIGHT = 5
_BELOW = 7
_ENOUGH = 12  # points that agree on a pose
# Expected errors of the metadata: a weak pull where points say little.
_PRIOR_METRES = 3.0
_PRIOR_RADIANS = 0.07


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

    def to_camera(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
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
    """Pose that fits the matches.

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
    points, solid = unproject(matches.render, depth, prior, intrinsics)
    none = PoseFit(None, None, np.zeros(len(matches), np.bool_), float("nan"), float("inf"))
    if solid.sum() < 8:
        return none
    used = matches.select(solid)
    world = points[solid]
    best: tuple[Pose, NDArray[np.bool_], float] | None = None
    start = _pose_from_points(used, world, intrinsics, pixels)
    if start is not None:
        best = _refine_pose(start, used, world, prior, intrinsics, pixels)
    # A consensus search among what agrees already is a matter of a few tries; among all, of thousands.
    agreed = np.ones(len(used), np.bool_) if best is None or best[1].sum() < _ENOUGH else best[1]
    five_point = _five_point(used.select(agreed), world[agreed], prior, intrinsics, pixels)
    if five_point is not None:
        other = _refine_pose(five_point, used, world, prior, intrinsics, pixels)
        if best is None or other[1].sum() > best[1].sum():
            best = other
    inliers = np.zeros(len(matches), np.bool_)
    if best is None or best[1].sum() < 6:
        return PoseFit(five_point, None, inliers, float("nan"), float("inf"))
    pose, inlier, spread = best
    inliers[solid] = inlier
    gap = np.linalg.norm(project(world[inlier], pose, intrinsics) - used.photo[inlier], axis=1)
    return PoseFit(five_point, pose, inliers, float(np.sqrt((gap**2).mean())), spread)


def unproject(
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


def project(points: NDArray[np.float64], pose: Pose, intrinsics: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixels of world points, shape ``(n, 2)``; NaN behind the camera."""
    seen = pose.to_camera(points)
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
    moved = prior.to_camera(world) @ turn.T
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


def _pose_from_points(
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


def _refine_pose(
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
        seen = pose.to_camera(world)
        ahead = seen[:, 2] > 0.1
        xy = project(world, pose, intrinsics)
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
        off = _rotation_vector(pose.rotation @ prior.rotation.T)
        step_off = pose.rotation @ (pose.position - prior.position)
        pull = np.array([1 / _PRIOR_RADIANS**2] * 3 + [1 / _PRIOR_METRES**2] * 3)
        hessian += np.diag(pull)
        slope += pull * np.concatenate([off, step_off])
        delta = -np.linalg.solve(hessian, slope)
        pose = Pose(pose.position + pose.rotation.T @ delta[3:], _exp(delta[:3]) @ pose.rotation)
        if np.abs(delta).max() < 1e-7:
            break
    gap = np.linalg.norm(project(world, pose, intrinsics) - matches.photo, axis=1)
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


def _rotation_vector(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angle-axis vector of a rotation; good away from half a turn."""
    angle = float(np.arccos(np.clip((np.trace(rotation) - 1) / 2, -1.0, 1.0)))
    skew = rotation - rotation.T
    axis: NDArray[Any] = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    return np.asarray(axis / 2 if angle < 1e-6 else axis * (angle / (2 * np.sin(angle))))


FARTHEST_NUDGE = 0.7
"""Metres that a photo is moved at most."""

_FINE = 0.12  # metres: what is finer is noise or lost in one of the two
_COARSE = 0.9  # metres: what is broader is light
_BLOCK = 5.0  # metres: parts of a wall that are compared each by itself
_LEAST_SIDE = 2.0  # metres of a part that is worth matching
_LEAST = 0.25  # correlation that two parts must have
_LEAST_CONTRAST = 2.5  # levels of luminance: a wall with less has nothing to be recognised by
_AROUND = 1.2  # metres around a place that photo and wall are compared in
_UNLIKE = 0.05  # agreement at which a photo counts nothing
_ALIKE = 0.35  # and from which it counts fully
_PLAIN = 0.15  # spread of normalised detail that counts as none
_FAR_COLOUR = 16.0  # Lab: beyond twice this, something else stands before the wall, or the sky is seen over it
_SHIFT = 0.3  # metres of shift expected
_STAND = 0.25  # metres that the wall's plane may be off
_NOISE = 0.06  # metres that a part's own shift may be wrong


@dataclass(frozen=True)
class Nudge:
    """Where a photo's colours of a chart are to be taken from.

    Attributes
    ----------
    offset
        Metres to add to the texels' places, ENU, shape ``(3,)``.
    before, after
        Correlation of the photo with the chart's texels, as it came and with the one shift; NaN where nothing could be
        compared.
    """

    offset: NDArray[np.float64]
    before: float
    after: float


NO_NUDGE = Nudge(np.zeros(3), float("nan"), float("nan"))


def nudge_of(
    chart: Chart,
    photo: NDArray[np.float32],
    shown: NDArray[np.bool_],
    wall: NDArray[np.float32],
    known: NDArray[np.bool_],
    pose: Pose,
) -> Nudge:
    """Find how a photo must be moved to lie on a chart.

    Parameters
    ----------
    chart
        The wall's texels.
    photo, wall
        Luminance 0..255 of the photo as projected there, and of the chart's texels, shape ``(height, width)``.
    shown, known
        Where each of these is to be trusted, of the same shape.
    pose
        Of the photo's camera.

    Returns
    -------
    Nudge
        `NONE` where the two have too little in common to tell.

    Notes
    -----
    Parts of the wall are compared by normalised correlation of what is between 0.1 and 1 m large. Their shifts are
    explained by one shift on the wall and by a wall that stands before or behind its place: that moves what is far
    from the camera's foot more than what is near.
    """
    texel = float(np.linalg.norm(chart.right))
    reach = max(round(FARTHEST_NUDGE / texel), 1)
    a, b = _band(photo, shown, texel), _band(wall, known, texel)
    side = max(round(_BLOCK / texel), 8)
    rows, columns = (np.linspace(0, n, max(round(n / side), 1) + 1).astype(int) for n in a.shape)
    right, up = chart.right / texel, chart.up / float(np.linalg.norm(chart.up))
    foot = pose.position - chart.origin
    away = float(foot @ chart.normal)
    if away < 0.5 or min(a.shape) * texel < _LEAST_SIDE / 2:
        return NO_NUDGE
    lines: list[tuple[float, float, float]] = []  # shift, what the plane's stand would do, weight
    axes: list[int] = []
    total = np.zeros((3, 2 * reach + 1, 2 * reach + 1))
    for top, bottom in zip(rows[:-1].tolist(), rows[1:].tolist(), strict=True):
        for left, end in zip(columns[:-1].tolist(), columns[1:].tolist(), strict=True):
            part = slice(top, bottom), slice(left, end)
            if (known[part] & shown[part]).sum() * texel**2 < _LEAST_SIDE**2:
                continue
            sums = _sums(a, shown, b[part], known[part], top, left, reach)
            if sums is None:
                continue
            total += sums
            found = _peak(_ratio(sums))
            if found is None or found[2] < _LEAST:
                continue
            middle = np.array([left + end, top + bottom]) / 2 * texel
            far = (middle - np.array([foot @ right, foot @ up])) / away
            weight = found[2] ** 2
            for axis in (0, 1):
                lines.append((found[axis] * texel, float(far[axis]), weight))
                axes.append(axis)
    if not lines:
        return NO_NUDGE
    shift = _fit_shift(np.array(lines), np.array(axes))
    ratio = _ratio(total)
    centre = float(ratio[reach, reach])
    x, y = (int(np.clip(round(v / texel), -reach, reach)) for v in shift[:2])
    offset = shift[0] * right + shift[1] * up + shift[2] * chart.normal
    return Nudge(np.asarray(offset, np.float64), centre, float(ratio[reach + y, reach + x]))


def agreement(
    photo: NDArray[np.float32],
    shown: NDArray[np.bool_],
    wall: NDArray[np.float32],
    known: NDArray[np.bool_],
    texel: float,
) -> NDArray[np.float32]:
    """How far a photo shows what a wall's texels do, place by place.

    Parameters
    ----------
    photo, wall
        CIE L*a*b* of the photo as projected there, in the wall's colours, and of the wall's texels, shape
        ``(height, width, 3)``.
    shown, known
        Where each of these is to be trusted, shape ``(height, width)``.
    texel
        Metres.

    Returns
    -------
    ndarray
        0..1, shape ``(height, width)``: 0 where the photo has other detail than the wall (a tree, an awning, a wrong
        place) or another colour (the sky over the eaves); 1 where they agree, or nothing is known of the wall.
    """
    cv2 = opencv()

    def smooth(values: NDArray[np.float32], sigma: float) -> NDArray[np.float32]:
        return np.asarray(cv2.GaussianBlur(values, (0, 0), sigma / texel), np.float32)

    light = np.float32(2.55)
    a, b = _band(photo[..., 0] * light, shown, texel), _band(wall[..., 0] * light, known, texel)
    both = (shown & known).astype(np.float32)
    share = smooth(both, _AROUND)
    alike = (2 * smooth(a * b * both, _AROUND) + _PLAIN**2 * share) / np.maximum(
        smooth((a * a + b * b) * both, _AROUND) + _PLAIN**2 * share, 1e-6
    )
    alike = np.where(share > 0.02, alike, 1.0)
    # The wall's colour about a place, from as near as it is known.
    seen, own = shown.astype(np.float32), known.astype(np.float32)
    there = smooth(photo * seen[..., None], _COARSE / 3) / np.maximum(smooth(seen, _COARSE / 3), 1e-3)[..., None]
    reach = smooth(own, 2 * _AROUND)
    wanted = smooth(wall * own[..., None], 2 * _AROUND) / np.maximum(reach, 1e-3)[..., None]
    tints = np.array([0.5, 1.0, 1.0], np.float32)  # light and shade move on a wall, its tint does not
    far = np.linalg.norm((there - wanted) * tints, axis=2)
    # What the wall has there itself may differ from its surroundings: a shop front, a window.
    usual = smooth(np.linalg.norm((wall - wanted) * tints, axis=2) * own, _AROUND) / np.maximum(
        smooth(own, _AROUND), 1e-3
    )
    odd = np.where(reach > 1e-3, far - usual, 0.0)
    weight = np.clip((alike - _UNLIKE) / (_ALIKE - _UNLIKE), 0.0, 1.0)
    weight *= np.clip(2.0 - odd / _FAR_COLOUR, 0.0, 1.0)
    return np.asarray(weight, np.float32)


def _band(grey: NDArray[np.float32], where: NDArray[np.bool_], texel: float) -> NDArray[np.float32]:
    """Return what is as large as windows and their frames, in like contrast everywhere; 0 where nothing is known."""
    cv2 = opencv()
    weight = where.astype(np.float32)

    def smooth(values: NDArray[np.float32], sigma: float) -> NDArray[np.float32]:
        spread = sigma / texel
        share = cv2.GaussianBlur(weight, (0, 0), spread)
        return np.asarray(cv2.GaussianBlur(values * weight, (0, 0), spread) / np.maximum(share, 1e-3), np.float32)

    detail = smooth(grey, _FINE) - smooth(grey, _COARSE)
    contrast = np.sqrt(smooth(detail * detail, 2 * _COARSE)) + np.float32(_LEAST_CONTRAST)
    return np.asarray(detail / contrast * weight, np.float32)


def _sums(
    a: NDArray[np.float32],
    shown: NDArray[np.bool_],
    part: NDArray[np.float32],
    known: NDArray[np.bool_],
    top: int,
    left: int,
    reach: int,
) -> NDArray[np.float64] | None:
    """Products of a part of the wall with the photo at all shifts: both together, and each with itself."""
    cv2 = opencv()
    height, width = part.shape
    window = np.zeros((height + 2 * reach, width + 2 * reach), np.float32)
    mask = np.zeros_like(window)
    y0, x0 = max(top - reach, 0), max(left - reach, 0)
    y1, x1 = min(top + height + reach, a.shape[0]), min(left + width + reach, a.shape[1])
    inner = slice(y0 - top + reach, y1 - top + reach), slice(x0 - left + reach, x1 - left + reach)
    window[inner], mask[inner] = a[y0:y1, x0:x1], shown[y0:y1, x0:x1]
    own = known.astype(np.float32)
    if not (mask.any() and own.any()):
        return None
    pairs = ((window, part), (window * window, own), (mask, part * part))
    return np.stack([cv2.matchTemplate(x, y, cv2.TM_CCORR) for x, y in pairs]).astype(np.float64)


def _ratio(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Normalised correlation at all shifts; 0 where there is nothing to compare."""
    energy = np.sqrt(np.maximum(sums[1], 0.0) * np.maximum(sums[2], 0.0))
    return np.asarray(np.where(energy > 1.0, sums[0] / np.maximum(energy, 1e-9), 0.0))


def _peak(ratio: NDArray[np.float64]) -> tuple[float, float, float] | None:
    """Shift along and up of the best correlation, between texels, and how good it is; None at the border."""
    row, column = np.unravel_index(int(ratio.argmax()), ratio.shape)
    size = len(ratio)
    if not (0 < row < size - 1 and 0 < column < size - 1):
        return None

    def between(low: float, here: float, high: float) -> float:
        bend = 2 * here - low - high
        return float(np.clip((high - low) / (2 * bend), -0.5, 0.5)) if bend > 1e-9 else 0.0

    here = float(ratio[row, column])
    x = column + between(ratio[row, column - 1], here, ratio[row, column + 1])
    y = row + between(ratio[row - 1, column], here, ratio[row + 1, column])
    return x - size // 2, y - size // 2, here


def _fit_shift(lines: NDArray[np.float64], axes: NDArray[np.int64]) -> NDArray[np.float64]:
    """Shift along, up, and stand of the wall, metres, that explain the parts' shifts; odd ones have no say."""
    basis = np.column_stack([axes == 0, axes == 1, lines[:, 1]]).astype(np.float64)
    prior = np.diag([_NOISE / _SHIFT, _NOISE / _SHIFT, _NOISE / _STAND]) ** 2
    weight = lines[:, 2]
    found = np.zeros(3)
    for _ in range(6):
        found = np.linalg.solve(basis.T @ (basis * weight[:, None]) + prior, basis.T @ (weight * lines[:, 0]))
        off = np.abs(basis @ found - lines[:, 0])
        limit = max(3 * 1.4826 * float(np.median(off)), 3 * _NOISE)
        weight = lines[:, 2] * np.where(off < limit, (1 - (off / limit) ** 2) ** 2, 0.0)
        if not weight.any():
            return np.zeros(3)
    return np.asarray(np.clip(found, -FARTHEST_NUDGE, FARTHEST_NUDGE))
