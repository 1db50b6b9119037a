"""Street photos on the buildings: the pose of each is mended, what moves is masked, and the rest painted on walls.

Paper, section "Street View Reprojection": (1) a camera from the photo's metadata, (2) its pose corrected by matching
the photo with a view rendered from there, (3) people and vehicles masked and painted over, (4) colours aligned and the
photo projected on the walls, each wall from the camera that sees it best.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vico.geo.street_images import StreetImage
from vico.world.model import Dropped
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.ray_casting import RayCaster
from vico.worldgen.photos.atlas import Atlas
from vico.worldgen.photos.streetview.blending import Blending, Layer, paint_chart
from vico.worldgen.photos.streetview.matching import opencv
from vico.worldgen.photos.streetview.painting import ColourCurve, colour_curve, lab_of
from vico.worldgen.photos.streetview.photo import (
    Ground,
    Photographer,
    PhotoOutcome,
    StreetviewConfig,
    flat_ground,
    prepared,
)
from vico.worldgen.photos.streetview.projection import (
    PATCH,
    Samples,
    Seen,
    Shot,
    chosen_cameras,
    in_frustum,
    samples_of,
    seen_from,
)

_FEWEST_KNOWN = 300  # samples that a photo's colours are compared with, before it is compared with the other photos
_FEWEST_ON_CHART = 8
_MOST_LIGHTER, _MOST_TINTED = 25.0, 12.0  # Lab: what light and shade on one wall may amount to


@dataclass(frozen=True)
class StreetviewReport:
    """What became of all photos, in the order they came.

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
    views: list[Seen] = []
    for image in images:
        with drop_on_failure(f"{image.source} {image.id}"):
            outcome, shot = prepared(image, photograph, config, ground or flat_ground)
            if shot is not None:
                seen = _sampled(samples, shot, atlas, sight, config)
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
    curves = _curves(samples, views, looks)
    pages = [page.copy() for page in atlas.pages]
    known = [page.copy() for page in atlas.known]
    charts, texels = [0] * len(shots), [0] * len(shots)
    painted_charts = painted_texels = 0
    how = Blending(config.farthest, np.radians(config.steepest), config.feather, config.unshade, config.nudge)
    for number, cameras in _assigned(samples, views, config).items():
        layers = [
            Layer(shots[k][1], curves[k], _shade(samples, views[k], looks[k], curves[k], number, config))
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


def _sampled(samples: Samples, shot: Shot, atlas: Atlas, sight: RayCaster | None, config: StreetviewConfig) -> Seen:
    """Which samples of the atlas a photo shows: view-frustum clipping by chart, then point by point."""
    charts = in_frustum(samples, shot, config.farthest)
    spans = [np.arange(samples.bounds[c], samples.bounds[c + 1]) for c in charts.tolist()]
    index = np.concatenate(spans) if spans else np.zeros(0, np.int64)
    seen = seen_from(
        shot, samples.points[index], samples.normals[index], sight,
        texel=atlas.texel, farthest=config.farthest, steepest=np.radians(config.steepest),
    )  # fmt: skip
    return replace(seen, index=index[seen.index])


def _curves(samples: Samples, views: Sequence[Seen], looks: Sequence[NDArray[np.float32]]) -> list[ColourCurve]:
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


def _shade(
    samples: Samples,
    seen: Seen,
    lab: NDArray[np.float32],
    curve: ColourCurve,
    number: int,
    config: StreetviewConfig,
) -> NDArray[np.float64]:
    """Return what to add to a photo's colours on one chart, so that its middle is the chart's known colour."""
    mine = (samples.chart[seen.index] == number) & samples.known[seen.index]
    if not config.unshade > 0 or mine.sum() < _FEWEST_ON_CHART:
        return np.zeros(3)
    gap = samples.lab[seen.index[mine]] - curve.applied(lab[mine])
    limit = np.array([_MOST_LIGHTER, _MOST_TINTED, _MOST_TINTED])
    return np.asarray(np.clip(np.median(gap, axis=0), -limit, limit), np.float64)


def _assigned(samples: Samples, views: Sequence[Seen], config: StreetviewConfig) -> dict[int, list[int]]:
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
            order = chosen_cameras(qualities, int(count), most=config.cameras, least=config.least_gain)
            if order:
                assigned[number] = [cameras[k] for k in order]
    return assigned
