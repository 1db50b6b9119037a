"""Heads of our own people: skull, features, beard, by a profile in shares of the head's height."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.assets.people.accessories import hat_parts
from vico.assets.people.brows import eyebrows, glasses
from vico.assets.people.hair import hair
from vico.assets.people.lofts import BodyPart, LoftRing, blob, dense, loft, with_normals
from vico.assets.people.model import Appearance, Colour, J
from vico.assets.people.skulls import Skull

# Height above the chin, then front, back and half-width around the head's axis; shares of the head's height.
_SKULL = np.array(
    [
        [0.00, 0.30, 0.02, 0.12],
        [0.03, 0.355, 0.10, 0.17],
        [0.08, 0.380, 0.18, 0.215],
        [0.15, 0.390, 0.26, 0.250],
        [0.20, 0.398, 0.30, 0.265],
        [0.26, 0.395, 0.34, 0.280],
        [0.34, 0.400, 0.38, 0.295],
        [0.43, 0.400, 0.41, 0.312],
        [0.52, 0.385, 0.43, 0.320],
        [0.60, 0.398, 0.44, 0.325],
        [0.70, 0.398, 0.45, 0.330],
        [0.80, 0.370, 0.43, 0.318],
        [0.88, 0.310, 0.37, 0.275],
        [0.94, 0.230, 0.28, 0.210],
        [0.98, 0.130, 0.17, 0.125],
        [1.00, 0.020, 0.03, 0.020],
    ]
)
_SIDES = 18


class _Skull:
    """Places points on one head."""

    def __init__(self, size: float, stature: float, broad: float) -> None:
        self.size, self.chin, self.broad, self.axis = size, stature - size, broad, 0.0

    def at(self, share: float, angle: float, lift: float = 0.0) -> NDArray[np.float64]:
        """Return a point at a height and an angle from straight ahead (to the left), lifted off the skin by a share."""
        front, back, side = (np.interp(share, _SKULL[:, 0], _SKULL[:, k]) for k in (1, 2, 3))
        c, s = np.cos(angle), np.sin(angle)
        power = 2 / 2.15
        # Towards the crown, off the skin means upwards.
        up = float(np.clip((share - 0.60) / 0.40, 0, 1))
        out = lift * np.sqrt(1 - up * up)
        x = np.sign(c) * abs(c) ** power * ((front if c >= 0 else back) + out)
        y = np.sign(s) * abs(s) ** power * (side * self.broad + out)
        return np.array([x * self.size, y * self.size, self.chin + (share + lift * up) * self.size])


def head_parts(look: Appearance, size: float, stature: float, *, fine: bool) -> list[BodyPart]:
    """Make a head of `size` metres, chin to crown, on a body of `stature` metres."""
    skull = _Skull(size, stature, 0.97 + 0.05 * look.gender + 0.06 * max(look.build - 0.5, 0))
    parts = [_face(look, skull)]
    parts += _features(look, skull)
    return parts + worn_on_head(look, skull, fine=fine)


def worn_on_head(look: Appearance, skull: Skull, *, fine: bool) -> list[BodyPart]:
    """Hair, eyebrows and glasses for any head; `fine`: for close-ups."""
    parts = [*eyebrows(look, skull, fine=fine), *hair(look, skull, fine=fine), *hat_parts(look, skull)]
    return parts + glasses(skull, fine=fine) if look.glasses else parts


def _shade(colour: Colour, red: float, green: float, blue: float) -> Colour:
    r, g, b = (int(np.clip(v * f, 0, 255)) for v, f in zip(colour, (red, green, blue), strict=True))
    return r, g, b


def _face(look: Appearance, skull: _Skull) -> BodyPart:
    """Return the skull, tinted at lips, cheeks and eye sockets; the chin follows the jaw joint."""
    angles = np.linspace(0, 2 * np.pi, _SIDES, endpoint=False)
    points = np.array([[skull.at(share, a) for a in angles] for share in _SKULL[:, 0]])
    count = len(_SKULL)
    faces = []
    for k in range(count - 1):
        for i in range(_SIDES):
            j = (i + 1) % _SIDES
            a, b, c, d = k * _SIDES + i, k * _SIDES + j, (k + 1) * _SIDES + j, (k + 1) * _SIDES + i
            faces += [(a, b, c), (a, c, d)]
    vertices = points.reshape(-1, 3)
    skin = np.tile(np.asarray(look.skin, np.float64), (len(vertices), 1))
    share = np.repeat(_SKULL[:, 0], _SIDES)
    y = vertices[:, 1] / skull.size
    ahead = vertices[:, 0] > 0.2 * skull.size
    lips = ahead & (np.abs(share - 0.20) < 0.02) & (np.abs(y) < 0.10)
    skin[lips] = _shade(look.skin, 0.78, 0.58, 0.56)
    sockets = ahead & (np.abs(share - 0.52) < 0.02) & (np.abs(y) > 0.06) & (np.abs(y) < 0.28)
    skin[sockets] = _shade(look.skin, 0.86, 0.82, 0.80)
    cheeks = ahead & (np.abs(share - 0.38) < 0.06) & (np.abs(y) > 0.12) & (np.abs(y) < 0.27)
    skin[cheeks] = _shade(look.skin, 1.0, 0.94, 0.92)
    if look.beard:
        chin = (share < 0.29) & (vertices[:, 0] > -0.02 * skull.size) & ~lips
        skin[chin] = look.hair_colour
    weights = np.tile(dense({J["head"]: 1.0}), (len(vertices), 1))
    jaw = (np.clip((0.22 - share) / 0.08, 0, 1) * (vertices[:, 0] > 0.1 * skull.size))[:, None]
    weights = weights * (1 - jaw) + jaw * dense({J["jaw"]: 1.0})
    return with_normals(BodyPart(vertices, np.array(faces), skin, weights))


def _features(look: Appearance, skull: _Skull) -> list[BodyPart]:
    size, head = skull.size, {J["head"]: 1.0}
    wide = 1.0 + 0.25 * look.ancestry[0] / sum(look.ancestry)
    nose = []
    for share, out, half in (
        (0.56, 0.385, 0.022),
        (0.48, 0.415, 0.030),
        (0.40, 0.455, 0.038),
        (0.345, 0.492, 0.052),
        (0.315, 0.445, 0.060),
        (0.295, 0.40, 0.04),
    ):
        centre = (0.37 * size, 0.0, skull.chin + share * size)
        nose.append(LoftRing(centre, (out - 0.37) * size, 0.03 * size, half * wide * size, head, look.skin, 1.7))
    parts = [loft(nose, sides=8, close_start=True, close_end=True)]
    for side, left in (("left", 1.0), ("right", -1.0)):
        eye = {J[f"{side}_eye"]: 1.0}
        middle = skull.at(0.525, left * 0.46)
        inset = np.array([0.028 * size, 0, 0])
        parts.append(
            blob(middle - inset, np.array([0.040, 0.056, 0.028]) * size, eye, (236, 232, 228), sides=8, rings=4)
        )
        iris = middle + np.array([0.004 * size, -left * 0.003 * size, 0])
        parts.append(
            blob(
                iris - inset * 0.1,
                np.array([0.016, 0.022, 0.024]) * size,
                eye,
                _shade(look.eyes, 0.6, 0.6, 0.6),
                sides=6,
                rings=4,
            )
        )
        lid = middle + np.array([-0.010, 0, 0.026]) * size
        parts.append(
            blob(
                lid, np.array([0.034, 0.060, 0.012]) * size, head, _shade(look.skin, 0.72, 0.66, 0.64), sides=8, rings=3
            )
        )
        ear = skull.at(0.46, left * 1.66)
        parts.append(
            blob(
                ear + np.array([0, left * 0.012, 0]) * size,
                np.array([0.075, 0.030, 0.120]) * size,
                head,
                _shade(look.skin, 0.96, 0.88, 0.86),
                sides=7,
                rings=5,
            )
        )
    mouth = [skull.at(0.195, a, 0.004) for a in (-0.27, -0.12, 0.0, 0.12, 0.27)]
    lips = [
        LoftRing(
            p, r * size, r * size, 0.012 * size, {J["head"]: 0.6, J["jaw"]: 0.4}, _shade(look.skin, 0.74, 0.52, 0.50)
        )
        for p, r in zip(mouth, (0.006, 0.018, 0.020, 0.018, 0.006), strict=True)
    ]
    parts.append(loft(lips, sides=6, forward=(0, 0, 1), close_start=True, close_end=True))
    return parts
