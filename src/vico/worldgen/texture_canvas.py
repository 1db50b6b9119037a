"""Painted textures: a canvas to paint them on, and the cache where they are kept as the files that worlds hold.

A canvas has rectangles, strokes and periodic noise on float arrays, with a layer of own light. A picture is painted
and packed once, then read: all tiles of a city and all worlds that are built later use the same facades, roofs and
pavings.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.io.cache import cache_folder
from vico.io.files import write_bytes
from vico.io.sources import source_digest
from vico.world.glb import packed_png

Colour = Sequence[float] | NDArray[Any]


class Canvas:
    """A picture under construction, float32 0..255, y pointing up, with the light each texel gives at night.

    Attributes
    ----------
    pixels
        sRGB, shape ``(h, w, 3)``.
    glow
        Share of its colour a texel shines with at night, 0..255, shape ``(h, w)``.
    random
        Where all chance comes from.
    """

    def __init__(self, height: int, width: int, colour: Colour, random: np.random.Generator) -> None:
        self.pixels = np.empty((height, width, 3), np.float32)
        self.pixels[:] = colour
        self.glow = np.zeros((height, width), np.float32)
        self.random = random

    def rect(
        self, x0: float, y0: float, x1: float, y1: float, colour: Colour, opacity: float = 1.0, glow: float = 0.0
    ) -> None:
        """Fill a rectangle, pixels from the lower left corner; an opaque one hides the light behind it."""
        a, b, c, d = (max(round(v), 0) for v in (x0, y0, x1, y1))
        view = self.pixels[b:d, a:c]
        view += (np.asarray(colour, np.float32) - view) * opacity
        if opacity >= 1.0:
            self.glow[b:d, a:c] = glow

    def shade(self, x0: float, y0: float, x1: float, y1: float, factor: float) -> None:
        """Darken or lighten a rectangle."""
        a, b, c, d = (max(round(v), 0) for v in (x0, y0, x1, y1))
        self.pixels[b:d, a:c] *= factor

    def stroke(self, x0: float, y0: float, x1: float, y1: float, width: float, colour: Colour) -> None:
        """Draw a slanting bar, its long edges smoothed."""
        half = width / 2
        a, c = max(int(min(x0, x1) - half), 0), int(max(x0, x1) + half) + 1
        b, d = max(int(min(y0, y1) - half), 0), int(max(y0, y1) + half) + 1
        y, x = np.mgrid[b : min(d, self.pixels.shape[0]), a : min(c, self.pixels.shape[1])]
        length = max(float(np.hypot(x1 - x0, y1 - y0)), 1e-6)
        ux, uy = (x1 - x0) / length, (y1 - y0) / length
        along = (x - x0) * ux + (y - y0) * uy
        across = np.abs((y - y0) * ux - (x - x0) * uy)
        cover = np.clip(half + 0.5 - across, 0, 1) * ((along >= 0) & (along <= length))
        view = self.pixels[b:d, a:c]
        view += (np.asarray(colour, np.float32) - view) * cover[..., None].astype(np.float32)
        self.glow[b:d, a:c][cover > 0.5] = 0.0

    def arch(self, x0: float, y0: float, x1: float, y1: float, colour: Colour, *, opacity: float = 1.0) -> None:
        """Fill an upright shape with a half-round head; `y1` is its top."""
        inside, view, glow = self.inside_arch(x0, y0, x1, y1)
        view[inside] += (np.asarray(colour, np.float32) - view[inside]) * opacity
        if opacity >= 1.0:
            glow[inside] = 0.0

    def inside_arch(
        self, x0: float, y0: float, x1: float, y1: float, *, pointed: bool = False
    ) -> tuple[NDArray[np.bool_], NDArray[np.float32], NDArray[np.float32]]:
        """Mask the texels of a shape with a round (or pointed) head; with views of colours and light around it."""
        a, b, c, d = (max(round(v), 0) for v in (x0, y0, x1, y1))
        y, x = np.mgrid[b:d, a:c]
        radius = (x1 - x0) / 2
        if pointed:
            spring = y1 - radius * 1.73
            head = (np.hypot(x - x0, y - spring) < 2 * radius) & (np.hypot(x - x1, y - spring) < 2 * radius)
        else:
            spring = y1 - radius
            head = np.hypot(x + 0.5 - (x0 + x1) / 2, y - spring) < radius
        return (y < spring) | head, self.pixels[b:d, a:c], self.glow[b:d, a:c]

    def noise(self, strength: float, cells: int, ratio: int = 1) -> None:
        """Add periodic noise: `cells` knots across the picture (`ratio` times as many up), smoothly joined."""
        self.pixels += periodic_noise(self.pixels.shape[:2], cells, self.random, ratio)[..., None] * strength

    def grain(self, strength: float) -> None:
        """Add noise from pixel to pixel."""
        noise = self.random.standard_normal(self.pixels.shape[:2], dtype=np.float32)
        self.pixels += (noise * np.float32(strength))[..., None]

    def texture(self) -> NDArray[np.uint8]:
        """Return the picture as `Material.texture` has it: row 0 at the bottom, alpha where something glows."""
        colour = np.clip(np.round(self.pixels), 0, 255).astype(np.uint8)
        if not self.glow.any():
            return colour
        return np.concatenate([colour, np.clip(np.round(self.glow), 0, 255).astype(np.uint8)[..., None]], axis=2)


def periodic_noise(
    shape: tuple[int, ...], cells: int, random: np.random.Generator, ratio: int = 1
) -> NDArray[np.float32]:
    """Smooth noise about 0 that repeats at the picture's borders, standard deviation about 0.6."""
    height, width = shape[0], shape[1]
    rows = max(cells * ratio * height // width, 1)
    knots = random.normal(0, 1, (rows, cells)).astype(np.float32)

    def axis(n: int, k: int) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float32]]:
        place = (np.arange(n) + 0.5) * k / n
        low = np.floor(place).astype(np.int64)
        part = (place - low).astype(np.float32)
        return low % k, (low + 1) % k, part * part * (3 - 2 * part)

    y0, y1, fy = axis(height, rows)
    x0, x1, fx = axis(width, cells)
    rowwise = knots[:, x0] * (1 - fx) + knots[:, x1] * fx
    return np.asarray(rowwise[y0] * (1 - fy)[:, None] + rowwise[y1] * fy[:, None], np.float32)


# ------------------------------------------------------------------------------------------------------------ stuffs


def plaster(height: int, width: int, random: np.random.Generator, base: Colour = (212, 210, 206)) -> Canvas:
    """Smooth render with faint clouds."""
    canvas = Canvas(height, width, base, random)
    canvas.noise(3.5, 6)
    canvas.noise(2.5, max(width // 26, 8))
    canvas.grain(1.2)
    return canvas


def bricks(
    height: int,
    width: int,
    random: np.random.Generator,
    course: int = 16,
    length: int = 32,
    base: Colour = (158, 104, 86),
) -> Canvas:
    """Paint running bond, in its own red: a vertex colour that reddens grey bricks would redden panes as well."""
    canvas = Canvas(height, width, base, random)
    rows, columns = height // course, width // length
    tone = random.normal(0, 1, (rows, columns)).astype(np.float32) * 11
    y, x = np.mgrid[0:height, 0:width]
    row = y // course
    shifted = (x + (row % 2) * (length // 2)) % width
    canvas.pixels += tone[row, shifted // length][..., None]
    thick = 2 if course >= 12 else 1
    joint = (y % course < thick) | (shifted % length < thick)
    canvas.pixels[joint] += (np.array((176, 152, 138), np.float32) - canvas.pixels[joint]) * (0.9 if thick > 1 else 0.5)
    canvas.noise(4, 8)
    canvas.grain(2)
    return canvas


def blocks(
    height: int,
    width: int,
    random: np.random.Generator,
    course: int,
    length: int,
    base: Colour = (214, 211, 206),
    joint: float = 0.78,
) -> Canvas:
    """Dressed stone with fine joints."""
    canvas = Canvas(height, width, base, random)
    rows, columns = height // course, width // length
    tone = random.normal(0, 1, (rows, columns)).astype(np.float32) * 5
    y, x = np.mgrid[0:height, 0:width]
    row = y // course
    shifted = (x + (row % 2) * (length // 2)) % width
    canvas.pixels += tone[row, shifted // length][..., None]
    thick = 3 if course >= 32 else 1
    canvas.pixels[(y % course < thick) | (shifted % length < thick)] *= joint
    canvas.pixels[(y % course == thick)] *= 1.05
    canvas.noise(4, 10)
    canvas.noise(2.5, max(width // 12, 8))
    canvas.grain(1.6)
    return canvas


Picture = NDArray[np.uint8]

# Folders that are kept: states of the sources and data between which one goes to and fro.
_KEPT_FOLDERS = 4


@dataclass(frozen=True)
class TextureCache:
    """Pictures that one module paints.

    Parameters
    ----------
    file, module
        The module: what it and all that it imports say decides what its pictures look like.
    """

    file: str
    module: str

    def picture(self, name: str, paint: Callable[[], Picture], *, data: str = "") -> tuple[Picture, bytes]:
        """Return a picture and its PNG file, from the cache if it is there, else painted and kept.

        Parameters
        ----------
        name
            That no other picture of the module has.
        paint
            Paints it: the same picture whenever it is called.
        data
            A digest of the data files by which it is painted.
        """
        path = self._folder(data) / f"{hashlib.sha256(name.encode()).hexdigest()[:24]}.png"
        kept = _read_picture(path)
        if kept is None:
            texture = paint()
            kept = texture, packed_png(texture)
            # A cache that can't be written costs time, nothing else.
            with contextlib.suppress(OSError):
                _make_room(path.parent)
                write_bytes(path, kept[1])
        return kept

    def _folder(self, data: str) -> Path:
        made_by = [source_digest(Path(self.file), self.module), data, np.__version__, _packer_digest()]
        key = hashlib.sha256(json.dumps(made_by).encode()).hexdigest()[:24]
        return cache_folder() / "textures" / f"{self.module}-{key}"


@lru_cache(maxsize=1)
def _packer_digest() -> str:
    """Return a digest of how pictures are packed here: libraries of other versions and builds make other bytes."""
    y, x = np.mgrid[0:128, 0:128]
    probe = np.stack([x * y, x ^ y, x + 3 * y], axis=2).astype(np.uint8)
    return hashlib.sha256(packed_png(probe)).hexdigest()


def _read_picture(path: Path) -> tuple[Picture, bytes] | None:
    """Return a kept picture and its file; None if it is absent or damaged, so that it is painted anew."""
    try:
        packed = path.read_bytes()
        with Image.open(io.BytesIO(packed), formats=["PNG"]) as image:
            return np.asarray(image), packed
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        return None


def _make_room(folder: Path) -> None:
    """Make a folder if it is not there, and let go of those of the same module that were made long before it."""
    if folder.is_dir():
        return
    module = folder.name.rpartition("-")[0]
    others = sorted(folder.parent.glob(f"{module}-*"), key=lambda path: path.stat().st_mtime)
    for old in others[: 1 - _KEPT_FOLDERS]:
        shutil.rmtree(old, ignore_errors=True)
    folder.mkdir(parents=True, exist_ok=True)
