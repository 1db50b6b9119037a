"""Rigs as other programs write them, moved in ways that are known: as BVH and as glTF."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

#: Joints of a Mixamo rig (y up, looking along z, metres): name, parent, offset in the T-pose.
MIXAMO: list[tuple[str, str, tuple[float, float, float]]] = [
    ("Hips", "", (0.0, 0.95, 0.0)),
    ("Spine", "Hips", (0.0, 0.10, 0.0)),
    ("Spine1", "Spine", (0.0, 0.12, 0.0)),
    ("Spine2", "Spine1", (0.0, 0.12, 0.0)),
    ("Neck", "Spine2", (0.0, 0.15, 0.0)),
    ("Head", "Neck", (0.0, 0.10, 0.02)),
]
for _side, _x in (("Left", 1.0), ("Right", -1.0)):
    MIXAMO += [
        (f"{_side}UpLeg", "Hips", (0.09 * _x, -0.05, 0.0)),
        (f"{_side}Leg", f"{_side}UpLeg", (0.0, -0.42, 0.0)),
        (f"{_side}Foot", f"{_side}Leg", (0.0, -0.40, 0.0)),
        (f"{_side}ToeBase", f"{_side}Foot", (0.0, -0.06, 0.12)),
        (f"{_side}Shoulder", "Spine2", (0.06 * _x, 0.10, 0.0)),
        (f"{_side}Arm", f"{_side}Shoulder", (0.12 * _x, 0.0, 0.0)),
        (f"{_side}ForeArm", f"{_side}Arm", (0.28 * _x, 0.0, 0.0)),
        (f"{_side}Hand", f"{_side}ForeArm", (0.26 * _x, 0.0, 0.0)),
        (f"{_side}HandIndex1", f"{_side}Hand", (0.09 * _x, 0.0, 0.02)),
    ]

Rig = list[tuple[str, str, tuple[float, float, float]]]


def arms_down(rig: Rig) -> Rig:
    """The same rig with hanging arms at rest, as motion capture of old has it."""
    hanging = {"Arm": (0.0, 0.0, 0.0), "ForeArm": (0.0, -0.28, 0.0), "Hand": (0.0, -0.26, 0.0)}
    changed = []
    for name, parent, offset in rig:
        part = name.removeprefix("Left").removeprefix("Right")
        changed.append((name, parent, hanging[part] if part in ("ForeArm", "Hand") else offset))
    return changed


def random_turns(rig: Rig, frames: int, seed: int) -> NDArray[np.float64]:
    """Rotations of each joint relative to its parent, degrees about z, x and y in turn, shape ``(t, n, 3)``."""
    return np.random.default_rng(seed).uniform(-40.0, 40.0, (frames, len(rig), 3))


def local_matrices(turns: NDArray[np.float64]) -> NDArray[np.float64]:
    flat = Rotation.from_euler("ZXY", turns.reshape(-1, 3), degrees=True).as_matrix()
    return flat.reshape(*turns.shape[:2], 3, 3)


def places(rig: Rig, turns: NDArray[np.float64], root: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where the joints are, in the rig's axes, shape ``(t, n, 3)``."""
    local, index = local_matrices(turns), {name: k for k, (name, _, _) in enumerate(rig)}
    world, found = np.empty_like(local), np.empty((*turns.shape[:2], 3))
    for k, (_, parent, offset) in enumerate(rig):
        above = index.get(parent, -1)
        world[:, k] = local[:, k] if above < 0 else world[:, above] @ local[:, k]
        found[:, k] = root if above < 0 else found[:, above] + world[:, above] @ np.array(offset)
    return found


def bvh(rig: Rig, turns: NDArray[np.float64], root: NDArray[np.float64], *, unit: float = 100.0) -> str:
    """The rig's motion as a BVH file, 30 frames a second; `unit` is how many of its units make a metre."""
    lines, order = ["HIERARCHY"], []

    def write(name: str, depth: int) -> None:
        k = next(k for k, row in enumerate(rig) if row[0] == name)
        order.append(k)
        tab = "\t" * depth
        lines.append(f"{tab}{'JOINT' if rig[k][1] else 'ROOT'} mixamorig:{name}")
        x, y, z = (unit * value for value in (rig[k][2] if rig[k][1] else (0.0, 0.0, 0.0)))
        lines.extend([f"{tab}{{", f"{tab}\tOFFSET {x} {y} {z}"])
        position = "" if rig[k][1] else "Xposition Yposition Zposition "
        lines.append(f"{tab}\tCHANNELS {3 if rig[k][1] else 6} {position}Zrotation Xrotation Yrotation")
        children = [row[0] for row in rig if row[1] == name]
        for child in children:
            write(child, depth + 1)
        if not children:
            lines.extend([f"{tab}\tEnd Site", f"{tab}\t{{", f"{tab}\t\tOFFSET 0 1 0", f"{tab}\t}}"])
        lines.append(f"{tab}}}")

    write(rig[0][0], 0)
    lines += ["MOTION", f"Frames: {len(turns)}", f"Frame Time: {1 / 30}"]
    for moment, place in zip(turns, root, strict=True):
        numbers = np.concatenate([unit * place, moment[order].ravel()])
        lines.append(" ".join(repr(float(number)) for number in numbers))
    return "\n".join(lines) + "\n"


def glb(rig: Rig, turns: NDArray[np.float64], root: NDArray[np.float64], *, change: Any = None) -> bytes:
    """The rig's motion as a binary glTF, bound in the T-pose; `change` may spoil the document before it is written."""
    index = {name: k for k, (name, _, _) in enumerate(rig)}
    t, n = turns.shape[:2]
    quaternions = Rotation.from_matrix(local_matrices(turns).reshape(-1, 3, 3)).as_quat().reshape(t, n, 4)
    rest = places(rig, np.zeros((1, n, 3)), np.array([rig[0][2]]))[0]
    bound = np.tile(np.eye(4), (n, 1, 1))
    bound[:, :3, 3] = -rest
    arrays: list[tuple[NDArray[np.float32], str]] = [
        (np.arange(t, dtype=np.float32) / 30, "SCALAR"),
        (np.swapaxes(bound, 1, 2).astype(np.float32), "MAT4"),
        (root.astype(np.float32), "VEC3"),
        *((quaternions[:, k].astype(np.float32), "VEC4") for k in range(n)),
    ]
    buffer, views, accessors = b"", [], []
    for array, kind in arrays:
        views.append({"buffer": 0, "byteOffset": len(buffer), "byteLength": array.nbytes})
        accessors.append({"bufferView": len(views) - 1, "componentType": 5126, "count": len(array), "type": kind})
        buffer += array.tobytes()
    # Nodes stand as in the first frame, which is not the pose of rest.
    nodes: list[dict[str, Any]] = []
    for k, (name, _, offset) in enumerate(rig):
        nodes.append({"name": f"mixamorig:{name}", "translation": offset, "rotation": quaternions[0, k].tolist()})
        children = [index[row[0]] for row in rig if row[1] == name]
        if children:
            nodes[-1]["children"] = children
    channels = [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]
    channels += [{"sampler": 1 + k, "target": {"node": k, "path": "rotation"}} for k in range(n)]
    document = {
        "asset": {"version": "2.0"},
        "nodes": nodes,
        "skins": [{"joints": list(range(n)), "inverseBindMatrices": 1}],
        "animations": [
            {"name": "dance", "channels": channels, "samplers": [{"input": 0, "output": 2 + k} for k in range(n + 1)]}
        ],
        "buffers": [{"byteLength": len(buffer)}],
        "bufferViews": views,
        "accessors": accessors,
    }
    if change is not None:
        change(document)
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    buffer += b"\0" * (-len(buffer) % 4)
    length = 12 + 8 + len(text) + 8 + len(buffer)
    head = struct.pack("<III", 0x46546C67, 2, length) + struct.pack("<II", len(text), 0x4E4F534A) + text
    return head + struct.pack("<II", len(buffer), 0x004E4942) + buffer
