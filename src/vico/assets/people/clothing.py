"""Details of clothes and accessories, by measures of the body and its clothes.

Sewn onto clothes: the shirt in an open jacket, lapels, ties, buttons, pockets; and turned-in hems. Worn over clothes
and on the head: hats, vests, aprons, bags.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vico.assets.people.lofts import BodyPart, LoftRing, Weights, blend, blob, loft, merge_parts, with_normals
from vico.assets.people.model import Appearance, Colour, Hat, J

# Where the front opens (share of the stature), half its width there and at the neck, as shares too.
_OPENING = {"suit": (0.655, 0.002, 0.036), "jacket": (0.520, 0.020, 0.030), "coat": (0.735, 0.003, 0.032)}


def darker(colour: Colour, share: float) -> Colour:
    """Return a shade of a colour."""
    return int(colour[0] * share), int(colour[1] * share), int(colour[2] * share)


def front_of(
    look: Appearance,
    cloth: BodyPart,
    level: Callable[[float], float],
    neckline: float,
    rows: Sequence[float] = (),
    thickness: float = 0.0034,
) -> list[BodyPart]:
    """Dress the front of a top.

    Parameters
    ----------
    look
        Which top it is.
    cloth
        The top as a mesh.
    level
        Metres above the floor of a share of the stature.
    neckline
        Where the cloth ends above, as a share of the stature.
    rows
        Heights at which the cloth has rows of vertices, metres: pieces get rows there, or they would cut through it.
    thickness
        How far pieces lie above the cloth, as a share of the stature.
    """
    dark, h = darker(look.top_colour, 0.72), look.height

    def piece(
        span: tuple[float, float],
        widths: tuple[float, float],
        layer: float,
        colour: Colour,
        centres: tuple[float, float] = (0.0, 0.0),
    ) -> BodyPart:
        heights = np.array([level(span[0]), *(z for z in rows if level(span[0]) < z < level(span[1])), level(span[1])])
        if not len(rows):
            heights = np.linspace(level(span[0]), level(span[1]), 12)
        at = (heights - heights[0]) / (heights[-1] - heights[0])
        middle, half = np.interp(at, (0, 1), centres) * h, np.interp(at, (0, 1), widths) * h
        return front_strip(cloth, heights, middle, half, layer * thickness * h, colour)

    if look.top in _OPENING:
        low, narrow, wide = _OPENING[look.top]
        parts = [piece((low, neckline), (narrow, wide), 1.0, look.under_colour)]
        for left in (1.0, -1.0):
            edges = (left * (narrow + 0.004), left * (wide + 0.006))
            parts.append(piece((low, neckline), (0.004, 0.009), 1.5, dark, edges))
        if look.top == "suit" and look.gender > 0.5:
            parts.append(piece((0.655, neckline - 0.004), (0.006, 0.004), 2.2, (110, 34, 42)))
        if look.top == "coat":
            parts.append(piece((0.54, low), (0.0025, 0.0025), 1.0, dark))
        return parts
    if look.top == "shirt":
        return [piece((0.53, neckline - 0.004), (0.0035, 0.0035), 1.0, dark)]
    if look.top == "hoodie":
        return [piece((0.56, 0.615), (0.055, 0.042), 1.3, dark)]
    return []


def front_strip(
    cloth: BodyPart,
    heights: NDArray[np.float64],
    middle: NDArray[np.float64],
    half: NDArray[np.float64],
    lift: float,
    colour: Colour,
) -> BodyPart:
    """Return a strip up the front of `cloth`, five vertices wide.

    Parameters
    ----------
    cloth
        What it is sewn to.
    heights, middle, half
        Of its rows, how far to the left of the middle it runs there, and half its width, metres.
    lift
        How far it lies off the cloth, metres.
    colour
        sRGB.
    """
    columns = np.linspace(-1.0, 1.0, 5)
    y = (middle[:, None] + half[:, None] * columns).ravel()
    z = np.repeat(heights, len(columns))
    x = _foremost(cloth, y, z)
    for _ in range(12):
        if np.isfinite(x).all():
            break
        # At the neck the piece may be wider, or higher, than what it is sewn to.
        lost = ~np.isfinite(x)
        y, z = np.where(lost, 0.85 * y, y), np.where(lost, z - 0.004, z)
        x = _foremost(cloth, y, z)
    points = np.column_stack([np.where(np.isfinite(x), x, np.nanmax(np.where(np.isfinite(x), x, np.nan))) + lift, y, z])
    faces, width = [], len(columns)
    for k in range(len(heights) - 1):
        for c in range(width - 1):
            a = k * width + c
            faces += [(a, a + 1, a + width + 1), (a, a + width + 1, a + width)]
    nearest = ((points[:, None] - cloth.vertices[None]) ** 2).sum(2).argmin(1)
    colours = np.tile(np.asarray(colour, np.float64), (len(points), 1))
    return with_normals(BodyPart(points, np.array(faces), colours, cloth.weights[nearest]))


def _foremost(part: BodyPart, y: NDArray[np.float64], z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the largest x of a part's surface at each (y, z)."""
    a, b, c = (part.vertices[part.triangles[:, k]] for k in range(3))
    area = (b[:, 1] - a[:, 1]) * (c[:, 2] - a[:, 2]) - (c[:, 1] - a[:, 1]) * (b[:, 2] - a[:, 2])
    facing = area > 1e-12  # towards +x: above its rim in front there is still the back of the collar
    a, b, c, area = a[facing], b[facing], c[facing], area[facing]
    py, pz = y[:, None], z[:, None]
    u = ((b[:, 1] - py) * (c[:, 2] - pz) - (c[:, 1] - py) * (b[:, 2] - pz)) / area
    v = ((c[:, 1] - py) * (a[:, 2] - pz) - (a[:, 1] - py) * (c[:, 2] - pz)) / area
    w = 1 - u - v
    x = u * a[:, 0] + v * b[:, 0] + w * c[:, 0]
    inside = (u > -1e-6) & (v > -1e-6) & (w > -1e-6)
    return np.where(inside, x, -np.inf).max(axis=1)


def add_hem(part: BodyPart, edges: NDArray[np.int64], depth: float) -> BodyPart:
    """Turn the open edges of a piece of cloth in by `depth` metres, so that it has an inside."""
    rim = np.unique(edges)
    place = np.full(len(part.vertices), -1)
    place[rim] = np.arange(len(rim)) + len(part.vertices)
    inner = part.vertices[rim] - depth * part.normals[rim]
    u, v = edges[:, 0], edges[:, 1]
    strips = np.concatenate([np.column_stack([v, u, place[u]]), np.column_stack([v, place[u], place[v]])])
    return BodyPart(
        np.concatenate([part.vertices, inner]),
        np.concatenate([part.triangles, strips]),
        np.concatenate([part.colour, 0.7 * part.colour[rim]]),
        np.concatenate([part.weights, part.weights[rim]]),
        np.concatenate([part.normals, part.normals[rim]]),
    )


# Outlines of hats from below: height on the head, size beside the band's.
_OUTLINES: dict[Hat, tuple[tuple[float, float], ...]] = {
    "cap": ((0.70, 1.0), (0.80, 1.01), (0.92, 0.90), (1.01, 0.66), (1.06, 0.30), (1.07, 0.05)),
    "beanie": ((0.64, 1.03), (0.66, 1.06), (0.74, 1.05), (0.88, 0.97), (1.00, 0.74), (1.09, 0.38), (1.11, 0.05)),
    "sun hat": (
        (0.69, 1.0),
        (0.68, 1.80),
        (0.71, 1.10),
        (0.74, 1.02),
        (0.92, 0.96),
        (1.03, 0.78),
        (1.06, 0.30),
        (1.07, 0.05),
    ),
    "hard hat": (
        (0.695, 1.0),
        (0.69, 1.22),
        (0.705, 1.10),
        (0.85, 1.08),
        (1.00, 0.88),
        (1.10, 0.55),
        (1.14, 0.20),
        (1.145, 0.05),
    ),
    "uniform cap": ((0.70, 1.0), (0.80, 1.0), (0.82, 1.05), (0.96, 1.30), (1.00, 1.26), (1.02, 0.60), (1.025, 0.05)),
    "toque": ((0.70, 1.0), (0.92, 1.02), (0.94, 1.08), (1.20, 1.24), (1.34, 1.14), (1.39, 0.70), (1.40, 0.05)),
}
_PEAKED: tuple[Hat, ...] = ("cap", "uniform cap")
# How far hats stand off the head, for the hair below, as a share of its height; hair is pressed to less than that.
_ROOM, PRESSED = 0.075, 0.045
#: Hair above this share of the head is under a hat.
COVERED = 0.60
# Bands of vests: at these shares of the way from hips to shoulders, so much of it to either side.
_BANDS, _HALF_BAND, _GREY = (0.14, 0.42), 0.045, (214, 216, 208)
# How far vests and aprons are off the clothes below, metres.
_OFF = 0.020
_TRUNK = [J[name] for name in ("pelvis", "spine1", "spine2", "spine3", "left_collar", "right_collar", "neck")]
_THIGHS = [J["left_hip"], J["right_hip"]]


def hat_parts(look: Appearance, skull: object) -> list[BodyPart]:
    """Make the hat that somebody wears, if any.

    Parameters
    ----------
    skull
        A `vico.assets.people.heads.Skull`.
    """
    if look.hat == "none":
        return []
    size, chin, axis = skull.size, skull.chin, skull.axis  # type: ignore[attr-defined]
    at, head = skull.at, {J["head"]: 1.0}  # type: ignore[attr-defined]
    front, back = at(0.74, 0.0)[0] - axis, axis - at(0.74, np.pi)[0]
    side = at(0.74, np.pi / 2)[1]
    room = _ROOM * size
    dark = _shade(look.hat_colour, 0.62)
    rings = []
    for k, (height, scale) in enumerate(_OUTLINES[look.hat]):
        # The band of a uniform cap and the rim of a beanie are darker.
        edge = (look.hat == "uniform cap" and height < 0.81) or (look.hat == "beanie" and k < 2)
        colour = dark if edge else look.hat_colour
        radii = ((front + room) * scale, (back + room) * scale, (side + room) * scale)
        rings.append(LoftRing((axis, 0.0, chin + height * size), *radii, head, colour, 2.1))
    parts = [loft(rings, sides=14, close_end=True)]
    if look.hat in _PEAKED:
        centre = np.array([axis + front + 0.13 * size, 0.0, chin + 0.70 * size])
        peak = dark if look.hat == "cap" else (24, 24, 28)
        parts.append(blob(centre, np.array([0.22, 0.27, 0.022]) * size, head, peak, sides=10, rings=4))
    return parts


def worn_parts(look: Appearance, joints: NDArray[np.float64], clothes: Sequence[BodyPart]) -> list[BodyPart]:
    """Make what is worn over clothes.

    Parameters
    ----------
    joints
        Of the resting body, metres, shape ``(55, 3)``.
    clothes
        Pieces that cover trunk and legs.
    """
    cloth = merge_parts(list(clothes))
    parts: list[BodyPart] = []
    if look.over == "vest":
        parts.append(_vest(look, joints, cloth))
    if look.over == "apron":
        parts.append(_apron(look, joints, cloth))
    if look.bag == "backpack":
        parts += _backpack(look, joints, cloth)
    if look.bag == "shoulder bag":
        parts += _shoulder_bag(look, joints, cloth)
    return parts


def _shade(colour: Colour, share: float) -> Colour:
    return int(colour[0] * share), int(colour[1] * share), int(colour[2] * share)


class _Outline:
    """How far clothes reach ahead, back and aside of the body's axis, by height."""

    def __init__(self, joints: NDArray[np.float64], cloth: BodyPart, height: float) -> None:
        trunk = cloth.vertices[cloth.weights[:, [*_TRUNK, *_THIGHS]].sum(axis=1) > 0.5]
        self._hip = float(joints[J["left_hip"], 2])
        self._z = np.linspace(float(joints[J["left_knee"], 2]), float(joints[J["left_shoulder"], 2]) + 0.01, 24)
        rows = []
        for z in self._z:
            near = trunk[np.abs(trunk[:, 2] - z) < 0.022 * height]
            if len(near) > 3:
                rows.append((z, near[:, 0].max(), -near[:, 0].min(), np.abs(near[:, 1]).max()))
        self._rows = np.array(rows)

    def at(self, z: float) -> tuple[float, float, float]:
        """Return the reach ahead, back and to the sides at a height, metres."""
        front, back, side = (float(np.interp(z, self._rows[:, 0], self._rows[:, k])) for k in (1, 2, 3))
        return front, back, side

    def hanging(self, z: float) -> tuple[float, float]:
        """Return the reach ahead and to the sides of cloth that hangs from the belly."""
        front, _, side = self.at(z)
        belly, _, hips = self.at(self._hip)
        return (front, side) if z > self._hip else (max(front, belly - 0.012), hips)


def _vest(look: Appearance, joints: NDArray[np.float64], cloth: BodyPart) -> BodyPart:
    """Return a vest without sleeves, with bands that reflect."""
    h, outline = look.height, _Outline(joints, cloth, look.height)
    low, high = joints[J["pelvis"], 2] - 0.01 * h, joints[J["left_shoulder"], 2] - 0.005 * h
    edges = [0.0, 0.30, 0.5, 0.80, 0.90, 0.97]
    for band in _BANDS:
        edges += [band - _HALF_BAND, band + _HALF_BAND]
    rings = []
    for share in sorted(edges):
        z = low + share * (high - low)
        front, back, side = (reach + _OFF for reach in outline.at(z))
        # Chests are broad where they meet the arms.
        chest, shoulders = (float(np.clip((share - edge) / 0.2, 0, 1)) for edge in (0.45, 0.8))
        side *= 1 - 0.10 * shoulders
        banded = any(band - _HALF_BAND - 1e-9 <= share < band + _HALF_BAND - 1e-9 for band in _BANDS)
        colour = _GREY if banded else look.over_colour
        upper = float(np.clip((z - joints[J["spine1"], 2]) / (joints[J["spine3"], 2] - joints[J["spine1"], 2]), 0, 1))
        carried = blend({J["pelvis"]: 0.5, J["spine1"]: 0.5}, {J["spine2"]: 0.3, J["spine3"]: 0.7}, upper)
        rings.append(LoftRing((0.0, 0.0, z), front, back, side, carried, colour, 2.5 + 1.5 * chest))
    neck = joints[J["neck"]]
    reach = 0.045 * h
    top = (neck[0], 0.0, neck[2] - 0.012 * h)
    rings.append(LoftRing(top, reach, reach, 1.25 * reach, {J["spine3"]: 1.0}, look.over_colour, 2.2))
    return loft(rings, sides=18)


def _apron(look: Appearance, joints: NDArray[np.float64], cloth: BodyPart) -> BodyPart:
    """Return a panel that hangs from the chest to above the knees, thick enough to be seen from both sides."""
    h, outline = look.height, _Outline(joints, cloth, look.height)
    top, waist = joints[J["spine3"], 2] + 0.03 * h, joints[J["spine1"], 2]
    hem = joints[J["left_knee"], 2] + 0.06 * h
    heights, columns = np.linspace(hem, top, 15), np.linspace(-1.0, 1.0, 9)
    share = np.interp(heights, (hem, waist, waist + 0.03 * h, top), (0.95, 0.93, 0.62, 0.50))
    rows = []
    for z, part in zip(heights, share, strict=True):
        front, side = outline.hanging(z)
        front, side = front + _OFF, side + _OFF
        across = columns * part
        # Below the belly it spans from thigh to thigh.
        power = float(np.interp(z, (float(joints[J["left_hip"], 2]), waist), (9.0, 2.6)))
        ahead = front * (1 - np.abs(across) ** power) ** (1 / power)
        rows.append(np.column_stack([ahead, across * side, np.full(len(columns), z)]))
    outer = np.concatenate(rows)
    wide = len(columns)
    faces = []
    for k in range(len(heights) - 1):
        for c in range(wide - 1):
            a = k * wide + c
            faces += [(a, a + 1, a + wide + 1), (a, a + wide + 1, a + wide)]
    weights = _carried_by(outer, cloth)
    front_faces, count = np.array(faces), len(outer)
    inner = outer - np.array([0.006, 0.0, 0.0])
    colours = np.tile(np.asarray(look.over_colour, np.float64), (2 * count, 1))
    return with_normals(
        BodyPart(
            np.concatenate([outer, inner]),
            np.concatenate([front_faces, front_faces[:, ::-1] + count]),
            colours,
            np.concatenate([weights, weights]),
        )
    )


def _carried_by(points: NDArray[np.float64], cloth: BodyPart) -> NDArray[np.float64]:
    """Return the weights of points over clothes: those of the cloth below them, so that no limb comes through."""
    trunk = np.flatnonzero(cloth.weights[:, [*_TRUNK, *_THIGHS]].sum(axis=1) > 0.5)
    distance, nearest = cKDTree(cloth.vertices[trunk]).query(points, k=3)
    share = 1.0 / (distance + 0.01)
    return np.einsum("nk,nkj->nj", share / share.sum(axis=1)[:, None], cloth.weights[trunk][nearest])


def _backpack(look: Appearance, joints: NDArray[np.float64], cloth: BodyPart) -> list[BodyPart]:
    h, dark = look.height, _shade(look.bag_colour, 0.6)
    # School bags are as large on small backs as on large ones.
    wide, deep = max(0.085 * h, 0.125), max(0.055 * h, 0.075)
    top, low = joints[J["left_shoulder"], 2] - 0.01 * h, joints[J["spine1"], 2] - 0.01 * h
    near = (np.abs(cloth.vertices[:, 1]) < 0.05 * h) & (cloth.vertices[:, 2] > low) & (cloth.vertices[:, 2] < top)
    back = float(cloth.vertices[near, 0].min()) if near.any() else -0.08 * h
    carried: Weights = {J["spine3"]: 0.7, J["spine2"]: 0.3}
    shape = ((0.0, 0.80), (0.04, 0.98), (0.45, 1.0), (0.50, 0.94), (0.85, 0.92), (1.0, 0.62))
    rings = []
    for share, scale in shape:
        colour = dark if share < 0.45 else look.bag_colour
        centre = (back - deep + 0.01, 0.0, low + share * (top - low))
        rings.append(LoftRing(centre, deep * scale, deep * scale, wide * scale, carried, colour, 4.0))
    parts = [loft(rings, sides=12, close_start=True, close_end=True)]
    heights = np.linspace(joints[J["spine2"], 2], joints[J["left_collar"], 2] - 0.005 * h, 7)
    for left in (1.0, -1.0):
        parts.append(front_strip(cloth, heights, np.full(7, left * 0.062 * h), np.full(7, 0.013 * h), 0.017, dark))
    return parts


def _shoulder_bag(look: Appearance, joints: NDArray[np.float64], cloth: BodyPart) -> list[BodyPart]:
    h, dark = look.height, _shade(look.bag_colour, 0.55)
    hip = joints[J["pelvis"], 2]
    side = -_Outline(joints, cloth, h).at(hip)[2]
    rings = [
        LoftRing((0.0, side - 0.028 * h, hip + z * h), 0.095 * h, 0.095 * h, 0.03 * h, {J["pelvis"]: 1.0}, colour, 4.0)
        for z, colour in ((-0.115, look.bag_colour), (-0.02, look.bag_colour), (0.0, dark), (0.02, dark))
    ]
    heights = np.linspace(joints[J["spine1"], 2] - 0.02 * h, joints[J["left_collar"], 2] - 0.005 * h, 9)
    middle = np.linspace(-0.075 * h, 0.055 * h, 9)
    return [
        loft(rings, sides=10, close_start=True, close_end=True),
        front_strip(cloth, heights, middle, np.full(9, 0.013 * h), 0.018, dark),
    ]
