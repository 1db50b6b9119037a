"""People dressed from the baked CC0 bodies (see `people.bake`), by the same `Appearance` as our own."""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.people.accessories import worn_parts
from vico.assets.people.bake import AGES, ANCESTRIES, GENDERS, LEVELS, TARGETS, VERSION
from vico.assets.people.clothes import darker, front_of, hemmed
from vico.assets.people.cutting import open_loops
from vico.assets.people.heads import hairline, worn_on_head
from vico.assets.people.lofts import BodyPart, merged, skinned, with_normals
from vico.assets.people.model import JOINTS, Appearance, Colour, J, SkinnedBody
from vico.errors import MissingExtraError
from vico.io.cache import cache_folder
from vico.io.compiled import compiled

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
    with np.load(path, allow_pickle=False) as file:
        record = {name: file[name] for name in file.files}
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

    def __init__(self, look: Appearance, path: Path) -> None:
        wardrobe = _wardrobe(path)
        self.look, self.path, self.wardrobe = look, path, wardrobe
        shares = _shares(look)
        used = np.flatnonzero(shares)
        points = (wardrobe["base"] + np.tensordot(shares[used], wardrobe["basis"][used], 1)).astype(np.float64)
        points[:, 2] -= points[wardrobe["rows.shoes"], 2].min()
        points *= look.height / points[wardrobe["rows.head"], 2].max()
        self.points, self.joints = points, points[-len(JOINTS) :]

    def piece(self, name: str, colour: Colour) -> BodyPart:
        """Return a surface as it lies on the skin."""
        rows, triangles = self.wardrobe[f"rows.{name}"], self.wardrobe[f"triangles.{name}"].astype(np.int64)
        colours = np.tile(np.asarray(colour, np.float64), (len(rows), 1))
        return with_normals(
            BodyPart(self.points[rows], triangles, colours, self.wardrobe["weights"][rows].astype(np.float64))
        )

    def cloth(self, name: str, colour: Colour, ease: float | NDArray[np.float64], *, soft: int = 0) -> BodyPart:
        """Return a surface made a garment: smoothed, pushed off the body, hemmed."""
        part = self.piece(name, colour)
        if soft:
            part.vertices = _smoothed(part, soft)
            part = with_normals(part)
        room = np.broadcast_to(np.asarray(ease, np.float64), (len(part.vertices),))
        if name not in ("top", "tee", "shoes", "boots"):
            # What is worn below is tucked in at the waist.
            waist, hip = self.joints[J["spine1"], 2] - 0.04, self.joints[J["left_hip"], 2] + 0.03
            room = room - (room + 0.008) * np.clip((part.vertices[:, 2] - hip) / (waist - hip), 0, 1)
        part.vertices = part.vertices + part.normals * room[:, None]
        edges = _edges(self.path, name)
        return hemmed(with_normals(part), edges, max(float(room.max()), 0.0) + 0.006)


def _smoothed(part: BodyPart, times: int) -> NDArray[np.float64]:
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
    rows = fit.wardrobe[f"rows.{name}"]
    hem = 1 - np.clip((fit.points[rows, 2] - fit.joints[J["pelvis"], 2] + 0.1) / 0.25, 0, 1)
    top = fit.cloth(name, look.top_colour, near + far * hem, soft=2 if near > 0.008 else 1)
    parts.append(top)
    if look.top in ("suit", "coat"):
        parts.append(fit.cloth("tails" if look.top == "suit" else "skirt", look.top_colour, near + 0.004, soft=1))
    front = merged([top, *parts[2:]]) if len(parts) > 2 else top
    collar = float(top.vertices[(top.vertices[:, 0] > 0) & (np.abs(top.vertices[:, 1]) < 0.03), 2].max())
    return parts + front_of(look, front, lambda share: share * look.height, collar / look.height)


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


class _Scan:
    """The surface of a head, found by rays from its axis."""

    def __init__(self, head: BodyPart, eye: float) -> None:
        crown = float(head.vertices[:, 2].max())
        # Eyes are at 0.525 of the head's height, as on our own heads.
        self.size = (crown - eye) / 0.475
        self.chin = crown - self.size
        above = head.vertices[head.vertices[:, 2] > eye]
        self.axis = float(above[:, 0].min() + above[:, 0].max()) / 2
        self.shares, self.angles = np.linspace(0.38, 0.985, 22), np.linspace(-np.pi, np.pi, 37)
        heights = self.chin + self.shares * self.size
        self.radii = _leaving(head.vertices, head.triangles, self.axis, heights, self.angles)
        # Ears would make bumps in the hair: no radius above the middle one of its surroundings.
        for shift in (-2, 2):
            self.radii[:10] = np.minimum(
                self.radii[:10], np.roll(self.radii[:10, :-1], shift, 1)[:, np.r_[:36, 0]] * 1.06
            )

    def at(self, share: float, angle: float, lift: float = 0.0) -> NDArray[np.float64]:
        """Return a point at a height and an angle from straight ahead (to the left), lifted off the skin by a share."""
        turned = (angle + np.pi) % (2 * np.pi) - np.pi
        row = (share - self.shares[0]) / (self.shares[1] - self.shares[0])
        column = (turned + np.pi) / (self.angles[1] - self.angles[0])
        row, column = min(max(row, 0.0), len(self.shares) - 1.001), min(max(column, 0.0), len(self.angles) - 1.001)
        k, i = int(row), int(column)
        u, v = row - k, column - i
        radius = (self.radii[k, i] * (1 - v) + self.radii[k, i + 1] * v) * (1 - u)
        radius += (self.radii[k + 1, i] * (1 - v) + self.radii[k + 1, i + 1] * v) * u
        if share > self.shares[-1]:
            radius *= (1 - share) / (1 - self.shares[-1])
        up = min(max((share - 0.60) / 0.40, 0.0), 1.0)
        out = radius + lift * self.size * math.sqrt(1 - up * up)
        height = self.chin + (share + lift * up) * self.size
        return np.array([self.axis + out * math.cos(angle), out * math.sin(angle), height])


@compiled
def _leaving(
    points: NDArray[Any], triangles: NDArray[Any], axis: float, heights: NDArray[Any], angles: NDArray[Any]
) -> NDArray[Any]:
    """How far from the axis the surface is left for good, by level and angle (Moeller and Trumbore's ray test)."""
    radii = np.zeros((len(heights), len(angles)))
    for k in range(len(heights)):
        for i in range(len(angles)):
            wx, wy = np.cos(angles[i]), np.sin(angles[i])
            for f in range(len(triangles)):
                a, b, c = points[triangles[f, 0]], points[triangles[f, 1]], points[triangles[f, 2]]
                if min(a[2], b[2], c[2]) > heights[k] or max(a[2], b[2], c[2]) < heights[k]:
                    continue
                e1x, e1y, e1z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
                e2x, e2y, e2z = c[0] - a[0], c[1] - a[1], c[2] - a[2]
                px, py, pz = wy * e2z, -wx * e2z, wx * e2y - wy * e2x
                det = e1x * px + e1y * py + e1z * pz
                if abs(det) < 1e-12:
                    continue
                tx, ty, tz = axis - a[0], -a[1], heights[k] - a[2]
                u = (tx * px + ty * py + tz * pz) / det
                qx, qy, qz = ty * e1z - tz * e1y, tz * e1x - tx * e1z, tx * e1y - ty * e1x
                v = (wx * qx + wy * qy) / det
                if u > -1e-6 and v > -1e-6 and u + v < 1 + 1e-6:
                    radii[k, i] = max(radii[k, i], (e2x * qx + e2y * qy + e2z * qz) / det)
        # A ray may slip through an eye: take the level's middle radius there.
        seen = np.median(radii[k])
        for i in range(len(angles)):
            if radii[k, i] <= 0:
                radii[k, i] = seen
    return radii


def _head(fit: _Fitting) -> list[BodyPart]:
    look = fit.look
    head = fit.piece("head", look.skin)
    typical = fit.wardrobe["typical"][fit.wardrobe["rows.head"]].astype(np.float64)
    from_mouth = typical - fit.wardrobe["mouth"]
    # Red in their middle and fading to the rim: colours spread to the next vertices, which are far at the corners.
    away = np.hypot(from_mouth[:, 1] / 0.024, from_mouth[:, 2] / 0.0085)
    redness = np.clip(1.7 * (1.0 - away), 0.0, 1.0) * (from_mouth[:, 0] > -0.012)
    skin = np.asarray(look.skin, np.float64)
    if look.beard:
        chin = (from_mouth[:, 2] < 0.014) & (from_mouth[:, 2] > -0.075) & (from_mouth[:, 0] > -0.085)
        chin &= np.abs(from_mouth[:, 1]) < 0.075
        head.colour[chin] = 0.75 * np.asarray(look.hair_colour) + 0.25 * skin
    lips, share = redness > 0, redness[redness > 0][:, None]
    head.colour[lips] = (1 - share) * head.colour[lips] + share * skin * np.array([0.84, 0.66, 0.65])
    eyes = fit.piece("eyes", (232, 228, 224))
    for side in ("left", "right"):
        own = eyes.weights[:, J[f"{side}_eye"]] > 0.5
        out = eyes.vertices - eyes.vertices[own].mean(0)
        ahead = out[:, 0] / np.linalg.norm(out, axis=1)
        eyes.colour[own & (ahead > 0.78)] = np.asarray(look.eyes) * 0.6
        eyes.colour[own & (ahead > 0.985)] = 12
    scan = _Scan(head, float(fit.joints[[J["left_eye"], J["right_eye"]], 2].mean()))
    _tint_scalp(head, scan, look)
    return [head, eyes, *worn_on_head(look, scan)]


def _tint_scalp(head: BodyPart, scan: _Scan, look: Appearance) -> None:
    """Colour the skin under the hair, where it may show between strands."""
    line = hairline(look)
    if line is None:
        return
    share = (head.vertices[:, 2] - scan.chin) / scan.size
    angle = np.abs(np.arctan2(head.vertices[:, 1], head.vertices[:, 0] - scan.axis))
    lines = np.array([line(float(a)) for a in angle])
    head.colour[share > np.maximum(lines, 0.30) + 0.04] = 0.9 * np.asarray(look.hair_colour)


def body(look: Appearance) -> SkinnedBody:
    """Dress somebody.

    Parameters
    ----------
    look
        How they look.

    Returns
    -------
    SkinnedBody
        About 2,700 vertices.

    Raises
    ------
    MissingExtraError
        If the data are not installed.
    """
    fit = _Fitting(look, installed_file())
    clothes = [*_lower(fit), *_upper(fit)]
    worn = worn_parts(look, fit.joints, clothes)
    parts = [*_head(fit), fit.piece("hands", look.skin), *clothes, *_feet(fit), *worn]
    return skinned(parts, fit.joints, look.height)
