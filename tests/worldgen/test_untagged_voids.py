"""What a build says of voids that its elevation files do not tag."""

import numpy as np

from vico.geo.elevation import HeightSamples
from vico.worldgen.evidence import _void_notes


def samples(**patches: tuple[tuple[str, float, float, float, int, float], ...]) -> HeightSamples:
    return HeightSamples(np.zeros((4, 3)), 10.0, "a.tif", "0", **patches)


def test_a_void_is_told_with_its_place_size_step_and_how_to_tag_it() -> None:
    told = _void_notes(samples(voids=(("a.tif", 46.5, 8.0, 0.0, 1240, 610.4),)))
    assert told == [
        (
            "a.tif",
            "1,240 pixels of exactly 0 m around 46.50000, 8.00000 lie 610 m below the ground on nearly all sides; no "
            "ground does: left out as void and filled in; to say so in the file: gdal_edit.py -a_nodata 0 a.tif",
        )
    ]


def test_a_patch_that_may_be_a_sea_is_said_to_be_kept() -> None:
    [(_, said)] = _void_notes(samples(doubtful=(("a.tif", 46.5, 8.0, 0.0, 1240, 80.0),)))
    assert "lie 80 m below the ground on nearly all sides; so does a sea below cliffs" in said
    assert "kept" in said


def test_many_patches_are_told_in_one_line_more() -> None:
    told = _void_notes(samples(voids=tuple(("a.tif", 46.5, 8.0, 0.0, 10, 600.0) for _ in range(40))))
    assert told[-1][1].endswith("more such patches, " + f"{10 * (40 - len(told) + 1)} pixels")
