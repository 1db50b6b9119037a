"""Motions of other skeletons on ours: joints are turned by how the bones rest.

Which joints of a file stand for ours is found by the names that programs give them.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from vico.assets.motions.clip import HIP_HEIGHT, Matrices, MotionClip, ground_motion, rotation_between, rotation_vectors
from vico.assets.people import FINGERS, JOINTS, PARENTS, J
from vico.errors import InputError

# Biped numbers its fingers from the thumb: Finger1 is the index finger's first joint, Finger11 its second.
_BIPED_FINGERS = {"thumb": 0, "index": 1, "middle": 2, "ring": 3, "pinky": 4}
_PHALANGES = ("proximal", "intermediate", "distal")


def _finger_words(finger: str, k: int) -> tuple[str, ...]:
    names = (finger, "little") if finger == "pinky" else (finger,)
    words = [
        word for name in names for word in (f"hand{name}{k}", f"{name}{k}", f"{name}0{k}", name + _PHALANGES[k - 1])
    ]
    return (*words, f"finger{_BIPED_FINGERS[finger]}{k - 1 or ''}")


# Words that files call our joints by, without side, prefix and number; the first that fits is taken.
_NAMES: dict[str, tuple[str, ...]] = {
    "hip": ("hip", "upleg", "upperleg", "legupper", "thigh", "femur", "hipjoint"),
    "knee": ("knee", "leg", "lowerleg", "lowleg", "leglower", "calf", "shin", "tibia"),
    "ankle": ("ankle", "foot"),
    "foot": ("toebase", "toe", "ball", "toes", "toe0", "foot"),  # beside an ankle, as SMPL has it
    "collar": ("collar", "clavicle", "shoulder"),
    "shoulder": ("arm", "uparm", "upperarm", "armupper", "uarm", "shldr", "shoulder", "humerus"),
    "elbow": ("elbow", "forearm", "lowarm", "lowerarm", "armlower", "farm", "radius"),
    "wrist": ("wrist", "hand"),
    **{f"{finger}{k}": _finger_words(finger, k) for finger in FINGERS for k in (1, 2, 3)},
}
_PELVIS = ("hips", "pelvis", "hip", "spinebase", "root")
_NECK, _HEAD = ("neck", "lowerneck", "necklower", "upperneck"), ("head",)
# Vertebrae: lumbar and thoracic ones, as Xsens names them.
_SPINE = re.compile(
    r"(spine|abdomen|ab|belly|chest|upperchest|lowerback|upperback|torso|thorax|waist)"
    r"(lower|upper|mid|chest|navel|shoulder)?\d*|[lt]\d{1,2}"
)
_LIMB_WORDS = frozenset(word for words in _NAMES.values() for word in words)
_KNOWN = _LIMB_WORDS | {*_PELVIS, *_NECK, *_HEAD}
_ARMS = ("arm", "uparm", "upperarm", "armupper", "uarm", "shldr")

_SIDES = {"l": "left", "left": "left", "r": "right", "right": "right"}
# Mixamo numbers its prefix when a file holds several figures, and programs take its colon away.
_PREFIX = re.compile(r"(mixamorig\d*|bip\d+|armature)")
# Parts of a name that say that it stands in the middle (C_hips, root.x), or is a bone that bends or stretches.
_FILLERS = frozenset(("c", "m", "x", "cn", "center", "centre", "bend", "stretch", "bind", "def"))
# Boundaries of words within a name: leftArm, Spine1Roll, LThumb.
_CAMEL = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
#: Without these there is no person.
_NEEDED = (
    "pelvis",
    "head",
    *(f"{side}_{part}" for side in ("left", "right") for part in ("hip", "knee", "shoulder", "elbow")),
)


@dataclass(frozen=True)
class Skeleton:
    """Joints of a file at rest.

    Attributes
    ----------
    names
        Of the joints; a parent comes before its children.
    parents
        Index of each joint's parent, -1 for roots, shape ``(n,)``.
    places
        Where each is at rest, in the file's axes and unit, shape ``(n, 3)``.
    """

    names: tuple[str, ...]
    parents: NDArray[np.int64]
    places: NDArray[np.float64]


def joints_by_name(skeleton: Skeleton, *, source: str) -> dict[str, int]:
    """Return which of the file's joints stand for ours.

    Raises
    ------
    InputError
        If one that a person cannot do without is not found.
    """
    words = _words(skeleton.names)
    found: dict[str, int] = {}
    middle = {"pelvis": _PELVIS, "neck": _NECK, "head": _HEAD}
    if ("", "spine006") in words:  # Rigify calls the whole chain so, from the pelvis to the head
        middle = {"pelvis": (*_PELVIS, "spine"), "neck": (*_NECK, "spine004"), "head": (*_HEAD, "spine006")}
    for ours, options in middle.items():
        hits = [k for option in options for k, word in enumerate(words) if word == ("", option)]
        if hits:
            found[ours] = hits[0]
    for side in ("left", "right"):
        taken: set[int] = set()
        for part, options in _words_by_part(words, side):
            hits = [
                k for option in options for k, word in enumerate(words) if word == (side, option) and k not in taken
            ]
            if hits:
                found[f"{side}_{part}"] = hits[0]
                taken.add(hits[0])
    missing = [name for name in _NEEDED if name not in found]
    if missing:
        there = ", ".join(skeleton.names[:20])
        raise InputError(
            f"{source}: no joint stands for {', '.join(missing)}; it has {there}. "
            "Rename its joints as Mixamo or SMPL-X do, or give a file of a whole person"
        )
    return found | _spine(skeleton, words, found)


def _words_by_part(words: list[tuple[str, str]], side: str) -> list[tuple[str, tuple[str, ...]]]:
    """Return our parts and their words: where an arm is called so, `shoulder` is the collar bone."""
    has_arm = any((side, arm) in words for arm in _ARMS)
    # Fingers counted from 1 begin with the thumb or with the index, who knows; Biped's begin with 0.
    counted = (side, "finger0") in words
    return [
        (
            part,
            tuple(
                word
                for word in options
                if (word != "shoulder" or has_arm == (part == "collar")) and (counted or not word.startswith("finger"))
            ),
        )
        for part, options in _NAMES.items()
    ]


def _words(names: Sequence[str]) -> list[tuple[str, str]]:
    """Return side ("left", "right" or "") and the word of each joint's name, in small letters."""
    split = [_parts(name) for name in names]
    numbers = [parts[-1] for parts in split if len(parts) > 1 and parts[-1].isdigit()]
    # Programs number all nodes to keep their names apart: Hips_01, LeftUpLeg_055.
    if 2 * len(numbers) >= len(split) and 5 * len(set(numbers)) > 4 * len(numbers):
        split = [parts[:-1] if len(parts) > 1 and parts[-1].isdigit() else parts for parts in split]
    for at in (0, -1):  # a prefix, such as the figure's name; a suffix, such as _jnt
        while common := _common(split, at):
            split = [
                (parts[1:] if at == 0 else parts[:-1]) if len(parts) > 1 and parts[at] == common else parts
                for parts in split
            ]
    return [_word(parts) for parts in split]


def _parts(name: str) -> list[str]:
    """Return the parts of a name, without namespaces and what is known as prefixes."""
    own = _CAMEL.sub("_", re.split(r"[:|/]", name)[-1]).lower()
    parts = (_PREFIX.sub("", part, count=1) if _PREFIX.match(part) else part for part in re.split(r"[^a-z0-9]+", own))
    return [part for part in parts if part]


def _common(split: list[list[str]], at: int) -> str:
    """Return the part that most names begin or end with, "" if there is none."""
    counts = Counter(parts[at] for parts in split if len(parts) > 1)
    part, count = counts.most_common(1)[0] if counts else ("", 0)
    means = part in _SIDES or part in _KNOWN or part.isdigit()
    return "" if means or 2 * count <= len(split) else part


def _word(parts: list[str]) -> tuple[str, str]:
    side, rest = "", []
    for part in parts:
        if part in _SIDES:
            side = _SIDES[part]
            continue
        for long in ("left", "right"):
            if part.startswith(long) or part.endswith(long):
                side, part = long, part.removeprefix(long).removesuffix(long)
        if part not in _FILLERS:
            rest.append(part)
    word = "".join(rest)
    if not side and word not in _KNOWN and word[:1] in ("l", "r") and word[1:] in _LIMB_WORDS:  # lfemur
        side, word = _SIDES[word[0]], word[1:]
    first = re.fullmatch(r"([a-z]+)0*1", word)  # the first of several: upperarm01, neck_01
    if first is not None and word not in _KNOWN and first[1] in _KNOWN:
        word = first[1]
    return side, word


def _spine(skeleton: Skeleton, words: list[tuple[str, str]], found: dict[str, int]) -> dict[str, int]:
    """Return which joints between pelvis and neck stand for our three of the spine."""
    chain: list[int] = []
    k = int(skeleton.parents[found.get("neck", found["head"])])
    while k >= 0 and k != found["pelvis"]:
        if _SPINE.fullmatch(words[k][1]):
            chain.append(k)
        k = int(skeleton.parents[k])
    chain.reverse()
    if not chain:
        return {}
    picked = {1: (0,), 2: (0, 1)}.get(len(chain), (0, len(chain) // 2, len(chain) - 1))
    ours = {1: ("spine2",), 2: ("spine1", "spine3")}.get(len(chain), ("spine1", "spine2", "spine3"))
    return {name: chain[at] for name, at in zip(ours, picked, strict=True)}


# Where bones point in the T-pose from the joint of this name to the next one along the limb.
_DOWN, _LEFT = np.array([0.0, 0.0, -1.0]), np.array([0.0, 1.0, 0.0])
_LIMBS = {
    "hip": ("knee", _DOWN),
    "knee": ("ankle", _DOWN),
    "shoulder": ("elbow", _LEFT),
    "elbow": ("wrist", _LEFT),
    "wrist": ("middle1", _LEFT),
    **{f"{finger}{k}": (f"{finger}{k + 1}", _LEFT) for finger in FINGERS[:-1] for k in (1, 2)},
}


def retarget(
    skeleton: Skeleton, turned: Matrices, root: NDArray[np.float64], rate: float, *, name: str, source: str
) -> MotionClip:
    """Return the motion of another skeleton on ours, its feet on the ground.

    Parameters
    ----------
    turned
        How each joint is turned from its rest, in the file's axes, shape ``(t, n, 3, 3)``.
    root
        Where the joint that stands for the pelvis is, in the file's axes and unit, shape ``(t, 3)``.
    rate
        Frames a second.
    source
        The file, for errors.

    Raises
    ------
    InputError
        If the skeleton is no person's.
    """
    joints = joints_by_name(skeleton, source=source)
    axes, hips = _limb_frame(skeleton, joints, source)
    rest = _rest_rotations(skeleton, joints, axes)
    frames = len(turned)
    world = np.empty((frames, len(JOINTS), 3, 3))
    for k, ours in enumerate(JOINTS):
        if ours in joints:
            world[:, k] = axes @ turned[:, joints[ours]] @ axes.T @ rest[k]
        else:
            world[:, k] = world[:, PARENTS[k]] if k else np.eye(3)
    local = np.swapaxes(world[:, PARENTS[1:]], -1, -2) @ world[:, 1:]
    position = (root @ axes.T) * (HIP_HEIGHT / hips)
    return ground_motion(
        MotionClip(name, rate, np.asarray(position, np.float32), rotation_vectors(world[:, 0]), rotation_vectors(local))
    )


def _limb_frame(skeleton: Skeleton, joints: dict[str, int], source: str) -> tuple[Matrices, float]:
    """Return the rotation from the file's axes to forward, left, up, and how high the hips are above the soles."""
    at = {name: skeleton.places[k] for name, k in joints.items()}
    hips = (at["left_hip"] + at["right_hip"]) / 2
    left, up = at["left_hip"] - at["right_hip"], at["head"] - hips
    forward = np.cross(left, up)
    height = float(np.linalg.norm(up))
    if min(np.linalg.norm(left), np.linalg.norm(forward)) < 1e-3 * height or height <= 0:
        raise InputError(f"{source}: its skeleton at rest is no standing person; export it with a T-pose at rest")
    # The file's own axes are upright: the nearest of them to where the head and the left are.
    rough = [forward, left, up]
    axes = np.zeros((3, 3))
    for row, way in ((2, up), (1, left)):
        free = [k for k in range(3) if not axes[:, k].any()]
        k = max(free, key=lambda axis: abs(way[axis]))
        axes[row, k] = np.sign(way[k])
    axes[0] = np.cross(axes[1], axes[2])
    if float(axes[0] @ rough[0]) <= 0:
        raise InputError(f"{source}: its skeleton at rest is twisted; export it with a T-pose at rest")
    legs = [
        sum(float(np.linalg.norm(at[a] - at[b])) for a, b in pairwise(way))
        for side in ("left", "right")
        if (way := [f"{side}_{part}" for part in ("hip", "knee", "ankle") if f"{side}_{part}" in at])
    ]
    length = float(np.mean(legs)) * (1.08 if "left_ankle" in at else 2.0)
    if length <= 0:
        raise InputError(f"{source}: its legs have no length; export it with its bones' offsets")
    return axes, length


def _rest_rotations(skeleton: Skeleton, joints: dict[str, int], axes: Matrices) -> NDArray[np.float64]:
    """Return how each of our joints has to be turned from the T-pose to rest as the file's do, shape ``(55, 3, 3)``."""
    rest = np.broadcast_to(np.eye(3), (len(JOINTS), 3, 3)).copy()
    for k, ours in enumerate(JOINTS[1:], start=1):
        inherited = rest[PARENTS[k]]
        rest[k] = inherited
        side, _, part = ours.partition("_")
        if part not in _LIMBS or ours not in joints or f"{side}_{_LIMBS[part][0]}" not in joints:
            continue
        following, way = _LIMBS[part]
        theirs = axes @ (skeleton.places[joints[f"{side}_{following}"]] - skeleton.places[joints[ours]])
        if np.linalg.norm(theirs) > 0:
            mine = inherited @ (way * (-1.0 if side == "right" and way is _LEFT else 1.0))
            rest[k] = rotation_between(mine, theirs) @ inherited
    # Feet and toes stand as they are: they point forward in every rest pose.
    for side in ("left", "right"):
        for part in ("ankle", "foot"):
            rest[J[f"{side}_{part}"]] = np.eye(3)
    return rest
