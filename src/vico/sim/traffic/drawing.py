"""Draws vehicles with their lamps, and what signals show."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.assets.vehicle_lights import lit_lamps, night_lamps
from vico.assets.vehicle_parts import mirrored
from vico.assets.vehicles import vehicle_prototypes
from vico.sim.bodies import Drawn, joined_drawn
from vico.sim.traffic.lights import LampDrawing
from vico.sim.traffic.makes import VEHICLE_MODELS
from vico.sim.traffic.signal_heads import SignalHeads
from vico.world.mesh import Surface


class TrafficDrawing:
    """Draws traffic.

    Parameters
    ----------
    models
        Of each vehicle, an index into `VEHICLE_MODELS`.
    entities
        Of each vehicle.
    heads
        Of the signals that are obeyed; None where none are.
    """

    def __init__(self, models: NDArray[np.int32], entities: NDArray[np.int32], heads: SignalHeads | None) -> None:
        self._models, self._entities, self._heads = models, entities, heads
        self._lamps = LampDrawing([VEHICLE_MODELS[k].split("_")[0] for k in models])

    def draw(
        self,
        transforms: NDArray[np.float32],
        there: NDArray[np.int64],
        lights: NDArray[np.uint8],
        elapsed: float,
        shown: tuple[NDArray[np.uint8], NDArray[np.uint8]],
    ) -> Drawn:
        """Return what is seen now.

        Parameters
        ----------
        transforms
            Model to world of every vehicle, shape ``(vehicles, 4, 4)``.
        there
            Vehicles that are in the world.
        lights
            Which lights each vehicle shows.
        elapsed
            Seconds since the traffic began.
        shown
            What signals show on each lane, and on each walkway.
        """
        vehicles = Drawn(VEHICLE_MODELS, self._models, transforms, self._entities)
        parts = [Drawn(VEHICLE_MODELS, self._models[there], transforms[there], self._entities[there])]
        parts.append(self._lamps.draw(lights, elapsed, vehicles))
        if self._heads is not None:
            parts.append(self._heads.draw(*shown))
        return joined_drawn(parts)

    def prototypes(self, *, lefthand: bool) -> dict[str, list[Surface]]:
        """Models of the vehicles and signals, by the names `draw` uses; doors of buses open to the kerb."""
        models = vehicle_prototypes()
        models = models | {name: [*models[name], night_lamps(name.split("_")[0])] for name in VEHICLE_MODELS}
        models = models | lit_lamps()
        if self._heads is not None:
            models = models | self._heads.prototypes()
        return models | {"bus": [mirrored(part) for part in models["bus"]]} if lefthand else models
