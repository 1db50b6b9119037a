"""Textures of a city as layers of a few texture arrays: one material then draws all walls of a tile in one call."""

from __future__ import annotations

import io
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.world.mesh import Material

#: Height and width of each array's layers, pixels: storeys of walls, strips of ground floors, patches that repeat.
SHAPES = ((256, 256), (512, 512), (512, 1024), (256, 2048))
#: Layer 0 of the first array is white: what has no texture of its own.
PLAIN = 0


@dataclass(frozen=True)
class Layer:
    """Where a material's texture is.

    Attributes
    ----------
    array
        Index into `SHAPES`.
    layer
        Index in that array, below 256.
    cutout
        Whether alpha means holes; else it is the share of the material's emission that a texel gives.
    colour
        Mean colour, sRGB 0..255, float64, shape ``(3,)``.
    """

    array: int
    layer: int
    cutout: bool
    colour: NDArray[np.float64]


_WHITE = Layer(0, PLAIN, False, np.full(3, 255.0))


@dataclass
class TextureLayers:
    """Collects textures; the same picture is kept once.

    Attributes
    ----------
    pictures
        Of each array, its layers: sRGB and alpha, uint8, shape ``(h, w, 4)``.
    """

    pictures: list[list[NDArray[np.uint8]]] = field(default_factory=lambda: [[] for _ in SHAPES])
    _known: dict[bytes, Layer] = field(default_factory=dict)
    # By the material itself, which is kept so that its number stays its own.
    _seen: dict[int, tuple[Material, Layer]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Begin with the white layer."""
        self.pictures[0].append(np.full((*SHAPES[0], 4), 255, np.uint8))

    def layer_of(self, material: Material) -> Layer:
        """Return where a material's texture is, adding it if it is new."""
        if material.texture is None:
            return _WHITE
        if id(material) not in self._seen:
            self._seen[id(material)] = material, self._layer_of(material)
        return self._seen[id(material)][1]

    def _layer_of(self, material: Material) -> Layer:
        assert material.texture is not None
        key = repr((material.texture.shape, material.cutout)).encode() + material.texture.tobytes()
        if key not in self._known:
            picture = _with_alpha(material)
            array = _array_for(*picture.shape[:2])
            if len(self.pictures[array]) >= 255:
                # More pictures than a byte can number: the mean colour is left of the rest.
                return Layer(0, PLAIN, False, picture[:, :, :3].reshape(-1, 3).mean(axis=0))
            self.pictures[array].append(_resized(picture, SHAPES[array]))
            solid = picture[:, :, 3] > 127 if material.cutout else np.ones(picture.shape[:2], np.bool_)
            colour = picture[solid][:, :3].mean(axis=0) if solid.any() else np.full(3, 128.0)
            self._known[key] = Layer(array, len(self.pictures[array]) - 1, material.cutout, colour)
        return self._known[key]

    def files(self) -> Iterable[tuple[dict[str, Any], bytes]]:
        """Yield every layer as a JPEG of its colours and, where its alpha says something, a PNG of that."""
        for array, layers in enumerate(self.pictures):
            for number, picture in enumerate(layers):
                yield {"array": array, "layer": number, "what": "colour"}, _encoded(picture[:, :, :3], "JPEG")
                if picture[:, :, 3].min() < 255:
                    yield {"array": array, "layer": number, "what": "alpha"}, _encoded(picture[:, :, 3], "PNG")


def _with_alpha(material: Material) -> NDArray[np.uint8]:
    texture = material.texture
    assert texture is not None
    if texture.shape[2] == 4:
        return texture
    alpha = np.full((*texture.shape[:2], 1), 255, np.uint8)
    return np.concatenate([texture, alpha], axis=2)


def _array_for(height: int, width: int) -> int:
    """Return the smallest array whose layers hold a picture; the last that is as wide for those that none holds."""
    for array, (tall, wide) in enumerate(SHAPES):
        if height <= tall and width <= wide:
            return array
    return len(SHAPES) - 1 if width > 2 * height else 2


def _resized(picture: NDArray[np.uint8], shape: tuple[int, int]) -> NDArray[np.uint8]:
    if picture.shape[:2] == shape:
        return np.ascontiguousarray(picture)
    size = shape[1], shape[0]
    # Colour and alpha apart: where alpha is 0 the colour still counts.
    colour = Image.fromarray(np.ascontiguousarray(picture[:, :, :3])).resize(size, Image.Resampling.BICUBIC)
    alpha = Image.fromarray(np.ascontiguousarray(picture[:, :, 3])).resize(size, Image.Resampling.BILINEAR)
    return np.dstack([np.asarray(colour), np.asarray(alpha)])


def _encoded(pixels: NDArray[np.uint8], form: str) -> bytes:
    out = io.BytesIO()
    options: dict[str, Any] = {"quality": 88, "subsampling": 0} if form == "JPEG" else {"compress_level": 3}
    Image.fromarray(np.ascontiguousarray(pixels)).save(out, form, **options)
    return out.getvalue()
