"""Street photos on the buildings: the pose of each is mended, what moves is masked, and the rest painted on walls.

Paper, section "Street View Reprojection": (1) a camera from the photo's metadata, (2) its pose corrected by matching
the photo with a view rendered from there, (3) people and vehicles masked and painted over, (4) colours aligned and
the photo projected on the walls, each wall from the camera that sees it best.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError
from vico.geo.street_images import StreetImage
from vico.render.cameras import Cameras
from vico.render.frames import render
from vico.render.world_scene import scene_of
from vico.world.model import Dropped
from vico.world.world import World
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.ray_casting import RayCaster
from vico.worldgen.photos.atlas import Atlas
from vico.worldgen.photos.streetview.masking import (
    ColourCurve,
    FastMarchingFill,
    Movers,
    Painter,
    PhotoView,
    StandingDifferences,
    colour_curve,
    lab_of,
)
from vico.worldgen.photos.streetview.matching import Matcher, SiftMatcher, opencv
from vico.worldgen.photos.streetview.projection import (
    PATCH,
    BlendingConfig,
    CameraLayer,
    Samples,
    Shot,
    VisiblePoints,
    choose_cameras,
    in_frustum,
    paint_chart,
    samples_of,
    visible_points,
)
from vico.worldgen.photos.streetview.registration import Correction, Pose, PoseFit, correction, fit_pose

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
    painter: Painter = field(default_factory=FastMarchingFill)
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
    """Result for one photo.

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


def _prepare_photo(
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
    # Where metadata give the height above ground only, the pose is lifted on the terrain.
    position = np.asarray(image.position, np.float64).copy()
    if image.eye is not None:
        position[2] = float(np.asarray(ground(position[None, :2])).ravel()[0]) + image.eye
    metadata = Pose(position, np.asarray(image.rotation, np.float64))
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


def photographer_of(world: World) -> Photographer:
    """Return what renders a world with pinhole cameras whose principal point is the picture's middle."""
    scene = scene_of(world, rooms=False)

    def take(
        position: NDArray[np.float64], rotation: NDArray[np.float64], intrinsics: NDArray[np.float64], w: int, h: int
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.int32]]:
        fov = 2 * math.atan(h / 2 / intrinsics[1, 1])
        camera = Cameras(position[None], rotation[2][None], up=-rotation[1], fov_y=fov, width=w, height=h)
        frames = render(scene, camera, samples=1)
        return frames.rgb[0], frames.depth[0], frames.segmentation[0]

    return take


_FEWEST_KNOWN = 300  # samples that a photo's colours are compared with, before it is compared with the other photos
_FEWEST_ON_CHART = 8
# Lab: what light and shade on one wall may amount to.
_MOST_LIGHTER = 25.0
_MOST_TINTED = 12.0


@dataclass(frozen=True)
class StreetviewReport:
    """Results for all photos, in the order they came.

    Attributes
    ----------
    photos
        One outcome each.
    painted_charts, painted_texels
        How much of the atlas holds street photos now.
    """

    photos: tuple[PhotoOutcome, ...]
    painted_charts: int
    painted_texels: int

    @property
    def counts(self) -> dict[str, int]:
        """Numbers for the stage's report."""
        used = sum(photo.used for photo in self.photos)
        return {
            "photos": len(self.photos),
            "photos_used": used,
            "photos_refused": len(self.photos) - used,
            "charts": self.painted_charts,
            "texels": self.painted_texels,
        }

    @property
    def dropped(self) -> list[Dropped]:
        """Photos that were not used, and why, for the stage's report."""
        return [Dropped(id=f"{p.source} {p.id}", reason=p.reason) for p in self.photos if not p.used]

    @property
    def attributions(self) -> list[str]:
        """Whom to credit for the photos used, each once, in order."""
        return list(dict.fromkeys(photo.attribution for photo in self.photos if photo.used))


def reproject(
    atlas: Atlas,
    images: Iterable[StreetImage],
    photograph: Photographer,
    sight: RayCaster | None,
    *,
    config: StreetviewConfig | None = None,
    ground: Ground | None = None,
) -> tuple[Atlas, StreetviewReport]:
    """Paint street photos on the walls of an atlas.

    Parameters
    ----------
    atlas
        Texels of the walls and roofs, with whatever colours they have.
    images
        Photos with the poses their metadata give; taken one at a time.
    photograph
        Renders the world with the atlas's colours, and whatever else stands in it.
    sight
        The world's surfaces, for exact visibility; without, the rendered depth decides.
    config
        How; the defaults need OpenCV only.
    ground
        Terrain heights, such as a world's ``height``; flat at 0 without. Photos whose height is known above ground
        only are lifted on it.

    Returns
    -------
    tuple of Atlas and StreetviewReport
        A new atlas, and what became of each photo.

    Raises
    ------
    MissingExtraError
        If OpenCV, or what a plug-in in `config` needs, is not installed.

    Notes
    -----
    The paper's five-point pose is computed for every photo and reported; `StreetviewConfig.pose` says which is used.
    """
    opencv()
    config = config or StreetviewConfig()
    samples = samples_of(atlas)
    outcomes: list[PhotoOutcome] = []
    shots: list[tuple[int, Shot]] = []
    views: list[VisiblePoints] = []
    for image in images:
        with drop_on_failure(f"{image.source} {image.id}"):
            outcome, shot = _prepare_photo(image, photograph, config, ground or flat_ground)
            if shot is not None:
                seen = _visible_samples(samples, shot, atlas, sight, config)
                if len(seen.index):
                    shots.append((len(outcomes), shot))
                    views.append(seen)
                else:
                    outcome = replace(outcome, used=False, reason="sees no wall near enough")
            outcomes.append(outcome)
    looks = [
        lab_of(shot.colours(seen.xy, seen.pixels * (PATCH / atlas.texel)))
        for (_, shot), seen in zip(shots, views, strict=True)
    ]
    curves = _colour_curves(samples, views, looks)
    pages = [page.copy() for page in atlas.pages]
    known = [page.copy() for page in atlas.known]
    charts, texels = [0] * len(shots), [0] * len(shots)
    painted_charts = painted_texels = 0
    how = BlendingConfig(config.farthest, np.radians(config.steepest), config.feather, config.unshade, config.nudge)
    for number, cameras in _assign_cameras(samples, views, config).items():
        layers = [
            CameraLayer(shots[k][1], curves[k], _shade_on_chart(samples, views[k], looks[k], curves[k], number, config))
            for k in cameras
        ]
        colour, mine, given, _ = paint_chart(atlas, number, layers, sight, how)
        chart = atlas.charts[number]
        pages[chart.page][chart.box] = colour
        known[chart.page][chart.box] |= mine
        painted_charts += any(given)
        for k, count in zip(cameras, given, strict=True):
            charts[k] += count > 0
            texels[k] += count
            painted_texels += count
    for k, (place, _) in enumerate(shots):
        reason = "" if texels[k] else "other photos show all its walls better"
        outcomes[place] = replace(
            outcomes[place], used=texels[k] > 0, reason=reason, charts=charts[k], texels=texels[k]
        )
    new = replace(atlas, pages=tuple(pages), known=tuple(known))
    return new, StreetviewReport(tuple(outcomes), painted_charts, painted_texels)


def _visible_samples(
    samples: Samples, shot: Shot, atlas: Atlas, sight: RayCaster | None, config: StreetviewConfig
) -> VisiblePoints:
    """Which samples of the atlas a photo shows: view-frustum clipping by chart, then point by point."""
    charts = in_frustum(samples, shot, config.farthest)
    spans = [np.arange(samples.bounds[c], samples.bounds[c + 1]) for c in charts.tolist()]
    index = np.concatenate(spans) if spans else np.zeros(0, np.int64)
    seen = visible_points(
        shot, samples.points[index], samples.normals[index], sight,
        texel=atlas.texel, farthest=config.farthest, steepest=np.radians(config.steepest),
    )  # fmt: skip
    return replace(seen, index=index[seen.index])


def _colour_curves(
    samples: Samples, views: Sequence[VisiblePoints], looks: Sequence[NDArray[np.float32]]
) -> list[ColourCurve]:
    """Each photo's colours in line with what the walls it shows are known to be, else with all photos together."""
    everything = np.concatenate(list(looks)) if looks else np.zeros((0, 3), np.float32)
    curves = []
    for seen, lab in zip(views, looks, strict=True):
        known = samples.known[seen.index] & ~seen.painted
        if known.sum() >= _FEWEST_KNOWN:
            curves.append(colour_curve(lab[known], samples.lab[seen.index[known]], seen.quality[known]))
        else:
            curves.append(colour_curve(lab, everything, seen.quality))
    return curves


def _shade_on_chart(
    samples: Samples,
    seen: VisiblePoints,
    lab: NDArray[np.float32],
    curve: ColourCurve,
    number: int,
    config: StreetviewConfig,
) -> NDArray[np.float64]:
    """Return what to add to a photo's colours on one chart, so that its middle is the chart's known colour."""
    mine = (samples.chart[seen.index] == number) & samples.known[seen.index]
    if not config.unshade > 0 or mine.sum() < _FEWEST_ON_CHART:
        return np.zeros(3)
    gap = samples.lab[seen.index[mine]] - curve.apply(lab[mine])
    limit = np.array([_MOST_LIGHTER, _MOST_TINTED, _MOST_TINTED])
    return np.asarray(np.clip(np.median(gap, axis=0), -limit, limit), np.float64)


def _assign_cameras(samples: Samples, views: Sequence[VisiblePoints], config: StreetviewConfig) -> dict[int, list[int]]:
    """Return the cameras of each chart that has any, best first."""
    spans = [np.searchsorted(seen.index, samples.bounds) for seen in views]
    assigned: dict[int, list[int]] = {}
    for number in range(len(samples.bounds) - 1):
        start, count = samples.bounds[number], samples.bounds[number + 1] - samples.bounds[number]
        cameras, qualities = [], []
        for k, span in enumerate(spans):
            part = slice(span[number], span[number + 1])
            if part.start < part.stop:
                cameras.append(k)
                qualities.append((views[k].index[part] - start, views[k].quality[part]))
        if cameras:
            order = choose_cameras(qualities, int(count), most=config.cameras, least=config.least_gain)
            if order:
                assigned[number] = [cameras[k] for k in order]
    return assigned
