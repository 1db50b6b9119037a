"""One glTF 2.0 file (GLB) with everything that can be seen; models are stored once and placed by nodes."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from vico.io.files import write_bytes
from vico.world.glb import glb_bytes
from vico.world.mesh import Surface
from vico.world.world import World

_SEEN = ("ground", "buildings", "roofs")
_OF_BUILDINGS = ("buildings", "roofs")
# ENU, z up, to glTF's axes, y up.
_AXES = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], np.float64)


def write_gltf(world: World, folder: Path, *, rooms: bool) -> dict[str, int]:
    """Write ``world.glb``: y up, metres, the origin at the window's centre.

    Nodes are named by the ids of buildings and objects, so that programs which pick can tell them apart.
    """
    names = [*_SEEN, "rooms"] if rooms else list(_SEEN)
    objects = world.objects if rooms else world.objects.where(world.objects.outdoors)
    models = world.prototypes()
    used = sorted(set(objects.prototype.tolist()))
    layers: dict[str, Sequence[Surface]] = {}
    buildings = {building.entity: building for building in world.buildings}
    known = {building.id: building for building in world.buildings}
    for name in names:
        for surface in world.surfaces(name):
            for entity, part in _by_entity(surface, set(buildings)) if name in _OF_BUILDINGS else [(0, surface)]:
                node = buildings[entity].id if entity else name
                layers[node] = [*layers.get(node, ()), part]
    layers |= {f"model {name}": models[name] for name in used}
    text, binary = _chunks(glb_bytes(layers))
    mesh_of: dict[str, int] = {}
    nodes: list[dict[str, Any]] = []
    for node in text["nodes"]:
        if node["name"].startswith("model "):
            if "mesh" in node:
                mesh_of[node["name"].removeprefix("model ")] = node["mesh"]
        else:
            if building := known.get(node["name"]):
                facts = {"kind": "building", "entity": building.entity, "name": building.name, "use": building.use}
                node["extras"] = {key: value for key, value in facts.items() if value is not None}
            nodes.append(node)
    matrices = _AXES @ objects.transforms().astype(np.float64) @ _AXES.T
    for k, prototype in enumerate(objects.prototype.tolist()):
        if prototype in mesh_of:
            nodes.append(
                {
                    "name": str(objects.id[k]),
                    "mesh": mesh_of[prototype],
                    "matrix": [round(float(v), 6) for v in matrices[k].T.ravel()],
                    "extras": {"kind": str(objects.kind[k]), "entity": int(objects.entity[k])},
                }
            )
    text["nodes"] = nodes
    text["scenes"] = [{"name": world.manifest.name, "nodes": list(range(len(nodes)))}]
    origin = world.manifest.origin
    text["asset"]["copyright"] = "; ".join(source.attribution for source in world.manifest.sources)
    text["asset"]["extras"] = {"latitude": origin.lat, "longitude": origin.lon, "buildings": _entities(world)}
    write_bytes(folder / "world.glb", _packed(text, binary))
    return {"nodes": len(nodes), "models": len(mesh_of), "layers": len(names)}


def _by_entity(surface: Surface, buildings: set[int]) -> Iterator[tuple[int, Surface]]:
    """Split a surface into the parts of buildings; what is of none has the number 0."""
    owner = surface.entity[surface.triangles[:, 0]] if len(surface.triangles) else np.zeros(0, np.int32)
    owner = np.where(np.isin(owner, list(buildings)), owner, 0)
    for entity in np.unique(owner).tolist():
        used, corners = np.unique(surface.triangles[owner == entity], return_inverse=True)
        yield (
            entity,
            replace(
                surface,
                positions=surface.positions[used],
                normals=surface.normals[used],
                uv=surface.uv[used],
                colour=surface.colour[used],
                entity=surface.entity[used],
                triangles=corners.reshape(-1, 3).astype(np.int32),
            ),
        )


def _entities(world: World) -> dict[str, int]:
    """Return building ids and the numbers that the vertex attribute ``_ENTITY`` holds for them."""
    return {building.id: building.entity for building in world.buildings}


def _chunks(glb: bytes) -> tuple[dict[str, Any], bytes]:
    length = struct.unpack_from("<I", glb, 12)[0]
    return json.loads(glb[20 : 20 + length]), glb[28 + length :]


def _packed(document: dict[str, Any], binary: bytes) -> bytes:
    text = json.dumps(document, separators=(",", ":"), ensure_ascii=False).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks
