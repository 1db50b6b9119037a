"""Cameras: the lens of each agent, the pictures of one step, and the semantic class of each entity."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError
from vico.render.cameras import Lens
from vico.render.viewers import USUAL_OUTPUTS, output_shape
from vico.sim.config import SimConfig
from vico.sim.state.simulation_state import SimulationState
from vico.world.world import World

#: What `semantic` pictures tell apart; a pixel's value is the place in this list.
CLASSES = (
    "nothing",
    "unknown",
    "ground",
    "road",
    "water",
    "green",
    "building",
    "room",
    "person",
    "robot",
    "car",
    "bus",
    "bicycle",
    "rail_vehicle",
    "tree",
    "pole",
    "sign",
    "street_furniture",
    "furniture",
    "object",
)
_NUMBER = {name: k for k, name in enumerate(CLASSES)}
_OF_KIND = {
    **{name: name for name in CLASSES},
    **dict.fromkeys(("resident", "assistant", "pedestrian"), "person"),
    **dict.fromkeys(("tram", "train"), "rail_vehicle"),
    **dict.fromkeys(("truck", "van", "taxi"), "car"),
    **dict.fromkeys(("hedge", "shrub", "plant"), "tree"),
    **dict.fromkeys(("street_lamp", "bollard", "flagpole", "mast", "utility_pole", "pillar", "column"), "pole"),
    "umbrella": "object",
    "backdrop": "unknown",
    "wire": "pole",
    **dict.fromkeys(("traffic_signals", "sign", "bus_stop", "board"), "sign"),
}


@dataclass(frozen=True)
class Views:
    """Pictures of one step, in the order of the cameras asked for.

    Attributes
    ----------
    pictures
        By output (docs/pictures.md), one array a view: ``rgb``, sRGB, uint8, shape ``(h, w, 3)``; ``depth``, metres, 0
        where nothing is hit, float32, shape ``(h, w)``; ``segmentation``, entity ids, 0 where nothing is hit, int32;
        and what else was asked for.
    extrinsics
        World (ENU metres) to camera (x right, y down, z forward), float64, shape ``(k, 4, 4)``.
    intrinsics
        Of each view's lens, pixels, float64, shape ``(k, 3, 3)``.
    wait_for
        Returns when the pictures of camera ``k`` are there; they may be worked on until then.
    """

    pictures: Mapping[str, Sequence[NDArray[Any]]]
    extrinsics: NDArray[np.float64]
    intrinsics: NDArray[np.float64]
    wait_for: Callable[[int], None] = lambda k: None


class SemanticClasses:
    """Classes of what segmentation images show, by entity.

    Parameters
    ----------
    world
        Where it happens.
    entity
        Returns kind and name of what is not the world's, by entity.
    """

    def __init__(self, world: World, entity: Callable[[int], dict[str, str]]) -> None:
        self._world, self._entity = world, entity
        self._indoor: set[int] | None = None
        self._known: dict[int, int] = {0: 0}

    def of_image(self, segmentation: NDArray[np.int32]) -> NDArray[np.uint8]:
        """Return the class of every pixel, places in `CLASSES`, uint8, of the same shape."""
        entities, place = np.unique(segmentation, return_inverse=True)
        classes = np.array([self.of_entity(entity) for entity in entities.tolist()], np.uint8)
        return np.asarray(classes[place].reshape(segmentation.shape))

    def of_entity(self, entity: int) -> int:
        """Return the class of an entity."""
        if (known := self._known.get(entity)) is not None:
            return known
        found = self._world.entities.get(entity)
        if found is None:
            # What belongs to a run may become something else.
            return _NUMBER[_OF_KIND.get(self._entity(entity)["kind"], "street_furniture")]
        other = "furniture" if entity in self._indoors() else "street_furniture"
        self._known[entity] = _NUMBER[_OF_KIND.get(found["kind"], other)]
        return self._known[entity]

    def _indoors(self) -> set[int]:
        """Return the entities of what stands in rooms."""
        if self._indoor is None:
            objects = self._world.objects
            inside = np.array([bool(room) for room in objects.room], np.bool_)
            self._indoor = set(objects.entity[inside].tolist())
        return self._indoor


def lenses_of(state: SimulationState, config: SimConfig) -> dict[str, Lens]:
    """Return the lens of each agent, by name.

    Raises
    ------
    InputError
        If a camera is set for somebody who is not there.
    """
    models = [robot.partition(":")[0] for robot in config.robots]
    people = len(state.people)
    residents = people - config.assistants
    known = {"residents", "assistants", "robots", *models, *state.names}
    for name in config.cameras:
        if name not in known:
            raise InputError(f"cameras: nobody is called {name!r}; there are {', '.join(sorted(known))}")
    found: dict[str, Lens] = {}
    for i, name in enumerate(state.names):
        kinds = ["residents" if i < residents else "assistants"] if i < people else [models[i - people], "robots"]
        record: Any = next((config.cameras[key] for key in (name, *kinds) if key in config.cameras), {})
        found[name] = Lens.of(record, side=config.image)
    return found


def lenses_by_entity(state: SimulationState, config: SimConfig) -> dict[int, Lens]:
    """Return the lens of each agent that has another one than usual, by the entity of its body."""
    if not config.cameras:
        return {}
    entities = state.people.entity.tolist()
    if state.robots is not None:
        entities += state.robots.bodies().entity.tolist()
    return dict(zip(entities, lenses_of(state, config).values(), strict=True))


__all__ = [
    "CLASSES",
    "USUAL_OUTPUTS",
    "Lens",
    "SemanticClasses",
    "Views",
    "lenses_by_entity",
    "lenses_of",
    "output_shape",
]
