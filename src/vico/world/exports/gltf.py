"""One glTF 2.0 file (GLB) with everything that can be seen; models are stored once and placed by nodes."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vico.io.files import write_bytes
from vico.world.glb import glb_bytes
from vico.world.mesh import Surface
from vico.world.world import World

_SEEN = ("ground", "buildings", "roofs")
# ENU, z up, to glTF's axes, y up.
_AXES = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], np.float64)


def write_gltf(world: World, folder: Path, *, rooms: bool) -> dict[str, int]:
    """Write ``world.glb``: y up, metres, the origin at the window's centre; nodes are named by the objects' ids."""
    names = [*_SEEN, "rooms"] if rooms else list(_SEEN)
    objects = world.objects if rooms else world.objects.where(world.objects.outdoors)
    models = world.prototypes()
    used = sorted(set(objects.prototype.tolist()))
    layers: dict[str, Sequence[Surface]] = {name: world.surfaces(name) for name in names}
    layers |= {f"model {name}": models[name] for name in used}
    text, binary = _chunks(glb_bytes(layers))
    mesh_of: dict[str, int] = {}
    nodes: list[dict[str, Any]] = []
    for node in text["nodes"]:
        if node["name"].startswith("model "):
            if "mesh" in node:
                mesh_of[node["name"].removeprefix("model ")] = node["mesh"]
        else:
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
