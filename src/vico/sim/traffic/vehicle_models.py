"""Which models vehicles are, and what follows: sizes, how they accelerate, brake, and keep their distance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vico.assets.vehicles import BICYCLE_PAINTS, CAR_KINDS, vehicle_size
from vico.seeds import rng
from vico.sim.traffic.car_following import COMFORTABLE_BRAKING, TIME_GAP
from vico.sim.traffic.records import NONE

#: Models that vehicles can be, by name.
VEHICLE_MODELS = [f"{kind}_{colour}" for kind, colours in CAR_KINDS.items() for colour in colours] + ["bus"]
VEHICLE_MODELS += [f"bicycle_{colour}" for colour in BICYCLE_PAINTS]

#: Share of each kind of car.
_SHARE = {"hatchback": 0.3, "sedan": 0.27, "suv": 0.23, "van": 0.12, "taxi": 0.08}
_CAR_ACCELERATION, _BUS_ACCELERATION, _HARD_BRAKING = 1.6, 1.1, 8.0  # m/s^2, on dry ground
_CAR_SPEED_FACTORS, _BUS_SPEED_FACTOR = (0.85, 1.05), 0.95


def choose_models(
    fleet: np.recarray, buses: Sequence[int], models: Sequence[str], seed: int
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Give every vehicle a model and the parameters that go with it.

    Parameters
    ----------
    fleet
        Cars, then buses, dtype `vico.sim.traffic.records.VEHICLE`; their parameters are set.
    buses
        Route of each bus.
    models
        Models of the first cars; empty where the seed decides.
    seed
        Decides models and paces.

    Returns
    -------
    tuple
        Model of each vehicle, an index into `VEHICLE_MODELS`, int32, and its height, metres.
    """
    random, cars = rng(seed, "traffic", "makes"), len(fleet) - len(buses)
    shares = np.array(
        [share for kind, colours in CAR_KINDS.items() for share in [_SHARE[kind] / len(colours)] * len(colours)]
    )
    chosen, bus_model = random.choice(len(shares), cars, p=shares / shares.sum()), VEHICLE_MODELS.index("bus")
    for v, model in enumerate(models):
        chosen[v] = VEHICLE_MODELS.index(model) if model else chosen[v]
    prototype = np.concatenate([chosen, np.full(len(buses), bus_model)]).astype(np.int32)
    sizes = np.array([vehicle_size(name) for name in VEHICLE_MODELS])[prototype].reshape(-1, 5)
    length, width, height, overhang, wheelbase = sizes.T.copy()
    car, bus = slice(0, cars), slice(cars, None)
    fleet.length, fleet.half_width, fleet.overhang, fleet.wheelbase = length, width / 2, overhang, wheelbase
    fleet.acceleration[car], fleet.acceleration[bus] = _CAR_ACCELERATION, _BUS_ACCELERATION
    fleet.braking, fleet.hard_braking, fleet.time_gap = COMFORTABLE_BRAKING, _HARD_BRAKING, TIME_GAP
    fleet.speed_factor[car] = random.uniform(*_CAR_SPEED_FACTORS, cars)
    fleet.speed_factor[bus] = _BUS_SPEED_FACTOR
    fleet.route[car], fleet.route[bus] = NONE, buses
    fleet.delivers = np.array([name.startswith("van_") for name in VEHICLE_MODELS])[prototype]
    return prototype, height
