"""Shapes that stand or move in numbers, near and far, and where those stand that do not move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.models.library import in_hand_models, signal_prototypes
from vico.assets.models.movable import movable_colours, movable_kinds, movable_prototype, movable_surfaces
from vico.assets.simplification import simplify_mesh
from vico.assets.transit_vehicles import train_prototypes, tram_prototypes
from vico.assets.vehicles import CAR_KINDS, lit_lamps, night_lamps, ridden_prototypes, vehicle_prototypes
from vico.viewer.city.pack import Blob, packed
from vico.viewer.city.textures import TextureLayers
from vico.world.mesh import Surface
from vico.world.world import World

Models = Mapping[str, Sequence[Surface]]
# From far away a shape has this share of its triangles, but some at least; leaves this share, each larger.
_FAR_SHARE, _FAR_LEAST, _FAR_LEAVES = 0.14, 12, 0.17


def moving_models() -> dict[str, Sequence[Surface]]:
    """Return the shapes of vehicles, their lamps, and what people carry, by prototype's name."""
    found: dict[str, Sequence[Surface]] = {**vehicle_prototypes(), **ridden_prototypes()}
    found |= tram_prototypes() | train_prototypes() | lit_lamps() | signal_prototypes()
    found |= {f"{kind}:night": [night_lamps(kind)] for kind in (*CAR_KINDS, "bus", "bicycle")}
    found |= {name: model.surfaces for name, model in in_hand_models().items()}
    for kind in movable_kinds():
        for colour in movable_colours():
            found[movable_prototype(kind, colour)] = movable_surfaces(kind, colour)
    return found


def write_models(models: Models, textures: TextureLayers, blob: Blob) -> dict[str, Any]:
    """Write shapes, from near and from far; return their entries by name."""
    return {name: _entry(list(models[name]), textures, blob) for name in sorted(models)}


def _entry(surfaces: list[Surface], textures: TextureLayers, blob: Blob) -> dict[str, Any]:
    near = [blob.mesh(mesh) for mesh in packed(surfaces, textures)]
    far = [blob.mesh(mesh) for mesh in packed(coarse(surfaces, textures), textures)]
    low = np.min([mesh["low"] for mesh in near], axis=0) if near else np.zeros(3)
    high = np.max([mesh["high"] for mesh in near], axis=0) if near else np.zeros(3)
    return {"near": near, "far": far, "low": low.tolist(), "high": high.tolist()}


def coarse(surfaces: Sequence[Surface], textures: TextureLayers) -> list[Surface]:
    """Return shapes as they may look from some sixty metres away, in plain colours but for leaves."""
    found = []
    for surface in surfaces:
        if surface.material.cutout:
            found.append(_fewer_leaves(surface))
        elif len(surface.triangles) <= _FAR_LEAST:
            found.append(surface)
        else:
            found.append(_thinned(surface, textures))
    return found


def _thinned(surface: Surface, textures: TextureLayers) -> Surface:
    wanted = max(_FAR_LEAST, round(_FAR_SHARE * len(surface.triangles)))
    points, faces, kept = simplify_mesh(surface.positions, surface.triangles, wanted)
    if not len(faces):
        return surface
    tint = textures.layer_of(surface.material).colour / 255.0
    corner_colour = (surface.colour[surface.triangles[kept, 0], :3] * tint).astype(np.uint8)
    split = points[faces].reshape(-1, 3)
    colours = np.repeat(corner_colour, 3, axis=0)
    return Surface.from_triangles(split, np.arange(len(split)).reshape(-1, 3), colour=colours)


def _fewer_leaves(surface: Surface) -> Surface:
    """Return a share of the squares that leaves are painted on, each larger, so that a crown stays as dense."""
    squares = _connected(surface.triangles, len(surface.positions))
    numbers = np.unique(squares)
    step = max(1, round(1 / _FAR_LEAVES))
    chosen = np.isin(squares, numbers[::step])
    positions = surface.positions.astype(np.float64).copy()
    for number in numbers[::step].tolist():
        own = np.unique(surface.triangles[squares == number])
        middle = positions[own].mean(axis=0)
        positions[own] = middle + (positions[own] - middle) * np.sqrt(step) * 0.95
    used, faces = np.unique(surface.triangles[chosen], return_inverse=True)
    return Surface(
        positions[used].astype(np.float32),
        surface.normals[used],
        surface.uv[used],
        surface.colour[used],
        surface.entity[used],
        faces.reshape(-1, 3).astype(np.int32),
        surface.material,
    )


def _connected(triangles: NDArray[Any], count: int) -> NDArray[np.int64]:
    """Return a number for each triangle, the same for those that share vertices."""
    owner = np.arange(count)
    while True:
        least = owner[triangles].min(axis=1)
        before = owner.copy()
        for corner in range(3):
            np.minimum.at(owner, triangles[:, corner], least)
        if np.array_equal(owner, before):
            return np.asarray(owner[triangles[:, 0]], np.int64)


def write_instances(world: World, chosen: NDArray[np.bool_], blob: Blob) -> list[dict[str, Any]]:
    """Write where objects stand, by prototype: x, y, z, yaw, scale (float32) of each, then entities (int32)."""
    objects, entries = world.objects, []
    rows = np.flatnonzero(chosen)
    names, which = np.unique(objects.prototype[rows].astype(str), return_inverse=True)
    for k, name in enumerate(names.tolist()):
        own = rows[which == k]
        columns = (objects.x, objects.y, objects.z, objects.yaw, objects.scale)
        table = np.column_stack([column[own] for column in columns]).astype(np.float32)
        offset = blob.add(table)
        blob.add(objects.entity[own].astype(np.int32))
        entries.append({"prototype": name, "offset": offset, "count": len(own)})
    return entries
