"""One street photo made ready for the walls: its pose mended, what moves in it painted over, or the reason why not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError
from vico.geo.street_images import StreetImage
from vico.worldgen.photos.streetview.masks import Movers, PhotoView, StandingDifferences
from vico.worldgen.photos.streetview.matching import Matcher, SiftMatcher, opencv
from vico.worldgen.photos.streetview.painting import FastMarching, Painter
from vico.worldgen.photos.streetview.pose import Correction, Pose, PoseFit, correction, fit_pose
from vico.worldgen.photos.streetview.projection import Shot

#: Renders the world as it is textured now. Takes a position ``(3,)``, a world-to-camera rotation ``(3, 3)``, camera
#: matrix ``(3, 3)``, width and height; gives RGB uint8 ``(h, w, 3)``, depth along the axis in metres, 0 for none,
#: float32 ``(h, w)``, and entities int32 ``(h, w)``.
Photographer = Callable[
    [NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], int, int],
    tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.int32]],
]

#: Heights of the ground at points of shape ``(n, 2)``.
Ground = Callable[[NDArray[np.float64]], Any]

# How many times nearer matches must lie in each round than in the first, and what share of the last round's demands on
# their number it makes: a wrong pose finds few partners where things would have to be, so the last round tells.
_ROUNDS = ((1.0, 0.6), (4.0, 1.0))
_SAME_VIEW = 0.08  # metres (norm of a correction) up to which a render need not be made anew: a pixel or two


@dataclass(frozen=True)
class StreetviewConfig:
    """How photos are matched, judged and projected.

    Attributes
    ----------
    matcher, movers, painter
        What matches photo and render, finds what moves, and paints over it; defaults need no weights.
    width
        Pixels of the longer side of the renders, which matching and masking work on.
    pose
        Which pose is used: refined on the points' reprojection, the paper's five-point method's as it is, or the
        metadata's without matching (of a survey that knows it to a few centimetres).
    shift, turn
        How far off a photo's metadata may be, metres and degrees: matches are looked for as far as that.
    most_norm
        Largest norm of a correction's se(3) vector, metres (20 m to the radian); the paper's check.
    least_inliers, least_share
        Matches that must agree on the pose in the last round, and their least share of all.
    most_uncertain
        Largest standard deviation of the pose's position, metres.
    most_masked
        A photo that is masked by more than this share is not used.
    farthest, steepest
        Metres and degrees (from a wall's normal) beyond which a photo is not used on a wall.
    cameras, least_gain
        Most photos on one chart, and what each must add, as a share of the chart seen perfectly.
    feather
        Width of a seam, metres.
    unshade
        Where a wall's colour is known already, it stays as it is in patches this wide, metres, and the photo gives
        what is finer, so that its light and shade are not painted on the wall; 0 takes all from the photo.
    nudge
        Whether each photo is moved on each wall to lie on what the wall shows already.
    """

    matcher: Matcher = field(default_factory=SiftMatcher)
    movers: Movers | None = field(default_factory=StandingDifferences)
    painter: Painter = field(default_factory=FastMarching)
    width: int = 768
    pose: Literal["refined", "five_point", "given"] = "refined"
    shift: float = 4.0
    turn: float = 8.0
    most_norm: float = 6.0
    least_inliers: int = 16
    least_share: float = 0.1
    most_uncertain: float = 0.5
    most_masked: float = 0.7
    farthest: float = 70.0
    steepest: float = 75.0
    cameras: int = 4
    least_gain: float = 0.02
    feather: float = 0.5
    unshade: float = 1.0
    nudge: bool = True

    def __post_init__(self) -> None:
        if not 64 <= self.width <= 8192:
            raise InputError(f"street photos: renders {self.width} pixels wide; it must lie within 64..8192")
        if min(self.shift, self.turn, self.most_norm, self.farthest, self.feather) <= 0 or self.cameras < 1:
            raise InputError("street photos: shift, turn, most_norm, farthest, feather and cameras must be positive")


@dataclass(frozen=True)
class PhotoOutcome:
    """What became of one photo.

    Attributes
    ----------
    id, source, attribution
        Of the photo.
    used
        Whether some wall has its colours.
    reason
        Why not; empty where it is used.
    matches, inliers
        Points matched in the last round, and those that agree on the pose.
    error
        Their root mean square reprojection error, pixels of the render; NaN without a pose.
    moved
        How the refined pose differs from the metadata's; None without one.
    five_point
        The same of the five-point method's.
    masked
        Share of the picture that was masked.
    charts, texels
        How many it was projected on.
    pose, five_point_pose
        The pose that is used, if one is, and the five-point method's.
    """

    id: str
    source: str
    attribution: str
    used: bool
    reason: str = ""
    matches: int = 0
    inliers: int = 0
    error: float = float("nan")
    moved: Correction | None = None
    five_point: Correction | None = None
    masked: float = 0.0
    charts: int = 0
    texels: int = 0
    pose: Pose | None = None
    five_point_pose: Pose | None = None


def flat_ground(xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Heights of a plane at 0."""
    return np.zeros(np.asarray(xy).shape[:-1])


def seated(image: StreetImage, ground: Ground) -> Pose:
    """Return the pose a photo's metadata give, lifted on the terrain where its height is known above ground only."""
    position = np.asarray(image.position, np.float64).copy()
    if image.eye is not None:
        position[2] = float(np.asarray(ground(position[None, :2])).ravel()[0]) + image.eye
    return Pose(position, np.asarray(image.rotation, np.float64))


def prepared(
    image: StreetImage, photograph: Photographer, config: StreetviewConfig, ground: Ground
) -> tuple[PhotoOutcome, Shot | None]:
    """Mend a photo's pose and paint over what moves; None if it can't be used, with the reason."""
    cv2 = opencv()
    height, width = image.picture.shape[:2]
    share = min(config.width / max(width, height), 1.0)
    size = round(width * share), round(height * share)
    small = cv2.resize(image.picture, size, interpolation=cv2.INTER_AREA)
    lens = image.intrinsics.copy()
    lens[0] *= size[0] / width
    lens[1] *= size[1] / height
    metadata = seated(image, ground)
    outcome = PhotoOutcome(image.id, image.source, image.attribution, used=False)
    pose = seen_from = metadata
    fit: PoseFit | None = None
    for nearer, least in () if config.pose == "given" else _ROUNDS:
        shift, turn = config.shift / nearer, config.turn / nearer
        render, depth, _ = photograph(pose.position, pose.rotation, lens, *size)
        if not (depth > 0).any():
            return replace(outcome, reason="the world shows nothing from where it was taken"), None
        near = np.maximum(depth, 1.0)
        reach = np.where(depth > 0, lens[0, 0] * (np.radians(turn) + shift / near), 0.0).astype(np.float32)
        matches = config.matcher.match(render, small, reach)
        fit = fit_pose(matches, depth, pose, lens)
        five_point = fit.five_point
        found = fit.refined if config.pose == "refined" else five_point
        outcome = replace(
            outcome,
            matches=len(matches),
            inliers=int(fit.inliers.sum()),
            error=fit.error,
            moved=None if fit.refined is None else correction(metadata, fit.refined),
            five_point_pose=five_point,
            five_point=None if five_point is None else correction(metadata, five_point),
        )
        reason = _doubts(outcome, fit, found, metadata, least, config)
        if reason:
            return replace(outcome, reason=reason), None
        assert found is not None
        seen_from, pose = pose, found
    if config.pose == "given" or correction(seen_from, pose).norm > _SAME_VIEW:
        render, depth, _ = photograph(pose.position, pose.rotation, lens, *size)
    mask = np.zeros(depth.shape, np.bool_)
    if config.movers is not None:
        mask = config.movers.mask(PhotoView(small, render, depth, above_ground(depth, pose, lens, ground), lens[0, 0]))
    outcome = replace(outcome, masked=float(mask.mean()), pose=pose)
    if outcome.masked > config.most_masked:
        return replace(outcome, reason=f"{outcome.masked:.0%} of it shows people, vehicles or other things"), None
    full = cv2.resize(mask.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST) > 0
    # Painting is slow and smooth: done small, and taken where something was masked only.
    filled = cv2.resize(config.painter(small, mask), (width, height), interpolation=cv2.INTER_LINEAR)
    picture = np.where(full[..., None], filled, image.picture)
    return outcome, Shot(image.id, picture, full, pose, image.intrinsics, depth)


def _doubts(
    outcome: PhotoOutcome, fit: PoseFit, found: Pose | None, metadata: Pose, least: float, config: StreetviewConfig
) -> str | None:
    """Why a pose is not to be believed, or None; `least` is what the round asks for of what the last one does."""
    needed, share = round(least * config.least_inliers), least * config.least_share
    if outcome.inliers < needed or found is None:
        return f"{outcome.inliers} of {outcome.matches} matches agree on a pose; {needed} are needed"
    if outcome.inliers < share * outcome.matches:
        return f"{outcome.inliers} of {outcome.matches} matches agree on a pose; {share:.0%} of them must"
    moved = correction(metadata, found)
    if not moved.norm <= config.most_norm:
        return (
            f"the pose would move by {moved.shift:.1f} m and {moved.turn:.1f} degrees (norm {moved.norm:.1f} m, at "
            f"most {config.most_norm:.1f})"
        )
    if fit.uncertainty > config.most_uncertain:
        return f"its matches leave the position uncertain by {fit.uncertainty:.2f} m"
    return None


def above_ground(
    depth: NDArray[np.float32], pose: Pose, intrinsics: NDArray[np.float64], ground: Ground
) -> NDArray[np.float32]:
    """How high above the ground lies what each pixel shows, metres, infinite where nothing is; shape ``(h, w)``."""
    row, column = np.nonzero(depth > 0)
    hit = row, column
    rays = np.column_stack([column + 0.5, row + 0.5, np.ones(len(row))]) @ np.linalg.inv(intrinsics).T
    points = pose.world(rays * depth[hit][:, None].astype(np.float64))
    above = np.full(depth.shape, np.inf, np.float32)
    above[hit] = points[:, 2] - np.asarray(ground(points[:, :2])).ravel()
    return above
