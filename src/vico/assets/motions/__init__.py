"""Recorded motions: a clip on the 55 joints of SMPL-X, and readers of the files that users bring."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from vico.assets.motions.bvh import read_bvh
from vico.assets.motions.clip import HIP_HEIGHT, MotionClip, read_motion
from vico.assets.motions.gltf import read_gltf_motion
from vico.assets.motions.smplx import motion_from_smplx, read_amass, smplx_of
from vico.errors import InputError

_READERS: dict[str, Callable[[Path], MotionClip]] = {
    ".bvh": read_bvh,
    ".npz": read_amass,
    ".glb": read_gltf_motion,
    ".gltf": read_gltf_motion,
    ".motion": read_motion,
}


def import_motion(path: Path) -> MotionClip:
    """Read a motion from a BVH, AMASS (``.npz``) or glTF file, or one of our own (``.motion``).

    Raises
    ------
    InputError
        If the file is of another kind, or its skeleton is no person's.
    SchemaError
        If it is damaged.
    """
    reader = _READERS.get(path.suffix.lower())
    if path.suffix.lower() in (".pkl", ".pickle"):
        raise InputError(
            f"{path}: pickles run code when they are read, and are not; save its poses, trans and "
            "mocap_frame_rate with numpy.savez"
        )
    if reader is None:
        raise InputError(
            f"{path}: motions are read from {', '.join(_READERS)}; convert FBX files first, for example with Blender's "
            "glTF export or FBX2glTF"
        )
    return reader(path)


__all__ = [
    "HIP_HEIGHT",
    "MotionClip",
    "import_motion",
    "motion_from_smplx",
    "read_amass",
    "read_bvh",
    "read_gltf_motion",
    "read_motion",
    "smplx_of",
]
