"""Headlights: cones of light before vehicles, of which a picture shows the nearest few."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.vehicle_parts import SHINING
from vico.render.compiled import kernel
from vico.render.records import LAMP
from vico.world.mesh import Surface

#: Vehicles whose headlights light a picture, at most.
MOST_BEAMS = 6
#: How far light reaches, metres.
BEAM_REACH = 24.0
#: From this exposure of lamps on headlights are seen on what is around: by day glass shines a little, to be told.
LIT_FROM = 0.02
# Light is thrown whole up to 21 degrees from straight ahead, and nothing from 40 on.
_SPREAD, _SHARE = 6.0, -4.6
_POWER, _SIZE = 26.0, 9.0
# What is nearer than this to the middle of a cone has it in its picture, metres; the middle is so far ahead.
_FARTHEST, _MIDDLE = 75.0, 9.0
# Headlights are white, unlike rear lights, and no higher than this above ground, unlike lamps in buses, metres.
_WHITE, _HIGH = 200, 1.4


class Beams(NamedTuple):
    """Headlights of models.

    Attributes
    ----------
    row
        Of each prototype in `lamps`, -1: none; int32, shape ``(p,)``.
    lamps
        `LAMP` in the models' frames: the middle between a vehicle's headlights stands for both.
    """

    row: NDArray[np.int32]
    lamps: NDArray[np.void]

    def placed(self, prototype: NDArray[np.int32], rows: NDArray[np.float32]) -> NDArray[np.void]:
        """Return the headlights of placed models; `rows` are of their transforms, shape ``(n, 3, 4)``."""
        known = self.row[prototype]
        shining = np.flatnonzero(known >= 0)
        found = self.lamps[known[shining]]
        matrix = rows[shining]
        local = np.stack([found[name] for name in "xyz"], axis=1)
        place = np.einsum("nij,nj->ni", matrix[:, :, :3], local) + matrix[:, :, 3]
        found["x"], found["y"], found["z"] = place.T
        found["axis_x"], found["axis_y"], found["axis_z"] = matrix[:, :, 0].T
        return found


def beams_of(models: Mapping[str, Sequence[Surface]]) -> Beams:
    """Return the headlights of models."""
    row = np.full(len(models), -1, np.int32)
    found: list[tuple[float, ...]] = []
    for k, surfaces in enumerate(models.values()):
        place = _headlight(surfaces)
        if place is not None:
            row[k] = len(found)
            found.append((*place, 1.0, 0.0, 0.0, _SPREAD, _SHARE, _POWER, _SIZE, 1.0 / BEAM_REACH**2, 0))
    return Beams(row, np.array(found, LAMP) if found else np.zeros(0, LAMP))


def _headlight(surfaces: Sequence[Surface]) -> tuple[float, float, float] | None:
    """Return the middle between a model's headlights, a hand's breadth before them."""
    for surface in surfaces:
        if surface.material.name != SHINING.name:
            continue
        points = surface.positions[(surface.colour.min(axis=1) >= _WHITE) & (surface.positions[:, 2] < _HIGH)]
        if len(points):
            front = points[points[:, 0] > points[:, 0].max() - 0.3]
            return float(front[:, 0].max()) + 0.1, float(front[:, 1].mean()), float(front[:, 2].mean())
    return None


@kernel
def nearest_beams(beams: Any, camera: Any, lamp_exposure: Any, chosen: Any) -> int:
    """Write the rows of the headlights that light a camera's picture most into `chosen`; return how many."""
    count, far = 0, np.empty(len(chosen))
    if camera.indoors or lamp_exposure < LIT_FROM:
        return 0
    for k in range(len(beams)):
        beam = beams[k]
        dx = beam.x + _MIDDLE * beam.axis_x - camera.x
        dy = beam.y + _MIDDLE * beam.axis_y - camera.y
        dz = beam.z - camera.z
        ahead = dx * camera.forward_x + dy * camera.forward_y + dz * camera.forward_z
        away = np.sqrt(dx * dx + dy * dy + dz * dz)
        if away > _FARTHEST or ahead < -_MIDDLE - 4.0:
            continue
        if count < len(chosen):
            at = count
            count += 1
        elif far[count - 1] > away:
            at = count - 1
        else:
            continue
        while at > 0 and far[at - 1] > away:
            far[at], chosen[at] = far[at - 1], chosen[at - 1]
            at -= 1
        far[at], chosen[at] = away, k
    return count
