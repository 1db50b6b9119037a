"""People's limbs as capsules: what throws their shadows. Where each lies in a body, and how thick it is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.people import JOINTS, SkinnedBody
from vico.assets.people.model import J

# Both ends of each capsule: a joint, another joint, and how far on the way from the one to the other the end lies.
_End = tuple[str, str, float]
_ENDS: dict[str, tuple[_End, _End]] = {
    "head": (("neck", "neck", 0.0), ("head", "head", 0.0)),  # its end goes to the middle of the head
    # Two beside each other: bodies are broader than deep.
    "left_torso": (("left_hip", "right_hip", 0.25), ("left_shoulder", "right_shoulder", 0.3)),
    "right_torso": (("right_hip", "left_hip", 0.25), ("right_shoulder", "left_shoulder", 0.3)),
}
for _side in ("left", "right"):
    for _name, _first, _second, _way in (
        ("upper_arm", "shoulder", "elbow", 1.0),
        ("forearm", "elbow", "middle1", 1.1),
        ("thigh", "hip", "knee", 1.0),
        ("shin", "knee", "ankle", 1.0),
        ("foot", "ankle", "foot", 1.35),
    ):
        _joints = f"{_side}_{_first}", f"{_side}_{_second}"
        _ENDS[f"{_side}_{_name}"] = (*_joints, 0.0), (*_joints, _way)
LIMBS = tuple(_ENDS)
HEAD = LIMBS.index("head")
#: Column of a limb, as `PosedAvatars` has it, of its radius: after both ends.
LIMB_RADIUS = 6
# Joints of both ends, shape (limbs, 2, 2), and how far from the one to the other, shape (limbs, 2).
LIMB_JOINTS = np.array([[[J[a], J[b]] for a, b, _ in ends] for ends in _ENDS.values()], np.int32)
LIMB_WAYS = np.array([[way for *_, way in ends] for ends in _ENDS.values()], np.float32)
# Vertices that thickness is measured by: every so manyth; and what it is where there are none, metres.
_STRIDE, _THIN = 3, 0.05


def _limb_of_joint(name: str) -> int:
    side = "right" if name.startswith("right") else "left"
    part = name.removeprefix(f"{side}_")
    if part in ("head", "neck", "jaw", "eye"):
        return HEAD
    limb = {
        "shoulder": "upper_arm",
        "elbow": "forearm",
        "hip": "thigh",
        "knee": "shin",
        "ankle": "foot",
        "foot": "foot",
    }.get(part, "forearm" if part.rstrip("123") not in ("pelvis", "spine", "collar") else "torso")
    return LIMBS.index(f"{side}_{limb}")


_LIMB_OF = np.array([_limb_of_joint(name) for name in JOINTS], np.int64)
_HANDS = np.array([name.rpartition("_")[2].rstrip("123") in ("wrist", "index", "middle", "pinky", "ring", "thumb")
                   for name in JOINTS])  # fmt: skip


class LimbSizes(NamedTuple):
    """How large the capsules of some bodies are.

    Attributes
    ----------
    radius
        Metres, float32, shape ``(n, limbs)``.
    head
        The middle of the head, from the joint of that name in the T-pose, metres, float32, shape ``(n, 3)``.
    """

    radius: NDArray[np.float32]
    head: NDArray[np.float32]


def limb_sizes(bodies: list[SkinnedBody]) -> LimbSizes:
    """Measure bodies in the pose that their meshes rest in, with what they wear."""
    known: dict[int, tuple[NDArray[np.float32], NDArray[np.float32]]] = {}
    for body in bodies:
        if id(body) not in known:
            known[id(body)] = _sizes_of(body)
    return LimbSizes(
        np.array([known[id(body)][0] for body in bodies], np.float32).reshape(-1, len(LIMBS)),
        np.array([known[id(body)][1] for body in bodies], np.float32).reshape(-1, 3),
    )


def _sizes_of(body: SkinnedBody) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the radii of one body's limbs, and the middle of its head."""
    rest, some = body.rest_joints, slice(None, None, _STRIDE)
    points, joint = body.vertices[some], body.weight_joints[some, 0]
    limb = _LIMB_OF[joint]
    torso = LIMBS.index("left_torso")
    limb = np.where((limb == torso) & (points[:, 1] < 0), LIMBS.index("right_torso"), limb)
    own = points[limb == HEAD]
    middle = (own.min(axis=0) + own.max(axis=0)) / 2 - rest[J["head"]] if len(own) else np.zeros(3)
    ends = limb_ends(rest.astype(np.float64), middle)
    start, along = ends[limb, 0], (ends[:, 1] - ends[:, 0])[limb]
    off = points - start
    way = (off * along).sum(axis=1) / np.maximum((along * along).sum(axis=1), 1e-9)
    away = np.linalg.norm(off - np.clip(way, 0.0, 1.0)[:, None] * along, axis=1)
    # Fingers have most of an arm's vertices, and are not what it is as thick as.
    counted = ~_HANDS[joint]
    count = np.bincount(limb[counted], minlength=len(LIMBS))
    total = np.bincount(limb[counted], away[counted], minlength=len(LIMBS))
    radius = np.where(count > 0, total / np.maximum(count, 1), _THIN)
    return radius.astype(np.float32), np.asarray(middle, np.float32)


def limb_ends(joints: NDArray[np.float64], head: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return both ends of each limb of a body whose head is upright, metres, shape ``(limbs, 2, 3)``."""
    first, second = joints[LIMB_JOINTS[..., 0]], joints[LIMB_JOINTS[..., 1]]
    ends = first + LIMB_WAYS[..., None] * (second - first)
    ends[HEAD, 1] += head
    return np.asarray(ends)
