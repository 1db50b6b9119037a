"""All textures of a scene in one array of packed texels, with their mip levels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.errors import InputError
from vico.world.mesh import Material

LEVELS = 13  # up to 4096 texels a side
CUTOUT, DOUBLE_SIDED = 1, 2


class Textures(NamedTuple):
    """Materials and texels as arrays.

    Attributes
    ----------
    texels
        ``r | g << 8 | b << 16 | a << 24``, uint32.
    start
        First texel of a material's mip level, shape ``(m, LEVELS)``; levels past the last repeat it.
    size
        log2 of the width and the height of level 0, then the number of levels (0: no texture), shape ``(m, 3)``.
    flags
        Bits `CUTOUT` and `DOUBLE_SIDED`, shape ``(m,)``.
    emission
        Shape ``(m,)``.
    """

    texels: NDArray[np.uint32]
    start: NDArray[np.int64]
    size: NDArray[np.int32]
    flags: NDArray[np.uint8]
    emission: NDArray[np.float32]


def pack_textures(materials: Sequence[Material]) -> Textures:
    """Lay the textures of all materials out for the shader."""
    n = max(len(materials), 1)
    start = np.zeros((n, LEVELS), np.int64)
    size = np.zeros((n, 3), np.int32)
    flags = np.zeros(n, np.uint8)
    emission = np.zeros(n, np.float32)
    textures = {id(m.texture): m.texture.shape[:2] for m in materials if m.texture is not None}
    # One array from the start: joining the levels at the end would take the memory of a photographed city twice.
    texels = np.full(1 + sum(_texel_count(*sides) for sides in textures.values()), 0xFFFFFFFF, np.uint32)
    position = 1
    known: dict[int, int] = {}
    for index, material in enumerate(materials):
        flags[index] = CUTOUT * material.cutout | DOUBLE_SIDED * material.double_sided
        emission[index] = material.emission
        if material.texture is None:
            continue
        if id(material.texture) in known:
            same = known[id(material.texture)]
            start[index], size[index] = start[same], size[same]
            continue
        known[id(material.texture)] = index
        levels = _mip_levels(material)
        height, width = levels[0].shape[:2]
        size[index] = width.bit_length() - 1, height.bit_length() - 1, len(levels)
        for k in range(LEVELS):
            if k < len(levels):
                level = levels[k].astype(np.uint32)
                packed = level[..., 0] | level[..., 1] << 8 | level[..., 2] << 16 | level[..., 3] << 24
                texels[position : position + packed.size] = packed.ravel()
                start[index, k] = position
                position += packed.size
            else:
                start[index, k] = start[index, k - 1]
    return Textures(texels[:position], start, size, flags, emission)


def _sides(height: int, width: int) -> tuple[int, int]:
    """Sides of a texture's finest level: powers of two, no larger than there are levels for."""
    tall, wide = (min(1 << max(side - 1, 0).bit_length(), 1 << (LEVELS - 1)) for side in (height, width))
    return tall, wide


def _texel_count(height: int, width: int) -> int:
    """Texels of all levels of a texture."""
    height, width = _sides(height, width)
    return sum(max(height >> k, 1) * max(width >> k, 1) for k in range(max(height, width).bit_length()))


def _mip_levels(material: Material) -> list[NDArray[np.uint8]]:
    pixels = material.texture
    if pixels is None or pixels.ndim != 3 or pixels.shape[2] not in (3, 4) or pixels.dtype != np.uint8:
        raise InputError(f"material {material.name}: a texture must be uint8 of shape (h, w, 3) or (h, w, 4)")
    height, width = _sides(*pixels.shape[:2])
    if (height, width) != pixels.shape[:2]:
        pixels = np.asarray(Image.fromarray(pixels).resize((width, height), Image.Resampling.LANCZOS))
    if pixels.shape[2] == 3:
        pixels = np.concatenate([pixels, np.full((*pixels.shape[:2], 1), 255, np.uint8)], axis=2)
    levels = [pixels]
    # Averages are taken in (roughly) linear light, and where alpha means holes of opaque texels only, so that leaves
    # keep their colour.
    light: NDArray[Any] = (pixels[..., :3].astype(np.float32) / 255) ** 2
    alpha: NDArray[Any] = pixels[..., 3].astype(np.float32) / 255
    opaque = float((alpha >= 0.5).mean())
    while max(light.shape[:2]) > 1 and len(levels) < LEVELS:
        weight = np.maximum(alpha, 1e-3) if material.cutout else np.ones_like(alpha)
        total = _halved(weight)
        light = _halved(light * weight[..., None]) / total[..., None]
        alpha = _halved(alpha)
        coverage: NDArray[Any] = alpha
        if material.cutout:
            # Holes must keep their share of the area, or foliage thins out with distance.
            limit = float(np.quantile(alpha, 1 - opaque)) if 0 < opaque < 1 else 0.5
            coverage = np.clip(alpha * (0.5 / max(limit, 1e-3)), 0, 1)
        colour = np.sqrt(np.clip(light, 0, 1)) * 255
        levels.append(np.round(np.concatenate([colour, coverage[..., None] * 255], axis=2)).astype(np.uint8))
    return levels


def _halved(values: NDArray[Any]) -> NDArray[Any]:
    for axis in (0, 1):
        if values.shape[axis] > 1:
            even, odd = (slice(None),) * axis + (slice(0, None, 2),), (slice(None),) * axis + (slice(1, None, 2),)
            values = (values[even] + values[odd]) / 2
    return values
