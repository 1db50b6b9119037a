"""Draws vehicles with their lamps, and what signals show."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.assets.vehicle_lights import lit_lamps, night_lamps
from vico.assets.vehicle_parts import mirrored
from vico.assets.vehicles import CRANK_AXLE, ridden_prototypes, vehicle_prototypes
from vico.exact import product
from vico.sim.bodies import Drawn, joined_drawn
from vico.sim.traffic.lights import LampDrawing
from vico.sim.traffic.signal_heads import SignalHeads
from vico.sim.traffic.vehicle_models import VEHICLE_MODELS
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
        pedals: NDArray[np.float64],
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
        pedals
            Turns of the cranks of each cyclist, who are the last vehicles.
        """
        vehicles = Drawn(VEHICLE_MODELS, self._models, transforms, self._entities)
        parts = [Drawn(VEHICLE_MODELS, self._models[there], transforms[there], self._entities[there])]
        parts.append(self._lamps.draw(lights, elapsed, vehicles))
        if len(pedals):
            ridden = slice(len(transforms) - len(pedals), len(transforms))
            turned = _turned_cranks(transforms[ridden], pedals)
            parts.append(Drawn(["cranks"], np.zeros(len(pedals), np.int32), turned, self._entities[ridden]))
        if self._heads is not None:
            parts.append(self._heads.draw(*shown))
        return joined_drawn(parts)

    def prototypes(self, *, lefthand: bool) -> dict[str, list[Surface]]:
        """Models of the vehicles and signals, by the names `draw` uses; doors of buses open to the kerb."""
        models = vehicle_prototypes()
        if any(VEHICLE_MODELS[k].startswith("bicycle") for k in np.unique(self._models)):
            models = models | ridden_prototypes()
        lit = [name for name in VEHICLE_MODELS if name in models]
        models = models | {name: [*models[name], night_lamps(name.split("_")[0])] for name in lit}
        models = models | lit_lamps()
        if self._heads is not None:
            models = models | self._heads.prototypes()
        return models | {"bus": [mirrored(part) for part in models["bus"]]} if lefthand else models


def _turned_cranks(bicycles: NDArray[np.float32], turns: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return model to world of cranks that have made so many turns, in bicycles at `bicycles`, shape ``(n, 4, 4)``."""
    c, s = np.cos(2 * np.pi * turns), np.sin(2 * np.pi * turns)
    cranks = np.tile(np.eye(4), (len(turns), 1, 1))
    cranks[:, 0, 0], cranks[:, 0, 2], cranks[:, 2, 0], cranks[:, 2, 2] = c, s, -s, c
    cranks[:, :3, 3] = CRANK_AXLE
    return product(bicycles.astype(np.float64), cranks).astype(np.float32)
