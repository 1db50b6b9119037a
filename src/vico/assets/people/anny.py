"""People dressed from the baked CC0 bodies (see `people.bake`), by the same `Appearance` as our own; faces and eyes."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vico.assets.people.bake import AGES, ANCESTRIES, GENDERS, LEVELS, TARGETS, VERSION, open_loops
from vico.assets.people.clothing import add_hem, darker, front_of, worn_parts
from vico.assets.people.heads import BALD, ScannedSkull, hairline, worn_on_head
from vico.assets.people.lofts import BodyPart, LoftRing, blob, loft, merge_parts, skin_parts, with_normals
from vico.assets.people.model import JOINTS, Appearance, Colour, J, SkinnedBody
from vico.errors import MissingExtraError
from vico.io.arrays import read_npz
from vico.io.cache import cache_folder

Points = NDArray[np.float64]
# The mouth of the average young adult, metres from where the rows of teeth meet.
_MOUTH = 0.0235  # half its width
_LINE = -0.0048  # its line's height
_UPPER = 0.0088  # the upper lip, above that line
_LOWER = 0.0078  # the lower lip, below it
# What blood shows through: place (folded to the left), radii, what the skin's colour is multiplied with.
_FLUSHED = (
    ((0.000, 0.036, 0.030), (0.030, 0.022, 0.020), (1.0, 0.93, 0.92)),  # cheeks
    ((0.026, 0.000, 0.022), (0.018, 0.020, 0.014), (1.0, 0.94, 0.93)),  # the nose's tip
    ((-0.004, 0.030, 0.058), (0.020, 0.024, 0.013), (0.94, 0.89, 0.89)),  # around the eyes
)
# Angles from an eye's axis, radians, at which these end.
_PUPIL = 0.17
_IRIS = 0.44
_RIM = 0.51  # the iris's darker rim
_BACK = 1.75  # the last ring
# Lids are dark as far as this from an eye's middle, in its radii.
_LASHES = 1.085


def paint_face(look: Appearance, head: BodyPart, from_mouth: Points, inside: NDArray[np.bool_], *, fine: bool) -> None:
    """Colour lips, cheeks and beard.

    Parameters
    ----------
    look
        Whose face.
    head
        Its surface; colours are changed.
    from_mouth
        Where its vertices are on the average young adult, metres from the mouth, shape ``(v, 3)``.
    inside
        Which vertices are within the mouth, shape ``(v,)``.
    fine
        Whether the surface has the detail for lips with a rim.
    """
    skin = np.asarray(look.skin, np.float64)
    if fine:
        _flush(head, from_mouth)
    if look.beard:
        # It thins out towards its rim.
        rims = (0.016 - from_mouth[:, 2], from_mouth[:, 2] + 0.078, from_mouth[:, 0] + 0.09)
        dense = np.clip(np.min([*rims, 0.08 - np.abs(from_mouth[:, 1])], axis=0) / 0.010, 0, 1)[:, None]
        dense = 0.75 * (dense if fine else np.round(dense))
        head.colour[:] = (1 - dense) * head.colour + dense * np.asarray(look.hair_colour)
    red = (_lips if fine else _coarse_lips)(from_mouth)[:, None]
    head.colour[:] = (1 - red) * head.colour + red * skin * np.array([0.84, 0.66, 0.65])
    _part_lips(head, from_mouth, inside, 0.0022 if fine else 0.006)
    # Not at the corners, whose colour would spread to the cheeks.
    dark = (inside * np.clip(4 * (1 - (from_mouth[:, 1] / _MOUTH) ** 2) - 0.4, 0, 1))[:, None]
    head.colour[:] = (1 - dark) * head.colour + dark * skin * np.array([0.42, 0.27, 0.27])


def mouth_lining(head: BodyPart, from_mouth: Points) -> BodyPart:
    """Return what is seen between lips that do not quite meet: something dark, not the far side of the head."""
    lips = _lips(from_mouth) > 0.5
    low, high = head.vertices[lips].min(0), head.vertices[lips].max(0)
    middle = 0.5 * (low + high)
    deep = np.array([0.35 * (high[1] - low[1]), 0.42 * (high[1] - low[1]), 0.40 * (high[2] - low[2])])
    front = float(np.quantile(head.vertices[lips, 0], 0.3))
    middle[0] = front - 0.004 - deep[0]
    return blob(middle, deep, {J["head"]: 0.7, J["jaw"]: 0.3}, (46, 18, 18), sides=12, rings=6)


def _coarse_lips(from_mouth: Points) -> Points:
    """How red lips are, 0..1: in their middle, fading to the rim, as colours spread to the next, far vertices."""
    away = np.hypot(from_mouth[:, 1] / 0.024, (from_mouth[:, 2] + 0.0035) / 0.0085)
    return np.clip(1.7 * (1.0 - away), 0.0, 1.0) * (from_mouth[:, 0] > -0.012)


def _lips(from_mouth: Points) -> Points:
    """How red lips are, 0..1: between the arcs that bound them, with a Cupid's bow."""
    aside = np.abs(from_mouth[:, 1]) / _MOUTH
    arc = np.maximum(1 - aside**2, 0.0)
    upper = _UPPER * arc**0.85 - 0.0012 * np.exp(-((aside / 0.13) ** 2))
    lower = _LOWER * arc**0.65
    above = from_mouth[:, 2] - _LINE
    share = np.where(above > 0, above / np.maximum(upper, 1e-6), -above / np.maximum(lower, 1e-6))
    return np.clip((1.12 - share) / 0.25, 0.0, 1.0) * (arc > 0) * (from_mouth[:, 0] > -0.008)


def _part_lips(head: BodyPart, from_mouth: Points, inside: NDArray[np.bool_], reach: float) -> None:
    """Darken where the lips meet, and light it as if it looked ahead: no sun comes in there."""
    share = np.clip(4 * (1 - np.abs(from_mouth[:, 1]) / _MOUTH), 0, 1) * (from_mouth[:, 0] > -0.008)
    share *= np.clip(1.5 - np.abs(from_mouth[:, 2] - _LINE) / reach, 0, 1)
    head.colour[:] *= 1 - 0.3 * share[:, None]
    share = np.where(inside, 1.0, share)
    normals = (1 - 0.85 * share[:, None]) * head.normals
    normals[:, 0] += 0.85 * share
    head.normals[:] = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)


def _flush(head: BodyPart, from_mouth: Points) -> None:
    folded = from_mouth * np.array([1.0, 1.0, 1.0])
    folded[:, 1] = np.abs(folded[:, 1])
    for place, radii, tint in _FLUSHED:
        away = np.linalg.norm((folded - place) / radii, axis=1)
        share = np.clip(1.0 - away, 0.0, 1.0)[:, None]
        head.colour[:] *= 1 - share + share * np.asarray(tint)


def eyeballs(look: Appearance, eyes: BodyPart, *, fine: bool) -> list[BodyPart]:
    """Return both eyes in their colours.

    Parameters
    ----------
    look
        Whose eyes.
    eyes
        Their surface; coloured if it is used.
    fine
        Whether to make balls with a round iris of their own instead.
    """
    iris = np.asarray(look.eyes) * 0.6
    if fine:
        return [_eyeball(eyes, side, _times(look.eyes, 0.6)) for side in ("left", "right")]
    for side in ("left", "right"):
        own = eyes.weights[:, J[f"{side}_eye"]] > 0.5
        out = eyes.vertices - eyes.vertices[own].mean(0)
        ahead = out[:, 0] / np.linalg.norm(out, axis=1)
        eyes.colour[own & (ahead > 0.78)] = iris
        eyes.colour[own & (ahead > 0.985)] = 12
    return [eyes]


def _times(colour: Colour, share: float) -> Colour:
    red, green, blue = (min(int(share * c), 255) for c in colour)
    return red, green, blue


def _ball(eyes: BodyPart, side: str) -> tuple[Points, float]:
    """Return the middle and the radius of an eye."""
    own = eyes.vertices[eyes.weights[:, J[f"{side}_eye"]] > 0.5]
    middle = 0.5 * (own.min(0) + own.max(0))
    return middle, float(np.linalg.norm(own - middle, axis=1).mean())


def _eyeball(eyes: BodyPart, side: str, iris: Colour) -> BodyPart:
    """Return the front of a ball with a pupil, an iris and its darker rim."""
    joint = J[f"{side}_eye"]
    middle, radius = _ball(eyes, side)
    rim, bright, white = _times(iris, 0.5), _times(iris, 1.6), (230, 226, 220)
    turns: tuple[tuple[float, Colour], ...] = (
        (0.02, (10, 10, 11)),
        (_PUPIL, bright),
        (0.30, iris),
        (_IRIS, rim),
        (_RIM, white),
        (0.75, white),
    )
    turns += ((1.0, white), (1.3, (214, 200, 194)), (_BACK, (190, 160, 152)))
    rings = []
    for k, (turn, _) in enumerate(turns):
        # A ring has the colour of what lies outside of it; lofts double it where colours change.
        colour = turns[max(k - 1, 0)][1]
        wide = radius * np.sin(turn)
        centre = middle + np.array([radius * np.cos(turn), 0.0, 0.0])
        rings.append(LoftRing(centre, wide, wide, wide, {joint: 1.0}, colour))
    return loft(rings, sides=20, forward=(0.0, 0.0, 1.0), close_start=True)


def paint_lids(look: Appearance, head: BodyPart, eyes: BodyPart) -> None:
    """Darken the rims of the lids, where lashes grow, and what is behind them."""
    dark = 0.5 * np.asarray(look.skin, np.float64) * np.array([0.42, 0.34, 0.32])
    for side in ("left", "right"):
        middle, radius = _ball(eyes, side)
        out = head.vertices - middle
        away = np.linalg.norm(out, axis=1) / radius
        ahead = out[:, 0] / np.maximum(radius * away, 1e-9)
        lashes = np.clip((_LASHES - away) / 0.03, 0, 1) * np.clip((ahead - 0.35) / 0.2, 0, 1)
        share = (lashes * np.where(out[:, 2] > 0, 0.85, 0.28))[:, None]
        head.colour[:] = (1 - share) * head.colour + share * dark


# Metres that a garment lies off the body: near the skin, and how much more at its far end.
_TOPS: dict[str, tuple[float, float]] = {
    "t-shirt": (0.006, 0.006),
    "dress": (0.003, 0.004),
    "shirt": (0.007, 0.004),
    "jumper": (0.011, 0.004),
    "hoodie": (0.014, 0.005),
    "jacket": (0.016, 0.006),
    "suit": (0.012, 0.005),
    "coat": (0.019, 0.006),
}
# Metres that skin under a top is pulled in.
_TUCKED = 0.015
_BOTTOMS: dict[str, tuple[float, float]] = {
    "trousers": (0.006, 0.020),
    "jeans": (0.004, 0.010),
    "leggings": (0.001, 0.000),
    "shorts": (0.008, 0.016),
}


# What the data's ages are, years: a baby, a child of about eleven, an adult, an elder. Shoulders and faces grow up
# between eighteen and twenty-one, not later.
_AGES = (1.0, 11.0, 21.0, 90.0)


def baked_file() -> Path:
    """Return where the baked bodies are, or would be."""
    return cache_folder() / "assets" / f"people-{VERSION}.npz"


def available() -> bool:
    """Whether the baked bodies are there."""
    return baked_file().is_file()


def installed_file() -> Path:
    """Return where the baked bodies are.

    Raises
    ------
    MissingExtraError
        If they are not installed.
    """
    path = baked_file()
    if not path.is_file():
        raise MissingExtraError(f"people: no baked bodies at {path}; type: vico assets install people")
    return path


@lru_cache(maxsize=2)
def _wardrobe(path: Path) -> dict[str, NDArray[Any]]:
    record = read_npz(path.read_bytes())
    record["basis"] = record["basis"].astype(np.float32)
    return record


@lru_cache(maxsize=64)
def _edges(path: Path, name: str) -> NDArray[np.int64]:
    """Return the open edges of a piece."""
    return open_loops(_wardrobe(path)[f"triangles.{name}"].astype(np.int64))


def _share_of_ages(age: float) -> list[float]:
    """Return how much of each of the data's ages makes somebody of an age."""
    return [float(np.interp(age, _AGES, np.eye(len(AGES))[k])) for k in range(len(AGES))]


def _shares(look: Appearance) -> NDArray[np.float32]:
    """How much of each target makes this body."""
    genders = dict(zip(GENDERS, (1 - look.gender, look.gender), strict=True))
    ages = dict(zip(AGES, _share_of_ages(look.age), strict=True))

    def levels(value: float) -> dict[str, float]:
        low, high = max(1 - 2 * value, 0.0), max(2 * value - 1, 0.0)
        return dict(zip(LEVELS, (low, 1 - low - high, high), strict=True))

    # The ends of the data's scales are caricatures: stay inside.
    muscles, weights = levels(0.2 + 0.6 * look.muscle), levels(0.12 + 0.76 * look.build)
    ancestry = dict(zip(ANCESTRIES, np.asarray(look.ancestry) / sum(look.ancestry), strict=True))
    shares = []
    for target in TARGETS:
        first, gender, age, *rest = target.split("-")
        share = genders[gender] * ages[age]
        if first == "universal":
            share *= muscles[rest[0].removesuffix("muscle")] * weights[rest[1].removesuffix("weight")]
        else:
            share *= ancestry[first]
        shares.append(share)
    return np.array(shares, np.float32)


class _Fitting:
    """One body's surfaces in metres, floor at 0, while it is dressed."""

    def __init__(self, look: Appearance, path: Path, *, fine: bool) -> None:
        wardrobe = _wardrobe(path)
        self.look, self.path, self.wardrobe, self.fine = look, path, wardrobe, fine
        shares = _shares(look)
        used = np.flatnonzero(shares)
        points = (wardrobe["base"] + np.tensordot(shares[used], wardrobe["basis"][used], 1)).astype(np.float64)
        points[:, 2] -= points[wardrobe["rows.shoes"], 2].min()
        points *= look.height / points[wardrobe["rows.head"], 2].max()
        self.points, self.joints = points, points[-len(JOINTS) :]

    def name(self, piece: str) -> str:
        """Return what a piece is called in the detail wanted."""
        return f"fine {piece}" if self.fine and f"rows.fine {piece}" in self.wardrobe else piece

    def piece(self, name: str, colour: Colour) -> BodyPart:
        """Return a surface as it lies on the skin."""
        name = self.name(name)
        rows, triangles = self.wardrobe[f"rows.{name}"], self.wardrobe[f"triangles.{name}"].astype(np.int64)
        colours = np.tile(np.asarray(colour, np.float64), (len(rows), 1))
        return with_normals(
            BodyPart(self.points[rows], triangles, colours, self.wardrobe["weights"][rows].astype(np.float64))
        )

    def cloth(self, name: str, colour: Colour, ease: float | NDArray[np.float64], *, soft: int = 0) -> BodyPart:
        """Return a surface made a garment: smoothed, pushed off the body, hemmed."""
        part = self.piece(name, colour)
        if soft:
            part.vertices = _smooth_cloth(part, soft)
            part = with_normals(part)
        room = np.broadcast_to(np.asarray(ease, np.float64), (len(part.vertices),))
        if name not in ("top", "tee", "shoes", "boots"):
            # What is worn below is tucked in at the waist.
            waist, hip = self.joints[J["spine1"], 2] - 0.04, self.joints[J["left_hip"], 2] + 0.03
            room = room - (room + 0.008) * np.clip((part.vertices[:, 2] - hip) / (waist - hip), 0, 1)
        part.vertices = part.vertices + part.normals * room[:, None]
        edges = _edges(self.path, name)
        return add_hem(with_normals(part), edges, max(float(room.max()), 0.0) + 0.006)


def _smooth_cloth(part: BodyPart, times: int) -> NDArray[np.float64]:
    """Let cloth span hollows: move each vertex half way to the mean of its neighbours, open edges aside."""
    count = len(part.vertices)
    pairs = np.concatenate([part.triangles[:, [0, 1]], part.triangles[:, [1, 2]], part.triangles[:, [2, 0]]])
    edges = np.unique(np.sort(pairs, axis=1), axis=0, return_counts=True)
    both = np.concatenate([edges[0], edges[0][:, ::-1]])
    degree = np.bincount(both[:, 0], minlength=count)[:, None]
    rim = np.zeros(count, bool)
    rim[edges[0][edges[1] == 1].ravel()] = True
    points = part.vertices.copy()
    for _ in range(times):
        sums = np.zeros_like(points)
        np.add.at(sums, both[:, 0], points[both[:, 1]])
        points = np.where(rim[:, None], points, 0.5 * points + 0.5 * sums / np.maximum(degree, 1))
    return points


def _lower(fit: _Fitting) -> list[BodyPart]:
    look, parts = fit.look, []
    ankle, hip = fit.joints[J["left_ankle"], 2], fit.joints[J["left_hip"], 2]
    bare = look.top == "dress" or look.bottom in ("skirt", "shorts")
    if bare and not (look.top == "dress" and look.bottom == "leggings"):
        parts.append(fit.piece("legs", look.skin))
    if look.top == "dress":
        parts.append(fit.cloth("skirt", look.top_colour, 0.006, soft=1))
        if look.bottom == "leggings":
            parts.append(fit.cloth("trousers", look.bottom_colour, 0.001))
        else:
            parts.append(fit.cloth("shorts", darker(look.top_colour, 0.6), 0.001))
        return parts
    if look.bottom == "skirt":
        parts.append(fit.cloth("skirt", look.bottom_colour, 0.004, soft=1))
        parts.append(fit.cloth("shorts", darker(look.bottom_colour, 0.6), 0.001))
        return parts
    near, far = _BOTTOMS[look.bottom]
    name = "shorts" if look.bottom == "shorts" else "trousers"
    z = fit.points[fit.wardrobe[f"rows.{name}"], 2]
    down = np.clip((hip - z) / (hip - ankle), 0, 1)
    parts.append(fit.cloth(name, look.bottom_colour, near + far * down, soft=0 if look.bottom == "leggings" else 1))
    return parts


def _upper(fit: _Fitting) -> list[BodyPart]:
    look, parts = fit.look, []
    near, far = _TOPS[look.top]
    name = "tee" if look.top in ("t-shirt", "dress") else "top"
    if name == "tee":
        parts.append(fit.piece("arms", look.skin))
        _tuck_in(parts[-1], fit)
    rows = fit.wardrobe[f"rows.{name}"]
    hem = 1 - np.clip((fit.points[rows, 2] - fit.joints[J["pelvis"], 2] + 0.1) / 0.25, 0, 1)
    top = fit.cloth(name, look.top_colour, near + far * hem, soft=2 if near > 0.008 else 1)
    parts.append(top)
    if look.top in ("suit", "coat"):
        parts.append(fit.cloth("tails" if look.top == "suit" else "skirt", look.top_colour, near + 0.004, soft=1))
    front = merge_parts([top, *parts[2:]]) if len(parts) > 2 else top
    collar = float(top.vertices[(top.vertices[:, 0] > 0) & (np.abs(top.vertices[:, 1]) < 0.03), 2].max())
    return parts + front_of(look, front, lambda share: share * look.height, collar / look.height)


def _tuck_in(skin: BodyPart, fit: _Fitting) -> None:
    """Pull skin that lies under the top, off its open edges, further in: else it comes through where joints bend."""
    name = "tee" if fit.look.top in ("t-shirt", "dress") else "top"
    place = fit.points[fit.wardrobe[f"rows.{name}"]]
    from_edge = cKDTree(place[np.unique(_edges(fit.path, name))]).query(skin.vertices)[0]
    from_top = cKDTree(place).query(skin.vertices)[0]
    covered = (from_top < 0.6 * from_edge) & (from_top < 0.04)
    depth = np.where(covered, _TUCKED * np.clip((from_edge - 0.02) / 0.03, 0.0, 1.0), 0.0)
    skin.vertices = skin.vertices - depth[:, None] * skin.normals


def _feet(fit: _Fitting) -> list[BodyPart]:
    look = fit.look
    name = "boots" if look.shoes == "boots" else "shoes"
    colour = look.skin if look.shoes == "sandals" else look.shoes_colour
    part = fit.cloth(name, colour, 0.004)
    # A sole: what touches the floor is flat, stands out and has a colour of its own.
    low = part.vertices[:, 2] < 0.016
    part.vertices[:, 2] = np.where(low, np.clip(part.vertices[:, 2] - 0.004, 0.0, 0.012), part.vertices[:, 2])
    part.colour[low] = 0.5 * part.colour[low] + (110 if look.shoes == "trainers" else 16)
    return [with_normals(part)]


def _head(fit: _Fitting) -> list[BodyPart]:
    look, fine = fit.look, fit.fine
    head = fit.piece("head", look.skin)
    _tuck_in(head, fit)
    rows = fit.wardrobe[f"rows.{fit.name('head')}"]
    from_mouth = fit.wardrobe["typical"][rows].astype(np.float64) - fit.wardrobe["mouth"]
    eyes = fit.piece("eyes", (232, 228, 224))
    paint_face(look, head, from_mouth, fit.wardrobe[f"inside.{fit.name('head')}"], fine=fine)
    balls = eyeballs(look, eyes, fine=fine)
    if fine:
        paint_lids(look, head, eyes)
        balls.append(mouth_lining(head, from_mouth))
    skull = ScannedSkull(head, float(fit.joints[[J["left_eye"], J["right_eye"]], 2].mean()))
    _tint_scalp(head, skull, look)
    return [head, *balls, *worn_on_head(look, skull, fine=fine)]


def _tint_scalp(head: BodyPart, skull: ScannedSkull, look: Appearance) -> None:
    """Colour the skin under the hair, where it may show between strands."""
    line = hairline(look)
    if line is None:
        return
    share = (head.vertices[:, 2] - skull.chin) / skull.size
    angle = np.abs(np.arctan2(head.vertices[:, 1], head.vertices[:, 0] - skull.axis))
    lines = np.array([line(float(a)) for a in angle])
    highest = BALD if look.hair == "bald" else 1.0
    head.colour[(share > np.maximum(lines, 0.30) + 0.04) & (share < highest)] = 0.9 * np.asarray(look.hair_colour)


def body(look: Appearance, *, fine: bool = False) -> SkinnedBody:
    """Dress somebody.

    Parameters
    ----------
    look
        How they look.
    fine
        With a face and hands for close-ups.

    Returns
    -------
    SkinnedBody
        About 2,700 vertices, fine about 7,000.

    Raises
    ------
    MissingExtraError
        If the data are not installed.
    """
    fit = _Fitting(look, installed_file(), fine=fine)
    clothes = [*_lower(fit), *_upper(fit)]
    worn = worn_parts(look, fit.joints, clothes)
    parts = [*_head(fit), fit.piece("hands", look.skin), *clothes, *_feet(fit), *worn]
    return skin_parts(parts, fit.joints, look.height)
