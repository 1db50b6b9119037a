"""Pictures of a run in a city: every camera sees the tiles around it in full, and all others from afar.

Which tiles these are depends on where a camera is, and on nothing else: not on who else looks, nor on what is in
memory. Scenes are made when somebody first looks from there; those that were looked at longest ago go where there is
no room. `renderer_of` makes the renderer of a run, in a city or not.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.render import Cameras, Scene, render
from vico.render.materials import Palette
from vico.sim.cameras import Views
from vico.sim.pictures.buildings import ScenePart
from vico.sim.pictures.people import MovingBodies, RenderedSimulation
from vico.sim.pictures.scene import SceneRenderer
from vico.sim.state.simulation_state import SimulationState
from vico.world.city_world import CityWorld
from vico.world.silhouettes import CitySilhouettes

_GIGABYTE = 2**30
#: Metres around a camera that are drawn in full, at least.
NEAR = 200.0
#: Metres that are drawn in full beyond that for each metre of a camera's height above the houses.
PER_HEIGHT = 2.0
_HOUSES = 25.0  # m, height of houses
# Metres beyond that in which others are drawn: as far as cameras of agents see, or from above.
_SEEN, _SEEN_FROM_ABOVE = 600.0, 3000.0
# Rings of tiles around that are drawn in full at most: from high up, all is far.
_MOST_RINGS = 3


class Neighbourhood(NamedTuple):
    """Tiles that are drawn in full for a camera: a square around a corner of four.

    Attributes
    ----------
    column, row
        Of the tile south-west of the corner.
    rings
        Tiles from the corner to each side.
    """

    column: int
    row: int
    rings: int

    @classmethod
    def around(cls, x: float, y: float, above: float, size: float) -> Neighbourhood:
        """Return that of a camera.

        Parameters
        ----------
        x, y
            Where it is, ENU metres.
        above
            How high above the ground, metres.
        size
            Of a tile, metres.
        """
        least = math.ceil(NEAR / size + 0.5)
        # Who stands on a hill of a coarse height field, or on a roof terrace, is no higher than the houses.
        rings = math.ceil((NEAR + PER_HEIGHT * max(above - _HOUSES, 0.0)) / size + 0.5)
        return cls(math.floor(x / size), math.floor(y / size), min(rings, max(_MOST_RINGS, least)))

    def reach(self, size: float) -> int:
        """Return how many tiles beyond those in full are seen: from the ground those that cameras of agents reach."""
        is_low = self.rings == math.ceil(NEAR / size + 0.5)
        return math.ceil((_SEEN if is_low else _SEEN_FROM_ABOVE) / size)

    @property
    def tiles(self) -> list[tuple[int, int]]:
        """Columns and rows of the tiles, whether the city has them or not."""
        steps = range(1 - self.rings, 1 + self.rings)
        return [(self.column + east, self.row + north) for north in steps for east in steps]


class CityRenderer:
    """The `ObservationRenderer` of a run in a city of tiles.

    Parameters
    ----------
    sim
        The simulation to render; its world is the city.
    detail
        As of `SceneRenderer`.
    """

    def __init__(self, sim: RenderedSimulation, *, detail: Literal["light", "full"] = "light") -> None:
        assert isinstance(sim.world, CityWorld)
        self._sim, self._city, self._detail = sim, sim.world, detail
        self._palette = Palette()
        self._silhouettes = CitySilhouettes(sim.world.city)
        # Those looked at last come last.
        self._scenes: dict[Neighbourhood, SceneRenderer] = {}
        self._looked: dict[int, Neighbourhood] = {}
        self._glances: dict[Neighbourhood, dict[int, Any]] = {}

    def rebind(self, sim: RenderedSimulation) -> CityRenderer | SceneRenderer:
        """Return a renderer of another simulation, with the scenes of this one if its world is the same."""
        if not isinstance(sim.world, CityWorld):
            return SceneRenderer(sim, detail=self._detail)
        if sim.world is not self._city:
            return CityRenderer(sim, detail=self._detail)
        self._sim = sim
        self._scenes = {place: scene.rebind(sim) for place, scene in self._scenes.items()}
        self._looked, self._glances = {}, {}
        return self

    def neighbourhoods(self, eyes: NDArray[np.float64]) -> list[Neighbourhood]:
        """Return the neighbourhood of each of some points, ENU metres, shape ``(k, 3)``."""
        above = eyes[:, 2] - self._city.height(eyes[:, :2])
        size = self._city.city.manifest.size
        return [Neighbourhood.around(x, y, up, size) for (x, y), up in zip(eyes[:, :2].tolist(), above, strict=True)]

    def render(self, state: SimulationState, poses: NDArray[np.float64], own: NDArray[np.int32]) -> Views:
        """Begin to render one view for each pose; see `ObservationRenderer.render`."""
        parts: list[tuple[NDArray[np.int64], Views]] = []
        place, moving = self.neighbourhoods(poses[:, :3]), MovingBodies(state, self._city.height)
        for where in dict.fromkeys(place):
            members = np.array([k for k, one in enumerate(place) if one == where], np.int64)
            scene = self._scene(where)
            for entity in own[members].tolist():
                if self._looked.get(entity, where) != where:
                    scene.forget(entity)
                self._looked[entity] = where
            parts.append((members, scene.render(state, poses[members], own[members], moving=moving)))
        return _join_views(parts, len(poses))

    def show(self, state: SimulationState, eye: NDArray[np.float64]) -> Scene:
        """Put all that moves where it is in a state; return the scene around a point, ENU metres, shape ``(3,)``."""
        return self._scene(self.neighbourhoods(eye[None])[0]).show(state)

    def render_cameras(self, state: SimulationState, cameras: Cameras, *, samples: int = 2) -> NDArray[np.uint8]:
        """Render any cameras, RGB only; as `SceneRenderer.render_cameras`."""
        place = self.neighbourhoods(cameras.position)
        images: list[Any] = [None] * len(place)
        for where in dict.fromkeys(place):
            members = [k for k, one in enumerate(place) if one == where]
            scene = self._scene(where).show(state)
            found = render(scene, cameras.of(members), depth=False, segmentation=False, samples=samples).rgb
            for k, image in zip(members, found, strict=True):
                images[k] = image
        return np.stack(images)

    def wait(self) -> None:
        """Wait for pictures that are still being worked on."""
        for scene in self._scenes.values():
            scene.wait()

    def picture_waiter(self) -> Callable[[], None]:
        """Return what to call, from any thread, to wait for the pictures of the last `render`."""
        waiters = [scene.picture_waiter() for scene in self._scenes.values()]

        def wait() -> None:
            for one in waiters:
                one()

        return wait

    def names(self, entities: Sequence[int]) -> dict[int, dict[str, str]]:
        """Return kind and name of entities."""
        return {entity: self._sim.entity(entity) for entity in entities}

    def _scene(self, where: Neighbourhood) -> SceneRenderer:
        """Return the scene of a neighbourhood; another one goes where there is no room for it."""
        scene = self._scenes.pop(where, None)
        if scene is None:
            self._make_room()
            part = self._part(where)
            scene = SceneRenderer(self._sim, detail=self._detail, part=part)
            scene.remember(self._glances.pop(where, {}))
            part.world.forget()
            self._city.drop_pages()
            for other in self._scenes.values():
                other.scene.share_textures(scene.scene)
        self._scenes[where] = scene
        return scene

    def _make_room(self) -> None:
        """Let go of the scenes that were looked at longest ago until there is room for another."""
        sizes = {where: scene.nbytes for where, scene in self._scenes.items()}
        largest = max(sizes.values(), default=0)
        for where in sizes:
            if sum(sizes[one] for one in self._scenes) + largest <= self._sim.config.memory * _GIGABYTE:
                return
            gone = self._scenes.pop(where)
            gone.wait()
            # Where everything was for those who looked last from there: their flow is the same as if it had stayed.
            self._glances[where] = {k: glance for k, glance in gone.glances.items() if self._looked.get(k) == where}

    def _part(self, where: Neighbourhood) -> ScenePart:
        size = self._city.city.manifest.size
        tiles = set(where.tiles)
        low, high = (
            tuple((k + side * where.rings + 0.5) * size for k in (where.column, where.row)) for side in (-1, 1)
        )
        far = partial(self._silhouettes.beyond, tiles, where.reach(size))
        return ScenePart(self._city.part(tiles), (low[0], low[1]), (high[0], high[1]), far, self._palette)


def _join_views(parts: Sequence[tuple[NDArray[np.int64], Views]], count: int) -> Views:
    """Return the views of several scenes as one, in the order of their cameras."""
    place: dict[int, tuple[Views, int]] = {}
    for members, views in parts:
        place |= {k: (views, row) for row, k in enumerate(members.tolist())}
    order = [place[k] for k in range(count)]
    names = parts[0][1].pictures if parts else {}

    def wait_for(k: int) -> None:
        views, row = place[k]
        views.wait_for(row)

    return Views(
        {name: [views.pictures[name][row] for views, row in order] for name in names},
        np.array([views.extrinsics[row] for views, row in order]).reshape(-1, 4, 4),
        np.array([views.intrinsics[row] for views, row in order]).reshape(-1, 3, 3),
        wait_for,
    )


def renderer_of(sim: RenderedSimulation, *, detail: Literal["light", "full"] = "light") -> SceneRenderer | CityRenderer:
    """Return what makes pictures of a run; `detail` as of `SceneRenderer`."""
    is_city = isinstance(sim.world, CityWorld) and len(sim.world.city.manifest.tiles) > 1
    return CityRenderer(sim, detail=detail) if is_city else SceneRenderer(sim, detail=detail)
