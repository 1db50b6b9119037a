"""Things people carry: as large as the catalogue says, standing on the ground, and told apart by colour."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from vico.assets.models.movable import movable_colours, movable_kinds, movable_prototype, movable_surfaces
from vico.errors import InputError


def points(kind: str, colour: str = "red") -> NDArray[np.float32]:
    return np.concatenate([surface.positions for surface in movable_surfaces(kind, colour)])


@pytest.mark.parametrize("kind", sorted(movable_kinds()))
def test_a_thing_is_as_large_as_the_catalogue_says(kind: str) -> None:
    extent = np.ptp(points(kind), axis=0)
    np.testing.assert_allclose(extent, movable_kinds()[kind].size, atol=0.02)


@pytest.mark.parametrize("kind", sorted(movable_kinds()))
def test_a_thing_stands_on_the_ground_around_its_origin(kind: str) -> None:
    low, high = points(kind).min(axis=0), points(kind).max(axis=0)
    assert abs(low[2]) < 0.005
    # The origin is below it, near enough to the middle for it to be put down where it was meant to be.
    assert np.all(np.abs((low + high)[:2] / 2) < 0.08)


@pytest.mark.parametrize("kind", sorted(movable_kinds()))
def test_every_colour_makes_another_model(kind: str) -> None:
    looks = {
        np.concatenate([s.colour for s in movable_surfaces(kind, colour)]).tobytes() for colour in movable_colours()
    }
    assert len(looks) == len(movable_colours())


def test_colours_are_far_enough_apart_to_be_told_apart() -> None:
    values = np.array(list(movable_colours().values()), np.float64)
    apart = np.linalg.norm(values[:, None] - values[None], axis=2)[np.triu_indices(len(values), 1)]
    assert apart.min() > 60


@pytest.mark.parametrize("kind", sorted(movable_kinds()))
def test_its_colour_covers_a_good_part_of_a_thing(kind: str) -> None:
    red, blue = (
        [np.repeat(s.colour[s.triangles].mean(axis=1), 1, axis=0) for s in movable_surfaces(kind, colour)]
        for colour in ("red", "blue")
    )
    areas = [
        np.linalg.norm(
            np.cross(
                s.positions[s.triangles[:, 1]] - s.positions[s.triangles[:, 0]],
                s.positions[s.triangles[:, 2]] - s.positions[s.triangles[:, 0]],
            ),
            axis=1,
        )
        for s in movable_surfaces(kind, "red")
    ]
    differs = [np.abs(a - b).sum(axis=1) > 30 for a, b in zip(red, blue, strict=True)]
    share = sum(float(a[d].sum()) for a, d in zip(areas, differs, strict=True)) / sum(float(a.sum()) for a in areas)
    assert share > 0.15


def test_triangles_point_outwards() -> None:
    for kind in movable_kinds():
        for surface in movable_surfaces(kind, "green"):
            faces = surface.positions[surface.triangles].astype(np.float64)
            across = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
            stored = surface.normals[surface.triangles].mean(axis=1)
            assert float(((across * stored).sum(axis=1) < -1e-9).mean()) == 0.0, kind


def test_names_and_sentences_carry_the_colour() -> None:
    assert movable_prototype("helmet", "blue") == "good/helmet/blue"
    assert movable_kinds()["backpack"].described("orange") == "an orange backpack"
    assert movable_kinds()["parcel"].described("orange") == "a parcel with orange tape"
    assert len({good.described("red") for good in movable_kinds().values()}) == len(movable_kinds())


def test_what_is_not_in_the_catalogue_is_refused() -> None:
    with pytest.raises(InputError, match="no thing called 'piano'"):
        movable_surfaces("piano", "red")
    with pytest.raises(InputError, match="no colour called 'mauve'"):
        movable_surfaces("helmet", "mauve")
