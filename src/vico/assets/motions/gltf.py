"""Motions from glTF files (``.glb``, ``.gltf``), as Mixamo's characters come out of Blender or FBX2glTF."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from vico.assets.motions.clip import MOST_FRAMES, MotionClip
from vico.assets.motions.retargeting import Skeleton, joints_by_name, retarget
from vico.errors import MissingFileError, SchemaError
from vico.io.gltf_file import GltfFault, GltfFile, gltf_errors, node_matrix

_RATE = 30.0
_MOST_BYTES = 1 << 30
_MOST_NODES = 10_000


def read_gltf_motion(path: Path, *, animation: str = "") -> MotionClip:
    """Read a motion from a glTF file; its skeleton is found by the joints' names.

    Parameters
    ----------
    animation
        Name of one of its animations; the first without.

    Raises
    ------
    MissingFileError
        If there is no such file.
    SchemaError
        If it is damaged, or has no such animation.
    InputError
        If its skeleton is no person's.
    """
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise SchemaError(f"{path}: larger than {_MOST_BYTES >> 20} MiB; leave its meshes out")
        data = path.read_bytes()
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file") from None
    with gltf_errors(str(path)):
        rig = Rig(GltfFile.of(data, lambda uri: _beside(path, uri)))
        name, tracks = rig.tracks(animation)
        first = min(float(times[0]) for times, _, _ in tracks.values())
        last = max(float(times[-1]) for times, _, _ in tracks.values())
        count = round((last - first) * _RATE) + 1
        if not (math.isfinite(first) and math.isfinite(last)) or not 1 <= count <= MOST_FRAMES:
            raise GltfFault(f"its animation goes from {first} to {last} s; cut it into pieces")
        times = first + np.arange(count) / _RATE
        moving = rig.moving(tracks, times)
        rest = rig.rest()
    skeleton = Skeleton(rig.names, rig.parents, rest[:, :3, 3])
    pelvis = joints_by_name(skeleton, source=str(path))["pelvis"]
    turned = _rotations(moving) @ np.swapaxes(_rotations(rest), -1, -2)
    return retarget(skeleton, turned, moving[:, pelvis, :3, 3], _RATE, name=name or path.stem, source=str(path))


def _beside(path: Path, uri: str) -> bytes:
    """Return a file beside the document; nothing elsewhere is read."""
    if "/" in uri or "\\" in uri or uri.startswith(".") or ":" in uri:
        raise GltfFault(f"refers to {uri[:80]!r} outside its folder; export it as one .glb file")
    beside = path.with_name(uri)
    if not beside.is_file() or beside.stat().st_size > _MOST_BYTES:
        raise GltfFault(f"refers to {uri[:80]!r}, which is not there or too large; export it as one .glb file")
    return beside.read_bytes()


def _rotations(transforms: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotations in transforms, without their scales, shape ``(..., 3, 3)``."""
    u, _, v = np.linalg.svd(transforms[..., :3, :3])
    u[..., :, 2] *= np.sign(np.linalg.det(u @ v))[..., None]
    return np.asarray(u @ v)


Tracks = dict[tuple[int, str], tuple[NDArray[np.float64], NDArray[np.float64], str]]


class Rig:
    """The nodes of a document, parents before children."""

    def __init__(self, file: GltfFile) -> None:
        self._file = file
        nodes = file.document.get("nodes", [])
        if not 0 < len(nodes) <= _MOST_NODES:
            raise GltfFault(f"has {len(nodes)} nodes; a rig has 1..{_MOST_NODES}")
        above = np.full(len(nodes), -1, np.int64)
        for k, node in enumerate(nodes):
            for child in node.get("children", []):
                if not isinstance(child, int) or not 0 <= child < len(nodes) or above[child] >= 0:
                    raise GltfFault(f"node {k} has a child that is not there or has two parents; export it anew")
                above[child] = k
        order = [k for k in range(len(nodes)) if above[k] < 0]
        for k in order:  # grows while it is gone through
            order += nodes[k].get("children", [])
        if len(order) != len(nodes):
            raise GltfFault("has nodes that are their own ancestors; export it anew")
        place = {k: at for at, k in enumerate(order)}
        self._order, self._nodes = order, [nodes[k] for k in order]
        #: Where each node of the document is among these.
        self.place = place
        self.parents = np.array([place[int(above[k])] if above[k] >= 0 else -1 for k in order], np.int64)
        self.names = tuple(str(node.get("name", f"node {k}")) for k, node in zip(order, self._nodes, strict=True))

    def tracks(self, wanted: str) -> tuple[str, Tracks]:
        """Return the name and the tracks of an animation: times, values and interpolation by node and path."""
        animations = self._file.document.get("animations", [])
        names = [str(entry.get("name", "")) for entry in animations]
        if not animations or (wanted and wanted not in names):
            there = ", ".join(name or "one without a name" for name in names) or "none"
            raise GltfFault(f"has no animation {wanted!r}; it has {there}" if wanted else "has no animation")
        animation = animations[names.index(wanted) if wanted else 0]
        place, tracks = {k: at for at, k in enumerate(self._order)}, {}
        for channel in animation["channels"]:
            target, sampler = channel["target"], animation["samplers"][channel["sampler"]]
            if target.get("path") not in ("translation", "rotation") or "node" not in target:
                continue
            times = np.asarray(self._file.accessor(sampler["input"]), np.float64)
            values = np.asarray(self._file.accessor(sampler["output"]), np.float64)
            how = str(sampler.get("interpolation", "LINEAR"))
            if how == "CUBICSPLINE":  # without its tangents, frame by frame: rigs are baked densely
                values = values.reshape(len(times), 3, -1)[:, 1]
            width = 4 if target["path"] == "rotation" else 3
            if times.ndim != 1 or not len(times) or values.shape != (len(times), width) or (np.diff(times) <= 0).any():
                raise GltfFault("a track has no ascending times with a value each; export it anew")
            tracks[place[target["node"]], target["path"]] = times, values, how
        if not tracks:
            raise GltfFault("its animation moves no joint; export it anew")
        return names[animations.index(animation)], tracks

    def moving(self, tracks: Tracks, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where the nodes are at some moments, to the world, shape ``(t, n, 4, 4)``."""
        world = np.empty((len(times), len(self._nodes), 4, 4))
        for k, node in enumerate(self._nodes):
            own = np.tile(node_matrix(node), (len(times), 1, 1))
            if (k, "rotation") in tracks:
                scale = np.asarray(node.get("scale", (1.0, 1.0, 1.0)), np.float64)
                own[:, :3, :3] = _turns(*tracks[k, "rotation"], times) * scale
            if (k, "translation") in tracks:
                own[:, :3, 3] = _moves(*tracks[k, "translation"], times)
            parent = self.parents[k]
            world[:, k] = own if parent < 0 else world[:, parent] @ own
        return world

    def rest(self) -> NDArray[np.float64]:
        """Return where the nodes are at rest, to the world: as its skin is bound, else as the nodes stand."""
        standing = self.moving({}, np.zeros(1))[0]
        skins = self._file.document.get("skins", [])
        if not skins or "inverseBindMatrices" not in skins[0]:
            return standing
        place = {k: at for at, k in enumerate(self._order)}
        joints = [place[k] for k in skins[0]["joints"]]
        bound = np.linalg.inv(bound_matrices(self._file, skins[0]["inverseBindMatrices"], len(joints)))
        top = min(joints)
        above = standing[self.parents[top]] if self.parents[top] >= 0 else np.eye(4)
        rest = standing.copy()
        rest[joints] = above @ bound
        # Bones are as long at rest as they are in motion: skins may be bound in another unit.
        pairs = [(k, int(self.parents[k])) for k in joints if self.parents[k] in joints]
        lengths = [sum(float(np.linalg.norm(w[a, :3, 3] - w[b, :3, 3])) for a, b in pairs) for w in (standing, rest)]
        if min(lengths) > 0:
            rest[:, :3, 3] *= lengths[0] / lengths[1]
        return rest


def bound_matrices(file: GltfFile, index: int, count: int) -> NDArray[np.float64]:
    """Return an accessor's 4 x 4 matrices."""
    found = np.asarray(file.accessor(index), np.float64)
    if found.shape != (count, 16) or not np.isfinite(found).all():
        raise GltfFault("its skin is bound by no matrices; export it anew")
    return np.swapaxes(found.reshape(count, 4, 4), 1, 2)


def _turns(times: NDArray[np.float64], values: NDArray[np.float64], how: str, at: NDArray[np.float64]) -> Any:
    turned = Rotation.from_quat(values)
    if len(times) == 1:
        return np.tile(turned.as_matrix(), (len(at), 1, 1))
    held = np.clip(at, times[0], times[-1])
    if how == "STEP":
        return turned[np.searchsorted(times, held, side="right") - 1].as_matrix()
    return Slerp(times, turned)(held).as_matrix()


def _moves(times: NDArray[np.float64], values: NDArray[np.float64], how: str, at: NDArray[np.float64]) -> Any:
    if how == "STEP":
        return values[np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 1)]
    return np.stack([np.interp(at, times, values[:, k]) for k in range(3)], axis=1)
