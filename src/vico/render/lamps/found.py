"""Which of a world's things shine on their surroundings: heads of street lamps, and shop windows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.exact import apply_matrix
from vico.render.records import LAMP
from vico.world.mesh import Material, Surface

#: Kinds of things whose bright parts shine.
LAMP_KINDS = ("street_lamp", "lamp", "lantern")
#: What shines in them.
HEAD = Material("lamp head", emission=1.0)
# A part shines that is at least this bright in each channel, sRGB, and this far up, metres.
_BRIGHT, _UP = 190, 1.8
# Light below a lamp, whatever its height, 1 = a sunny wall's; and how far it reaches, in its heights and metres.
_BELOW, _HEIGHTS, _FARTHEST = 0.72, 3.4, 24.0
# Shop windows: metres from one point that shines to the next along a front, before the pane, and above its foot; light
# of each, and how far it reaches, metres.
_APART, _BEFORE, _ABOVE, _SHOP_LIGHT, _SHOP_REACH = 4.0, 0.5, 2.0, 1.8, 9.0
_TALL = 1.8


def with_lit_heads(surfaces: Sequence[Surface]) -> list[Surface]:
    """Return a lamp's model with bright parts high up that shine; as it is where something in it does already."""
    if any(surface.material.emission > 0.0 for surface in surfaces):
        return list(surfaces)
    found: list[Surface] = []
    for surface in surfaces:
        corners = surface.triangles
        bright = (surface.colour[corners].min(axis=(1, 2)) >= _BRIGHT) & (
            surface.positions[corners][:, :, 2].min(axis=1) >= _UP
        )
        if bright.any():
            found.append(replace(surface, triangles=corners[bright], material=HEAD))
            surface = replace(surface, triangles=corners[~bright])
        if len(surface.triangles):
            found.append(surface)
    return found


def lamps_placed(
    models: Mapping[str, Sequence[Surface]], names: Sequence[str], transforms: NDArray[np.float64]
) -> NDArray[np.void]:
    """Return the `LAMP` of each placed model that shines; transforms are model to world, shape ``(n, 4, 4)``."""
    heads = {name: _head(models[name]) for name in set(names)}
    found = [(heads[name], transform) for name, transform in zip(names, transforms, strict=True)]
    shining = [(head, transform) for head, transform in found if head is not None]
    lamps = np.zeros(len(shining), LAMP)
    for lamp, (head, transform) in zip(lamps, shining, strict=True):
        place, is_globe = head
        height = float(place[2] * transform[2, 2])
        # Just below the head, or it would shine into itself alone.
        lamp["x"], lamp["y"], lamp["z"] = apply_matrix(place, transform[:3, :3]) + transform[:3, 3]
        # A globe shines all around, else the ground gets most.
        lamp["axis_z"], lamp["spread"], lamp["share"] = -1.0, (0.3 if is_globe else 1.1), (0.7 if is_globe else 0.3)
        # Bright below and even around: the lamp's light is spread over its height's square.
        lamp["size"] = 0.6 * height**2
        lamp["power"] = _BELOW * (height**2 + lamp["size"])
        lamp["inverse_reach"] = 1.0 / min(_HEIGHTS * height, _FARTHEST) ** 2
    return lamps


def _head(surfaces: Sequence[Surface]) -> tuple[NDArray[np.float64], bool] | None:
    """Return where a model shines, and whether it does so all around."""
    shining = [s.positions[s.triangles].reshape(-1, 3) for s in surfaces if s.material.emission > 0.0]
    if not shining:
        return None
    points = np.concatenate(shining).astype(np.float64)
    low, high = points.min(axis=0), points.max(axis=0)
    return (low + high) / 2, bool(high[2] - low[2] > 0.2)


def shop_lamps(static: Iterable[Surface], materials: ArrayLike) -> NDArray[np.void]:
    """Return `LAMP` before the windows of shops: points along the lower edges of surfaces of these materials."""
    wanted = tuple(np.atleast_1d(np.asarray(materials)).tolist())
    found = [_before_panes(s) for s in static if s.material.name.startswith(wanted)]
    return np.concatenate(found) if found else np.zeros(0, LAMP)


def _before_panes(surface: Surface) -> NDArray[np.void]:
    corners = surface.positions[surface.triangles].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    entity = surface.entity[surface.triangles[:, 0]]
    order = np.argsort(corners[:, :, 2], axis=1)
    corners = np.take_along_axis(corners, order[:, :, None], axis=1)
    # Of each wall's two triangles, the one that stands on its edge.
    low, other, top = corners[:, 0], corners[:, 1], corners[:, 2]
    stands = (abs(normal[:, 2]) < 0.1) & (top[:, 2] - low[:, 2] > _TALL) & (other[:, 2] - low[:, 2] < 0.5)
    lamps: list[NDArray[np.void]] = []
    for a, b, out, owner in zip(low[stands], other[stands], normal[stands], entity[stands], strict=True):
        number = max(round(float(np.hypot(*(b - a)[:2])) / _APART), 1)
        if np.hypot(*(b - a)[:2]) < 1.0:
            continue
        share = (np.arange(number) + 0.5)[:, None] / number
        place = a + share * (b - a) + _BEFORE * out
        row = np.zeros(number, LAMP)
        row["x"], row["y"], row["z"] = place[:, 0], place[:, 1], place[:, 2] + _ABOVE
        row["axis_x"], row["axis_y"], row["axis_z"] = 0.85 * out[0], 0.85 * out[1], -0.53
        row["spread"], row["share"], row["size"] = 0.9, 0.15, 2.5
        row["power"], row["inverse_reach"], row["entity"] = _SHOP_LIGHT, 1.0 / _SHOP_REACH**2, owner
        lamps.append(row)
    return np.concatenate(lamps) if lamps else np.zeros(0, LAMP)
