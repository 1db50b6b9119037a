"""Doors of houses as a browser draws those that are open: where they are, their leaves, and the halls behind them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vico.assets.house_doors import (
    DOOR_MATERIAL,
    hall_name,
    hall_surface,
    house_doors,
    is_gate,
    leaf_names,
    leaf_surfaces,
)
from vico.sim.pictures.buildings import hall_size
from vico.world.mesh import Surface
from vico.world.world import World


def door_entries(world: World) -> tuple[list[dict[str, Any]], dict[str, Sequence[Surface]]]:
    """Return the doors that can be drawn open, and the shapes of their leaves and halls by name.

    An entry tells the row of the entrance in ``world.entrances``, the middle of the sill (`at`) and the way in
    (`inward`), half the width and the height, the leaves from left to right as seen from outside, the hall, and
    whether it is a gate, which goes up and does not swing.
    """
    doors = house_doors(world.geometry("buildings", DOOR_MATERIAL), world.entrances)
    material = next((s.material for s in world.surfaces("buildings") if s.material.name == DOOR_MATERIAL), None)
    footprints = {building.id: building.footprint for building in world.buildings}
    entries: list[dict[str, Any]] = []
    shapes: dict[str, Sequence[Surface]] = {}
    for number in np.flatnonzero(doors["kind"] >= 0).tolist() if material is not None else []:
        door = doors[number]
        names = leaf_names(door)
        size = hall_size(door, footprints[world.entrances[number].building])
        hall = hall_name(door, size, lit=True)
        if names[0] not in shapes:
            assert material is not None
            shapes |= dict(zip(names, leaf_surfaces(door, material), strict=True))
        shapes.setdefault(hall, [hall_surface(door, size, lit=True)])
        entries.append(
            {
                "entrance": number,
                "at": [round(float(door[axis]), 3) for axis in ("x", "y", "z")],
                "inward": [round(float(door[axis]), 5) for axis in ("inward_x", "inward_y")],
                "half_width": round(float(door["half_width"]), 3),
                "height": round(float(door["height"]), 3),
                "leaves": names,
                "hall": hall,
                "gate": is_gate(door),
            }
        )
    return entries, shapes
