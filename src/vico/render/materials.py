"""Materials by number, with all their textures in one array of packed texels and their mip levels.

Scenes of one city share a palette.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.errors import InputError
from vico.io.compiled import compiled
from vico.render.records import CUTOUT, DOUBLE_SIDED, MATERIAL
from vico.threads import for_each
from vico.world.mesh import Material

LEVELS = 13  # up to 4096 texels a side
_STRIP = 256  # rows, even


class Textures(NamedTuple):
    """Materials and texels as arrays.

    Attributes
    ----------
    texels
        ``r | g << 8 | b << 16 | a << 24``, uint32.
    start
        First texel of a material's mip level, int64, shape ``(m, LEVELS)``; levels past the last repeat it.
    materials
        `MATERIAL`, shape ``(m,)``.
    """

    texels: NDArray[np.uint32]
    start: NDArray[np.int64]
    materials: NDArray[np.void]

    @property
    def double_sided(self) -> NDArray[np.bool_]:
        """Which materials are seen from both sides, shape ``(m,)``."""
        return (self.materials["flags"] & DOUBLE_SIDED) != 0


def pack_textures(materials: Sequence[Material]) -> Textures:
    """Lay the textures of all materials out for the shader."""
    n = max(len(materials), 1)
    start = np.zeros((n, LEVELS), np.int64)
    records = np.zeros(n, MATERIAL)
    # One array from the start: joining the levels at the end would take the memory of a photographed city twice.
    textures = {id(m.texture): m.texture for m in materials if m.texture is not None}.values()
    count = 1 + sum(_texel_count(*_sides(*texture.shape[:2])) for texture in textures)
    texels = np.full(count, 0xFFFFFFFF, np.uint32)
    position = 1
    known: dict[int, int] = {}
    for index, material in enumerate(materials):
        record = records[index]
        record["flags"] = CUTOUT * material.cutout | DOUBLE_SIDED * material.double_sided
        record["emission"] = material.emission
        if material.texture is None:
            continue
        same = known.setdefault(id(material.texture), index)
        if same != index:
            start[index] = start[same]
            for name in ("log2_width", "log2_height", "levels"):
                record[name] = records[same][name]
            continue
        height, width = _sides(*material.texture.shape[:2])
        record["log2_width"], record["log2_height"] = width.bit_length() - 1, height.bit_length() - 1
        record["levels"] = max(height, width).bit_length()
        start[index] = position + _level_starts(height, width)
        position += _texel_count(height, width)

    def fill(index: int) -> None:
        _write_levels(materials[index], texels, start[index])

    for_each(fill, known.values())
    return Textures(texels, start, records)


def _sides(height: int, width: int) -> tuple[int, int]:
    """Sides of a texture's finest level: powers of two, no larger than there are levels for."""
    tall, wide = (min(1 << max(side - 1, 0).bit_length(), 1 << (LEVELS - 1)) for side in (height, width))
    return tall, wide


def _level_sizes(height: int, width: int) -> list[int]:
    """Texels of each level of a texture with these sides."""
    return [max(height >> k, 1) * max(width >> k, 1) for k in range(max(height, width).bit_length())]


def _texel_count(height: int, width: int) -> int:
    """Texels of all levels of a texture."""
    return sum(_level_sizes(height, width))


def _level_starts(height: int, width: int) -> NDArray[np.int64]:
    """Where the levels begin after the first texel; levels past the last repeat it."""
    starts = np.cumsum([0, *_level_sizes(height, width)[:-1]])
    return np.concatenate([starts, np.full(LEVELS - len(starts), starts[-1])])


def _write_levels(material: Material, texels: NDArray[np.uint32], start: NDArray[np.int64]) -> None:
    """Write a texture and its coarser levels where each starts."""
    pixels = material.texture
    if pixels is None or pixels.ndim != 3 or pixels.shape[2] not in (3, 4) or pixels.dtype != np.uint8:
        raise InputError(f"material {material.name}: a texture must be uint8 of shape (h, w, 3) or (h, w, 4)")
    height, width = _sides(*pixels.shape[:2])
    if (height, width) != pixels.shape[:2]:
        pixels = np.asarray(Image.fromarray(pixels).resize((width, height), Image.Resampling.LANCZOS))
    if pixels.shape[2] == 3:
        pixels = np.concatenate([pixels, np.full((*pixels.shape[:2], 1), 255, np.uint8)], axis=2)
    finest = np.ascontiguousarray(pixels).view("<u4").ravel()
    texels[start[0] : start[0] + finest.size] = finest
    opaque = float((pixels[..., 3] >= 128).mean())
    light, alpha = None, None
    for first in start[1 : max(height, width).bit_length()]:
        if light is None or alpha is None:
            # In strips of rows: as numbers a page of photos would take a gigabyte.
            strips = [_coarser(*_linear(pixels[k : k + _STRIP]), material.cutout) for k in range(0, height, _STRIP)]
            light, alpha = (np.concatenate(parts) for parts in zip(*strips, strict=True))
        else:
            light, alpha = _coarser(light, alpha, material.cutout)
        gain = 1.0
        if material.cutout:
            # Holes must keep their share of the area, or foliage thins out with distance.
            limit = float(np.quantile(alpha, 1 - opaque)) if 0 < opaque < 1 else 0.5
            gain = 0.5 / max(limit, 1e-3)
        _pack(light, alpha, np.float32(gain), texels[first:])


_LINEAR = np.square(np.arange(256, dtype=np.float32) / np.float32(255))


def _linear(pixels: NDArray[np.uint8]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Colour in (roughly) linear light, and alpha."""
    return _LINEAR[pixels[..., :3]], pixels[..., 3].astype(np.float32) / np.float32(255)


@compiled(nogil=True)
def _coarser(light, alpha, cutout):
    """Halve a level: averages in linear light; where alpha means holes of opaque texels alone: leaves keep theirs."""
    tall, wide = min(alpha.shape[0], 2), min(alpha.shape[1], 2)
    height, width = alpha.shape[0] // tall, alpha.shape[1] // wide
    new_light = np.empty((height, width, 3), np.float32)
    new_alpha = np.empty((height, width), np.float32)
    half = np.float32(0.5)
    for i in range(height):
        for j in range(width):
            # A side of one texel meets itself.
            i0, j0 = i * tall, j * wide
            i1, j1 = i0 + tall - 1, j0 + wide - 1
            a, b, c, d = alpha[i0, j0], alpha[i1, j0], alpha[i0, j1], alpha[i1, j1]
            new_alpha[i, j] = ((a + b) * half + (c + d) * half) * half
            if cutout:
                least = np.float32(1e-3)
                a, b, c, d = max(a, least), max(b, least), max(c, least), max(d, least)
            else:
                a = b = c = d = np.float32(1.0)
            weight = ((a + b) * half + (c + d) * half) * half
            for k in range(3):
                first = (light[i0, j0, k] * a + light[i1, j0, k] * b) * half
                second = (light[i0, j1, k] * c + light[i1, j1, k] * d) * half
                new_light[i, j, k] = (first + second) * half / weight
    return new_light, new_alpha


@compiled(nogil=True)
def _pack(light, alpha, gain, texels):
    """Write a level as packed sRGB texels; `gain` multiplies alpha."""
    zero, one, most = np.float32(0.0), np.float32(1.0), np.float32(255.0)
    k = 0
    for i in range(alpha.shape[0]):
        for j in range(alpha.shape[1]):
            texel = np.uint32(np.rint(min(max(alpha[i, j] * gain, zero), one) * most)) << np.uint32(24)
            for c in range(3):
                value = np.uint32(np.rint(np.sqrt(min(max(light[i, j, c], zero), one)) * most))
                texel |= value << np.uint32(8 * c)
            texels[k] = texel
            k += 1


_PLAIN = [field.name for field in fields(Material) if field.name != "texture"]


class Palette:
    """Numbers for materials: those that look the same share one.

    Where scenes share a palette, those made later find the textures of those made before in memory. A scene keeps the
    textures that there were when it was made.
    """

    def __init__(self) -> None:
        self._entries: list[Material] = []
        self._known: dict[tuple[object, ...], int] = {}
        self._packed: Textures | None = None

    @property
    def names(self) -> list[str]:
        """Names of all materials so far."""
        return [material.name for material in self._entries]

    def number(self, material: Material) -> int:
        """Return a material's number; it gets one where it has none yet."""
        # The picture is known by its object, which stays: its material is kept.
        key = (id(material.texture), *(getattr(material, name) for name in _PLAIN))
        if key not in self._known:
            self._known[key] = len(self._entries)
            self._entries.append(material)
            self._packed = None
        return self._known[key]

    def pack(self) -> Textures:
        """Return the textures of all materials so far; the same arrays until there is another one."""
        if self._packed is None:
            self._packed = pack_textures(self._entries)
        return self._packed
