"""SMPL-X parameters in and out: AMASS files (``.npz``), and arrays.

SMPL-X looks along z with y up, and so do the axes its joints turn about; ours look along x with z up. Its world, in
AMASS, has z up as ours has. Shapes (betas) and expressions are not motion, and are left.
"""

from __future__ import annotations

import io
import zipfile
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.motions.clip import HIP_HEIGHT, MotionClip, ground_motion, rotation_matrices, rotation_vectors
from vico.assets.people import JOINTS, J
from vico.errors import InputError, MissingFileError, SchemaError
from vico.io.arrays import read_npz

#: Pelvis height of the mean SMPL-X body in the T-pose, metres; its translations are for a body of that size.
_SMPLX_HIP_HEIGHT = 0.95
_MOST_BYTES = 1 << 30
#: Names under which archives keep their frame rate.
_RATES = ("mocap_frame_rate", "mocap_framerate", "mocap_fps", "framerate", "frame_rate", "fps")
#: Names under which archives keep the translation, AMASS's first.
_TRANSLATIONS = ("trans", "transl", "translation", "root_trans", "root_translation", "root_transl", "smpl_trans")
#: Parts of the names of arrays that may be a translation under another name.
_LIKE_TRANSLATION = ("trans", "root_pos", "root_loc", "pelvis", "location")
#: Parts under which archives keep the pose, in the order of the joints, and how many joints each has.
_PARTS = {"root_orient": 1, "pose_body": 21, "pose_jaw": 1, "pose_eye": 2, "pose_hand": 30}

# Rows: our axes (forward, left, up) in those of an SMPL-X body (left, up, forward).
_AXES = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
_BODY, _HANDS = 21, 30
# Joints of full poses.
_WHOLE = 55  # SMPL-X: with jaw and eyes
_WITHOUT_FACE = 52  # SMPL-H
_WITHOUT_HANDS = 24  # SMPL: its two hand joints rest


def motion_from_smplx(
    poses: NDArray[Any], translation: NDArray[Any], rate: float, *, name: str = "motion"
) -> MotionClip:
    """Return a motion from SMPL-X, SMPL-H or SMPL parameters.

    Parameters
    ----------
    poses
        Axis-angle of all joints, the pelvis first, radians, shape ``(t, 165)`` (SMPL-X), ``(t, 156)`` (SMPL-H) or
        ``(t, 72)`` (SMPL).
    translation
        Metres, z up, shape ``(t, 3)``.
    rate
        Frames a second.

    Raises
    ------
    InputError
        If the shapes are others.
    """
    poses = np.asarray(poses, np.float64)
    if poses.ndim != 2 or poses.shape[1] not in (3 * _WHOLE, 3 * _WITHOUT_FACE, 3 * _WITHOUT_HANDS):
        raise InputError(
            f"motion {name!r}: poses have shape {poses.shape}; they have to be (t, 165) of SMPL-X, (t, 156) of SMPL-H "
            "or (t, 72) of SMPL"
        )
    if not len(poses):
        raise InputError(f"motion {name!r} has no frame; take a file with at least one")
    given = poses.reshape(len(poses), -1, 3)
    if not np.isfinite(given).all():
        raise InputError(f"motion {name!r}: poses hold numbers that are not finite; repair the file")
    joints = np.zeros((len(poses), len(JOINTS), 3))
    joints[:, : 1 + _BODY] = given[:, : 1 + _BODY]
    if given.shape[1] == _WHOLE:
        joints[:, 1 + _BODY :] = given[:, 1 + _BODY :]
    elif given.shape[1] == _WITHOUT_FACE:
        joints[:, -_HANDS:] = given[:, -_HANDS:]
    return MotionClip(
        name,
        float(rate),
        np.asarray(translation, np.float32) * np.float32(HIP_HEIGHT / _SMPLX_HIP_HEIGHT),
        rotation_vectors(rotation_matrices(joints[:, 0]) @ _AXES.T),
        np.asarray(joints[:, 1:] @ _AXES.T, np.float32),
    )


def smplx_of(clip: MotionClip) -> dict[str, NDArray[np.float32]]:
    """Return a motion as SMPL-X parameters, under the names of AMASS.

    Returns
    -------
    dict
        ``poses``, radians, shape ``(t, 165)``; of them ``root_orient`` ``(t, 3)``, ``pose_body`` ``(t, 63)``,
        ``pose_jaw`` ``(t, 3)``, ``pose_eye`` ``(t, 6)``, ``pose_hand`` ``(t, 90)``; ``trans``, metres, ``(t, 3)``;
        and ``mocap_frame_rate``.
    """
    root = rotation_vectors(rotation_matrices(clip.orientation) @ _AXES)
    rest = np.asarray(clip.pose.astype(np.float64) @ _AXES, np.float32)
    poses = np.concatenate([root[:, None], rest], axis=1).reshape(len(clip), -1)
    parts = {"root_orient": (0, 1), "pose_body": (1, 22), "pose_jaw": (22, 23), "pose_eye": (23, 25)}
    found = {part: poses[:, 3 * first : 3 * end] for part, (first, end) in parts.items()}
    return found | {
        "pose_hand": poses[:, 3 * J["left_index1"] :],
        "poses": poses,
        "trans": clip.position * np.float32(_SMPLX_HIP_HEIGHT / HIP_HEIGHT),
        "mocap_frame_rate": np.array(clip.rate, np.float32),
    }


def read_amass(path: Path) -> MotionClip:
    """Read a motion of AMASS: an ``.npz`` with ``poses`` or its parts, ``trans`` and a frame rate.

    Of the parts ``root_orient`` and ``pose_body`` have to be there; jaw, eyes and hands rest without theirs. Without
    ``trans`` (or ``transl`` or another usual name of it) it stays on the spot, on the ground where its feet are lowest.
    Nothing is unpickled, and other arrays are not read.

    Raises
    ------
    MissingFileError
        If there is no such file.
    SchemaError
        If it is no such archive.
    InputError
        If its arrays have other shapes, or it has no frame.
    """
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise SchemaError(f"{path}: larger than {_MOST_BYTES >> 20} MiB; cut it into pieces")
        packed = path.read_bytes()
        if not packed.startswith(b"PK"):
            what = "is empty" if not packed else "is no .npz archive, whatever its name"
            raise SchemaError(f"{path}: {what}; save its poses, trans and mocap_frame_rate with numpy.savez")
        data = read_npz(packed, ("poses", *_PARTS, *_TRANSLATIONS, *_RATES))
        rate = next((np.asarray(data[key], np.float64) for key in _RATES if key in data), None)
        if rate is None or rate.size != 1 or not ("poses" in data or {"root_orient", "pose_body"} <= data.keys()):
            raise SchemaError(
                f"{path}: no motion of AMASS (poses, or root_orient and pose_body; mocap_frame_rate, one number); "
                f"it holds {_member_names(packed)}"
            )
        poses = data["poses"] if "poses" in data else _full_pose(data)
        name = next((name for name in _TRANSLATIONS if name in data), None)
        if name is not None:
            clip = motion_from_smplx(poses, data[name], rate.item(), name=path.stem)
            said = f"its translation is {name}, taken for AMASS's trans: metres, z up"
            return clip if name == "trans" else replace(clip, notes=(said,))
        if like := [name for name in _names(packed) if any(part in name.lower() for part in _LIKE_TRANSLATION)]:
            raise SchemaError(f"{path}: has no trans, but {', '.join(like[:4])}; save its translation as trans")
        return ground_motion(motion_from_smplx(poses, np.zeros((len(poses), 3)), rate.item(), name=path.stem))
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file") from None
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except (ValueError, OSError, EOFError, TypeError, zipfile.BadZipFile, zlib.error) as error:
        if isinstance(error, SchemaError):
            raise
        if "allow_pickle" in str(error):
            raise SchemaError(
                f"{path}: no readable .npz of plain arrays: one holds Python objects, which are not read; save it as "
                "an array of numbers"
            ) from None
        raise SchemaError(f"{path}: no readable .npz of plain arrays ({error})") from None


def _full_pose(data: dict[str, NDArray[Any]]) -> NDArray[np.float64]:
    """Return the pose of all joints, radians, shape ``(t, 165)``; parts that are not there rest."""
    frames = len(np.atleast_1d(data["root_orient"]))
    parts = []
    for part, joints in _PARTS.items():
        array = np.asarray(data.get(part, np.zeros((frames, 3 * joints))), np.float64)
        if array.shape not in ((frames, 3 * joints), (frames, joints, 3)):
            raise InputError(f"{part} has shape {array.shape}; it has to be ({frames}, {3 * joints})")
        parts.append(array.reshape(frames, 3 * joints))
    return np.concatenate(parts, axis=1)


def _names(packed: bytes) -> list[str]:
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        return [name.removesuffix(".npy") for name in archive.namelist()]


def _member_names(packed: bytes) -> str:
    """Return the names of an archive's arrays, none of which is read."""
    names = _names(packed)
    return ", ".join(names[:20]) + (f" and {len(names) - 20} more" if len(names) > 20 else "") or "none of them"
