"""Street photos on walls: a street of two walls whose colours are known, rendered with our own renderer."""

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from vico.errors import InputError, MissingExtraError
from vico.geo.street_images import StreetImage, camera_rotation, cut_panorama, pinhole, rotation_from_axis_angle
from vico.render import Cameras, Scene, render
from vico.seeds import rng
from vico.world.mesh import Surface
from vico.worldgen.facts.ray_casting import RayCaster
from vico.worldgen.photos.atlas import Atlas, unwrap, with_atlas_pages
from vico.worldgen.photos.streetview.masking import (
    FastMarchingFill,
    LanguageGroundedMovers,
    PatchFill,
    PhotoView,
    StandingDifferences,
    colour_curve,
    lab_of,
    rgb_of,
)
from vico.worldgen.photos.streetview.matching import LoftrMatcher, Matches, SiftMatcher, XfeatMatcher
from vico.worldgen.photos.streetview.projection import BlendingConfig, CameraLayer, Shot, paint_chart
from vico.worldgen.photos.streetview.registration import Pose, correction
from vico.worldgen.photos.streetview.reprojection import Photographer, StreetviewConfig, above_ground, reproject
from vico.worldgen.stages import digest_of

cv2 = pytest.importorskip("cv2", reason="OpenCV is the extra photos")
pytest.importorskip("embreex", reason="embreex is the extra photos")

WIDTH, HEIGHT = 480, 360
LENS = pinhole(WIDTH, HEIGHT, 330.0)
TRUE = Pose(np.array([2.0, 0.0, 2.0]), camera_rotation(10.0, 8.0))


def quad(corner: tuple[float, ...], along: tuple[float, ...], up: tuple[float, ...], entity: int) -> Surface:
    a, b, c = (np.array(v, np.float64) for v in (corner, along, up))
    return Surface.from_triangles(
        np.array([a, a + b, a + b + c, a + c]), np.array([[0, 1, 2], [0, 2, 3]]), entity=entity
    )


GROUND = quad((-30, -20, 0), (60, 0, 0), (0, 45, 0), 1)
WALLS = [quad((-14, 15, 0), (28, 0, 0), (0, 0, 10), 100), quad((14, 15, 0), (0, -20, 0), (0, 0, 8), 101)]


def facade(shape: tuple[int, ...], random: np.random.Generator) -> np.ndarray:
    """Windows of many sizes in rows, each its own."""
    picture = np.full((*shape, 3), random.integers(150, 220, 3), np.float32)
    for row in range(4, shape[0] - 14, 22):
        for column in range(3, shape[1] - 16, 20):
            wide, tall = random.integers(6, 14, 2)
            picture[row : row + tall, column : column + wide] = random.integers(10, 120, 3)
            picture[row + tall // 2, column : column + wide] = 230
    return np.clip(picture + random.normal(0, 5, picture.shape), 0, 255).astype(np.uint8)


@dataclass(frozen=True)
class Street:
    """The true walls, the model's, and what sees them."""

    walls: list[Surface]
    true: Atlas
    model: Atlas
    sight: RayCaster


@cache
def street() -> Street:
    walls, _, empty = unwrap(WALLS, [], texel=0.1, page=512)
    random = rng(0, "facade")
    pages, soft = [p.copy() for p in empty.pages], [p.copy() for p in empty.pages]
    for chart in empty.charts:
        pages[chart.page][chart.box] = facade((chart.height, chart.width), random)
        blurred = cv2.GaussianBlur(pages[chart.page][chart.box], (0, 0), 1.6, borderType=cv2.BORDER_REPLICATE)
        soft[chart.page][chart.box] = np.clip(blurred * 0.95 + 6, 0, 255)
    true = replace(empty, pages=tuple(pages), known=empty.inside)
    model = replace(empty, pages=tuple(soft), known=tuple(i.copy() for i in empty.inside))
    solids = [GROUND, *WALLS]
    starts = np.cumsum([0, *(len(s.positions) for s in solids)])
    faces = np.concatenate([s.triangles + k for s, k in zip(solids, starts, strict=False)])
    return Street(walls, true, model, RayCaster(np.concatenate([s.positions for s in solids]), faces))


def photographer(atlas: Atlas, extra: tuple[Surface, ...] = ()) -> Photographer:
    scene = Scene([GROUND, *with_atlas_pages(street().walls, atlas), *extra])

    def take(position, rotation, intrinsics, width, height):  # type: ignore[no-untyped-def]
        fov = 2 * np.arctan(height / 2 / intrinsics[1, 1])
        camera = Cameras(position[None], rotation[2][None], up=-rotation[1], fov_y=fov, width=width, height=height)
        frames = render(scene, camera)
        return frames.rgb[0], frames.depth[0], frames.segmentation[0]

    return take


def box(x: float, y: float, wide: float, tall: float) -> Surface:
    """Something red that stands in the street."""
    low, high = np.array([x - wide / 2, y - 0.3, 0.0]), np.array([x + wide / 2, y + 0.3, tall])
    corners = np.array(
        [[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    )
    faces = [
        [0, 4, 5],
        [0, 5, 1],
        [2, 3, 7],
        [2, 7, 6],
        [0, 1, 3],
        [0, 3, 2],
        [4, 6, 7],
        [4, 7, 5],
        [1, 5, 7],
        [1, 7, 3],
    ]
    return Surface.from_triangles(corners, np.array(faces), colour=(200, 30, 40), entity=999)


def photo(
    name: str = "a", *, off: tuple[float, ...] = (0.8, -0.6, 0.1), extra: tuple[Surface, ...] = ()
) -> StreetImage:
    """A photo of the true street from `TRUE`, brighter than the model is, whose metadata are off."""
    rgb, _, _ = photographer(street().true, extra)(TRUE.position, TRUE.rotation, LENS, WIDTH, HEIGHT)
    bright = np.clip(rgb.astype(np.float32) * (1.1, 1.05, 0.98) + rng(0, "noise").normal(0, 2, rgb.shape), 0, 255)
    rotation = rotation_from_axis_angle([0.015, -0.03, 0.02]) @ TRUE.rotation
    return StreetImage(name, bright.astype(np.uint8), TRUE.position + off, rotation, LENS, None, "test", "me")


CONFIG = StreetviewConfig(width=480)


def error(atlas: Atlas, where: list[np.ndarray]) -> float:
    pairs = zip(atlas.pages, street().true.pages, where, strict=True)
    return float(np.concatenate([np.abs(a[w].astype(float) - b[w]) for a, b, w in pairs]).mean())


def test_a_photo_finds_its_place_and_sharpens_the_walls_it_shows() -> None:
    s = street()
    made, report = reproject(s.model, [photo()], photographer(s.model), s.sight, config=CONFIG)
    (outcome,) = report.photos
    assert outcome.used, outcome.reason
    assert outcome.pose is not None
    left = correction(TRUE, outcome.pose)
    assert left.shift < 0.15
    assert left.turn < 0.5
    changed = [(a != b).any(axis=2) for a, b in zip(made.pages, s.model.pages, strict=True)]
    assert sum(int(c.sum()) for c in changed) > 5000
    assert error(made, changed) < 0.8 * error(s.model, changed)
    assert report.counts == {
        "photos": 1, "photos_used": 1, "photos_refused": 0, "charts": outcome.charts, "texels": outcome.texels,
    }  # fmt: skip
    assert report.attributions == ["me"]
    # The model it was given is as it was, and the same again gives the same bytes.
    again, _ = reproject(s.model, [photo()], photographer(s.model), s.sight, config=CONFIG)
    assert all((a == b).all() for a, b in zip(made.pages, again.pages, strict=True))


def test_texels_become_known_only_where_a_photo_shows_them() -> None:
    s = street()
    blank = replace(s.model, known=tuple(np.zeros_like(k) for k in s.model.known))
    made, report = reproject(blank, [photo()], photographer(s.model), None, config=CONFIG)
    known = sum(int(k.sum()) for k in made.known)
    assert report.photos[0].texels == pytest.approx(known, rel=0.02)
    assert 0.1 < known / sum(int(i.sum()) for i in made.inside) < 0.8
    assert all(not (k & ~i).any() for k, i in zip(made.known, made.inside, strict=True))


def test_a_photo_of_elsewhere_is_refused_with_the_reason() -> None:
    s = street()
    other = replace(photo("other"), picture=rng(1, "x").integers(0, 255, (HEIGHT, WIDTH, 3)).astype(np.uint8))
    far = replace(photo("far"), position=np.array([900.0, 0, 1500.0]), rotation=camera_rotation(0.0, 80.0))
    made, report = reproject(s.model, [other, far], photographer(s.model), s.sight, config=CONFIG)
    assert [p.used for p in report.photos] == [False, False]
    assert "matches agree on a pose; 10 are needed" in report.photos[0].reason
    assert "shows nothing" in report.photos[1].reason
    assert [d.id for d in report.dropped] == ["test other", "test far"]
    assert all((a == b).all() for a, b in zip(made.pages, s.model.pages, strict=True))


def test_a_large_correction_is_not_believed() -> None:
    s = street()
    strict = replace(CONFIG, most_norm=0.5)
    _, report = reproject(s.model, [photo()], photographer(s.model), s.sight, config=strict)
    assert not report.photos[0].used
    assert "the pose would move by" in report.photos[0].reason


def test_what_stands_in_the_street_is_masked_and_not_painted_on_the_wall() -> None:
    s = street()
    things = (box(3.0, 9.0, 0.6, 1.8), box(7.5, 9.0, 4.0, 1.5))
    take = photographer(s.model)
    render_, depth, _ = take(TRUE.position, TRUE.rotation, LENS, WIDTH, HEIGHT)
    above = above_ground(depth, TRUE, LENS, lambda xy: np.zeros(len(xy)))
    assert np.nanmin(above) == pytest.approx(0.0, abs=0.02)
    _, _, entity = photographer(s.true, things)(TRUE.position, TRUE.rotation, LENS, WIDTH, HEIGHT)
    found = StandingDifferences().mask(PhotoView(photo(extra=things).picture, render_, depth, above, LENS[0, 0]))
    moving = entity == 999
    wall = above > 0.3
    assert (found & moving & wall).sum() > 0.9 * (moving & wall).sum()
    assert (found & ~moving & wall & np.isfinite(above)).mean() < 0.05
    made, report = reproject(s.model, [photo(extra=things)], take, s.sight, config=CONFIG)
    assert report.photos[0].used
    assert 0.01 < report.photos[0].masked < 0.3
    bare, _ = reproject(s.model, [photo(extra=things)], take, s.sight, config=replace(CONFIG, movers=None))
    clear, _ = reproject(s.model, [photo()], take, s.sight, config=replace(CONFIG, movers=None))
    for atlas in (made, bare):  # even what is not masked is kept off a wall that is known to look otherwise
        pairs = zip(atlas.pages, clear.pages, made.inside, strict=True)
        stained = sum(int(((np.abs(a.astype(int) - b).max(axis=2) > 60) & i).sum()) for a, b, i in pairs)
        assert stained < 150


def test_a_photo_without_a_known_height_is_lifted_on_the_terrain() -> None:
    s = street()
    low = replace(photo(), eye=2.0, position=photo().position * (1, 1, 0) + (0, 0, 2.0))
    _, report = reproject(s.model, [low], photographer(s.model), s.sight, config=CONFIG, ground=lambda xy: xy[:, 0] * 0)
    assert report.photos[0].used


def test_a_camera_that_sees_a_speck_of_a_wall_leaves_it_as_it_is() -> None:
    s = street()
    _, depth, _ = photographer(s.model)(TRUE.position, TRUE.rotation, LENS, WIDTH, HEIGHT)
    masked = np.ones((HEIGHT, WIDTH), np.bool_)
    masked[100:102, 240:242] = False
    shot = Shot("a", photo().picture, masked, TRUE, LENS, depth)
    flat = colour_curve(lab_of(photo().picture[:20, :20].reshape(-1, 3)), np.tile(np.float32([50, 0, 0]), (9, 1)))
    for k, chart in enumerate(s.model.charts):
        how = BlendingConfig(farthest=60.0, steepest=1.3, feather=0.5, unshade=1.0)
        colour, _, given, _ = paint_chart(s.model, k, [CameraLayer(shot, flat, np.zeros(3))], s.sight, how)
        assert given == [0]
        assert (colour == s.model.pages[chart.page][chart.box]).all()


def rendered_panorama(pose: Pose, width: int) -> np.ndarray:
    """Equirectangular, put together of renders to all six sides."""
    side = width // 2
    lens = pinhole(side, side, side / 2)
    take = photographer(street().true)
    column, row = np.meshgrid(np.arange(width) + 0.5, np.arange(width // 2) + 0.5)
    longitude, latitude = (column / width - 0.5) * 2 * np.pi, (0.5 - row / (width // 2)) * np.pi
    flat = np.cos(latitude)
    rays = np.stack([flat * np.sin(longitude), -np.sin(latitude), flat * np.cos(longitude)], axis=-1) @ pose.rotation
    made = np.zeros((width // 2, width, 3), np.uint8)
    for heading, pitch in ((0, 0), (90, 0), (180, 0), (270, 0), (0, 89.99), (0, -89.99)):
        rotation = camera_rotation(heading, pitch)
        picture, _, _ = take(pose.position, rotation, lens, side, side)
        seen = rays @ rotation.T
        here = (seen[..., 2] > 0) & (np.abs(seen[..., :2]).max(axis=-1) <= seen[..., 2] * 1.001)
        xy = np.clip((seen[here][:, :2] / seen[here][:, 2:] + 1) * side / 2, 0, side - 1).astype(int)
        made[here] = picture[xy[:, 1], xy[:, 0]]
    return made


def test_a_rendered_panorama_is_cut_into_what_cameras_would_see() -> None:
    true = Pose(TRUE.position, camera_rotation(40.0, 6.0, -5.0))
    whole = StreetImage("p", rendered_panorama(true, 1440), true.position, true.rotation, LENS, None, "test", "me")
    take = photographer(street().true)
    for view in cut_panorama(whole)[:2]:
        h, w = view.picture.shape[:2]
        direct, _, _ = take(view.position, view.rotation, view.intrinsics, w, h)
        gap = np.abs(cv2.GaussianBlur(view.picture, (0, 0), 1.0).astype(int) - cv2.GaussianBlur(direct, (0, 0), 1.0))
        assert np.median(gap) < 2
        assert (gap.max(axis=2) > 25).mean() < 0.02


def test_no_photos_change_nothing() -> None:
    s = street()
    made, report = reproject(s.model, [], photographer(s.model), s.sight)
    assert report.counts["photos"] == 0
    assert all((a == b).all() for a, b in zip(made.pages, s.model.pages, strict=True))


def test_a_curve_brings_a_dark_photo_to_its_reference() -> None:
    random = rng(0, "colours")
    reference = random.integers(40, 230, (4000, 3)).astype(np.uint8)
    dark = np.clip((reference / 255.0) ** 1.3 * (0.8, 0.7, 0.6) * 255, 0, 255).astype(np.uint8)
    curve = colour_curve(lab_of(dark), lab_of(reference))
    mended = rgb_of(curve.apply(lab_of(dark)))
    assert np.abs(mended - reference).mean() < 0.4 * np.abs(dark.astype(float) - reference).mean()
    assert (np.diff(curve.target) >= 0).all()


def test_painting_over_leaves_the_rest() -> None:
    picture = np.tile(np.arange(60, dtype=np.uint8)[None, :, None] * 4, (40, 1, 3))
    mask = np.zeros((40, 60), np.bool_)
    mask[10:20, 20:30] = True
    holed = np.where(mask[..., None], 255, picture).astype(np.uint8)
    filled = FastMarchingFill()(holed, mask)
    assert (filled[~mask] == picture[~mask]).all()
    assert np.abs(filled[mask].astype(int) - picture[mask]).mean() < 25
    assert FastMarchingFill()(picture, np.zeros_like(mask)) is picture


def test_patches_fill_a_pattern() -> None:
    pytest.importorskip("patchmatch", reason="PyPatchMatch is the extra patches")
    picture = np.kron(np.indices((16, 16)).sum(axis=0) % 2, np.ones((8, 8)))[..., None].repeat(3, axis=2) * 200
    mask = np.zeros(picture.shape[:2], np.bool_)
    mask[40:64, 40:64] = True
    filled = PatchFill()(np.where(mask[..., None], 90, picture).astype(np.uint8), mask)
    assert np.abs(filled.astype(float) - picture)[mask].mean() < 60


def test_sift_matches_stay_within_reach() -> None:
    picture = facade((200, 260), rng(3, "picture"))
    moved = np.roll(picture, (0, 12), (0, 1))
    wide = SiftMatcher().match(picture, moved, np.full((200, 260), 20.0, np.float32))
    gap = wide.photo - wide.render
    assert len(wide) > 40
    assert np.median(gap, axis=0) == pytest.approx([12, 0], abs=0.3)
    assert np.linalg.norm(gap, axis=1).max() <= 20.0
    none = SiftMatcher().match(picture, moved, np.zeros((200, 260), np.float32))
    assert len(none) == 0
    assert len(SiftMatcher().match(np.zeros_like(picture), moved, np.full((200, 260), 9.0, np.float32))) == 0


def test_matches_out_of_reach_are_dropped() -> None:
    matches = Matches(np.array([[5.0, 5], [15, 5]]), np.array([[9.0, 5], [25, 5]]), np.ones(2))
    assert len(matches.within(np.full((10, 20), 5.0, np.float32))) == 1


def test_plug_ins_say_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    for name in ("torch", "transformers", "kornia"):
        monkeypatch.setitem(sys.modules, name, None)
    picture, reach = np.zeros((64, 64, 3), np.uint8), np.ones((64, 64), np.float32)
    for matcher in (LoftrMatcher(tmp_path / "weights.ckpt"), XfeatMatcher()):
        with pytest.raises(MissingExtraError, match="pip install"):
            matcher.match(picture, picture, reach)
    with pytest.raises(MissingExtraError, match="pip install"):
        LanguageGroundedMovers("a", "b").mask(PhotoView(picture, picture, reach, reach, 50.0))


def test_a_configuration_and_a_report_can_be_kept_as_a_stage_s_product() -> None:
    s = street()
    outcome = reproject(s.model, [], photographer(s.model), s.sight)[1]
    assert digest_of(StreetviewConfig()) != digest_of(StreetviewConfig(painter=PatchFill()))
    assert digest_of(outcome) == digest_of(outcome)


def test_a_configuration_that_can_not_be_meant_is_refused() -> None:
    with pytest.raises(InputError, match="renders 3 pixels wide"):
        StreetviewConfig(width=3)
    with pytest.raises(InputError, match="positive"):
        StreetviewConfig(most_norm=0)
