"""What makes a run's pictures: one scene of a world, or scenes around the cameras in a city of many tiles."""

from __future__ import annotations

from typing import Literal

from vico.sim.city_scene import CityRenderer
from vico.sim.scene import RenderedSimulation, SceneRenderer
from vico.world.city_world import CityWorld


def renderer_of(sim: RenderedSimulation, *, detail: Literal["light", "full"] = "light") -> SceneRenderer | CityRenderer:
    """Return what makes pictures of a run; `detail` as of `SceneRenderer`."""
    is_city = isinstance(sim.world, CityWorld) and len(sim.world.city.manifest.tiles) > 1
    return CityRenderer(sim, detail=detail) if is_city else SceneRenderer(sim, detail=detail)
