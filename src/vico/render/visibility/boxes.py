"""Where upright boxes at walls, such as doors and shop fronts, come to lie in a picture."""

from __future__ import annotations

from typing import Any, NamedTuple

from vico.render.compiled import inlined


class BoxInPicture(NamedTuple):
    """The rectangle around a box's corners, in pixels, and the least and the greatest depth of them, metres."""

    left: float
    right: float
    top: float
    bottom: float
    nearest: float
    farthest: float


@inlined
def box_in_picture(place: Any, across: Any, inward: Any, camera: Any) -> Any:
    """Return where a box comes to lie whose corners are so far from a place.

    Parameters
    ----------
    place
        What has `x`, `y`, `z`, `height`, and a unit vector `inward_x`, `inward_y`; ENU metres.
    across, inward
        First and last distance along the wall and into it, metres.
    """
    left, right, top, bottom, nearest, farthest = 1e30, -1e30, 1e30, -1e30, 1e30, -1e30
    for corner in range(8):
        a = across[1] if corner & 1 else across[0]
        b = inward[1] if corner & 2 else inward[0]
        dx = place.x + a * place.inward_y + b * place.inward_x - camera.x
        dy = place.y - a * place.inward_x + b * place.inward_y - camera.y
        dz = place.z + (place.height if corner & 4 else 0.0) - camera.z
        depth = dx * camera.forward_x + dy * camera.forward_y + dz * camera.forward_z
        nearest, farthest = min(nearest, depth), max(farthest, depth)
        scale = camera.focal / max(depth, float(camera.near))
        x = camera.centre_x + scale * (dx * camera.right_x + dy * camera.right_y + dz * camera.right_z)
        y = camera.centre_y + scale * (dx * camera.down_x + dy * camera.down_y + dz * camera.down_z)
        left, right, top, bottom = min(left, x), max(right, x), min(top, y), max(bottom, y)
    return BoxInPicture(left, right, top, bottom, nearest, farthest)
