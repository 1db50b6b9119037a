"""What stands for things in physics is where they are seen: no air stops fingers, and nothing lets them through."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError

from vico.assets.models.movable import (
    Solid,
    kinds_for,
    movable_kinds,
    movable_mass,
    movable_prototype,
    movable_solids,
    movable_surfaces,
)
from vico.assets.models.schema import MovableEntry
from vico.challenges.pick_place.tasks import fitting_kinds

WITH_SOLIDS = sorted(kind for kind in movable_kinds() if movable_solids(movable_prototype(kind, "red")))


def outside(solid: Solid, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far points are outside of a solid, metres; 0 inside."""
    local = (points - solid.middle) @ solid.rotation
    if solid.shape == "ball":
        return np.maximum(np.linalg.norm(local, axis=1) - solid.half[0], 0.0)
    if solid.shape == "box":
        return np.linalg.norm(np.maximum(np.abs(local) - solid.half, 0.0), axis=1)
    level = np.maximum(np.hypot(local[:, 0], local[:, 1]) - solid.half[0], 0.0)
    return np.hypot(level, np.maximum(np.abs(local[:, 2]) - solid.half[2], 0.0))


def surface_points(solid: Solid) -> NDArray[np.float64]:
    stream = np.random.default_rng(4)
    local = stream.uniform(-1.0, 1.0, (400, 3))
    local[np.arange(400), stream.integers(0, 3, 400)] = stream.choice([-1.0, 1.0], 400)
    if solid.shape != "box":
        length = np.maximum(np.hypot(local[:, 0], local[:, 1]), 1.0) if solid.shape == "cylinder" else None
        local = local / np.linalg.norm(local, axis=1)[:, None] if length is None else local
        if length is not None:
            local[:, :2] /= length[:, None]
    found: NDArray[np.float64] = local * solid.half @ solid.rotation.T + solid.middle
    return found


def seen(kind: str) -> NDArray[np.float64]:
    """Return points all over what is seen of a thing, metres."""
    stream = np.random.default_rng(5)
    found = []
    for surface in movable_surfaces(kind, "red"):
        corners = surface.positions[surface.triangles].astype(np.float64)
        share = stream.dirichlet(np.ones(3), (len(corners), 12))
        found.append(np.einsum("tsk,tkc->tsc", share, corners).reshape(-1, 3))
    return np.concatenate(found)


def test_all_that_fits_a_jaw_has_solids_of_its_own() -> None:
    assert set(fitting_kinds()) <= set(WITH_SOLIDS)
    assert len(fitting_kinds()) >= 12


@pytest.mark.parametrize("kind", WITH_SOLIDS)
def test_what_is_seen_is_solid(kind: str) -> None:
    points = seen(kind)
    away = np.min([outside(solid, points) for solid in movable_solids(movable_prototype(kind, "red"))], axis=0)
    assert float(np.quantile(away, 0.97)) < 0.012
    assert float(away.max()) < 0.035


@pytest.mark.parametrize("kind", WITH_SOLIDS)
def test_what_is_solid_is_seen(kind: str) -> None:
    points = seen(kind)
    low, high = points.min(axis=0) - 0.006, points.max(axis=0) + 0.006
    for solid in movable_solids(movable_prototype(kind, "red")):
        face = surface_points(solid)
        assert ((face >= low) & (face <= high)).all(), solid
        # Most of it lies close under what is seen.
        away = np.min(np.linalg.norm(face[:, None] - points[None], axis=2), axis=1)
        assert float(np.median(away)) < 0.03, solid


@pytest.mark.parametrize("kind", WITH_SOLIDS)
def test_things_stand_on_their_solids(kind: str) -> None:
    low = min(float(surface_points(solid)[:, 2].min()) for solid in movable_solids(movable_prototype(kind, "red")))
    assert low == pytest.approx(0.0, abs=0.004)


def test_things_weigh_what_they_would() -> None:
    assert movable_mass(movable_prototype("water bottle", "red")) == pytest.approx(1.55)
    assert movable_mass(movable_prototype("backpack", "red")) is None
    assert movable_mass("parcel") is None
    assert movable_solids("parcel") == []


def test_small_things_are_for_robots_alone() -> None:
    assert "water bottle" in kinds_for("robot")
    assert "water bottle" not in kinds_for("assistant")
    assert set(kinds_for("assistant")) < set(kinds_for("robot")) == set(movable_kinds())


def test_a_solid_that_is_not_understood_is_refused() -> None:
    entry = {"sentence": "a {colour} thing", "size": [0.1, 0.1, 0.1]}
    parts = [{"shape": "box", "size": [0.1, 0.1, 0.1], "colour": "paint"}]
    with pytest.raises(ValidationError, match="cone"):
        MovableEntry.model_validate(entry | {"parts": parts, "solid": [{"shape": "cone", "radius": 0.1}]})
    with pytest.raises(ValidationError, match="tasks"):
        MovableEntry.model_validate(entry | {"parts": parts, "tasks": ["cooking"]})
