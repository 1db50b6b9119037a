import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from scipy.ndimage import gaussian_filter

from vico.errors import InputError
from vico.seeds import rng
from vico.worldgen.photos.atlas import Atlas, Chart
from vico.worldgen.photos.enhancement import BackProjection, even_out_light, inpaint_atlas, pad_gutters, upscale_atlas
from vico.worldgen.photos.exemplar_fill import exemplar_fill, pull_push


def facade(height: int = 96, width: int = 160) -> np.ndarray:
    """Rows of windows on plaster; the ground floor differs."""
    picture = np.full((height, width, 3), (210, 190, 150), np.uint8)
    for top in range(8, height - 34, 24):
        for left in range(6, width - 14, 20):
            picture[top : top + 14, left : left + 10] = (60, 70, 90)
            picture[top : top + 14, left + 4 : left + 6] = (240, 240, 240)
    picture[height - 26 :] = (120, 90, 80)
    noise = rng(0, "facade").integers(-5, 6, picture.shape)
    return np.clip(picture.astype(int) + noise, 0, 255).astype(np.uint8)


def chart(page: int, x: int, y: int, width: int, height: int, entity: int = 1) -> Chart:
    right, up = np.array([0.1, 0, 0]), np.array([0, 0, 0.1])
    return Chart(entity, page, x, y, width, height, np.zeros(3), right, up, np.array([0.0, -1, 0]), 0)


def one_page(picture: np.ndarray, missing: np.ndarray) -> Atlas:
    """A page with one chart, foot first, and a gutter."""
    page, inside = np.zeros((128, 256, 3), np.uint8), np.zeros((128, 256), bool)
    known = inside.copy()
    placed = chart(0, 8, 8, picture.shape[1], picture.shape[0])
    page[placed.box], inside[placed.box], known[placed.box] = picture[::-1], True, ~missing[::-1]
    page[~known] = (255, 0, 255)
    return Atlas((page,), (inside,), (known,), (placed,), 0.1, 1)


def psnr(a: np.ndarray, b: np.ndarray) -> float:
    return float(10 * np.log10(255**2 / np.mean((a.astype(float) - b) ** 2)))


def test_missing_windows_come_back() -> None:
    picture = facade()
    missing = np.zeros(picture.shape[:2], bool)
    missing[4:30, 60:90] = missing[50:70, 20:44] = missing[74:90, 100:130] = True
    filled = exemplar_fill(np.where(missing[..., None], 0, picture).astype(np.uint8), missing)
    smooth = pull_push(picture, ~missing)
    assert (filled[~missing] == picture[~missing]).all()
    assert psnr(filled[missing], picture[missing]) > psnr(smooth[missing], picture[missing]) + 4
    again = exemplar_fill(np.where(missing[..., None], 0, picture).astype(np.uint8), missing)
    assert (again == filled).all()


@settings(max_examples=20, deadline=None)
@given(st.integers(1, 40), st.integers(1, 40), st.integers(0, 2**32 - 1), st.floats(0, 1))
def test_a_fill_copies_known_texels_whatever_the_shape(height: int, width: int, seed: int, share: float) -> None:
    random = rng(seed, "fill")
    picture = random.integers(1, 255, (height, width, 3)).astype(np.uint8)
    missing = random.random((height, width)) < share
    filled = exemplar_fill(np.where(missing[..., None], 0, picture).astype(np.uint8), missing)
    if missing.all():
        assert (filled == 0).all()
        return
    colours = {tuple(c) for c in picture[~missing].tolist()}
    assert {tuple(c) for c in filled.reshape(-1, 3).tolist()} <= colours


def test_an_atlas_is_filled_and_photos_stay_told_from_guesses() -> None:
    picture = facade()
    missing = np.zeros(picture.shape[:2], bool)
    missing[30:60, 60:100] = True
    atlas = one_page(picture, missing)
    done = inpaint_atlas(atlas)
    (placed,) = done.charts
    assert (done.pages[0][placed.box][::-1][~missing] == picture[~missing]).all()
    assert psnr(done.pages[0][placed.box][::-1][missing], picture[missing]) > 20
    assert done.known[0] is atlas.known[0]
    assert (atlas.pages[0][~atlas.known[0]] == (255, 0, 255)).all(), "the atlas given is as it was"
    smooth = pad_gutters(done)
    gutter = smooth.pages[0][4:8, 8 : 8 + placed.width].astype(int)
    assert np.abs(gutter - smooth.pages[0][8, 8 : 8 + placed.width]).mean() < 20, "the edge goes on in the gutter"
    assert not (smooth.pages[0] == (255, 0, 255)).all(axis=2).any()


def test_a_chart_without_photos_takes_its_neighbours_colour() -> None:
    page, inside = np.zeros((64, 128, 3), np.uint8), np.zeros((64, 128), bool)
    charts = (chart(0, 4, 4, 20, 20), chart(0, 40, 4, 20, 20), chart(0, 80, 4, 20, 20, entity=2))
    known = inside.copy()
    for k, placed in enumerate(charts):
        inside[placed.box] = True
        if k != 1:
            known[placed.box], page[placed.box] = True, (200, 100, 40 * k)
    done = inpaint_atlas(Atlas((page,), (inside,), (known,), charts, 0.1, 3))
    assert (done.pages[0][charts[1].box] == (200, 100, 0)).all()


def test_super_resolution_beats_bicubic_and_keeps_the_charts_in_place() -> None:
    sharp = facade(96, 160)
    blurred = gaussian_filter(sharp.astype(float), (0.9, 0.9, 0))
    coarse = np.round(blurred.reshape(48, 2, 80, 2, 3).mean(axis=(1, 3))).astype(np.uint8)
    bicubic = np.asarray(Image.fromarray(coarse).resize((160, 96), Image.Resampling.BICUBIC))
    made = BackProjection()(coarse)
    assert psnr(made, sharp) > psnr(bicubic, sharp) + 0.5
    atlas = one_page(coarse, np.zeros(coarse.shape[:2], bool))
    fine = upscale_atlas(atlas)
    (old,), (new,) = atlas.charts, fine.charts
    assert (new.x, new.y, new.width, new.height) == (16, 16, 160, 96)
    np.testing.assert_allclose(new.right * new.width, old.right * old.width)
    assert fine.texel == 0.05
    assert fine.inside[0].shape == fine.pages[0].shape[:2] == (256, 512)
    inner = fine.pages[0][new.box][::-1][6:-6, 6:-6]
    assert psnr(inner, sharp[6:-6, 6:-6]) > psnr(bicubic[6:-6, 6:-6], sharp[6:-6, 6:-6]) + 0.5


def test_plug_ins_that_answer_wrongly_and_pages_too_large_are_refused() -> None:
    atlas = one_page(facade(), np.eye(96, 160, dtype=bool))

    class Shrinks:
        factor = 2

        def __call__(self, image: np.ndarray, *_: object, **__: object) -> np.ndarray:
            return image[1:]

    with pytest.raises(InputError, match="Shrinks"):
        inpaint_atlas(atlas, inpainter=Shrinks())
    with pytest.raises(InputError, match="Shrinks"):
        upscale_atlas(atlas, upscaler=Shrinks())
    with pytest.raises(InputError, match="powers of two"):
        upscale_atlas(atlas, upscaler=BackProjection(factor=3))
    with pytest.raises(InputError, match="pages of 128 at most"):
        upscale_atlas(atlas, upscaler=BackProjection(factor=64))


def test_walls_in_the_shade_of_the_day_become_as_bright_as_those_in_the_sun() -> None:
    page, inside = np.zeros((64, 512, 3), np.uint8), np.zeros((64, 512), bool)
    charts = []
    for k in range(16):
        angle = 2 * np.pi * k / 16
        normal = np.array([np.cos(angle), np.sin(angle), 0.0])
        placed = chart(0, 4 + 30 * k, 4, 20, 20, entity=k + 1)
        charts.append(Chart(**{**vars(placed), "normal": normal}))
        page[placed.box], inside[placed.box] = round(110 * np.exp(0.4 * normal[1])), True
    done = even_out_light(Atlas((page,), (inside,), (inside.copy(),), tuple(charts), 0.1, 16))
    before = [int(page[c.box].mean()) for c in charts]
    after = [int(done.pages[0][c.box].mean()) for c in charts]
    assert max(before) / min(before) > 2.1
    assert max(after) / min(after) < 1.35
    assert max(after) == pytest.approx(max(before), rel=0.15)
