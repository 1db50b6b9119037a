"""Rooms with what stands in them, a file a building, fetched only when somebody goes in."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.io.files import write_bytes
from vico.viewer.city.models import write_instances
from vico.viewer.city.pack import Blob, packed
from vico.viewer.city.textures import TextureLayers
from vico.world.mesh import Surface
from vico.world.world import World


def write_rooms(world: World, textures: TextureLayers, folder: Path) -> dict[str, Any]:
    """Write the rooms of each building and the shapes of what stands in them; return their entries.

    Returns
    -------
    dict
        ``files``: of each building its file, meshes and instances; ``rooms``: of each room, by its index in the world,
        which file it is in.
    """
    index = {building: k for k, building in enumerate(sorted({room.building for room in world.rooms}))}
    file_of_entity = {room.entity: index[room.building] for room in world.rooms}
    parts: dict[int, list[Surface]] = {k: [] for k in index.values()}
    for surface in world.surfaces("rooms"):
        owner = _owners(surface, file_of_entity)
        for k in np.unique(owner).tolist():
            if k >= 0:
                parts[k].append(_some(surface, owner == k))
    file_of_room = {room.id: index[room.building] for room in world.rooms}
    standing = np.array([file_of_room.get(str(room), -1) for room in world.objects.room], np.int64)
    files: list[dict[str, Any]] = []
    for k in range(len(index)):
        blob = Blob()
        entry: dict[str, Any] = {
            "file": f"rooms_{k}.bin",
            "near": [blob.mesh(mesh) for mesh in packed(parts[k], textures)],
            "instances": write_instances(world, standing == k, blob),
        }
        write_bytes(folder / f"rooms_{k}.bin", blob.bytes())
        files.append(entry)
    models, shapes = world.prototypes(), Blob()
    used = {entry["prototype"] for file in files for entry in file["instances"]}
    furniture = {
        name: {"near": [shapes.mesh(mesh) for mesh in packed(models[name], textures)], "far": []}
        for name in sorted(used)
    }
    write_bytes(folder / "furniture.bin", shapes.bytes())
    return {"files": files, "rooms": [index[room.building] for room in world.rooms], "furniture": furniture}


def _owners(surface: Surface, file_of_entity: dict[int, int]) -> NDArray[np.int64]:
    """Return the file of each triangle, -1 for those of no room."""
    entities, inverse = np.unique(surface.entity[surface.triangles[:, 0]], return_inverse=True)
    files = np.array([file_of_entity.get(entity, -1) for entity in entities.tolist()], np.int64)
    return np.asarray(files[inverse])


def _some(surface: Surface, chosen: NDArray[np.bool_]) -> Surface:
    used, faces = np.unique(surface.triangles[chosen], return_inverse=True)
    return replace(
        surface,
        positions=surface.positions[used],
        normals=surface.normals[used],
        uv=surface.uv[used],
        colour=surface.colour[used],
        entity=surface.entity[used],
        triangles=faces.reshape(-1, 3).astype(np.int32),
    )
