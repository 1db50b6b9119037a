"""A user's own head or body: a GLB file with colours or textures, worn by somebody of a run.

A file with a skin whose joints are named as Mixamo, SMPL-X or Biovision name them becomes a whole body. Any other is a
head: it is set on the neck in place of the own one, from the neck to the crown, and turns with it. Textures become
colours of vertices: faces are divided until there are enough of these.
"""

from __future__ import annotations

import io
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.assets.motions.gltf import Rig, bound_matrices
from vico.assets.motions.retargeting import Skeleton, joints_by_name
from vico.assets.people.model import JOINTS, PARENTS, J, SkinnedBody, t_pose
from vico.errors import MissingFileError, SchemaError
from vico.io.gltf_file import GltfFault, GltfFile, gltf_errors

__all__ = ["fit_custom_body"]
_MOST_BYTES = 256 << 20
_MOST_TRIANGLES, _MOST_PIXELS = 100_000, 8192 * 8192
# Textured faces are divided while there are fewer of them.
_FINE = 6000
_HEAD = ("head", "jaw", "left_eye", "right_eye")
# glTF: y up, looking along +z. Ours: z up, looking along +x.
_AXES = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


class _Mesh(NamedTuple):
    """Triangles of a file at rest, in our axes: points, colours (sRGB, 0..255), shares of our joints (n, 55)."""

    points: NDArray[np.float64]
    triangles: NDArray[np.int64]
    colour: NDArray[np.float64]
    shares: NDArray[np.float64]


def fit_custom_body(body: SkinnedBody, path: Path) -> SkinnedBody:
    """Return a body with the head of a file on it, or the whole body that the file holds, as tall as `body`.

    Raises
    ------
    MissingFileError
        If there is no such file.
    SchemaError
        If it is damaged, too large, or has no mesh.
    InputError
        If it has a skin whose joints are no person's.
    """
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise SchemaError(f"{path}: larger than {_MOST_BYTES >> 20} MiB; make its mesh and textures smaller")
        data = path.read_bytes()
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file; a head or a body to wear is a .glb file") from None
    with gltf_errors(str(path)):
        reader = _Reader(GltfFile.of(data), str(path))
        mesh = reader.mesh()
    return _with_head(body, mesh) if reader.skin is None else _whole_body(body, mesh, reader.joints)


class _Reader:
    """Reads a file's meshes: those with a skin if there are any."""

    def __init__(self, file: GltfFile, source: str) -> None:
        self._file, self._rig = file, Rig(file)
        nodes = file.document["nodes"]
        skinned = [k for k, node in enumerate(nodes) if "mesh" in node and "skin" in node]
        self._nodes = skinned or [k for k, node in enumerate(nodes) if "mesh" in node]
        self.world = self._rig.moving({}, np.zeros(1))[0]
        self.skin: dict[str, Any] | None = None
        #: Where our joints are that the file has, in our axes, by name.
        self.joints: dict[str, NDArray[np.float64]] = {}
        if skinned:
            self.skin = file.entry("skins", nodes[skinned[0]]["skin"])
            places = self.world[:, :3, 3]
            named = joints_by_name(Skeleton(self._rig.names, self._rig.parents, places), source=source)
            self.joints = {name: _AXES @ places[at] for name, at in named.items()}
            self._ours = self._nearest_of_ours({at: J[name] for name, at in named.items()})

    def _nearest_of_ours(self, ours: dict[int, int]) -> NDArray[np.int64]:
        """Return which joint of ours moves what each node moves: its own, else that of the nearest node above."""
        found = np.zeros(len(self._rig.parents), np.int64)
        for k, parent in enumerate(self._rig.parents):
            found[k] = ours.get(k, found[parent] if parent >= 0 else J["pelvis"])
        return found

    def mesh(self) -> _Mesh:
        """Return all triangles."""
        lots: list[_Mesh] = []
        for k in self._nodes:
            node = self._file.document["nodes"][k]
            for primitive in self._file.entry("meshes", node["mesh"])["primitives"]:
                if primitive.get("mode", 4) == 4:
                    lots.append(self._primitive(primitive, self.world[self._rig.place[k]]))
        triangles, start = [], 0
        for lot in lots:
            triangles.append(lot.triangles + start)
            start += len(lot.points)
        if not lots or not start or not 0 < sum(map(len, triangles)) <= _MOST_TRIANGLES:
            raise GltfFault(f"has no triangles, or more than {_MOST_TRIANGLES:,}; simplify its mesh")
        points, colour, shares = (
            np.concatenate([getattr(lot, name) for lot in lots]) for name in ("points", "colour", "shares")
        )
        if not np.isfinite(points).all() or np.ptp(points, axis=0).max() <= 0.0:
            raise GltfFault("has points that are nowhere; export it anew")
        return _Mesh(points, np.concatenate(triangles), colour, shares)

    def _primitive(self, primitive: dict[str, Any], here: NDArray[np.float64]) -> _Mesh:
        file, attributes = self._file, primitive["attributes"]
        if "KHR_draco_mesh_compression" in primitive.get("extensions", {}):
            raise GltfFault("is compressed with Draco; export it plain")
        points = np.asarray(file.accessor(attributes["POSITION"]), np.float64).reshape(-1, 3)
        count = len(points)
        corners = (
            np.asarray(file.accessor(primitive["indices"]), np.int64) if "indices" in primitive else np.arange(count)
        )
        triangles = corners[: len(corners) // 3 * 3].reshape(-1, 3)
        if len(triangles) > _MOST_TRIANGLES or (len(triangles) and not 0 <= triangles.min() <= triangles.max() < count):
            raise GltfFault("has too many triangles, or some of points that are not there; simplify and export it anew")
        shares = np.zeros((count, len(JOINTS)))
        if self.skin is None:
            points = points @ here[:3, :3].T + here[:3, 3]
        else:
            points, shares = self._bind_pose(attributes, points)
        picture, factor = self._material(primitive)
        colour = np.tile(factor, (count, 1))
        if "COLOR_0" in attributes:
            own = np.asarray(file.accessor(attributes["COLOR_0"]), np.float64).reshape(count, -1)
            colour = colour * np.clip(own[:, :3], 0.0, 1.0) ** (1 / 2.2)
        if picture is None or "TEXCOORD_0" not in attributes:
            return _Mesh(points @ _AXES.T, triangles, colour, shares)
        uv = np.asarray(file.accessor(attributes["TEXCOORD_0"]), np.float64).reshape(count, 2)
        columns = np.concatenate([points @ _AXES.T, colour, uv, shares], axis=1)
        while len(triangles) < _FINE:
            columns, triangles = _subdivide(columns, triangles)
        sampled = columns[:, 3:6] * _sample_picture(picture, columns[:, 6:8]) / 255.0
        return _Mesh(columns[:, :3], triangles, sampled, columns[:, 8:])

    def _bind_pose(
        self, attributes: dict[str, Any], points: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return points where their nodes have them at rest, and their shares of our joints."""
        assert self.skin is not None
        nodes = np.array([self._rig.place[k] for k in self.skin["joints"]], np.int64)
        moves = self.world[nodes]
        if "inverseBindMatrices" in self.skin:
            moves = moves @ bound_matrices(self._file, self.skin["inverseBindMatrices"], len(nodes))
        which = np.asarray(self._file.accessor(attributes["JOINTS_0"]), np.int64).reshape(-1, 4)
        weights = np.asarray(self._file.accessor(attributes["WEIGHTS_0"]), np.float64).reshape(-1, 4)
        if len(which) != len(points) or len(weights) != len(points) or not 0 <= which.min() <= which.max() < len(nodes):
            raise GltfFault("its skin names joints that are not there; export it anew")
        weights = weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-9)
        full = np.concatenate([points, np.ones((len(points), 1))], axis=1)
        placed = np.einsum("vk,vkrc,vc->vr", weights, moves[which], full)[:, :3]
        shares = np.zeros((len(points), len(JOINTS)))
        for k in range(4):
            np.add.at(shares, (np.arange(len(points)), self._ours[nodes[which[:, k]]]), weights[:, k])
        return placed, shares

    def _material(self, primitive: dict[str, Any]) -> tuple[NDArray[np.uint8] | None, NDArray[np.float64]]:
        """Return the texture, if there is one, and the factor of colours, sRGB, 0..255."""
        material = self._file.entry("materials", primitive["material"]) if "material" in primitive else {}
        rough = material.get("pbrMetallicRoughness", {})
        factor = np.asarray(rough.get("baseColorFactor", (1.0, 1.0, 1.0)), np.float64)[:3]
        srgb = 255.0 * np.clip(factor, 0.0, 1.0) ** (1 / 2.2)
        if "baseColorTexture" not in rough:
            return None, srgb
        texture = self._file.entry("textures", rough["baseColorTexture"]["index"])
        image = self._file.entry("images", texture["source"])
        data = self._file.bytes_at(image["uri"]) if "uri" in image else bytes(self._file.view(image["bufferView"])[0])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            picture = Image.open(io.BytesIO(data), formats=("PNG", "JPEG"))
            if picture.width * picture.height > _MOST_PIXELS:
                raise GltfFault(f"has a texture of {picture.width} x {picture.height} pixels; make it smaller")
            return np.asarray(picture.convert("RGB")), srgb


def _subdivide(columns: NDArray[np.float64], triangles: NDArray[np.int64]) -> tuple[NDArray[Any], NDArray[np.int64]]:
    """Divide each triangle into four; columns of the new vertices are those halfway along its edges."""
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    unique, place = np.unique(edges, axis=0, return_inverse=True)
    a, b, c = triangles.T
    ab, bc, ca = (len(columns) + place.reshape(-1, 3)).T
    new = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    halfway = 0.5 * (columns[unique[:, 0]] + columns[unique[:, 1]])
    return np.concatenate([columns, halfway]), np.concatenate([np.stack(corners, axis=1) for corners in new])


def _sample_picture(picture: NDArray[np.uint8], uv: NDArray[np.float64]) -> NDArray[np.float64]:
    height, width = picture.shape[:2]
    x = np.minimum((uv[:, 0] % 1.0 * width).astype(np.int64), width - 1)
    y = np.minimum((uv[:, 1] % 1.0 * height).astype(np.int64), height - 1)
    return picture[y, x].astype(np.float64)


def _with_head(body: SkinnedBody, mesh: _Mesh) -> SkinnedBody:
    """Return a body with another head, as high as its own from the neck to the crown."""
    own = np.isin(body.weight_joints, [J[name] for name in _HEAD])
    is_head = (body.weights * own).sum(axis=1) > 0.5
    neck = float(body.vertices[is_head & (body.weight_joints[:, 0] == J["head"])][:, 2].min())
    crown = float(body.vertices[is_head][:, 2].max())
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    scale = (crown - neck + _OVERLAP) / (high[2] - low[2])
    middle = 0.5 * (low + high)
    at = body.rest_joints[J["head"]].astype(np.float64)
    points = (mesh.points - [middle[0], middle[1], low[2]]) * scale + [at[0] + _AHEAD, at[1], neck - _OVERLAP]
    kept = ~is_head[body.triangles].all(axis=1)
    joints = np.zeros((len(points), 4), np.int32)
    joints[:, 0] = J["head"]
    weights = np.tile(np.array([1.0, 0.0, 0.0, 0.0], np.float32), (len(points), 1))
    return replace(
        body,
        vertices=np.concatenate([body.vertices, points.astype(np.float32)]),
        normals=np.concatenate([body.normals, _normals(points, mesh.triangles)]),
        triangles=np.concatenate([body.triangles[kept], mesh.triangles + len(body.vertices)]).astype(np.int32),
        colour=np.concatenate([body.colour, np.clip(mesh.colour, 0, 255).astype(np.uint8)]),
        weight_joints=np.concatenate([body.weight_joints, joints]),
        weights=np.concatenate([body.weights, weights]),
    )


# How far a head reaches into the neck, and its middle lies before the head's joint, metres.
_OVERLAP, _AHEAD = 0.02, 0.015


def _whole_body(body: SkinnedBody, mesh: _Mesh, named: dict[str, NDArray[np.float64]]) -> SkinnedBody:
    """Return the body that a skinned mesh is, as tall as another one; that also has the joints that the file lacks."""
    low, high = float(mesh.points[:, 2].min()), float(mesh.points[:, 2].max())
    scale = float(body.height) / (high - low)
    pelvis = named["pelvis"]
    shift = np.array([pelvis[0], pelvis[1], low])
    rest = body.rest_joints.astype(np.float64)
    joints = np.empty_like(rest)
    for k, name in enumerate(JOINTS):
        if name in named:
            joints[k] = (named[name] - shift) * scale
        else:
            joints[k] = joints[PARENTS[k]] + rest[k] - rest[PARENTS[k]]
    frames, stretched = t_pose(joints)
    points = (mesh.points - shift) * scale
    order = np.argsort(-mesh.shares, axis=1, kind="stable")[:, :4]
    weights = np.take_along_axis(mesh.shares, order, axis=1)
    weights /= np.maximum(weights.sum(axis=1, keepdims=True), 1e-9)
    return SkinnedBody(
        points.astype(np.float32),
        _normals(points, mesh.triangles),
        mesh.triangles.astype(np.int32),
        np.clip(mesh.colour, 0, 255).astype(np.uint8),
        order.astype(np.int32),
        weights.astype(np.float32),
        joints.astype(np.float32),
        frames,
        stretched,
        body.height,
    )


def _normals(points: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.float32]:
    """Return the vertices' normals, those of points that coincide joined: seams of textures do not show."""
    _, same = np.unique(np.round(points, 6), axis=0, return_inverse=True)
    same = same.reshape(-1)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    faces = np.cross(b - a, c - a)
    total = np.zeros((int(same.max()) + 1, 3))
    for k in range(3):
        np.add.at(total, same[triangles[:, k]], faces)
    normals = total[same]
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12), np.float32)
