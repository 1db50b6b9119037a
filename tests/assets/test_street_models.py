"""Models of what stands outdoors: life size, whole, light."""

import numpy as np
import pytest

from vico.assets.models.library import street_models
from vico.world.objects import FEET, GROUPS

# Heights in metres between which such things are in real streets.
LIFE_SIZE = {
    "bench": (0.7, 1.1), "waste_basket": (0.8, 1.3), "post_box_pillar": (1.4, 1.8), "telephone": (2.2, 2.7),
    "fire_hydrant": (0.6, 1.0), "street_lamp": (5.0, 9.0), "kiosk": (2.4, 3.2), "shelter": (2.2, 2.8),
    "traffic_signals": (3.0, 4.0), "sign_stop": (2.2, 3.0), "bicycle_parking": (0.75, 1.1), "statue": (2.8, 5.0),
    "market_stall": (2.2, 3.0), "swing": (2.0, 2.6), "fence": (0.9, 1.3), "wall_high": (1.8, 2.3),
    "hedge_low": (0.5, 0.9), "tree_oak": (10.0, 20.0), "tree_poplar": (14.0, 25.0), "tree_fruit": (3.5, 6.0),
    "power_tower": (18.0, 30.0), "bollard": (0.7, 1.1), "tent": (2.8, 3.6), "cafe_parasol": (2.3, 3.0),
}  # fmt: skip


@pytest.mark.parametrize(("name", "limits"), LIFE_SIZE.items())
def test_a_model_is_life_size(name: str, limits: tuple[float, float]) -> None:
    assert limits[0] <= street_models()[name].size[2] <= limits[1]


def test_all_models_are_light_and_whole() -> None:
    for name, thing in street_models().items():
        assert 20 <= thing.triangles <= 400, name
        assert thing.group in GROUPS, name
        assert len(thing.surfaces) <= 3, name
        for surface in thing.surfaces:
            corners = surface.positions[surface.triangles].astype(np.float64)
            area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
            # A tube may end in a point; nothing else has no area.
            assert (area > 1e-9).mean() > 0.8, name
            np.testing.assert_allclose(np.linalg.norm(surface.normals, axis=1), 1.0, atol=1e-3, err_msg=name)


def test_barriers_reach_into_the_ground_and_meet_end_to_end() -> None:
    for name in ("fence", "fence_wood", "wall", "wall_brick", "guard_rail", "chain", "hedge"):
        low, high = street_models()[name].bounds
        assert low[2] < -0.3, name
        assert low[0] <= -0.99, name
        assert high[0] >= 0.99, name


def test_feet_are_never_wider_than_what_stands_on_them() -> None:
    for thing in street_models().values():
        if thing.kind in FEET and thing.kind != "tree":
            assert FEET[thing.kind] <= max(thing.size[:2]) + 0.06, thing.name
