"""What is drawn into, and what is read back of it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.render.compiled import kernel
from vico.render.uniforms import Record

_NOBODY = 1
# Keys have spare places behind a picture's last pixel.
_SPARE = 64
# The sky is this far away, metres: only turning moves it.
_SKY = 1e7


class Seen(NamedTuple):
    """A picture and what comes after shading looks at.

    Attributes
    ----------
    rgb
        uint8, shape ``(h, w, 3)``.
    glass
        How much of what is behind is seen through each pixel, of 255, uint8, shape ``(h * w,)``.
    keys
        As the visibility pass leaves them, uint64: the inverse depth's bits, then who is seen.
    """

    rgb: NDArray[np.uint8]
    glass: NDArray[np.uint8]
    keys: NDArray[np.uint64]


class Target:
    """A frame buffer with all outputs; its first row is the picture's upper one.

    Parameters
    ----------
    gl
        The context.
    width, height
        Pixels.
    with_past
        Whether it takes where points were.
    """

    def __init__(self, gl: Any, width: int, height: int, with_past: bool) -> None:
        size = width, height
        self._shape = height, width
        self._colours = gl.texture(size, 4, dtype="f1")
        self._depth = gl.texture(size, 1, dtype="f4")
        self._entity = gl.texture(size, 1, dtype="i4")
        self._normals = gl.texture(size, 4, dtype="f4")
        planes = [self._colours, self._depth, self._entity, self._normals]
        if with_past:
            self._places = gl.texture(size, 4, dtype="f4")
            planes.append(self._places)
        for plane in planes:
            plane.filter = gl.NEAREST, gl.NEAREST
        self._read_colours = np.empty((height * width, 4), np.uint8)
        self._buffer = gl.framebuffer(planes, gl.depth_texture(size))

    def clear(self) -> None:
        """Draw into it from here on, from nothing."""
        self._buffer.use()
        self._buffer.clear(depth=1.0)

    def depth(self, into: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
        """Return depths, metres, shape ``(h, w)``; 0 for the sky."""
        return self._read(self._depth, np.empty(self._shape, np.float32) if into is None else into)

    def entities(self, into: NDArray[np.int32] | None = None) -> NDArray[np.int32]:
        """Return who is seen, shape ``(h, w)``."""
        return self._read(self._entity, np.empty(self._shape, np.int32) if into is None else into)

    def normals(self) -> NDArray[np.float32]:
        """Return normals, shape ``(h, w, 3)``."""
        return self._read(self._normals, np.empty((*self._shape, 4), np.float32))[..., :3]

    def places(self, depth: NDArray[np.float32], camera: Record) -> NDArray[np.float64]:
        """Return where points were, from where the eye was, shape ``(h, w, 3)``; NaN where that is not known."""
        found = self._read(self._places, np.empty((*self._shape, 4), np.float32)).astype(np.float64)
        return _with_sky(np.where(found[..., 3:] > 0.5, found[..., :3], np.nan), depth, camera)

    def seen(self, depth: NDArray[np.float32], entity: NDArray[np.int32]) -> Seen:
        """Return the picture, given the depths and who is seen in it."""
        size = self._shape[0] * self._shape[1]
        colours = self._read(self._colours, self._read_colours)
        seen = Seen(np.empty((*self._shape, 3), np.uint8), np.empty(size, np.uint8), np.zeros(size + _SPARE, np.uint64))
        halves = seen.keys.view(np.uint32), seen.keys.view(np.float32)
        _unpack(colours, depth.reshape(-1), entity.reshape(-1), seen.rgb.reshape(-1, 3), seen.glass, *halves)
        return seen

    def _read(self, plane: Any, into: NDArray[Any]) -> NDArray[Any]:
        plane.read_into(into)
        return into


@kernel
def _unpack(colours: Any, depth: Any, entity: Any, rgb: Any, glass: Any, whole: Any, real: Any) -> None:
    """Write a picture's pixels and keys; `whole` and `real` are the keys' halves, the lower one first."""
    for i in range(len(depth)):
        rgb[i, 0], rgb[i, 1], rgb[i, 2] = colours[i, 0], colours[i, 1], colours[i, 2]
        glass[i] = colours[i, 3]
        if depth[i] > 0.0:
            real[2 * i + 1] = np.float32(1.0) / depth[i]
            whole[2 * i] = max(entity[i], _NOBODY)


def _with_sky(places: NDArray[np.float64], depth: NDArray[np.float32], camera: Record) -> NDArray[np.float64]:
    """Return places with those of the sky, far away along each pixel's ray."""
    height, width = depth.shape
    right, down, forward = (
        np.array([float(camera[f"{name}_{part}"]) for part in "xyz"]) for name in ("right", "down", "forward")
    )
    u = (np.arange(width) + 0.5 - float(camera["centre_x"])) / float(camera["focal"])
    v = (np.arange(height) + 0.5 - float(camera["centre_y"])) / float(camera["focal"])
    ray = forward + u[None, :, None] * right + v[:, None, None] * down
    return np.where(depth[..., None] > 0.0, places, _SKY * ray)
