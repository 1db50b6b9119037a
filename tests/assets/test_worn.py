"""Heads and bodies of a user's own, from GLB files that the test writes."""

from __future__ import annotations

import io
import json
import struct
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from vico.assets.people import Appearance, J, SkinnedBody, body_of
from vico.assets.people.custom_body import fit_custom_body
from vico.errors import MissingFileError, SchemaError
from vico.render.skinning import batch_bodies, skin

_TO_GLTF = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


# Not while tests are collected: what makes a body would be compiled then.
@cache
def plain() -> SkinnedBody:
    return body_of(Appearance(height=1.75, hair="long"), source="procedural")


def write_glb(path: Path, arrays: dict[str, NDArray[Any]], document: dict[str, Any], picture: bytes = b"") -> Path:
    """Write a GLB whose accessors are the arrays, in their order."""
    views, accessors, blob = [], [], b""
    kinds = {"float32": 5126, "uint16": 5123, "uint32": 5125}
    for values in arrays.values():
        data = np.ascontiguousarray(values).tobytes()
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": len(data)})
        shape = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}[1 if values.ndim == 1 else values.shape[1]]
        accessors.append(
            {
                "bufferView": len(views) - 1,
                "componentType": kinds[values.dtype.name],
                "count": len(values),
                "type": shape,
            }
        )
        blob += data + b"\0" * (-len(data) % 4)
    if picture:
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": len(picture)})
        blob += picture + b"\0" * (-len(picture) % 4)
        document["images"] = [{"bufferView": len(views) - 1, "mimeType": "image/png"}]
    document |= {"asset": {"version": "2.0"}, "bufferViews": views, "accessors": accessors}
    document["buffers"] = [{"byteLength": len(blob)}]
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(blob), 0x004E4942) + blob
    path.write_bytes(struct.pack("<III", 0x46546C67, 2, 12 + len(body)) + body)
    return path


def head_file(path: Path) -> Path:
    """A box 2 units high, looking along +z: its texture is red on one half and blue on the other."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (0, 2) for z in (-1, 1)], np.float32)
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (1, 5, 7, 3), (0, 2, 6, 4))
    faces = np.array([f for q in quads for f in ((q[0], q[1], q[2]), (q[0], q[2], q[3]))], np.uint16).reshape(-1)
    uv = np.column_stack([(corners[:, 0] + 1) / 2.001, np.zeros(8)]).astype(np.float32)
    drawn = io.BytesIO()
    Image.fromarray(np.array([[[255, 0, 0], [0, 0, 255]]], np.uint8)).save(drawn, "PNG")
    document = {
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "indices": 1, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}],
    }
    return write_glb(path, {"points": corners, "faces": faces, "uv": uv}, document, drawn.getvalue())


def body_file(path: Path, body: SkinnedBody) -> Path:
    """One of our bodies as another program would export it: in centimetres, its joints called as Mixamo calls them."""
    called = {
        "pelvis": "Hips",
        "spine1": "Spine",
        "spine2": "Spine1",
        "spine3": "Spine2",
        "neck": "Neck",
        "head": "Head",
    }
    for side, word in (("left", "Left"), ("right", "Right")):
        parts = {"hip": "UpLeg", "knee": "Leg", "ankle": "Foot", "foot": "ToeBase", "collar": "Shoulder"}
        parts |= {"shoulder": "Arm", "elbow": "ForeArm", "wrist": "Hand"}
        called |= {f"{side}_{ours}": f"{word}{theirs}" for ours, theirs in parts.items()}
    names = list(called)
    from vico.assets.people import JOINTS, PARENTS

    nodes: list[dict[str, Any]] = [{"name": f"mixamorig:{called[name]}", "children": []} for name in names]
    bind = np.tile(np.eye(4), (len(names), 1, 1))
    for k, name in enumerate(names):
        at = _TO_GLTF @ body.rest_joints[J[name]] * 100
        parent = JOINTS[PARENTS[J[name]]] if name != "pelvis" else None
        above = _TO_GLTF @ body.rest_joints[J[parent]] * 100 if parent else np.zeros(3)
        nodes[k]["translation"] = (at - above).tolist()
        bind[k, :3, 3] = -at
        if parent:
            nodes[names.index(parent)]["children"].append(k)
    nearest = np.array([_nearest(j, names) for j in range(len(JOINTS))], np.uint16)
    nodes.append({"mesh": 0, "skin": 0})
    document = {
        "nodes": nodes,
        "skins": [{"joints": list(range(len(names))), "inverseBindMatrices": 4}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "JOINTS_0": 2, "WEIGHTS_0": 3}, "indices": 1}]}],
    }
    arrays = {
        "points": (body.vertices @ _TO_GLTF.T * 100).astype(np.float32),
        "faces": body.triangles.reshape(-1).astype(np.uint32),
        "joints": nearest[body.weight_joints],
        "weights": body.weights,
        "bind": np.swapaxes(bind, 1, 2).reshape(-1, 16).astype(np.float32),
    }
    return write_glb(path, arrays, document)


def _nearest(joint: int, names: list[str]) -> int:
    from vico.assets.people import JOINTS, PARENTS

    while JOINTS[joint] not in names:
        joint = int(PARENTS[joint])
    return names.index(JOINTS[joint])


def placed(body: SkinnedBody, rotations: NDArray[np.float32]) -> NDArray[np.float32]:
    batch = batch_bodies([body], [1])
    return skin(batch, rotations[None], np.zeros((1, 3), np.float32), np.zeros((1, 3)), np.zeros(1))[0]


def test_a_textured_head_is_worn_on_the_neck_and_turns_with_it(tmp_path: Path) -> None:
    body = fit_custom_body(plain(), head_file(tmp_path / "head.glb"))
    new = slice(len(plain().vertices), None)
    rest = np.zeros((55, 3), np.float32)
    head = placed(body, rest)[new]
    top = placed(plain(), rest)[:, 2].max()
    assert abs(head[:, 2].max() - top) < 0.02
    assert abs(head[:, 1].mean()) < 0.02
    # Both halves of the texture are there: red on the person's right.
    red = body.colour[new][:, 0] > 200
    assert 0.3 < red.mean() < 0.7
    assert head[red, 1].mean() < -0.03 < 0.03 < head[~red, 1].mean()
    turned = rest.copy()
    turned[J["head"]] = 0.0, 0.0, np.pi / 2
    assert placed(body, turned)[new][red, 0].mean() - head[red, 0].mean() > 0.03
    # Nothing of the own head is left: none of its triangles.
    used = np.zeros(len(body.vertices), bool)
    used[body.triangles] = True
    own_hair = (plain().weight_joints[:, 0] == J["head"]) & (plain().vertices[:, 2] > plain().height - 0.05)
    assert not used[: len(plain().vertices)][own_hair].any()


def test_a_skinned_body_moves_as_its_own_joints_would(tmp_path: Path) -> None:
    body = fit_custom_body(plain(), body_file(tmp_path / "body.glb", plain()))
    assert body.height == plain().height
    bent = np.zeros((55, 3), np.float32)
    bent[J["left_elbow"]] = 0.0, 0.0, -1.0
    bent[J["right_hip"]] = 0.0, -0.8, 0.0
    away = np.linalg.norm(placed(body, bent) - placed(plain(), bent), axis=1)
    hands = np.isin(plain().weight_joints[:, 0], [j for j in range(55) if j > 21])
    assert away[~hands].max() < 0.03


def test_files_that_cannot_be_worn_are_refused_with_their_name(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match=r"none\.glb"):
        fit_custom_body(plain(), tmp_path / "none.glb")
    whole = head_file(tmp_path / "head.glb").read_bytes()
    for k, data in enumerate(
        (b"", b"glTF", whole[:200], whole.replace(b'"POSITION": 0', b'"POSITION": 9'), whole[:-60])
    ):
        damaged = tmp_path / f"damaged{k}.glb"
        damaged.write_bytes(data)
        with pytest.raises(SchemaError, match=f"damaged{k}"):
            fit_custom_body(plain(), damaged)
