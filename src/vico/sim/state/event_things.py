"""Things that stand in the city while an event goes on: bodies like all others, set up where there is room for them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.models.library import street_models
from vico.assets.vehicles import vehicle_prototypes, vehicle_size
from vico.errors import InputError
from vico.sim.bodies.arrays import CAR, FIXTURE, Bodies, Drawn
from vico.sim.bodies.footprints import Rectangle, gaps, records_of
from vico.sim.bodies.state_arrays import FIRST_THING
from vico.sim.environment import Occurrence
from vico.sim.environment.event_sites import spots_of
from vico.sim.state.base import SimulationBase
from vico.world.mesh import Surface

if TYPE_CHECKING:
    from vico.sim.environment.agenda import Agenda
    from vico.sim.traffic import Traffic

#: Entities of an event's things: so many numbers for each event.
THINGS_EACH = 100
# Things are set up where this much is free around them, metres.
_ROOM = 0.5


class EventThings:
    """Things that stand because of events; part of the state."""

    def __init__(self) -> None:
        # Entities of those that stand, ascending, and what each is.
        self._standing: dict[int, _Thing] = {}
        self._bodies = Bodies.none()

    def __len__(self) -> int:
        return len(self._standing)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return which things stand and where; nothing as long as there are none."""
        if not self._standing:
            return {}
        things = self._standing.values()
        return {
            "entity": np.array(list(self._standing), np.int32),
            "pose": np.array([thing.pose for thing in things], np.float64),
            "model": np.array([thing.model for thing in things], "U48"),
        }

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held."""
        self._standing = {}
        if "entity" in arrays:
            rows = zip(arrays["entity"].tolist(), arrays["pose"].tolist(), arrays["model"].tolist(), strict=True)
            self._standing = {entity: _Thing(model, tuple(pose)) for entity, pose, model in rows}
        self._bodies = self._join_bodies()

    def bodies(self) -> Bodies:
        """Return everything that stands."""
        return self._bodies

    def of_event(self, number: int) -> Bodies:
        """Return what stands for one event."""
        return self._bodies.where((self._bodies.entity - FIRST_THING) // THINGS_EACH == number)

    def draw(self) -> Drawn:
        """Return what to draw."""
        things = list(self._standing.values())
        names = sorted({thing.model for thing in things})
        transforms = np.zeros((len(things), 4, 4), np.float32)
        for k, thing in enumerate(things):
            x, y, z, yaw = thing.pose
            c, s = math.cos(yaw), math.sin(yaw)
            transforms[k] = np.array([[c, -s, 0.0, x], [s, c, 0.0, y], [0.0, 0.0, 1.0, z], [0.0, 0.0, 0.0, 1.0]])
        index = np.array([names.index(thing.model) for thing in things], np.int32)
        return Drawn(names, index, transforms, np.array(list(self._standing), np.int32))

    def prototypes(self) -> dict[str, list[Surface]]:
        """Return the shapes that `draw` refers to."""
        return {name: shape_of(name)[0] for name in sorted({thing.model for thing in self._standing.values()})}

    def entity(self, entity: int) -> dict[str, str] | None:
        """Return kind and name of a thing; None if none has this number."""
        thing = self._standing.get(entity)
        kind = "" if thing is None else "car" if _is_vehicle(thing.model) else "fixture"
        return None if thing is None else {"kind": kind, "name": thing.model.replace("_", " ")}

    def follow(
        self, base: SimulationBase, agenda: Agenda, traffic: Traffic | None, obstacles: Callable[[], Bodies]
    ) -> None:
        """Clear away what stands for events that are over, and set up what is missing where there is room by now.

        Parameters
        ----------
        obstacles
            Returns every body outdoors that somebody on the ground could touch.
        """
        going_on = {one.id: one for one in agenda.going_on}
        kept = {e: thing for e, thing in self._standing.items() if (e - FIRST_THING) // THINGS_EACH in going_on}
        if len(kept) != len(self._standing):
            self._stand(kept)
        for one in going_on.values():
            # At once, so that the next event's things keep clear of them.
            if more := self._missing(one, base, agenda, traffic, obstacles):
                self._stand(self._standing | more)

    def _stand(self, things: dict[int, _Thing]) -> None:
        """Have these things stand, and no others."""
        self._standing = dict(sorted(things.items()))
        self._bodies = self._join_bodies()

    def _missing(
        self,
        one: Occurrence,
        base: SimulationBase,
        agenda: Agenda,
        traffic: Traffic | None,
        obstacles: Callable[[], Bodies],
    ) -> dict[int, _Thing]:
        """Return what is missing of an event's things and can be set up now, by entity."""
        first = FIRST_THING + THINGS_EACH * one.id
        known = base.event_spots
        if one.event not in known:
            known[one.event] = spots_of(one, base.event_sites)[:THINGS_EACH]
        spots = known[one.event]
        missing = [k for k in range(len(spots)) if first + k not in self._standing]
        if not missing:
            return {}
        closed = agenda.effects.lanes
        # As long as a car has to drive out of the street, nothing is put in its way.
        if one.kind.lanes and traffic is not None and closed is not None and traffic.is_taken(closed):
            return {}
        others = records_of(obstacles())
        things = {}
        for k in missing:
            x, y, yaw = spots[k].x, spots[k].y, spots[k].yaw
            z = float(base.world.height(np.array([x, y])))
            things[first + k] = _Thing(spots[k].model, (x, y, z, yaw))
        return {
            entity: thing
            for entity, thing in things.items()
            if not len(others) or gaps(thing.outline(), others).min() >= _ROOM
        }

    def _join_bodies(self) -> Bodies:
        things = list(self._standing.values())
        sizes = np.array([shape_of(thing.model)[1] for thing in things], np.float64).reshape(-1, 3)
        poses = np.array([thing.pose for thing in things], np.float64).reshape(-1, 4)
        kinds = [CAR if _is_vehicle(thing.model) else FIXTURE for thing in things]
        return Bodies(
            np.array(list(self._standing), np.int32),
            np.array(kinds, np.int8),
            poses[:, :3],
            poses[:, 3],
            sizes[:, 0] / 2,
            sizes[:, 1] / 2,
            sizes[:, 2],
            np.zeros((len(things), 2)),
        )


class _Thing:
    """A thing that stands: its model, and x, y, z and yaw."""

    def __init__(self, model: str, pose: tuple[float, float, float, float]) -> None:
        self.model, self.pose = model, pose

    def outline(self) -> Rectangle:
        length, width, _ = shape_of(self.model)[1]
        x, y, _, yaw = self.pose
        return Rectangle(x, y, math.cos(yaw), math.sin(yaw), length / 2, width / 2)


def _is_vehicle(model: str) -> bool:
    return model in vehicle_prototypes()


@lru_cache(maxsize=64)
def shape_of(model: str) -> tuple[list[Surface], tuple[float, float, float]]:
    """Return a model's surfaces, and the length, width and height that stand in the way, metres.

    Raises
    ------
    InputError
        If nothing is called so.
    """
    vehicles = vehicle_prototypes()
    if model in vehicles:
        return vehicles[model], vehicle_size(model)[:3]
    found = street_models().get(model)
    if found is None:
        raise InputError(f"events: no model is called {model!r}; take one of data/assets/models/outdoor, or a car's")
    length, width = found.foot or found.size[:2]
    return found.surfaces, (length, width, found.size[2])
