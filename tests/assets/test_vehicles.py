"""Vehicle models: sizes, budgets, and that they are what they claim to be."""

import numpy as np
import pytest

from vico.assets.transit_vehicles import BUS_DOORS, bus_door_leaves, tram_prototypes
from vico.assets.vehicles import night_lamps, vehicle_prototypes, vehicle_size

NAMES = sorted(vehicle_prototypes())


@pytest.mark.parametrize("name", NAMES)
def test_a_model_fits_the_size_traffic_uses(name: str) -> None:
    positions = np.concatenate([s.positions for s in vehicle_prototypes()[name]])
    low, high = positions.min(0), positions.max(0)
    length, width, height, _, _ = vehicle_size(name)
    # Bumpers and mirrors stick out by centimetres.
    assert np.allclose(high[0] - low[0], length, atol=0.12)
    assert -0.05 <= high[1] - low[1] - width < 0.25
    assert abs(high[2] - height) < 0.16
    assert abs(low[2]) < 0.03


@pytest.mark.parametrize("name", NAMES)
def test_a_model_has_300_to_2000_triangles(name: str) -> None:
    assert 300 <= sum(len(s.triangles) for s in vehicle_prototypes()[name]) <= (2000 if name == "bus" else 1200)


@pytest.mark.parametrize("name", NAMES)
def test_faces_look_outward(name: str) -> None:
    """Normals agree with the triangles' winding."""
    for surface in vehicle_prototypes()[name]:
        corners = surface.positions[surface.triangles].astype(np.float64)
        winding = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        agree = (winding * surface.normals[surface.triangles[:, 0]]).sum(1)
        assert (agree >= -1e-9).all()


def test_doors_of_the_bus_are_on_its_right() -> None:
    """Two leaves a door fill what its side leaves open there."""
    leaves, width = bus_door_leaves()
    assert len(leaves) == 2 * len(BUS_DOORS)
    assert all(y < 0 for _, y, _ in leaves)
    (bus,) = vehicle_prototypes()["bus"]
    corners = bus.positions[bus.triangles]
    flat = np.abs(np.ptp(corners[:, :, 1], axis=1)) < 1e-6
    walls = corners[flat & (np.abs(corners[:, 0, 1]) > 1.2) & (np.ptp(corners[:, :, 2], axis=1) > 0.4)]
    for x, _, _ in leaves:
        over = (walls[:, :, 0].min(axis=1) < x - width / 4) & (walls[:, :, 0].max(axis=1) > x + width / 4)
        low = walls[over & (walls[:, :, 2].max(axis=1) < 1.5)]
        assert (low[:, 0, 1] > 0).all()


def test_cars_come_in_many_kinds_and_colours() -> None:
    kinds = {name.split("_")[0] for name in NAMES}
    assert kinds >= {"hatchback", "sedan", "suv", "van", "taxi", "bus", "bicycle"}
    assert len(NAMES) >= 15


def test_buses_and_trams_are_lit_inside_at_night() -> None:
    lights = [night_lamps("bus"), tram_prototypes()["tram_middle"][1]]
    for surface, top in zip(lights, (2.6, 2.7), strict=True):
        assert surface.material.emission == 1.0
        down = surface.normals[:, 2] < -0.99
        assert surface.positions[down, 2].max() == pytest.approx(top, abs=0.01)
