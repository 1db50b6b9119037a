"""What agents are told after each step: their own state, what they heard, and what they see."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.sim.lazy import ByAgent, Observations
from vico.sim.moves import eye_height
from vico.sim.simulation_state import SimulationState
from vico.sim.told import Told

Observation = dict[str, Any]


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


class ObservationRenderer(Protocol):
    """Renders what agents see; a simulation makes the usual one itself."""

    def render(self, state: SimulationState, poses: NDArray[np.float64], own: NDArray[np.int32]) -> Views:
        """Render one view for each pose in one call.

        Parameters
        ----------
        state
            The state to render.
        poses
            Optical centres (ENU metres) and unit vectors along the optical axes, float64, shape ``(k, 6)``.
        own
            Entity of the body that each view leaves out (the viewer's own), int32, shape ``(k,)``.
        """

    def names(self, entities: Sequence[int]) -> dict[int, dict[str, str]]:
        """Return kind and name of entities that can be seen."""

    def picture_waiter(self) -> Callable[[], None]:
        """Return what to call, from any thread, to wait for the pictures of the last `render`."""

    def rebind(self, sim: Any) -> ObservationRenderer:
        """Return a renderer of another simulation that keeps as much of the scene as it can."""


def poses(state: SimulationState) -> NDArray[np.float64]:
    """Return every agent's x, y, z (ENU metres) and the unit vector it looks along, float64, shape ``(n, 6)``.

    x, y, z is where the agent stands (feet); the camera is `camera_height` above.
    """
    p = state.people
    facing = np.column_stack([np.cos(p.yaw) * np.cos(p.pitch), np.sin(p.yaw) * np.cos(p.pitch), np.sin(p.pitch)])
    mine = np.column_stack([p.position, facing])
    if state.robots is None:
        return mine
    robots = state.robots.bodies()
    ahead = np.column_stack([np.cos(robots.yaw), np.sin(robots.yaw), np.zeros(len(robots))])
    return np.vstack([mine, np.column_stack([robots.position, ahead])])


def camera_heights(state: SimulationState) -> NDArray[np.float64]:
    """Return the height of every agent's camera above its position, metres."""
    mine = eye_height(state)
    return mine if state.robots is None else np.concatenate([mine, state.robots.camera_heights()])


def observe(
    state: SimulationState,
    seeing: Sequence[int],
    renderer: ObservationRenderer | None,
    *,
    who: Sequence[int] | None = None,
    waits: bool = True,
) -> tuple[Observations, ByAgent]:
    """Return observations and infos of all agents; those in `seeing` get pictures, rendered in one call.

    Parameters
    ----------
    who
        Indices of the agents that observe; None for all. Those in `seeing` are among them.
    waits
        Whether an observation that is asked for waits for its pictures; else see `ObservationRenderer.picture_waiter`.

    Returns
    -------
    tuple
        Observation by name (the outputs asked for, ``extrinsics`` and ``intrinsics`` only for those who see;
        ``sensors`` for robots; ``pose``, ``events``, ``state`` for everybody), and info by name: ``entities``, kind
        and name of what segmentation shows, by entity; ``action_code``; ``weather`` outdoors
        (`vico.sim.environment`); ``signals`` within 60 m outdoors, where a run obeys them
        (`vico.sim.traffic.signals.SignalsShown`); ``events`` of the city that it knows of, where a run has any
        (`vico.sim.city`); for residents ``in_view``, what is in view by sight lines (`vico.sim.perception.InView`), the
        same with and without pictures, and ``rest``, the nearest free seat (``sit``) and bed (``lie``) of the place, or
        None: its ``entity``, where to ``stand`` before it, and the ``door`` (a room's id) to go through where it is in
        another room. Each is made when it is first asked for, of the state as it is now, and waits for its pictures;
        those of ``without_pictures`` have and await none.
    """
    names = state.names
    chosen = range(len(names)) if who is None else who
    told = Told(_kept(state), poses(state), chosen)
    seen = None
    if renderer is not None and len(seeing):
        seen = _Pictures(_rendered(state, seeing, told.poses, renderer), renderer, [names[i] for i in seeing])
    asked = [names[i] for i in chosen]

    def pictures(name: str) -> Observation:
        return seen.of(name, waits=waits) if seen is not None else {}

    def entities(name: str) -> dict[str, Any]:
        return {"entities": seen.entities(name) if seen is not None else {}}

    return Observations(asked, told.observation, pictures, told.crowd()), ByAgent(asked, told.info, entities)


class _Pictures:
    """What some agents see, by their names in the order of the views."""

    def __init__(self, views: Views, renderer: ObservationRenderer, names: Sequence[str]) -> None:
        self._views, self._renderer = views, renderer
        self._place = {name: k for k, name in enumerate(names)}

    def of(self, name: str, *, waits: bool) -> Observation:
        """Return an agent's pictures; nothing where it has none."""
        if (k := self._place.get(name)) is None:
            return {}
        views = self._views
        if waits:
            views.wait_for(k)
        pictures = {name: arrays[k] for name, arrays in views.pictures.items()}
        return pictures | {"extrinsics": views.extrinsics[k], "intrinsics": views.intrinsics[k]}

    def entities(self, name: str) -> dict[int, dict[str, str]]:
        """Return kind and name of what an agent's pictures show, by entity; nothing without segmentation."""
        images = self._views.pictures.get("segmentation")
        if (k := self._place.get(name)) is None or images is None:
            return {}
        self._views.wait_for(k)
        return self._renderer.names(distinct_entities(images[k]))


def _rendered(
    state: SimulationState, seeing: Sequence[int], stances: NDArray[np.float64], renderer: ObservationRenderer
) -> Views:
    """Return views of some agents."""
    order = list(seeing)
    cameras = stances.copy()
    cameras[:, 2] += camera_heights(state)
    if state.robots is not None:
        cameras[len(state.people) :] = state.robots.cameras()
    cameras = cameras[order]
    own = state.people.entity
    if state.robots is not None:
        own = np.concatenate([own, state.robots.bodies().entity])
    return renderer.render(state, cameras, np.asarray(own[order], np.int32))


def _kept(state: SimulationState) -> SimulationState:
    """Return a state whose people, robots' outcomes and time stay what they are now."""
    kept = copy(state)
    kept.people = copy(state.people)
    for name, array in state.people.arrays().items():
        setattr(kept.people, name, array.copy())
    return kept


def distinct_entities(image: NDArray[np.int32]) -> list[int]:
    """Return the entities that a picture shows, ascending."""
    flat, width = np.ravel(image), image.shape[1]
    # Beneath the first row, an entity's first pixel is unlike the one before it and the one above; few others are.
    first, below = flat[:width], flat[width:]
    marks = np.empty(len(below), np.bool_)
    _mark_corners(below, flat[width - 1 : -1], flat[: len(below)], marks)
    found = np.concatenate([first, below[np.flatnonzero(marks)]])
    return [int(value) for value in np.unique(found) if value > 0]


@compiled(nogil=True)
def _mark_corners(here, left, above, marks):  # type: ignore[no-untyped-def]
    for i in range(len(marks)):
        marks[i] = (here[i] != left[i]) & (here[i] != above[i])


def facing_of(yaw: float, pitch: float) -> tuple[float, float, float]:
    """Return the unit vector of a gaze, ENU; radians."""
    return math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), math.sin(pitch)
