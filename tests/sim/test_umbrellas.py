"""Umbrellas lean away from each other, no more than they have to."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import toy_city
from vico.assets.models.library import in_hand_models
from vico.sim.animation import Hold
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.pictures.hands import draw_umbrellas, lean_apart
from vico.sim.pictures.scene import SceneRenderer


def _both(distance: float) -> NDArray[np.float64]:
    canopies = np.array([[10.0, 0.0, 1.8], [10.0 + distance, 0.0, 1.9]])
    return lean_apart(canopies, np.array([0.53, 0.45]), np.array([0.64, 0.55]))


def test_lean_grows_evenly_as_two_come_near_and_nobody_leans_alone() -> None:
    assert not lean_apart(np.zeros((1, 3)), np.ones(1), np.ones(1)).any()
    assert not _both(1.1).any()
    leans = np.array([_both(d) for d in np.linspace(1.1, 0.5, 61)])
    assert not leans[..., 1].any()
    assert (leans[:, 0, 0] <= 0).all()
    assert (leans[:, 1, 0] >= 0).all()
    steps = np.diff(np.abs(leans[..., 0]), axis=0)
    assert steps.min() > -1e-9
    assert steps.max() < 0.03
    assert np.abs(leans).max() <= 0.6 + 1e-9


@pytest.mark.parametrize("distance", [0.65, 0.8, 1.0])
def test_umbrellas_of_two_side_by_side_do_not_pass_through_each_other(distance: float) -> None:
    sim = Simulation(toy_city.world(), None, SimConfig(assistants=2, observe=(), start=43200, weather="rain"))
    for k in range(2):
        sim.scenario.place_agent(f"assistant_{k}", (-20.0 + distance * k, -15.0))
    people = sim.state.people
    people.hold[:], people.hold_share[:], people.yaw[:] = Hold.UMBRELLA_RIGHT, 1.0, (0.4, 2.0)
    drawn = draw_umbrellas(SceneRenderer(sim).holders(sim.state), 2)
    assert drawn is not None
    model = in_hand_models()["umbrella"]
    points = np.concatenate([surface.positions for surface in model.surfaces])
    canopy = np.column_stack([points[points[:, 2] > 0.55], np.ones(int((points[:, 2] > 0.55).sum()))])
    left, right = (canopy @ np.asarray(matrix, float).T for matrix in drawn.transforms)
    assert left[:, 0].max() < right[:, 0].min() + 0.02
