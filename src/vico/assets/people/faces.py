"""Colours of faces of the baked bodies, and their eyes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.assets.people.lofts import BodyPart, LoftRing, blob, loft
from vico.assets.people.model import Appearance, Colour, J

Points = NDArray[np.float64]
# The mouth of the average young adult, metres from where the rows of teeth meet: half its width, how far its line is
# below, how high the lips are above and below that line.
_MOUTH, _LINE, _UPPER, _LOWER = 0.0235, -0.0048, 0.0088, 0.0078
# What blood shows through: place (folded to the left), radii, what the skin's colour is multiplied with.
_FLUSHED = (
    ((0.000, 0.036, 0.030), (0.030, 0.022, 0.020), (1.0, 0.93, 0.92)),  # cheeks
    ((0.026, 0.000, 0.022), (0.018, 0.020, 0.014), (1.0, 0.94, 0.93)),  # the nose's tip
    ((-0.004, 0.030, 0.058), (0.020, 0.024, 0.013), (0.94, 0.89, 0.89)),  # around the eyes
)
# Angles from an eye's axis at which the pupil, the iris and its darker rim end, and that of the last ring.
_PUPIL, _IRIS, _RIM, _BACK = 0.17, 0.44, 0.51, 1.75
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
